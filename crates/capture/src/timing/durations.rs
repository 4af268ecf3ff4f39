//! Many durations in little memory: counts by steps of a thousandth, with the shortest and the longest.

use std::collections::BTreeMap;

use linesman_diagnosis::report::Number;
use linesman_proto::time::Span;
use serde::{Deserialize, Serialize};

/// Bits of a duration that are kept: steps are at most a thousandth of it.
const KEPT_BITS: u32 = 11;
/// Most steps; beyond, the coarser ones next to them are counted.
const MOST_STEPS: usize = 16_384;

/// Durations, counted.
#[derive(Clone, Default, Debug)]
pub struct Durations {
    counts: BTreeMap<u64, u64>,
    count: u64,
    sum: u128,
    shortest: u64,
    longest: u64,
}

/// Durations, summed up.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct DurationsReport {
    /// Number of them.
    pub count: Number,
    /// The shortest.
    pub min_ns: Number,
    /// Half of them are shorter.
    pub median_ns: Number,
    /// The mean.
    pub mean_ns: Number,
    /// 99 of 100 are shorter.
    pub p99_ns: Number,
    /// The longest.
    pub max_ns: Number,
}

/// A bar of a histogram.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct BarReport {
    /// From this on.
    pub from_ns: Number,
    /// Up to this, which is not in it; `null` for all that is longer.
    pub to_ns: Option<Number>,
    /// Number of them.
    pub count: Number,
}

impl Durations {
    /// Takes one.
    pub fn record(&mut self, span: Span) {
        let ns = span.as_nanos();
        (self.shortest, self.longest) = match self.count {
            0 => (ns, ns),
            _ => (self.shortest.min(ns), self.longest.max(ns)),
        };
        self.count += 1;
        self.sum += u128::from(ns);
        let step = step(ns);
        if self.counts.len() >= MOST_STEPS && !self.counts.contains_key(&step) {
            let near = self.counts.range(..step).next_back().or(self.counts.iter().next());
            let near = near.map_or(step, |(near, _)| *near);
            *self.counts.entry(near).or_default() += 1;
        } else {
            *self.counts.entry(step).or_default() += 1;
        }
    }

    /// Number of them.
    #[must_use]
    pub const fn count(&self) -> u64 {
        self.count
    }

    /// The duration that a share of them, in percent, does not exceed; `None` where there are none.
    #[must_use]
    pub fn percentile(&self, percent: u64) -> Option<Span> {
        let wanted = (u128::from(self.count) * u128::from(percent)).div_ceil(100).max(1);
        let mut sum = 0_u128;
        let found = self.counts.iter().find(|(_, count)| {
            sum += u128::from(**count);
            sum >= wanted
        });
        found.map(|(ns, _)| Span::ns((*ns).clamp(self.shortest, self.longest)))
    }

    /// The steps and how many are in each, shortest first.
    pub fn steps(&self) -> impl Iterator<Item = (Span, u64)> + '_ {
        self.counts.iter().map(|(ns, count)| (Span::ns(*ns), *count))
    }

    /// Summed up; `None` where there are none.
    #[must_use]
    pub fn report(&self) -> Option<DurationsReport> {
        let mean = self.sum.checked_div(u128::from(self.count))?;
        Some(DurationsReport {
            count: Number(self.count),
            min_ns: Number(self.shortest),
            median_ns: Number(self.percentile(50)?.as_nanos()),
            mean_ns: Number(mean as u64),
            p99_ns: Number(self.percentile(99)?.as_nanos()),
            max_ns: Number(self.longest),
        })
    }

    /// Deviations from `cycle`, of intervals in which nothing is missing: bars of 1, 2, 5, 10, … µs.
    #[must_use]
    pub fn jitter(&self, cycle: Span) -> Vec<BarReport> {
        let near = self.steps().filter(|(interval, _)| cycles_in(*interval, cycle) <= 1);
        bars(near.map(|(interval, count)| (interval.as_nanos().abs_diff(cycle.as_nanos()), count)))
    }

    /// Cycles that passed without one.
    #[must_use]
    pub fn missing(&self, cycle: Span) -> u64 {
        self.steps()
            .map(|(interval, count)| cycles_in(interval, cycle).saturating_sub(1) * count)
            .fold(0, u64::saturating_add)
    }

    /// Intervals that are longer or shorter by a fifth of the cycle or more, whole cycles apart.
    #[must_use]
    pub fn off(&self, cycle: Span) -> u64 {
        let cycle_ns = cycle.as_nanos().max(1);
        let is_off = |interval: Span| {
            let whole = cycles_in(interval, cycle).max(1).saturating_mul(cycle_ns);
            interval.as_nanos().abs_diff(whole) * 5 >= cycle_ns
        };
        self.steps().filter(|(interval, _)| is_off(*interval)).map(|(_, count)| count).sum()
    }
}

