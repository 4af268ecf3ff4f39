//! Deficit of a working counter that equals the share of all behind one link: the link is open, though nobody polls links
//! or states.

use linesman_proto::address::DeviceId;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::{End, Tree};

use super::{Suspects, shares};
use crate::locate::cut_distance;
use crate::model::is_on_terminal_bus;
use crate::model::{Cyclic, Deficit, NetworkModel};

/// Datagrams of one cycle, and of slower ones, lose their shares so soon after each other.
const AT_ONCE: Span = Span::ms(500);
/// Time by which frames that were on their way when a link was lost come back.
const ANSWERS_LATE: Span = Span::ms(100);
/// One device that fails alone has other reasons.
const SEVERAL: usize = 2;

/// Links behind which all shares that a deficit lacks belong, most likely first.
pub(super) fn suspects(model: &NetworkModel, deficit: &Deficit) -> Option<Suspects> {
    let tree = model.tree.as_ref().filter(|tree| tree.len() <= model.devices.len())?;
    let since = deficit.first.at;
    let until = deficit.ended.unwrap_or(model.now);
    // What was short in several ways was not cut off at one place.
    if deficit.ended.is_some() && deficit.first.value != deficit.lowest {
        return None;
    }
    let traffic = &model.traffic;
    let counts_all =
        traffic.broadcasts.now().is_some_and(|now| now.value >= traffic.broadcasts.most())
            && traffic
                .broadcasts
                .latest()
                .is_some_and(|read| since + ANSWERS_LATE < read && read <= until);
    if counts_all {
        return None;
    }
    let gone = traffic.broadcasts.now().filter(|now| now.at <= until && now.at + AT_ONCE >= since);
    let gone = gone.map(|now| usize::from(traffic.broadcasts.most().saturating_sub(now.value)));
    let fits = |node: &usize| {
        let behind = tree.subtree(*node);
        is_between(tree, *node)
            && !behind.iter().any(|node| is_heard(model, *node, deficit))
            && !is_link_read(model, tree, *node, (since, until))
            && (owners(model, behind) >= SEVERAL || gone == Some(behind.len()))
            && model.cyclic.iter().all(|cyclic| lacks(model, cyclic, behind, since))
    };
    let mut heads: Vec<usize> = tree.order().iter().copied().filter(fits).collect();
    heads.sort_by_key(|node| {
        (
            gone.is_some_and(|gone| gone != tree.subtree(*node).len()),
            is_on_terminal_bus(model, *node),
        )
    });
    cut_distance::keep_fitting(model, tree, &mut heads, since);
    let links: Vec<usize> = heads.iter().filter_map(|node| tree.link_above(*node)).collect();
    let behind = tree.subtree(*heads.first()?);
    let devices = behind.iter().map(|node| DeviceId(*node as u32));
    let devices = devices
        .filter(|id| model.cyclic.iter().any(|one| model.owners(one).any(|own| own.device == *id)));
    Some(Suspects { is_certain: true, devices: devices.collect(), links })
}

/// Not the first link, without which no frame comes back, nor one of a ring, where frames come from the other side.
fn is_between(tree: &Tree, node: usize) -> bool {
    matches!(tree.upstream(node), Some(End::Controller(..)))
        && tree.link_above(node).is_none_or(|link| !tree.is_on_ring(link))
}

/// True if a SubDevice answered in the time of a deficit.
fn is_heard(model: &NetworkModel, node: usize, deficit: &Deficit) -> bool {
    let (device, from) = (&model.devices[node], deficit.first.at + ANSWERS_LATE);
    match deficit.ended {
        None => device.answered.is_some_and(|answered| answered.at > from),
        Some(ended) => device.heard_short.is_some_and(|heard| from < heard && heard <= ended),
    }
}

/// True if the near end told of its link since: then that is known, and other rules tell.
fn is_link_read(
    model: &NetworkModel,
    tree: &Tree,
    node: usize,
    (since, until): (Instant, Instant),
) -> bool {
    let Some(End::Controller(near, _)) = tree.upstream(node) else { return false };
    let dl = &model.devices[near].dl;
    !dl.is_assumed && dl.latest_reading.is_some_and(|read| since <= read && read <= until)
}

fn owners(model: &NetworkModel, behind: &[usize]) -> usize {
    let is_owner = |node: &&usize| {
        let mut owned = model.cyclic.iter().flat_map(|cyclic| model.owners(cyclic));
        owned.any(|owner| owner.device.index() == **node)
    };
    behind.iter().filter(is_owner).count()
}

/// True if a datagram lacks just the shares of all that is behind, or nothing where they have none in it.
fn lacks(model: &NetworkModel, cyclic: &Cyclic, behind: &[usize], since: Instant) -> bool {
    let own = model.owners(cyclic).filter(|owner| behind.contains(&owner.device.index()));
    let share: u16 = own.filter_map(|owner| shares(cyclic, &owner).first().copied()).sum();
    let then = cyclic.wkc.deficits().iter().rev().find(|deficit| {
        let at = deficit.first.at;
        at <= since + AT_ONCE && since <= at + AT_ONCE
    });
    let lacking = |deficit: &Deficit| {
        let now = if deficit.ended.is_some() { deficit.lowest } else { cyclic.wkc.now().value };
        deficit.expected.saturating_sub(now)
    };
    share == then.map_or(0, lacking)
}
