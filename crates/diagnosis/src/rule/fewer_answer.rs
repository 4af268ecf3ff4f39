//! # Fewer SubDevices answer than there are
//!
//! A MainDevice hears fewer SubDevices than there are, or than it heard before.
//!
//! **How it is found.** Another tool told how many SubDevices answer a broadcast (`Slaves:` of `ethercat master`,
//! `slave(s) responding` in a kernel log, `answering` in an observation file), and more are known: from a list,
//! from a project, or from an earlier count. On a line without branches those answer that are nearest, so the
//! break lies behind the last of them. The same is told of broadcasts that were seen, where their working counter
//! falls and stays low, and nothing else says who is gone: then links are named behind which there are just as many
//! SubDevices as are missing. Where receive times were latched (0x0900), the time that frames take tells which of
//! them: a cut shortens their way by all that lies behind.
//!
//! **What it means.** A link is open, or a device is without power; all behind it is gone with it. On a line with
//! branches the number alone does not say which.
//!
//! **What to do.** Go to the place that is named, and look at the lamps on both sides of it. Where none is named,
//! `linesman scan --against` with the project says who is missing.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::{End, Tree};

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, LinkDirection, Place, Severity, Symptom};
use crate::locate::cut_distance;
use crate::model::{NetworkModel, Seen, is_on_terminal_bus};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "H104",
    name: "fewer-answer",
    severity: Severity::Error,
    class: Class::Hardware,
    source: include_str!("fewer_answer.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

/// Fewer that answer for so long are fewer for good.
const LASTS: Span = Span::ms(500);
/// Ports that were opened or closed so shortly before are why.
const ORDERED: Span = Span::ms(500);
/// What was on its way when a link was lost comes back by then.
const ANSWERS_LATE: Span = Span::ms(100);
/// So many links are named.
const MOST_LINKS: usize = 4;

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let model = view.model;
    let reported = &model.reported;
    conditions.extend(seen(view, conditions));
    // Without a link nobody answers; where the wiring is known, the link itself is told.
    let carrier = model.host.card(Path::A).carrier.filter(|carrier| !carrier.value);
    let unlinked =
        carrier.filter(|_| model.devices.is_empty() && model.traffic.recording.frames() == 0);
    let told = reported.answering.or_else(|| Some(Seen::new(0, unlinked?.at, None)));
    let Some(answering) = told else { return };
    let known = model.devices.len().max(usize::from(reported.answering_most));
    let count = usize::from(answering.value);
    if count >= known && count > 0 {
        return;
    }
    // A link that is known to be lost says more.
    let is_placed = conditions.iter().any(|one| matches!(one.page.code, "H100" | "H101"));
    let at = place(model, count);
    let network = Place::Network { network: model.network };
    let text = match (count, known, unlinked) {
        (_, _, Some(_)) => "the card has no link".to_owned(),
        (0, 0, None) => "no SubDevice answers a broadcast".to_owned(),
        (count, known, None) => {
            format!("{count} SubDevices answer a broadcast, and {known} are known")
        }
    };
    let mut condition = Condition::new(&PAGE, at, FaultName::LinkOpen, answering.at)
        .confidence(if at == network { 0.4 } else { 0.5 })
        .or(FaultName::DeviceOff, 0.25)
        .or(FaultName::SupplyOff, 0.1)
        .confirmed(answering.at)
        .shown_by(Evidence::host(Some(answering.at), text));
    if count == 0 {
        condition = condition.or_at(FaultName::NicDamaged, Place::Host, 0.05);
    }
    condition = match count {
        0 => condition
            .advise("Look at the cable from the card to the first SubDevice, and at the lamps at both ends.")
            .advise("Check the supply of the first SubDevice."),
        _ if at == network => condition.advise(
            "Compare the SubDevices that answer with the drawing: `linesman scan --against` says who is \
             missing.",
        ),
        _ => condition.advise(format!("Look at {at}: the lamps on both sides, the plugs, the supply behind.")),
    };
    let gone = model.devices.iter().map(|device| device.id);
    let follows = gone
        .flat_map(|id| [Symptom::Silent(id), Symptom::WorkingCounter(id), Symptom::StateLost(id)]);
    condition =
        condition.explaining(follows).explaining([Symptom::FramesLost, Symptom::FramesLate]);
    if is_placed {
        let first_gone = model.devices.iter().find(|device| device.silent.is_some());
        let symptom = match (count, first_gone) {
            (0, _) => Some(Symptom::NobodyAnswers),
            (_, Some(device)) => Some(Symptom::Silent(device.id)),
            (_, None) => None,
        };
        condition.symptoms.extend(symptom);
        condition.explains.clear();
    }
    conditions.push(condition);
}

