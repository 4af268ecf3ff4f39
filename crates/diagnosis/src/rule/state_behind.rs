//! # A SubDevice is in a lower state than the others
//!
//! Others are in OP, and one or few SubDevices are not, without an error that says why.
//!
//! **How it is found.** AL status (0x0130) of a SubDevice is INIT, PREOP, SAFEOP or BOOT while at least as many others
//! are in OP, in a list of another tool or in a recording in which nobody was seen asking it for a state. It is said
//! of the error bit without a code, too. Where a request was seen, or an error with its code, those say more.
//!
//! **What it means.** Its process data are not exchanged, or its outputs are not taken. It may have started anew, it
//! may have refused a state long ago, or the MainDevice was told to leave it there. BOOT is the state of a firmware
//! update: one is under way, or was broken off.
//!
//! **What to do.** Read AL status and its code (0x0130, 0x0134), ask it for the next state, and look whether it takes
//! it. In BOOT, look first whether somebody is updating its firmware.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::register::table;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};
use crate::model::{Device, NetworkModel};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "S209",
    name: "state-behind",
    severity: Severity::Warning,
    class: Class::Software,
    source: include_str!("state_behind.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

/// Who comes up is in a lower state for a while.
const LASTS: Span = Span::s(2);

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let model = view.model;
    // Whoever brings the line up here knows what it asked for.
    if model.sees_all_orders || model.traffic.is_one_sided() {
        return;
    }
    let present = || model.devices.iter().filter(|device| device.silent.is_none());
    let in_op = present().filter(|device| device.al.state() == Some(AlState::Op)).count();
    let behind: Vec<&Device> = present().filter(|device| is_behind(view, device)).collect();
    if behind.is_empty() || behind.len() > in_op {
        return;
    }
    let found: Vec<Condition> = behind
        .into_iter()
        .filter(|device| !is_told(conditions, model, device))
        .filter_map(|device| condition(model, device, in_op))
        .collect();
    conditions.extend(found);
}

/// Whether it stays below OP, and nobody was seen asking it for that.
fn is_behind(view: &View<'_>, device: &Device) -> bool {
    let Some(status) = device.al.status else { return false };
    let is_low = status.value.state().state().is_some_and(|state| state != AlState::Op);
    let is_list = view.model.traffic.recording.frames() == 0;
    let lasts = is_list || view.has_ended || view.now.since(status.at) >= LASTS;
    // It may have gone on since, in frames that are not in the recording.
    let read = device.al.latest_reading.unwrap_or(status.at);
    let is_fresh = || !view.model.traffic.may_lack(read, view.now);
    is_low && lasts && (is_list || (device.al.requested.is_none() && is_fresh()))
}

/// Whether another finding tells of its state, or of the device itself.
fn is_told(conditions: &[Condition], model: &NetworkModel, device: &Device) -> bool {
    let lost = Symptom::StateLost(device.id);
    let place = Place::device(model.network, device.id);
    conditions.iter().any(|one| {
        one.explains.contains(&lost)
            || one.symptoms.contains(&lost)
            || (one.place == place && one.severity >= Severity::Warning)
    })
}

fn condition(model: &NetworkModel, device: &Device, in_op: usize) -> Option<Condition> {
    let status = device.al.status?;
    let state = status.value.state().state()?;
    let label = model.label(device.id);
    let error = if status.value.error() { " with the error bit" } else { "" };
    let text = format!("AL status of {label}: {state}{error}, while {in_op} others are in OP");
    let place = Place::device(model.network, device.id);
    let causes = match state {
        AlState::Boot => [
            (FaultName::FirmwareFault, 0.4),
            (FaultName::InitRefused, 0.1),
            (FaultName::ConfigMismatch, 0.05),
        ],
        AlState::Init | AlState::PreOp | AlState::SafeOp | AlState::Op => [
            (FaultName::InitRefused, 0.3),
            (FaultName::ConfigMismatch, 0.25),
            (FaultName::BrownOut, 0.15),
        ],
    };
    let [(cause, sure), others @ ..] = causes;
    let seen = crate::model::Seen::new((), status.at, status.frame);
    let mut condition = Condition::new(&PAGE, place, cause, status.at)
        .confidence(sure)
        .confirmed(status.at)
        .about([Symptom::StateLost(device.id)])
        .explaining([Symptom::WorkingCounter(device.id)])
        .shown_by(Evidence::register(device.id, table::AL_STATUS.address, &seen, text));
    for (cause, sure) in others {
        condition = condition.or(cause, sure);
    }
    if status.value.error() {
        condition.severity = Severity::Error;
    }
    if state == AlState::Boot {
        condition = condition.advise(format!(
            "Is a firmware update of {label} under way? Then wait for its end; was one broken off, repeat it."
        ));
    }
    Some(
        condition
            .advise(format!("Read AL status and its code (0x0130, 0x0134) of {label}."))
            .advise(format!("Ask {label} for the next state, and look whether it takes it."))
            .advise("If it is to stay there, as a SubDevice that is switched off in the project, nothing is wrong."),
    )
}
