//! SubDevice plugged in the wrong way round within a closed ring (C304).
//!
//! A controller processes what comes in at its port A. In a closed ring all do so with the frames of card A,
//! and those of card B come round untouched. One whose IN and OUT are exchanged, and what hangs on it beside
//! the ring, is processed by the frames of card B instead: a broadcast read is answered in both copies,
//! though no link is open. Where the copy of card B alone is answered, by all, everybody is entered from the
//! other side: the cables of the two cards are exchanged.

use linesman_config::fault::FaultName;
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::register::table;
use linesman_proto::topology::Tree;

use super::wiring::PLUGGED;
use super::{Rule, View};
use crate::finding::{Condition, Evidence, Place};
use crate::found_wiring::{ReversedInRing, displaced, exchanged_cards, planned_ring};
use crate::model::{NetworkModel, Seen};

/// The rule.
pub const RULE: Rule = Rule { pages: &[], judge };

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let model = view.model;
    let Some(tree) = planned_ring(model) else { return };
    if let Some(exchanged) = exchanged_cards(model, tree) {
        conditions.push(cards_exchanged(model, tree, exchanged));
    } else if let Some(reversed) = ReversedInRing::of(model) {
        conditions.push(condition(model, tree, &reversed));
    }
}

fn condition(model: &NetworkModel, tree: &Tree, reversed: &ReversedInRing) -> Condition {
    let split = reversed.split;
    let id = |node: usize| DeviceId(node as u32);
    let place = |node| Place::device(model.network, id(node));
    let cause_of = |node: usize| match tree.parent(node) {
        None => FaultName::MainDeviceWrongPort,
        Some(_) => FaultName::PortsSwapped,
    };
    let label = model.label(id(reversed.node));
    let (one, other) = split.value;
    let text = format!(
        "the ring is closed, and both copies of a broadcast were processed, by {one} and by {other} \
         SubDevices: frames of card A do not come in at port A of {label}"
    );
    let sure = 0.9 / (1 + reversed.others.len()) as f64;
    let shown = Evidence::register(id(reversed.node), table::AL_STATUS.address, &split, text);
    let mut condition =
        Condition::new(&PLUGGED, place(reversed.node), cause_of(reversed.node), split.at)
            .confidence(sure)
            .shown_by(shown);
    if reversed.others.is_empty() {
        condition = condition.confirmed(split.at);
    }
    for other in &reversed.others {
        condition = condition.or_at(cause_of(*other), place(*other), sure);
    }
    // Positions mean others than planned, so whatever is said of single ones follows from this.
    let follows = displaced(model.devices.iter().map(|device| device.id));
    condition
        .explaining(follows)
        .advise(format!("Exchange the cables at the IN and OUT ports of {label}."))
        .advise("In a ring frames of card A come in at IN (port A) of each SubDevice.")
}

fn cards_exchanged(model: &NetworkModel, tree: &Tree, seen: Seen<Path>) -> Condition {
    let first =
        tree.ring_nodes().first().map_or(DeviceId::default(), |node| DeviceId(*node as u32));
    let label = model.label(first);
    let text = format!(
        "the ring is closed, and all {} SubDevices process what card B sends, none what card A sends: \
         frames of card B come in at port A of {label}",
        tree.len()
    );
    let shown = Evidence::register(first, table::AL_STATUS.address, &seen, text);
    let place = Place::device(model.network, first);
    Condition::new(&PLUGGED, place, FaultName::MainDeviceWrongPort, seen.at)
        .confidence(0.9)
        .or(FaultName::PortsSwapped, 0.05)
        .shown_by(shown)
        .confirmed(seen.at)
        .advise("Exchange the cables of the two cards of the MainDevice.")
        .advise(format!("Card A belongs at the IN port (port A) of {label}."))
}
