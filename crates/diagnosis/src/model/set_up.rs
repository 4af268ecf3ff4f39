//! Set-up of one controller beside its FMMUs: SyncManagers and distributed clock, as they were written or read.

use std::collections::BTreeMap;

use linesman_proto::address::RegisterAddress;
use linesman_proto::register::{self, SyncManagerConfig};

use super::Seen;

/// Sixteen SyncManagers of eight bytes. Reference: S2 2.14.
pub(super) const SYNC_MANAGERS: std::ops::Range<u16> = {
    let first = register::SYNC_MANAGER.address.0;
    first..first + 16 * SyncManagerConfig::LEN as u16
};
const SYSTEM_TIME_OFFSET: u16 = 0x0920;
const SYSTEM_TIME_DELAY: u16 = 0x0928;
const ACTIVATION: u16 = 0x0981;
const START_TIME: u16 = 0x0990;
const SYNC0_CYCLE: u16 = 0x09A0;
const SYNC1_CYCLE: u16 = 0x09A4;

/// SyncManagers and distributed clock of a controller.
#[derive(Clone, Default, Debug)]
pub struct SetUp {
    /// SyncManagers by number, from 0x0800 on, as last written, or as read where nobody was seen to write them.
    pub sync_managers: BTreeMap<u8, SyncManagerConfig>,
    /// Distributed clock.
    pub clock: ClockSetUp,
}

/// Registers of the distributed clock; `None` for what was neither written nor read. Reference: S2 2.15.
#[derive(Clone, Copy, Default, Debug)]
pub struct ClockSetUp {
    /// 0x0920: system time minus local time, in ns.
    pub offset_ns: Option<Seen<i64>>,
    /// 0x0928: propagation delay from the reference clock, in ns.
    pub delay_ns: Option<Seen<u32>>,
    /// 0x0981: which SYNC signals are switched on.
    pub activation: Option<Seen<u8>>,
    /// 0x0990: system time of the first SYNC pulse, in ns.
    pub start_ns: Option<Seen<u64>>,
    /// 0x09A0: cycle of SYNC0, in ns.
    pub sync0_ns: Option<Seen<u32>>,
    /// 0x09A4: time from SYNC0 to SYNC1, in ns.
    pub sync1_ns: Option<Seen<u32>>,
}

impl ClockSetUp {
    /// True if nothing of it was seen.
    #[must_use]
    pub const fn is_unknown(&self) -> bool {
        self.offset_ns.is_none()
            && self.delay_ns.is_none()
            && self.activation.is_none()
            && self.start_ns.is_none()
            && self.sync0_ns.is_none()
            && self.sync1_ns.is_none()
    }
}

impl SetUp {
    /// Takes `data` that were written from `start` on.
    pub(super) fn written(&mut self, start: RegisterAddress, data: &[u8], seen: Seen<()>) {
        if SYNC_MANAGERS.contains(&start.0) {
            self.write_sync_managers(start, data);
        } else if start.0 >= SYSTEM_TIME_OFFSET && start.0 <= SYNC1_CYCLE {
            self.note_clock(start, data, seen);
        }
    }

    /// Takes `data` that were read from `start` on.
    pub(super) fn read(&mut self, start: RegisterAddress, data: &[u8], seen: Seen<()>) {
        if SYNC_MANAGERS.contains(&start.0) {
            for (number, bytes) in whole_sync_managers(start, data) {
                let read = SyncManagerConfig::from_bytes(bytes);
                self.sync_managers.entry(number).or_insert(read);
            }
        } else if start.0 >= SYSTEM_TIME_OFFSET && start.0 <= SYNC1_CYCLE {
            self.note_clock(start, data, seen);
        }
    }

    /// Writes of single bytes, such as to activate a SyncManager, change one that is known.
    fn write_sync_managers(&mut self, start: RegisterAddress, data: &[u8]) {
        for (number, bytes) in whole_sync_managers(start, data) {
            self.sync_managers.insert(number, SyncManagerConfig::from_bytes(bytes));
        }
        let end = usize::from(start.0) + data.len();
        for (number, known) in &mut self.sync_managers {
            let first = SYNC_MANAGERS.start + u16::from(*number) * SyncManagerConfig::LEN as u16;
            let mut bytes = known.to_bytes();
            for (address, byte) in (first..).zip(&mut bytes) {
                if address >= start.0 && usize::from(address) < end {
                    *byte = data[usize::from(address - start.0)];
                }
            }
            *known = SyncManagerConfig::from_bytes(bytes);
        }
    }

