//! What is missing, where it is just the share of all behind one link: then the link is open, though nobody polls
//! links or states.

use linesman_proto::address::DeviceId;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::{End, Tree};

use super::{Suspects, shares};
use crate::line::{Cyclic, Deficit, Line};
use crate::locate::way;
use crate::rule::link_lost::is_on_terminal_bus;

/// Datagrams of one cycle, and of slower ones, lose their shares so soon after each other.
const AT_ONCE: Span = Span::ms(500);
/// What was on its way when a link was lost comes back by then.
const ANSWERS_LATE: Span = Span::ms(100);
/// One device that fails alone has other reasons.
const SEVERAL: usize = 2;

/// Links behind which all shares that a lasting deficit lacks belong, most likely first.
pub(super) fn suspects(line: &Line, deficit: &Deficit) -> Option<Suspects> {
    let tree = line.tree.as_ref().filter(|tree| {
        tree.closes_at().is_none() && tree.len() <= line.devices.len() && deficit.ended.is_none()
    })?;
    let since = deficit.first.at;
    let traffic = &line.traffic;
    let counts_all =
        traffic.broadcast_now.is_some_and(|now| now.value >= traffic.broadcast_answers)
            && traffic.broadcast_read.is_some_and(|read| read > since + ANSWERS_LATE);
    if counts_all {
        return None;
    }
    let gone = traffic
        .broadcast_now
        .filter(|now| now.at.before(AT_ONCE) <= line.now && now.at + AT_ONCE >= since);
    let gone = gone.map(|now| usize::from(traffic.broadcast_answers.saturating_sub(now.value)));
    let fits = |node: &usize| {
        let behind = tree.subtree(*node);
        is_between(tree, *node)
            && !behind.iter().any(|node| is_heard(line, *node, since))
            && !is_link_read(line, tree, *node, since)
            && (owners(line, behind) >= SEVERAL || gone == Some(behind.len()))
            && line.cyclic.iter().all(|cyclic| lacks(line, cyclic, behind, since))
    };
    let mut heads: Vec<usize> = tree.order().iter().copied().filter(fits).collect();
    heads.sort_by_key(|node| {
        (
            gone.is_some_and(|gone| gone != tree.subtree(*node).len()),
            is_on_terminal_bus(line, *node),
        )
    });
    way::keep_fitting(line, tree, &mut heads, since);
    let links: Vec<usize> = heads.iter().filter_map(|node| tree.link_above(*node)).collect();
    let behind = tree.subtree(*heads.first()?);
    let devices = behind.iter().map(|node| DeviceId(*node as u32));
    let devices = devices
        .filter(|id| line.cyclic.iter().any(|one| line.owners(one).any(|own| own.device == *id)));
    Some(Suspects { is_certain: true, devices: devices.collect(), links })
}

/// Not the first link: without it no frame comes back.
fn is_between(tree: &Tree, node: usize) -> bool {
    matches!(tree.upstream(node), Some(End::Controller(..)))
}

fn is_heard(line: &Line, node: usize, since: Instant) -> bool {
    line.devices[node].answered.is_some_and(|answered| answered.at > since + ANSWERS_LATE)
}

/// Whether the near end told of its link since: then that is known, and other rules tell.
fn is_link_read(line: &Line, tree: &Tree, node: usize, since: Instant) -> bool {
    let Some(End::Controller(near, _)) = tree.upstream(node) else { return false };
    let dl = &line.devices[near].dl;
    !dl.is_assumed && dl.latest_reading.is_some_and(|read| read >= since)
}

fn owners(line: &Line, behind: &[usize]) -> usize {
    let is_owner = |node: &&usize| {
        let mut owned = line.cyclic.iter().flat_map(|cyclic| line.owners(cyclic));
        owned.any(|owner| owner.device.index() == **node)
    };
    behind.iter().filter(is_owner).count()
}

/// Whether a datagram lacks just the shares of all that is behind, or nothing where they have none in it.
fn lacks(line: &Line, cyclic: &Cyclic, behind: &[usize], since: Instant) -> bool {
    let own = line.owners(cyclic).filter(|owner| behind.contains(&owner.device.index()));
    let share: u16 = own.filter_map(|owner| shares(cyclic, &owner).first().copied()).sum();
    let open = cyclic.deficits.back().filter(|deficit| {
        let at = deficit.first.at;
        deficit.ended.is_none() && at <= since + AT_ONCE && since <= at + AT_ONCE
    });
    share == open.map_or(0, |deficit| deficit.expected.saturating_sub(cyclic.wkc.value))
}
