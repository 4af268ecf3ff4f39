//! `sync-lost`: the SYNC signals of a device do not reach its processor, or not as its controller makes
//! them. The controller makes them as before: registers show nothing. Of a line that is broken the
//! processor leaves OP with 0x002C after some cycles, or does not get there and gives 0x002D. Of a line
//! that bounces it hears each edge twice; what comes a moment behind an edge can be no SYNC, and the
//! processor gives its synchronised inputs and outputs up with 0x0033.
//!
//! Reference: S1 9.2; ETG.1020, synchronisation.

use linesman_config::fault::FaultName;

use super::source::ListedChanges;
use super::{Kind, Parameter, PlaceRule, Shape};
use crate::wire::{Change, TimingChange};

pub(super) const KIND: Kind = Kind {
    name: FaultName::SyncLost,
    place: PlaceRule::Processor,
    parameters: &[Parameter {
        key: "how",
        meaning: "Whether the line to the processor is broken, or carries each edge twice.",
        shape: Shape::Word { words: &["broken", "bounces"] },
    }],
    start: |start| {
        let from = start.from;
        let nodes = start.target.nodes.into_iter();
        let change = match start.values.text("how") {
            Some("bounces") => TimingChange::BounceSync,
            _ => TimingChange::CutSync,
        };
        Ok(ListedChanges::boxed(nodes.map(move |node| (from, Change::Timing { node, change }))))
    },
};
