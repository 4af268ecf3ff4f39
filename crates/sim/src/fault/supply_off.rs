//! `supply-off`: a supply that several devices share fails. They go off together, but for the
//! microseconds that their capacitors differ. A coupler takes the terminals along that it feeds.

use linesman_config::fault::FaultName;
use linesman_proto::time::Span;

use super::source::ListedChanges;
use super::{Kind, Parameter, PlaceRule, Shape};
use crate::wire::Change;

pub(super) const KIND: Kind = Kind {
    name: FaultName::SupplyOff,
    place: PlaceRule::Devices,
    parameters: &[Parameter {
        key: "spread_us",
        meaning: "How far apart the devices go off, in µs.",
        shape: Shape::Number { low: 0.0, high: 1e6, default: Some(200.0) },
    }],
    start: |start| {
        let spread = Span::ns((start.number("spread_us") * 1e3) as u64).as_nanos();
        let mut stream = start.stream.clone();
        let from = start.from;
        let nodes = start.target.nodes.into_iter();
        let mut changes: Vec<_> = nodes
            .map(|node| (from + Span::ns(stream.below(spread + 1)), Change::Off { node }))
            .collect();
        changes.sort_by_key(|(at, _)| *at);
        Ok(ListedChanges::boxed(changes))
    },
};
