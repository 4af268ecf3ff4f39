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
//! answer, or is in the other half of a ring.
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
use crate::line::clock::{Astray, Reference};
use crate::line::{Absence, Device, Line};

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
    let line = view.line;
    // Whoever follows a clock that stands goes astray with it.
    if reference_clock::is_lost(line) {
        return;
    }
    let astray: Vec<(&Device, Astray)> = (line.devices.iter())
        .filter_map(|device| Some((device, device.clock.astray?)))
        .filter(|(device, astray)| !was_gone(device, astray) && !was_left_alone(line, astray))
        .collect();
    if astray.is_empty() {
        conditions.extend(alone(line));
        return;
    }
    if let Some(reference) = wrong_reference(line, &astray) {
        conditions.push(of_reference(line, reference, &astray));
        return;
    }
    for (device, astray) in &astray {
        let condition = begin(line, device.id, std::slice::from_ref(astray));
        let evidence = evidence(line, device.id, astray);
        conditions.push(condition.shown_by(evidence).explaining(follows(device.id)));
    }
}

/// So long after it answers again a clock that nobody steered is on its way back.
const PULLED_IN: Span = Span::s(2);

/// Whether the SubDevice was gone, or started anew, meanwhile or just before: then its clock had to be set or
/// pulled in again.
fn was_gone(device: &Device, astray: &Astray) -> bool {
    let is_within = |at| at >= astray.near.at && at <= astray.far.at;
    let was_away = |absence: &Absence| {
        let is_over = absence.ended.is_some_and(|ended| ended + PULLED_IN < astray.near.at);
        absence.since.at <= astray.far.at && !is_over
    };
    device.absences.iter().any(was_away)
        || device.al.changes.iter().any(|change| change.is_own_fall() && is_within(change.at))
}

/// Whether a SubDevice did not answer when a clock went astray, or not long before.
fn was_silent(device: &Device, astray: &Astray) -> bool {
    let began = |since: Instant| since <= astray.far.at;
    device.silent.is_some_and(|silent| began(silent.at))
        || device.absences.iter().any(|absence| {
            began(absence.since.at) && absence.ended.is_none_or(|ended| ended >= astray.near.at)
        })
}

/// Whether no frame came round meanwhile, or none with the time of the reference, or the ring was in halves, so
/// that nobody was steered, and the clock went off by no more than a sound quartz does in such a time.
fn was_left_alone(line: &Line, astray: &Astray) -> bool {
    let silent = line.traffic.silences.iter().map(|silence| {
        let ended = silence.ended.unwrap_or(line.now).min(astray.far.at);
        ended.since(silence.since.at.max(astray.near.at).min(ended)).as_nanos()
    });
    // Frames may go round without a time, too.
    let withheld = line.references.iter();
    let withheld = withheld.map(|reference| reference.withheld(astray.near.at, astray.far.at));
    let withheld = withheld.min().unwrap_or_default().as_nanos();
    let alone = silent.sum::<u64>().max(withheld);
    // Where the reference does not answer, nobody puts its time into the frame, and the others take what is there.
    let without_reference = line.references.iter().any(|reference| {
        line.device(reference.device).is_some_and(|device| was_silent(device, astray))
    });
    if without_reference {
        return true;
    }
    let is_in_halves = line.traffic.broadcast_split.is_some_and(|split| split.at >= astray.near.at);
    if is_in_halves && astray.ppm.unsigned_abs() <= Reference::SOUND.unsigned_abs() {
        return true;
    }
    let off = u128::from(
        astray.worst.value.unsigned_abs().saturating_sub(astray.near.value.unsigned_abs()),
    );
    off * 1_000_000 <= u128::from(alone) * Reference::SOUND as u128
}

/// The reference clock, if it is that which runs wrong.
fn wrong_reference(line: &Line, astray: &[(&Device, Astray)]) -> Option<DeviceId> {
    let [reference] = line.references.as_slice() else { return None };
    if reference.wrong_speed.is_some() {
        return Some(reference.device);
    }
    // Most of those whose difference was read since, in one direction.
    let began = astray.iter().map(|(_, astray)| astray.far.at).min()?;
    let read = line.devices.iter().filter(|device| {
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
fn alone(line: &Line) -> Option<Condition> {
    let [reference] = line.references.as_slice() else { return None };
    let ppm = reference.wrong_speed?.unsigned_abs();
    let id = reference.device;
    let mut others = line.devices.iter().filter(|device| device.id != id);
    if ppm <= SLEWED && others.any(|device| device.clock.near.is_some()) {
        return None;
    }
    let condition = of_reference(line, id, &[]);
    Some(condition.confidence(0.6).or_at(FaultName::ClockDrift, Place::Host, 0.3))
}

fn of_reference(line: &Line, id: DeviceId, astray: &[(&Device, Astray)]) -> Condition {
    let spans: Vec<Astray> = astray.iter().map(|(_, astray)| *astray).collect();
    let mut condition = begin(line, id, &spans);
    let reference = line.references.iter().find(|one| one.device == id);
    if let Some(ppm) = reference.and_then(|reference| reference.wrong_speed) {
        let text = format!(
            "the time of reference clock {} goes {} than that of the computer, by {} parts per million",
            line.label(id),
            if ppm > 0 { "faster" } else { "slower" },
            ppm.abs()
        );
        condition = condition.shown_by(Evidence::host(Some(line.now), text));
    }
    for (device, astray) in astray.iter().take(3) {
        condition = condition.shown_by(evidence(line, device.id, astray));
    }
    condition.explaining(line.devices.iter().flat_map(|device| follows(device.id)))
}

fn begin(line: &Line, id: DeviceId, astray: &[Astray]) -> Condition {
    let since = astray.iter().map(|one| one.far.at).min().unwrap_or(line.now);
    let condition = Condition::new(
        &PAGE,
        Place::device(line.network, id),
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

fn evidence(line: &Line, id: DeviceId, astray: &Astray) -> Evidence {
    let us = |ns: i64| ns as f64 / 1e3;
    let text = format!(
        "clock of {}: {:+.3} µs off the reference, then {:+.3} µs, at most {:+.3} µs; up to {} parts \
         per million",
        line.label(id),
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
