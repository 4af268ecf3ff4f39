//! # Two SubDevices answer to one station address
//!
//! A request to one station address is answered twice.
//!
//! **How it is found.** One controller adds 1 to the working counter of a read or a write to its station
//! address (0x0010), 3 to one that does both. More means that two have answered; or a SubDevice that is
//! asked by its position says that it has the address of another one. The SubDevice that does not answer to
//! its own address any more meanwhile is the one that has taken the other's.
//!
//! **What it means.** Somebody has given a SubDevice an address that is taken: another tool on the line, a
//! MainDevice that has addressed only a part of it, or two SubDevices that both kept the address of a former
//! place. What is written reaches both; what is read is both mixed, so nothing read there counts. Process
//! data are addressed logically and go on.
//!
//! **What to do.** End the other tool, and scan the line anew: that gives each SubDevice an address of its
//! own.

use std::collections::BTreeSet;

use linesman_config::fault::{Class, FaultName};
use linesman_proto::register::table;
use linesman_proto::time::Span;

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};
use crate::model::{Device, NetworkModel, Seen, SharedAddress, SharedBy};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "C332",
    name: "address-shared",
    severity: Severity::Error,
    class: Class::Configuration,
    source: include_str!("shared_address.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

/// SubDevices are asked in turn: the one that has lost its own address is missed so much earlier or later.
const AROUND: Span = Span::ms(500);
/// What did not come again for this long is over.
const QUIET: Span = Span::s(1);

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    for device in &view.model.devices {
        let shared = device.shared_address;
        conditions.extend(shared.map(|shared| condition(view.model, device, &shared)));
    }
}

fn condition(model: &NetworkModel, owner: &Device, shared: &SharedAddress) -> Condition {
    let other = match shared.first.value {
        SharedBy::Reading(id) => model.device(id),
        SharedBy::WorkingCounter(_) => astray(model, owner, shared),
    };
    let place = Place::device(model.network, other.unwrap_or(owner).id);
    let label = model.label(owner.id);
    let text = match shared.first.value {
        SharedBy::WorkingCounter(wkc) => format!(
            "working counter {wkc} where {label} alone answers to {}: another one answers, too",
            shared.station
        ),
        SharedBy::Reading(id) => format!(
            "{}, asked by its position, has station address {}: that of {label}",
            model.label(id),
            shared.station
        ),
    };
    let address = table::STATION_ADDRESS.address;
    let seen = Seen::new((), shared.first.at, shared.first.frame);
    let mut condition = Condition::new(&PAGE, place, FaultName::DuplicateAddress, shared.first.at)
        .confidence(0.9)
        .confirmed(shared.first.at)
        .shown_by(Evidence::register(owner.id, address, &seen, text))
        .explaining(follows(model, owner, other))
        .advise(
            "Look for another tool or MainDevice that gives addresses on this line, and end it.",
        )
        .advise("Scan the line anew: each SubDevice then gets an address of its own.");
    if other.is_some() {
        let place = Place::device(model.network, owner.id);
        condition = condition.or_at(FaultName::DuplicateAddress, place, 0.05);
    }
    if shared.last + QUIET < model.now {
        condition = condition.ended(shared.last);
    }
    condition
}

/// The only SubDevice that does not answer to its own address meanwhile.
fn astray<'a>(
    model: &'a NetworkModel,
    owner: &Device,
    shared: &SharedAddress,
) -> Option<&'a Device> {
    let (from, to) = (shared.first.at.before(AROUND), shared.last + AROUND);
    let mut silent = model.devices.iter().filter(|device| {
        device.id != owner.id
            && device.absences.iter().any(|absence| {
                absence.since.at <= to && absence.ended.is_none_or(|ended| ended >= from)
            })
    });
    silent.next().filter(|_| silent.next().is_none())
}

/// Both are asked in vain, and both get what is meant for one; where one is the reference clock, all that
/// follow it get a mixed time.
fn follows(model: &NetworkModel, owner: &Device, other: Option<&Device>) -> BTreeSet<Symptom> {
    let both = || [Some(owner), other].into_iter().flatten();
    let is_clock =
        both().any(|device| model.references.iter().any(|reference| reference.device == device.id));
    let concerned = model.devices.iter().filter(|device| {
        is_clock && device.sync_on.is_some_and(|on| on.value)
            || both().any(|one| one.id == device.id)
    });
    let symptoms = concerned.flat_map(|device| {
        let id = device.id;
        [Symptom::Silent(id), Symptom::StateLost(id), Symptom::WorkingCounter(id)]
    });
    symptoms.collect()
}
