//! The configuration of an FMMU: sixteen bytes at 0x0600 + 16 n.
//!
//! Reference: S2 2.13; S1, FMMU. An FMMU maps a run of logical bits to a run of bits in the
//! controller's memory, one to one and in order. Mapping whole bytes is the special case with start
//! bit 0 and stop bit 7.

use std::fmt;

use super::table;
use crate::address::{LogicalAddress, RegisterAddress};

/// The sixteen bytes of an FMMU.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub struct FmmuConfig {
    /// First logical byte.
    pub logical_start: LogicalAddress,
    /// Logical bytes spanned, first and last included, however few bits of them are mapped.
    pub length: u16,
    /// First bit mapped in the first logical byte, 0..=7.
    pub logical_start_bit: u8,
    /// Last bit mapped in the last logical byte, 0..=7.
    pub logical_stop_bit: u8,
    /// First byte in the controller's memory.
    pub physical_start: RegisterAddress,
    /// First bit in that byte, 0..=7.
    pub physical_start_bit: u8,
    /// Whether logical reads are mapped: inputs.
    pub reads: bool,
    /// Whether logical writes are mapped: outputs.
    pub writes: bool,
    /// Whether it is switched on.
    pub active: bool,
}

impl FmmuConfig {
    /// Length of the configuration in bytes.
    pub const LEN: usize = 16;

    /// Maps `length` whole bytes of inputs.
    #[must_use]
    pub const fn inputs(logical: LogicalAddress, length: u16, physical: RegisterAddress) -> Self {
        Self { reads: true, ..Self::whole_bytes(logical, length, physical) }
    }

    /// Maps `length` whole bytes of outputs.
    #[must_use]
    pub const fn outputs(logical: LogicalAddress, length: u16, physical: RegisterAddress) -> Self {
        Self { writes: true, ..Self::whole_bytes(logical, length, physical) }
    }

    /// Maps the full bit of a mailbox in, bit 3 of the status of SyncManager `index`, to one
    /// logical bit; `None` for a SyncManager that does not exist.
    #[must_use]
    pub const fn mailbox_full(logical: LogicalAddress, bit: u8, index: u16) -> Option<Self> {
        match table::SYNC_MANAGER.at(index) {
            Some(start) => Some(Self {
                logical_start_bit: bit & 7,
                logical_stop_bit: bit & 7,
                physical_start_bit: 3,
                ..Self::inputs(logical, 1, RegisterAddress(start.0 + 5))
            }),
            None => None,
        }
    }

    const fn whole_bytes(logical: LogicalAddress, length: u16, physical: RegisterAddress) -> Self {
        Self {
            logical_start: logical,
            length,
            logical_start_bit: 0,
            logical_stop_bit: 7,
            physical_start: physical,
            physical_start_bit: 0,
            reads: false,
            writes: false,
            active: true,
        }
    }

    /// From the sixteen bytes; reserved bits are dropped.
    #[must_use]
    pub const fn from_bytes(bytes: [u8; Self::LEN]) -> Self {
        let [l0, l1, l2, l3, n0, n1, start, stop, p0, p1, physical_bit, kind, active, _, _, _] =
            bytes;
        Self {
            logical_start: LogicalAddress(u32::from_le_bytes([l0, l1, l2, l3])),
            length: u16::from_le_bytes([n0, n1]),
            logical_start_bit: start & 7,
            logical_stop_bit: stop & 7,
            physical_start: RegisterAddress(u16::from_le_bytes([p0, p1])),
            physical_start_bit: physical_bit & 7,
            reads: kind & 1 != 0,
            writes: kind & 2 != 0,
            active: active & 1 != 0,
        }
    }

