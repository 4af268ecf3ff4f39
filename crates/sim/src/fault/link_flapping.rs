//! `link-flapping`: a contact opens and closes again and again.
//!
//! Openings come by chance at a mean rate and last as long as an exponential draw says, at least a
//! microsecond. An opening shorter than the detection time of the ports costs frames without any
//! link being lost. With one direction only (`K1.C>K2.A`) one pair of wires has the bad contact; see
//! `link-open` for what each end notices then.

use linesman_config::fault::FaultName;
use linesman_proto::time::{Instant, Span};

use super::source::ListedChanges;
use super::{Kind, Parameter, PlaceRule, Shape};
use crate::seed::Stream;
use crate::wire::{Change, Source};

pub(super) const KIND: Kind = Kind {
    name: FaultName::LinkFlapping,
    place: PlaceRule::Directions,
    parameters: &[
        Parameter {
            key: "openings_per_s",
            meaning: "Mean number of openings a second while the contact is closed.",
            shape: Shape::Number { low: 0.001, high: 10_000.0, default: Some(1.0) },
        },
        Parameter {
            key: "open_ms",
            meaning: "Mean duration of an opening, in ms.",
            shape: Shape::Number { low: 0.001, high: 60_000.0, default: Some(20.0) },
        },
    ],
    start: |start| {
        let Some((opens, closes)) = start.target.breaks().next() else {
            return Ok(ListedChanges::boxed([]));
        };
        Ok(Box::new(Flapping {
            opens,
            closes,
            openings_per_s: start.number("openings_per_s"),
            closings_per_s: 1_000.0 / start.number("open_ms").max(1e-3),
            at: start.from,
            open: false,
            first: true,
            stream: start.stream,
        }))
    },
};

#[derive(Debug)]
struct Flapping {
    opens: Change,
    closes: Change,
    openings_per_s: f64,
    closings_per_s: f64,
    at: Instant,
    open: bool,
    first: bool,
    stream: Stream,
}

impl Source for Flapping {
    fn next_change(&mut self) -> Option<(Instant, Change)> {
        // It begins with an opening: that is when it was noticed.
        if !std::mem::take(&mut self.first) {
            let rate = if self.open { self.closings_per_s } else { self.openings_per_s };
            self.at += self.stream.wait(rate).max(Span::us(1));
        }
        self.open = !self.open;
        let change = if self.open { self.opens } else { self.closes };
        Some((self.at, change))
    }
}
