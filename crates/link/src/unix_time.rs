//! Wall-clock time as a number, for capture files and for the start of a run.
//!
//! It is kept apart from [`Instant`](linesman_proto::time::Instant), which counts from the start of
//! the run: wall clocks are set, step and differ between the interfaces of one capture.

use std::fmt;
use std::ops::Add;

use jiff::Timestamp;
use jiff::civil::DateTime;
use jiff::tz::TimeZone;
use linesman_proto::time::Span;

/// Nanoseconds since 1970-01-01 00:00 UTC; before that, negative.
///
/// The range covers all that a pcapng time stamp can say, however absurd.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct UnixTime(i128);

impl UnixTime {
    /// 1970-01-01 00:00 UTC.
    pub const EPOCH: Self = Self(0);

    /// The point `nanos` ns after the epoch.
    #[must_use]
    #[inline]
    pub const fn from_nanos(nanos: i128) -> Self {
        Self(nanos)
    }

    /// Nanoseconds since the epoch.
    #[must_use]
    #[inline]
    pub const fn as_nanos(self) -> i128 {
        self.0
    }

    /// Time passed since `earlier`; `None` when `earlier` is in fact later. What a [`Span`] cannot
    /// hold (584 years) becomes the longest one it can.
    #[must_use]
    #[inline]
    pub fn since(self, earlier: Self) -> Option<Span> {
        let nanos = self.0.checked_sub(earlier.0)?;
        (nanos >= 0).then(|| Span::ns(u64::try_from(nanos).unwrap_or(u64::MAX)))
    }

    /// The time that an RFC 3339 text names; `None` when it names none.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        Some(Self(text.parse::<Timestamp>().ok()?.as_nanosecond()))
    }

    /// The time that somebody of this host means: RFC 3339, what [`local`](Self::local) writes, or a date
    /// with or without a time, in the time zone of the host.
    #[must_use]
    pub fn parse_local(text: &str) -> Option<Self> {
        let text = text.trim();
        let joined = text.replacen(" +", "+", 1).replacen(" -", "-", 1);
        let there = || Self::parse(text).or_else(|| Self::parse(&joined));
        let here = || {
            let zoned = text.parse::<DateTime>().ok()?.to_zoned(TimeZone::system()).ok()?;
            Some(Self(zoned.timestamp().as_nanosecond()))
        };
        there().or_else(here)
    }

    /// For people: in the time zone of this host (TZ), to the millisecond, with the offset from UTC:
    /// `2026-03-01 11:16:50.182 +01:00`.
    #[must_use]
    pub fn local(self) -> String {
        self.local_as("%Y-%m-%d %H:%M:%S%.3f %:z")
    }

    /// For people, to the nanosecond: `2026-03-01 11:16:50.182345678 +01:00`.
    #[must_use]
    pub fn local_exact(self) -> String {
        self.local_as("%Y-%m-%d %H:%M:%S%.9f %:z")
    }

    /// Its date in the time zone of this host, with the offset from UTC: `2026-03-01 +01:00`.
    #[must_use]
    pub fn local_date(self) -> String {
        self.local_as("%Y-%m-%d %:z")
    }

    /// Its time of day in the time zone of this host, to the millisecond: `11:16:50.182`.
    #[must_use]
    pub fn local_time_of_day(self) -> String {
        self.local_as("%H:%M:%S%.3f")
    }

    /// For names of files, in the time zone of this host: `20260301111650`.
    #[must_use]
    pub fn local_digits(self) -> String {
        self.local_as("%Y%m%d%H%M%S")
    }

    fn local_as(self, format: &str) -> String {
        let zoned = |stamp: Timestamp| stamp.to_zoned(TimeZone::system());
        match Timestamp::from_nanosecond(self.0).map(zoned) {
            Ok(zoned) => zoned.strftime(format).to_string(),
            Err(_) => self.to_string(),
        }
    }

    /// As RFC 3339 with nanoseconds, in UTC; `None` outside the years -9999..=9999.
    #[must_use]
    pub fn rfc3339(self) -> Option<String> {
        let stamp = Timestamp::from_nanosecond(self.0).ok()?;
        Some(format!("{stamp:.9}"))
    }
}

impl Add<Span> for UnixTime {
    type Output = Self;
    fn add(self, span: Span) -> Self {
        Self(self.0.saturating_add(i128::from(span.as_nanos())))
    }
}

impl fmt::Display for UnixTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.rfc3339() {
            Some(text) => f.write_str(&text),
            None => write!(f, "{} ns since 1970", self.0),
        }
    }
}

impl fmt::Debug for UnixTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "UnixTime({self})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn writes_rfc_3339_with_nanoseconds() {
        let time = UnixTime::from_nanos(1_700_000_000_000_000_001);
        assert_eq!(time.rfc3339().as_deref(), Some("2023-11-14T22:13:20.000000001Z"));
        assert_eq!(UnixTime::from_nanos(i128::MAX).rfc3339(), None);
        assert!(UnixTime::from_nanos(i128::MIN).to_string().ends_with("ns since 1970"));
    }

    #[test]
    fn distance_is_never_negative_and_never_overflows() {
        let (early, late) = (UnixTime::from_nanos(5), UnixTime::from_nanos(12));
        assert_eq!(late.since(early), Some(Span::ns(7)));
        assert_eq!(early.since(late), None);
        let (first, last) = (UnixTime::from_nanos(-1), UnixTime::from_nanos(i128::from(u64::MAX)));
        assert_eq!(last.since(first), Some(Span::ns(u64::MAX)));
        assert_eq!(UnixTime::from_nanos(i128::MAX).since(UnixTime::from_nanos(i128::MIN)), None);
    }
}
