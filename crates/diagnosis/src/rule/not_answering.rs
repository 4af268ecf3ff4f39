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
//!
//! **What it means.** It is without power, cut off, or has lost its station address by starting anew.
//! When the link to it is lost, that finding stands above this one.
//!
//! **What to do.** Look at the nearest SubDevice before it that answers: the trouble is between the two,
//! or in this one.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::address::DeviceId;
use linesman_proto::port::Port;
use linesman_proto::register::table;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::{End, Link, Tree};

use super::link_lost::is_on_terminal_bus;
use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, LinkDirection, Place, Severity, Symptom};
use crate::line::{Absence, Device, Line, Seen};
use crate::locate::Drops;

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

/// Who did not answer for so long was away.
const LONG: Span = Span::ms(100);
/// A link that was lost so often flaps.
const FLAPS: usize = 3;
/// An absence that has been over for so long is history.
const TOLD_FOR: Span = Span::ms(2_500);

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let line = view.line;
    let away = || line.devices.iter().filter_map(|device| Some((device, absence(view, device)?)));
    if away().next().is_none() {
        return;
    }
    let down: Vec<usize> =
        Drops::all(line).iter().filter(|drops| drops.is_down).map(|drops| drops.link).collect();
    let is_cut_off = |node: usize| {
        line.tree.as_ref().filter(|tree| node < tree.len()).is_some_and(|tree| {
            let mut way = tree.path_to(node).into_iter();
            way.any(|node| tree.link_above(node).is_some_and(|link| down.contains(&link)))
        })
    };
    let branches = silent_branches(view);
    let (restarted, branches): (Vec<Branch>, Vec<Branch>) =
        branches.into_iter().partition(|branch| branch.was_without_supply(line));
    for branch in &branches {
        conditions.push(cut_off(line, branch));
    }
    for branch in &restarted {
        conditions.push(without_supply(line, branch));
    }
    for (device, absence) in away() {
        // The link says it all of one alone, and the first one without supply all of those behind it.
        let is_told = |branch: &Branch| branch.devices.contains(&device.id);
        if branches.iter().any(|branch| branch.devices == [device.id])
            || restarted.iter().any(is_told)
        {
            continue;
        }
        let silent = absence.since;
        let place = Place::device(line.network, device.id);
        let label = line.label(device.id);
        let new = |cause| Condition::new(&PAGE, place, cause, silent.at);
        let is_cut_off = is_cut_off(device.id.index())
            || branches.iter().any(|branch| branch.devices.contains(&device.id));
        let restarted = device.lost_address.filter(|seen| seen.at >= silent.at);
        let mut condition = if let Some(seen) = restarted.filter(|_| !is_cut_off) {
            let address = table::STATION_ADDRESS.address;
            let text = format!(
                "{label} answers at its position without its station address: it was without supply, or its \
                 controller was reset; an open link leaves the address as it is"
            );
            new(FaultName::DeviceOff)
                .confidence(0.5)
                .or(FaultName::BrownOut, 0.3)
                .or(FaultName::SupplyOff, 0.1)
                .advise(format!(
                    "Look at the supply of {label}: its plug, its terminals, its fuse."
                ))
                .shown_by(Evidence::register(device.id, address, &seen, text))
        } else if is_cut_off {
            // Why is for the finding above.
            new(FaultName::LinkOpen).confidence(0.6).or(FaultName::DeviceOff, 0.3)
        } else {
            new(FaultName::DeviceOff)
                .confidence(0.5)
                .or(FaultName::LinkOpen, 0.25)
                .or(FaultName::BrownOut, 0.1)
                .advise(format!("Look at {label} and at the way to it: lamps, supply, plugs."))
        };
        let text = match absence.ended {
            None => format!("{label} does not answer"),
            Some(ended) => {
                let lasted = ended.since(silent.at);
                format!("{label} did not answer for {lasted}, then again")
            }
        };
        let address = table::AL_STATUS.address;
        condition = condition
            .confirmed(silent.at)
            .about([Symptom::Silent(device.id)])
            .explaining([
                Symptom::WorkingCounter(device.id),
                Symptom::StateLost(device.id),
                Symptom::Mailbox(device.id),
            ])
            .shown_by(Evidence::register(device.id, address, &silent, text));
        if let Some(ended) = absence.ended {
            condition = condition.ended(ended);
        }
        // Another tool's list says at once who is gone: those behind went with it.
        if line.traffic.frames == 0 && !is_cut_off {
            condition = condition.explaining(behind(line, device.id));
        }
        conditions.push(condition);
    }
}

/// The absence of a SubDevice that lasts, or was over a moment ago. While addresses are given nobody answers to them
/// for a while.
fn absence(view: &View<'_>, device: &Device) -> Option<Absence> {
    let latest = *device.joined_absences().last()?;
    let Some(ended) = latest.ended else { return Some(latest) };
    let is_told = ended.since(latest.since.at) >= LONG && view.now.since(ended) <= TOLD_FOR;
    is_told.then_some(latest)
}

