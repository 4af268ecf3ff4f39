//! The loop that keeps the local copy of the system time in step with the reference clock.
//!
//! Each write to 0x0910 is compared with the local copy: Δ = local time + offset - delay - what was
//! written (S1 9.1.3). What follows from Δ the documents say in part: the mean of Δ is 0x092C
//! (averaged over 2^0x0934 values), the mean deviation of the clock's period (over 2^0x0935 values)
//! makes the speed counter difference 0x0932, whose effect is given by the formula in S2 2.15.2.6,
//! and 0x0930 is the bandwidth. The law between them is this model's own:
//!
//! * the deviation is what the quartz counted between two comparisons against what the reference
//!   counted; 0x0932 takes the value that cancels its mean, within ± (0x0930 - 0x7F);
//! * beside it the time is shifted by the mean of Δ over its filter depth, by at most 1 ns in
//!   0x0930 + 2 ticks of 10 ns: 24 ppm at the reset value.
//!
//! So a loop at its reset values follows quartzes up to 760 ppm off, takes some 4 x 4096
//! comparisons to learn a speed, and works off a wrong start at 24 µs a second.

use linesman_proto::register as r;
use linesman_proto::time::Instant;

use super::local::{FINE, TICK_NS};
use crate::controller::core::Core;
use crate::controller::memory::at;

/// Binary places of the mean difference.
const MEAN_PLACES: u32 = 16;
/// The strongest correction of the time: a quarter of the difference for each comparison.
const LEAST_DEPTH: u32 = 2;
/// More than is worked off between two comparisons: 4 ms, in 2^-16 ns.
const MOST_DEBT: i64 = 1 << 38;
/// No quartz is further off than this part of its speed: 1/500.
const WORST_QUARTZ: i128 = (1 << FINE) / 500;
/// Values of the speed counter start that work (S2 2.15.2.5).
const STARTS: std::ops::RangeInclusive<u16> = 0x0080..=0x3FFF;
/// By how much the speed counter difference stays within its start (S2 2.15.2.6).
const MARGIN: i64 = 0x7F;

/// What the filters hold.
#[derive(Clone, Copy, Default, Debug)]
pub(in crate::controller) struct TimeLoop {
    /// In 2^-16 ns.
    mean: Option<i64>,
    /// How much too fast the quartz is, in 2^-40.
    deviation: i64,
    /// Ticks and reference time of the comparison before.
    before: Option<(u64, u32)>,
}

impl Core {
    /// The local copy of the system time.
    pub(in crate::controller) fn system_time(&self, when: Instant) -> u64 {
        self.clock.local(when).wrapping_add(self.system_time_offset())
    }

    pub(super) fn system_time_offset(&self) -> u64 {
        self.memory.u64(&r::SYSTEM_TIME_OFFSET)
    }

    /// The system time is that of the moment the frame began.
    pub(super) fn put_system_time(&mut self) {
        let taken = self.clock.taken(self.passing.began);
        let time = taken.wrapping_add(self.system_time_offset());
        self.put_time(&r::SYSTEM_TIME, time);
    }

    /// Shows a time, as far as the controller has the register.
    pub(super) fn put_time(&mut self, register: &r::Register, time: u64) {
        use crate::controller::memory::Rights;
        let address = at(register);
        for (offset, byte) in time.to_le_bytes().into_iter().enumerate() {
            if self.rights.byte(address + offset) & Rights::READ != 0 {
                self.memory.bytes_mut()[address + offset] = byte;
            }
        }
    }

    /// A frame that ends at `end` brought the time of the reference clock.
    pub(super) fn compare_system_time(&mut self, received: u32, end: Instant) {
        let began = self.passing.began;
        let taken = self.clock.taken(began).wrapping_add(self.system_time_offset()) as u32;
        let delay = self.memory.u32(&r::SYSTEM_TIME_DELAY);
        let difference = i64::from(taken.wrapping_sub(delay).wrapping_sub(received) as i32);
        let mean = self.average_difference(difference);
        self.show_difference(mean);
        self.average_deviation(self.clock.ticks(began), received);
        self.steer(mean, end);
    }

    fn average_difference(&mut self, difference: i64) -> i64 {
        let depth = u32::from(self.memory.u8(&r::DIFFERENCE_FILTER_DEPTH) & 0x0F);
        let new = difference << MEAN_PLACES;
        // The first value is the mean until there are others.
        let mean = self.time_loop.mean.map_or(new, |mean| mean + ((new - mean) >> depth));
        self.time_loop.mean = Some(mean);
        mean
    }

    fn show_difference(&mut self, mean: i64) {
        let magnitude = ((mean.unsigned_abs() + (1 << (MEAN_PLACES - 1))) >> MEAN_PLACES) as u32;
        let shown = r::SystemTimeDifference::new(magnitude, mean >= 0);
        self.memory.set_u32(&r::SYSTEM_TIME_DIFFERENCE, shown.0);
    }

