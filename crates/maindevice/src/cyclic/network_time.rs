//! Time of the network as the cycle knows it, for programs: when the cycle began, the last base tick, now.
//!
//! The frame that brings the time of the reference clock ties a time of the run, when that frame left, to a time of
//! the network, when it was at the reference clock. Each other time of the run lies as far from the first as its time
//! of the network lies from the second. So a task that starts when its first frame leaves starts at the time at which
//! that frame is at the reference clock: at a multiple of the cycle time, once the cycle follows it (SYN-09, S0
//! L776-778).

use linesman_proto::time::{DcTime, Instant, Span};

use crate::network_group::TimePair;

/// Three times of a call of an application, by the network's time (DC-08). None is before the one above it.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct TaskTimes {
    /// When the current cycle of the task began: near a multiple of its cycle time.
    pub task_start: DcTime,
    /// The last base tick since then. A task whose cycle is no multiple of the base time has no tick but its start.
    pub base_tick: DcTime,
    /// When the application was called. It does not go on while the application runs.
    pub now: DcTime,
}

/// The latest frame that brought the time of the reference clock.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct NetworkTime {
    /// When it left, the time that the reference clock put into it, and how fast that goes.
    known: Option<TimePair>,
}

impl NetworkTime {
    /// Takes over the time that a frame brought which left at `at`, and by how much it goes faster than this computer,
    /// in 2^-48.
    pub(super) const fn take(&mut self, at: Instant, time: u64, speed: i64) {
        self.known = Some(TimePair { at, time, speed });
    }

    /// What it has taken over last.
    pub(super) const fn pair(&self) -> Option<TimePair> {
        self.known
    }

    /// How much faster the time of the network goes than this computer, in 2^-48.
    pub(super) fn speed(&self) -> i64 {
        self.known.map_or(0, |pair| pair.speed)
    }

    /// Forgets all: the clocks were set anew.
    pub(super) const fn forget(&mut self) {
        self.known = None;
    }

    /// The time of the network at a time of the run; `None` before a frame has brought it.
    pub(super) fn at(&self, at: Instant) -> Option<DcTime> {
        Some(self.known?.time_at(at))
    }
}

/// The last base tick at `now`, of ticks that begin when the task starts.
pub(super) fn base_tick(start: Instant, now: Instant, cycle: Span, tick: Span) -> Instant {
    let (cycle, tick) = (cycle.as_nanos(), tick.as_nanos());
    if tick == 0 || !cycle.is_multiple_of(tick) {
        return start;
    }
    let since = now.since(start).as_nanos();
    start + Span::ns(since - since % tick)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_of_the_run_lie_as_far_apart_by_the_network() {
        let mut time = NetworkTime::default();
        let at = Instant::from_nanos;
        assert_eq!(time.at(at(5)), None);
        time.take(at(1_000), 850_000_000_000_000_000, 0);
        assert_eq!(time.at(at(1_250)), Some(DcTime(850_000_000_000_000_250)));
        assert_eq!(time.at(at(400)), Some(DcTime(849_999_999_999_999_400)), "it may be before");
        time.forget();
        assert_eq!(time.at(at(1_250)), None);
    }

    // proves: DC-08 (U)
    #[test]
    fn last_base_tick_lies_between_the_start_of_the_task_and_now() {
        let (start, us) = (Instant::from_nanos(77_000), Span::us);
        for (passed, tick, expected) in [
            (us(0), us(50), us(0)),
            (us(49), us(50), us(0)),
            (us(50), us(50), us(50)),
            (us(199), us(50), us(150)),
            // A base time that is longer than the cycle, or does not divide it.
            (us(180), us(1_000), us(0)),
            (us(180), us(60), us(0)),
            (us(180), us(0), us(0)),
        ] {
            let now = start + passed;
            let last = base_tick(start, now, us(200), tick);
            assert_eq!(last, start + expected, "{passed} after the start, ticks of {tick}");
            assert!(start <= last && last <= now);
        }
    }
}
