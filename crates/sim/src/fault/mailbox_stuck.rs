//! `mailbox-stuck`: the part of a device's software that serves the mailbox has died. Everything
//! else works on: states, process data.
//!
//! Reference: S1 8.2. A mailbox that is not read stays full, so that further writes are denied
//! (working counter 0); one that is not filled stays empty, so that reads are.

use linesman_config::fault::FaultName;

use super::source::ListedChanges;
use super::{Kind, Parameter, PlaceRule, Shape};
use crate::device::SoftwareFault;
use crate::wire::{Change, SoftwareChange};

pub(super) const KIND: Kind = Kind {
    name: FaultName::MailboxStuck,
    place: PlaceRule::Mailbox,
    parameters: &[Parameter {
        key: "side",
        meaning: "What it does no longer: take requests out, put answers in, or both.",
        shape: Shape::Word { words: &["requests", "answers", "both"] },
    }],
    start: |start| {
        let software_faults: &[SoftwareFault] = match start.values.text("side") {
            Some("answers") => &[SoftwareFault::MailboxNotFilled],
            Some("both") => &[SoftwareFault::MailboxNotRead, SoftwareFault::MailboxNotFilled],
            Some(_) | None => &[SoftwareFault::MailboxNotRead],
        };
        let from = start.from;
        let nodes = start.target.nodes.into_iter();
        Ok(ListedChanges::boxed(nodes.flat_map(|node| {
            software_faults.iter().map(move |software_fault| {
                let change = SoftwareChange::Begin(*software_fault);
                (from, Change::Software { node, change })
            })
        })))
    },
};
