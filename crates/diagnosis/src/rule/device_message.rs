//! # Message of a SubDevice's diagnosis history
//!
//! A SubDevice has noted something of itself in object 0x10F3, and a tool read it.
//!
//! **How it is found.** SDO uploads of 0x10F3 from subindex 6 on are seen on the line, by whomever they were
//! asked: `linesman history`, another tool, the MainDevice. Each message stands once, with the code, the
//! severity that the SubDevice gives it, the number of its text, and the time by the SubDevice's clock.
//!
//! **What it means.** It is the SubDevice's own view, and may be old: it is told among the findings of the same
//! time, beneath the one that it belongs to when the SubDevice left a state, and is no fault by itself.
//!
//! **What to do.** `linesman history` shows the texts from the device description, and acknowledges them.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::mailbox::coe::diagnosis::{DiagnosisMessage, Severity as Seriousness};

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};
use crate::model::mailbox::HistoryMessage;

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "S241",
    name: "device-message",
    severity: Severity::Info,
    class: Class::Software,
    source: include_str!("device_message.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let model = view.model;
    for device in &model.devices {
        let serious = |message: &HistoryMessage| {
            matches!(message.severity, Seriousness::Warning | Seriousness::Error)
        };
        let all = device.mailbox.messages.iter().filter(|seen| serious(&seen.value));
        let all: Vec<_> = all.collect();
        let (Some(first), Some(last)) = (all.first(), all.last()) else { continue };
        let place = Place::device(model.network, device.id);
        let mut condition = Condition::new(&PAGE, place, FaultName::FirmwareFault, first.at)
            .confidence(0.4)
            .confirmed(first.at)
            .ended(last.at)
            .about([Symptom::Emergency(device.id)])
            .advise(format!(
                "`linesman history WHERE {}` shows the texts, from the description of the device.",
                device.id.no()
            ));
        for seen in all {
            let label = model.label(device.id);
            let text = format!("{label} noted {}", text(&seen.value));
            condition = condition.shown_by(Evidence::frame(seen.at, seen.frame.unwrap_or(0), text));
        }
        conditions.push(condition);
    }
}

fn text(message: &HistoryMessage) -> String {
    let (low, high) = (message.code as u16, (message.code >> 16) as u16);
    let code = if low == DiagnosisMessage::EMERGENCY {
        format!("emergency 0x{high:04X}")
    } else {
        format!("code 0x{:08X}", message.code)
    };
    let when = match message.time_ns {
        0 => "without a time".to_owned(),
        ns => format!("at {}.{:06} s of its clock", ns / 1_000_000_000, ns / 1_000 % 1_000_000),
    };
    let severity = message.severity.name();
    format!("{code} ({severity}), text 0x{:04X}, {when}", message.text)
}
