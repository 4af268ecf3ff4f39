//! `nic-damaged`: the MainDevice's network card spoils what it receives or what it sends.

use linesman_config::fault::FaultName;

use super::source::{Envelope, Shower, frame_hits};
use super::{Kind, Parameter, PlaceRule, Shape};

pub(super) const KIND: Kind = Kind {
    name: FaultName::NicDamaged,
    place: PlaceRule::Card,
    parameters: &[
        Parameter {
            key: "part",
            meaning: "Which part of the card is damaged.",
            shape: Shape::Word { words: &["receiver", "transmitter"] },
        },
        Parameter {
            key: "hits_per_s",
            meaning: "Mean number of destroyed symbols a second.",
            shape: Shape::Number { low: 0.0, high: 1e6, default: Some(1_000.0) },
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
        // The line to the card, then the one from it.
        let line = usize::from(start.values.text("part") == Some("transmitter"));
        let lines: Vec<_> = start.target.lines.get(line).copied().into_iter().collect();
        if let Some(count) = start.values.whole("hits") {
            return Ok(frame_hits(count, interval, &lines, &mut stream));
        }
        let rate = start.number("hits_per_s");
        Ok(Box::new(Shower::new(lines, rate, Envelope::Constant, start.from, stream)))
    },
};
