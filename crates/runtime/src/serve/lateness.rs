//! Lateness of a host: a distribution of times that takes little room however long a run lasts.

use hdrhistogram::Histogram;
use linesman_proto::time::Span;
use serde::{Deserialize, Serialize};

/// Longest time that is told apart, in ns; longer ones count as this: an hour.
const LONGEST: u64 = 3_600_000_000_000;
/// Decimal digits of each time that are kept.
const DIGITS: u8 = 2;

/// Times of a run, each kept to two digits.
#[derive(Clone, Debug)]
pub struct Lateness(Histogram<u64>);

/// What is told of them.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct LatenessReport {
    /// How many frames.
    pub frames: u64,
    /// Half of them were late by no more than this, in ns.
    pub p50_ns: u64,
    /// 99 of 100, in ns.
    pub p99_ns: u64,
    /// 999 of 1,000, in ns.
    pub p999_ns: u64,
    /// The latest of all, in ns.
    pub max_ns: u64,
    /// How many were late by more than 100 µs.
    pub over_100us: u64,
    /// How many were late by more than 1 ms.
    pub over_1ms: u64,
}

impl Default for Lateness {
    fn default() -> Self {
        #[allow(clippy::expect_used, reason = "both bounds and the digits are constants")]
        Self(Histogram::new_with_bounds(1, LONGEST, DIGITS).expect("bounds that a histogram takes"))
    }
}

impl Lateness {
    /// A frame was late by so much.
    pub fn note(&mut self, late: Span) {
        self.0.saturating_record(late.as_nanos());
    }

    /// What came together so far.
    #[must_use]
    pub fn report(&self) -> LatenessReport {
        let Self(times) = self;
        if times.is_empty() {
            return LatenessReport::default();
        }
        let over = |span: Span| times.len() - times.count_between(0, span.as_nanos());
        let max_ns = times.max();
        // A percentile is told as the upper end of its class, which the latest of all may not reach.
        let at = |share| times.value_at_quantile(share).min(max_ns);
        LatenessReport {
            frames: times.len(),
            p50_ns: at(0.5),
            p99_ns: at(0.99),
            p999_ns: at(0.999),
            max_ns,
            over_100us: over(Span::us(100)),
            over_1ms: over(Span::ms(1)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_those_of_the_times() {
        assert_eq!(Lateness::default().report(), LatenessReport::default());
        let mut lateness = Lateness::default();
        for micros in 1..=2000 {
            lateness.note(Span::us(micros));
        }
        let report = lateness.report();
        let near = |found: u64, expected: u64| found.abs_diff(expected) * 100 <= expected;
        assert!(near(report.p50_ns, 1_000_000), "{report:?}");
        assert!(near(report.p99_ns, 1_980_000), "{report:?}");
        assert!(near(report.max_ns, 2_000_000), "{report:?}");
        assert!(report.over_100us.abs_diff(1_900) <= 10, "{report:?}");
        assert!(report.over_1ms.abs_diff(1_000) <= 10, "{report:?}");
        assert_eq!(report.frames, 2000);
    }

    #[test]
    fn no_time_and_an_endless_one_are_kept() {
        let mut lateness = Lateness::default();
        lateness.note(Span::ZERO);
        lateness.note(Span::s(1_000_000));
        let report = lateness.report();
        assert_eq!((report.frames, report.over_1ms), (2, 1));
        assert!(report.max_ns >= LONGEST / 100 * 99, "{report:?}");
    }
}
