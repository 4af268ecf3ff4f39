//! Servo that keeps the cycle in step with the reference clock: the MainDevice is one of the clocks
//! that follow.
//!
//! The datagram that distributes the system time brings that time back: it says when, by the reference
//! clock, the frame was there. The next batches are moved so that the frame is there when a cycle
//! begins, that is at a multiple of the cycle time (SYN-09; SYNC0 falls its shift later). A
//! proportional and an integral part follow a quartz that is off and drifts.

use linesman_proto::time::{DcTime, Instant, Span};

use crate::network_group::SPEED_PLACES;

/// So much of the phase is corrected each cycle: 1/16.
const PROPORTIONAL: i64 = 16;
/// And so much is learnt of the speed: 1/512.
const INTEGRAL: i64 = 512;
/// At most this part of a cycle: 1/100.
const MOST: i64 = 100;
/// Further off than this part of a cycle it is not followed but taken over: 1/10.
const JUMP: i64 = 10;
/// So many frames in a row have to be as far off: one that this computer sent late says nothing of the clocks.
const FAR_OFF: u32 = 3;

/// The controller. Without a reference clock that was set it does nothing.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct DcServo {
    /// How often the reference was set, and the system time at the start of the run.
    base: Option<(u32, DcTime)>,
    /// The reference's time in the last frame that brought it, of which frames bring the low half only, and
    /// when that came back.
    time: Option<(Instant, i64)>,
    /// What the cycle is too short, in 1/512 ns.
    speed: i64,
    /// Frames in a row that were further off than is followed.
    far_off: u32,
}

impl DcServo {
    /// The reference was set, for the how-maniest time, to a time that was `epoch` when the run began. True if that is
    /// news.
    pub(super) fn set_base(&mut self, base: Option<(u32, DcTime)>) -> bool {
        let is_news = self.base != base;
        if is_news {
            *self = Self { base, ..Self::default() };
        }
        is_news
    }

    /// How much faster the reference goes than this computer, in 2^-48, for a cycle of this length.
    pub(super) fn speed(&self, cycle: Span) -> i64 {
        let cycle = i128::from(cycle.as_nanos().max(1)) * i128::from(INTEGRAL);
        ((-i128::from(self.speed) << SPEED_PLACES) / cycle) as i64
    }

    /// The reference's time in the last frame that brought it, all of it.
    pub(super) fn shown(&self) -> Option<u64> {
        self.time.map(|(_, time)| time as u64)
    }

    /// By how many ns the next batches are to be moved, from the low half of the reference's time
    /// in the data of a datagram that came back at `now`.
    pub(super) fn correction(&mut self, now: Instant, data: &[u8], cycle: Span) -> i64 {
        let (Some((_, epoch)), Some(low)) = (self.base, data.first_chunk()) else { return 0 };
        let low = u32::from_le_bytes(*low);
        // The high half is that of the time it was set to, later that of the time before.
        let later = |(at, time): (Instant, i64)| time.wrapping_add(now.since(at).as_nanos() as i64);
        let near = self.time.map_or(epoch.0.wrapping_add(now.as_nanos()) as i64, later);
        let ahead = i64::from(low.wrapping_sub(near as u32) as i32);
        let time = near.wrapping_add(ahead);
        let is_first = self.time.replace((now, time)).is_none();
        let span = cycle;
        let cycle = i64::try_from(cycle.as_nanos()).unwrap_or(i64::MAX).max(1);
        // A clock that stands, or was set meanwhile, says nothing of the phase.
        if !is_first && ahead.abs() > cycle / JUMP {
            self.far_off = 0;
            return self.as_before(span);
        }
        let phase = time.rem_euclid(cycle);
        let error = if phase > cycle / 2 { phase - cycle } else { phase };
        let most = cycle / MOST;
        if is_first || error.abs() > cycle / JUMP {
            self.far_off += 1;
            if !is_first && self.far_off < FAR_OFF {
                return self.as_before(span);
            }
            self.far_off = 0;
            // Later, never earlier: what is past cannot be sent.
            return (-error).rem_euclid(cycle);
        }
        self.far_off = 0;
        self.speed = (self.speed - error).clamp(-most * INTEGRAL, most * INTEGRAL);
        (self.speed / INTEGRAL - error / PROPORTIONAL).clamp(-most, most)
    }

    /// The same where a datagram came back without a time: the cycle goes on as fast as it went, as the clocks
    /// do that have nobody to follow.
    pub(super) fn as_before(&self, cycle: Span) -> i64 {
        let most = i64::try_from(cycle.as_nanos()).unwrap_or(i64::MAX) / MOST;
        if self.time.is_none() { 0 } else { (self.speed / INTEGRAL).clamp(-most, most) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A reference that is 80 ppm fast against the MainDevice: the frames stay at the cycle's begin.
    #[test]
    fn the_cycle_follows_the_reference_clock() {
        let cycle = Span::ms(1);
        let mut steer = DcServo::default();
        assert_eq!(
            steer.correction(Instant::ZERO, &[0x40, 0xE2, 0x01, 0x00], cycle),
            0,
            "nothing was set yet"
        );
        let epoch = DcTime(850_000_000_000_000_123);
        steer.set_base(Some((1, epoch)));
        let mut now = 0_i64;
        let mut worst = 0;
        for number in 0..20_000 {
            let reference = epoch.0 as i64 + 400_000 + now + now * 80 / 1_000_000;
            let at = Instant::from_nanos(now.unsigned_abs());
            let moved = steer.correction(at, &reference.to_le_bytes(), cycle);
            if number > 5_000 {
                let phase = reference.rem_euclid(1_000_000);
                worst = worst.max(phase.min(1_000_000 - phase));
            }
            now += 1_000_000 + moved;
        }
        assert!(worst < 50, "{worst} ns off");
    }

    #[test]
    fn single_frame_that_left_late_does_not_move_the_cycle_and_three_in_a_row_do() {
        let cycle = Span::ms(1);
        let mut servo = DcServo::default();
        servo.set_base(Some((1, DcTime(0))));
        let mut at = |ms: u64, late: u64| {
            let came = ms * 1_000_000 + late;
            servo.correction(Instant::from_nanos(came), &(came as u32).to_le_bytes(), cycle)
        };
        assert_eq!(at(1, 0), 0, "the first");
        for ms in 2..20 {
            assert_eq!(at(ms, 0), 0, "in time");
        }
        assert_eq!(
            [at(20, 200_000), at(21, 0), at(22, 200_000), at(23, 200_000), at(24, 0)],
            [0; 5]
        );
        assert_eq!([at(25, 200_000), at(26, 200_000)], [0; 2]);
        assert_eq!(at(27, 200_000), 800_000, "three in a row: it is the cycle that is off");
    }

    #[test]
    fn clock_that_stands_does_not_move_the_cycle() {
        let cycle = Span::ms(1);
        let mut servo = DcServo::default();
        servo.set_base(Some((1, DcTime(0))));
        let mut at = |ms: u64, shown: u32| {
            servo.correction(Instant::from_nanos(ms * 1_000_000), &shown.to_le_bytes(), cycle)
        };
        assert_eq!(at(1, 1_000_000), 0);
        for ms in 2..50 {
            assert_eq!(at(ms, 1_300_000), 0, "{ms} ms");
        }
    }
}
