//! Category 60, DC: the operation modes with distributed clocks, 24 bytes each.
//!
//! Reference: ETG.2010; the same values stand in the ESI as `Dc/OpMode` (ETG.2000).

use super::strings::StringIndex;

/// One way to run with (or without) distributed clocks.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct OpMode {
    /// Cycle of SYNC0 in ns; 0 means the MainDevice's cycle times [`OpMode::sync0_cycle_factor`].
    pub sync0_cycle_ns: u32,
    /// Shift of SYNC0 in ns.
    pub sync0_shift_ns: i32,
    /// Shift of SYNC1 in ns.
    pub sync1_shift_ns: i32,
    /// Cycle of SYNC1 in cycles of SYNC0.
    pub sync1_cycle_factor: i16,
    /// What to write to registers 0x0980 (low byte) and 0x0981 (high byte); 0 means without SYNC.
    pub assign_activate: u16,
    /// Positive: SYNC0 every n cycles. Negative: n times within a cycle (oversampling).
    pub sync0_cycle_factor: i16,
    /// Its name, such as "DcSync".
    pub name: StringIndex,
    /// Its description.
    pub description: StringIndex,
    /// Reserved; kept.
    pub reserved: [u8; 4],
}

impl OpMode {
    /// Length of a record in bytes.
    pub const LEN: usize = 24;

    /// The record in 24 bytes of an image.
    #[must_use]
    pub const fn from_bytes(bytes: &[u8; Self::LEN]) -> Self {
        const fn four(bytes: &[u8; OpMode::LEN], at: usize) -> [u8; 4] {
            [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]
        }
        Self {
            sync0_cycle_ns: u32::from_le_bytes(four(bytes, 0)),
            sync0_shift_ns: i32::from_le_bytes(four(bytes, 4)),
            sync1_shift_ns: i32::from_le_bytes(four(bytes, 8)),
            sync1_cycle_factor: i16::from_le_bytes([bytes[12], bytes[13]]),
            assign_activate: u16::from_le_bytes([bytes[14], bytes[15]]),
            sync0_cycle_factor: i16::from_le_bytes([bytes[16], bytes[17]]),
            name: StringIndex(bytes[18]),
            description: StringIndex(bytes[19]),
            reserved: four(bytes, 20),
        }
    }

    /// The 24 bytes of an image.
    #[must_use]
    pub fn to_bytes(self) -> [u8; Self::LEN] {
        let mut bytes = [0; Self::LEN];
        bytes[..4].copy_from_slice(&self.sync0_cycle_ns.to_le_bytes());
        bytes[4..8].copy_from_slice(&self.sync0_shift_ns.to_le_bytes());
        bytes[8..12].copy_from_slice(&self.sync1_shift_ns.to_le_bytes());
        bytes[12..14].copy_from_slice(&self.sync1_cycle_factor.to_le_bytes());
        bytes[14..16].copy_from_slice(&self.assign_activate.to_le_bytes());
        bytes[16..18].copy_from_slice(&self.sync0_cycle_factor.to_le_bytes());
        bytes[18] = self.name.0;
        bytes[19] = self.description.0;
        bytes[20..].copy_from_slice(&self.reserved);
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_field_keeps_its_place() {
        let mode = OpMode {
            sync0_cycle_ns: 0x0102_0304,
            sync0_shift_ns: -5,
            sync1_shift_ns: 6,
            sync1_cycle_factor: -8,
            assign_activate: 0x0730,
            sync0_cycle_factor: -1,
            name: StringIndex(5),
            description: StringIndex(6),
            reserved: [1, 2, 3, 4],
        };
        let bytes = mode.to_bytes();
        assert_eq!(bytes[..8], [4, 3, 2, 1, 0xFB, 0xFF, 0xFF, 0xFF]);
        assert_eq!(bytes[12..20], [0xF8, 0xFF, 0x30, 0x07, 0xFF, 0xFF, 5, 6]);
        assert_eq!(OpMode::from_bytes(&bytes), mode);
    }
}