    fn note_clock(&mut self, start: RegisterAddress, data: &[u8], seen: Seen<()>) {
        let clock = &mut self.clock;
        if let Some(bytes) = bytes_at(data, start, SYSTEM_TIME_OFFSET) {
            clock.offset_ns = Some(told(i64::from_le_bytes(bytes), seen));
        }
        if let Some(bytes) = bytes_at(data, start, SYSTEM_TIME_DELAY) {
            clock.delay_ns = Some(told(u32::from_le_bytes(bytes), seen));
        }
        if let Some([byte]) = bytes_at(data, start, ACTIVATION) {
            clock.activation = Some(told(byte, seen));
        }
        if let Some(bytes) = bytes_at(data, start, START_TIME) {
            clock.start_ns = Some(told(u64::from_le_bytes(bytes), seen));
        }
        if let Some(bytes) = bytes_at(data, start, SYNC0_CYCLE) {
            clock.sync0_ns = Some(told(u32::from_le_bytes(bytes), seen));
        }
        if let Some(bytes) = bytes_at(data, start, SYNC1_CYCLE) {
            clock.sync1_ns = Some(told(u32::from_le_bytes(bytes), seen));
        }
    }
}

/// SyncManagers of which all eight bytes are in `data`.
fn whole_sync_managers(
    start: RegisterAddress,
    data: &[u8],
) -> impl Iterator<Item = (u8, [u8; SyncManagerConfig::LEN])> + '_ {
    // Many poll a single byte of them, which is none as a whole.
    let numbers = if data.len() < SyncManagerConfig::LEN { 0..0 } else { 0..16_u8 };
    numbers.filter_map(move |number| {
        let address = SYNC_MANAGERS.start + u16::from(number) * SyncManagerConfig::LEN as u16;
        Some((number, bytes_at(data, start, address)?))
    })
}

fn bytes_at<const N: usize>(data: &[u8], start: RegisterAddress, address: u16) -> Option<[u8; N]> {
    let offset = usize::from(address.checked_sub(start.0)?);
    data.get(offset..)?.first_chunk().copied()
}

const fn told<T>(value: T, seen: Seen<()>) -> Seen<T> {
    Seen::new(value, seen.at, seen.frame)
}

#[cfg(test)]
mod tests {
    use linesman_proto::time::Instant;

    use super::*;

    const SEEN: Seen<()> = Seen::new((), Instant::ZERO, Some(3));

    #[test]
    fn sync_manager_written_in_two_parts_has_both() {
        let mut set_up = SetUp::default();
        let first = [0x00, 0x10, 0x80, 0x00, 0x26, 0x00, 0x00, 0x00];
        set_up.written(RegisterAddress(0x0808), &first, SEEN);
        assert!(!set_up.sync_managers[&1].activate.enable());
        set_up.written(RegisterAddress(0x080E), &[1], SEEN);
        let config = set_up.sync_managers[&1];
        assert!(config.activate.enable());
        assert_eq!((config.start.0, config.length), (0x1000, 0x80));
        set_up.written(RegisterAddress(0x0816), &[1], SEEN);
        assert_eq!(set_up.sync_managers.len(), 1, "of SyncManager 2 nothing but a bit is known");
    }

    #[test]
    fn sync_manager_that_is_read_does_not_replace_what_was_written() {
        let mut set_up = SetUp::default();
        set_up.written(RegisterAddress(0x0800), &[0, 0x10, 0x80, 0, 0x26, 0, 1, 0], SEEN);
        set_up.read(RegisterAddress(0x0800), &[0; 16], SEEN);
        assert_eq!(set_up.sync_managers[&0].length, 0x80);
        assert_eq!(set_up.sync_managers[&1].length, 0, "the second is known by the reading");
    }

    #[test]
    fn clock_registers_are_known_where_all_their_bytes_were_seen() {
        let mut set_up = SetUp::default();
        assert!(set_up.clock.is_unknown());
        set_up.written(RegisterAddress(0x09A0), &[0x40, 0x42, 0x0F, 0, 1, 0], SEEN);
        assert_eq!(set_up.clock.sync0_ns.map(|seen| seen.value), Some(1_000_000));
        assert!(set_up.clock.sync1_ns.is_none(), "two of four bytes");
        set_up.written(RegisterAddress(0x0920), &(-5_i64).to_le_bytes(), SEEN);
        assert_eq!(set_up.clock.offset_ns.map(|seen| seen.value), Some(-5));
    }
}
