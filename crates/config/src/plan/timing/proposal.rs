//! Shifts and cycles with which a SubDevice passes that does not.
//!
//! A shift is proposed only when the same calculation lets it pass. It leaves a twentieth of the period free on
//! both sides of SYNC0 where there is so much room.

use linesman_proto::time::Span;

use super::super::shift::signed;
use super::super::{Plan, ShiftReference};
use super::device_timing::{CycleTimes, DeviceTiming, SlowerTask, TimingVerdict};

/// Part of the period that a proposed shift leaves free beside the margin: 1/20.
const COMFORT: u64 = 20;
/// ns of a µs: the shifts of the network are given in those.
const MICROSECOND: i64 = 1_000;
/// Most shifts of the network that are tried.
const MOST_TRIED: usize = 1_000;

/// Margins that are tried one after the other.
fn margins(times: &CycleTimes, margin: Span) -> [i64; 2] {
    let margin = signed(margin);
    [margin.saturating_add(signed(times.period) / COMFORT as i64), margin]
}

/// True if SYNC0 at this time leaves so much on both sides.
fn passes(times: &CycleTimes, sync0_ns: i64, margin: i64) -> bool {
    let found = times.margins(sync0_ns);
    found.first.0 >= margin && found.second.0 >= margin
}

/// True if a shift might mend it: it fails by a rule.
fn is_off(device: &DeviceTiming) -> bool {
    let rules = [&device.after_frames, &device.before_next];
    rules.iter().any(|rule| rule.verdict == TimingVerdict::Fail)
}

/// Fills in what mends a SubDevice by itself.
pub(super) fn for_one(plan: &Plan, device: &mut DeviceTiming, margin: Span) {
    let (Some(times), Some(planned)) = (&device.times, plan.device(device.device)) else { return };
    let period = signed(times.period).max(1);
    let moved = is_off(device).then(|| {
        margins(times, margin).into_iter().find_map(|margin| {
            let all = times.candidates(margin).filter(|at| passes(times, *at, margin));
            // The shortest way round the period.
            let way = |at: i64| (at - times.sync0_ns + period / 2).rem_euclid(period) - period / 2;
            all.map(way).min_by_key(|way| way.abs())
        })
    });
    let own = planned.settings.clock.map_or(0, |clock| clock.sync0_shift_ns);
    let no_shift = matches!(moved, Some(None));
    device.own_shift_ns = moved.flatten().map(|moved| own.saturating_add(moved));
    let least = no_shift.then(|| times.least_period(margin));
    device.slower = device.too_fast.max(least).map(|needed| slower(plan, times, needed));
}

/// A cycle of at least `needed`, a multiple of that of the SubDevice's task so that the tasks stay in step.
fn slower(plan: &Plan, times: &CycleTimes, needed: Span) -> SlowerTask {
    let cycle = times.cycle.as_nanos().max(1);
    let cycle = Span::ns(needed.as_nanos().div_ceil(cycle).max(2).saturating_mul(cycle));
    let fitting = plan.tasks.iter().filter(|task| task.cycle >= needed && task.cycle > times.cycle);
    let task = fitting.min_by_key(|task| task.cycle).map(|task| task.name.clone());
    SlowerTask { cycle, task }
}

/// A shift of the network in ns with which all SubDevices that refer to it pass the rules.
fn for_all(
    plan: &Plan,
    devices: &[DeviceTiming],
    reference: ShiftReference,
    margin: Span,
) -> Option<i64> {
    // Where SYNC0 comes several times a cycle the shift follows from that, not from the network.
    let moved = devices.iter().filter_map(|device| {
        let planned = plan.device(device.device)?;
        let task = plan.clocked_task(planned)?;
        let is_moved = device.reference == reference && plan.comes_often(planned, task).is_none();
        let times = device.times.as_ref().filter(|_| is_moved)?;
        Some((device, times, plan.network_shift_ns(planned, task)))
    });
    let moved: Vec<_> = moved.collect();
    if !moved.iter().any(|(device, ..)| is_off(device)) {
        return None;
    }
    let now = moved.first().map_or(0, |(.., shift)| *shift);
    // Comfort by the shortest period, then without.
    let shortest = moved.iter().min_by_key(|(_, times, _)| times.period)?;
    margins(shortest.1, margin).into_iter().find_map(|margin| {
        let mut tried: Vec<i64> = moved
            .iter()
            .flat_map(|(_, times, shift)| {
                let period = signed(times.period).max(1);
                times.candidates(margin).flat_map(move |at| {
                    let way = (at - times.sync0_ns + period / 2).rem_euclid(period) - period / 2;
                    let at = shift.saturating_add(way);
                    [
                        at.div_euclid(MICROSECOND) * MICROSECOND,
                        at.saturating_add(MICROSECOND - 1).div_euclid(MICROSECOND) * MICROSECOND,
                    ]
                })
            })
            .filter(|shift| reference == ShiftReference::Inputs || *shift >= 0)
            .collect();
        tried.sort_by_key(|shift| ((shift - now).abs(), *shift));
        tried.dedup();
        let good = |shift: &i64| {
            moved.iter().all(|(_, times, now)| {
                passes(times, times.sync0_ns.saturating_add(shift - now), margin)
            })
        };
        tried.into_iter().take(MOST_TRIED).find(good)
    })
}

/// A shift of the outputs with which all that refer to it pass the rules; `None` where they do, or none mends them.
pub(super) fn outputs_shift(plan: &Plan, devices: &[DeviceTiming], margin: Span) -> Option<Span> {
    let shift = for_all(plan, devices, ShiftReference::Outputs, margin)?;
    u64::try_from(shift).ok().map(Span::ns)
}

/// The same for the inputs, in ns.
pub(super) fn inputs_shift_ns(plan: &Plan, devices: &[DeviceTiming], margin: Span) -> Option<i64> {
    for_all(plan, devices, ShiftReference::Inputs, margin)
}
