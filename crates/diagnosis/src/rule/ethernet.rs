//! # Ethernet frames through a mailbox (EoE)
//!
//! A SubDevice spoils Ethernet frames that it sends through its mailbox, or refuses those of the MainDevice.
//!
//! **How it is found.** Fragments of a frame are numbered, and so are the messages of a mailbox. `S253`: fragments do not come,
//! come twice, or come behind a later one, while no message of the mailbox is missing, so that none was lost on its way. `S254`: the
//! mailbox answers fragments of the MainDevice with an error: 0x0007, no memory left, is a full buffer. Both are seen only where the
//! SyncManagers of the mailbox were seen set up.
//!
//! **What it means.** The part of the firmware that carries Ethernet frames is at fault, or short of memory. States, process
//! data and other protocols of the mailbox are not concerned. Each such frame is lost: connections (TCP) get slow,
//! for they send again; datagrams (UDP) are missing.
//!
//! **What to do.** Of `S253`: new firmware for the SubDevice; nothing at cables or MainDevice mends it. Of `S254`: send less to it:
//! fewer connections at once, less multicast and broadcast in its subnet. Power off and on empties its buffers.
//! Where it has no use for Ethernet, `eoe = false` switches it off.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::mailbox::error_reply::ErrorReplyCode;

use super::mailbox::begin;
use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Severity};
use crate::model::{Device, NetworkModel};

/// Fragments are lost, doubled, or out of order.
pub const FRAGMENTS: RulePage = RulePage {
    code: "S253",
    name: "eoe-fragments",
    severity: Severity::Warning,
    class: Class::Software,
    source: include_str!("ethernet.rs"),
};

/// Fragments are refused.
pub const FULL: RulePage = RulePage {
    code: "S254",
    name: "eoe-buffer-full",
    severity: Severity::Warning,
    class: Class::Software,
    source: include_str!("ethernet.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[FRAGMENTS, FULL], judge };

/// Shown of many.
const SHOWN: usize = 3;

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    for device in &view.model.devices {
        conditions.extend(spoiled(view.model, device));
        conditions.extend(refused(view.model, device));
    }
}

fn spoiled(model: &NetworkModel, device: &Device) -> Option<Condition> {
    // What is missing may be what the recording lacks.
    let all = device.mailbox.ethernet.spoiled.iter();
    let all: Vec<_> =
        all.filter(|seen| !model.traffic.may_lack(seen.value.since, seen.at)).collect();
    let (first, last) = (all.first()?, all.last()?);
    let mut condition = begin(model, device, &FRAGMENTS, FaultName::EoeFault, first.at, last.at)
        .confidence(0.8)
        .or(FaultName::FirmwareFault, 0.15);
    let label = model.label(device.id);
    for seen in all.iter().rev().take(SHOWN) {
        let spoiled = seen.value;
        let text = format!(
            "fragment {} of Ethernet frame {} of {label} {}; no message of its mailbox is missing",
            spoiled.fragment,
            spoiled.frame,
            spoiled.how.words()
        );
        condition = condition.shown_by(Evidence::frame(seen.at, seen.frame.unwrap_or(0), text));
    }
    Some(
        condition
            .advise("Ask its maker for newer firmware: cables and MainDevice have no part in it.")
            .advise("Until then use connections that send again (TCP), and few at once."),
    )
}

fn refused(model: &NetworkModel, device: &Device) -> Option<Condition> {
    let all = &device.mailbox.ethernet.refused;
    let (first, last) = (all.front()?, all.back()?);
    let is_full = all.iter().all(|seen| seen.value == ErrorReplyCode::NoMemory);
    let (cause, other) = match is_full {
        true => (FaultName::EoeFault, FaultName::MailboxError),
        false => (FaultName::MailboxError, FaultName::EoeFault),
    };
    let mut condition = begin(model, device, &FULL, cause, first.at, last.at)
        .confidence(if is_full { 0.8 } else { 0.6 })
        .or(other, 0.15);
    let label = model.label(device.id);
    for seen in all.iter().rev().take(SHOWN) {
        let text = format!("{label} answers an Ethernet fragment with error {}", seen.value);
        condition = condition.shown_by(Evidence::frame(seen.at, seen.frame.unwrap_or(0), text));
    }
    Some(
        condition
            .advise("Send less to it: fewer connections at once, less multicast and broadcast.")
            .advise("Power it off and on: its buffers are empty then."),
    )
}
