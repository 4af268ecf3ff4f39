//! How errors come in time: two places in step, or one place steadily.

use linesman_proto::register::ErrorCounter;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::End;

use super::damage::Damage;
use super::survey::Survey;
use crate::line::Rise;

/// Damage from one source begins within the time in which all counters are read once or twice.
const SAME_START: Span = Span::ms(500);

/// Rises read so close together belong to one round of reading.
const SAME_READING: Span = Span::ms(60);

/// With fewer readings chance alone may look like a common source.
const ENOUGH_READINGS: usize = 10;

/// Two series that go together so closely have one source: by chance one pair of ten readings in
/// thirty does.
const RELATED: f64 = 0.6;

/// Whether the damage at two places began together and swell and fade together, as the bursts of one source make
/// them. Two faults of their own may last at the same time, but each goes its own way.
pub(super) fn falls_together(survey: &Survey<'_>, a: &[Damage], b: &[Damage]) -> bool {
    let first = |damages: &[Damage]| damages.iter().map(|damage| damage.first).min();
    let (Some(one), Some(other)) = (first(a), first(b)) else { return false };
    if one.max(other).since(one.min(other)) > SAME_START {
        return false;
    }
    let of = |damages: &[Damage]| -> Vec<(Instant, f64)> {
        let rises = damages.iter().flat_map(|damage| rises(survey, damage));
        rises.map(|rise| (rise.at, f64::from(rise.difference.rise))).collect()
    };
    let readings = side_by_side(&of(a), &of(b));
    readings.len() >= ENOUGH_READINGS && correlation(&readings) >= RELATED
}

/// Whether errors come in nearly each reading, as a damaged part makes them, and not in bursts.
pub(super) fn is_steady(survey: &Survey<'_>, damages: &[Damage]) -> bool {
    damages.iter().all(|damage| {
        let End::Controller(node, port) = damage.hop.to else { return false };
        let Some(track) = survey.track(node, ErrorCounter::PhysicalLayer(port)) else {
            return false;
        };
        let rises: Vec<&Rise> = survey.rises(track).collect();
        let (Some(first), Some(last)) = (rises.first(), rises.last()) else { return false };
        let reading = last.at.since(last.after_time).as_nanos();
        let period = last.at.since(first.after_time).as_nanos();
        let count = rises.len() as u64;
        count >= 5 && period <= reading.saturating_mul(count * 5 / 4)
    })
}

/// The rises of the receiving port that show a damage.
fn rises<'a>(survey: &Survey<'a>, damage: &Damage) -> Vec<&'a Rise> {
    let End::Controller(node, port) = damage.hop.to else { return Vec::new() };
    let counters = [ErrorCounter::PhysicalLayer(port), ErrorCounter::InvalidFrame(port)];
    counters
        .into_iter()
        .filter_map(|counter| survey.track(node, counter))
        .flat_map(|track| survey.rises(track))
        .collect()
}

/// Rises of two groups by the reading in which they were seen; 0 where only the other one rose.
fn side_by_side(a: &[(Instant, f64)], b: &[(Instant, f64)]) -> Vec<(f64, f64)> {
    let mut all: Vec<(Instant, f64, f64)> = Vec::with_capacity(a.len() + b.len());
    all.extend(a.iter().map(|(at, by)| (*at, *by, 0.0)));
    all.extend(b.iter().map(|(at, by)| (*at, 0.0, *by)));
    all.sort_by_key(|(at, ..)| *at);
    let mut readings: Vec<(f64, f64)> = Vec::with_capacity(all.len());
    let mut began: Option<Instant> = None;
    for (at, one, other) in all {
        match (began, readings.last_mut()) {
            (Some(from), Some(last)) if at.since(from) <= SAME_READING => {
                last.0 += one;
                last.1 += other;
            }
            (Some(_) | None, _) => {
                readings.push((one, other));
                began = Some(at);
            }
        }
    }
    readings
}

/// Correlation of two series, -1 to 1; 0 where one of them never changes.
fn correlation(series: &[(f64, f64)]) -> f64 {
    let len = series.len() as f64;
    let (sum_a, sum_b) = series.iter().fold((0.0, 0.0), |(a, b), pair| (a + pair.0, b + pair.1));
    let (mean_a, mean_b) = (sum_a / len, sum_b / len);
    let (mut both, mut own_a, mut own_b) = (0.0, 0.0, 0.0);
    for (a, b) in series {
        both += (a - mean_a) * (b - mean_b);
        own_a += (a - mean_a) * (a - mean_a);
        own_b += (b - mean_b) * (b - mean_b);
    }
    if own_a > 0.0 && own_b > 0.0 { both / (own_a * own_b).sqrt() } else { 0.0 }
}
