//! # A SubDevice started anew
//!
//! A SubDevice is back in INIT, or in another lower state, and nobody asked for it; it signals no error.
//!
//! **How it is found.** AL status (0x0130) falls while AL control (0x0120) last asked for the state
//! before. A controller that starts anew comes up in INIT with its station address, its SyncManagers and
//! its counters cleared, so it answers only to its position at first, and its neighbours have lost the
//! links to it for a while. Links that are lost while the device keeps its state are no restart.
//!
//! How long the supply was away its own clock tells, which begins at 0 when the controller comes up, whatever time its links
//! take after that; live, the diagnosis reads it (0x0910).
//!
//! **What it means.** For a fall to INIT the supply was gone: for a moment (brown-out), or for longer
//! (device or supply off). When several SubDevices fall at the same moment, they share the supply that
//! failed. When all terminals of a coupler fall, or all from one of them to the end, and the coupler does not,
//! it is the voltage of their terminal bus: an overload. Without its load that is back at once: terminals that were away together for
//! longer than a second have lost their supply. A fall to another state without an error code is the doing of the firmware. The links that
//! the device lost meanwhile are listed beneath.
//!
//! **What to do.** Measure the supply of the SubDevice under load, at the device; look what is switched
//! at these moments.

mod card;
mod links;
mod supply;
mod terminal_bus;
mod unseen;

use std::collections::BTreeSet;

use linesman_config::fault::{Class, FaultName};
use linesman_proto::address::{DeviceId, RegisterAddress};
use linesman_proto::port::Port;
use linesman_proto::state::AlState;
use linesman_proto::state::status_code::Class as CodeClass;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::End;

use super::{Rule, RulePage, View, link_lost};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};
use crate::model::{Absence, AlChange, AlError, Device, NetworkModel, Seen, is_on_terminal_bus};

/// Back in INIT.
pub const RESTARTED: RulePage = RulePage {
    code: "H150",
    name: "restarted",
    severity: Severity::Error,
    class: Class::Hardware,
    source: include_str!("restarted.rs"),
};

/// In another lower state.
pub const FELL: RulePage = RulePage {
    code: "S205",
    name: "state-fell",
    severity: Severity::Error,
    class: Class::Software,
    source: include_str!("restarted.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[RESTARTED, FELL], judge };

const AL_STATUS: RegisterAddress = RegisterAddress(0x0130);
/// Outages that follow so close on each other have one cause; states are polled one after the other.
const TOGETHER: Span = Span::ms(500);
/// An outage that ended so long before the state was seen may belong to it: addresses are given and
/// states read only after a scan.
const BEFORE: Span = Span::s(3);
/// A supply that is back within a second dipped (IEC 61000-4-29 tests DC ports with dips and short interruptions of up
/// to a second); one that stays away for longer failed.
const DIP: Span = Span::s(1);
/// Links of cables come up in 0.3 to 5 s. Where nothing tells how long those of a line need, an outage that is longer than
/// this is more likely a failure that was followed by a short negotiation than a dip followed by a long one.
const LONG: Span = Span::ms(2500);

/// Lost-link counters are read in turn: one may show the outage so long after it.
const LINKS_COUNTED: Span = Span::s(3);

/// A fall, with the time in which the device was gone.
#[derive(Clone, Copy)]
struct Fall<'a> {
    device: &'a Device,
    change: &'a AlChange,
    is_restart: bool,
    gone: Option<(Instant, Instant)>,
    /// When the card that is plugged to it lost its link, if that was then.
    card_lost: Option<Instant>,
}

impl Fall<'_> {
    fn began(&self) -> Instant {
        let noticed = self.gone.map_or(self.change.at, |(since, _)| since);
        self.card_lost.map_or(noticed, |lost| lost.min(noticed))
    }

    /// Whether both were on their way down and up at the same time: a device without supply of its own
    /// goes with the one that feeds it, and is seen to have fallen only after that one is back.
    fn overlaps(&self, other: &Self) -> bool {
        self.began() <= other.change.at + TOGETHER && other.began() <= self.change.at + TOGETHER
    }

    /// True if the supply was away for longer than a dip, as far as the outage and the time that a link needs tell.
    fn was_long(&self, model: &NetworkModel, together: &[Self]) -> bool {
        let Some((since, until)) = self.gone else { return false };
        // No card waits so long for its link alone.
        if until.since(self.began()) >= link_lost::SLOWEST_LINK_UP {
            return true;
        }
        let node = self.device.id.index();
        let above = model.tree.as_ref().filter(|tree| node < tree.len());
        let above = above.and_then(|tree| tree.upstream(node)?.node());
        // An outage in front of it hides how long it was away.
        if above.is_some_and(|above| was_cut_off(&model.devices[above], since, until)) {
            return false;
        }
        let is_alone = !together.iter().any(|other| Some(other.device.id.index()) == above);
        // Who starts anew again and again has a supply that dips again and again.
        let falls = self.device.al.changes.iter().filter(|change| change.is_own_fall()).count();
        // A contact of the terminal bus has its link at once, if the one before kept its own.
        let bound = if falls > 1 {
            LONG
        } else if is_alone && is_on_terminal_bus(model, node) {
            DIP
        } else {
            shortest_outage(model).map_or(LONG, |link_up| LONG.min(link_up + DIP))
        };
        until.since(since) >= bound
    }
}

