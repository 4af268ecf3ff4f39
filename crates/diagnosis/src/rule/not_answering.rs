//! # SubDevice does not answer
//!
//! A SubDevice that answered before, or that should be there, does not answer.
//!
//! **How it is found.** A datagram to its address came back with working counter 0 from a register that
//! every controller has, and for a tenth of a second at least no later one was answered; or an online list says so.
//! A station address that is asked again and again and has never answered counts, too, where others answer.
//!
//! Where all behind one link are silent at once, it is one finding, at that link; unless the near end of it was read
//! since and says otherwise, or broadcasts still count all of them. Where nobody has seen the wiring, as when the
//! diagnosis joins a line that runs already, SubDevices that follow upon one another and are silent at once are one
//! finding at the first of them: frames come to it by a link from one of those before it, which of them was not seen.
//! Where frames go through a silent SubDevice to others that still answer, it has its supply and has lost its station
//! address by starting anew; those that fell silent with it are listed with it.
//!
//! **What it means.** It is without power, cut off, or has lost its station address by starting anew.
//! When the link to it is lost, that finding stands above this one.
//!
//! **What to do.** Look at the nearest SubDevice before it that answers: the trouble is between the two,
//! or in this one.

mod branch;

use linesman_config::fault::{Class, FaultName};
use linesman_proto::address::DeviceId;
use linesman_proto::port::Port;
use linesman_proto::register::table;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::End;

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, LinkDirection, Place, Severity, Symptom};
use crate::locate::{LinkLosses, cut_distance};
use crate::model::{Absence, Device, NetworkModel};
use branch::{Branch, absence, passed, silent_branches};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "H102",
    name: "not-answering",
    severity: Severity::Error,
    class: Class::Hardware,
    source: include_str!("not_answering.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

/// A link that was lost so often flaps.
const FLAPS: usize = 3;
/// The next step where the wiring is not known.
const NAME_PROJECT: &str = "Name the project or ENI, `--project FILE`: it has the wiring.";
/// SubDevices are asked in turn: who falls silent within this time did so at once.
const AT_ONCE: Span = Span::ms(200);

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let model = view.model;
    let away = || model.devices.iter().filter_map(|device| Some((device, absence(view, device)?)));
    if away().next().is_none() {
        return;
    }
    let down: Vec<usize> = LinkLosses::all(model)
        .iter()
        .filter(|drops| drops.is_down)
        .map(|drops| drops.link)
        .collect();
    let is_cut_off = |node: usize| {
        model.tree.as_ref().filter(|tree| node < tree.len()).is_some_and(|tree| {
            let mut way = tree.path_to(node).into_iter();
            way.any(|node| tree.link_above(node).is_some_and(|link| down.contains(&link)))
        })
    };
    let passed = passed(view);
    let is_passed = |id: &DeviceId| passed.iter().any(|branch| branch.devices.contains(id));
    let (restarted, branches): (Vec<Branch>, Vec<Branch>) = silent_branches(view)
        .into_iter()
        .filter(|branch| !branch.devices.iter().all(is_passed))
        .partition(|branch| branch.was_without_supply(model));
    conditions.extend(passed.iter().map(|branch| lost_addresses(model, branch)));
    let (together, apart): (Vec<&Branch>, Vec<&Branch>) =
        branches.iter().partition(|branch| fell_with_others(branch, &branches));
    conditions.extend(several(model, &together));
    conditions.extend(apart.iter().map(|branch| cut_off(model, branch)));
    conditions.extend(restarted.iter().map(|branch| without_supply(model, branch)));
    for (device, absence) in away() {
        // The link says it all of one alone, and the first one without supply all of those behind it.
        let is_told = |branch: &Branch| branch.devices.contains(&device.id);
        if branches.iter().any(|branch| branch.devices == [device.id])
            || restarted.iter().chain(&passed).any(is_told)
        {
            continue;
        }
        let is_cut_off = is_cut_off(device.id.index()) || branches.iter().any(is_told);
        conditions.push(alone(model, device, &absence, is_cut_off));
    }
}