/// SubDevices that all fell silent behind one link, of which nobody says that it is up.
struct Branch {
    /// The link; `None` where nobody has seen what the first of them hangs on.
    link: Option<Link<DeviceId>>,
    is_on_terminal_bus: bool,
    devices: Vec<DeviceId>,
    since: Seen<()>,
    ended: Option<Instant>,
}

/// All branches that are silent as a whole, or were a moment ago, while whoever is before them answers.
fn silent_branches(view: &View<'_>) -> Vec<Branch> {
    let line = view.line;
    let away: Vec<Option<Absence>> =
        line.devices.iter().map(|device| absence(view, device)).collect();
    let is_silent = |id: &DeviceId| away.get(id.index()).is_some_and(Option::is_some);
    // How many answer says the same, and where.
    if counts_all(line, &away) || line.reported.answering.is_some() {
        return Vec::new();
    }
    let branches = match line.tree.as_ref().filter(|tree| tree.len() <= line.devices.len()) {
        Some(tree) if tree.closes_at().is_some() => return Vec::new(),
        Some(tree) => in_tree(line, tree, &is_silent, &away),
        None => in_order(line, &is_silent, &away),
    };
    branches.into_iter().filter(|branch| !is_up(line, branch)).collect()
}

impl Branch {
    /// Whether one of them has started anew since: it was without supply, and no link that opens does that.
    fn was_without_supply(&self, line: &Line) -> bool {
        let has_restarted = |id: &DeviceId| line.device(*id).is_some_and(Device::has_restarted);
        self.ended.is_some() && self.devices.iter().any(has_restarted)
    }
}

/// The first of some that fell silent together and have started anew.
fn without_supply(line: &Line, branch: &Branch) -> Condition {
    let since = branch.since;
    let first = branch.devices.first().copied().unwrap_or_default();
    let label = line.label(first);
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
        Condition::new(&PAGE, Place::device(line.network, first), FaultName::DeviceOff, since.at)
            .confidence(0.4)
            .or(FaultName::SupplyOff, 0.3)
            .or(FaultName::BrownOut, 0.2)
            .confirmed(since.at)
            .about([Symptom::Silent(first)])
            .explaining(all.flat_map(|id| {
                [
                    Symptom::Silent(id),
                    Symptom::WorkingCounter(id),
                    Symptom::StateLost(id),
                    Symptom::Mailbox(id),
                ]
            }))
            .shown_by(Evidence::register(first, table::AL_STATUS.address, &since, text))
            .advise(format!("Look at the supply of {label}: its plug, its terminals, its fuse."));
    match branch.ended {
        Some(ended) => condition.ended(ended),
        None => condition,
    }
}

/// Whether broadcasts went on counting all: who still counts is there, and has lost its address.
fn counts_all(line: &Line, away: &[Option<Absence>]) -> bool {
    let traffic = &line.traffic;
    let (Some(now), Some(read)) = (traffic.broadcast_now, traffic.broadcast_read) else {
        return false;
    };
    let since = || away.iter().flatten().map(|absence| absence.since.at);
    // Who was not asked again since all were counted may have come back with them.
    let lasts = away.iter().zip(&line.devices).any(|(absence, device)| {
        absence.is_some_and(|absence| absence.ended.is_none())
            && device.last_unanswered.is_none_or(|last| last >= now.at)
    });
    usize::from(now.value) >= line.devices.len()
        && since().max().is_some_and(|latest| read >= latest)
        && (lasts || since().min().is_some_and(|first| now.at < first))
}

fn in_tree(
    line: &Line,
    tree: &Tree,
    is_silent: &dyn Fn(&DeviceId) -> bool,
    away: &[Option<Absence>],
) -> Vec<Branch> {
    let id = |node: usize| DeviceId(node as u32);
    let heads = tree.order().iter().copied().filter(|node| {
        let above = tree.upstream(*node).and_then(|end| end.node());
        above.is_some_and(|above| !is_silent(&id(above)))
            && tree.subtree(*node).iter().all(|node| is_silent(&id(*node)))
    });
    let branch = |head: usize| {
        let link = tree.links().get(tree.link_above(head)?)?.map(id);
        let devices: Vec<DeviceId> = tree.subtree(head).iter().map(|node| id(*node)).collect();
        Some(Branch {
            link: Some(link),
            is_on_terminal_bus: is_on_terminal_bus(line, head),
            since: since(away, &devices)?,
            ended: ended(away, &devices),
            devices,
        })
    };
    heads.filter_map(branch).collect()
}

