//! Objects with rules of their own: lists of PDOs, the diagnosis history, settings as a whole.
//!
//! Read first: ETG.1000.6 and ETG.1020, the chapters on these objects.

use linesman_proto::mailbox::abort_code::SdoAbortCode;
use linesman_proto::mailbox::coe::information::Access;
use linesman_proto::mailbox::coe::{ObjectAddress, ObjectIndex};

use super::{Dictionary, Entry, Object};
use crate::device::history::{ACKNOWLEDGED, FIRST_MESSAGE, FLAGS, HISTORY, WRITABLE_FLAGS};

/// Stores all settings, when "save" is written to subindex 1.
pub const STORE_SETTINGS: ObjectIndex = ObjectIndex(0x1010);
/// Takes all settings back, when "load" is written to subindex 1.
pub const RESTORE_SETTINGS: ObjectIndex = ObjectIndex(0x1011);

impl Object {
    /// Whether this is a list of PDOs (0x1C10 up), or of what a PDO is made of (0x1600 up, 0x1A00
    /// up): entries can be written only while subindex 0 is 0, and that is written last.
    #[must_use]
    pub fn is_closed_list(&self) -> bool {
        self.is_assignment() || self.is_mapping()
    }

    /// Whether a MainDevice assigns PDOs here.
    fn is_assignment(&self) -> bool {
        (0x1C10..=0x1C2F).contains(&self.index.0)
    }

    fn is_mapping(&self) -> bool {
        (0x1600..=0x17FF).contains(&self.index.0) || (0x1A00..=0x1BFF).contains(&self.index.0)
    }

    /// Whether it is about outputs.
    fn is_for_outputs(&self) -> bool {
        if self.is_mapping() { self.index.0 < 0x1A00 } else { self.index.0.is_multiple_of(2) }
    }
}

impl Dictionary {
    /// Whether an entry is there to be read at present.
    pub(super) fn check_presence(object: &Object, subindex: u8) -> Result<(), SdoAbortCode> {
        let empty = object.index == HISTORY
            && subindex >= FIRST_MESSAGE
            && u64::from(subindex) > object.count();
        if empty { Err(SdoAbortCode::NO_SUBINDEX) } else { Ok(()) }
    }

    /// Whether a number may be written here, by the rules of this object.
    pub(super) fn check_number(
        &self,
        object: &Object,
        entry: &Entry,
        number: u64,
    ) -> Result<(), SdoAbortCode> {
        match (object.index, entry.subindex) {
            (HISTORY, ACKNOWLEDGED) => {
                let there = u64::from(FIRST_MESSAGE)..=object.count();
                if number == 0 || there.contains(&number) {
                    Ok(())
                } else {
                    Err(SdoAbortCode::VALUE_RANGE)
                }
            }
            (HISTORY, FLAGS) if number & !WRITABLE_FLAGS != 0 => Err(SdoAbortCode::VALUE_RANGE),
            (STORE_SETTINGS, 1) if number != signature(b"save") => {
                Err(SdoAbortCode::NOT_TRANSFERRED)
            }
            (RESTORE_SETTINGS, 1) if number != signature(b"load") => {
                Err(SdoAbortCode::NOT_TRANSFERRED)
            }
            _ if object.is_closed_list() => self.check_list(object, entry.subindex, number),
            _ => Ok(()),
        }
    }

    /// Whether a list may be changed like this.
    fn check_list(&self, object: &Object, subindex: u8, number: u64) -> Result<(), SdoAbortCode> {
        if subindex > 0 {
            if object.count() != 0 {
                return Err(SdoAbortCode::SUBINDEX_0_NOT_ZERO);
            }
            return self.check_listed(object, number);
        }
        if number >= object.entries.len() as u64 {
            return Err(SdoAbortCode::VALUE_TOO_HIGH);
        }
        let wanted = usize::try_from(number).unwrap_or(usize::MAX);
        for entry in object.entries.iter().skip(1).take(wanted) {
            self.check_listed(object, entry.as_number())?;
        }
        Ok(())
    }

    /// Whether this may be in such a list.
    fn check_listed(&self, list: &Object, number: u64) -> Result<(), SdoAbortCode> {
        let outputs = list.is_for_outputs();
        let sound = if list.is_mapping() {
            self.is_mappable(number as u32, outputs)
        } else {
            let range = if outputs { 0x1600..=0x17FF } else { 0x1A00..=0x1BFF };
            let index = number as u16;
            range.contains(&index) && self.object(ObjectIndex(index)).is_some()
        };
        if sound { Ok(()) } else { Err(SdoAbortCode::NOT_MAPPABLE) }
    }

    /// Whether an object may be part of a PDO: with exactly its own bits and in its direction.
    /// Padding may always.
    fn is_mappable(&self, mapped: u32, outputs: bool) -> bool {
        let [bits, subindex, low, high] = mapped.to_le_bytes();
        let index = u16::from_le_bytes([low, high]);
        if index == 0 {
            return bits > 0;
        }
        let wanted = if outputs { Access::RX_PDO } else { Access::TX_PDO };
        let entry = self.find(ObjectAddress::new(index, subindex)).and_then(|at| self.entry(at));
        entry.is_some_and(|entry| entry.access.has(wanted) && entry.bits == u16::from(bits))
    }
}

/// Four letters as the number that they are in memory.
fn signature(letters: &[u8; 4]) -> u64 {
    u64::from(u32::from_le_bytes(*letters))
}
