//! Cycle timing of a datagram that is sent again and again: its cycle time, deviations from it, and pauses.

use std::collections::VecDeque;

use linesman_proto::time::{Instant, Span};

use super::spell::{Spell, SpellEntry};

/// Intervals from whose middle the cycle is taken: so many that half of them may be off.
const LEARNT_FROM: usize = 33;
/// So many intervals off the beat one after the other are another beat.
const OTHER_BEAT: u32 = 24;
/// Pauses that are kept.
const PAUSES_KEPT: usize = 16;
/// A pause lasts at least so many cycles …
const PAUSE_CYCLES: u64 = 3;
/// … and so long: no watchdog that is of use is shorter.
const PAUSE: Span = Span::ms(5);
/// From this share of the cycle on, in percent, an interval is off the beat.
const OFF_PERCENT: u64 = 20;
/// From this share on it is uneven, which harms nobody.
const UNEVEN_PERCENT: u64 = 10;

/// An interval that was off the beat.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct CycleDeviation {
    /// When it ended.
    pub at: Instant,
    /// By how much it was too long or too short.
    pub by: Span,
}

impl SpellEntry for CycleDeviation {
    fn at(&self) -> Instant {
        self.at
    }

    fn by(&self) -> Span {
        self.by
    }
}

/// A stretch of time without any.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Pause {
    /// The last one before.
    pub from: Instant,
    /// The first one after.
    pub to: Instant,
}

impl Pause {
    /// How long it was.
    #[must_use]
    pub const fn span(&self) -> Span {
        self.to.since(self.from)
    }
}

/// The times of something that comes in a cycle.
#[derive(Clone, Default, Debug)]
pub struct CycleTiming {
    /// Intervals in ns from which the cycle is learnt; empty once it is known.
    learning: Vec<u64>,
    cycle: Option<Span>,
    last: Option<Instant>,
    off_in_a_row: u32,
    /// Intervals off the beat.
    pub off: Spell<CycleDeviation>,
    /// Uneven intervals, those off the beat included.
    pub uneven: Spell<CycleDeviation>,
    /// The latest pauses, oldest first.
    pub pauses: VecDeque<Pause>,
}

impl CycleTiming {
    /// The usual interval, once it is known.
    #[must_use]
    pub const fn cycle(&self) -> Option<Span> {
        self.cycle
    }

    /// When it came last.
    #[must_use]
    pub const fn last(&self) -> Option<Instant> {
        self.last
    }

    /// It came at `at`. Says whether it was off the beat, or paused.
    pub fn tick(&mut self, at: Instant) -> bool {
        // One that is known to be lost is heard of when later ones are back already.
        if self.last.is_some_and(|last| at <= last) {
            return false;
        }
        let Some(last) = self.last.replace(at) else { return false };
        let interval = at.since(last);
        let Some(cycle) = self.cycle else {
            self.learn(interval);
            return false;
        };
        let (interval_ns, cycle_ns) = (interval.as_nanos(), cycle.as_nanos());
        let paused = interval >= PAUSE && interval_ns >= PAUSE_CYCLES * cycle_ns;
        if paused {
            if self.pauses.len() == PAUSES_KEPT {
                self.pauses.pop_front();
            }
            self.pauses.push_back(Pause { from: last, to: at });
        }
        let is_off = |by: u64| by * 100 >= cycle_ns * OFF_PERCENT;
        // Whatever is missing between them is missing, not late.
        let cycles = ((interval_ns + cycle_ns / 2) / cycle_ns).max(1);
        let by = interval_ns.abs_diff(cycles * cycle_ns);
        let off = CycleDeviation { at, by: Span::ns(by) };
        if by * 100 >= cycle_ns * UNEVEN_PERCENT {
            self.uneven.push(off);
        }
        if !is_off(interval_ns.abs_diff(cycle_ns)) {
            self.off_in_a_row = 0;
            return paused;
        }
        self.off_in_a_row += 1;
        if self.off_in_a_row >= OTHER_BEAT {
            // Not off the beat, but another beat.
            *self = Self {
                last: Some(at),
                pauses: std::mem::take(&mut self.pauses),
                ..Self::default()
            };
            return paused;
        }
        if !is_off(by) {
            return paused;
        }
        self.off.push(off);
        true
    }

