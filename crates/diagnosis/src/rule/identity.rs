//! # Another device than planned
//!
//! What a SubDevice says of itself is not what the project wants at its place.
//!
//! **How it is found.** Vendor, product code, revision and, where the project gives one, serial number
//! are read from the SII (words 0x08 to 0x0F) or from object 0x1018, and held against the project in the
//! order in which frames are processed. A SubDevice too few or too many moves all behind it; when the
//! rest fits again after such a step, the step is the finding, and not all the SubDevices behind it.
//!
//! **What it means.**
//!
//! * `C301` another type or revision sits at this place, or two of them sit in each other's place, or
//!   cables are plugged in another order than planned.
//! * `C302` a planned SubDevice is not in the line; its neighbours are wired to each other.
//! * `C303` a SubDevice is in the line that was not planned.
//!
//! **What to do.** Compare the label of the device with the project; change the device, the cabling or
//! the project. A newer revision mostly does what the older one did: then the project may accept it.

use linesman_config::fault::{Class, FaultName};
use linesman_config::identity::{self, Mismatch, mismatch};
use linesman_proto::address::DeviceId;
use linesman_proto::register::table;
use linesman_proto::sii::Identity;
use linesman_proto::time::Instant;

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};
use crate::found_wiring::{self, displaced};
use crate::model::{Device, NetworkModel, Planned, Seen};

/// Another device.
pub const WRONG: RulePage = RulePage {
    code: "C301",
    name: "device-wrong",
    severity: Severity::Error,
    class: Class::Configuration,
    source: include_str!("identity.rs"),
};

/// A device too few.
pub const MISSING: RulePage = RulePage {
    code: "C302",
    name: "device-missing",
    severity: Severity::Error,
    class: Class::Configuration,
    source: include_str!("identity.rs"),
};

