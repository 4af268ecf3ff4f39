//! Categories 50 and 51, TxPDO and RxPDO: what the process data consist of by default.
//!
//! Reference: ETG.2010; ETG.1000.6 §5.4. "Tx" and "Rx" are the SubDevice's view: a TxPDO carries
//! inputs of the MainDevice. Layout: header of 8 bytes, then 8 bytes for each entry.

use super::strings::StringIndex;
use crate::mailbox::coe::data_type::DataType;

/// Which way process data flow, as the MainDevice sees it.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Direction {
    /// From MainDevice to SubDevice: RxPDOs, category 51, objects 0x1600..=0x17FF.
    Outputs,
    /// From SubDevice to MainDevice: TxPDOs, category 50, objects 0x1A00..=0x1BFF.
    Inputs,
}

/// One process data object.
#[derive(Clone, PartialEq, Eq, Hash, Debug, Default)]
pub struct Pdo {
    /// Index of its mapping object: 0x16xx or 0x1Axx.
    pub index: u16,
    /// SyncManager it is assigned to by default; `None` (0xFF) when it is not.
    pub sync_manager: Option<u8>,
    /// Reference to the clock it is synchronised with.
    pub synchronization: u8,
    /// Its name.
    pub name: StringIndex,
    /// Switches.
    pub flags: PdoFlags,
    /// What it consists of, in order: at most 255.
    pub entries: Vec<PdoEntry>,
}

impl Pdo {
    /// Length of the header and of each entry in bytes.
    pub const RECORD_LEN: usize = 8;
    /// Most entries of a PDO, as their count is one byte.
    pub const MAX_ENTRIES: usize = 255;

    const UNASSIGNED: u8 = 0xFF;

    /// Length of the whole PDO in bits, padding entries included.
    #[must_use]
    pub fn bits(&self) -> u32 {
        self.entries.iter().map(|entry| u32::from(entry.bits)).sum()
    }

    /// The PDO without its entries, and how many the header announces.
    pub(crate) const fn header_from_bytes(bytes: [u8; Self::RECORD_LEN]) -> (Self, u8) {
        let [index_low, index_high, count, sync_manager, synchronization, name, low, high] = bytes;
        let sync_manager = if sync_manager == Self::UNASSIGNED { None } else { Some(sync_manager) };
        let pdo = Self {
            index: u16::from_le_bytes([index_low, index_high]),
            sync_manager,
            synchronization,
            name: StringIndex(name),
            flags: PdoFlags(u16::from_le_bytes([low, high])),
            entries: Vec::new(),
        };
        (pdo, count)
    }

    /// Appends header and entries to the data of a category. The caller has checked the count.
    pub(crate) fn build(&self, into: &mut Vec<u8>) {
        let [index_low, index_high] = self.index.to_le_bytes();
        let [low, high] = self.flags.0.to_le_bytes();
        let count = u8::try_from(self.entries.len()).unwrap_or(u8::MAX);
        let sync_manager = self.sync_manager.unwrap_or(Self::UNASSIGNED);
        let name = self.name.0;
        into.extend_from_slice(&[
            index_low,
            index_high,
            count,
            sync_manager,
            self.synchronization,
            name,
            low,
            high,
        ]);
        for entry in self.entries.iter().take(Self::MAX_ENTRIES) {
            into.extend_from_slice(&entry.to_bytes());
        }
    }
}

/// Switches of a PDO, as far as their meaning is known; all bits are kept.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct PdoFlags(pub u16);

impl PdoFlags {
    /// Bit 0: it must stay assigned.
    #[must_use]
    pub const fn mandatory(self) -> bool {
        self.0 & 0x0001 != 0
    }

    /// Bit 4: its entries cannot be changed.
    #[must_use]
    pub const fn fixed(self) -> bool {
        self.0 & 0x0010 != 0
    }
}

/// One entry of a PDO.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct PdoEntry {
    /// Index of the object; 0 for padding.
    pub index: u16,
    /// Subindex of the object.
    pub subindex: u8,
    /// Its name.
    pub name: StringIndex,
    /// Data type as one byte; [`PdoEntry::data_type`] names it.
    pub data_type_code: u8,
    /// Length in bits.
    pub bits: u8,
    /// Reserved; kept.
    pub flags: u16,
}

impl PdoEntry {
    /// The entry in 8 bytes of an image.
    #[must_use]
    pub const fn from_bytes(bytes: [u8; Pdo::RECORD_LEN]) -> Self {
        let [index_low, index_high, subindex, name, data_type_code, bits, low, high] = bytes;
        Self {
            index: u16::from_le_bytes([index_low, index_high]),
            subindex,
            name: StringIndex(name),
            data_type_code,
            bits,
            flags: u16::from_le_bytes([low, high]),
        }
    }

    /// The 8 bytes of an image.
    #[must_use]
    pub const fn to_bytes(self) -> [u8; Pdo::RECORD_LEN] {
        let [index_low, index_high] = self.index.to_le_bytes();
        let [low, high] = self.flags.to_le_bytes();
        [
            index_low,
            index_high,
            self.subindex,
            self.name.0,
            self.data_type_code,
            self.bits,
            low,
            high,
        ]
    }

    /// Its data type.
    #[must_use]
    pub const fn data_type(self) -> DataType {
        DataType(self.data_type_code as u16)
    }

    /// Whether it only fills up bits between other entries.
    #[must_use]
    pub const fn is_padding(self) -> bool {
        self.index == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn header_and_entries_go_back_as_they_came() {
        // EL2004, first RxPDO: one BOOL at 0x7000:01 on SyncManager 0.
        let header = [0x00, 0x16, 0x01, 0x00, 0x00, 0x05, 0x11, 0x00];
        let entry = [0x00, 0x70, 0x01, 0x06, 0x01, 0x01, 0x00, 0x00];
        let (mut pdo, count) = Pdo::header_from_bytes(header);
        assert_eq!((pdo.index, pdo.sync_manager, count), (0x1600, Some(0), 1));
        assert!(pdo.flags.mandatory() && pdo.flags.fixed());
        pdo.entries.push(PdoEntry::from_bytes(entry));
        assert_eq!(pdo.bits(), 1);
        assert_eq!(pdo.entries[0].data_type().name(), Some("BOOL"));
        let mut bytes = Vec::new();
        pdo.build(&mut bytes);
        assert_eq!(bytes, [header, entry].concat());
    }

    #[test]
    fn an_unassigned_pdo_says_so() {
        let header = [0x02, 0x1A, 0, 0xFF, 0, 0, 0, 0];
        let (pdo, _) = Pdo::header_from_bytes(header);
        assert_eq!(pdo.sync_manager, None);
        let mut bytes = Vec::new();
        pdo.build(&mut bytes);
        assert_eq!(bytes, header);
    }
}
