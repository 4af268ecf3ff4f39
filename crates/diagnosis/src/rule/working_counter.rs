//! # Working counter too low
//!
//! Process data came back with a lower working counter than before: at least one SubDevice did not read
//! or write its share.
//!
//! **How it is found.** Each logical datagram has a working counter that it comes back with while all is
//! well; it is known from the time after the process data were set up. Who owns which part is known from
//! the FMMUs (0x0600 and up) that were seen being written. A SubDevice that gives inputs adds 1; one
//! that takes outputs adds 1 to an LWR and 2 to an LRW. The missing amount and what else is known of the
//! owners (error or fallen state, a lost link on the way, no answer, a processor that has stopped) tell who it is: those whose shares
//! add up to just what is missing, and as few as possible. When the MainDevice itself took a SubDevice
//! out of SAFEOP or OP, a lower working counter is what it wanted. Where nothing else is known, and what is missing is
//! just the share of all behind one link, that link is open: nobody needs to poll states for that.
//!
//! **What it means.** By itself it says only *that* data are missing. Usually another finding says why,
//! and this one is listed beneath it.
//!
//! **What to do.** Look at the SubDevice's state and at the way to it.

mod causes;
mod trailing;

use std::collections::BTreeMap;

use linesman_config::fault::{Class, FaultName};
use linesman_proto::address::DeviceId;
use linesman_proto::time::{Instant, Span};

use self::causes::DeficitSymptom;
use super::{Rule, RulePage, View, processor_stopped};
use crate::finding::{Condition, Evidence, LinkDirection, Place, Severity, Symptom};
use crate::locate::{LinkLosses, cut_distance};
use crate::model::{Cyclic, Deficit, Device, NetworkModel, Owner, Trouble};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "S210",
    name: "working-counter-low",
    severity: Severity::Error,
    class: Class::Software,
    source: include_str!("working_counter.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

/// States and presence are polled more slowly than process data: what is seen of a SubDevice so much
/// earlier or later still belongs to the deficit.
const AROUND: Span = Span::ms(1500);

/// Number of deficits of one datagram that have one cause that comes and goes.
const FLAPS: usize = 3;

/// Time after a deficit by which states and links have been read anew.
const ASKED: Span = Span::ms(200);

/// A deficit that has been over for so long is judged: what was known then of states and links may be forgotten since.
const JUDGED_FOR: Span = Span::ms(2_500);

/// SubDevice, or group of them, that did not do its share.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
struct Suspects {
    /// They are the ones for sure; else one or some of them.
    is_certain: bool,
    devices: Vec<DeviceId>,
    /// Where their shares are just those of all behind a link: such links, most likely first.
    links: Vec<usize>,
}

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    // Datagrams of one device fail together: one finding for each set of suspects.
    let mut groups: BTreeMap<Suspects, Vec<(&Cyclic, &Deficit)>> = BTreeMap::new();
    if view.model.cyclic.iter().all(|cyclic| cyclic.wkc.deficits().is_empty()) {
        return;
    }
    let lost = LinkLosses::all(view.model);
    for cyclic in &view.model.cyclic {
        let is_history =
            |deficit: &&Deficit| deficit.ended.is_some_and(|ended| ended + JUDGED_FOR < view.now);
        let judged = |deficit: &&Deficit| {
            !is_history(deficit) && !may_be_start_up(view.model, cyclic, deficit)
        };
        for deficit in cyclic.wkc.deficits().iter().filter(judged) {
            let explained = explained(conditions, deficit);
            let suspects = suspects(view, &lost, cyclic, deficit, &explained);
            groups.entry(suspects).or_default().push((cyclic, deficit));
        }
    }
    for (suspects, deficits) in &groups {
        conditions.push(condition(view, suspects, deficits));
    }
}

