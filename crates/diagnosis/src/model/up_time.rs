//! Time since a controller came up, as its own clock tells.
//!
//! The clock of a controller begins at 0 when its supply comes (SOEM#48), and runs on whatever links do meanwhile: how
//! long the supply was away shows beside how long nothing answered. What is read at 0x0910 is that time with the offset
//! (0x0920) added and the delay (0x0928) taken off (S2 2.15.2).

use linesman_proto::register::SYSTEM_TIME;
use linesman_proto::time::Instant;

/// A clock of 32 bits begins anew after so many ns.
const WRAP: u64 = 1 << 32;
/// Offset and delay lie so many bytes behind the system time.
const OFFSET_AT: usize = 16;
const DELAY_AT: usize = 24;
/// Nobody is away for longer than so many times a clock of 32 bits wraps.
const MOST_WRAPS: u64 = 64;

/// A reading of a controller's own time.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct UpTime {
    /// When it was read.
    read_at: Instant,
    /// What the clock showed, in ns, without offset and delay.
    local_ns: u64,
    /// True if the upper half was 0: then it may be a clock of 32 bits.
    may_wrap: bool,
}

impl UpTime {
    /// Where it is read, and how many bytes: system time, offset and delay in one frame.
    pub const REGISTERS: (u16, u16) = (SYSTEM_TIME.address.0, Self::LEN as u16);
    const LEN: usize = 28;

    /// What these registers said, read at `at`; `None` where there is no clock.
    #[must_use]
    pub fn from_bytes(bytes: &[u8], at: Instant) -> Option<Self> {
        let bytes: &[u8; Self::LEN] = bytes.first_chunk()?;
        let long = |from: usize| bytes[from..].first_chunk().map(|part| u64::from_le_bytes(*part));
        let (system, offset) = (long(0)?, long(OFFSET_AT)?);
        let delay = bytes[DELAY_AT..].first_chunk().map(|part| u32::from_le_bytes(*part))?;
        if bytes.iter().all(|byte| *byte == 0) {
            return None;
        }
        let local = system.wrapping_sub(offset).wrapping_add(u64::from(delay));
        let may_wrap = system >> 32 == 0;
        let local_ns = if may_wrap { local % WRAP } else { local };
        Some(Self { read_at: at, local_ns, may_wrap })
    }

    /// When the clock was read.
    #[must_use]
    pub const fn read_at(&self) -> Instant {
        self.read_at
    }

    /// When the controller came up, if that was between two times; `None` where it was not, or where the clock leaves
    /// more than one time open.
    #[must_use]
    pub fn began_within(&self, from: Instant, to: Instant) -> Option<Instant> {
        let wraps = if self.may_wrap { MOST_WRAPS } else { 0 };
        let mut all = (0..=wraps)
            .map_while(|wrapped| {
                let up = self.local_ns.checked_add(wrapped * WRAP)?;
                self.read_at.as_nanos().checked_sub(up).map(Instant::from_nanos)
            })
            .filter(|began| (from..=to).contains(began));
        let one = all.next();
        one.filter(|_| all.next().is_none())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(system: u64, offset: i64, delay: u32, at_ms: u64) -> Option<UpTime> {
        let mut bytes = [0; 28];
        bytes[..8].copy_from_slice(&system.to_le_bytes());
        bytes[16..24].copy_from_slice(&offset.to_le_bytes());
        bytes[24..].copy_from_slice(&delay.to_le_bytes());
        UpTime::from_bytes(&bytes, Instant::from_nanos(at_ms * 1_000_000))
    }

    fn ms(ms: u64) -> Instant {
        Instant::from_nanos(ms * 1_000_000)
    }

    #[test]
    fn clock_tells_when_the_controller_came_up_whatever_was_written_to_it() {
        let began = |up: Option<UpTime>| up.unwrap().began_within(ms(4_000), ms(9_000));
        // Read at 10 s, 2.5 s after it came up.
        assert_eq!(began(read(2_500_000_000, 0, 0, 10_000)), Some(ms(7_500)));
        let offset = 700_000_000_000_000_000;
        assert_eq!(
            began(read(2_500_000_000 + offset as u64 - 145, offset, 145, 10_000)),
            Some(ms(7_500))
        );
        assert_eq!(began(read(2_499_000_000, -1_000_000, 0, 10_000)), Some(ms(7_500)));
        // It has been up all the time.
        assert_eq!(began(read(900_000_000_000, 0, 0, 10_000)), None);
    }

    #[test]
    fn clock_of_32_bits_may_leave_it_open() {
        let up = read(500_000_000, 0, 0, 10_000).unwrap();
        assert_eq!(up.began_within(ms(9_000), ms(10_000)), Some(ms(9_500)));
        assert_eq!(up.began_within(ms(5_000), ms(6_000)), Some(Instant::from_nanos(5_205_032_704)));
        assert_eq!(up.began_within(ms(5_000), ms(10_000)), None, "once or twice round");
    }

    #[test]
    fn controller_without_a_clock_tells_nothing() {
        assert_eq!(read(0, 0, 0, 10_000), None);
        assert_eq!(UpTime::from_bytes(&[1; 27], Instant::ZERO), None);
    }
}
