//! # A clock drifts
//!
//! The clock of a SubDevice does not follow the reference clock any more.
//!
//! **How it is found.** Each controller shows how far its clock is off the reference clock (0x092C), as an
//! average of what the frames bring. A clock that had been near, within 5 µs, and is 20 µs off or more has
//! gone astray; two readings tell how fast it goes. One clock that goes astray runs wrong itself. When all of
//! them do at once, in the same direction, it is the reference that runs wrong; so it is when the time that it
//! gives goes faster or slower than the clock of the computer by more than any sound quartz.
//!
//! Nobody reads these registers all the time: live, the diagnosis asks for them by turns. A clock that goes off
//! while no frame comes round, or none that hands the time of the reference round, by no more than a sound quartz
//! does in that time, was left alone and is well; so is one that goes off when the reference clock does not
//! answer, within two seconds after that, or is in the other half of a ring.
//!
//! **What it means.** Control in the controller follows quartzes that are off by some hundreds of parts per
//! million, and sound ones are off by fifty at most. Heat and damage make it more. The SYNC signals of the
//! SubDevice come earlier and earlier, or later and later, within the cycle; when they meet the frames, it
//! misses outputs and leaves OP (0x001A, 0x002C), again and again. That is listed beneath.
//!
//! **What to do.** Measure the temperature in the cabinet, then exchange the SubDevice. Where the reference
//! runs wrong, choose another one meanwhile.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::address::{DeviceId, RegisterAddress};
use linesman_proto::time::{Instant, Span};

use super::{Rule, RulePage, View, reference_clock};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};
use crate::model::clock::{ClockDeviation, Reference};
use crate::model::{Absence, Device, NetworkModel};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "T420",
    name: "clock-drift",
    severity: Severity::Error,
    class: Class::Timing,
    source: include_str!("clock_drift.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

const DIFFERENCE: RegisterAddress = RegisterAddress(0x092C);

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let model = view.model;
    // Whoever follows a clock that stands goes astray with it.
    if reference_clock::is_lost(model) {
        return;
    }
    let astray: Vec<(&Device, ClockDeviation)> = (model.devices.iter())
        .filter_map(|device| Some((device, device.clock.astray?)))
        .filter(|(device, astray)| !was_gone(device, astray) && !was_left_alone(model, astray))
        .collect();
    if astray.is_empty() {
        conditions.extend(alone(model));
        return;
    }
    if let Some(reference) = wrong_reference(model, &astray) {
        conditions.push(of_reference(model, reference, &astray));
        return;
    }
    for (device, astray) in &astray {
        let condition = begin(model, device.id, std::slice::from_ref(astray));
        let evidence = evidence(model, device.id, astray);
        conditions.push(condition.shown_by(evidence).explaining(follows(device.id)));
    }
}

/// So long after it answers again a clock that nobody steered is on its way back.
const PULLED_IN: Span = Span::s(2);

/// Whether the SubDevice was gone, or started anew, meanwhile or just before: then its clock had to be set or
/// pulled in again.
fn was_gone(device: &Device, astray: &ClockDeviation) -> bool {
    let is_within = |at| at >= astray.near.at && at <= astray.far.at;
    let was_away = |absence: &Absence| {
        let is_over = absence.ended.is_some_and(|ended| ended + PULLED_IN < astray.near.at);
        absence.since.at <= astray.far.at && !is_over
    };
    device.absences.iter().any(was_away)
        || device.al.changes.iter().any(|change| change.is_own_fall() && is_within(change.at))
}

/// Whether a SubDevice did not answer when a clock went astray, or not long before.
fn was_silent(device: &Device, astray: &ClockDeviation) -> bool {
    let began = |since: Instant| since <= astray.far.at;
    device.silent.is_some_and(|silent| began(silent.at))
        || device.absences.iter().any(|absence| {
            let is_over = absence.ended.is_some_and(|ended| ended + PULLED_IN < astray.near.at);
            began(absence.since.at) && !is_over
        })
}

/// Whether no frame came round meanwhile, or none with the time of the reference, or the ring was in halves, so
/// that nobody was steered, and the clock went off by no more than a sound quartz does in such a time.
fn was_left_alone(model: &NetworkModel, astray: &ClockDeviation) -> bool {
    let silent = model.traffic.losses.silences().iter().map(|silence| {
        let ended = silence.ended.unwrap_or(model.now).min(astray.far.at);
        ended.since(silence.since.at.max(astray.near.at).min(ended)).as_nanos()
    });
    // Frames may go round without a time, too.
    let withheld = model.references.iter();
    let withheld = withheld.map(|reference| reference.withheld(astray.near.at, astray.far.at));
    let withheld = withheld.min().unwrap_or_default().as_nanos();
    let alone = silent.sum::<u64>().max(withheld);
    // Where the reference does not answer, nobody puts its time into the frame, and the others take what is there.
    let without_reference = model.references.iter().any(|reference| {
        model.device(reference.device).is_some_and(|device| was_silent(device, astray))
    });
    if without_reference {
        return true;
    }
    let is_in_halves =
        model.traffic.broadcasts.split().is_some_and(|split| split.at >= astray.near.at);
    if is_in_halves && astray.ppm.unsigned_abs() <= Reference::SOUND.unsigned_abs() {
        return true;
    }
    let off = u128::from(
        astray.worst.value.unsigned_abs().saturating_sub(astray.near.value.unsigned_abs()),
    );
    off * 1_000_000 <= u128::from(alone) * Reference::SOUND as u128
}