/// Tells whether a working counter that was low from the first frame on may have risen as a MainDevice brought the line
/// up: a SubDevice was seen to go up, or nobody read a state.
fn may_be_start_up(model: &NetworkModel, cyclic: &Cyclic, deficit: &Deficit) -> bool {
    let went_up = |device: &Device| {
        device.al.changes.iter().any(|change| {
            change.from.state().state() < change.to.state().state() && !change.from.error()
        })
    };
    cyclic.wkc.low_before() == Some(deficit)
        && (model.devices.iter().any(went_up)
            || model.devices.iter().all(|device| device.al.status.is_none()))
}

/// SubDevices for whose share other findings of that time account.
fn explained(conditions: &[Condition], deficit: &Deficit) -> Vec<DeviceId> {
    let is_then = |condition: &&Condition| {
        let until = deficit.ended.unwrap_or(Instant::MAX);
        condition.since.before(AROUND) <= until
            && condition.ended.is_none_or(|ended| ended + AROUND >= deficit.first.at)
    };
    let symptoms = conditions.iter().filter(is_then).flat_map(|condition| &condition.explains);
    let mut devices: Vec<DeviceId> = symptoms
        .filter_map(|symptom| {
            if let Symptom::WorkingCounter(device) = symptom { Some(*device) } else { None }
        })
        .collect();
    devices.sort_unstable();
    devices.dedup();
    devices
}

/// Which of the owners can explain what is missing: those with the strongest signs of trouble whose
/// shares add up to just that, and as few as possible.
fn suspects(
    view: &View<'_>,
    lost: &[LinkLosses],
    cyclic: &Cyclic,
    deficit: &Deficit,
    explained: &[DeviceId],
) -> Suspects {
    let model = view.model;
    let missing = deficit.expected - deficit.lowest;
    let owners: Vec<_> = model.owners(cyclic).collect();
    if owners.is_empty() {
        // The set-up was not seen: whoever is in trouble right then, above all who is away.
        let troubled = model
            .devices
            .iter()
            .filter_map(|device| Some((device.id, trouble(device, deficit, view.now)?)));
        let troubled: Vec<(DeviceId, Trouble)> = troubled.collect();
        let is_away = |trouble: &Trouble| matches!(trouble, Trouble::Absent(_));
        let are_away = troubled.iter().any(|(_, trouble)| is_away(trouble));
        let suspected = troubled.iter().filter(|(_, trouble)| !are_away || is_away(trouble));
        let devices: Vec<DeviceId> = suspected.map(|(id, _)| *id).collect();
        return Suspects { is_certain: devices.len() == 1, devices, links: Vec::new() };
    }
    let shares: Vec<(DeviceId, Vec<u16>)> =
        owners.iter().map(|owner| (owner.device, shares(cyclic, owner))).collect();
    let certain = |devices| Suspects { is_certain: true, devices, links: Vec::new() };
    let signs: Vec<OwnerEvidence> =
        owners.iter().map(|owner| sign(view, lost, owner.device, deficit)).collect();
    for least in [
        OwnerEvidence::Error,
        OwnerEvidence::LinkLost,
        OwnerEvidence::Absent,
        OwnerEvidence::Stopped,
    ] {
        let suspected = shares.iter().zip(&signs).filter(|(_, sign)| **sign >= least);
        let suspected: Vec<_> = suspected.map(|(share, _)| share.clone()).collect();
        // Who hangs behind a SubDevice that failed goes with it, and comes back at a time of its own: the
        // lowest working counter may lack any part of them.
        let whole: u16 = suspected.iter().filter_map(|(_, shares)| shares.first()).sum();
        if least > OwnerEvidence::Absent && whole >= missing && is_one_branch(model, &suspected) {
            return certain(suspected.into_iter().map(|(device, _)| device).collect());
        }
        if let Some(devices) = fewest(&suspected, missing) {
            return certain(devices);
        }
    }
    let full = |(_, shares): &(DeviceId, Vec<u16>)| shares.first().copied().unwrap_or(0);
    let in_trouble =
        || shares.iter().zip(&signs).filter(|(_, sign)| **sign >= OwnerEvidence::Absent);
    if in_trouble().map(|(share, _)| full(share)).sum::<u16>() >= missing {
        return certain(in_trouble().map(|(share, _)| share.0).collect());
    }
    if signs.iter().all(|sign| *sign == OwnerEvidence::None)
        && let Some(behind) = trailing::suspects(model, deficit)
    {
        return behind;
    }
    if shares.iter().map(full).sum::<u16>() == missing {
        return certain(owners.iter().map(|owner| owner.device).collect());
    }
    // What another finding takes from it need not be sought elsewhere.
    let of_others = || shares.iter().filter(|(device, _)| explained.contains(device));
    if of_others().map(full).sum::<u16>() >= missing {
        let of_others: Vec<_> = of_others().cloned().collect();
        let all = of_others.iter().map(|(device, _)| *device).collect();
        return certain(fewest(&of_others, missing).unwrap_or(all));
    }
    // One device that fails loses its whole share, or one direction of it.
    let alone = shares.iter().filter(|(_, shares)| shares.contains(&missing));
    let alone: Vec<_> = alone.map(|(device, _)| *device).collect();
    match alone.len() {
        0 => Suspects {
            is_certain: false,
            devices: owners.iter().map(|owner| owner.device).collect(),
            links: Vec::new(),
        },
        1 => certain(alone),
        _ => Suspects { is_certain: false, devices: alone, links: Vec::new() },
    }
}

