//! `mailbox-stuck`: the part of a device's software that serves the mailbox has died. Everything
//! else works on: states, process data.
//!
//! Reference: S1 8.2. A mailbox that is not read stays full, so that further writes are denied
//! (working counter 0); one that is not filled stays empty, so that reads are.

use linesman_config::fault::FaultName;

use super::source::Listed;
use super::{Kind, Parameter, PlaceRule, Shape};
use crate::device::Trouble;
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
        let troubles: &[Trouble] = match start.values.text("side") {
            Some("answers") => &[Trouble::MailboxNotFilled],
            Some("both") => &[Trouble::MailboxNotRead, Trouble::MailboxNotFilled],
            Some(_) | None => &[Trouble::MailboxNotRead],
        };
        let from = start.from;
        let nodes = start.target.nodes.into_iter();
        Ok(Listed::boxed(nodes.flat_map(|node| {
            troubles.iter().map(move |trouble| {
                let change = SoftwareChange::Begin(*trouble);
                (from, Change::Software { node, change })
            })
        })))
    },
};
