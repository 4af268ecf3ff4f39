//! `config-mismatch`: settings of a device do not fit what its data say, and the MainDevice goes by
//! them. The device finds out itself, at the next step that needs them, and refuses it.

use linesman_config::fault::FaultName;

use super::source::ListedChanges;
use super::{Kind, Parameter, PlaceRule, Shape};
use crate::device::{Mismatch, SoftwareFault};
use crate::wire::{Change, SoftwareChange};

pub(super) const KIND: Kind = Kind {
    name: FaultName::ConfigMismatch,
    place: PlaceRule::Processor,
    parameters: &[Parameter {
        key: "what",
        meaning: "`process-data`: another tool has stored a shorter PDO assignment, and the device \
                  refuses SAFEOP with code 0x001E or 0x001D. `mailbox`: its firmware wants shorter \
                  mailboxes than its EEPROM says, and it refuses PREOP with 0x0016. `modules`: a \
                  module is missing from what the MainDevice has configured, and it refuses SAFEOP \
                  with 0x0070.",
        shape: Shape::Word { words: &["process-data", "mailbox", "modules"] },
    }],
    start: |start| {
        let what = match start.values.text("what") {
            Some("mailbox") => Mismatch::Mailbox,
            Some("modules") => Mismatch::Modules,
            Some(_) | None => Mismatch::ProcessData,
        };
        let change = SoftwareChange::Begin(SoftwareFault::Mismatch(what));
        let (from, nodes) = (start.from, start.target.nodes.into_iter());
        Ok(ListedChanges::boxed(nodes.map(|node| (from, Change::Software { node, change }))))
    },
};