fn cycles_in(interval: Span, cycle: Span) -> u64 {
    let cycle_ns = cycle.as_nanos().max(1);
    interval.as_nanos().saturating_add(cycle_ns / 2) / cycle_ns
}

/// The step in which a duration is counted: its highest bits.
const fn step(ns: u64) -> u64 {
    let bits = u64::BITS - ns.leading_zeros();
    let dropped = bits.saturating_sub(KEPT_BITS);
    ns >> dropped << dropped
}

/// Counts in bars of 1, 2, 5, 10, … µs; the last one has all that is longer.
#[must_use]
pub fn bars(all: impl Iterator<Item = (u64, u64)>) -> Vec<BarReport> {
    const EDGES: [u64; 16] = [
        0,
        1_000,
        2_000,
        5_000,
        10_000,
        20_000,
        50_000,
        100_000,
        200_000,
        500_000,
        1_000_000,
        2_000_000,
        5_000_000,
        10_000_000,
        100_000_000,
        1_000_000_000,
    ];
    let mut counts = [0_u64; EDGES.len()];
    for (ns, count) in all {
        let at = EDGES.iter().rposition(|edge| *edge <= ns).unwrap_or(0);
        counts[at] += count;
    }
    let report = |(at, count): (usize, &u64)| BarReport {
        from_ns: Number(EDGES[at]),
        to_ns: EDGES.get(at + 1).map(|edge| Number(*edge)),
        count: Number(*count),
    };
    counts.iter().enumerate().filter(|(_, count)| **count > 0).map(report).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(all_us: impl IntoIterator<Item = u64>) -> Durations {
        let mut durations = Durations::default();
        all_us.into_iter().for_each(|us| durations.record(Span::us(us)));
        durations
    }

    #[test]
    fn durations_are_summed_up_to_a_thousandth() {
        assert_eq!(Durations::default().report(), None);
        let report = of((1..=100).map(|us| us * 1_000)).report().unwrap();
        assert_eq!((report.count.0, report.min_ns.0), (100, 1_000_000));
        assert_eq!((report.mean_ns.0, report.max_ns.0), (50_500_000, 100_000_000));
        assert!(report.median_ns.0.abs_diff(50_000_000) <= 50_000, "{report:?}");
        assert!(report.p99_ns.0.abs_diff(99_000_000) <= 99_000, "{report:?}");
    }

    #[test]
    fn cycle_that_is_left_out_is_missing_and_not_late() {
        let durations = of(std::iter::repeat_n(1_000, 50).chain([3_000, 1_300, 700]));
        let cycle = Span::ms(1);
        assert_eq!((durations.missing(cycle), durations.off(cycle)), (2, 2));
        let jitter = durations.jitter(cycle);
        let bar =
            |from: u64| jitter.iter().find(|bar| bar.from_ns.0 == from).map(|bar| bar.count.0);
        assert_eq!((bar(0), bar(200_000)), (Some(50), Some(2)), "{jitter:?}");
    }

    #[test]
    fn durations_of_all_lengths_take_bounded_room() {
        let mut durations = Durations::default();
        for n in 0..200_000_u64 {
            durations.record(Span::ns(n.wrapping_mul(0x9E37_79B9_7F4A_7C15)));
        }
        assert!(durations.counts.len() <= MOST_STEPS);
        assert_eq!(durations.steps().map(|(_, count)| count).sum::<u64>(), 200_000);
    }
}
