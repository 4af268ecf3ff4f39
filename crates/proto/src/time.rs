//! Time as a number: nanoseconds, never read from a clock here.
//!
//! [`Instant`] and [`Span`] belong to the run (0 is its start); [`DcTime`] belongs to distributed
//! clocks (0 is 2000-01-01 00:00 UTC). The two never mix.

use std::fmt;
use std::ops::{Add, AddAssign, Mul, Sub};

/// A point in time: nanoseconds since the start of the run.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Instant(u64);

impl Instant {
    /// The start of the run.
    pub const ZERO: Self = Self(0);
    /// Later than anything: for "no deadline".
    pub const MAX: Self = Self(u64::MAX);

    /// The point `nanos` ns after the start of the run.
    #[must_use]
    #[inline]
    pub const fn from_nanos(nanos: u64) -> Self {
        Self(nanos)
    }

    /// Nanoseconds since the start of the run.
    #[must_use]
    #[inline]
    pub const fn as_nanos(self) -> u64 {
        self.0
    }

    /// Time passed since `earlier`; zero when `earlier` is in fact later.
    #[must_use]
    #[inline]
    pub const fn since(self, earlier: Self) -> Span {
        Span(self.0.saturating_sub(earlier.0))
    }

    /// This point moved back by `span`, not beyond the start of the run.
    #[must_use]
    #[inline]
    pub const fn before(self, span: Span) -> Self {
        Self(self.0.saturating_sub(span.0))
    }
}

/// A length of time in nanoseconds, never negative.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Span(u64);

impl Span {
    /// No time at all.
    pub const ZERO: Self = Self(0);

    /// `nanos` nanoseconds.
    #[must_use]
    #[inline]
    pub const fn ns(nanos: u64) -> Self {
        Self(nanos)
    }

    /// `micros` microseconds.
    #[must_use]
    pub const fn us(micros: u64) -> Self {
        Self(micros * 1_000)
    }

    /// `millis` milliseconds.
    #[must_use]
    pub const fn ms(millis: u64) -> Self {
        Self(millis * 1_000_000)
    }

    /// `seconds` seconds.
    #[must_use]
    pub const fn s(seconds: u64) -> Self {
        Self(seconds * 1_000_000_000)
    }

    /// The length in nanoseconds.
    #[must_use]
    #[inline]
    pub const fn as_nanos(self) -> u64 {
        self.0
    }

    /// The length in seconds, for rates and for people.
    #[must_use]
    pub fn as_secs_f64(self) -> f64 {
        self.0 as f64 / 1e9
    }

    /// This length less `other`, not below zero.
    #[must_use]
    #[inline]
    pub const fn saturating_sub(self, other: Self) -> Self {
        Self(self.0.saturating_sub(other.0))
    }
}

impl Add<Span> for Instant {
    type Output = Self;
    #[inline]
    fn add(self, span: Span) -> Self {
        Self(self.0.saturating_add(span.0))
    }
}

impl AddAssign<Span> for Instant {
    #[inline]
    fn add_assign(&mut self, span: Span) {
        *self = *self + span;
    }
}

impl Sub<Span> for Instant {
    type Output = Self;
    #[inline]
    fn sub(self, span: Span) -> Self {
        self.before(span)
    }
}

impl Add for Span {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }
}

impl AddAssign for Span {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Mul<u64> for Span {
    type Output = Self;
    #[inline]
    fn mul(self, factor: u64) -> Self {
        Self(self.0.saturating_mul(factor))
    }
}

impl fmt::Display for Span {
    /// In s, ms, µs or ns with at most three decimals, the rest cut off.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (unit, name) = match self.0 {
            0..1_000 => (1u64, "ns"),
            1_000..1_000_000 => (1_000, "µs"),
            1_000_000..1_000_000_000 => (1_000_000, "ms"),
            _ => (1_000_000_000, "s"),
        };
        let whole = self.0 / unit;
        let thousandths = (self.0 % unit) * 1_000 / unit;
        if thousandths == 0 {
            write!(f, "{whole} {name}")
        } else {
            let text = format!("{thousandths:03}");
            write!(f, "{whole}.{} {name}", text.trim_end_matches('0'))
        }
    }
}

impl fmt::Debug for Span {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Span({self})")
    }
}

impl fmt::Display for Instant {
    /// Seconds since the start of the run, with microseconds.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{:06} s", self.0 / 1_000_000_000, self.0 % 1_000_000_000 / 1_000)
    }
}

impl fmt::Debug for Instant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Instant({self})")
    }
}

/// Distributed-clock system time: nanoseconds since 2000-01-01 00:00 UTC, 64 bit.
///
/// Reference: S2, register 0x0910.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Debug)]
pub struct DcTime(pub u64);

impl DcTime {
    /// Seconds from the Unix epoch to the epoch of distributed clocks.
    pub const UNIX_EPOCH_OFFSET_S: u64 = 946_684_800;

    /// The low 32 bits, which wrap after 4.295 s.
    #[must_use]
    pub const fn low(self) -> DcTime32 {
        DcTime32(self.0 as u32)
    }
}

/// The low 32 bits of a [`DcTime`] or of a receive time. They wrap every 2^32 ns = 4.295 s, so the
/// only thing offered is the difference.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub struct DcTime32(pub u32);

impl DcTime32 {
    /// `self - earlier` over the wrap, in ns: right when the true distance is below 2.147 s.
    #[must_use]
    pub const fn delta(self, earlier: Self) -> i32 {
        self.0.wrapping_sub(earlier.0) as i32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // proves: DC-02 partial
    #[test]
    fn dc_time_wraps_after_four_seconds() {
        assert_eq!(Span::ns(1 << 32).to_string(), "4.294 s");
        let before = DcTime(u64::from(u32::MAX) - 99).low();
        let after = DcTime(u64::from(u32::MAX) + 101).low();
        assert_eq!(after.delta(before), 200);
        assert_eq!(before.delta(after), -200);
    }

    #[test]
    fn spans_read_like_a_data_sheet() {
        assert_eq!(Span::ns(80).to_string(), "80 ns");
        assert_eq!(Span::ns(6_720).to_string(), "6.72 µs");
        assert_eq!(Span::ms(2).to_string(), "2 ms");
        assert_eq!(Instant::from_nanos(1_500_000_000).to_string(), "1.500000 s");
    }

    #[test]
    fn time_does_not_run_below_zero() {
        assert_eq!(Instant::from_nanos(5).since(Instant::from_nanos(9)), Span::ZERO);
        assert_eq!(Instant::from_nanos(5) - Span::ns(9), Instant::ZERO);
    }
}