/// True if all hang behind the first of them.
fn is_one_branch(model: &NetworkModel, suspected: &[(DeviceId, Vec<u16>)]) -> bool {
    let (Some(tree), Some((first, _))) = (&model.tree, suspected.first()) else { return false };
    let branch = tree.subtree(first.index());
    suspected.iter().all(|(device, _)| branch.contains(&device.index()))
}

/// Shares that an owner can miss: its whole share first, then one direction of it.
fn shares(cyclic: &Cyclic, owner: &Owner) -> Vec<u16> {
    let share = |reads, writes| cyclic.command.increment(reads, writes);
    let mut all = vec![share(owner.reads, owner.writes)];
    for part in [share(owner.reads, false), share(false, owner.writes)] {
        if part > 0 && !all.contains(&part) {
            all.push(part);
        }
    }
    all
}

/// The fewest devices whose shares add up to just `missing`; whole shares are preferred.
fn fewest(shares: &[(DeviceId, Vec<u16>)], missing: u16) -> Option<Vec<DeviceId>> {
    let missing = usize::from(missing);
    let whole: usize =
        shares.iter().filter_map(|(_, all)| all.first()).map(|at| usize::from(*at)).sum();
    if whole == missing {
        return Some(shares.iter().map(|(device, _)| *device).collect());
    }
    // By sum: the fewest devices so far that make it.
    let mut best: Vec<Option<Vec<DeviceId>>> = vec![None; missing + 1];
    best[0] = Some(Vec::new());
    for (device, all) in shares {
        for sum in (1..=missing).rev() {
            for share in all.iter().map(|share| usize::from(*share)).filter(|share| *share <= sum) {
                let Some(before) = best[sum - share].clone().filter(|with| !with.contains(device))
                else {
                    continue;
                };
                let is_better =
                    best[sum].as_ref().is_none_or(|known| before.len() + 1 < known.len());
                if is_better {
                    best[sum] = Some(before.into_iter().chain([*device]).collect());
                }
            }
        }
    }
    best.pop().flatten().filter(|devices| !devices.is_empty())
}

/// Knowledge of an owner at the time of a deficit, the stronger the later.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
enum OwnerEvidence {
    /// Nothing.
    None,
    /// Its processor has stopped: its share is missing where it held a buffer just then, which nobody gives back
    /// (0x0807 + 8n bit 0). Mostly it held none.
    Stopped,
    /// It did not answer when it was asked; noise takes single answers, too.
    Absent,
    /// It lies behind a link that was lost.
    LinkLost,
    /// It signals an error, or has left its state.
    Error,
}

