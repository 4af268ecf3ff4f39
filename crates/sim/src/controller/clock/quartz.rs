//! The quartz: how far off it is, how that changes with heat, and how unevenly it is read.

use linesman_proto::time::{Instant, Span};

/// Parts of a whole that speeds are given in: thousand million.
const BILLION: i128 = 1_000_000_000;

/// How a controller's quartz behaves.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct LocalClock {
    /// What it shows when the run begins, in ns: the supply was there before. At each power-on of the run it begins at 0.
    pub start: u64,
    /// How much too fast it runs, in parts per thousand million; negative is too slow. Quartzes of
    /// SubDevices are within 25 ppm, that is 25,000.
    pub ppb: i64,
    /// How its speed changes after power-on, in parts per thousand million per second: heat.
    pub ramp_ppb_per_s: i64,
    /// How long it changes; after that the speed stays.
    pub ramp: Span,
    /// How far a time that is taken (of a frame, of an input) can be off either way, in ns.
    pub jitter_ns: u16,
    /// What the chance of the jitter comes from.
    pub seed: u64,
}

impl LocalClock {
    /// The fastest change of speed that is meant, in parts per thousand million per second.
    pub const STEEPEST_RAMP: i64 = 100_000;
    /// The longest change of speed that is meant.
    pub const LONGEST_RAMP: Span = Span::s(10_000);
    /// A speed at which the quartz does not count at all, in parts per thousand million.
    pub const STOPPED: i64 = -1_000_000_000;

    /// A clock that is `ppm` parts per million too fast, and steady.
    #[must_use]
    pub fn with_ppm(start: u64, ppm: f64) -> Self {
        Self { start, ppb: (ppm * 1_000.0).round() as i64, ..Self::default() }
    }
}

/// A quartz that counts since an instant.
#[derive(Clone, Copy, Debug)]
pub(super) struct Quartz {
    since: Instant,
    ppb: i64,
    ramp_ppb_per_s: i64,
    ramp: Span,
}

impl Quartz {
    /// It stands until `since`.
    pub(super) fn new(clock: LocalClock, since: Instant) -> Self {
        let steepest = LocalClock::STEEPEST_RAMP;
        Self {
            since,
            ppb: clock.ppb.clamp(LocalClock::STOPPED, -LocalClock::STOPPED),
            ramp_ppb_per_s: clock.ramp_ppb_per_s.clamp(-steepest, steepest),
            ramp: clock.ramp.min(LocalClock::LONGEST_RAMP),
        }
    }

    /// The same quartz with another speed from an instant on. Counting begins anew.
    pub(super) fn with_speed(at: Instant, ppb: i64, ramp_ppb_per_s: i64, ramp: Span) -> Self {
        let clock = LocalClock { ppb, ramp_ppb_per_s, ramp, ..LocalClock::default() };
        Self::new(clock, at)
    }

    /// Nanoseconds counted since the beginning.
    pub(super) fn counted(&self, at: Instant) -> u64 {
        let passed = at.since(self.since).as_nanos();
        passed.wrapping_add(self.gained(passed) as u64)
    }

    /// How far it is ahead after `passed` ns, rounded down.
    fn gained(&self, passed: u64) -> i64 {
        if self.ramp_ppb_per_s == 0
            && let Ok(signed) = i64::try_from(passed)
            && let Some(product) = signed.checked_mul(self.ppb)
        {
            return product.div_euclid(BILLION as i64);
        }
        let ramp = i128::from(self.ramp.as_nanos());
        let passed = i128::from(passed);
        // Twice the area under the change of speed: a triangle, and a rectangle behind it.
        let heated = if passed <= ramp { passed * passed } else { ramp * (2 * passed - ramp) };
        let steady = 2 * BILLION * i128::from(self.ppb) * passed;
        let total = steady + i128::from(self.ramp_ppb_per_s) * heated;
        total.div_euclid(2 * BILLION * BILLION) as i64
    }
}

/// How far a time that is taken at an instant is off: a function of the instant, so that the order
/// of asking does not matter.
pub(super) fn jitter(seed: u64, at: Instant, most: u16) -> i64 {
    if most == 0 {
        return 0;
    }
    // SplitMix64, one step: neighbouring instants have nothing to do with each other.
    let mut bits = (seed ^ at.as_nanos()).wrapping_add(0x9E37_79B9_7F4A_7C15);
    bits = (bits ^ bits >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    bits = (bits ^ bits >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
    bits ^= bits >> 31;
    let width = 2 * u64::from(most) + 1;
    (bits % width) as i64 - i64::from(most)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heat_bends_the_time() {
        let clock = LocalClock {
            ppb: 10_000,
            ramp_ppb_per_s: 1_000,
            ramp: Span::s(10),
            ..LocalClock::default()
        };
        let quartz = Quartz::new(clock, Instant::ZERO);
        let gained =
            |s: u64| quartz.counted(Instant::ZERO + Span::s(s)) as i64 - s as i64 * 1_000_000_000;
        // 10 ppm, and 1 ppm more each second: 10 t + t²/2 µs.
        assert_eq!(gained(1), 10_500);
        assert_eq!(gained(2), 22_000);
        assert_eq!(gained(10), 150_000);
        // From then on 20 ppm.
        assert_eq!(gained(11), 170_000);
        assert_eq!(gained(3_600), 150_000 + 3_590 * 20_000);
    }

    #[test]
    fn both_ways_of_counting_agree() {
        for ppb in [-200_000, -1, 0, 7, 33_333, 1_000_000, LocalClock::STOPPED] {
            let plain = Quartz::new(LocalClock { ppb, ..LocalClock::default() }, Instant::ZERO);
            // A ramp of no length changes nothing but the way of counting.
            let wide = Quartz::with_speed(Instant::ZERO, ppb, 1, Span::ZERO);
            for at in [1, 999, 123_456_789, 86_400_000_000_000, 9_000_000_000_000_000] {
                let at = Instant::from_nanos(at);
                assert_eq!(plain.counted(at), wide.counted(at), "{ppb} at {at:?}");
            }
        }
    }

    #[test]
    fn a_stopped_quartz_stands() {
        let stopped = Quartz::with_speed(Instant::ZERO, LocalClock::STOPPED, 0, Span::ZERO);
        assert_eq!(stopped.counted(Instant::from_nanos(5_000_000_000)), 0);
    }

    #[test]
    fn jitter_keeps_its_bounds_and_belongs_to_the_instant() {
        let draws: Vec<i64> =
            (0..1_000).map(|at| jitter(7, Instant::from_nanos(at * 80), 12)).collect();
        assert!(draws.iter().all(|off| (-12..=12).contains(off)));
        assert!(draws.contains(&12) && draws.contains(&-12));
        assert_eq!(jitter(7, Instant::from_nanos(80), 12), draws[1]);
        assert_eq!(jitter(7, Instant::from_nanos(80), 0), 0);
    }
}
