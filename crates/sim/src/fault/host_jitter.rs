//! `host-jitter`: the computer sends its frames unevenly.
//!
//! Now and then it keeps a frame back before it reaches the card, and those behind it with it. On the
//! line nothing is wrong: no counter moves and every frame comes back, only late; when it is later
//! than the MainDevice waits, that frame is missing there. Devices with clocks or watchdogs notice.

use linesman_config::fault::FaultName;
use linesman_proto::address::Path;
use linesman_proto::time::{Instant, Span};

use super::source::{ListedChanges, spread};
use super::{Kind, Parameter, PlaceRule, Shape};
use crate::seed::Stream;
use crate::wire::{Change, Source};

pub(super) const KIND: Kind = Kind {
    name: FaultName::HostJitter,
    place: PlaceRule::Card,
    parameters: &[
        Parameter {
            key: "delays_per_s",
            meaning: "Mean number of frames a second that are kept back.",
            shape: Shape::Number { low: 0.001, high: 20_000.0, default: Some(50.0) },
        },
        Parameter {
            key: "delay_us",
            meaning: "How long a frame is kept back in the mean, by chance, in µs.",
            shape: Shape::Number { low: 0.1, high: 1e6, default: Some(500.0) },
        },
        Parameter {
            key: "hits",
            meaning: "Exactly so many frames are kept back, evenly over time and exactly `delay_us` each, instead of `delays_per_s`.",
            shape: Shape::Whole { low: 1, high: 1_000_000, default: None },
        },
    ],
    start: |start| {
        let interval = start.interval();
        let mut stream = start.stream.clone();
        let card = start.target.cards.first().copied().unwrap_or(Path::A);
        let delay_us = start.number("delay_us");
        if let Some(count) = start.values.whole("hits") {
            let by = Span::ns((delay_us * 1e3) as u64);
            let instants = spread(count, interval, &mut stream);
            return Ok(ListedChanges::boxed(
                instants.into_iter().map(|at| (at, Change::Delay { card, by })),
            ));
        }
        let rate_per_s = start.number("delays_per_s");
        Ok(Box::new(HostJitter { card, rate_per_s, delay_us, at: start.from, stream }))
    },
};

#[derive(Debug)]
struct HostJitter {
    card: Path,
    rate_per_s: f64,
    delay_us: f64,
    at: Instant,
    stream: Stream,
}

impl Source for HostJitter {
    fn next_change(&mut self) -> Option<(Instant, Change)> {
        self.at += self.stream.wait(self.rate_per_s);
        let by = self.stream.wait(1e6 / self.delay_us).min(Span::s(1));
        let change = Change::Delay { card: self.card, by };
        (self.at != Instant::MAX).then_some((self.at, change))
    }
}
