//! # Link lost
//!
//! Two devices do not see each other any more, or lost each other for a while.
//!
//! **How it is found.** DL status (0x0110) of the nearer device shows that a port has no link where one
//! belongs, and all behind it does not answer; or the lost-link counter of a port (0x0310 to 0x0313)
//! rose. The nearer device closes the port, so frames turn back there and the rest of the line goes on.
//!
//! **What it means.**
//!
//! * The link is down and stays down: the cable or contact is open, or the device behind it is without
//!   power. On a line without a ring frames cannot tell these two apart, since the device cannot be
//!   asked; the lamps on it can. When it is back in its old state, it was the cable; when it is back in
//!   INIT, with its address and counters cleared, it was the supply.
//! * One end has lost the link, the other has not: one pair of wires is broken, or something between the two,
//!   such as a media converter, shows a link whatever happens behind it.
//!   In a ring such an end closes no port, so that all on its side fall silent; it stays in use as long as it
//!   shows a link.
//! * The card of the MainDevice has lost its link, and nothing tells how the line is wired: the first cable, or the first
//!   SubDevice.
//! * The link comes and goes: a contact is loose, a plug not locked, a cable broken inside.
//!
//! What follows (SubDevices that do not answer, working counters, watchdogs) is listed beneath.
//!
//! **What to do.** Look at the lamps on both sides. Seat the plug, exchange the cable; on the terminal
//! bus press the terminals together and look at the contacts. Measure the supply of the device behind.

mod card;
mod follows;
mod never_seen;
mod other_way;
mod swallowed_half;

use linesman_config::fault::{Class, FaultName};
use linesman_proto::address::DeviceId;
use linesman_proto::port::Port;
use linesman_proto::register::{ErrorCounter, table};
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::{End, Tree};

use super::wiring::entry;
use super::{Rule, RulePage, View};
use crate::finding::{Alternative, Condition, Evidence, LinkDirection, Place, Severity, Symptom};
use crate::locate::{LinkLoss, LinkLosses};
use crate::model::{NetworkModel, Seen, is_on_terminal_bus, search};

pub(super) use follows::{SLOWEST_LINK_UP, follows};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "H101",
    name: "link-lost",
    severity: Severity::Error,
    class: Class::Hardware,
    source: include_str!("link_lost.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

/// A link that was back so soon was not plugged by a hand.
const SHORT: Span = Span::s(1);
/// What was on its way when a link was lost comes back by then.
const ANSWERS_LATE: Span = Span::ms(100);
/// A counter that rose in a silence is read so long after it at most.
const READ_WITHIN: Span = Span::ms(1_500);
/// Cards are looked at now and then only.
const CARRIER_LATE: Span = Span::ms(300);
/// A link that was lost again, before it was mended, comes and goes.
const AGAIN: u64 = 2;
/// So many losses are no accident.
const OFTEN: u64 = 3;

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let Some(tree) = &view.model.tree else {
        conditions.extend(card::lost(view));
        return;
    };
    let all = LinkLosses::all(view.model);
    for drops in &all {
        // Who answers though its entry has no link is plugged in the other way round.
        let ends = [tree.links()[drops.link].upstream, tree.links()[drops.link].downstream];
        let only_entry = drops.seen.iter().all(|drop| Some(drop.end) == ends.get(1).copied());
        if drops.is_down && only_entry && entry::is_reversed(view.model, ends[1]) {
            continue;
        }
        let mut condition = condition(view.model, tree, drops);
        if condition
            .alternatives
            .first()
            .is_some_and(|other| other.confidence > condition.confidence)
        {
            // What was never there is a matter of the device rather than of the link.
            lead_with_device(&mut condition);
        }
        if let Some(with) = share_supply(view.model, tree, &all, drops) {
            blame_supply(view.model, tree, drops, &with, &mut condition);
        } else if let Some(node) = dead_on_ring(view.model, tree, &all, drops) {
            blame(view.model, tree, node, &mut condition);
        }
        conditions.push(condition);
    }
}

/// The device of a ring that both its neighbours have lost at once, and that nobody reaches: two cuts
/// beside it at one moment are far less likely.
fn dead_on_ring(
    model: &NetworkModel,
    tree: &Tree,
    all: &[LinkLosses],
    drops: &LinkLosses,
) -> Option<usize> {
    if !drops.is_down || !tree.is_on_ring(drops.link) {
        return None;
    }
    let other = all.iter().find(|other| {
        other.link != drops.link
            && other.is_down
            && tree.is_on_ring(other.link)
            && other.falls_with(drops)
    })?;
    let nodes = |link: usize| {
        let ends = [tree.links()[link].upstream, tree.links()[link].downstream];
        ends.into_iter().filter_map(|end| end.node())
    };
    nodes(drops.link).find(|node| {
        let is_between = nodes(other.link).any(|one| one == *node);
        let device = &model.devices[*node];
        let has_answered = |at: Instant| at > drops.first.max(other.first) + ANSWERS_LATE;
        let is_reached = device.answered.is_some_and(|answered| has_answered(answered.at));
        is_between && (device.silent.is_some() || !is_reached)
    })
}