/// One that does not answer.
fn alone(model: &NetworkModel, device: &Device, absence: &Absence, is_cut_off: bool) -> Condition {
    let silent = absence.since;
    let label = model.label(device.id);
    let text = match absence.ended {
        None => format!("{label} does not answer"),
        Some(ended) => {
            format!("{label} did not answer for {}, then again", ended.since(silent.at))
        }
    };
    let mut condition = alone_causes(model, device, absence, is_cut_off)
        .confirmed(silent.at)
        .about([Symptom::Silent(device.id)])
        .explaining([
            Symptom::WorkingCounter(device.id),
            Symptom::StateLost(device.id),
            Symptom::Mailbox(device.id),
        ])
        .shown_by(Evidence::register(device.id, table::AL_STATUS.address, &silent, text));
    if let Some(ended) = absence.ended {
        condition = condition.ended(ended);
    }
    // Another tool's list says at once who is gone: those behind went with it.
    if model.traffic.recording.frames() == 0 && !is_cut_off {
        condition = condition.explaining(behind(model, device.id));
    }
    condition
}

fn alone_causes(
    model: &NetworkModel,
    device: &Device,
    absence: &Absence,
    is_cut_off: bool,
) -> Condition {
    let (silent, label) = (absence.since, model.label(device.id));
    let place = Place::device(model.network, device.id);
    let new = |cause| Condition::new(&PAGE, place, cause, silent.at);
    if is_cut_off {
        // Why is for the finding above.
        return new(FaultName::LinkOpen).confidence(0.6).or(FaultName::DeviceOff, 0.3);
    }
    let Some(seen) = device.lost_address.filter(|seen| seen.at >= silent.at) else {
        return new(FaultName::DeviceOff)
            .confidence(0.5)
            .or(FaultName::LinkOpen, 0.25)
            .or(FaultName::BrownOut, 0.1)
            .advise(format!("Look at {label} and at the way to it: lamps, supply, plugs."));
    };
    let text = format!(
        "{label} answers at its position without its station address: it was without supply, or its \
         controller was reset; an open link leaves the address as it is"
    );
    new(FaultName::DeviceOff)
        .confidence(0.5)
        .or(FaultName::BrownOut, 0.3)
        .or(FaultName::SupplyOff, 0.1)
        .advise(look_at_supply(&label))
        .shown_by(Evidence::register(device.id, table::STATION_ADDRESS.address, &seen, text))
}

fn look_at_supply(label: &str) -> String {
    format!("Look at the supply of {label}: its plug, its terminals, its fuse.")
}

/// Some that do not answer to their addresses though frames go through the first of them.
fn lost_addresses(model: &NetworkModel, branch: &Branch) -> Condition {
    let since = branch.since;
    let first = branch.devices.first().copied().unwrap_or_default();
    let label = model.label(first);
    let others = match branch.devices.len() {
        0 | 1 => String::new(),
        count => format!(" and {} that follow upon it", count - 1),
    };
    let to = branch.passed_to.map_or_else(String::new, |(id, seen)| {
        format!(" to {}, which has answered since (at {})", model.label(id), seen.at)
    });
    let text = format!(
        "{label}{others} do not answer to their station addresses, and frames go through {label}{to}: it has supply, \
         and has lost its address by starting anew"
    );
    let all = branch.devices.iter().copied();
    let mut condition =
        Condition::new(&PAGE, Place::device(model.network, first), FaultName::BrownOut, since.at)
            .confidence(0.6)
            .or(FaultName::DeviceOff, 0.15)
            .or(FaultName::SupplyOff, 0.1)
            .confirmed(since.at)
            .about([Symptom::Silent(first)])
            .explaining(all.flat_map(follows_from_silence))
            .shown_by(Evidence::register(first, table::STATION_ADDRESS.address, &since, text))
            .advise(look_at_supply(&label))
            .advise(
                "Let the MainDevice set it up again, or start the MainDevice anew: without address it takes no part.",
            );
    if first.index() == 0 {
        // Without it nothing at all came back.
        condition =
            condition.explaining([Symptom::NobodyAnswers, Symptom::FramesLost, Symptom::NoCarrier]);
    }
    condition
}

/// What follows when a SubDevice does not answer.
fn follows_from_silence(id: DeviceId) -> [Symptom; 4] {
    [Symptom::Silent(id), Symptom::WorkingCounter(id), Symptom::StateLost(id), Symptom::Mailbox(id)]
}