/// True if a SubDevice that kept its supply did not answer in all of this time.
fn was_cut_off(device: &Device, since: Instant, until: Instant) -> bool {
    let has_fallen =
        device.al.changes.iter().any(|change| change.is_own_fall() && change.at >= since);
    let covers = |absence: &Absence| {
        absence.since.at <= since + TOGETHER
            && absence.ended.is_none_or(|ended| ended + TOGETHER >= until)
    };
    !has_fallen && device.joined_absences().iter().any(covers)
}

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let model = view.model;
    let mut falls: Vec<Fall<'_>> = Vec::new();
    for device in &model.devices {
        let mut own = device.al.changes.iter().filter(|change| change.is_own_fall());
        if let Some(change) = own.next_back() {
            // Who was gone and is seen on its way up again was in INIT in between, read or not.
            let gone = outage(model, device, change);
            let is_cut = model.traffic.recording.cut() > 0;
            if (is_cut || gone.is_none()) && model.traffic.may_lack(change.after, change.at) {
                // The order may have been given in a frame that is not in the recording.
                continue;
            }
            let is_restart = change.to.state().state() == Some(AlState::Init) || gone.is_some();
            let card_lost = card::lost(model, device, change);
            falls.push(Fall { device, change, is_restart, gone, card_lost });
        }
    }
    conditions.extend(unseen::restarted(model));
    for fall in &falls {
        let together: Vec<_> = falls
            .iter()
            .filter(|other| other.is_restart && other.overlaps(fall))
            .filter(|other| !supply::are_apart(model, &falls, [fall, other]))
            .copied()
            .collect();
        conditions.push(if fall.is_restart {
            restarted(model, fall, &together, &falls)
        } else {
            fell(model, fall)
        });
    }
}

/// What a restart of a SubDevice brings about for itself.
fn follows_from_restart(id: DeviceId) -> [Symptom; 5] {
    [
        Symptom::Silent(id),
        Symptom::StateLost(id),
        Symptom::WorkingCounter(id),
        Symptom::Mailbox(id),
        Symptom::Emergency(id),
    ]
}

/// When the device was gone before it came back in INIT: as long as a neighbour had no link to it, the
/// one before it first of all, or, where that is not known, as long as it did not answer. Neighbours
/// behind it tell in a ring alone: elsewhere they are gone with it.
fn outage(model: &NetworkModel, device: &Device, change: &AlChange) -> Option<(Instant, Instant)> {
    let is_recent =
        |since: Instant, until: Instant| since <= change.at && until + BEFORE >= change.at;
    let tree = model.tree.as_ref().filter(|tree| device.id.index() < tree.len());
    let neighbours = tree.into_iter().flat_map(|tree| {
        let node = device.id.index();
        let children = tree.children(node).map(|(port, _)| port);
        let ports: Vec<Port> = std::iter::once(tree.entry(node)).chain(children).collect();
        ports.into_iter().filter_map(|port| model.opposite(device.id, port))
    });
    for end in neighbours {
        let End::Controller(neighbour, port) = end else { continue };
        let Some(neighbour) = model.device(neighbour) else { continue };
        let mut down = None;
        let mut latest = None;
        for seen in &neighbour.dl.changes {
            let is_active = seen.to.port_state(port).is_active();
            match (down, is_active) {
                (None, false) if seen.from.port_state(port).is_active() => down = Some(seen.at),
                (Some(since), true) => {
                    latest =
                        Some((since, seen.at)).filter(|_| is_recent(since, seen.at)).or(latest);
                    down = None;
                }
                (None | Some(_), _) => {}
            }
        }
        if latest.is_some() {
            return latest;
        }
    }
    // The first SubDevice has no neighbour before it: without it nothing at all comes back. It misses no
    // request of its own then, but those that it has no address for after its start.
    let silences = model.traffic.losses.silences().iter().rev();
    let silences = silences.map(|one| (one.since.at, one.ended.unwrap_or(change.at)));
    let absences = device.joined_absences().into_iter().rev();
    let absences = absences.map(|absence| (absence.since.at, absence.ended.unwrap_or(change.at)));
    // A recording has nothing of the time in which the card had no link.
    let quiet = model.quiet().map(|pause| (pause.from, pause.to));
    let latest = |(since, until): &(Instant, Instant)| is_recent(*since, *until);
    let mut all = quiet.chain(silences).chain(absences);
    all.find(latest)
}

