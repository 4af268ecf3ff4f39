//! # Other devices than planned, as another tool reports them
//!
//! An online list says of SubDevices that they are not the planned ones (VPRS: vendor, product code,
//! revision or serial number differ), and not what they are instead.
//!
//! **How it is found.** An observation file gives the words of such a list. The first SubDevice with that word,
//! in the order in which frames are processed, is where the line begins to be another one: all behind it
//! are compared with the wrong plan, position by position. A port elsewhere that should have a link and has
//! none (LNK_MIS), and SubDevices at the end of the list that do not answer (NO_COMM), belong to it: the
//! cable of that port may be the one that is plugged in at the first wrong place.
//!
//! **What it means.** `C306`: a SubDevice is missing, or cables are plugged in the wrong order (S0 L1590,
//! L1623). It is one cable or one device, not all that are listed.
//!
//! **What to do.** Compare the cables at the named ports with the drawing. `linesman scan --against` reads what the
//! SubDevices are, and says which cable it is.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::address::DeviceId;
use linesman_proto::port::Port;
use linesman_proto::register::table;
use linesman_proto::topology::End;

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, LinkDirection, Place, Severity, Symptom};
use crate::locate::LinkLosses;
use crate::model::{Device, NetworkModel};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "C306",
    name: "devices-reported-wrong",
    severity: Severity::Error,
    class: Class::Configuration,
    source: include_str!("reported_wrong.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let model = view.model;
    let Some(tree) = model.tree.as_ref() else { return };
    let device = |node: &usize| model.device(DeviceId(*node as u32));
    let is_wrong = |device: &&Device| device.reported_wrong.is_some();
    let wrong: Vec<&Device> = tree.order().iter().filter_map(device).filter(is_wrong).collect();
    let Some((first, seen)) = wrong.first().and_then(|one| Some((*one, one.reported_wrong?)))
    else {
        return;
    };
    let node = first.id.index();
    let empty: Vec<(DeviceId, Port)> = LinkLosses::all(model)
        .iter()
        .filter(|drops| drops.is_down)
        .filter_map(|drops| match tree.links().get(drops.link)?.upstream {
            End::Controller(node, port) => Some((DeviceId(node as u32), port)),
            End::MainDevice(_) => None,
        })
        .collect();
    let silent: Vec<DeviceId> =
        model.devices.iter().filter(|one| one.silent.is_some()).map(|one| one.id).collect();
    let place = match tree.link_above(node).and_then(|link| tree.links().get(link)) {
        Some(link) => {
            let named = link.map(|node| DeviceId(node as u32));
            Place::link(model.network, named, Some(LinkDirection::Both))
        }
        None => Place::device(model.network, first.id),
    };
    let mut condition = Condition::new(&PAGE, place, cause(&empty, &silent, &wrong), seen.at)
        .confidence(0.5)
        .or(FaultName::PortsSwapped, 0.2)
        .or(FaultName::DevicesSwapped, 0.15)
        .confirmed(seen.at)
        .shown_by(Evidence::register(
            first.id,
            table::SII_DATA.address,
            &seen,
            format!(
                "{} is not the planned one, nor are {} others behind it",
                model.label(first.id),
                wrong.len() - 1
            ),
        ));
    for (id, port) in &empty {
        let label = model.label(*id);
        let text = format!("port {port} of {label} has no link, and one belongs there");
        condition = condition
            .shown_by(Evidence::register(*id, table::DL_STATUS.address, &seen, text).port(*port))
            .advise(format!(
                "Is the cable that belongs into port {port} of {label} plugged in at {place}?"
            ));
    }
    condition = condition
        .advise(format!("Look whether {} is the device at {place}.", model.label(first.id)))
        .advise(
            "Run `linesman scan WHERE --against PROJECT.toml`: it says which cable or device it is.",
        );
    conditions.push(condition.explaining(explained(model, &wrong, &silent, &empty)));
}

/// One wrong device is a wrong device; more are moved by one that is missing, or by a cable.
fn cause(empty: &[(DeviceId, Port)], silent: &[DeviceId], wrong: &[&Device]) -> FaultName {
    if wrong.len() == 1 && empty.is_empty() && silent.is_empty() {
        FaultName::DeviceWrong
    } else {
        FaultName::DeviceMissing
    }
}

fn explained(
    model: &NetworkModel,
    wrong: &[&Device],
    silent: &[DeviceId],
    empty: &[(DeviceId, Port)],
) -> Vec<Symptom> {
    let mut list: Vec<Symptom> = Vec::new();
    for (id, port) in empty {
        list.push(Symptom::LinkDown(*id, *port));
        if let Some(End::Controller(far, entry)) = model.opposite(*id, *port) {
            list.push(Symptom::LinkDown(far, entry));
        }
    }
    for id in silent {
        list.extend([Symptom::Silent(*id), Symptom::WorkingCounter(*id)]);
    }
    for device in wrong {
        list.extend([Symptom::StateLost(device.id), Symptom::WorkingCounter(device.id)]);
    }
    list
}
