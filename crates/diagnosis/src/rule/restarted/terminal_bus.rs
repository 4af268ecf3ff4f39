//! Terminals that start anew while the coupler that feeds them does not.

use linesman_proto::address::DeviceId;
use linesman_proto::topology::Tree;

use super::{Fall, TOGETHER};
use crate::model::{NetworkModel, is_on_terminal_bus};

/// What feeds all that fell together, where these are two terminals or more and reach to the end of its terminal
/// bus: the voltage falls along the contacts, so that the last ones go first. One that did not fall has its supply.
pub(super) fn common_feeder(model: &NetworkModel, together: &[Fall<'_>]) -> Option<DeviceId> {
    let tree = model.tree.as_ref().filter(|tree| tree.len() == model.devices.len())?;
    let first = together.iter().map(|fall| fall.device.id.index()).min()?;
    let feeder = feeder(model, tree, first)?;
    let is_fed = |node: usize| node != feeder && self::feeder(model, tree, node) == Some(feeder);
    let mut fed = (first..tree.len()).filter(|node| is_fed(*node));
    let is_bus = together.len() > 1
        && together.iter().all(|fall| is_fed(fall.device.id.index()))
        && fed.all(|node| has_gone(model, node, together));
    is_bus.then_some(DeviceId(feeder as u32))
}

/// Feeder of a terminal: the nearest one before it that says that it supplies, or is no terminal.
fn feeder(model: &NetworkModel, tree: &Tree, node: usize) -> Option<usize> {
    let mut node = node;
    while is_on_terminal_bus(model, node) {
        node = tree.upstream(node)?.node()?;
        let power = model.devices[node].power;
        if power.is_some_and(|power| power.value.ebus_current_ma < 0) {
            break;
        }
    }
    Some(node)
}

/// True if it fell with them, or was away meanwhile: its state may not have been read before it went again. Who was cut
/// off behind one that fell, has not started anew and answers since the last fall, had its supply.
fn has_gone(model: &NetworkModel, node: usize, together: &[Fall<'_>]) -> bool {
    let device = &model.devices[node];
    let latest = together.iter().map(|fall| fall.change.at).max();
    let has_kept = !device.has_restarted()
        && device.answered.is_some_and(|answered| Some(answered.at) > latest);
    if has_kept {
        return false;
    }
    let is_away_with = |fall: &Fall<'_>| {
        device.absences.iter().any(|absence| {
            absence.since.at.before(TOGETHER) <= fall.change.at
                && absence.ended.is_none_or(|ended| fall.began() <= ended + TOGETHER)
        })
    };
    together.iter().any(|fall| fall.device.id == device.id || is_away_with(fall))
}