fn sign(view: &View<'_>, lost: &[LinkLosses], id: DeviceId, deficit: &Deficit) -> OwnerEvidence {
    let Some(device) = view.model.device(id) else { return OwnerEvidence::None };
    let trouble = trouble(device, deficit, view.now);
    if let Some(Trouble::Error(_) | Trouble::Fall(_)) = trouble {
        return OwnerEvidence::Error;
    }
    let (from, to) = around(deficit, view.now);
    let is_behind = |drops: &LinkLosses| {
        let tree = view.model.tree.as_ref()?;
        let behind = tree.links()[drops.link].downstream.node()?;
        Some(tree.subtree(behind).contains(&id.index()))
    };
    let was_lost = |drops: &&LinkLosses| {
        drops.first <= to && (drops.is_down || drops.last.max(drops.first) >= from)
    };
    let mut then = lost.iter().filter(was_lost);
    match (then.any(|drops| is_behind(drops) == Some(true)), trouble) {
        (true, _) => OwnerEvidence::LinkLost,
        (false, Some(_)) => OwnerEvidence::Absent,
        (false, None) if processor_stopped::stood_within(device, from, to) => {
            OwnerEvidence::Stopped
        }
        (false, None) => OwnerEvidence::None,
    }
}

/// The time in which what is seen of a SubDevice belongs to a deficit.
fn around(deficit: &Deficit, now: Instant) -> (Instant, Instant) {
    (deficit.first.at.before(AROUND), deficit.ended.unwrap_or(now) + AROUND)
}

fn trouble(device: &Device, deficit: &Deficit, now: Instant) -> Option<Trouble> {
    let (from, to) = around(deficit, now);
    device.trouble_within(from, to)
}

fn condition(view: &View<'_>, suspects: &Suspects, deficits: &[(&Cyclic, &Deficit)]) -> Condition {
    let model = view.model;
    let since = deficits.iter().map(|(_, deficit)| deficit.first.at).min().unwrap_or_default();
    let total: u64 = deficits.iter().map(|(_, deficit)| deficit.count).sum();
    let lasts = deficits.iter().any(|(_, deficit)| deficit.ended.is_none());
    let ended = deficits.iter().filter_map(|(_, deficit)| deficit.ended).max();
    let first_suspect = suspects.devices.first().and_then(|id| model.device(*id));
    let named = |link: &usize| {
        let link = model.tree.as_ref()?.links().get(*link)?.map(|node| DeviceId(node as u32));
        Some(Place::link(model.network, link, Some(LinkDirection::Both)))
    };
    let links: Vec<Place> = suspects.links.iter().filter_map(named).collect();
    let place = match first_suspect {
        _ if !links.is_empty() => links[0],
        Some(device) if suspects.is_certain => Place::device(model.network, device.id),
        Some(_) | None => Place::Network { network: model.network },
    };
    let known = first_suspect
        .and_then(|device| deficits.iter().find_map(|(_, at)| trouble(device, at, view.now)));
    let link_changed = model.changed_link().filter(|event| {
        deficits.iter().any(|(_, deficit)| {
            let (from, to) = around(deficit, view.now);
            from <= event.at && event.at <= to
        })
    });
    let (has_links, has_changed) = (!links.is_empty(), link_changed.is_some());
    let symptom = symptom(suspects, deficits, known.as_ref(), has_links, has_changed);
    let [(cause, confidence), others @ ..] = symptom.causes();
    let mut condition = Condition::new(&PAGE, place, cause, since).confidence(confidence);
    // Why it is so shows when states and links were read since.
    let is_sure = known.is_some() || view.has_ended || since + ASKED <= view.now;
    if is_sure {
        condition = condition.confirmed(since);
    }
    for (cause, confidence) in others {
        condition = condition.or(cause, confidence);
    }
    for other in links.iter().skip(1).take(3) {
        condition = condition.or_at(FaultName::LinkOpen, *other, 0.05);
    }
    if let Some(link) = links.first() {
        condition = condition.advise(format!(
            "Look at {link}: the lamps on both sides, the plugs, the supply behind."
        ));
    }
    for (cyclic, deficit) in deficits.iter().rev().take(3) {
        condition = condition.shown_by(evidence(model, cyclic, deficit));
    }
    if let Some(event) = link_changed {
        let text = "the frames tell that DL status of a SubDevice has changed then (event field, bit 2): a link came or \
                    went";
        condition = condition.shown_by(Evidence::frame(event.at, event.frame.unwrap_or(0), text));
    }
    if lasts && !links.is_empty() {
        condition.evidence.extend(cut_distance::evidence(model, since));
    }
    // Where one or some of them are it, or the set-up was not seen and they are all that are in trouble, what
    // explains it of each of them explains this, whoever it is.
    condition =
        condition.about(suspects.devices.iter().map(|device| Symptom::WorkingCounter(*device)));
    condition.is_by_sum_alone =
        link_changed.is_none() && (!suspects.is_certain || (known.is_none() && !links.is_empty()));
    if is_sure
        && !lasts
        && let Some(ended) = ended
    {
        condition = condition.ended(ended);
        if total <= 3 {
            condition.severity = Severity::Warning;
        }
    }
    condition
        .advise(read_states(model, suspects))
        .advise("Take no output of this datagram for written and no input for fresh meanwhile.")
}