/// Where nobody has seen the wiring: those that follow upon one another in the order of positions, which is that in which
/// frames reach them, so that all behind a link do. Somebody before them answers.
fn in_order(
    line: &Line,
    is_silent: &dyn Fn(&DeviceId) -> bool,
    away: &[Option<Absence>],
) -> Vec<Branch> {
    let is_away = |device: &Device| is_silent(&device.id);
    // Of whom nothing was heard and who was not asked nobody knows.
    let is_known = |device: &&Device| is_away(device) || device.answered.is_some();
    let known: Vec<&Device> = line.devices.iter().filter(is_known).collect();
    let runs = known.chunk_by(|one, next| is_away(one) == is_away(next));
    let silent = runs.skip(1).filter(|run| run.first().is_some_and(|first| is_away(first)));
    let branch = |run: &[&Device]| {
        let devices: Vec<DeviceId> = run.iter().map(|device| device.id).collect();
        Some(Branch {
            link: None,
            is_on_terminal_bus: false,
            since: since(away, &devices)?,
            ended: ended(away, &devices),
            devices,
        })
    };
    silent.filter(|run| run.len() > 1).filter_map(branch).collect()
}

fn since(away: &[Option<Absence>], devices: &[DeviceId]) -> Option<Seen<()>> {
    let absences = devices.iter().filter_map(|id| away.get(id.index()).copied().flatten());
    absences.map(|absence| absence.since).min_by_key(|seen| seen.at)
}

/// When all of them answered again.
fn ended(away: &[Option<Absence>], devices: &[DeviceId]) -> Option<Instant> {
    let absences = devices.iter().map(|id| away.get(id.index()).copied().flatten());
    let ended: Option<Vec<Instant>> = absences.map(|absence| absence?.ended).collect();
    ended?.into_iter().max()
}

/// Whether the near end says, after all fell silent, that the link is there, or that it is not: then another rule
/// tells of it.
fn is_up(line: &Line, branch: &Branch) -> bool {
    let Some(End::Controller(id, _)) = branch.link.map(|link| link.upstream) else { return false };
    let dl = line.device(id).map(|device| &device.dl).filter(|dl| !dl.is_assumed);
    let read = dl.and_then(|dl| dl.latest_reading);
    read.is_some_and(|read| read >= branch.since.at)
}

/// One link, and all behind it silent.
fn cut_off(line: &Line, branch: &Branch) -> Condition {
    let since = branch.since;
    let first = branch.devices.first().copied().unwrap_or_default();
    let device = Place::device(line.network, first);
    let place = branch
        .link
        .map_or(device, |link| Place::link(line.network, link, Some(LinkDirection::Both)));
    // A link that comes and goes takes the same shares from process data, again and again.
    let outages = line.cyclic.iter().map(|cyclic| cyclic.deficits.len()).max().unwrap_or(0);
    let flaps = outages >= FLAPS;
    let mut text = silence_text(line, branch);
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
            let (a, b) = (End::Controller(before, Port::B), Some(End::Controller(first, Port::A)));
            let direction = Some(LinkDirection::Both);
            let link = Place::Link { network: line.network, a, b, direction };
            causes.or_at(FaultName::LinkOpen, link, 0.15)
        }
    };
    let label = line.label(first);
    let all = branch.devices.iter().copied();
    let condition = causes
        .confirmed(since.at)
        .about(all.clone().map(Symptom::Silent))
        .explaining(all.flat_map(|id| {
            [
                Symptom::Silent(id),
                Symptom::WorkingCounter(id),
                Symptom::StateLost(id),
                Symptom::Mailbox(id),
            ]
        }))
        .shown_by(Evidence::register(first, table::AL_STATUS.address, &since, text))
        .advise(format!("Look at {label}: if no lamp is lit, measure its supply first."));
    let condition = match branch.link {
        Some(_) => condition.advise(format!("Look at the plugs and the cable of {place}.")),
        None => condition
            .advise(format!(
                "Follow the way into {label}: plugs, cable or contact, to where it comes from."
            ))
            .advise("Name the project or ENI, `--project FILE`: it has the wiring."),
    };
    match branch.ended {
        Some(ended) => condition.ended(ended),
        None => condition,
    }
}

/// Who does not answer, in words.
fn silence_text(line: &Line, branch: &Branch) -> String {
    let label = |id: Option<&DeviceId>| line.label(id.copied().unwrap_or_default());
    let first = label(branch.devices.first());
    match (branch.devices.len(), branch.link) {
        (1, _) => format!("{first} does not answer, and whoever is before it does"),
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
fn behind(line: &Line, id: DeviceId) -> impl Iterator<Item = Symptom> {
    let tree =
        line.tree.as_ref().filter(|tree| tree.closes_at().is_none() && id.index() < tree.len());
    let above = tree.and_then(|tree| tree.upstream(id.index())?.node());
    let is_head =
        above.and_then(|node| line.devices.get(node)).is_some_and(|one| one.silent.is_none());
    let nodes = tree.filter(|_| is_head).map(|tree| tree.subtree(id.index())).unwrap_or_default();
    let others = nodes.iter().map(|node| DeviceId(*node as u32)).filter(move |other| *other != id);
    others.flat_map(|id| [Symptom::Silent(id), Symptom::WorkingCounter(id), Symptom::StateLost(id)])
}
