//! `reference-clock-lost`: the clock that all others follow stands, or starts anew at what it showed at
//! power-on. The frames carry its time as before; whoever follows it is led astray: 0x092C of all
//! others leaves its window, that of the reference itself stays.
//!
//! Reference: S1 9.1.3.

use linesman_config::fault::FaultName;
use linesman_proto::time::Span;

use super::source::ListedChanges;
use super::{Kind, Parameter, PlaceRule, Shape};
use crate::controller::LocalClock;
use crate::wire::{Change, TimingChange};

pub(super) const KIND: Kind = Kind {
    name: FaultName::ReferenceClockLost,
    place: PlaceRule::Device,
    parameters: &[Parameter {
        key: "how",
        meaning: "Whether the clock stands, or starts anew and goes on.",
        shape: Shape::Word { words: &["stands", "starts-anew"] },
    }],
    start: |start| {
        let change = if start.values.text("how") == Some("starts-anew") {
            TimingChange::RestartClock
        } else {
            TimingChange::Drift { ppb: LocalClock::STOPPED, ramp_ppb_per_s: 0, ramp: Span::ZERO }
        };
        let from = start.from;
        // Of a device with several controllers it is the first.
        let node = start.target.nodes.into_iter().take(1);
        Ok(ListedChanges::boxed(node.map(|node| (from, Change::Timing { node, change }))))
    },
};