/// Behind the last that answers, where nothing branches.
fn place(model: &NetworkModel, count: usize) -> Place {
    let network = Place::Network { network: model.network };
    if count == 0 {
        let first = model.links().find(|link| link.upstream == End::MainDevice(Path::A));
        return Place::Link {
            network: model.network,
            a: End::MainDevice(Path::A),
            b: first.map(|link| link.downstream),
            direction: None,
        };
    }
    let Some(tree) = model.tree.as_ref().filter(|tree| count < tree.len() && is_chain(tree)) else {
        return network;
    };
    let lost = tree.order().get(count).and_then(|node| tree.link_above(*node));
    let link = lost.and_then(|link| tree.links().get(link));
    link.map_or(network, |link| {
        let named = link.map(|node| DeviceId(node as u32));
        Place::link(model.network, named, Some(LinkDirection::Both))
    })
}

fn is_chain(tree: &Tree) -> bool {
    tree.closes_at().is_none() && (0..tree.len()).all(|node| tree.children(node).count() <= 1)
}

/// Broadcasts that were seen: fewer SubDevices than before count in them, for good, and nothing else says who is gone.
fn seen(view: &View<'_>, conditions: &[Condition]) -> Option<Condition> {
    let model = view.model;
    let traffic = &model.traffic;
    let now = traffic.broadcasts.now().filter(|_| traffic.recording.frames() > 0)?;
    let most = traffic.broadcasts.most();
    let lasts = view.has_ended || view.now.since(now.at) >= LASTS;
    // In a ring each card counts its own half; without any answer another rule tells.
    let is_ring = traffic.broadcasts.came_in_copies()
        || model.tree.as_ref().is_some_and(|tree| tree.closes_at().is_some());
    let is_ordered = model.loops_ordered.is_some_and(|ordered| ordered >= now.at.before(ORDERED));
    if now.value == 0 || now.value >= most || !lasts || is_ring || is_ordered {
        return None;
    }
    let is_gone = |one: &Condition| {
        one.ended.is_none()
            && (one.explains.iter().chain(&one.symptoms).any(|symptom| {
                matches!(
                    symptom,
                    Symptom::Silent(_) | Symptom::LinkDown(..) | Symptom::NobodyAnswers
                )
            }))
    };
    if conditions.iter().any(is_gone) {
        return None;
    }
    let missing = usize::from(most - now.value);
    let links = candidates(model, missing, now.at);
    let network = Place::Network { network: model.network };
    let at = links.first().copied().unwrap_or(network);
    let share = 1.0 / links.len().max(1) as f64;
    let text = format!("{} SubDevices answer a broadcast; it were {most} before", now.value);
    let mut condition = Condition::new(&PAGE, at, FaultName::LinkOpen, now.at)
        .confidence(if at == network { 0.4 } else { 0.55 * share })
        .confirmed(now.at)
        .shown_by(Evidence::frame(now.at, now.frame.unwrap_or(0), text));
    for other in links.iter().skip(1) {
        condition = condition.or_at(FaultName::LinkOpen, *other, 0.55 * share);
    }
    condition = condition.or(FaultName::DeviceOff, 0.25).or(FaultName::SupplyOff, 0.1);
    condition = match at == network {
        true => condition.advise(
            "Compare the SubDevices that answer with the drawing: `linesman scan --against` says who is \
             missing.",
        ),
        false => condition
            .advise(format!("Look at {at}: the lamps on both sides, the plugs, the supply behind.")),
    };
    condition.evidence.extend(cut_distance::evidence(model, now.at));
    let gone = model.devices.iter().map(|device| device.id);
    let follows = gone
        .flat_map(|id| [Symptom::Silent(id), Symptom::WorkingCounter(id), Symptom::StateLost(id)]);
    Some(condition.explaining(follows))
}

/// Links behind which there are just as many SubDevices as are missing, none of them heard since: cables before
/// contacts of the terminal bus.
fn candidates(model: &NetworkModel, missing: usize, since: Instant) -> Vec<Place> {
    let Some(tree) = model.tree.as_ref().filter(|tree| tree.len() <= model.devices.len()) else {
        return Vec::new();
    };
    let is_heard = |node: &usize| {
        model.devices[*node].answered.is_some_and(|answered| answered.at > since + ANSWERS_LATE)
    };
    let fits = |node: &usize| {
        let branch = tree.subtree(*node);
        branch.len() == missing && !branch.iter().any(is_heard)
    };
    let mut heads: Vec<usize> = tree.order().iter().copied().filter(fits).collect();
    heads.sort_by_key(|node| is_on_terminal_bus(model, *node));
    cut_distance::keep_fitting(model, tree, &mut heads, since);
    let link = |node: usize| tree.links().get(tree.link_above(node)?).copied();
    let links = heads.into_iter().filter_map(link).take(MOST_LINKS);
    let named = links.map(|link| link.map(|node| DeviceId(node as u32)));
    named.map(|link| Place::link(model.network, link, Some(LinkDirection::Both))).collect()
}
