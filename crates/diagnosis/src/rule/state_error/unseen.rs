//! Errors that stood before anybody listened and that come of process data which stayed away: why, nobody has seen.

use linesman_config::fault::FaultName;
use linesman_proto::state::status_code::Class;
use linesman_proto::time::Instant;

use super::{AL_STATUS_CODE, NAMED, SYNC, WATCHDOG, over};
use crate::finding::{Condition, Evidence, Place, Symptom};
use crate::model::{AlError, Device, NetworkModel};
use crate::rule::View;

/// The errors that stood so, with whom they belong to; none where such errors come while it is listened, which may be
/// explained by what is heard.
pub(super) fn errors(model: &NetworkModel) -> Vec<(&Device, &AlError)> {
    let comes_of_absence = |error: &&AlError| {
        // Without its code an error may be of any kind.
        error.code.is_some_and(|code| {
            error.may_be_watchdog() || code.value.explain().class == Class::Timing
        })
    };
    let is_running = |at: Instant| model.cyclic.iter().any(|cyclic| cyclic.wkc.first().at < at);
    let is_unseen = |error: &AlError| error.was_left_over() && is_running(error.status.at);
    let mut unseen = Vec::new();
    for device in &model.devices {
        for error in device.al.errors.iter().filter(comes_of_absence) {
            if !is_unseen(error) {
                return Vec::new();
            }
            unseen.push((device, error));
        }
    }
    unseen
}

/// Adds the causes that keep process data away for longer than a watchdog holds.
fn outage(condition: Condition) -> Condition {
    condition
        .or(FaultName::LinkOpen, 0.2)
        .or(FaultName::LinkFlapping, 0.1)
        .or(FaultName::DeviceOff, 0.1)
        .or(FaultName::SupplyOff, 0.05)
        .or(FaultName::BrownOut, 0.05)
        .or_at(FaultName::HostJitter, Place::Host, 0.05)
}

/// Adds the causes that cost SubDevices their step: a few frames that are late or lost are enough.
fn missed_frames(condition: Condition) -> Condition {
    condition
        .or(FaultName::LinkOpen, 0.15)
        .or_at(FaultName::LateFrames, Place::Host, 0.1)
        .or_at(FaultName::HostDrops, Place::Host, 0.07)
        .or(FaultName::CableDegraded, 0.07)
        .or(FaultName::LinkFlapping, 0.07)
        .or_at(FaultName::HostJitter, Place::Host, 0.05)
        .or(FaultName::DeviceOff, 0.05)
        .or(FaultName::EmcNoise, 0.03)
        .or(FaultName::TransmitterDamaged, 0.02)
        .or(FaultName::ReceiverDamaged, 0.02)
        .or(FaultName::DeviceInternal, 0.02)
        .or(FaultName::SupplyOff, 0.02)
        .or(FaultName::BrownOut, 0.02)
}

/// The finding: that it happened, to whom, and what it may have been.
pub(super) fn condition(view: &View<'_>, unseen: &[(&Device, &AlError)]) -> Option<Condition> {
    let model = view.model;
    let since = unseen.iter().map(|(_, error)| error.status.at).min()?;
    let ids = || unseen.iter().map(|(device, _)| device.id);
    let expired = unseen.iter().any(|(_, error)| error.may_be_watchdog());
    let (page, first) = match expired {
        true => (&WATCHDOG, FaultName::WatchdogStarved),
        false => (&SYNC, FaultName::SyncLost),
    };
    let names: Vec<String> = ids().take(NAMED).map(|id| model.label(id)).collect();
    let more = match unseen.len().saturating_sub(NAMED) {
        0 => String::new(),
        more => format!(" and {more} others"),
    };
    let what = if expired {
        "outputs had not come for longer than a watchdog holds"
    } else {
        "process data had not come in step"
    };
    let text = format!(
        "{}{more} stood with an error when first read: {what}; what kept them away was before the first frame that \
         was seen, or not seen in the frames",
        names.join(", ")
    );
    let place = Place::Network { network: model.network };
    let condition = Condition::new(page, place, first, since).confidence(0.3);
    let mut condition = if expired { outage(condition) } else { missed_frames(condition) }
        .confirmed(since)
        .about(ids().map(Symptom::StateLost))
        .explaining(ids().flat_map(|id| {
            [
                Symptom::StateLost(id),
                Symptom::WorkingCounter(id),
                Symptom::Emergency(id),
                Symptom::InputsStill(id),
            ]
        }))
        .shown_by(Evidence::host(Some(since), text))
        .advise("Look whether the MainDevice, or its cyclic task, stopped or paused.")
        .advise(
            "Look at the way to the first of them: cables and plugs, and the supply of whoever is before it.",
        )
        .advise("Listen from before it happens again: then the frames tell where.");
    if let [(device, _)] = unseen {
        let place = Place::device(model.network, device.id);
        condition = condition.or_at(FaultName::SyncLost, place, 0.05);
    }
    condition.evidence.extend(unseen.iter().take(NAMED).filter_map(|(device, error)| {
        let code = error.code?;
        let text = format!("AL status code {}", code.value);
        let value = Some(u64::from(code.value.0));
        Some(Evidence::register(device.id, AL_STATUS_CODE, &code, text).values(None, value))
    }));
    let ended: Option<Vec<Instant>> =
        unseen.iter().map(|(device, error)| over(view, device, error)).collect();
    if let Some(ended) = ended.and_then(|all| all.into_iter().max()) {
        condition = condition.ended(ended);
    }
    Some(condition)
}