/// The first of some that fell silent together and have started anew.
fn without_supply(model: &NetworkModel, branch: &Branch) -> Condition {
    let since = branch.since;
    let first = branch.devices.first().copied().unwrap_or_default();
    let label = model.label(first);
    let behind = match branch.devices.len() {
        0 | 1 => String::new(),
        count => format!(" and {} behind it", count - 1),
    };
    let lasted = match branch.ended {
        Some(ended) => format!(" for {}", ended.since(since.at)),
        None => String::new(),
    };
    let text = format!(
        "{label}{behind} did not answer{lasted}, and what has answered since has started anew: an open link \
         leaves states and station addresses as they are"
    );
    let all = branch.devices.iter().copied();
    let condition =
        Condition::new(&PAGE, Place::device(model.network, first), FaultName::DeviceOff, since.at)
            .confidence(0.4)
            .or(FaultName::SupplyOff, 0.3)
            .or(FaultName::BrownOut, 0.2)
            .confirmed(since.at)
            .about([Symptom::Silent(first)])
            .explaining(all.flat_map(follows_from_silence))
            .shown_by(Evidence::register(first, table::AL_STATUS.address, &since, text))
            .advise(look_at_supply(&label));
    match branch.ended {
        Some(ended) => condition.ended(ended),
        None => condition,
    }
}

/// Tells whether a branch is silent since the same time as another one.
fn fell_with_others(branch: &Branch, all: &[Branch]) -> bool {
    let lasts = |one: &Branch| one.ended.is_none();
    let near = |one: Instant, other: Instant| one.since(other).max(other.since(one)) <= AT_ONCE;
    let others = all.iter().filter(|other| other.devices != branch.devices && lasts(other));
    lasts(branch) && others.map(|other| other.since.at).any(|at| near(at, branch.since.at))
}

/// Several branches that fell silent at once, with others between them that answer: what they have in common is a supply.
fn several(model: &NetworkModel, branches: &[&Branch]) -> Option<Condition> {
    let first = branches.first()?;
    let entry = place_of(model, first)?;
    let since = branches.iter().map(|branch| branch.since).min_by_key(|seen| seen.at)?;
    let heads = || branches.iter().filter_map(|branch| branch.devices.first().copied());
    let head = heads().next()?;
    let names: Vec<String> = heads().map(|id| model.label(id)).collect();
    let text = format!(
        "SubDevices do not answer in {} places at once, from {} on, with others between them that do: one link cannot do \
         that",
        branches.len(),
        names.join(", ")
    );
    let all = || branches.iter().flat_map(|branch| branch.devices.iter().copied());
    let place = Place::device(model.network, head);
    let mut condition = Condition::new(&PAGE, place, FaultName::SupplyOff, since.at)
        .confidence(0.5)
        .or(FaultName::DeviceOff, 0.15)
        .or_at(FaultName::LinkOpen, entry, 0.1)
        .confirmed(since.at)
        .about(all().map(Symptom::Silent))
        .explaining(all().flat_map(follows_from_silence))
        .shown_by(Evidence::register(head, table::AL_STATUS.address, &since, text));
    for other in heads().skip(1) {
        condition = condition.or_at(FaultName::SupplyOff, Place::device(model.network, other), 0.1);
    }
    condition = condition
        .advise(format!("Measure the supply that {} have in common.", names.join(", ")))
        .advise(format!("Where that is well, look at the plugs and the cable of {entry}."));
    if first.link.is_none() {
        condition = condition.advise(NAME_PROJECT);
    }
    Some(condition)
}

/// The link that a branch hangs behind, by the end that is known.
fn place_of(model: &NetworkModel, branch: &Branch) -> Option<Place> {
    let direction = Some(LinkDirection::Both);
    if let Some(link) = branch.link {
        return Some(Place::link(model.network, link, direction));
    }
    // Frames come in by port A.
    let a = End::Controller(*branch.devices.first()?, Port::A);
    Some(Place::Link { network: model.network, a, b: None, direction })
}

