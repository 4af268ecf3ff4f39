//! Category 41, SyncManager: where each buffer lies by default and what it is for, 8 bytes each.
//!
//! Reference: ETG.2010; S2 on registers 0x0800..=0x087F, whose first bytes the record repeats.
//! Record *n* belongs to SyncManager *n*.

use crate::address::RegisterAddress;

/// What a SyncManager's buffer holds.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub enum SyncManagerKind {
    /// 0: not used.
    #[default]
    Unused,
    /// 1: mailbox from MainDevice to SubDevice.
    MailboxOut,
    /// 2: mailbox from SubDevice to MainDevice.
    MailboxIn,
    /// 3: process data from MainDevice to SubDevice.
    Outputs,
    /// 4: process data from SubDevice to MainDevice.
    Inputs,
    /// Another code.
    Other(u8),
}

impl SyncManagerKind {
    /// The kind with this code; object 0x1C00 uses the same codes.
    #[must_use]
    pub const fn from_code(code: u8) -> Self {
        match code {
            0 => Self::Unused,
            1 => Self::MailboxOut,
            2 => Self::MailboxIn,
            3 => Self::Outputs,
            4 => Self::Inputs,
            other => Self::Other(other),
        }
    }

    /// The code in the image.
    #[must_use]
    pub const fn code(self) -> u8 {
        match self {
            Self::Unused => 0,
            Self::MailboxOut => 1,
            Self::MailboxIn => 2,
            Self::Outputs => 3,
            Self::Inputs => 4,
            Self::Other(code) => code,
        }
    }
}

/// How a SyncManager is to be switched on.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct SyncManagerEnable(pub u8);

impl SyncManagerEnable {
    /// Bit 0: switch it on. Where it is 0, a MainDevice may still do so when PDOs map to it.
    #[must_use]
    pub const fn enabled(self) -> bool {
        self.0 & 0x01 != 0
    }

    /// Bit 1: its content is fixed.
    #[must_use]
    pub const fn fixed(self) -> bool {
        self.0 & 0x02 != 0
    }

    /// Bit 2: virtual, there is no such SyncManager in the controller.
    #[must_use]
    pub const fn is_virtual(self) -> bool {
        self.0 & 0x04 != 0
    }

    /// Bit 3: switch it on in OP only.
    #[must_use]
    pub const fn op_only(self) -> bool {
        self.0 & 0x08 != 0
    }
}

/// One record.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct SyncManager {
    /// Physical start address, register +0.
    pub start: RegisterAddress,
    /// Default length in bytes, register +2. Often 0 for process data: the PDOs tell then.
    pub length: u16,
    /// Control byte, register +4.
    pub control: u8,
    /// Status byte, register +5; don't care.
    pub status: u8,
    /// How to switch it on.
    pub enable: SyncManagerEnable,
    /// What it is for.
    pub kind: SyncManagerKind,
}

impl SyncManager {
    /// Length of a record in bytes.
    pub const LEN: usize = 8;

    /// The record in 8 bytes of an image.
    #[must_use]
    pub const fn from_bytes(bytes: [u8; Self::LEN]) -> Self {
        let [start_low, start_high, len_low, len_high, control, status, enable, kind] = bytes;
        Self {
            start: RegisterAddress(u16::from_le_bytes([start_low, start_high])),
            length: u16::from_le_bytes([len_low, len_high]),
            control,
            status,
            enable: SyncManagerEnable(enable),
            kind: SyncManagerKind::from_code(kind),
        }
    }

    /// The 8 bytes of an image.
    #[must_use]
    pub const fn to_bytes(self) -> [u8; Self::LEN] {
        let [start_low, start_high] = self.start.value().to_le_bytes();
        let [len_low, len_high] = self.length.to_le_bytes();
        [
            start_low,
            start_high,
            len_low,
            len_high,
            self.control,
            self.status,
            self.enable.0,
            self.kind.code(),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mailbox_of_a_drive_and_the_outputs_of_a_terminal() {
        // AKD, SyncManager 0; EL2004, SyncManager 0: enabled in OP only.
        let mailbox = SyncManager::from_bytes([0x00, 0x18, 0x00, 0x04, 0x26, 0, 1, 1]);
        assert_eq!((mailbox.start, mailbox.length), (RegisterAddress(0x1800), 1024));
        assert_eq!(mailbox.kind, SyncManagerKind::MailboxOut);
        let outputs = SyncManager::from_bytes([0x00, 0x0F, 0, 0, 0x44, 0, 0x09, 3]);
        assert_eq!(outputs.kind, SyncManagerKind::Outputs);
        assert!(outputs.enable.enabled() && outputs.enable.op_only());
        assert!(!outputs.enable.fixed() && !outputs.enable.is_virtual());
    }

    #[test]
    fn records_go_back_as_they_came() {
        for code in 0..=u8::MAX {
            let bytes = [1, 2, 3, 4, code, !code, code ^ 0x55, code];
            assert_eq!(SyncManager::from_bytes(bytes).to_bytes(), bytes);
        }
    }
}