/// Lays a lost link to the device behind it; the other link of the device follows from it.
fn blame(model: &NetworkModel, tree: &Tree, node: usize, condition: &mut Condition) {
    let id = DeviceId(node as u32);
    condition.alternatives = vec![Alternative {
        cause: FaultName::LinkOpen,
        place: Some(condition.place),
        confidence: 0.2,
    }];
    condition.place = Place::device(model.network, id);
    (condition.cause, condition.confidence) = (FaultName::DeviceOff, 0.7);
    for port in Port::ALL {
        condition.explains.push(Symptom::LinkDown(id, port));
        condition.explains.push(Symptom::LinkCounted(id, port));
        let far = tree.opposite(End::Controller(node, port));
        if let Some(End::Controller(far, port)) = far {
            let far = DeviceId(far as u32);
            condition.explains.push(Symptom::LinkDown(far, port));
            condition.explains.push(Symptom::LinkCounted(far, port));
        }
        if let Some(End::MainDevice(_)) = far {
            condition.explains.extend([Symptom::NoCarrier, Symptom::NobodyAnswers]);
        }
    }
}

/// Links, side by side, that were lost at the same moment as this one, this one included, and are down since, with the
/// device that went with each: two cables do not break at one moment, but what hangs on them may have one supply.
fn share_supply<'a>(
    model: &NetworkModel,
    tree: &Tree,
    all: &'a [LinkLosses],
    drops: &'a LinkLosses,
) -> Option<Vec<(&'a LinkLosses, usize)>> {
    // What is behind another lost link went with it, but in a ring there is another way.
    let lost_above = |node: usize| {
        let way = tree.path_to(node).into_iter().filter(move |on| *on != node);
        way.filter_map(|on| tree.link_above(on)).any(|link| {
            !tree.is_on_ring(link) && all.iter().any(|other| other.link == link && other.is_down)
        })
    };
    let gone = |one: &LinkLosses| {
        if tree.is_on_ring(one.link) {
            return dead_on_ring(model, tree, all, one);
        }
        tree.links()[one.link].downstream.node().filter(|node| !lost_above(*node))
    };
    let is_one = |one: &&LinkLosses| one.is_down && one.count == 1 && one.falls_with(drops);
    let with: Vec<_> =
        all.iter().filter(is_one).filter_map(|one| Some((one, gone(one)?))).collect();
    let own = with.iter().find(|(one, _)| one.link == drops.link)?.1;
    // Behind a device of a ring that went nobody is reached either.
    let is_behind = |node: usize| {
        with.iter().any(|(_, other)| {
            *other != node
                && tree.subtree(*other).contains(&node)
                && !tree.ring_nodes().contains(&node)
        })
    };
    let with: Vec<_> =
        with.iter().copied().filter(|(_, node)| *node == own || !is_behind(*node)).collect();
    let is_several = with.iter().any(|(_, node)| *node != own);
    is_several.then_some(with)
}

/// Lays a lost link to the supply of the device that went with it; those that fell with it follow from the first.
fn blame_supply(
    model: &NetworkModel,
    tree: &Tree,
    drops: &LinkLosses,
    with: &[(&LinkLosses, usize)],
    condition: &mut Condition,
) {
    let Some(node) = with.iter().find(|(one, _)| one.link == drops.link).map(|(_, node)| *node)
    else {
        return;
    };
    let link = condition.place;
    if tree.is_on_ring(drops.link) {
        blame(model, tree, node, condition);
    }
    let place = Place::device(model.network, DeviceId(node as u32));
    condition.place = place;
    (condition.cause, condition.confidence) = (FaultName::SupplyOff, 0.6);
    let other = |cause, place, confidence| Alternative { cause, place, confidence };
    condition.alternatives =
        vec![other(FaultName::LinkOpen, Some(link), 0.15), other(FaultName::DeviceOff, None, 0.15)];
    if with.first().is_some_and(|(first, _)| first.link == drops.link) {
        let follows = with.iter().flat_map(|(one, _)| follows(model, tree, one.link));
        condition.explains.extend(follows);
    }
    let mut gone: Vec<usize> = with.iter().map(|(_, node)| *node).collect();
    gone.dedup();
    let names: Vec<String> =
        gone.into_iter().map(|node| model.label(DeviceId(node as u32))).collect();
    condition.actions.insert(
        0,
        format!(
            "{} fell silent at the same moment: look for the supply that they share.",
            names.join(", ")
        ),
    );
}

