//! `brown-out`: a supply dips, once or again and again. Devices start anew: in INIT, with station
//! address and counters cleared; their neighbours have lost a link. The supply of a coupler is that
//! of its terminals, too.

use linesman_config::fault::FaultName;
use linesman_proto::time::{Instant, Span};

use super::{Kind, Parameter, PlaceRule, Shape};
use crate::wire::{Change, Source};

pub(super) const KIND: Kind = Kind {
    name: FaultName::BrownOut,
    place: PlaceRule::Devices,
    parameters: &[
        Parameter {
            key: "dip_ms",
            meaning: "How long the supply is gone, in ms.",
            shape: Shape::Number { low: 0.01, high: 60_000.0, default: Some(50.0) },
        },
        Parameter {
            key: "every_ms",
            meaning: "From one dip to the next, in ms; 0 for a single dip.",
            shape: Shape::Number { low: 0.0, high: 3.6e6, default: Some(0.0) },
        },
    ],
    start: |start| {
        let (dip, every) = (start.milliseconds("dip_ms"), start.milliseconds("every_ms"));
        if every != Span::ZERO && every <= dip {
            return Err(start.error("`every_ms` must be longer than `dip_ms`".to_owned()));
        }
        let nodes = start.target.nodes;
        Ok(Box::new(Dips { nodes, dip, every, at: start.from, next: 0 }))
    },
};

#[derive(Debug)]
struct Dips {
    nodes: Vec<usize>,
    dip: Span,
    every: Span,
    /// Begin of the present dip.
    at: Instant,
    /// Counts changes within the dip: all off, then all on.
    next: usize,
}

impl Source for Dips {
    fn next_change(&mut self) -> Option<(Instant, Change)> {
        if self.nodes.is_empty() {
            return None;
        }
        if self.next == 2 * self.nodes.len() {
            if self.every == Span::ZERO {
                return None;
            }
            self.at += self.every;
            self.next = 0;
        }
        let index = self.next;
        self.next += 1;
        Some(match self.nodes.get(index) {
            Some(node) => (self.at, Change::Off { node: *node }),
            None => {
                let node = self.nodes[index - self.nodes.len()];
                (self.at + self.dip, Change::On { node })
            }
        })
    }
}
