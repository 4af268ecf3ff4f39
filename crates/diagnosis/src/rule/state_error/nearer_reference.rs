//! Proposal of another reference clock where several SubDevices lose synchronisation (DC-06).
//!
//! Each SubDevice on the way from the MainDevice to the reference clock adds its share to what the time is off that is
//! handed round, and whoever is before it never gets that time. So the nearest SubDevice that has a clock is the better
//! choice (S0 L739-741).

use linesman_config::plan::reference;

use super::{SEVERAL, SYNC, page_of};
use crate::model::{Device, NetworkModel};

/// The proposal, with its place; `None` where fewer than two SubDevices lost synchronisation, or none that could be the
/// reference clock is nearer to the MainDevice.
pub(super) fn advice(model: &NetworkModel) -> Option<String> {
    let [led_by] = model.references.as_slice() else { return None };
    let far = model.device(led_by.device)?;
    let has_lost_step = |device: &&Device| {
        device.al.errors.iter().any(|error| page_of(model, error).code == SYNC.code)
    };
    let lost = model.devices.iter().filter(has_lost_step).count();
    if lost < SEVERAL {
        return None;
    }
    let at = far.position?;
    let nearer = model.devices.iter().filter(|device| device.position < Some(at));
    let able = nearer.filter(|device| device.position.is_some() && may_lead(device));
    let near = able.min_by_key(|device| device.position)?;
    Some(format!(
        "{lost} SubDevices lost synchronisation, and the reference clock, {}, is behind {} of them on the way: let {} be \
         it, the nearest to the MainDevice that has a clock (`clock = {{ reference = true }}` in the project).",
        model.label(far.id),
        at.0,
        model.label(near.id),
    ))
}

/// True if it has a clock, as far as was seen, and is not known to be too old to lead with it.
fn may_lead(device: &Device) -> bool {
    let type_name = device.type_name.as_deref().unwrap_or_default();
    let revision = device.identity.revision.map_or(0, |seen| seen.value);
    let is_listed = revision != 0 && reference::since(type_name).is_some();
    let has_clock = is_listed || !device.set_up.clock.is_unknown() || device.received.is_some();
    has_clock && reference::is_possible(type_name, revision)
}