/// The reference clock, if it is that which runs wrong.
fn wrong_reference(model: &NetworkModel, astray: &[(&Device, ClockDeviation)]) -> Option<DeviceId> {
    let [reference] = model.references.as_slice() else { return None };
    if reference.wrong_speed.is_some() {
        return Some(reference.device);
    }
    // Most of those whose difference was read since, in one direction.
    let began = astray.iter().map(|(_, astray)| astray.far.at).min()?;
    let read = model.devices.iter().filter(|device| {
        let latest = device.clock.differences.back();
        device.id != reference.device && latest.is_some_and(|latest| latest.at >= began)
    });
    let ahead = astray.iter().filter(|(_, astray)| astray.worst.value > 0).count();
    let is_one_way = ahead == 0 || ahead == astray.len();
    (astray.len() >= 3 && is_one_way && astray.len() == read.count()).then_some(reference.device)
}

/// The clock of a computer is not set right faster than this (Linux, `adjtimex`), in parts per million.
const SLEWED: u64 = 500;

/// A reference clock that nobody is known to leave, against the clock of the computer: one of the two is
/// wrong. While others follow it, a difference may be a computer's clock that is being set right.
fn alone(model: &NetworkModel) -> Option<Condition> {
    let [reference] = model.references.as_slice() else { return None };
    let ppm = reference.wrong_speed?.unsigned_abs();
    let id = reference.device;
    let mut others = model.devices.iter().filter(|device| device.id != id);
    if ppm <= SLEWED && others.any(|device| device.clock.near.is_some()) {
        return None;
    }
    let condition = of_reference(model, id, &[]);
    Some(condition.confidence(0.6).or_at(FaultName::ClockDrift, Place::Host, 0.3))
}

fn of_reference(
    model: &NetworkModel,
    id: DeviceId,
    astray: &[(&Device, ClockDeviation)],
) -> Condition {
    let spans: Vec<ClockDeviation> = astray.iter().map(|(_, astray)| *astray).collect();
    let mut condition = begin(model, id, &spans);
    let reference = model.references.iter().find(|one| one.device == id);
    if let Some(ppm) = reference.and_then(|reference| reference.wrong_speed) {
        let text = format!(
            "the time of reference clock {} goes {} than that of the computer, by {} parts per million",
            model.label(id),
            if ppm > 0 { "faster" } else { "slower" },
            ppm.abs()
        );
        condition = condition.shown_by(Evidence::host(Some(model.now), text));
    }
    for (device, astray) in astray.iter().take(3) {
        condition = condition.shown_by(evidence(model, device.id, astray));
    }
    condition.explaining(model.devices.iter().flat_map(|device| follows(device.id)))
}

fn begin(model: &NetworkModel, id: DeviceId, astray: &[ClockDeviation]) -> Condition {
    let since = astray.iter().map(|one| one.far.at).min().unwrap_or(model.now);
    let condition = Condition::new(
        &PAGE,
        Place::device(model.network, id),
        FaultName::ClockDrift,
        since,
    )
    .confidence(0.85)
    .confirmed(since)
    .advise("Measure the temperature in the cabinet: quartzes go wrong with heat.")
    .advise("Exchange this SubDevice; if it is the reference clock, choose another one meanwhile.");
    if astray.is_empty() {
        return condition;
    }
    let ended = astray.iter().map(|one| one.ended).collect::<Option<Vec<_>>>();
    match ended.and_then(|ended| ended.into_iter().max()) {
        Some(ended) => condition.ended(ended),
        None => condition,
    }
}

fn evidence(model: &NetworkModel, id: DeviceId, astray: &ClockDeviation) -> Evidence {
    let us = |ns: i64| ns as f64 / 1e3;
    let text = format!(
        "clock of {}: {:+.3} µs off the reference, then {:+.3} µs, at most {:+.3} µs; up to {} parts \
         per million",
        model.label(id),
        us(astray.near.value),
        us(astray.far.value),
        us(astray.worst.value),
        astray.ppm
    );
    Evidence::register(id, DIFFERENCE, &astray.far, text)
        .values(Some(astray.near.value.unsigned_abs()), Some(astray.far.value.unsigned_abs()))
}

fn follows(id: DeviceId) -> [Symptom; 3] {
    [Symptom::StateLost(id), Symptom::WorkingCounter(id), Symptom::Emergency(id)]
}
