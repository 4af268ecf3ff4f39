//! `mailbox-slow`: the software of a device has little time for its mailbox. Answers are right, but
//! late; the next request waits in the mailbox meanwhile.

use linesman_config::fault::FaultName;

use super::source::ListedChanges;
use super::{Kind, Parameter, PlaceRule, Shape};
use crate::device::SoftwareFault;
use crate::wire::{Change, SoftwareChange};

pub(super) const KIND: Kind = Kind {
    name: FaultName::MailboxSlow,
    place: PlaceRule::Mailbox,
    parameters: &[Parameter {
        key: "by_ms",
        meaning: "How much later than usual each message is answered, in ms.",
        shape: Shape::Number { low: 0.001, high: 600_000.0, default: Some(500.0) },
    }],
    start: |start| {
        let change =
            SoftwareChange::Begin(SoftwareFault::SlowMailbox { by: start.milliseconds("by_ms") });
        let from = start.from;
        let nodes = start.target.nodes.into_iter();
        Ok(ListedChanges::boxed(nodes.map(|node| (from, Change::Software { node, change }))))
    },
};
