//! Time line: a bar for each finding on the time of the run.

use linesman_diagnosis::report::{FindingReport, Number};
use linesman_proto::time::Instant;
use maud::{Markup, html};

use super::wall_clock::WallClock;
use crate::text::finding::{Writer, severity_word};
use crate::text::quantity::time;

/// Most bars; consequences beyond are left out.
const MOST: usize = 60;
/// Most steps of the axis.
const STEPS: u64 = 5;
/// The narrowest bar, in per cent of the run.
const LEAST: f64 = 0.5;

/// The bars, causes in front of what follows from them.
pub(super) fn section(
    findings: &[FindingReport],
    at: Instant,
    clock: WallClock,
    writer: &Writer<'_>,
) -> Markup {
    let mut rows = Vec::new();
    for finding in findings {
        flatten(finding, 0, &mut rows);
    }
    let left_out = rows.len().saturating_sub(MOST);
    rows.truncate(MOST);
    let latest = rows.iter().flat_map(|(_, one)| [Some(one.opened_ns), one.closed_ns]);
    let end =
        latest.flatten().map(|Number(ns)| ns).chain([at.as_nanos()]).max().unwrap_or(0).max(1);
    let ticks: Vec<u64> = ticks(end).collect();
    html! {
        @if !rows.is_empty() {
            section class="timeline" {
                h2 { "Time line" }
                @for (depth, one) in &rows {
                    @let closed = one.closed_ns.map_or(end, |Number(ns)| ns);
                    @let (from, to) = (share(one.opened_ns.0, end), share(closed, end));
                    @let width = (to - from).max(LEAST);
                    div class="row" {
                        span class="label" style=[(*depth > 0).then(|| format!("padding-left:{}em", depth))] {
                            (one.id) " " (one.code) " " (one.name)
                        }
                        svg class="track" role="img" width="100%" height="14" {
                            title { (one.id) " " (writer.names.place(&one.place)) }
                            @for tick in &ticks {
                                @let x = percent(share(*tick, end));
                                line class="grid" x1=(x) x2=(x) y1="0" y2="14" {}
                            }
                            rect class={ "bar " (severity_word(one.severity)) } y="2" height="10"
                                x=(percent(from.min(100.0 - width))) width=(percent(width)) {}
                        }
                    }
                }
                div class="row axis" {
                    span class="label" { (caption(clock, end)) }
                    div class="ticks" {
                        @for tick in &ticks {
                            span style={ "left:" (percent(share(*tick, end))) } {
                                (time(*tick))
                                @if let Some(clock) = clock.time_of_day(*tick) { br; (clock) }
                            }
                        }
                    }
                }
                @if left_out > 0 { p class="faint" { "and " (left_out) " more that follow" } }
            }
        }
    }
}

/// `since the start`, and the date that clock times belong to.
fn caption(clock: WallClock, end: u64) -> Markup {
    html! {
        "since the start"
        @if let Some(first) = clock.date(0) {
            br; "clock, " (first)
            @if let Some(last) = clock.date(end).filter(|last| *last != first) { " to " (last) }
        }
    }
}

/// Round times from the start to the end: steps of 1, 2 or 5 of a decimal unit.
fn ticks(end: u64) -> impl Iterator<Item = u64> {
    let decades = std::iter::successors(Some(1u64), |unit| unit.checked_mul(10));
    let steps = decades.flat_map(|unit| [1, 2, 5].map(|times| unit.saturating_mul(times)));
    let step = steps.into_iter().find(|step| end / step <= STEPS).unwrap_or(u64::MAX);
    (0..=end / step).map(move |index| index * step)
}

/// A time as a share of the run, in per cent.
fn share(ns: u64, end: u64) -> f64 {
    (ns as f64 / end as f64 * 100.0).min(100.0)
}

/// Hundredths are fine enough, and the same on every machine.
fn percent(share: f64) -> String {
    format!("{share:.2}%")
}

fn flatten<'a>(
    finding: &'a FindingReport,
    depth: usize,
    rows: &mut Vec<(usize, &'a FindingReport)>,
) {
    rows.push((depth, finding));
    for one in &finding.consequences {
        flatten(one, depth + 1, rows);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axis_has_round_steps_from_the_start() {
        let of = |end| ticks(end).collect::<Vec<_>>();
        assert_eq!(of(1), [0, 1]);
        assert_eq!(of(6_500_000_000), [0, 2_000_000_000, 4_000_000_000, 6_000_000_000]);
        assert_eq!(of(3_306_000_000), [0, 1_000_000_000, 2_000_000_000, 3_000_000_000]);
        for end in [7, 99, 12_345_678, 86_400_000_000_000, u64::MAX] {
            let count = of(end).len();
            assert!((2..=6).contains(&count), "{end}: {count}");
        }
    }
}
