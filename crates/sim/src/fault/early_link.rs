//! `early-link`: a link shows up before what is in between can carry frames.
//!
//! Some switches and slow devices report their link early. Each time the link comes up the ports open
//! their loops at once, and for a while every frame that is sent there vanishes: the whole line is
//! silent, not only what is behind it. No counter moves but that of the lost link before. It begins
//! with the device in between being switched on: the link goes down for `down_ms` first.

use linesman_config::fault::FaultName;

use super::source::ListedChanges;
use super::{Kind, Parameter, PlaceRule, Shape};
use crate::wire::Change;

pub(super) const KIND: Kind = Kind {
    name: FaultName::EarlyLink,
    place: PlaceRule::Link,
    parameters: &[
        Parameter {
            key: "blind_ms",
            meaning: "How long nothing gets through after the link is up, in ms.",
            shape: Shape::Number { low: 0.001, high: 60_000.0, default: Some(300.0) },
        },
        Parameter {
            key: "down_ms",
            meaning: "How long the link is down at the begin, in ms; 0 to wait for it to go down by itself.",
            shape: Shape::Number { low: 0.0, high: 60_000.0, default: Some(100.0) },
        },
    ],
    start: |start| {
        let (from, blind) = (start.from, Some(start.milliseconds("blind_ms")));
        let down = start.milliseconds("down_ms");
        let mut changes = Vec::new();
        for link in &start.target.links {
            changes.push((from, Change::Early { link: *link, blind }));
            if down.as_nanos() > 0 {
                changes.push((from, Change::Open { link: *link }));
                changes.push((from + down, Change::Close { link: *link }));
            }
        }
        changes.sort_by_key(|(at, _)| *at);
        Ok(ListedChanges::boxed(changes))
    },
};
