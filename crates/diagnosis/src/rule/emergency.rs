//! # Emergency message
//!
//! A SubDevice reported an error through its mailbox, without being asked.
//!
//! **How it is found.** A mailbox read brought a CoE emergency: a code, the error register, and five bytes
//! of the manufacturer. A code from 0x0000 to 0x00FF says that the error is gone.
//!
//! **What it means.** The class of the code says where to look: current, voltage, temperature, hardware or
//! software of the device, communication, or something outside it. When the SubDevice left its state at
//! the same time, that finding stands above this one.
//!
//! **What to do.** Look the code up in the SubDevice's manual; read its diagnosis history (object 0x10F3).

use linesman_config::fault::{Class, FaultName};
use linesman_proto::mailbox::coe::{Emergency, EmergencyClass};

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};
use crate::model::{Device, NetworkModel, Seen};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "S240",
    name: "emergency",
    severity: Severity::Warning,
    class: Class::Software,
    source: include_str!("emergency.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

/// Shown of many.
const SHOWN: usize = 3;

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    for device in &view.model.devices {
        let is_error = |seen: &&Seen<Emergency>| seen.value.class() != EmergencyClass::Reset;
        let errors: Vec<_> = device.emergencies.iter().filter(is_error).collect();
        let Some(first) = errors.first() else { continue };
        conditions.push(condition(view.model, device, first, &errors));
    }
}

fn condition(
    model: &NetworkModel,
    device: &Device,
    first: &Seen<Emergency>,
    errors: &[&Seen<Emergency>],
) -> Condition {
    let place = Place::device(model.network, device.id);
    let mut condition = Condition::new(&PAGE, place, FaultName::Emergency, first.at)
        .confidence(0.8)
        .or(FaultName::FirmwareFault, 0.1)
        .confirmed(first.at)
        .about([Symptom::Emergency(device.id)]);
    for seen in errors.iter().rev().take(SHOWN) {
        let sorts: Vec<_> = seen.value.register.names().collect();
        let text = format!(
            "{} sent emergency 0x{:04X} ({}), error register: {}",
            model.label(device.id),
            seen.value.code,
            seen.value.class().text(),
            if sorts.is_empty() { "no error".to_owned() } else { sorts.join(", ") }
        );
        condition = condition.shown_by(Evidence::frame(seen.at, seen.frame.unwrap_or(0), text));
    }
    // The latest message counts: an error, or that it is gone.
    let latest = device.emergencies.back();
    if let Some(gone) = latest.filter(|seen| seen.value.class() == EmergencyClass::Reset) {
        condition = condition.ended(gone.at);
    }
    condition
        .advise("Look the code up in the SubDevice's manual.")
        .advise("Read its diagnosis history (object 0x10F3), if it has one.")
}
