//! Objects of PDOs as transfers show them: their last values, and names from SDO information.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use linesman_config::profile::{MappedEntry, MappedPdo};
use linesman_proto::mailbox::coe::information::{EntryDescription, ObjectDescription};
use linesman_proto::mailbox::coe::{ObjectAddress, ObjectIndex};
use linesman_proto::sii::Direction;

use super::report::TransferOutcome;
use super::transfer::MailboxTransfer;

/// PDO assignments of the 32 SyncManagers.
const ASSIGNMENTS: RangeInclusive<u16> = 0x1C10..=0x1C2F;
/// Mappings of PDOs, outputs then inputs.
const MAPPINGS: RangeInclusive<u16> = ObjectIndex::RX_PDO_MAPPING.0..=0x1BFF;

/// Objects of a SubDevice that say what its process data consist of.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub(crate) struct PdoObjects {
    /// Values as they were last read or written.
    values: BTreeMap<(u16, u8), u32>,
    /// Names of entries, by index and subindex.
    entries: BTreeMap<(u16, u8), String>,
    /// Names of objects.
    objects: BTreeMap<u16, String>,
}

impl PdoObjects {
    /// True if a transfer tells anything of it.
    pub(super) fn concerns(transfer: &MailboxTransfer) -> bool {
        let is_value = |object: ObjectAddress| {
            ASSIGNMENTS.contains(&object.index.0) || MAPPINGS.contains(&object.index.0)
        };
        transfer.outcome == TransferOutcome::Done
            && match transfer.what {
                "upload" | "download" => transfer.object.is_some_and(is_value),
                "entry-description" | "object-description" => true,
                _ => false,
            }
    }

    /// Learns from a transfer of them; later ones hold.
    pub(super) fn learn(&mut self, transfer: &MailboxTransfer) {
        match transfer.what {
            "upload" | "download" => self.value(transfer),
            "entry-description" => self.entry(&transfer.data),
            "object-description" => self.object(&transfer.data),
            _ => {}
        }
    }

    fn value(&mut self, transfer: &MailboxTransfer) {
        let Some(ObjectAddress { index, subindex }) = transfer.object else { return };
        let width = if ASSIGNMENTS.contains(&index.0) { 2 } else { 4 };
        let is_whole = transfer.size == transfer.data.len() as u64;
        let number = |bytes: &[u8]| {
            bytes.iter().rev().fold(0_u32, |number, byte| number << 8 | u32::from(*byte))
        };
        match (transfer.complete, subindex, transfer.data.as_slice()) {
            (false, _, data) if (1..=4).contains(&data.len()) => {
                self.values.insert((index.0, subindex), number(data));
            }
            // Complete access: the number of entries takes a word of its own.
            (true, 0, [count, _, entries @ ..]) if is_whole => {
                self.values.insert((index.0, 0), u32::from(*count));
                self.parts(index, width, entries, number);
            }
            (true, 1, entries) if is_whole => self.parts(index, width, entries, number),
            (_, _, _) => {}
        }
    }

    fn parts(
        &mut self,
        index: ObjectIndex,
        width: usize,
        entries: &[u8],
        number: impl Fn(&[u8]) -> u32,
    ) {
        for (subindex, entry) in (1..=u8::MAX).zip(entries.chunks_exact(width)) {
            self.values.insert((index.0, subindex), number(entry));
        }
    }

    fn entry(&mut self, data: &[u8]) {
        if let Ok(entry) = EntryDescription::parse(data) {
            let at = (entry.object.index.0, entry.object.subindex);
            self.entries.insert(at, entry.name_text().into_owned());
        }
    }

    fn object(&mut self, data: &[u8]) {
        if let Ok(object) = ObjectDescription::parse(data) {
            self.objects.insert(object.index.0, object.name_text().into_owned());
        }
    }

    /// The values of an array behind its number of entries; `None` unless all were seen.
    fn array(&self, index: u16) -> Option<Vec<u32>> {
        let count = u8::try_from(*self.values.get(&(index, 0))?).ok()?;
        (1..=count).map(|subindex| self.values.get(&(index, subindex)).copied()).collect()
    }

    /// The PDOs that are assigned to a SyncManager, in the order of their data; `None` unless the assignment and all
    /// mappings of it were seen.
    pub(crate) fn assigned(&self, sync_manager: u8) -> Option<Vec<MappedPdo>> {
        let assignment = ObjectIndex::pdo_assignment(sync_manager)?;
        let pdos = self.array(assignment.0)?.into_iter();
        pdos.map(|pdo| self.mapped(u16::try_from(pdo).ok()?, sync_manager)).collect()
    }

    fn mapped(&self, index: u16, sync_manager: u8) -> Option<MappedPdo> {
        let is_input = index >= ObjectIndex::TX_PDO_MAPPING.0;
        let entry = |value: u32| {
            // Index, subindex, bits: ETG.1000.6 §5.6.7.4.7.
            let [bits, subindex, low, high] = value.to_le_bytes();
            let index = u16::from_le_bytes([low, high]);
            let name = self.entries.get(&(index, subindex)).cloned();
            let name = name.or_else(|| self.objects.get(&index).filter(|_| subindex == 0).cloned());
            MappedEntry {
                index,
                subindex,
                bits: u16::from(bits),
                name: name.unwrap_or_default(),
                data_type: String::new(),
            }
        };
        Some(MappedPdo {
            sync_manager,
            direction: if is_input { Direction::Inputs } else { Direction::Outputs },
            index,
            name: self.objects.get(&index).cloned().unwrap_or_default(),
            entries: self.array(index)?.into_iter().map(entry).collect(),
        })
    }
}