/// The shortest outage of a cable's link that this line has shown: its links come up in no more than that.
fn shortest_outage(model: &NetworkModel) -> Option<Span> {
    let of_port = |device: &Device, port: Port| {
        let mut down = None;
        let mut shortest: Option<Span> = None;
        for seen in &device.dl.changes {
            match (seen.from.port_state(port).is_active(), seen.to.port_state(port).is_active()) {
                // Who was away itself does not know since when.
                (true, false) => {
                    let was_away = device.absences.iter().any(|one| one.disturbs(seen.at));
                    down = Some(seen.at).filter(|_| !was_away);
                }
                (false, true) => {
                    let lasted = down.take().map(|since| seen.at.since(since));
                    shortest = shortest.into_iter().chain(lasted).min();
                }
                (true, true) | (false, false) => {}
            }
        }
        shortest
    };
    let is_cable = |device: &Device, port: Port| {
        let behind = model.opposite(device.id, port).and_then(|end| end.node());
        [Some(device.id), behind.filter(|_| port != Port::A)]
            .into_iter()
            .flatten()
            .all(|id| !is_on_terminal_bus(model, id.index()))
    };
    let ports = |device| Port::ALL.into_iter().map(move |port| (device, port));
    let all = model.devices.iter().flat_map(ports);
    all.filter(|(device, port)| is_cable(device, *port))
        .filter_map(|(device, port)| of_port(device, port))
        .min()
}

