//! # More current than the E-bus is fed
//!
//! The terminals behind a coupler or a power feed take more current from the E-bus than it supplies.
//!
//! **How it is found.** Each SubDevice says in its SII (category General) what it takes from the E-bus
//! or feeds into it, and which of its ports are contacts of the E-bus. In the order of processing the
//! currents are added up from feed to feed. SubDevices of equal identity take the same.
//!
//! **What it means.** On paper the supply is too weak from the named terminal on. Such a line may come up
//! to OP all the same, and lose its last terminals when outputs switch, in summer, or after the next
//! terminal was added.
//!
//! **What to do.** Insert a power feed terminal before the named terminal, or spread the terminals over
//! two couplers.

use std::collections::BTreeMap;

use linesman_config::ebus::{self, Draw, EbusGroup};
use linesman_config::fault::{Class, FaultName};
use linesman_config::identity::mismatch;
use linesman_proto::register::table;

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity};
use crate::found_wiring;
use crate::model::{Device, NetworkModel, Power, Seen};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "C307",
    name: "ebus-budget",
    severity: Severity::Warning,
    class: Class::Configuration,
    source: include_str!("ebus_budget.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

/// Vendor, product and revision: what a description is of.
type DescriptionKey = (u32, u32, u32);

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let model = view.model;
    let Some(tree) = &model.tree else { return };
    let feeds = |device: &Device| device.power.is_some_and(|seen| seen.value.ebus_current_ma < 0);
    if !model.devices.iter().any(feeds) {
        return;
    }
    let is_whole = usize::from(model.traffic.broadcasts.positions()) >= tree.len();
    if !is_whole
        || !model.devices.iter().all(is_as_planned)
        || found_wiring::is_wired_otherwise(model)
    {
        // Whoever is wired otherwise than planned is fed otherwise, too: first things first.
        return;
    }
    let known: BTreeMap<DescriptionKey, Seen<Power>> =
        model.devices.iter().filter_map(|device| Some((kind(device)?, device.power?))).collect();
    let power = |device: &Device| {
        device.power.or_else(|| known.get(&kind(device)?).copied()).map(|seen| seen.value)
    };
    let powers: Vec<Option<Power>> = model.devices.iter().map(power).collect();
    let draws = tree.order().iter().filter_map(|node| {
        let power = powers.get(*node)?.as_ref();
        Some(Draw {
            device: model.devices[*node].id,
            current_ma: power.map(|power| power.ebus_current_ma),
            ports: power.map(|power| &power.ports),
        })
    });
    for group in ebus::groups(tree, draws) {
        conditions.extend(overloaded(model, &group));
    }
}

/// Whether it is who it should be, as far as both are known.
fn is_as_planned(device: &Device) -> bool {
    let planned = device.planned.and_then(|planned| Some((planned.identity?, planned.rule)));
    match (planned, device.identity.identity()) {
        (Some((wanted, rule)), Some(there)) => mismatch(&wanted, &there, rule).is_none(),
        (None, _) | (_, None) => true,
    }
}

fn kind(device: &Device) -> Option<DescriptionKey> {
    let identity = &device.identity;
    let value = |seen: Option<Seen<u32>>| seen.map(|seen| seen.value);
    Some((value(identity.vendor_id)?, value(identity.product_code)?, value(identity.revision)?))
}

fn overloaded(model: &NetworkModel, group: &EbusGroup) -> Option<Condition> {
    let first = group.first_negative()?;
    let seen = model.device(group.feeder)?.power?;
    let (feeder, label) = (model.label(group.feeder), model.label(first));
    let behind = group.members.iter().find(|member| member.device == first)?;
    let condition = Condition::new(
        &PAGE,
        Place::device(model.network, first),
        FaultName::EbusOverload,
        seen.at,
    );
    let text = format!(
        "{feeder} supplies {} mA; up to and with {label} {} mA are taken from it, by all behind it {} mA",
        group.supply_ma,
        group.supply_ma - behind.remaining_ma,
        group.taken_ma()
    );
    Some(
        condition
            .confidence(0.9)
            .confirmed(seen.at)
            .shown_by(Evidence::register(group.feeder, table::SII_DATA.address, &seen, text))
            .advise(format!("Insert a power feed terminal before {label}."))
            .advise(format!(
                "Or move the terminals from {label} on behind a coupler of their own."
            )),
    )
}
