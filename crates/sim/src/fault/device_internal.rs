//! `device-internal`: a device spoils frames inside, between its receiver and the coder of its
//! transmitter. The neighbour gets bad frames in clean symbols.

use linesman_config::fault::FaultName;
use linesman_proto::time::Instant;

use super::source::{ListedChanges, flip, part, spread};
use super::{Kind, Parameter, PlaceRule, Shape};
use crate::seed::Stream;
use crate::wire::{Change, Source};

pub(super) const KIND: Kind = Kind {
    name: FaultName::DeviceInternal,
    place: PlaceRule::Device,
    parameters: &[
        Parameter {
            key: "hits_per_s",
            meaning: "Mean number of spoiled frames a second; no more than frames that pass.",
            shape: Shape::Number { low: 0.0, high: 100_000.0, default: Some(5.0) },
        },
        Parameter {
            key: "hits",
            meaning: "Exactly so many frames are spoiled, evenly over time.",
            shape: Shape::Whole { low: 1, high: 1_000_000, default: None },
        },
    ],
    start: |start| {
        let interval = start.interval();
        let mut stream = start.stream.clone();
        // Of a device with several controllers it is the first.
        let Some(node) = start.target.nodes.first().copied() else {
            return Ok(ListedChanges::boxed([]));
        };
        if let Some(count) = start.values.whole("hits") {
            let instants = spread(count, interval, &mut stream);
            let glitches = instants.into_iter().map(|at| {
                let (part, flip) = (part(&mut stream), flip(&mut stream));
                (at, Change::Glitch { node, part, flip })
            });
            return Ok(ListedChanges::boxed(glitches.collect::<Vec<_>>()));
        }
        let rate_per_s = start.number("hits_per_s");
        Ok(Box::new(Glitches { node, rate_per_s, at: start.from, stream }))
    },
};

#[derive(Debug)]
struct Glitches {
    node: usize,
    rate_per_s: f64,
    at: Instant,
    stream: Stream,
}

impl Source for Glitches {
    fn next_change(&mut self) -> Option<(Instant, Change)> {
        self.at += self.stream.wait(self.rate_per_s);
        let (part, flip) = (part(&mut self.stream), flip(&mut self.stream));
        let change = Change::Glitch { node: self.node, part, flip };
        (self.at != Instant::MAX).then_some((self.at, change))
    }
}