fn restarted(
    model: &NetworkModel,
    fall: &Fall<'_>,
    together: &[Fall<'_>],
    falls: &[Fall<'_>],
) -> Condition {
    let device = fall.device;
    let is_several = together.len() > 1;
    let is_first = together.iter().all(|other| device.id <= other.device.id);
    let common_feeder = is_first.then(|| terminal_bus::common_feeder(model, together)).flatten();
    // One at the end of a bus that dips again and again is missed until it stays: its last start is not the first one.
    let aways = together.iter().filter_map(supply::away);
    let away = if common_feeder.is_some() { aways.min() } else { aways.max() };
    let was_long = match away {
        Some(away) => away >= DIP,
        None => together.iter().any(|one| one.was_long(model, together)),
    };
    // Without its load the voltage of an overloaded bus is back at once: it dips, again and again.
    let feeder = common_feeder.filter(|_| !was_long);
    let (cause, others) = match (was_long, is_several) {
        _ if feeder.is_some() => {
            (FaultName::EbusOverload, [(FaultName::BrownOut, 0.2), (FaultName::SupplyOff, 0.1)])
        }
        (true, true) => {
            (FaultName::SupplyOff, [(FaultName::BrownOut, 0.15), (FaultName::DeviceOff, 0.1)])
        }
        (true, false) => {
            (FaultName::DeviceOff, [(FaultName::BrownOut, 0.15), (FaultName::SupplyOff, 0.1)])
        }
        (false, _) => {
            (FaultName::BrownOut, [(FaultName::DeviceOff, 0.15), (FaultName::FirmwareFault, 0.1)])
        }
    };
    let place = Place::device(model.network, feeder.unwrap_or(device.id));
    let mut condition = Condition::new(&RESTARTED, place, cause, fall.began())
        .confidence(0.7)
        .confirmed(fall.change.at)
        .shown_by(state_evidence(fall));
    for (cause, confidence) in others {
        condition = condition.or(cause, confidence);
    }
    if let Some(overloaded) = common_feeder.filter(|_| feeder.is_none()) {
        let overloaded = Place::device(model.network, overloaded);
        condition = condition.or_at(FaultName::EbusOverload, overloaded, 0.1);
    } else if feeder.is_none() && is_on_terminal_bus(model, device.id.index()) {
        // Terminals that lose the voltage of the E-bus start anew, whatever took it.
        condition = condition.or(FaultName::EbusOverload, 0.05);
    }
    if let Some((since, until)) = fall.gone {
        let text = format!(
            "{} was gone for {:.0} ms before that",
            model.label(device.id),
            until.since(since).as_secs_f64() * 1000.0
        );
        let seen = Seen::new((), since, None);
        condition = condition.shown_by(Evidence::register(device.id, AL_STATUS, &seen, text));
    }
    condition.evidence.extend(supply::evidence(model, fall));
    if is_first {
        let mut follows = BTreeSet::new();
        for other in together {
            follows.extend(consequences(model, other, together, falls));
            if other.device.id != device.id {
                follows.insert(Symptom::StateLost(other.device.id));
            }
        }
        condition = condition.explaining(follows);
    } else {
        condition = condition
            .about([Symptom::StateLost(device.id)])
            .explaining(consequences(model, fall, together, falls));
    }
    if is_back(fall)
        && let Some(status) = device.al.status
    {
        condition = condition.ended(status.at);
    }
    if let Some(feeder) = feeder {
        return condition
            .advise(format!(
                "Add up the currents that the terminals behind {} take (`linesman plan`): from where the sum exceeds \
                 what it supplies, insert a power feed terminal.",
                model.label(feeder)
            ))
            .advise("Take off the terminal that was added last, or the last ones, and look again.")
            .advise(format!("Exchange {}, whose supply of the terminal bus may be weak.", model.label(feeder)));
    }
    if is_several {
        condition = condition.advise(
            "Several SubDevices started anew at the same moment: look for the supply that they share.",
        );
    }
    condition
        .advise("Measure the supply of this SubDevice under load, at its terminals.")
        .advise("Check plug and clamp of the supply; move them while watching the line.")
        .advise("Look what is switched on at the moments of the restarts.")
}

/// All that a device without power brings about.
fn consequences(
    model: &NetworkModel,
    fall: &Fall<'_>,
    together: &[Fall<'_>],
    falls: &[Fall<'_>],
) -> Vec<Symptom> {
    let id = fall.device.id;
    let mut follows = links::lost_with(model, fall, together, falls);
    let own = [Symptom::Silent(id), Symptom::WorkingCounter(id), Symptom::Emergency(id)];
    follows.extend(own);
    follows.extend(out_of_step(model, fall.device));
    if let Some(tree) = model.tree.as_ref().filter(|tree| id.index() < tree.len()) {
        for behind in tree.subtree(id.index()).iter().map(|node| DeviceId(*node as u32)) {
            if behind != id {
                follows.extend([
                    Symptom::Silent(behind),
                    Symptom::WorkingCounter(behind),
                    Symptom::StateLost(behind),
                    Symptom::Emergency(behind),
                ]);
            }
        }
        if tree.upstream(id.index()).is_some_and(|end| end.node().is_none()) {
            follows.extend([Symptom::NoCarrier, Symptom::NobodyAnswers]);
            if fall.gone.is_some() {
                follows.push(Symptom::FramesLost);
            }
        }
    }
    // Its own fall is what it is about, not what follows.
    follows.retain(|symptom| *symptom != Symptom::StateLost(id));
    follows
}

/// Who lost step because the reference clock started anew: its time does, too.
fn out_of_step(model: &NetworkModel, device: &Device) -> Vec<Symptom> {
    if !model.references.iter().any(|reference| reference.device == device.id) {
        return Vec::new();
    }
    let falls = || device.al.changes.iter().filter(|change| change.is_own_fall());
    let is_then = |error: &AlError| {
        let at = error.status.at;
        falls().any(|fall| fall.at.before(BEFORE) <= at && at <= fall.at + BEFORE)
    };
    let is_timing = |error: &AlError| {
        error.code.is_some_and(|code| code.value.explain().class == CodeClass::Timing)
    };
    let lost = model.devices.iter().filter(|other| {
        let errors = &other.al.errors;
        other.id != device.id
            && !errors.is_empty()
            && errors.iter().all(|error| is_timing(error) && is_then(error))
    });
    lost.map(|other| Symptom::StateLost(other.id)).collect()
}

fn fell(model: &NetworkModel, fall: &Fall<'_>) -> Condition {
    let id = fall.device.id;
    let place = Place::device(model.network, id);
    let condition = Condition::new(&FELL, place, FaultName::FirmwareFault, fall.change.at)
        .confidence(0.7)
        .or(FaultName::BrownOut, 0.1)
        .confirmed(fall.change.at)
        .shown_by(state_evidence(fall))
        .about([Symptom::StateLost(id)])
        .explaining([Symptom::WorkingCounter(id)])
        .advise("Read the SubDevice's diagnosis history (object 0x10F3), if it has one.")
        .advise("Note its firmware version and ask the manufacturer, with a capture.");
    match fall.device.al.status {
        Some(status) if is_back(fall) => condition.ended(status.at),
        Some(_) | None => condition,
    }
}

fn state_evidence(fall: &Fall<'_>) -> Evidence {
    let change = fall.change;
    let (from, to) = (change.from.state(), change.to.state());
    let text = format!("AL status: {from} before, {to} now, not asked for");
    let seen = Seen::new((), change.at, change.frame);
    Evidence::register(fall.device.id, AL_STATUS, &seen, text)
        .values(Some(u64::from(change.from.0)), Some(u64::from(change.to.0)))
}

/// Whether it is where it was before.
fn is_back(fall: &Fall<'_>) -> bool {
    let state = fall.device.al.state();
    let is_later = fall.device.al.status.is_some_and(|status| status.at > fall.change.at);
    is_later && state >= fall.change.from.state().state()
}