    /// The sixteen bytes.
    #[must_use]
    pub const fn to_bytes(&self) -> [u8; Self::LEN] {
        let [l0, l1, l2, l3] = self.logical_start.0.to_le_bytes();
        let [n0, n1] = self.length.to_le_bytes();
        let [p0, p1] = self.physical_start.0.to_le_bytes();
        [
            l0,
            l1,
            l2,
            l3,
            n0,
            n1,
            self.logical_start_bit & 7,
            self.logical_stop_bit & 7,
            p0,
            p1,
            self.physical_start_bit & 7,
            self.reads as u8 | (self.writes as u8) << 1,
            self.active as u8,
            0,
            0,
            0,
        ]
    }

    /// Whether it maps whole bytes to whole bytes.
    #[must_use]
    pub const fn is_bytewise(&self) -> bool {
        self.logical_start_bit == 0 && self.logical_stop_bit == 7 && self.physical_start_bit == 0
    }

    /// How many bits it maps; 0 for a configuration that ends before it begins.
    #[must_use]
    pub const fn bit_len(&self) -> u32 {
        if self.length == 0 {
            return 0;
        }
        let stop = (self.length as u32 - 1) * 8 + self.logical_stop_bit as u32 + 1;
        stop.saturating_sub(self.logical_start_bit as u32)
    }

    /// Where a logical bit lies in the controller's memory: byte and bit. `None` for bits that it
    /// does not map. Whether it is active, and in which direction, is not looked at.
    #[must_use]
    pub const fn locate_bit(&self, at: LogicalAddress, bit: u8) -> Option<(RegisterAddress, u8)> {
        // In 64 bits, since neither address space is left on the way.
        let Some(distance) = (at.0 as u64).checked_sub(self.logical_start.0 as u64) else {
            return None;
        };
        let position = distance * 8 + (bit & 7) as u64;
        let Some(mapped) = position.checked_sub(self.logical_start_bit as u64) else {
            return None;
        };
        if mapped >= self.bit_len() as u64 {
            return None;
        }
        let physical = self.physical_start.0 as u64 * 8 + self.physical_start_bit as u64 + mapped;
        if physical / 8 > u16::MAX as u64 {
            return None;
        }
        Some((RegisterAddress((physical / 8) as u16), (physical % 8) as u8))
    }

    /// The part of a logical datagram of `length` bytes from `start` that it spans. For a bytewise
    /// FMMU this is all there is to know; for a bitwise one see [`locate_bit`](Self::locate_bit).
    #[must_use]
    pub const fn overlap(&self, start: LogicalAddress, length: u16) -> Option<FmmuOverlap> {
        let (own, other) = (self.logical_start.0 as u64, start.0 as u64);
        let from = if own > other { own } else { other };
        let (own_end, other_end) = (own + self.length as u64, other + length as u64);
        let to = if own_end < other_end { own_end } else { other_end };
        if from >= to {
            return None;
        }
        // Both distances fit: each is below a 16-bit length.
        Some(FmmuOverlap {
            datagram_offset: (from - other) as u16,
            fmmu_offset: (from - own) as u16,
            length: (to - from) as u16,
        })
    }
}

impl fmt::Display for FmmuConfig {
    /// `0x01000000, 4 bytes, at 0x1100, writes, on` for whole bytes; with bits,
    /// `0x00010011 bit 3 to 0x00010013 bit 0, at 0x0F01 bit 1, writes, on`; `off` for one that was
    /// never set up.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.length == 0 && !self.active {
            return f.write_str("off");
        }
        if self.is_bytewise() {
            let bytes = if self.length == 1 { "byte" } else { "bytes" };
            let (logical, physical) = (self.logical_start, self.physical_start);
            write!(f, "{logical}, {} {bytes}, at {physical}, ", self.length)?;
        } else {
            let last = self.logical_start.0.saturating_add(u32::from(self.length).max(1) - 1);
            let (logical, start, stop) =
                (self.logical_start, self.logical_start_bit, self.logical_stop_bit);
            write!(f, "{logical} bit {start} to {} bit {stop}, ", LogicalAddress(last))?;
            write!(f, "at {} bit {}, ", self.physical_start, self.physical_start_bit)?;
        }
        f.write_str(match (self.reads, self.writes) {
            (false, false) => "neither reads nor writes, ",
            (true, false) => "reads, ",
            (false, true) => "writes, ",
            (true, true) => "reads and writes, ",
        })?;
        f.write_str(if self.active { "on" } else { "off" })
    }
}