/// The symptom that deficits show; `known` is trouble that was seen of the first suspect. `has_links` if links are
/// suspected, `has_link_changed` if one is known to have changed then.
fn symptom(
    suspects: &Suspects,
    deficits: &[(&Cyclic, &Deficit)],
    known: Option<&Trouble>,
    has_links: bool,
    has_link_changed: bool,
) -> DeficitSymptom {
    let lasts = deficits.iter().any(|(_, deficit)| deficit.ended.is_none());
    let is_nobody = suspects.devices.is_empty();
    let nobody_known = is_nobody && (lasts || has_link_changed);
    let is_flapping = (has_links || !suspects.is_certain || is_nobody) && deficits.len() >= FLAPS;
    let is_open = suspects.devices.len() > 1 && !suspects.is_certain && !lasts;
    match known {
        None if is_flapping => DeficitSymptom::AgainAndAgain,
        _ if has_links => DeficitSymptom::BehindLink,
        Some(trouble) => DeficitSymptom::of_trouble(trouble),
        None if nobody_known && has_link_changed => DeficitSymptom::LinkChanged,
        None if nobody_known => DeficitSymptom::Nobody,
        None if is_open => DeficitSymptom::Passing,
        None => DeficitSymptom::DeficitAlone,
    }
}

/// Advice to read the states of those that may be the cause.
fn read_states(model: &NetworkModel, suspects: &Suspects) -> String {
    let names: Vec<_> = suspects.devices.iter().map(|id| model.label(*id)).collect();
    let names = names.join(", ");
    match (suspects.devices.is_empty(), suspects.is_certain) {
        (true, _) => {
            "Read AL status and DL status of all SubDevices: who is missing, or not in OP?".into()
        }
        (false, true) => format!("Read AL status (0x0130) and its code of {names}."),
        (false, false) => format!("Read AL status (0x0130) of {names}: one of them is it."),
    }
}

fn evidence(model: &NetworkModel, cyclic: &Cyclic, deficit: &Deficit) -> Evidence {
    let owners: Vec<_> = model.owners(cyclic).map(|owner| model.label(owner.device)).collect();
    let whose = if owners.is_empty() { String::new() } else { format!(" ({})", owners.join(", ")) };
    let until = match deficit.ended {
        Some(at) => format!("{} times until {} ns", deficit.count, at.as_nanos()),
        None => format!("{} times so far", deficit.count),
    };
    let text = format!(
        "{}{whose}: working counter {} instead of {}, {until}",
        cyclic.label(),
        deficit.lowest,
        deficit.expected
    );
    let shown = match deficit.first.frame {
        Some(frame) => Evidence::frame(deficit.first.at, frame, text),
        None => Evidence::host(Some(deficit.first.at), text),
    };
    shown.values(Some(u64::from(deficit.expected)), Some(u64::from(deficit.first.value)))
}