fn condition(model: &NetworkModel, tree: &Tree, drops: &LinkLosses) -> Condition {
    let link = tree.links()[drops.link];
    let named = link.map(|node| DeviceId(node as u32));
    let place = Place::link(model.network, named, Some(LinkDirection::Both));
    let behind = link.downstream.node();
    let (cause, confidence, others) = causes(model, tree, drops, behind);
    let mut condition = Condition::new(&PAGE, place, cause, drops.first)
        .confidence(confidence)
        .confirmed(drops.first)
        .about(ends(model, tree, drops.link).into_iter().map(|symptom| {
            if let Symptom::LinkDown(id, port) = symptom
                && drops.seen.is_empty()
            {
                return Symptom::LinkCounted(id, port);
            }
            symptom
        }))
        .explaining(follows(model, tree, drops.link));
    for (cause, at, confidence) in others {
        condition = match at {
            Some(node) => {
                let device = Place::device(model.network, DeviceId(node as u32));
                condition.or_at(cause, device, confidence)
            }
            None => condition.or(cause, confidence),
        };
    }
    for drop in drops.seen.iter().rev().take(3) {
        condition = condition.shown_by(status_evidence(model, drop));
    }
    for end in [link.upstream, link.downstream] {
        condition.evidence.extend(counter_evidence(model, end));
    }
    if let Some(ended) = drops.ended() {
        condition = condition.ended(ended);
    }
    if drops.may_be_old {
        condition = condition.may_be_old();
    }
    let far = match link.downstream {
        End::Controller(node, _) => model.label(DeviceId(node as u32)),
        End::MainDevice(_) => "the MainDevice's second card".to_owned(),
    };
    condition =
        condition.advise(format!("Look at {far}: if no lamp is lit, measure its supply first."));
    // Only a terminal says for sure that no cable leads to it; a coupler or junction may have either before it.
    let is_terminal = behind.is_some_and(|node| is_on_terminal_bus(model, node));
    if !is_terminal {
        let text = format!("Seat the plugs at both ends of {place}; then exchange the cable.");
        condition = condition.advise(text);
    }
    condition.advise("On the terminal bus, press the terminals together and look at the contacts.")
}

/// Puts the first alternative, which is likelier, in front.
fn lead_with_device(condition: &mut Condition) {
    let Some(first) = condition.alternatives.first_mut() else { return };
    let place = first.place.replace(condition.place);
    std::mem::swap(&mut first.cause, &mut condition.cause);
    std::mem::swap(&mut first.confidence, &mut condition.confidence);
    condition.place = place.unwrap_or(condition.place);
}

type Causes = (FaultName, f64, Vec<(FaultName, Option<usize>, f64)>);

fn causes(model: &NetworkModel, tree: &Tree, drops: &LinkLosses, behind: Option<usize>) -> Causes {
    use FaultName::{
        BrownOut, CableDegraded, DeviceOff, FalseLink, LinkFlapping, LinkOpen, RingOpen, SupplyOff,
    };
    if drops.count < OFTEN && is_one_sided(model, tree, drops) {
        // Nothing that shows a link by itself can be between two terminals.
        return match behind.is_some_and(|node| is_on_terminal_bus(model, node)) {
            true => (LinkOpen, 0.5, vec![(FalseLink, None, 0.35)]),
            false => (FalseLink, 0.5, vec![(LinkOpen, None, 0.35)]),
        };
    }
    if let Some(near) = swallowed_half::near_end(model, tree, drops) {
        return (FalseLink, 0.6, vec![(RingOpen, None, 0.2), (DeviceOff, Some(near), 0.1)]);
    }
    if let Some(never) = never_seen::causes(model, tree, drops) {
        return never;
    }
    let is_repeated = drops.count >= AGAIN;
    let is_of_ring = tree.is_on_ring(drops.link) || other_way::is_there(model, tree, drops);
    let sure = if drops.count >= OFTEN { 0.75 } else { 0.6 };
    match drops.longest() {
        None if is_of_ring && !is_repeated => (RingOpen, 0.75, vec![(LinkFlapping, None, 0.15)]),
        None => {
            let off = if behind.is_some_and(|node| is_on_terminal_bus(model, node)) {
                (0.5, 0.35, 0.05)
            } else {
                (0.6, 0.25, 0.1)
            };
            let mut others = vec![(DeviceOff, behind, off.1), (SupplyOff, behind, off.2)];
            if is_repeated {
                return (LinkFlapping, 0.5, vec![(LinkOpen, None, 0.3), others.remove(0)]);
            }
            (LinkOpen, off.0, others)
        }
        Some(_) if is_repeated => {
            (LinkFlapping, sure, vec![(BrownOut, behind, 0.1), (CableDegraded, None, 0.05)])
        }
        Some(_) if is_of_ring => (RingOpen, 0.6, vec![(LinkFlapping, None, 0.3)]),
        Some(longest) if longest < SHORT => {
            (LinkOpen, 0.45, vec![(LinkFlapping, None, 0.35), (BrownOut, behind, 0.1)])
        }
        Some(_) => (LinkOpen, 0.6, vec![(LinkFlapping, None, 0.15), (DeviceOff, behind, 0.15)]),
    }
}