/// A device too many.
pub const EXTRA: RulePage = RulePage {
    code: "C303",
    name: "device-extra",
    severity: Severity::Error,
    class: Class::Configuration,
    source: include_str!("identity.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[WRONG, MISSING, EXTRA], judge };

/// A place in the order of processing: who is planned there, and who was found there.
struct PlaceInOrder {
    id: DeviceId,
    planned: Option<(Identity, Planned)>,
    found: Option<Seen<Identity>>,
}

impl PlaceInOrder {
    fn mismatch(&self) -> Option<Mismatch> {
        Self::between(self, self)
    }

    /// Whether what was found at `found` differs from what is planned at `planned`. What is not known
    /// fits everything.
    fn between(planned: &Self, found: &Self) -> Option<Mismatch> {
        let (identity, plan) = planned.planned.as_ref()?;
        mismatch(identity, &found.found?.value, plan.rule)
    }
}

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let model = view.model;
    if !model
        .devices
        .iter()
        .any(|device| device.planned.is_some_and(|plan| plan.identity.is_some()))
    {
        return;
    }
    if found_wiring::is_wired_otherwise(model) || found_wiring::is_reversed_in_ring(model) {
        return;
    }
    let slots = slots(model);
    if slots.iter().all(|slot| slot.mismatch().is_none()) {
        return;
    }
    if let Some(condition) = moved(model, &slots) {
        conditions.push(condition);
        return;
    }
    for (index, slot) in slots.iter().enumerate() {
        if let Some(what) = slot.mismatch() {
            let other = slots.iter().enumerate().find(|(other, there)| {
                *other != index
                    && there.mismatch().is_some()
                    && PlaceInOrder::between(slot, there).is_none()
                    && PlaceInOrder::between(there, slot).is_none()
            });
            conditions.extend(wrong(model, slot, what, other.map(|(_, there)| there.id)));
        }
    }
}

/// All places in the order of processing, those beyond the plan last.
fn slots(model: &NetworkModel) -> Vec<PlaceInOrder> {
    let planned =
        model.tree.iter().flat_map(|tree| tree.order()).map(|node| DeviceId(*node as u32));
    let mut order: Vec<DeviceId> = planned.collect();
    let rest = model.devices.iter().map(|device| device.id);
    let rest: Vec<DeviceId> = rest.filter(|id| !order.contains(id)).collect();
    order.extend(rest);
    order.into_iter().filter_map(|id| model.device(id)).map(slot).collect()
}

fn slot(device: &Device) -> PlaceInOrder {
    let planned = device.planned.and_then(|plan| Some((plan.identity?, plan)));
    let found = device.identity.identity().map(|identity| {
        let read = device.identity.product_code;
        Seen::new(
            identity,
            read.map_or(Instant::ZERO, |read| read.at),
            read.and_then(|read| read.frame),
        )
    });
    PlaceInOrder { id: device.id, planned, found }
}

/// One stretch too few or too many that explains all differences.
fn moved(model: &NetworkModel, slots: &[PlaceInOrder]) -> Option<Condition> {
    let planned = slots.iter().filter(|slot| slot.planned.is_some()).count();
    let found = slots.iter().rposition(|slot| slot.found.is_some())? + 1;
    let first = slots.iter().position(|slot| slot.mismatch().is_some())?;
    let by = planned.abs_diff(found);
    let is_missing = found < planned;
    if by == 0 || slots[..planned].iter().any(|slot| slot.planned.is_none()) {
        return None;
    }
    let behind = first..found.min(planned.saturating_sub(if is_missing { by } else { 0 }));
    let fits = |index: usize| {
        let (plan, there) = if is_missing {
            (slots.get(index + by), slots.get(index))
        } else {
            (slots.get(index), slots.get(index + by))
        };
        plan.zip(there).is_some_and(|(plan, there)| PlaceInOrder::between(plan, there).is_none())
    };
    if !behind.clone().all(fits) {
        return None;
    }
    let slot = &slots[first];
    let seen = slot.found?;
    let place = Place::device(model.network, slot.id);
    let label = model.label(slot.id);
    let how_many = if by == 1 { "one SubDevice".to_owned() } else { format!("{by} SubDevices") };
    let (page, cause, text) = if is_missing {
        let is = if by == 1 { "is" } else { "are" };
        let text = format!(
            "{how_many} {is} missing from {label} on: the one found there is planned {by} further on"
        );
        (&MISSING, FaultName::DeviceMissing, text)
    } else {
        let text = format!(
            "{how_many} too many before {label}: from here on all are {by} further on than planned"
        );
        (&EXTRA, FaultName::DeviceExtra, text)
    };
    let condition = Condition::new(page, place, cause, seen.at)
        .confidence(0.85)
        .or(FaultName::DeviceWrong, 0.1)
        .confirmed(seen.at)
        .shown_by(evidence(slot.id, &seen, text))
        .explaining(shifted(slots, first))
        .advise(format!("Compare the line around {label} with the project, label by label."));
    Some(condition)
}

/// All behind answer from another place than planned: ports that should lead on end the line, and the
/// last planned ones never answer.
fn shifted(slots: &[PlaceInOrder], first: usize) -> Vec<Symptom> {
    let first = first.saturating_sub(1);
    displaced(slots[first..].iter().map(|slot| slot.id)).collect()
}

fn wrong(
    model: &NetworkModel,
    slot: &PlaceInOrder,
    what: Mismatch,
    swapped_with: Option<DeviceId>,
) -> Option<Condition> {
    let (planned, seen) = (slot.planned.as_ref()?.0, slot.found?);
    let label = model.label(slot.id);
    let place = Place::device(model.network, slot.id);
    let text = format!(
        "{label} has another {what} than planned: found {}; planned {}",
        identity::text(&seen.value),
        identity::text(&planned)
    );
    let condition = match swapped_with {
        Some(other) => Condition::new(&WRONG, place, FaultName::DevicesSwapped, seen.at)
            .confidence(0.7)
            .or(FaultName::DeviceWrong, 0.2)
            .advise(format!(
                "Exchange it with {}: each sits in the other's place.",
                model.label(other)
            )),
        None => Condition::new(&WRONG, place, FaultName::DeviceWrong, seen.at)
            .confidence(0.85)
            .or(FaultName::DevicesSwapped, 0.05),
    };
    Some(
        condition
            .confirmed(seen.at)
            .shown_by(evidence(slot.id, &seen, text))
            .advise("Compare the device's label with the project, and change one of them.")
            .advise("Check whether cables are plugged in the planned order."),
    )
}

fn evidence(id: DeviceId, seen: &Seen<Identity>, text: String) -> Evidence {
    Evidence::register(id, table::SII_DATA.address, seen, text)
}
