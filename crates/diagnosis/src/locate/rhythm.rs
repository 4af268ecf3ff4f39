//! Pattern of errors over time: two places in step, or one place steadily.

use linesman_proto::register::ErrorCounter;
use linesman_proto::time::Span;
use linesman_proto::topology::End;

use super::damage::Damage;
use super::input::LocateInput;
use super::intervals::{Intervals, TimeInterval, meet};
use crate::model::Rise;

/// Readings further apart than this say nothing of what came at the same moment.
const CLOSE_READING: Span = Span::ms(150);

/// Steps by which one series is moved against the other, to see how much of them coincides by chance.
const MOVES: u64 = 80;

/// Two hits that are covered wholly, counted at either place, in thousandths of a hit: a single meeting is none.
const ENOUGH_MEETINGS: u64 = 4_000;

/// Whether the damage at two places has one source: its bursts hit both at the same moments, and both begin
/// and end with it. Two faults of their own may last at the same time, but each goes its own way.
///
/// The same two series, moved against each other in circles, show what coincides by chance: each keeps its own rhythm, and
/// it does not matter how often places are hit and read. Not meetings are counted, but the covered part of each hit: where a
/// place is hit between nearly any two readings, all hits meet.
pub(super) fn falls_together(input: &LocateInput<'_>, a: &[Damage], b: &[Damage]) -> bool {
    let lasted = [a, b].map(|damages| all_hits(input, damages).last().copied());
    let (a, b) = (hits(input, a), hits(input, b));
    let ends = |hits: &[TimeInterval]| Some((*hits.first()?, *hits.last()?));
    let (Some((a_first, a_last)), Some((b_first, b_last))) = (ends(&a), ends(&b)) else {
        return false;
    };
    // One that goes on after the last close reading does not end there.
    let is_end = lasted == [Some(a_last), Some(b_last)];
    if meet(a_first, b_first) && meet(a_last, b_last) && is_end {
        return true;
    }
    let both = (a_first.0.max(b_first.0), a_last.1.min(b_last.1));
    let within = |hits: &[TimeInterval]| -> Vec<TimeInterval> {
        let within = hits.iter().filter(|hit| meet(**hit, both));
        within.map(|hit| (hit.0.max(both.0), hit.1.min(both.1))).collect()
    };
    let (a, b) = (within(&a), within(&b));
    let stretches = [&a, &b].map(|hits| hits.iter().copied().collect::<Intervals>());
    let around = both.1.since(both.0).as_nanos();
    let coincide = |by: u64| {
        covered(&a, &stretches[1], both, by) + covered(&b, &stretches[0], both, around - by)
    };
    let mut lengths: Vec<u64> =
        a.iter().chain(&b).map(|(from, to)| to.since(*from).as_nanos()).collect();
    lengths.sort_unstable();
    let Some(length) = lengths.get(lengths.len() / 2).filter(|_| around > 0) else { return false };
    // The same burst is read a little earlier at one place than at the other.
    let is_near = |by: u64| by.min(around - by) <= *length;
    let moves = (0..MOVES).map(|at| around / MOVES * at);
    let (near, far): (Vec<u64>, Vec<u64>) = moves.partition(|by| is_near(*by));
    let together = near.into_iter().map(coincide).max().unwrap_or(0);
    together >= ENOUGH_MEETINGS && far.into_iter().all(|by| coincide(by) < together)
}

/// Sum of the parts of the hits at one place that those at the other cover, in thousandths of a hit, when they are moved by
/// `by` ns in a circle of time.
fn covered(moved: &[TimeInterval], others: &Intervals, circle: TimeInterval, by: u64) -> u64 {
    let (start, end) = circle;
    let around = end.since(start).as_nanos();
    let share = |(from, to): &TimeInterval| {
        let len = to.since(*from);
        let from = start + Span::ns((from.since(start).as_nanos() + by) % around);
        let to = from + len;
        // What is moved beyond the end comes in at the start.
        let rest = to.since(end.max(from));
        let met = others.overlap((from, to.min(end))) + others.overlap((start, start + rest));
        met.as_nanos() * 1_000 / len.as_nanos().max(1)
    };
    moved.iter().map(share).sum()
}

/// When a place was hit, in order, as far as it was read closely: a hit lies between the reading before a rise
/// and the reading that shows it.
fn hits(input: &LocateInput<'_>, damages: &[Damage]) -> Vec<TimeInterval> {
    let is_close = |(begin, end): &TimeInterval| end.since(*begin) <= CLOSE_READING;
    all_hits(input, damages).into_iter().filter(is_close).collect()
}

/// When a place was hit, in order.
fn all_hits(input: &LocateInput<'_>, damages: &[Damage]) -> Vec<TimeInterval> {
    let rises = damages.iter().flat_map(|damage| rises(input, damage));
    let mut hits: Vec<TimeInterval> = rises.map(|rise| (rise.after_time, rise.at)).collect();
    hits.sort_unstable();
    hits.dedup();
    hits
}

/// Whether errors come in nearly each reading, as a damaged part makes them, and not in bursts.
pub(super) fn is_steady(input: &LocateInput<'_>, damages: &[Damage]) -> bool {
    damages.iter().all(|damage| {
        let End::Controller(node, port) = damage.hop.to else { return false };
        let Some(track) = input.track(node, ErrorCounter::PhysicalLayer(port)) else {
            return false;
        };
        let rises: Vec<&Rise> = input.rises(track).collect();
        let (Some(first), Some(last)) = (rises.first(), rises.last()) else { return false };
        let reading = last.at.since(last.after_time).as_nanos();
        let period = last.at.since(first.after_time).as_nanos();
        let count = rises.len() as u64;
        count >= 5 && period <= reading.saturating_mul(count * 5 / 4)
    })
}

/// The rises of the receiving port that show a damage.
fn rises<'a>(input: &LocateInput<'a>, damage: &Damage) -> Vec<&'a Rise> {
    let End::Controller(node, port) = damage.hop.to else { return Vec::new() };
    let counters = [ErrorCounter::PhysicalLayer(port), ErrorCounter::InvalidFrame(port)];
    counters
        .into_iter()
        .filter_map(|counter| input.track(node, counter))
        .flat_map(|track| input.rises(track))
        .collect()
}