/// One link, and all behind it silent.
fn cut_off(model: &NetworkModel, branch: &Branch) -> Condition {
    let since = branch.since;
    let first = branch.devices.first().copied().unwrap_or_default();
    let device = Place::device(model.network, first);
    let direction = Some(LinkDirection::Both);
    let place = place_of(model, branch).unwrap_or(device);
    // A link that comes and goes takes the same shares from process data, again and again.
    let outages = model.cyclic.iter().map(|cyclic| cyclic.wkc.deficits().len()).max().unwrap_or(0);
    let flaps = outages >= FLAPS;
    let mut text = silence_text(model, branch);
    if let Some(ended) = branch.ended {
        text = format!("{text}; for {}, then again", ended.since(since.at));
    }
    if flaps {
        text = format!("{text}; process data lacked shares {outages} times");
    }
    let (open, off, supply) = match branch.link {
        Some(_) if branch.is_on_terminal_bus => (0.5, 0.35, 0.05),
        Some(_) => (0.6, 0.25, 0.1),
        None => (0.5, 0.2, 0.1),
    };
    let causes = match flaps {
        true => Condition::new(&PAGE, place, FaultName::LinkFlapping, since.at)
            .confidence(0.5)
            .or(FaultName::LinkOpen, 0.25)
            .or_at(FaultName::BrownOut, device, 0.1),
        false => Condition::new(&PAGE, place, FaultName::LinkOpen, since.at)
            .confidence(open)
            .or_at(FaultName::DeviceOff, device, off)
            .or_at(FaultName::SupplyOff, device, supply),
    };
    // As on a line without branches.
    let before = first.index().checked_sub(1).filter(|_| branch.link.is_none());
    let causes = match before.map(|index| DeviceId(index as u32)) {
        None => causes,
        Some(before) => {
            let a = End::Controller(before, Port::B);
            let b = Some(End::Controller(first, Port::A));
            let link = Place::Link { network: model.network, a, b, direction };
            causes.or_at(FaultName::LinkOpen, link, 0.15)
        }
    };
    let label = model.label(first);
    let all = branch.devices.iter().copied();
    let condition = causes
        .confirmed(since.at)
        .about(all.clone().map(Symptom::Silent))
        .explaining(all.flat_map(follows_from_silence))
        .shown_by(Evidence::register(first, table::AL_STATUS.address, &since, text))
        .advise(format!("Look at {label}: if no lamp is lit, measure its supply first."));
    let condition = match branch.link {
        Some(_) => condition.advise(format!("Look at the plugs and the cable of {place}.")),
        None => condition
            .advise(format!(
                "Follow the way into {label}: plugs, cable or contact, to where it comes from."
            ))
            .advise(NAME_PROJECT),
    };
    match branch.ended {
        Some(ended) => condition.ended(ended),
        None => {
            let mut condition = condition;
            condition.evidence.extend(cut_distance::evidence(model, since.at));
            condition
        }
    }
}

/// Who does not answer, in words.
fn silence_text(model: &NetworkModel, branch: &Branch) -> String {
    let label = |id: Option<&DeviceId>| model.label(id.copied().unwrap_or_default());
    let first = label(branch.devices.first());
    match (branch.devices.len(), branch.link) {
        (1, Some(_)) => format!("{first} does not answer, and whoever is before it does"),
        (1, None) => format!(
            "{first} does not answer, and whoever is before it does; what it hangs on was not seen"
        ),
        (count, Some(_)) => format!(
            "{first} and {} behind it do not answer, and whoever is before them does",
            count - 1
        ),
        (count, None) => format!(
            "{count} SubDevices that follow upon one another do not answer, from {first} to {}, and whoever is \
             before them does; what {first} hangs on was not seen",
            label(branch.devices.last())
        ),
    }
}

/// What follows behind a silent SubDevice.
fn behind(model: &NetworkModel, id: DeviceId) -> impl Iterator<Item = Symptom> {
    let tree =
        model.tree.as_ref().filter(|tree| tree.closes_at().is_none() && id.index() < tree.len());
    let above = tree.and_then(|tree| tree.upstream(id.index())?.node());
    let is_head =
        above.and_then(|node| model.devices.get(node)).is_some_and(|one| one.silent.is_none());
    let nodes = tree.filter(|_| is_head).map(|tree| tree.subtree(id.index())).unwrap_or_default();
    let others = nodes.iter().map(|node| DeviceId(*node as u32)).filter(move |other| *other != id);
    others.flat_map(|id| [Symptom::Silent(id), Symptom::WorkingCounter(id), Symptom::StateLost(id)])
}
