//! `host-drops`: the computer loses frames after they came back.
//!
//! The frame has been all the way round, every SubDevice has executed it, its check sequence is right;
//! the host's buffers overflow and nobody reads it. No controller counts anything and the card's error
//! counters stay, but it counts the drop (`rx_dropped`); the MainDevice misses the frame.

use linesman_config::fault::FaultName;
use linesman_proto::address::Path;
use linesman_proto::time::Instant;

use super::source::{ListedChanges, spread};
use super::{Kind, Parameter, PlaceRule, Shape};
use crate::seed::Stream;
use crate::wire::{Change, Source};

pub(super) const KIND: Kind = Kind {
    name: FaultName::HostDrops,
    place: PlaceRule::Card,
    parameters: &[
        Parameter {
            key: "drops_per_s",
            meaning: "Mean number of frames a second that are lost.",
            shape: Shape::Number { low: 0.001, high: 20_000.0, default: Some(5.0) },
        },
        Parameter {
            key: "hits",
            meaning: "Exactly so many frames are lost, evenly over time, instead of `drops_per_s`.",
            shape: Shape::Whole { low: 1, high: 1_000_000, default: None },
        },
    ],
    start: |start| {
        let interval = start.interval();
        let mut stream = start.stream.clone();
        let card = start.target.cards.first().copied().unwrap_or(Path::A);
        if let Some(count) = start.values.whole("hits") {
            let instants = spread(count, interval, &mut stream);
            return Ok(ListedChanges::boxed(
                instants.into_iter().map(|at| (at, Change::Drop { card })),
            ));
        }
        let rate_per_s = start.number("drops_per_s");
        Ok(Box::new(Drops { card, rate_per_s, at: start.from, stream }))
    },
};

#[derive(Debug)]
struct Drops {
    card: Path,
    rate_per_s: f64,
    at: Instant,
    stream: Stream,
}

impl Source for Drops {
    fn next_change(&mut self) -> Option<(Instant, Change)> {
        self.at += self.stream.wait(self.rate_per_s);
        (self.at != Instant::MAX).then_some((self.at, Change::Drop { card: self.card }))
    }
}
