//! Address of an object, and the indices every EtherCAT device shares.
//!
//! Reference: ETG.1000.6, object dictionary, ETG.1020.

use std::fmt;

/// Index of an object in the dictionary, 16 bits.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct ObjectIndex(pub u16);

impl ObjectIndex {
    /// Device type: profile number in the low word.
    pub const DEVICE_TYPE: Self = Self(0x1000);
    /// Error register, see [`ErrorRegister`](super::ErrorRegister).
    pub const ERROR_REGISTER: Self = Self(0x1001);
    /// Name of the device.
    pub const DEVICE_NAME: Self = Self(0x1008);
    /// Version of its hardware.
    pub const HARDWARE_VERSION: Self = Self(0x1009);
    /// Version of its software.
    pub const SOFTWARE_VERSION: Self = Self(0x100A);
    /// Store parameters: "save" to subindex 1.
    pub const STORE_PARAMETERS: Self = Self(0x1010);
    /// Restore parameters: "load" to subindex 1.
    pub const RESTORE_PARAMETERS: Self = Self(0x1011);
    /// Identity: vendor, product, revision, serial number in subindices 1..=4.
    pub const IDENTITY: Self = Self(0x1018);
    /// Error settings: subindex 2 is the limit of the sync error counter.
    pub const ERROR_SETTINGS: Self = Self(0x10F1);
    /// Diagnosis history.
    pub const DIAGNOSIS_HISTORY: Self = Self(0x10F3);
    /// Time stamp in ns.
    pub const TIMESTAMP: Self = Self(0x10F8);
    /// First of the RxPDO mappings, which end at 0x17FF.
    pub const RX_PDO_MAPPING: Self = Self(0x1600);
    /// First of the TxPDO mappings, which end at 0x1BFF.
    pub const TX_PDO_MAPPING: Self = Self(0x1A00);
    /// Types of the SyncManagers: subindex n is the type of SyncManager n-1.
    pub const SYNC_MANAGER_TYPES: Self = Self(0x1C00);
    /// Synchronisation of outputs.
    pub const OUTPUT_SYNC: Self = Self(0x1C32);
    /// Synchronisation of inputs.
    pub const INPUT_SYNC: Self = Self(0x1C33);
    /// Drives: code of the last error, as in an emergency.
    pub const ERROR_CODE: Self = Self(0x603F);
    /// Drives: statusword.
    pub const STATUSWORD: Self = Self(0x6041);
    /// Modular devices: idents of the modules that are configured.
    pub const CONFIGURED_MODULES: Self = Self(0xF030);
    /// Modular devices: idents of the modules that are there.
    pub const DETECTED_MODULES: Self = Self(0xF050);

    /// The object with the PDOs assigned to a SyncManager: 0x1C10 + number, for 0..=31.
    #[must_use]
    pub const fn pdo_assignment(sync_manager: u8) -> Option<Self> {
        if sync_manager < 32 { Some(Self(0x1C10 + sync_manager as u16)) } else { None }
    }

    /// The bare number, for the wire.
    #[must_use]
    pub const fn value(self) -> u16 {
        self.0
    }
}

impl fmt::Display for ObjectIndex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:04X}", self.0)
    }
}

impl fmt::Debug for ObjectIndex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ObjectIndex({self})")
    }
}

/// One entry of an object, written `0x1018:01`.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default)]
pub struct ObjectAddress {
    /// The object.
    pub index: ObjectIndex,
    /// The entry; with complete access 0 or 1, the entry to begin with.
    pub subindex: u8,
}

impl ObjectAddress {
    /// The entry with these numbers.
    #[must_use]
    pub const fn new(index: u16, subindex: u8) -> Self {
        Self { index: ObjectIndex(index), subindex }
    }

    pub(super) const fn from_bytes(bytes: [u8; 3]) -> Self {
        let [low, high, subindex] = bytes;
        Self::new(u16::from_le_bytes([low, high]), subindex)
    }

    pub(super) const fn to_bytes(self) -> [u8; 3] {
        let [low, high] = self.index.0.to_le_bytes();
        [low, high, self.subindex]
    }
}

impl fmt::Display for ObjectAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{:02X}", self.index, self.subindex)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_written_as_engineers_write_them() {
        assert_eq!(ObjectAddress::new(0x1C12, 0x1A).to_string(), "0x1C12:1A");
        assert_eq!(ObjectIndex::pdo_assignment(3), Some(ObjectIndex(0x1C13)));
        assert_eq!(ObjectIndex::pdo_assignment(32), None);
    }
}
