//! Lateness of cycle begins on this computer, against the rule that jitter of 20 % of the cycle is
//! doubtful, and of 30 % bad: synchronisation errors are likely then (SYN-31).

use linesman_diagnosis::rule::jitter::Verdict;
use linesman_link::clock::{HostClock, tighten_timers};
use linesman_link::real_time::sched_fifo;
use linesman_proto::time::Span;
use serde::Serialize;

/// As a MainDevice would ask for it: above interrupt threads, below the kernel's own watchdogs.
const PRIORITY: u8 = 80;

/// What was measured.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Report {
    /// The cycle, in µs.
    cycle_us: f64,
    /// How many cycles.
    cycles: u64,
    /// Whether real-time priority was granted.
    real_time: bool,
    /// Half of the cycles began at most so late, in µs.
    median_us: f64,
    /// 99.9 % of the cycles began at most so late, in µs.
    most_us: f64,
    /// The latest one, in µs.
    latest_us: f64,
    /// The latest one in percent of the cycle.
    percent_of_cycle: f64,
    /// Cycles that began later than 30 % of the cycle.
    late_cycles: u64,
    /// `good`, `doubtful` (20 % of the cycle and more) or `bad` (30 %).
    outcome: String,
    #[serde(skip)]
    #[schemars(skip)]
    verdict: Option<Verdict>,
}

/// Wakes up each `cycle` for `span`.
pub(super) fn measure(cycle: Span, span: Span) -> Report {
    let real_time = sched_fifo(PRIORITY).is_ok();
    tighten_timers();
    let clock = HostClock::start();
    let cycles = (span.as_nanos() / cycle.as_nanos()).max(1);
    let mut late = Vec::with_capacity(usize::try_from(cycles).unwrap_or(usize::MAX));
    let mut next = clock.now() + cycle;
    for _ in 0..cycles {
        late.push(clock.sleep_until(next));
        next += cycle;
    }
    report(cycle, late, real_time)
}

fn report(cycle: Span, mut late: Vec<Span>, real_time: bool) -> Report {
    late.sort_unstable();
    let at = |share: f64| {
        let index = ((late.len() as f64 * share).ceil() as usize).clamp(1, late.len().max(1)) - 1;
        late.get(index).copied().unwrap_or(Span::ZERO)
    };
    let us = |span: Span| span.as_nanos() as f64 / 1e3;
    let latest = at(1.0);
    let verdict = Verdict::of(latest, cycle);
    let limit = Verdict::bad_from(cycle);
    Report {
        cycle_us: us(cycle),
        cycles: late.len() as u64,
        real_time,
        median_us: us(at(0.5)),
        most_us: us(at(0.999)),
        latest_us: us(latest),
        percent_of_cycle: us(latest) * 100.0 / us(cycle),
        late_cycles: late.iter().filter(|late| **late >= limit).count() as u64,
        outcome: match verdict {
            None => "good",
            Some(Verdict::Doubtful) => "doubtful",
            Some(Verdict::Bad) => "bad",
        }
        .to_owned(),
        verdict,
    }
}

impl Report {
    /// Whether no synchronisation errors are to be expected.
    pub(super) const fn is_good(&self) -> bool {
        self.verdict.is_none()
    }

    /// For people.
    pub(super) fn text(&self) -> String {
        let how = if self.real_time { "with" } else { "without" };
        let advice = match self.verdict {
            None => "below 20 %: well".to_owned(),
            Some(Verdict::Doubtful) => {
                "20 % and more: synchronisation may be lost at times".to_owned()
            }
            Some(Verdict::Bad) => format!(
                "30 % and more: synchronisation errors are likely; mend what is listed above, or take a \
                 cycle of {:.0} µs or longer",
                (self.latest_us / 0.2).ceil()
            ),
        };
        format!(
            "{} cycles of {:.0} µs {how} real-time priority: late by {:.1} µs (half of them), {:.1} µs \
             (99.9 %), {:.1} µs (the latest), {:.1} % of the cycle. {advice}.",
            self.cycles,
            self.cycle_us,
            self.median_us,
            self.most_us,
            self.latest_us,
            self.percent_of_cycle
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // proves: SYN-31 partial: of the host's own cycle
    #[test]
    fn a_fifth_of_the_cycle_is_doubtful_and_three_tenths_are_bad() {
        let of = |us: u64| report(Span::ms(1), vec![Span::us(5), Span::us(us)], true);
        for (us, outcome) in [(199, "good"), (200, "doubtful"), (299, "doubtful"), (300, "bad")] {
            assert_eq!(of(us).outcome, outcome, "{us} µs of 1 ms");
        }
        let bad = of(500);
        assert_eq!((bad.late_cycles, bad.is_good()), (1, false));
        assert!(bad.text().contains("50.0 % of the cycle"), "{}", bad.text());
        assert!(bad.text().contains("2500 µs or longer"), "{}", bad.text());
    }
}
