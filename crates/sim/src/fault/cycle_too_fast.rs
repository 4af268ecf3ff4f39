//! `cycle-too-fast`: the work of a device takes longer than the cycle. It counts cycles that came before
//! the last was done (0x1C32:0C), and in step with its clock it leaves OP with 0x001A.
//!
//! Reference: ETG.1020, synchronisation; S0.

use linesman_config::fault::FaultName;
use linesman_proto::time::Span;

use super::source::ListedChanges;
use super::{Kind, Parameter, PlaceRule, Shape};
use crate::wire::{Change, TimingChange};

pub(super) const KIND: Kind = Kind {
    name: FaultName::CycleTooFast,
    place: PlaceRule::Processor,
    parameters: &[Parameter {
        key: "needs_us",
        meaning: "How long its work takes in each cycle, in µs.",
        shape: Shape::Number { low: 1.0, high: 1e6, default: Some(1_500.0) },
    }],
    start: |start| {
        let change = TimingChange::SlowDown(Span::ns((start.number("needs_us") * 1e3) as u64));
        let from = start.from;
        let nodes = start.target.nodes.into_iter();
        Ok(ListedChanges::boxed(nodes.map(|node| (from, Change::Timing { node, change }))))
    },
};
