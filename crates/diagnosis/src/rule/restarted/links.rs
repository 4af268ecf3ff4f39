//! Links that a SubDevice without supply took along.

use linesman_proto::register::ErrorCounter;
use linesman_proto::time::Instant;
use linesman_proto::topology::End;

use super::{BEFORE, Fall, LINKS_COUNTED, TOGETHER};
use crate::finding::Symptom;
use crate::locate::LinkLosses;
use crate::model::{AlChange, Device, NetworkModel};
use crate::rule::link_lost;

/// Symptoms at the links of a device that started anew: without supply it has no link, so its
/// neighbours lose theirs. Not so where a link was lost more often than the device restarted, at
/// another time, or is down though the device has been back for long.
pub(super) fn lost_with(
    model: &NetworkModel,
    fall: &Fall<'_>,
    together: &[Fall<'_>],
    falls: &[Fall<'_>],
) -> Vec<Symptom> {
    let Some(tree) = &model.tree else { return Vec::new() };
    let device = fall.device;
    let own: Vec<_> = device.al.changes.iter().filter(|change| change.is_own_fall()).collect();
    let earliest = match own.as_slice() {
        [first, _, ..] => first.at.before(BEFORE),
        // Those whose supply went together lost their links together, whenever each was missed.
        [] | [_] => together.iter().map(Fall::began).fold(fall.began(), Instant::min),
    };
    // Of a device that has just come back some links are up, and others on their way.
    let is_coming_up = model.now < fall.change.at + link_lost::SLOWEST_LINK_UP;
    let mut follows = Vec::new();
    for drops in LinkLosses::all(model) {
        let link = tree.links()[drops.link];
        let ends = [link.upstream, link.downstream];
        let is_its = ends.iter().any(|end| end.node() == Some(device.id.index()));
        // One that starts anew again and again before it is up has no state to fall from.
        let was_never_up = own.first().is_some_and(|first| stays_down(device, first, drops.last));
        let is_then = drops.first + TOGETHER >= earliest
            && (drops.last <= fall.change.at + LINKS_COUNTED || was_never_up)
            && (!drops.is_down || (is_coming_up && drops.first <= earliest + TOGETHER));
        let is_as_often = drops.count <= own.len() as u64
            || was_never_up
            || was_away_at_each(device, &drops, own.len());
        if is_its && ((is_then && is_as_often) || went_with_either(model, &drops, ends, falls)) {
            follows.extend(link_lost::follows(model, tree, drops.link));
        }
    }
    follows
}

/// True if each loss lies in one of the times in which the device was away, and it fell nearly each time: one
/// that falls again before it answers was away for both.
fn was_away_at_each(device: &Device, drops: &LinkLosses, falls: usize) -> bool {
    let is_in = |at: Instant| {
        device.absences.iter().any(|absence| {
            absence.since.at.before(TOGETHER) <= at
                && absence.ended.is_none_or(|ended| at <= ended + TOGETHER)
        })
    };
    !drops.seen.is_empty()
        && drops.count <= drops.seen.len() as u64
        && drops.seen.iter().all(|drop| is_in(drop.at))
        && falls * 10 >= device.absences.len() * 8
}

/// True if both ends of a link started anew, at different times, and each of its losses lies in one of these outages.
fn went_with_either(
    model: &NetworkModel,
    drops: &LinkLosses,
    ends: [End; 2],
    falls: &[Fall<'_>],
) -> bool {
    let is_end = |fall: &&Fall<'_>| {
        let node = Some(fall.device.id.index());
        fall.is_restart && ends.iter().any(|end| end.node() == node)
    };
    let outages: Vec<(Instant, Instant)> = falls
        .iter()
        .filter(is_end)
        .map(|fall| (fall.began().before(TOGETHER), fall.change.at + LINKS_COUNTED))
        .collect();
    let is_in = |from: Instant, to: Instant| {
        outages.iter().any(|(began, over)| from <= *over && *began <= to)
    };
    let counted = ends.into_iter().filter_map(|end| {
        let End::Controller(node, port) = end else { return None };
        model.devices[node].counters.track(ErrorCounter::LostLink(port))
    });
    let mut rises = counted.flat_map(|track| &track.rises).filter(|rise| rise.at >= drops.first);
    outages.len() > 1
        && !drops.is_down
        && drops.count <= outages.len() as u64
        && drops.seen.iter().all(|drop| is_in(drop.at, drop.at))
        && rises.all(|rise| is_in(rise.after_time, rise.at))
}

/// True if a device was not seen in its former state again between a fall and `until`.
fn stays_down(device: &Device, fall: &AlChange, until: Instant) -> bool {
    let later = device.al.changes.iter().filter(|change| change.at > fall.at && change.at <= until);
    let before = fall.from.state().state();
    later.into_iter().all(|change| change.to.state().state() < before)
}