    fn average_deviation(&mut self, ticks: u64, received: u32) {
        let Some((ticks_then, received_then)) = self.time_loop.before.replace((ticks, received))
        else {
            return;
        };
        let counted = ticks.wrapping_sub(ticks_then).wrapping_mul(TICK_NS);
        if counted == 0 || counted > i64::MAX as u64 {
            return;
        }
        let passed = received.wrapping_sub(received_then);
        let gained = i128::from((counted as u32).wrapping_sub(passed) as i32);
        let worst = WORST_QUARTZ;
        let deviation = ((gained << FINE) / i128::from(counted)).clamp(-worst, worst) as i64;
        let depth = u32::from(self.memory.u8(&r::SPEED_FILTER_DEPTH) & 0x0F);
        let mean = &mut self.time_loop.deviation;
        *mean += (deviation - *mean) >> depth;
    }

    /// Sets the clock's speed by what the filters hold.
    fn steer(&mut self, mean: i64, end: Instant) {
        let start = self.speed_counter_start();
        let diff = speed_counter_diff(-self.time_loop.deviation, start);
        self.memory.set_u16(&r::SPEED_COUNTER_DIFF, diff as i16 as u16);
        let depth = u32::from(self.memory.u8(&r::DIFFERENCE_FILTER_DEPTH) & 0x0F);
        let mean = mean.clamp(-MOST_DEBT, MOST_DEBT);
        let debt = -((mean << (FINE - MEAN_PLACES)) >> depth.max(LEAST_DEPTH));
        self.clock.correct(end, speed_of(diff, start), debt, (1 << FINE) / (start + 2));
        // A pulse may come before the frame is over.
        self.plan_sync(self.passing.began);
    }

    fn speed_counter_start(&self) -> i64 {
        let start = self.memory.u16(&r::SPEED_COUNTER_START) & 0x7FFF;
        i64::from(start.clamp(*STARTS.start(), *STARTS.end()))
    }

    /// 0x0930 was written: filters, difference and speed start anew.
    pub(super) fn restart_time_loop(&mut self, end: Instant) {
        self.time_loop = TimeLoop::default();
        self.memory.set_u32(&r::SYSTEM_TIME_DIFFERENCE, 0);
        self.memory.set_u16(&r::SPEED_COUNTER_DIFF, 0);
        self.clock.correct(end, 0, 0, 0);
        self.plan_sync(end);
    }
}

/// What a speed counter difference does to each tick, in 2^-40 ns: one more nanosecond each time a
/// counter of `start - diff + 2` ticks is round, one less each time one of `start + diff + 2` is
/// (S2 2.15.2.6: the deviation is diff / (5 (start + diff + 2) (start - diff + 2))).
fn speed_of(diff: i64, start: i64) -> i64 {
    let middle = start + 2;
    ((2 * i128::from(diff)) << FINE).div_euclid(i128::from(middle * middle - diff * diff)) as i64
}

/// The difference whose effect is nearest to a wanted speed, in 2^-40 of the clock's speed.
fn speed_counter_diff(wanted: i64, start: i64) -> i64 {
    let wanted_for_tick = wanted.saturating_mul(TICK_NS as i64);
    let (mut low, mut high) = (-(start - MARGIN), start - MARGIN);
    // The speed grows with the difference.
    while low < high {
        let middle = (low + high).div_euclid(2);
        let between = (speed_of(middle, start) + speed_of(middle + 1, start)) / 2;
        if between < wanted_for_tick {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The register table's formula: deviation = diff / (5 (start + diff + 2) (start - diff + 2)).
    fn formula(diff: i64, start: i64) -> f64 {
        diff as f64 / (5.0 * (start + diff + 2) as f64 * (start - diff + 2) as f64)
    }

    #[test]
    fn the_effect_of_a_difference_is_the_documented_one() {
        for (diff, start) in [(1, 0x1000), (-1, 0x1000), (3969, 0x1000), (100, 0x0200), (1, 0x80)] {
            let ppm = speed_of(diff, start) as f64 / TICK_NS as f64 / (1u64 << FINE) as f64 * 1e6;
            let expected = formula(diff, start) * 1e6;
            assert!((ppm - expected).abs() < 1e-6, "{diff} of {start}: {ppm}, expected {expected}");
        }
        // 12 parts in a thousand million a count, and up to 760 ppm, at the reset value.
        assert!((formula(1, 0x1000) * 1e9 - 11.9).abs() < 0.1);
        assert!((formula(0x1000 - 0x7F, 0x1000) * 1e6 - 762.8).abs() < 1.0);
    }

    proptest! {
        #[test]
        fn the_difference_is_the_nearest(ppb in -700_000i64..700_000, start in 0x80i64..=0x3FFF) {
            let wanted = ((i128::from(ppb) << FINE) / 1_000_000_000) as i64;
            let diff = speed_counter_diff(wanted, start);
            prop_assert!(diff.abs() <= start - MARGIN);
            let error = |diff: i64| (speed_of(diff, start) - wanted * TICK_NS as i64).abs();
            for other in [diff - 1, diff + 1] {
                if other.abs() <= start - MARGIN {
                    prop_assert!(error(diff) <= error(other) + 1);
                }
            }
        }
    }
}
