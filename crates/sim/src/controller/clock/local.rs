//! Local time: what the quartz counts in steps of 10 ns, corrected in its speed.
//!
//! A controller counts 10 ns for each tick of its 100 MHz clock, and now and then 9 or 11: that is
//! how its time is kept in step (S1 9.1.3). Here the correction is a speed and a debt that is paid
//! off at another speed, both exact.

use linesman_proto::time::{Instant, Span};

use super::quartz::{LocalClock, Quartz, jitter};

/// What a tick of the clock counts, in ns.
pub(super) const TICK_NS: u64 = 10;
/// Binary places of corrections.
pub(super) const FINE: u32 = 40;

/// A clock that runs since an instant.
#[derive(Clone, Copy, Debug)]
pub(in crate::controller) struct RunningClock {
    clock: LocalClock,
    quartz: Quartz,
    /// Ticks when the quartz got the speed it has.
    ticks_before: u64,
    correction: Correction,
}

/// How the time differs from what the ticks alone would make of it.
#[derive(Clone, Copy, Default, Debug)]
struct Correction {
    /// From which tick on the rest holds.
    since: u64,
    /// What had been corrected by then, in 2^-40 ns.
    done: i128,
    /// For each tick, in 2^-40 ns.
    speed: i64,
    /// What is still to be corrected beside, in 2^-40 ns.
    debt: i64,
    /// The most of it for each tick, in 2^-40 ns.
    pay: i64,
}

impl Correction {
    /// In 2^-40 ns. Before its beginning only the speed is known.
    fn at(&self, tick: u64) -> i128 {
        let ticks = i128::from(tick.wrapping_sub(self.since) as i64);
        let paid = (i128::from(self.pay) * ticks.max(0)).min(i128::from(self.debt.unsigned_abs()));
        self.done + i128::from(self.speed) * ticks + i128::from(self.debt.signum()) * paid
    }
}

impl RunningClock {
    pub(in crate::controller) fn new(clock: LocalClock, since: Instant) -> Self {
        let quartz = Quartz::new(clock, since);
        Self { clock, quartz, ticks_before: 0, correction: Correction::default() }
    }

    /// The same clock, started at another instant.
    pub(in crate::controller) fn restarted(&self, at: Instant) -> Self {
        Self::new(self.clock, at)
    }

    /// Ticks since the clock started.
    pub(super) fn ticks(&self, at: Instant) -> u64 {
        self.ticks_before.wrapping_add(self.quartz.counted(at) / TICK_NS)
    }

    /// What it shows, in ns. Before its start it stands.
    pub(in crate::controller) fn local(&self, at: Instant) -> u64 {
        let ticks = self.ticks(at);
        let corrected = (self.correction.at(ticks) >> FINE) as u64;
        self.clock.start.wrapping_add(ticks.wrapping_mul(TICK_NS)).wrapping_add(corrected)
    }

    /// The time that is taken of something that happens at `at`.
    pub(in crate::controller) fn taken(&self, at: Instant) -> u64 {
        let off = jitter(self.clock.seed, at, self.clock.jitter_ns);
        self.local(at).wrapping_add_signed(off)
    }

    /// Changes the speed of its quartz at an instant without a jump.
    pub(in crate::controller) fn change_speed(
        &mut self,
        at: Instant,
        ppb: i64,
        ramp_ppb_per_s: i64,
        ramp: Span,
    ) {
        self.ticks_before = self.ticks(at);
        self.quartz = Quartz::with_speed(at, ppb, ramp_ppb_per_s, ramp);
    }

    /// The quartz has its own speed again, as after its warming up.
    pub(in crate::controller) fn restore_speed(&mut self, at: Instant) {
        let LocalClock { ppb, ramp_ppb_per_s, ramp, .. } = self.clock;
        let gained = i128::from(ramp_ppb_per_s) * i128::from(ramp.as_nanos()) / 1_000_000_000;
        self.change_speed(at, ppb + gained as i64, 0, Span::ZERO);
    }

    /// From an instant on the time is corrected by `speed` for each tick, and by `debt` beside, at
    /// most `pay` for each tick; all in 2^-40 ns.
    pub(super) fn correct(&mut self, at: Instant, speed: i64, debt: i64, pay: i64) {
        let since = self.ticks(at);
        let done = self.correction.at(since);
        self.correction = Correction { since, done, speed, debt, pay };
    }

