//! `watchdog-starved`: outputs do not come in time. Either the card that sends them falls silent now
//! and then, so that all watchdogs starve that are shorter than the pause; or the watchdog of one
//! device was set shorter than the cycle.
//!
//! Reference: S2 2.10: the process data watchdog (0x0400, 0x0420) is triggered by a complete write
//! to a SyncManager with bit 6 of its control byte. Times are in ticks of 0.1 ms unless the
//! MainDevice changed the divider.

use linesman_config::fault::FaultName;
use linesman_proto::address::Path;
use linesman_proto::register::WatchdogTime;
use linesman_proto::time::{Instant, Span};

use super::source::ListedChanges;
use super::{Kind, Parameter, PlaceRule, Shape};
use crate::truth::Place;
use crate::wire::{Change, Source};

pub(super) const KIND: Kind = Kind {
    name: FaultName::WatchdogStarved,
    place: PlaceRule::DeviceOrCard,
    parameters: &[
        Parameter {
            key: "watchdog_ms",
            meaning: "With `device`: the time its watchdog is set to, in ms.",
            shape: Shape::Number { low: 0.1, high: 6_553.5, default: Some(1.0) },
        },
        Parameter {
            key: "pause_ms",
            meaning: "With a card: how long it sends nothing, in ms.",
            shape: Shape::Number { low: 0.001, high: 600_000.0, default: Some(150.0) },
        },
        Parameter {
            key: "every_ms",
            meaning: "With a card: from one pause to the next, in ms; 0 for a single one.",
            shape: Shape::Number { low: 0.0, high: 3.6e6, default: Some(0.0) },
        },
    ],
    start: |start| {
        if let Some(Place::Host(path)) = start.target.places.first().copied() {
            let (pause, every) = (start.milliseconds("pause_ms"), start.milliseconds("every_ms"));
            if every != Span::ZERO && every <= pause {
                return Err(start.error("`every_ms` must be longer than `pause_ms`".to_owned()));
            }
            return Ok(Box::new(Pauses { path, pause, every, at: Some(start.from) }));
        }
        let ticks = (start.number("watchdog_ms") * 10.0).round() as u16;
        let time = Some(WatchdogTime(ticks));
        let from = start.from;
        let nodes = start.target.nodes.into_iter();
        Ok(ListedChanges::boxed(nodes.map(|node| (from, Change::Watchdog { node, time }))))
    },
};

#[derive(Debug)]
struct Pauses {
    path: Path,
    pause: Span,
    every: Span,
    at: Option<Instant>,
}

impl Source for Pauses {
    fn next_change(&mut self) -> Option<(Instant, Change)> {
        let at = self.at?;
        self.at = (self.every != Span::ZERO).then(|| at + self.every);
        Some((at, Change::Silence { path: self.path, until: at + self.pause }))
    }
}
