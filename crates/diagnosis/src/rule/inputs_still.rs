//! # Inputs stand still
//!
//! A SubDevice gives its inputs in each cycle, but its application does not renew them any more.
//!
//! **How it is found.** Some SubDevices flip a bit with each new value (TxPDO toggle), analogue terminals one in the status
//! of each channel. Bits of several bytes that all along flipped in the same frames stand still, while the working
//! counter is as it was and the SubDevice is in OP or SAFEOP. Inputs that stand still without such a bit are none:
//! nothing may move.
//!
//! **What it means.** The controller goes on exchanging what its memory holds; the processor that fills it has stopped, or
//! its application has. States, links and working counters show nothing of it. Live, or where the MainDevice polls DL
//! status, `S206` tells it more directly; then this is listed beneath.
//!
//! **What to do.** Do not trust its inputs. Power it off and on; note its firmware version, and ask its maker with a capture.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::time::Instant;

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};
use crate::model::input_activity::LifeSign;
use crate::model::{Cyclic, Device, NetworkModel};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "S211",
    name: "inputs-still",
    severity: Severity::Warning,
    class: Class::Software,
    source: include_str!("inputs_still.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let model = view.model;
    for cyclic in model.cyclic.iter().filter(|cyclic| !cyclic.wkc.has_deficit()) {
        let now = cyclic.returned.last().unwrap_or(view.now);
        if model.owners(cyclic).next().is_none() {
            let sign = cyclic.motion.stopped(0, cyclic.len, now);
            conditions.extend(sign.map(|sign| condition(model, cyclic, None, &sign)));
            continue;
        }
        for device in &model.devices {
            let sign = stopped(cyclic, device, now).filter(|_| !device.al.is_asked_down());
            conditions.extend(sign.map(|sign| condition(model, cyclic, Some(device), &sign)));
        }
    }
}

/// A sign of life of a SubDevice that has stopped.
fn stopped(cyclic: &Cyclic, device: &Device, now: Instant) -> Option<LifeSign> {
    let mut inputs = device.fmmus.values().filter(|fmmu| fmmu.active && fmmu.reads);
    inputs.find_map(|fmmu| {
        let part = fmmu.overlap(cyclic.start, cyclic.len)?;
        cyclic.motion.stopped(part.datagram_offset, part.length, now)
    })
}

fn condition(
    model: &NetworkModel,
    cyclic: &Cyclic,
    device: Option<&Device>,
    sign: &LifeSign,
) -> Condition {
    let place = device.map_or(Place::Network { network: model.network }, |device| {
        Place::device(model.network, device.id)
    });
    let whose = device.map_or_else(
        || "whose they are was not seen".to_owned(),
        |device| format!("inputs of {}", model.label(device.id)),
    );
    let since = sign.last.at;
    let text = format!(
        "{}: {} bytes from byte {} on flipped one bit each, {} times in {} frames, and stand still since, for {} \
         frames; {whose}",
        cyclic.label(),
        sign.bytes,
        sign.offset,
        sign.flips,
        sign.frames,
        sign.still
    );
    let condition = Condition::new(&PAGE, place, FaultName::FirmwareFault, since)
        .confidence(0.6)
        .or(FaultName::ConfigMismatch, 0.1)
        .or(FaultName::SyncLost, 0.1)
        .confirmed(since)
        .shown_by(Evidence::frame(since, sign.last.frame.unwrap_or(0), text))
        .advise("Take no input of it for fresh.")
        .advise("Read DL status (0x0110) of it: bit 1 tells whether its processor is served.")
        .advise(
            "Power it off and on; note its firmware version and ask its maker, with a capture.",
        );
    match device {
        Some(device) => condition.about([Symptom::InputsStill(device.id)]),
        None => condition,
    }
}
