//! `emc-noise`: outside interference couples into one or more cables, in bursts.
//!
//! All lines share the schedule of bursts (a converter switches, a welder fires); within a burst
//! each line is hit by chance for itself.

use linesman_config::fault::FaultName;
use linesman_proto::time::{Instant, Span};

use super::source::{HITS, flip, frame_hits};
use super::{Kind, Parameter, PlaceRule, Shape};
use crate::seed::Stream;
use crate::wire::{Change, Line, Source};

pub(super) const KIND: Kind = Kind {
    name: FaultName::EmcNoise,
    place: PlaceRule::ManyLines,
    parameters: &[
        Parameter {
            key: "hits_per_s",
            meaning: "Mean number of destroyed symbols a second, on each line.",
            shape: Shape::Number { low: 0.0, high: 1e6, default: Some(40.0) },
        },
        Parameter {
            key: "bursts_per_s",
            meaning: "Mean number of bursts a second.",
            shape: Shape::Number { low: 0.01, high: 10_000.0, default: Some(10.0) },
        },
        Parameter {
            key: "burst_ms",
            meaning: "Duration of a burst, in ms.",
            shape: Shape::Number { low: 0.001, high: 1_000.0, default: Some(5.0) },
        },
        HITS,
    ],
    start: |start| {
        let interval = start.interval();
        let mut stream = start.stream.clone();
        if let Some(count) = start.values.whole("hits") {
            return Ok(frame_hits(count, interval, &start.target.lines, &mut stream));
        }
        let burst = start.milliseconds("burst_ms").max(Span::ns(1));
        let bursts_per_s = start.number("bursts_per_s");
        let per_burst = start.number("hits_per_s") / bursts_per_s;
        let lines = start.target.lines;
        let rate_in_burst = per_burst / burst.as_secs_f64() * lines.len() as f64;
        Ok(Box::new(Bursts {
            lines,
            bursts_per_s,
            burst,
            rate_in_burst,
            at: start.from,
            until: start.from + burst,
            stream,
        }))
    },
};

#[derive(Debug)]
struct Bursts {
    lines: Vec<Line>,
    bursts_per_s: f64,
    burst: Span,
    /// On all lines together.
    rate_in_burst: f64,
    at: Instant,
    /// The end of the present burst.
    until: Instant,
    stream: Stream,
}

impl Source for Bursts {
    fn next_change(&mut self) -> Option<(Instant, Change)> {
        if self.rate_in_burst <= 0.0 || self.lines.is_empty() {
            return None;
        }
        loop {
            self.at += self.stream.wait(self.rate_in_burst);
            if self.at < self.until {
                let line = *self.stream.pick(&self.lines)?;
                return Some((self.at, Change::Hit { line, flip: flip(&mut self.stream) }));
            }
            if self.at == Instant::MAX {
                return None;
            }
            self.at = self.until + self.stream.wait(self.bursts_per_s);
            self.until = self.at + self.burst;
        }
    }
}
