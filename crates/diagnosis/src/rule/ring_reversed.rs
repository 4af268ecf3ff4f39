//! SubDevice plugged in the wrong way round within a closed ring (C304).
//!
//! A controller processes what comes in at its port A. In a closed ring all do so with the frames of card A,
//! and those of card B come round untouched. One whose IN and OUT are exchanged, and what hangs on it beside
//! the ring, is processed by the frames of card B instead: a broadcast read is answered in both copies,
//! though no link is open. Where the copy of card B alone is answered, by all, everybody is entered from the
//! other side: the cables of the two cards are exchanged.

use linesman_config::fault::FaultName;
use linesman_config::identity::mismatch;
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::register::table;
use linesman_proto::topology::Tree;

use super::wiring::{PLUGGED, displaced};
use super::{Rule, View};
use crate::finding::{Condition, Evidence, Place};
use crate::model::{Device, NetworkModel, Seen};

/// The rule.
pub const RULE: Rule = Rule { pages: &[], judge };

/// Who is reversed, and how sure.
struct Reversed {
    node: usize,
    /// Others whose answers would be as many.
    others: Vec<usize>,
}

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let model = view.model;
    let Some(tree) = ring(model) else { return };
    if let Some(exchanged) = exchanged(model, tree) {
        conditions.push(cards_exchanged(model, tree, exchanged));
    } else if let Some(split) = split(model, tree)
        && let Some(reversed) = find(model, tree, split.value)
    {
        conditions.push(condition(model, tree, &reversed, split));
    }
}

/// Whether somebody is plugged in the wrong way round, so that positions mean others than planned.
pub(super) fn judges(model: &NetworkModel) -> bool {
    let split = ring(model).and_then(|tree| Some((tree, split(model, tree)?)));
    split.is_some_and(|(tree, split)| find(model, tree, split.value).is_some())
}

/// The planned ring.
fn ring(model: &NetworkModel) -> Option<&Tree> {
    model.tree.as_ref().filter(|tree| model.tree_is_planned && tree.closes_at().is_some())
}

/// How many have processed either copy of a broadcast, if both were processed although the ring is closed.
fn split(model: &NetworkModel, tree: &Tree) -> Option<Seen<(u16, u16)>> {
    // Not one that fewer, or more, have answered to since.
    let changed = model.traffic.broadcasts.now().map(|now| now.at);
    let split = model.traffic.broadcasts.split().filter(|split| changed <= Some(split.at))?;
    let (one, other) = split.value;
    let is_whole = usize::from(one) + usize::from(other) == tree.len();
    // Nobody is turned round while a line runs.
    (is_whole && !model.traffic.broadcasts.was_processed_by_one() && !is_open(model, tree))
        .then_some(split)
}

/// The broadcast of which all have processed the copy of card B, and nobody that of card A, though that one
/// went round, too.
fn exchanged(model: &NetworkModel, tree: &Tree) -> Option<Seen<Path>> {
    let is_whole = usize::from(model.traffic.broadcasts.most()) == tree.len();
    model.traffic.broadcasts.processed_alone().filter(|seen| seen.value == Path::B && is_whole)
}

/// Whether the ring is open somewhere: both its ends have a link less than planned. Whose answers are taken
/// for whose is not certain here, so it is counted how many there are with so many links.
fn is_open(model: &NetworkModel, tree: &Tree) -> bool {
    let mut planned: Vec<usize> =
        (0..tree.len()).map(|node| tree.open_ports(node).count()).collect();
    let shown = model.devices.iter().filter(|device| !is_silent(device));
    let mut shown = shown.filter_map(|device| Some(device.dl.first?.value.active_ports().count()));
    !shown.all(|count| {
        let at = planned.iter().position(|known| *known == count);
        at.map(|at| planned.swap_remove(at)).is_some()
    })
}

/// Whether a planned one does not answer to its address.
const fn is_silent(device: &Device) -> bool {
    device.answered.is_none() || device.silent.is_some()
}

/// A controller of the ring, with all that hangs on it beside the ring.
fn block(tree: &Tree, ring: &[usize], at: usize) -> Vec<usize> {
    let further = ring.get(at + 1).map_or(&[][..], |next| tree.subtree(*next));
    tree.subtree(ring[at]).iter().copied().filter(|node| !further.contains(node)).collect()
}

/// Whose share of the line is as large as that of one copy. Of several it is the one by which identities fit:
/// those of card B have the last addresses. Then the one of which most do not answer to their address.
fn find(model: &NetworkModel, tree: &Tree, split: (u16, u16)) -> Option<Reversed> {
    let ring = tree.ring_nodes();
    let is_as_large = |at: &usize| {
        let len = block(tree, &ring, *at).len();
        len == usize::from(split.0) || len == usize::from(split.1)
    };
    let mut fitting: Vec<usize> = (0..ring.len()).filter(is_as_large).collect();
    let misfits = |at: &usize| {
        let block = block(tree, &ring, *at);
        let (behind, before): (Vec<usize>, Vec<usize>) =
            tree.order().iter().partition(|node| block.contains(node));
        let pairs = before.iter().chain(&behind).zip(tree.order());
        pairs.filter(|(planned, found)| is_another(model, **planned, **found)).count()
    };
    let unanswered = |at: &usize| {
        let block = block(tree, &ring, *at);
        let device = |node: &usize| model.devices.get(*node);
        block.iter().filter_map(device).filter(|device| is_silent(device)).count()
    };
    let rank = |at: &usize| (misfits(at), std::cmp::Reverse(unanswered(at)));
    fitting.sort_by_key(rank);
    let best = rank(fitting.first()?);
    let is_equal = |at: &&usize| rank(at) == best;
    let others = fitting.iter().skip(1).filter(is_equal).map(|at| ring[*at]).collect();
    Some(Reversed { node: ring[fitting[0]], others })
}

/// Whether who answers to the address of `found` cannot be the one planned as `planned`.
fn is_another(model: &NetworkModel, planned: usize, found: usize) -> bool {
    let planned = model.devices.get(planned).and_then(|device| device.planned);
    let found = model.devices.get(found).and_then(|device| device.identity.identity());
    let pair = planned.and_then(|planned| Some((planned.identity?, planned.rule))).zip(found);
    pair.is_some_and(|((planned, rule), found)| mismatch(&planned, &found, rule).is_some())
}

fn condition(
    model: &NetworkModel,
    tree: &Tree,
    reversed: &Reversed,
    split: Seen<(u16, u16)>,
) -> Condition {
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
