//! `nic-damaged`: the MainDevice's network card spoils what it receives or what it sends.

use linesman_config::fault::FaultName;

use super::source::{HITS, steady};
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
        HITS,
    ],
    start: |start| {
        // The line to the card, then the one from it.
        let direction = usize::from(start.values.text("part") == Some("transmitter"));
        let directions = start.target.directions.get(direction).copied().into_iter().collect();
        Ok(steady(&start, directions))
    },
};
