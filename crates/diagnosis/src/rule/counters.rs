//! # Counters that tell less than they seem
//!
//! Somebody else clears error counters, or a counter is at its end.
//!
//! **How it is found.** `C331`: a counter reads lower than before, no write to it was seen on this line, and
//! the SubDevice did not start anew. `H113`: a counter has read 255 from the first reading on, where counters of
//! controllers stop, and others on the line rise.
//!
//! **What it means.** `C331`: another tool counts on the same line, or clears the counters through another way
//! (a gateway, the device's own software). Rises between two readings may be lost: rates are too low, and
//! a place may show less than it had. `H113`: what happens at this port from now on is not counted; the
//! ports behind it then look worse than this one.
//!
//! **What to do.** `C331`: end the other tool, or read its numbers. `H113`: clear the counters (a write to
//! 0x0300 clears errors, to 0x0310 lost links) and look again: `linesman counters WHERE --clear`.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::register::ErrorCounter;
use linesman_proto::time::Span;

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};
use crate::model::{Device, NetworkModel};

/// Somebody clears them.
pub const CLEARED: RulePage = RulePage {
    code: "C331",
    name: "counters-cleared",
    severity: Severity::Info,
    class: Class::Configuration,
    source: include_str!("counters.rs"),
};

/// One is at its end.
pub const FULL: RulePage = RulePage {
    code: "H113",
    name: "counter-full",
    severity: Severity::Info,
    class: Class::Hardware,
    source: include_str!("counters.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[CLEARED, FULL], judge };

/// What did not come again for this long is over.
const QUIET: Span = Span::s(10);

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    conditions.extend(cleared(view.model));
    // As long as nothing is counted anywhere, it does not matter who could not.
    if !view.model.devices.iter().any(|device| device.counters.last_rise().is_some()) {
        return;
    }
    // Beside damage that was located it belongs to that: it says what could not be seen of it.
    let located =
        conditions.iter().find(|condition| matches!(condition.page.code, "H110" | "H111"));
    let about = located.and_then(|condition| condition.explains.first().copied());
    for device in &view.model.devices {
        let full = full(view.model, device);
        conditions.extend(full.map(|mut full| {
            full.symptoms = about.map_or(full.symptoms, |about| vec![about]);
            full
        }));
    }
}

fn cleared(model: &NetworkModel) -> Option<Condition> {
    let is_well = |device: &&Device| {
        // Who starts anew has counters of 0, too.
        device.absences.is_empty() && !device.al.changes.iter().any(|change| change.is_own_fall())
    };
    let all = model.devices.iter().filter(is_well);
    let all: Vec<_> = all.filter_map(|device| Some((device, device.counters.cleared()?))).collect();
    let (device, first) = all.iter().min_by_key(|(_, seen)| seen.at)?;
    let last = all.iter().map(|(_, seen)| seen.at).max()?;
    let times: u32 = all.iter().map(|(device, _)| device.counters.foreign_clears()).sum();
    let (counter, before) = first.value;
    let text = format!(
        "{} of {} fell from {before} to {} without a write that was seen here; {times} times on \
         {} SubDevices by now",
        name(counter),
        model.label(device.id),
        device.counters.latest(counter).unwrap_or(0),
        all.len()
    );
    let place = Place::Network { network: model.network };
    let condition = Condition::new(&CLEARED, place, FaultName::SecondMainDevice, first.at)
        .confidence(0.5)
        .confirmed(first.at)
        .about([Symptom::CountersCleared])
        .shown_by(Evidence::register(device.id, counter.address(), first, text))
        .advise("Look for another tool that is connected to this line, or to its MainDevice.")
        .advise(
            "Until then read rates with care: what was counted between two readings may be lost.",
        );
    Some(if last + QUIET < model.now { condition.ended(last) } else { condition })
}

fn full(model: &NetworkModel, device: &Device) -> Option<Condition> {
    // One that came to its end here has told all it had to tell.
    let is_full = |counter: &ErrorCounter| {
        let track = device.counters.track(*counter);
        track.is_some_and(|track| track.was_at_end() && track.is_at_end())
    };
    let full: Vec<ErrorCounter> = ErrorCounter::ALL.into_iter().filter(is_full).collect();
    let first = *full.first()?;
    let track = device.counters.track(first)?;
    let since = track.first.at;
    let names: Vec<String> = full.iter().map(|counter| name(*counter)).collect();
    let text = format!(
        "at its end, 255, and counts no more: {} of {}",
        names.join(", "),
        model.label(device.id)
    );
    let place = Place::device(model.network, device.id);
    let ports = full.iter().filter_map(|counter| counter.port());
    let mut condition = Condition::new(&FULL, place, FaultName::CableDegraded, since)
        .confidence(0.3)
        .or(FaultName::EmcNoise, 0.3)
        .confirmed(since)
        .about(ports.map(|port| Symptom::PortErrors(device.id, port)))
        .shown_by(Evidence::register(device.id, first.address(), &track.last, text))
        .advise("Clear the counters and look again: `linesman counters WHERE --clear`.");
    if full.iter().all(|counter| matches!(counter, ErrorCounter::LostLink(_))) {
        condition.cause = FaultName::LinkFlapping;
        condition.symptoms.clear();
        let ports = full.iter().filter_map(|counter| counter.port());
        condition = condition.about(ports.map(|port| Symptom::LinkCounted(device.id, port)));
    }
    Some(condition)
}

fn name(counter: ErrorCounter) -> String {
    match counter.port() {
        Some(port) => format!("counter `{}` of port {port}", counter.name()),
        None => format!("counter `{}`", counter.name()),
    }
}