    /// When it will show `target` or more, not before `from`; `None` if that is farther than can be
    /// told, or the clock stands.
    pub(super) fn when(&self, target: u64, from: Instant) -> Option<Instant> {
        const TRIES: usize = 32;
        const NEAR: i64 = 64;
        let missing = |at: Instant| target.wrapping_sub(self.local(at)) as i64;
        if missing(from) <= 0 {
            return Some(from);
        }
        let mut at = from;
        // Each round leaves a thousandth of the error, or less.
        for _ in 0..TRIES {
            let left = missing(at);
            if left.abs() <= NEAR {
                let (mut low, mut high) =
                    (at - Span::ns(4 * NEAR as u64), at + Span::ns(4 * NEAR as u64));
                low = low.max(from);
                // Local time is less than the target at `low`, and not at `high`.
                while low + Span::ns(1) < high {
                    let middle = low + Span::ns(high.since(low).as_nanos() / 2);
                    if missing(middle) > 0 {
                        low = middle;
                    } else {
                        high = middle;
                    }
                }
                return (missing(high) <= 0).then_some(high);
            }
            let next = if left > 0 {
                at + Span::ns(left.unsigned_abs())
            } else {
                (at - Span::ns(left.unsigned_abs())).max(from)
            };
            if next == Instant::MAX || next == at {
                return None;
            }
            at = next;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SECOND: Instant = Instant::from_nanos(1_000_000_000);

    #[test]
    fn a_fast_quartz_gains() {
        let clock = RunningClock::new(LocalClock::with_ppm(100, 20.0), Instant::from_nanos(1_000));
        assert_eq!(clock.local(Instant::from_nanos(1_000)), 100);
        assert_eq!(clock.local(Instant::from_nanos(1_000_001_000)), 100 + 1_000_000_000 + 20_000);
        let slow = RunningClock::new(LocalClock::with_ppm(0, -0.5), Instant::ZERO);
        assert_eq!(slow.local(Instant::from_nanos(10_000_000_000)), 10_000_000_000 - 5_000);
        assert_eq!(slow.local(Instant::from_nanos(19)), 10, "in steps of 10 ns");
    }

    #[test]
    fn a_change_of_speed_is_no_jump() {
        let mut clock = RunningClock::new(LocalClock::with_ppm(0, 10.0), Instant::ZERO);
        let before = clock.local(SECOND);
        clock.change_speed(SECOND, -10_000, 0, Span::ZERO);
        assert_eq!(clock.local(SECOND), before);
        assert_eq!(clock.local(SECOND + Span::s(1)), before + 1_000_000_000 - 10_000);
        clock.restore_speed(SECOND + Span::s(1));
        assert_eq!(clock.local(SECOND + Span::s(2)), before + 2_000_000_000);
    }

    #[test]
    fn a_debt_is_paid_and_then_over() {
        let mut clock = RunningClock::new(LocalClock::default(), Instant::ZERO);
        // 100 ns too fast, to be paid with 1 ns in 1000 ticks.
        clock.correct(SECOND, 0, -100 << FINE, (1 << FINE) / 1_000);
        assert_eq!(clock.local(SECOND), 1_000_000_000);
        let half = SECOND + Span::us(500);
        assert!((-51..=-49).contains(&(clock.local(half) as i64 - 1_000_500_000)));
        assert_eq!(clock.local(SECOND + Span::ms(2)), 1_002_000_000 - 100);
        assert_eq!(clock.local(SECOND + Span::s(2)), 3_000_000_000 - 100);
    }

    proptest! {
        // The wrap of 64 bits among them.
        #[test]
        fn when_is_the_first_instant(
            start: u64, ppb in -200_000i64..200_000, speed in -1_000_000_000i64..1_000_000_000,
            debt in -1_000_000i64..1_000_000, ahead in 1u64..10_000_000_000, from in 0u64..100_000_000_000
        ) {
            let clock = LocalClock { start, ppb, ..LocalClock::default() };
            let mut clock = RunningClock::new(clock, Instant::ZERO);
            let from = Instant::from_nanos(from);
            clock.correct(from, speed, debt << FINE, 1 << (FINE - 12));
            let target = clock.local(from).wrapping_add(ahead);
            let at = clock.when(target, from).unwrap();
            prop_assert!((clock.local(at).wrapping_sub(target) as i64) >= 0);
            prop_assert!((clock.local(at - Span::ns(1)).wrapping_sub(target) as i64) < 0);
        }

        // No tick runs backwards, whatever the corrections.
        #[test]
        fn time_never_goes_back(
            ppb in -200_000i64..200_000, speed in -10_000_000_000i64..10_000_000_000,
            debt in -1_000i64..1_000, at in 0u64..1_000_000_000
        ) {
            let mut clock = RunningClock::new(LocalClock { ppb, ..LocalClock::default() }, Instant::ZERO);
            clock.correct(Instant::from_nanos(500_000_000), speed, debt << FINE, 1 << (FINE - 7));
            let (one, next) = (Instant::from_nanos(at), Instant::from_nanos(at + 1));
            prop_assert!(clock.local(one) <= clock.local(next));
        }
    }

    #[test]
    fn a_clock_that_stands_never_gets_there() {
        let mut clock = RunningClock::new(LocalClock::default(), Instant::ZERO);
        clock.change_speed(SECOND, LocalClock::STOPPED, 0, Span::ZERO);
        assert_eq!(clock.local(SECOND + Span::s(9)), 1_000_000_000);
        assert_eq!(clock.when(2_000_000_000, SECOND), None);
    }
}
