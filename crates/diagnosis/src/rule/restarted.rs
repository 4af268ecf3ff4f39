//! # A SubDevice started anew
//!
//! A SubDevice is back in INIT, or in another lower state, and nobody asked for it; it signals no error.
//!
//! **How it is found.** AL status (0x0130) falls while AL control (0x0120) last asked for the state
//! before. A controller that starts anew comes up in INIT with its station address, its SyncManagers and
//! its counters cleared, so it often answers only to its position at first.
//!
//! **What it means.** For a fall to INIT the supply dipped (brown-out), or the firmware reset itself.
//! When several SubDevices fall at the same moment, they share the supply that failed. A fall to another
//! state without an error code is the doing of the firmware.
//!
//! **What to do.** Measure the supply of the SubDevice under load, at the device; look what is switched
//! at these moments.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::address::RegisterAddress;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;

use super::{Rule, RulePage, View, link_lost};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};
use crate::line::{AlChange, Device, Line};
use crate::locate::Drops;

/// Back in INIT.
pub const RESTARTED: RulePage = RulePage {
    code: "H150",
    name: "restarted",
    severity: Severity::Error,
    class: Class::Hardware,
    source: include_str!("restarted.rs"),
};

/// In another lower state.
pub const FELL: RulePage = RulePage {
    code: "S205",
    name: "state-fell",
    severity: Severity::Error,
    class: Class::Software,
    source: include_str!("restarted.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[RESTARTED, FELL], judge };

const AL_STATUS: RegisterAddress = RegisterAddress(0x0130);
/// States are polled one after the other: falls so close together are one event.
const TOGETHER: Span = Span::ms(500);

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let mut falls: Vec<(&Device, &AlChange)> = Vec::new();
    for device in &view.line.devices {
        let mut own = device.al.changes.iter().filter(|change| change.is_own_fall());
        if let Some(change) = own.next_back() {
            falls.push((device, change));
        }
    }
    for (device, change) in &falls {
        let is_restart = change.to.state().state() == Some(AlState::Init);
        let together: Vec<_> = falls
            .iter()
            .filter(|(other, at)| other.id != device.id && is_near(at, change))
            .map(|(other, _)| other.id)
            .collect();
        let page = if is_restart { &RESTARTED } else { &FELL };
        let cause = if is_restart { FaultName::BrownOut } else { FaultName::FirmwareFault };
        let text = format!(
            "AL status: {} before, {} now, not asked for",
            change.from.state(),
            change.to.state()
        );
        let seen = crate::line::Seen::new((), change.at, change.frame);
        let evidence = Evidence::register(device.id, AL_STATUS, &seen, text)
            .values(Some(u64::from(change.from.0)), Some(u64::from(change.to.0)));
        let place = Place::device(view.line.network, device.id);
        let mut condition = Condition::new(page, place, cause, change.at)
            .confidence(0.7)
            .confirmed(change.at)
            .shown_by(evidence)
            .explaining([Symptom::WorkingCounter(device.id), Symptom::Silent(device.id)]);
        condition = if is_restart {
            condition.or(FaultName::FirmwareFault, 0.15).or(FaultName::DeviceOff, 0.1)
        } else {
            condition.or(FaultName::BrownOut, 0.1)
        };
        let is_first = together.iter().all(|other| device.id < *other);
        if is_restart && is_first {
            condition =
                condition.explaining(together.iter().map(|other| Symptom::StateLost(*other)));
        } else if is_restart {
            condition = condition.about([Symptom::StateLost(device.id)]);
        }
        if let Some(back) = device.al.state().filter(|state| *state >= came_from(change))
            && let Some(at) = device.al.status
            && at.at > change.at
            && back > AlState::Init
        {
            condition = condition.ended(at.at);
        }
        if is_restart {
            condition = condition.explaining(links_lost_with(view.line, device));
        }
        conditions.push(advise(condition, is_restart, together.len()));
    }
}

/// What follows from a restart at the links of the device: without supply it has no link, so its
/// neighbours lose theirs. Not so where a link was lost more often than the device restarted.
fn links_lost_with(line: &Line, device: &Device) -> Vec<Symptom> {
    let Some(tree) = &line.tree else { return Vec::new() };
    let falls = device.al.changes.iter().filter(|change| change.is_own_fall()).count() as u64;
    let mut follows = Vec::new();
    for drops in Drops::all(line) {
        let link = tree.links()[drops.link];
        let ends = [link.upstream, link.downstream];
        let is_its = ends.iter().any(|end| end.node() == Some(device.id.index()));
        if is_its && drops.count <= falls {
            follows.extend(link_lost::follows(line, tree, drops.link));
        }
    }
    follows
}

fn is_near(one: &AlChange, other: &AlChange) -> bool {
    let (early, late) = if one.at < other.at { (one, other) } else { (other, one) };
    late.at.since(early.at) <= TOGETHER
}

fn came_from(change: &AlChange) -> AlState {
    change.from.state().state().unwrap_or(AlState::Init)
}

fn advise(condition: Condition, is_restart: bool, others: usize) -> Condition {
    if !is_restart {
        return condition
            .advise("Read the SubDevice's diagnosis history (object 0x10F3), if it has one.")
            .advise("Note its firmware version and ask the manufacturer, with a capture.");
    }
    let condition = if others > 0 {
        condition.advise(
            "Several SubDevices started anew at the same moment: look for the supply that they share.",
        )
    } else {
        condition
    };
    condition
        .advise("Measure the supply of this SubDevice under load, at its terminals.")
        .advise("Check plug and clamp of the supply; move them while watching the line.")
        .advise("Look what is switched on at the moments of the restarts.")
}
