//! Controllers of a closed ring that card B reaches and card A does not: one of them is plugged in the wrong
//! way round.

use linesman_config::identity::mismatch;
use linesman_proto::address::Path;
use linesman_proto::topology::Tree;

use crate::model::{Device, NetworkModel, Seen};

/// A controller that is plugged in the wrong way round within a closed ring.
pub(crate) struct ReversedInRing {
    /// The node in the planned tree.
    pub(crate) node: usize,
    /// Others whose answers would be as many.
    pub(crate) others: Vec<usize>,
    /// The broadcast that shows it: how many have processed either of its copies.
    pub(crate) split: Seen<(u16, u16)>,
}

impl ReversedInRing {
    /// The one that both copies of a broadcast show, if they do.
    pub(crate) fn of(model: &NetworkModel) -> Option<Self> {
        let tree = planned_ring(model)?;
        find(model, tree, split(model, tree)?)
    }
}

/// The planned ring; `None` where none is planned.
pub(crate) fn planned_ring(model: &NetworkModel) -> Option<&Tree> {
    model.tree.as_ref().filter(|tree| model.tree_is_planned && tree.closes_at().is_some())
}

/// Working counters of both copies of a broadcast, if both were processed although the ring is closed.
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
/// went round, too: the cables of the two cards are exchanged.
pub(crate) fn exchanged_cards(model: &NetworkModel, tree: &Tree) -> Option<Seen<Path>> {
    let is_whole = usize::from(model.traffic.broadcasts.most()) == tree.len();
    model.traffic.broadcasts.processed_alone().filter(|seen| seen.value == Path::B && is_whole)
}

/// True if the ring is open somewhere: both its ends have a link less than planned. Whose answers are taken
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

/// True if a planned one does not answer to its address.
const fn is_silent(device: &Device) -> bool {
    device.answered.is_none() || device.silent.is_some()
}

/// A controller of the ring, with all that hangs on it beside the ring.
fn block(tree: &Tree, ring: &[usize], at: usize) -> Vec<usize> {
    let further = ring.get(at + 1).map_or(&[][..], |next| tree.subtree(*next));
    tree.subtree(ring[at]).iter().copied().filter(|node| !further.contains(node)).collect()
}

/// Split whose share of the line is as large as that of one copy. Of several it is the one by which identities fit:
/// those of card B have the last addresses. Then the one of which most do not answer to their address.
fn find(model: &NetworkModel, tree: &Tree, split: Seen<(u16, u16)>) -> Option<ReversedInRing> {
    let ring = tree.ring_nodes();
    let is_as_large = |at: &usize| {
        let len = block(tree, &ring, *at).len();
        len == usize::from(split.value.0) || len == usize::from(split.value.1)
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
    Some(ReversedInRing { node: ring[fitting[0]], others, split })
}

/// True if the SubDevice that answers to the address of `found` cannot be the one planned as `planned`.
fn is_another(model: &NetworkModel, planned: usize, found: usize) -> bool {
    let planned = model.devices.get(planned).and_then(|device| device.planned);
    let found = model.devices.get(found).and_then(|device| device.identity.identity());
    let pair = planned.and_then(|planned| Some((planned.identity?, planned.rule))).zip(found);
    pair.is_some_and(|((planned, rule), found)| mismatch(&planned, &found, rule).is_some())
}
