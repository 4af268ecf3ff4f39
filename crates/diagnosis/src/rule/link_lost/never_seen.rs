//! Planned links that were never up: what is planned behind may have no power, no cable, or be missing.

use linesman_config::fault::FaultName::{DeviceMissing, DeviceOff, LinkOpen, SupplyOff};
use linesman_proto::register::ErrorCounter;
use linesman_proto::topology::{End, Tree};

use super::super::wiring;
use super::Causes;
use crate::locate::LinkLosses;
use crate::model::NetworkModel;

/// The causes, of a link that nobody ever saw.
pub(super) fn causes(model: &NetworkModel, tree: &Tree, drops: &LinkLosses) -> Option<Causes> {
    let link = tree.links()[drops.link];
    let node = link.downstream.node()?;
    let device = Some(node);
    if matches!(link.upstream, End::MainDevice(_)) {
        // Nobody at all was ever seen.
        let others =
            vec![(DeviceOff, device, 0.3), (DeviceMissing, device, 0.15), (SupplyOff, device, 0.1)];
        let is_nobody = model.tree_is_planned && model.traffic.datagrams.answered() == 0;
        return is_nobody.then_some((LinkOpen, 0.4, others));
    }
    if !never_was_there(model, tree, drops, node) {
        return None;
    }
    let equals = wiring::equals_in_a_row(model, tree, node);
    if equals.is_empty() {
        let others = vec![(DeviceMissing, device, 0.45), (DeviceOff, device, 0.15)];
        return Some((LinkOpen, 0.3, others));
    }
    // One of them is not there, and the others have moved up.
    let each = 0.6 / (1 + equals.len()) as f64;
    let mut others = vec![(DeviceMissing, device, each), (DeviceOff, device, 0.1)];
    others.extend(equals.into_iter().map(|equal| (DeviceMissing, Some(equal), each)));
    Some((LinkOpen, (0.9 * each).min(0.25), others))
}

/// Whether a planned device never answered, and the port before it never had a link since its controller was
/// switched on: its counter of lost links is 0.
fn never_was_there(model: &NetworkModel, tree: &Tree, drops: &LinkLosses, node: usize) -> bool {
    let End::Controller(near, port) = tree.links()[drops.link].upstream else { return false };
    let lost = model.devices[near].counters.track(ErrorCounter::LostLink(port));
    let is_from_start = matches!(drops.seen[..], [drop] if drop.frame.is_some());
    model.tree_is_planned
        && model.devices[node].answered.is_none()
        && is_from_start
        && lost.is_some_and(|track| track.last.value == 0)
}
