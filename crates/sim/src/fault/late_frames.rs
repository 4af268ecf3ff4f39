//! `late-frames`: a card sends its frames later than it was told to: a host that is busy, a queue in
//! front of the line. No counter of a controller moves; devices that keep step with their clock count
//! outputs that come behind their SYNC (0x1C32:0B), those that keep step with frames pass the jitter
//! on.
//!
//! Reference: S0, synchronisation; ETG.1020.

use linesman_config::fault::FaultName;
use linesman_proto::address::Path;
use linesman_proto::time::{Instant, Span};

use super::{Kind, Parameter, PlaceRule, Shape};
use crate::seed::Stream;
use crate::wire::{Change, Source};

pub(super) const KIND: Kind = Kind {
    name: FaultName::LateFrames,
    place: PlaceRule::Card,
    parameters: &[
        Parameter {
            key: "late_us",
            meaning: "How late a frame leaves at most, in µs.",
            shape: Shape::Number { low: 0.1, high: 1e6, default: Some(800.0) },
        },
        Parameter {
            key: "least_us",
            meaning: "How late it leaves at least, in µs, when it is late.",
            shape: Shape::Number { low: 0.0, high: 1e6, default: Some(0.0) },
        },
        Parameter {
            key: "redrawn_ms",
            meaning: "How long a lateness lasts before another is drawn, in ms.",
            shape: Shape::Number { low: 0.01, high: 1e6, default: Some(1.0) },
        },
        Parameter {
            key: "share",
            meaning: "In what share of these times frames are late at all, in percent.",
            shape: Shape::Number { low: 0.0, high: 100.0, default: Some(100.0) },
        },
    ],
    start: |start| {
        let us = |key: &str| (start.number(key) * 1e3) as u64;
        let (least, most) = (us("least_us"), us("late_us"));
        if least > most {
            return Err(start.error("`least_us` must not be more than `late_us`".to_owned()));
        }
        Ok(Box::new(LateFrames {
            paths: start.target.cards.clone(),
            least,
            most,
            share: start.number("share") / 100.0,
            each: start.milliseconds("redrawn_ms"),
            at: start.from,
            stream: start.stream.clone(),
        }))
    },
};

#[derive(Debug)]
struct LateFrames {
    paths: Vec<Path>,
    least: u64,
    most: u64,
    share: f64,
    each: Span,
    at: Instant,
    stream: Stream,
}

impl Source for LateFrames {
    fn next_change(&mut self) -> Option<(Instant, Change)> {
        let path = self.paths.first().copied()?;
        let late = self.stream.chance(self.share);
        let by = self.stream.between(self.least, self.most);
        let change = Change::Late { path, by: if late { Span::ns(by) } else { Span::ZERO } };
        let at = self.at;
        self.at += self.each;
        Some((at, change))
    }
}