/// How the register table writes this register.
pub(super) fn view(offset: u16, data: &[u8]) -> Option<String> {
    let bytes = data.first_chunk().filter(|_| offset == 0)?;
    Some(FmmuConfig::from_bytes(*bytes).to_string())
}

/// Which bytes an FMMU and a logical datagram have in common.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct FmmuOverlap {
    /// The first of them, counted from the start of the datagram's data.
    pub datagram_offset: u16,
    /// The first of them, counted from the FMMU's logical start.
    pub fmmu_offset: u16,
    /// How many.
    pub length: u16,
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The example of S1: logical 0x10011 bit 3 to 0x10013 bit 0, at physical 0x0F01 bit 1.
    const EXAMPLE: FmmuConfig = FmmuConfig {
        logical_start: LogicalAddress(0x10011),
        length: 3,
        logical_start_bit: 3,
        logical_stop_bit: 0,
        physical_start: RegisterAddress(0x0F01),
        physical_start_bit: 1,
        reads: false,
        writes: true,
        active: true,
    };

    #[test]
    fn the_bitwise_example_of_the_data_sheet() {
        assert_eq!(EXAMPLE.bit_len(), 14);
        assert!(!EXAMPLE.is_bytewise());
        assert_eq!(
            EXAMPLE.to_string(),
            "0x00010011 bit 3 to 0x00010013 bit 0, at 0x0F01 bit 1, writes, on"
        );
        let locate = |at, bit| EXAMPLE.locate_bit(LogicalAddress(at), bit);
        assert_eq!(locate(0x10011, 2), None);
        assert_eq!(locate(0x10011, 3), Some((RegisterAddress(0x0F01), 1)));
        assert_eq!(locate(0x10011, 7), Some((RegisterAddress(0x0F01), 5)));
        assert_eq!(locate(0x10012, 0), Some((RegisterAddress(0x0F01), 6)));
        assert_eq!(locate(0x10012, 2), Some((RegisterAddress(0x0F02), 0)));
        assert_eq!(locate(0x10013, 0), Some((RegisterAddress(0x0F02), 6)));
        assert_eq!(locate(0x10013, 1), None);
        assert_eq!(locate(0x10010, 7), None);
    }

    #[test]
    fn whole_bytes_as_maindevices_write_them() {
        let config = FmmuConfig::outputs(LogicalAddress(0x0100_0000), 4, RegisterAddress(0x1100));
        let bytes = [0, 0, 0, 1, 4, 0, 0, 7, 0x00, 0x11, 0, 2, 1, 0, 0, 0];
        assert_eq!(config.to_bytes(), bytes);
        assert_eq!(FmmuConfig::from_bytes(bytes), config);
        assert!(config.is_bytewise());
        assert_eq!(config.bit_len(), 32);
        assert_eq!(config.to_string(), "0x01000000, 4 bytes, at 0x1100, writes, on");
        assert_eq!(FmmuConfig::default().to_string(), "off");
        let inputs = FmmuConfig::inputs(LogicalAddress(0), 4, RegisterAddress(0x1140));
        assert_eq!(inputs.to_bytes()[11], 1);
    }

    #[test]
    fn the_full_bit_of_a_mailbox() {
        let config = FmmuConfig::mailbox_full(LogicalAddress(0x800), 5, 1).unwrap();
        assert_eq!(config.physical_start, RegisterAddress(0x080D));
        assert_eq!(config.bit_len(), 1);
        assert_eq!(config.locate_bit(LogicalAddress(0x800), 5), Some((RegisterAddress(0x080D), 3)));
        assert_eq!(config.locate_bit(LogicalAddress(0x800), 4), None);
        assert_eq!(FmmuConfig::mailbox_full(LogicalAddress(0), 0, 16), None);
    }

    #[test]
    fn overlaps_with_a_datagram() {
        let config = FmmuConfig::inputs(LogicalAddress(0x1000), 8, RegisterAddress(0x1100));
        let overlap = |start, length| {
            config
                .overlap(LogicalAddress(start), length)
                .map(|part| (part.datagram_offset, part.fmmu_offset, part.length))
        };
        assert_eq!(overlap(0x1000, 8), Some((0, 0, 8)));
        assert_eq!(overlap(0x0FFC, 32), Some((4, 0, 8)));
        assert_eq!(overlap(0x1004, 2), Some((0, 4, 2)));
        assert_eq!(overlap(0x1006, 8), Some((0, 6, 2)));
        assert_eq!(overlap(0x1008, 8), None);
        assert_eq!(overlap(0x0FF8, 8), None);
        assert_eq!(overlap(0x1000, 0), None);
        // At the very end of the logical space.
        let last = FmmuConfig::inputs(LogicalAddress(u32::MAX), 4, RegisterAddress(0x1100));
        let part = last.overlap(LogicalAddress(u32::MAX - 1), 100).unwrap();
        assert_eq!((part.datagram_offset, part.length), (1, 4));
    }

    #[test]
    fn senseless_configurations_map_nothing() {
        let empty = FmmuConfig { length: 0, ..EXAMPLE };
        assert_eq!(empty.bit_len(), 0);
        assert_eq!(empty.locate_bit(LogicalAddress(0x10011), 3), None);
        let backwards =
            FmmuConfig { length: 1, logical_start_bit: 5, logical_stop_bit: 2, ..EXAMPLE };
        assert_eq!(backwards.bit_len(), 0);
        let beyond = FmmuConfig::inputs(LogicalAddress(0), 2, RegisterAddress(0xFFFF));
        assert_eq!(beyond.locate_bit(LogicalAddress(1), 0), None);
    }

    proptest! {
        #[test]
        fn configurations_survive_the_register(
            logical: u32, length: u16, start in 0u8..8, stop in 0u8..8,
            physical: u16, physical_bit in 0u8..8, reads: bool, writes: bool, active: bool,
        ) {
            let config = FmmuConfig {
                logical_start: LogicalAddress(logical),
                length,
                logical_start_bit: start,
                logical_stop_bit: stop,
                physical_start: RegisterAddress(physical),
                physical_start_bit: physical_bit,
                reads,
                writes,
                active,
            };
            prop_assert_eq!(FmmuConfig::from_bytes(config.to_bytes()), config);
        }

        /// The bits located are exactly as many as the FMMU says, side by side in memory.
        #[test]
        fn located_bits_are_contiguous(
            length in 1u16..6, start in 0u8..8, stop in 0u8..8, physical_bit in 0u8..8,
        ) {
            let config = FmmuConfig {
                length,
                logical_start_bit: start,
                logical_stop_bit: stop,
                physical_start_bit: physical_bit,
                ..EXAMPLE
            };
            let first = config.logical_start.0 - 1;
            let located: Vec<u32> = (first..first + u32::from(length) + 2)
                .flat_map(|at| (0..8).map(move |bit| (at, bit)))
                .filter_map(|(at, bit)| config.locate_bit(LogicalAddress(at), bit))
                .map(|(byte, bit)| u32::from(byte.0) * 8 + u32::from(bit))
                .collect();
            let begin = u32::from(config.physical_start.0) * 8 + u32::from(physical_bit);
            let expected: Vec<u32> = (begin..begin + config.bit_len()).collect();
            prop_assert_eq!(located, expected);
        }
    }
}
