//! Counts of the MainDevice over all readings.

use linesman_proto::address::{Network, Path};
use linesman_proto::register::AlStatus;
use linesman_proto::time::{Instant, Span};

use super::super::{Count, ObservedMainDevice};
use super::TimedReading;
use crate::model::{NetworkModel, Seen, Tally};
use crate::observe::{HostEvent, HostObservation};

/// Records links, counts and answers of each step.
pub(super) fn teach(model: &mut NetworkModel, steps: &[TimedReading<'_>]) {
    let told: Vec<(Instant, &ObservedMainDevice)> =
        steps.iter().filter_map(|step| Some((step.at, step.main?))).collect();
    let mut observe = |at, what| {
        let (network, path) = (Network(0), Path::A);
        model.host.record(&HostObservation { network, path, time: at, what });
    };
    for (at, main) in &told {
        if let Some(on) = main.link {
            observe(*at, HostEvent::Carrier(on));
        }
    }
    let crc = rises(&told, |main| main.crc);
    for (at, crc) in crc.iter().flatten() {
        observe(*at, HostEvent::CardErrors { crc: *crc, other: 0 });
    }
    for (at, count) in rises(&told, |main| main.drops).into_iter().flatten() {
        observe(at, HostEvent::CardDrops(count));
    }
    for (at, count) in rises(&told, |main| main.send_errors).into_iter().flatten() {
        observe(at, HostEvent::SendFailures(count));
    }
    model.host.is_watched = crc.is_some();
    let lost = tally(&told, |main| main.lost);
    model.traffic.losses.report(lost.unwrap_or_default());
    let reported = &mut model.reported;
    reported.lost = lost;
    reported.late = tally(&told, |main| main.late);
    reported.late_cycles = tally(&told, |main| main.late_cycles);
    reported.timed_out = tally(&told, |main| main.timed_out);
    reported.unmatched = tally(&told, |main| main.unmatched);
    reported.skipped = tally(&told, |main| main.skipped);
    reported.corrupted = tally(&told, |main| main.corrupted);
    let sent = rises(&told, |main| main.sent);
    reported.sent =
        sent.map(|sent| sent.iter().fold(0, |sum: u64, (_, by)| sum.saturating_add(*by)));
    reported.loss_rate = told.iter().rev().find_map(|(_, main)| main.lost_per_s);
    let cycle = told.iter().rev().find_map(|(_, main)| main.cycle_us);
    let cycle = cycle.filter(|us| (0.0..=1e9).contains(us) && *us > 0.0);
    reported.cycle = cycle.map(|us| Span::ns((us * 1e3).round() as u64));
    for (at, is_open) in told.iter().filter_map(|(at, main)| Some((*at, main.ring_open?))) {
        reported.ring_open = Some(Seen::new(is_open, at, None));
    }
    for (at, states) in told.iter().filter_map(|(at, main)| Some((*at, main.states?))) {
        reported.states = Some(Seen::new(AlStatus(states.into()), at, None));
    }
    for (at, answering) in told.iter().filter_map(|(at, main)| Some((*at, main.answering?))) {
        reported.answering_most = reported.answering_most.max(answering);
        if reported.answering.is_none_or(|known| known.value != answering) {
            reported.answering = Some(Seen::new(answering, at, None));
        }
    }
    model.traffic.broadcasts.report(reported.answering_most, reported.answering);
    silence_the_rest(model, steps);
}

/// On a line without branches those answer that are nearest: the others do not, unless they were heard since.
fn silence_the_rest(model: &mut NetworkModel, steps: &[TimedReading<'_>]) {
    let Some(answering) = model.reported.answering else { return };
    let count = usize::from(answering.value);
    let is_chain = model.tree.as_ref().is_some_and(|tree| {
        tree.closes_at().is_none() && (0..tree.len()).all(|node| tree.children(node).count() <= 1)
    });
    if !is_chain && count > 0 {
        return;
    }
    let heard_since = |index: usize| {
        let since = steps.iter().filter(|step| step.at >= answering.at);
        since.flat_map(|step| &step.devices).any(|(one, read)| *one == index && read.is_heard())
    };
    let order: Vec<usize> = match &model.tree {
        Some(tree) => tree.order().to_vec(),
        None => (0..model.devices.len()).collect(),
    };
    for index in order.into_iter().skip(count) {
        if !heard_since(index)
            && let Some(device) = model.devices.get_mut(index)
        {
            device.is_silent(answering.at, None);
        }
    }
}

/// By how much a count rose, and when. What was counted before the first of several readings is history; of a
/// single one all counts. `None` when nobody told it.
fn rises(
    told: &[(Instant, &ObservedMainDevice)],
    of: impl Fn(&ObservedMainDevice) -> Option<Count>,
) -> Option<Vec<(Instant, u64)>> {
    let read: Vec<(Instant, u64)> =
        told.iter().filter_map(|(at, main)| Some((*at, of(main)?.0))).collect();
    match read[..] {
        [] => None,
        [single] => Some(vec![single]),
        [..] => Some(
            read.windows(2)
                .map(|pair| {
                    let [(_, before), (at, after)] = [pair[0], pair[1]];
                    // Who counts less has begun anew.
                    (at, after.checked_sub(before).unwrap_or(after))
                })
                .collect(),
        ),
    }
}

fn tally(
    told: &[(Instant, &ObservedMainDevice)],
    of: impl Fn(&ObservedMainDevice) -> Option<Count>,
) -> Option<Tally> {
    let mut tally = Tally::default();
    for (at, by) in rises(told, of)? {
        tally.add(by, at);
    }
    Some(tally)
}