/// Whether one end has lost the link while the other one had it all the time: one pair of wires, or
/// something between that shows a link by itself. Only where both were read afterwards.
pub(super) fn is_one_sided(model: &NetworkModel, tree: &Tree, drops: &LinkLosses) -> bool {
    let link = tree.links()[drops.link];
    let saw = |end: End| -> Option<bool> {
        let seen = drops.is_shown_by(model, end);
        match end {
            End::Controller(node, port) => {
                let device = model.devices.get(node)?;
                let lost = device.counters.track(ErrorCounter::LostLink(port))?;
                let has_risen = lost.rises.iter().any(|rise| rise.at >= drops.first);
                let was_read = device.silent.is_none()
                    && lost.last.at > drops.last
                    && !lost.is_at_end()
                    && !device.has_restarted();
                (seen || has_risen || was_read).then_some(seen || has_risen)
            }
            End::MainDevice(path) => {
                let Some(carrier) = model.host.card(path).carrier else {
                    let about = (drops.first.before(READ_WITHIN), drops.last);
                    return search::began_at_once(model, about).then_some(false);
                };
                let has_changed = !carrier.value || carrier.at >= drops.first.before(CARRIER_LATE);
                (seen || drops.last + CARRIER_LATE < model.now)
                    .then_some(seen || (has_changed && model.host.card(path).carrier_changes > 0))
            }
        }
    };
    matches!((saw(link.upstream), saw(link.downstream)), (Some(one), Some(other)) if one != other)
}

/// What the loss is about: both ends, and the card's link if it is one of them.
fn ends(model: &NetworkModel, tree: &Tree, link: usize) -> Vec<Symptom> {
    let ends = [tree.links()[link].upstream, tree.links()[link].downstream];
    let symptom = |end: End| match end {
        End::Controller(node, port) => Some(Symptom::LinkDown(DeviceId(node as u32), port)),
        End::MainDevice(path) => {
            let carrier = model.host.card(path).carrier;
            carrier.is_some_and(|carrier| !carrier.value).then_some(Symptom::NoCarrier)
        }
    };
    ends.into_iter().filter_map(symptom).collect()
}

fn status_evidence(model: &NetworkModel, drop: &LinkLoss) -> Evidence {
    let seen = Seen::new((), drop.at, drop.frame);
    match drop.end {
        End::Controller(node, port) => {
            let id = DeviceId(node as u32);
            let label = model.label(id);
            let text = match drop.back {
                Some(back) => {
                    format!("DL status of {label}: port {port} had no link until {back}")
                }
                None => {
                    format!("DL status of {label}: port {port} has no link, and one belongs there")
                }
            };
            Evidence::register(id, table::DL_STATUS.address, &seen, text)
                .port(port)
                .values(Some(1), Some(0))
        }
        End::MainDevice(path) => Evidence::host(Some(drop.at), format!("card {path} has no link")),
    }
}

fn counter_evidence(model: &NetworkModel, end: End) -> Option<Evidence> {
    let End::Controller(node, port) = end else { return None };
    let counter = ErrorCounter::LostLink(port);
    let track = model.devices[node].counters.track(counter)?;
    let rise = track.last_rise()?;
    let id = DeviceId(node as u32);
    let count = track.total.rise();
    let often = if count == 1 { "once".to_owned() } else { format!("{count} times") };
    let text = format!("{} lost the link of port {port} {often}", model.label(id));
    Some(Evidence::rise(id, counter.address(), Some(port), rise, text))
}
