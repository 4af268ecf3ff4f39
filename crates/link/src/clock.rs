//! The host's clocks: times of the run from the monotonic clock, and the wall clock beside it.
//!
//! Reference: clock_gettime(2), clock_nanosleep(2). A run counts on `CLOCK_MONOTONIC`, which never
//! steps and stands still while the host is suspended; only the start of the run, and the stamps
//! that the kernel puts on frames, are wall-clock times (`CLOCK_REALTIME`), which may be set.

use std::num::NonZeroU64;

use linesman_proto::time::{Instant, Span};
use rustix::io::Errno;
use rustix::thread::{ClockId as SleepClock, clock_nanosleep_absolute, set_current_timer_slack};
use rustix::time::{ClockId, Timespec, clock_gettime};

use crate::unix_time::UnixTime;

const NANOS_PER_SECOND: i64 = 1_000_000_000;

/// The clock of a run: 0 is its start.
///
/// Copies are the same clock.
#[derive(Clone, Copy, Debug)]
pub struct HostClock {
    /// The monotonic clock at the start, in ns.
    start: u64,
    started_at: UnixTime,
}

/// What both clocks read at one moment.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ClockReading {
    /// The clock of the run.
    pub at: Instant,
    /// The wall clock.
    pub wall: UnixTime,
}

impl HostClock {
    /// Starts a run now.
    #[must_use]
    pub fn start() -> Self {
        let start = monotonic();
        Self { start, started_at: wall() }
    }

    /// Now.
    #[must_use]
    pub fn now(&self) -> Instant {
        Instant::from_nanos(monotonic().saturating_sub(self.start))
    }

    /// The wall clock at the start of the run; its text is
    /// [`UnixTime::rfc3339`].
    #[must_use]
    pub const fn started_at(&self) -> UnixTime {
        self.started_at
    }

    /// The wall-clock time that `at` had, would the wall clock not have been set since the start.
    #[must_use]
    pub fn unix(&self, at: Instant) -> UnixTime {
        self.started_at + at.since(Instant::ZERO)
    }

    /// Both clocks, read as closely together as can be: within 5 µs unless the thread is
    /// interrupted each of four times.
    #[must_use]
    pub fn read(&self) -> ClockReading {
        const CLOSE: Span = Span::us(5);
        const ATTEMPTS: usize = 4;
        let mut best = self.read_once();
        for _ in 1..ATTEMPTS {
            if best.1 <= CLOSE {
                break;
            }
            let again = self.read_once();
            if again.1 < best.1 {
                best = again;
            }
        }
        best.0
    }

    /// Both clocks, and how far apart the two readings may be.
    fn read_once(&self) -> (ClockReading, Span) {
        let before = self.now();
        let wall = wall();
        let apart = self.now().since(before);
        (ClockReading { at: before + Span::ns(apart.as_nanos() / 2), wall }, apart)
    }

    /// Sleeps until `deadline` and tells how late it woke; does not sleep when it is past.
    ///
    /// Without a real-time scheduling class the kernel may be late by the thread's timer slack,
    /// 50 µs unless [`tighten_timers`] was called.
    pub fn sleep_until(&self, deadline: Instant) -> Span {
        let request = timespec(self.start.saturating_add(deadline.as_nanos()));
        // A signal wakes early; the deadline is absolute, so trying again costs nothing.
        while clock_nanosleep_absolute(SleepClock::Monotonic, &request) == Err(Errno::INTR) {}
        self.now().since(deadline)
    }
}

impl ClockReading {
    /// The time of the run that a recent wall-clock stamp means: never later than this reading,
    /// even when the wall clock was set back in between.
    #[must_use]
    pub fn instant_of(&self, stamp: UnixTime) -> Instant {
        self.at.before(self.wall.since(stamp).unwrap_or(Span::ZERO))
    }
}

/// Makes the timers of the calling thread as exact as the kernel can, instead of up to 50 µs late.
///
/// It needs no privilege; threads with a real-time scheduling class are exact anyway.
pub fn tighten_timers() {
    // Refused only by kernels without timer slack, whose timers are exact.
    let _ = set_current_timer_slack(NonZeroU64::new(1));
}

/// `CLOCK_MONOTONIC` in ns.
fn monotonic() -> u64 {
    nanos(clock_gettime(ClockId::Monotonic))
}

/// `CLOCK_REALTIME`.
fn wall() -> UnixTime {
    let now = clock_gettime(ClockId::Realtime);
    let nanos = i128::from(now.tv_sec) * i128::from(NANOS_PER_SECOND) + i128::from(now.tv_nsec);
    UnixTime::from_nanos(nanos)
}

/// How long the host has been suspended since it was started.
pub(crate) fn suspended() -> Span {
    let running = monotonic();
    Span::ns(nanos(clock_gettime(ClockId::Boottime)).saturating_sub(running))
}

fn nanos(time: Timespec) -> u64 {
    // The kernel's monotonic clocks are never negative and last 292 years in 63 bits.
    (time.tv_sec * NANOS_PER_SECOND + time.tv_nsec) as u64
}

pub(crate) fn timespec(nanos: u64) -> Timespec {
    let nanos = i64::try_from(nanos).unwrap_or(i64::MAX);
    Timespec { tv_sec: nanos / NANOS_PER_SECOND, tv_nsec: nanos % NANOS_PER_SECOND }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sleeping_ends_at_the_deadline_and_not_before() {
        let clock = HostClock::start();
        let deadline = clock.now() + Span::ms(3);
        let late = clock.sleep_until(deadline);
        assert!(clock.now() >= deadline);
        assert!(late < Span::s(2), "{late} late");
        let long_ago = Instant::ZERO;
        assert!(clock.sleep_until(long_ago) >= Span::ms(3), "past deadlines do not sleep");
    }

    #[test]
    fn stamps_of_the_wall_clock_become_times_of_the_run() {
        let wall = UnixTime::from_nanos(1_700_000_000_000_000_000);
        let reading = ClockReading { at: Instant::from_nanos(5_000), wall };
        let stamp = |nanos| UnixTime::from_nanos(wall.as_nanos() + nanos);
        assert_eq!(reading.instant_of(stamp(-1_000)), Instant::from_nanos(4_000));
        assert_eq!(reading.instant_of(stamp(-9_000)), Instant::ZERO, "before the run");
        assert_eq!(reading.instant_of(stamp(77)), Instant::from_nanos(5_000), "clock set back");
    }

    #[test]
    fn both_clocks_tell_of_the_same_moment() {
        let clock = HostClock::start();
        let start = clock.started_at();
        assert!(start > UnixTime::from_nanos(1_700_000_000_000_000_000), "{start}");
        let reading = clock.read();
        let apart = reading.wall.as_nanos() - clock.unix(reading.at).as_nanos();
        assert!(apart.abs() < 1_000_000_000, "{apart} ns apart; was the clock set just now?");
        assert!(start.rfc3339().is_some_and(|text| text.ends_with('Z')));
    }
}
