//! Consequences of a lost link: what hangs behind it, and links beyond that were lost with it.

use std::collections::BTreeSet;

use linesman_proto::address::DeviceId;
use linesman_proto::port::Port;
use linesman_proto::register::ErrorCounter;
use linesman_proto::time::Span;
use linesman_proto::topology::{End, Tree};

use super::ends;
use crate::finding::Symptom;
use crate::locate::LinkLosses;
use crate::model::{NetworkModel, Rise};

/// No link of a device that starts anew comes up so much later than the others.
pub(in crate::rule) const SLOWEST_LINK_UP: Span = Span::s(5);

/// What can follow from the loss.
pub(in crate::rule) fn follows(model: &NetworkModel, tree: &Tree, link: usize) -> Vec<Symptom> {
    let mut follows: BTreeSet<Symptom> = ends(model, tree, link).into_iter().collect();
    for end in [tree.links()[link].upstream, tree.links()[link].downstream] {
        if let End::Controller(node, port) = end {
            follows.insert(Symptom::LinkCounted(DeviceId(node as u32), port));
        }
    }
    follows.extend([Symptom::FramesLost, Symptom::CardErrors]);
    // Errors at the moment of the change are not reported at all; others are trouble of their own.
    for end in [tree.links()[link].upstream, tree.links()[link].downstream] {
        if let End::MainDevice(_) = end {
            follows.extend([Symptom::NoCarrier, Symptom::NobodyAnswers]);
        }
    }
    if let End::Controller(node, _) = tree.links()[link].downstream {
        let all = LinkLosses::all(model);
        let own = all.iter().find(|drops| drops.link == link);
        let is_powered = own.is_some_and(|own| kept_power(model, tree, own));
        if let Some(own) = own.filter(|_| !is_powered) {
            follows.extend(lost_beyond(tree, &all, own, node));
        }
        for &node in tree.subtree(node) {
            let id = DeviceId(node as u32);
            follows.extend([
                Symptom::Silent(id),
                Symptom::WorkingCounter(id),
                Symptom::StateLost(id),
                Symptom::Emergency(id),
            ]);
            // If it is the device that failed, those behind it lost their links, too.
            if !is_powered {
                follows.extend(Port::ALL.map(|port| Symptom::LinkCounted(id, port)));
            }
        }
    }
    follows.into_iter().collect()
}

/// The links beyond the device behind a lost one, as far as they were lost with it: then it was without
/// supply. Those that were lost more often, or before, or that stay away for much longer have trouble of their own.
fn lost_beyond(tree: &Tree, all: &[LinkLosses], own: &LinkLosses, behind: usize) -> Vec<Symptom> {
    let of = |link: usize| all.iter().find(|drops| drops.link == link);
    let mut lost = Vec::new();
    for (port, child) in tree.children(behind) {
        let beyond = tree.link_above(child).and_then(of);
        let is_in_time = |beyond: &LinkLosses| {
            let (own, beyond) = (own.ended(), beyond.ended());
            beyond.is_some_and(|ended| own.is_none_or(|own| ended <= own + SLOWEST_LINK_UP))
        };
        let is_with = |beyond: &&LinkLosses| {
            beyond.count <= own.count && beyond.first >= own.first && is_in_time(beyond)
        };
        if beyond.filter(is_with).is_some() {
            lost.push(Symptom::LinkDown(DeviceId(behind as u32), port));
            lost.push(Symptom::LinkDown(DeviceId(child as u32), tree.entry(child)));
        }
    }
    lost
}

/// True if the device behind a lost link had its supply all the time: it counted each of the losses itself, and its
/// controller, whose counters start from 0, has not started anew.
fn kept_power(model: &NetworkModel, tree: &Tree, own: &LinkLosses) -> bool {
    let End::Controller(node, entry) = tree.links()[own.link].downstream else { return false };
    let device = &model.devices[node];
    let lost = device.counters.track(ErrorCounter::LostLink(entry));
    let since = |rise: &&Rise| rise.at >= own.first;
    let counted =
        lost.map(|track| track.rises.iter().filter(since).map(|rise| rise.difference.rise));
    !device.has_restarted() && counted.is_some_and(|rises| rises.sum::<u64>() >= own.count)
}
