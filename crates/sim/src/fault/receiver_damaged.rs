//! `receiver-damaged`: the input stage of a port is damaged.
//!
//! The port itself sees symbol errors in whatever comes in. The place is the line that ends at the
//! port, `K1.C>B3.A` for the receiver of B3's port A. Seen from the frames it is the same as a
//! damaged transmitter at the other end: only exchanging parts tells them apart.

use linesman_config::fault::FaultName;

use super::source::{Envelope, Shower, frame_hits};
use super::{Kind, Parameter, PlaceRule, Shape};

pub(super) const KIND: Kind = Kind {
    name: FaultName::ReceiverDamaged,
    place: PlaceRule::Line,
    parameters: &[
        Parameter {
            key: "hits_per_s",
            meaning: "Mean number of destroyed symbols a second.",
            shape: Shape::Number { low: 0.0, high: 1e6, default: Some(100.0) },
        },
        Parameter {
            key: "hits",
            meaning: "Exactly so many frames are hit, evenly over time and even if that takes longer than `to_ms`, instead of `hits_per_s`.",
            shape: Shape::Whole { low: 1, high: 1_000_000, default: None },
        },
    ],
    start: |start| {
        let interval = start.interval();
        let mut stream = start.stream.clone();
        if let Some(count) = start.values.whole("hits") {
            return Ok(frame_hits(count, interval, &start.target.lines, &mut stream));
        }
        let rate = start.number("hits_per_s");
        let lines = start.target.lines;
        Ok(Box::new(Shower::new(lines, rate, Envelope::Constant, start.from, stream)))
    },
};