    /// One is missing: the interval to the next says nothing.
    pub const fn skip(&mut self) {
        self.last = None;
    }

    /// Forgets the cycle and what was off it. Pauses that are over stay: who starved by one is brought back, and set up
    /// again, right behind it.
    pub fn learn_again(&mut self) {
        *self = Self { pauses: std::mem::take(&mut self.pauses), ..Self::default() };
    }

    fn learn(&mut self, interval: Span) {
        self.learning.push(interval.as_nanos());
        if self.learning.len() < LEARNT_FROM {
            return;
        }
        let mut all = std::mem::take(&mut self.learning);
        all.sort_unstable();
        let middle = all[LEARNT_FROM / 2];
        self.cycle = (middle > 0).then_some(Span::ns(middle));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ticked(intervals_us: impl IntoIterator<Item = u64>) -> CycleTiming {
        let mut beat = CycleTiming::default();
        let mut at = Instant::ZERO;
        beat.tick(at);
        for us in intervals_us {
            at += Span::us(us);
            beat.tick(at);
        }
        beat
    }

    #[test]
    fn the_cycle_is_learnt_although_some_are_late() {
        let beat = ticked((0..40).map(|n| if n % 5 == 0 { 1_300 } else { 1_000 }));
        assert_eq!(beat.cycle(), Some(Span::ms(1)));
        let late: Vec<u64> = beat.off.latest().iter().map(|off| off.by.as_nanos()).collect();
        assert_eq!(late, [300_000], "that before the cycle was known says nothing");
    }

    #[test]
    fn pause_stays_known_when_the_cycle_is_learnt_again() {
        let mut beat = ticked(std::iter::repeat_n(1_000, 40).chain([112_000]));
        beat.learn_again();
        assert_eq!(beat.cycle(), None);
        assert_eq!(beat.pauses.len(), 1);
        // The interval to the next frame says nothing.
        assert!(!beat.tick(Instant::ZERO + Span::s(9)));
        assert_eq!(beat.pauses.len(), 1);
    }

    #[test]
    fn a_fifth_of_the_cycle_is_off_and_less_is_not() {
        let steady = || std::iter::repeat_n(1_000, 40);
        assert!(ticked(steady().chain([1_199, 801])).off.latest().is_empty());
        assert_eq!(ticked(steady().chain([1_200, 800])).off.latest().len(), 2);
        assert_eq!(ticked(steady().chain([1_099, 1_100, 1_300])).uneven.latest().len(), 2);
    }

    #[test]
    fn what_is_missing_is_not_late_and_comes_in_any_order() {
        let steady = || std::iter::repeat_n(1_000, 40);
        let mut beat = ticked(steady().chain([2_000, 3_000, 1_000]));
        assert!(beat.off.latest().is_empty(), "{:?}", beat.off);
        // A lost one is heard of afterwards.
        let last = beat.last().unwrap();
        beat.tick(Instant::from_nanos(last.as_nanos() - 1_500_000));
        assert_eq!((beat.last(), beat.off.latest().len()), (Some(last), 0));
        // Late by most of a cycle: the next interval tells.
        assert_eq!(ticked(steady().chain([1_900, 100])).off.latest().len(), 1);
    }

    #[test]
    fn a_pause_is_told_and_another_beat_is_learnt() {
        let steady = || std::iter::repeat_n(1_000, 40);
        let beat = ticked(steady().chain([112_000]).chain(steady()));
        assert_eq!(beat.pauses.len(), 1);
        assert_eq!(beat.pauses[0].span(), Span::ms(112));
        let slower = ticked(steady().chain(std::iter::repeat_n(2_000, 80)));
        assert_eq!((slower.cycle(), slower.off.latest().len()), (Some(Span::ms(2)), 0));
    }
}
