//! # Nobody answers
//!
//! Frames go out, and none comes back; or they come back, and no SubDevice took notice of them.
//!
//! **How it is found.** Requests were seen and not one of them was answered, from the beginning or
//! from some moment on. Nothing on the line can be asked then, so place and cause are a matter of
//! likelihood: the trouble is between the card and the first SubDevice, or in one of them.
//!
//! **What it means.** Usually the first cable is not plugged, is broken, or the first SubDevice has
//! no supply. If the card has a link and frames still vanish, something shows a link that does not
//! forward: a media converter, a switch, a device that is not EtherCAT, or a damaged controller.
//! If that is over again, and no SubDevice has lost a link or started anew meanwhile, no cable was out: for
//! single frames among others that came back it is damage (`H110`, `H112`), for a long silence a false
//! link. Where it was, those tell whose output watchdog expired, and those whose did not: frames reach all that are
//! processed before the hole. More a recording cannot say; `diagnose --active` can while it lasts: it closes ports
//! one after the other, for temporary use (0x0100 bit 1), so that each opens by itself after a second, and sees
//! when frames come back. What was recorded meanwhile tells the same.
//! A few frames that stay away between others that come back are no silence: a first cable that was open needs
//! some tenths of a millisecond at least to carry frames again (IEEE 802.3, 24.3.4.4).
//! If the card counts damaged frames meanwhile, the way round is whole and something on it spoils
//! every frame; which link it is, no counter can be asked.
//! In a ring the frames of card B may come round untouched while those of card A, which SubDevices process,
//! vanish: no link is down, or the ring would have opened; something takes the frames of one direction, or those
//! that go into a branch.
//!
//! **What to do.** Look at the LED of the card and of the IN port of the first SubDevice, then at
//! supply, cable and the choice of the card, in this order.

mod outage_location;
mod restarted;

use linesman_config::fault::{Class, FaultName};
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::register::ErrorCounter;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::End;

use super::link_lost::is_on_terminal_bus;
use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, LinkDirection, LinkEnd, Place, Severity, Symptom};
use crate::locate::LocateInput;
use crate::model::{NetworkModel, Seen, Silence, search};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "H100",
    name: "nobody-answers",
    severity: Severity::Error,
    class: Class::Hardware,
    source: include_str!("nobody_answers.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

/// So many requests in a row without a return are no accident.
pub(super) const CERTAIN: u64 = 8;
/// More in a row than noise takes from a line that still answers.
const LONG: u64 = 32;
/// How likely it is the card.
const CARD: f64 = 0.1;
/// How likely a first device that nobody ever saw is not there, or has a supply that failed with others'.
const NEVER_SEEN: f64 = 0.08;
/// Cards are looked at now and then only: a silence must last so long before their link proves anything.
const CARRIER_LATE: Span = Span::ms(300);
/// So long after its link was lost a card takes no frames any more: drivers look for it every second or two.
const CARRIER_KNOWN: Span = Span::ms(2_200);
/// Ports that were closed in a silence keep it from being one; what follows so soon belongs to it.
const SAME_SILENCE: Span = Span::ms(100);
/// With fewer, the end of the input may have cut off the answer.
const FEW: u64 = 3;
/// A receiver of 100BASE-TX wants a signal for so long at least before its link is up again (IEEE 802.3,
/// 24.3.4.4, stabilize_timer): what was over before was no open link. It is damage, or the computer.
const LINK_UP: Span = Span::us(330);

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let model = view.model;
    let traffic = &model.traffic;
    conditions.extend(told(view));
    // Of frames that were cut off nobody knows whether they were answered.
    if traffic.is_one_sided() || traffic.recording.cut() * 2 > traffic.recording.frames() {
        return;
    }
    // One condition: the latest silence, or the one that lasts.
    let is_long = |silence: &&Silence| match silence.ended {
        Some(ended) => {
            silence.frames >= CERTAIN
                && ended.since(silence.since.at) >= LINK_UP
                && !traffic.recording.was_bad(silence.since.at, ended)
        }
        // A few at the end, where a few were lost all along, are more of the same.
        None => {
            let is_few =
                silence.frames >= FEW && view.has_ended && !is_among_others(model, silence);
            silence.frames >= CERTAIN || is_few
        }
    };
    let swallowed =
        traffic.losses.swallowed().iter().rev().find(|silence| silence.frames >= CERTAIN);
    let silence = traffic.losses.silences().iter().rev().find(is_long);
    if let Some(silence) = silence.into_iter().chain(swallowed).max_by_key(|one| one.since.at) {
        let is_swallowed = swallowed.is_some_and(|one| one.since == silence.since);
        let silence = &searched(model, silence);
        let is_hole = is_swallowed || nothing_was_cut(view, silence);
        let was_searched = model.hole.is_some_and(|hole| hole.since == silence.since);
        if is_hole && !was_searched && is_among_others(model, silence) {
            // Frames are lost here and there: damage, which other rules place.
            return;
        }
        conditions.push(vanished(view, silence, is_hole));
    } else if traffic.datagrams.answered() == 0
        && traffic.returns.count() >= FEW
        && traffic.datagrams.unanswered() >= CERTAIN
    {
        conditions.push(ignored(view));
    }
}

/// Another tool says that none of the SubDevices it knows answers.
fn told(view: &View<'_>) -> Option<Condition> {
    let model = view.model;
    let silent = model.devices.iter().map(|device| device.silent);
    let silent: Vec<Seen<()>> = silent.collect::<Option<_>>()?;
    // Frames tell it themselves; how many answer a broadcast is another rule's.
    if model.traffic.recording.frames() > 0 || model.reported.answering.is_some() {
        return None;
    }
    let at = silent.iter().map(|seen| seen.at).min()?;
    let carrier = model.host.card(Path::A).carrier.map(|carrier| carrier.value);
    let text = match silent.len() {
        1 => "the only SubDevice does not answer".to_owned(),
        count => format!("none of {count} SubDevices answers"),
    };
    let devices = model.devices.iter().map(|device| device.id);
    let follows = devices
        .flat_map(|id| [Symptom::Silent(id), Symptom::WorkingCounter(id), Symptom::StateLost(id)]);
    let condition = cut(model, at, carrier, false)
        .confirmed(at)
        .shown_by(Evidence::host(Some(at), text))
        .about([Symptom::NobodyAnswers])
        .explaining(follows)
        .explaining([Symptom::FramesLost, Symptom::NoCarrier]);
    Some(advise(condition, carrier))
}

/// A silence as it is without the ports that were closed to find its place: frames that come back meanwhile
/// do not end it.
fn searched(model: &NetworkModel, silence: &Silence) -> Silence {
    let mut whole = *silence;
    if let Some(hole) = model.hole.filter(|hole| hole.since.at <= silence.since.at) {
        let is_one = hole.ended.is_none_or(|ended| silence.since.at <= ended + SAME_SILENCE);
        if is_one {
            whole.since = hole.since;
            whole.ended = silence.ended.filter(|_| hole.ended.is_some());
        }
    }
    whole
}

/// The link behind which frames vanish, if it was looked for in this silence and found.
fn found_hole(model: &NetworkModel, silence: &Silence) -> Option<Seen<usize>> {
    // Where nobody tells, frames that came back meanwhile have shown that the card has one.
    let has_link = model.host.card(Path::A).carrier.is_none_or(|carrier| carrier.value);
    model.hole.filter(|hole| hole.since == silence.since && has_link)?.found
}

/// Whether a silence is over, and neither a link nor the first SubDevice was lost meanwhile, as what was
/// read of the first SubDevice since then shows.
fn nothing_was_cut(view: &View<'_>, silence: &Silence) -> bool {
    let model = view.model;
    let (Some(ended), Some(input)) = (silence.ended, LocateInput::of(model, view.has_ended)) else {
        return false;
    };
    let Some(End::Controller(first, port)) = first_end(model) else { return false };
    let Some(device) = model.device(first) else { return false };
    let lost = device.counters.track(ErrorCounter::LostLink(port));
    let was_read = lost.is_some_and(|track| track.last.at > ended);
    let was_card_cut = model.host.card(Path::A).carrier.is_some_and(|carrier| {
        !carrier.value
            || (carrier.at >= silence.since.at && model.host.card(Path::A).carrier_changes > 0)
    });
    let has_fallen = model.devices.iter().any(|device| {
        device.al.changes.iter().any(|change| change.at >= silence.since.at && change.is_own_fall())
    });
    was_read && !was_card_cut && !has_fallen && !input.any_link_changed(silence.since.at, ended)
}

/// Whether other frames were lost than those of a silence, with others coming back between them.
fn is_among_others(model: &NetworkModel, silence: &Silence) -> bool {
    let lost = model.traffic.losses.frames();
    let share = lost.of_spell().saturating_sub(silence.frames);
    share >= FEW && share * 50 >= silence.frames
}

/// Nothing comes back.
fn vanished(view: &View<'_>, silence: &Silence, is_hole: bool) -> Condition {
    let model = view.model;
    let was_answered = model.traffic.datagrams.answered() > 0;
    let carrier = carrier_during(model, silence);
    let since = silence.since;
    let is_swallowed = model.traffic.losses.swallowed().iter().any(|one| one.since == since);
    let text = if is_swallowed {
        format!(
            "from here on {} requests in a row came round as card B had sent them, and not as card A had",
            silence.frames
        )
    } else if was_answered {
        format!("from here on {} requests in a row did not come back", silence.frames)
    } else {
        format!("first of {} requests; none came back", silence.frames)
    };
    let spoiled = model.host.card(Path::A).crc;
    let is_spoiled = spoiled.of_spell() > 0 && spoiled.last.is_some_and(|last| last >= since.at);
    let frame = since.frame.unwrap_or(0);
    let lasted = silence.last.at.since(silence.since.at);
    let found = found_hole(model, silence);
    let restarted = restarted::others_with(model, silence);
    let mut condition = match (found, is_spoiled, is_hole) {
        _ if let Some((count, seen)) = restarted => {
            restarted::without_supply(model, silence, count, seen)
        }
        (Some(found), ..) => placed(model, since.at, found),
        (None, true, _) => spoiling(model, since.at),
        (None, false, true) => hole(view, silence),
        (None, false, false) => {
            let carrier = carrier.filter(|_| lasted >= CARRIER_LATE);
            // A search that closed ports in vain leaves the first link.
            cut(model, since.at, carrier, search::began(model, silence).is_some())
        }
    };
    condition = condition.shown_by(Evidence::frame(since.at, frame, text));
    if is_spoiled {
        let text = format!(
            "the card received {} damaged frames meanwhile: the way round is whole, but something on \
             it spoils every frame",
            spoiled.of_spell()
        );
        condition = condition.shown_by(Evidence::host(spoiled.last, text));
    }
    if was_answered && let Some(returned) = model.traffic.returns.latest() {
        let frame = returned.frame.unwrap_or(0);
        let text = "the last frame that came back".to_owned();
        if returned.at <= since.at {
            condition = condition.shown_by(Evidence::frame(returned.at, frame, text));
        }
    }
    if let Some(carrier) = carrier {
        let told = model.host.card(Path::A).carrier.map(|carrier| carrier.at);
        let text = match (carrier, told) {
            (true, Some(_)) => "card A has a link",
            (true, None) if search::began(model, silence).is_some() => {
                "ports were closed meanwhile to find the place: who does so has a link"
            }
            (true, None) => "frames went on leaving the card, and none leaves one without a link",
            (false, _) => "card A had no link meanwhile",
        };
        let began = search::began(model, silence).map(|began| began.at);
        let at = told.or(began).or(Some(silence.last.at));
        condition = condition.shown_by(Evidence::host(at, text));
    }
    if silence.frames >= CERTAIN || view.has_ended {
        condition = condition.confirmed(silence.last.at);
    }
    if let Some(ended) = silence.ended {
        condition = condition.ended(ended);
    }
    // Frames that are damaged on their way are missing, too, and a few in a row may be noise.
    let may_be_noise = was_answered && (silence.ended.is_some() || silence.frames < LONG);
    let symptom = if may_be_noise { Symptom::FramesLost } else { Symptom::NobodyAnswers };
    condition = condition.about([symptom]);
    let devices = model.devices.iter().map(|device| device.id);
    let follows = devices.flat_map(|id| {
        [
            Symptom::Silent(id),
            Symptom::WorkingCounter(id),
            Symptom::StateLost(id),
            Symptom::Emergency(id),
        ]
    });
    condition = condition.explaining(follows);
    condition = condition.explaining([Symptom::FramesLost, Symptom::NoCarrier]);
    if is_spoiled && !may_be_noise {
        condition = condition.explaining([Symptom::CardErrors]);
    }
    if is_spoiled {
        return condition
            .advise(
                "Take SubDevices away from the far end, or plug the cable behind the first half \
                 out: when frames come back, what spoils them lies behind.",
            )
            .advise("Then read the error counters: they name the link.");
    }
    if found.is_none() && was_answered && carrier == Some(true) && silence.ended.is_none() {
        condition = condition.advise(
            "While it lasts, let `linesman diagnose --active` search: it closes one port after the other \
             for a moment, until frames come back, and names the link.",
        );
    }
    advise(condition, carrier)
}

/// Frames do not come back at all: the first hop, or what is behind it.
fn cut(model: &NetworkModel, at: Instant, carrier: Option<bool>, was_searched: bool) -> Condition {
    // Without a carrier it is the first hop for sure; with one, something forwards nothing.
    let (open, off, dead_link) = match carrier {
        Some(false) => (0.6, 0.3, 0.0),
        // Nobody looks for the place, and each link of the line may be the one.
        Some(true) if !model.sees_all_orders && !was_searched => {
            let network = Place::Network { network: model.network };
            return Condition::new(&PAGE, network, FaultName::FalseLink, at)
                .confidence(0.5)
                .or_at(FaultName::FalseLink, first_link(model), 0.2)
                .or_at(FaultName::NicDamaged, Place::Host, CARD)
                .or_at(FaultName::LinkOpen, first_link(model), 0.1);
        }
        Some(true) => {
            return Condition::new(&PAGE, first_link(model), FaultName::FalseLink, at)
                .confidence(0.5)
                .or_at(FaultName::FalseLink, Place::Network { network: model.network }, 0.25)
                .or_at(FaultName::NicDamaged, Place::Host, CARD)
                .or(FaultName::LinkOpen, 0.05);
        }
        None => (0.45, 0.3, 0.1),
    };
    let condition =
        Condition::new(&PAGE, first_link(model), FaultName::LinkOpen, at).confidence(open);
    let condition = match first_device(model) {
        Some(id) => condition.or_at(FaultName::DeviceOff, Place::device(model.network, id), off),
        None => condition.or(FaultName::DeviceOff, off),
    };
    let condition = match carrier {
        Some(false) => condition,
        Some(true) | None => condition.or(FaultName::FalseLink, dead_link),
    };
    let condition = condition.or_at(FaultName::NicDamaged, Place::Host, CARD);
    // Who was never seen may not be there at all.
    match first_device(model)
        .filter(|_| model.tree_is_planned && model.traffic.datagrams.answered() == 0)
    {
        Some(id) => condition
            .or_at(FaultName::DeviceMissing, Place::device(model.network, id), NEVER_SEEN)
            .or_at(FaultName::SupplyOff, Place::device(model.network, id), NEVER_SEEN),
        None => condition,
    }
}

/// Where frames vanish was found by closing ports.
fn placed(model: &NetworkModel, at: Instant, found: Seen<usize>) -> Condition {
    let place = match model.links().nth(found.value) {
        Some(link) => Place::link(model.network, link, Some(LinkDirection::Both)),
        None => Place::Network { network: model.network },
    };
    let text = "with the port before this link closed for a moment frames came back, with any port behind \
                it closed they did not";
    let behind = model.links().nth(found.value).and_then(|link| link.downstream.node());
    // Nothing that shows a link by itself can be between two terminals: one of two pairs of contacts is open.
    let (cause, sure, other, less) =
        match behind.is_some_and(|id| is_on_terminal_bus(model, id.index())) {
            true => (FaultName::LinkOpen, 0.6, FaultName::FalseLink, 0.3),
            false => (FaultName::FalseLink, 0.8, FaultName::LinkOpen, 0.1),
        };
    Condition::new(&PAGE, place, cause, at)
        .confidence(sure)
        .or(other, less)
        .shown_by(Evidence::host(Some(found.at), text))
        .advise(
            "Look at what is between the two ports, such as a media converter or a switch, and at the \
             device behind: its link lives, its controller does not.",
        )
}

/// Nothing came back for a while, and nobody has lost a link: something took the frames that shows one.
fn hole(view: &View<'_>, silence: &Silence) -> Condition {
    let model = view.model;
    let network = Place::Network { network: model.network };
    let (place, confidence) = match outage_location::place(view, silence) {
        Some((link, sure)) => (link, sure),
        None => (network, 0.5),
    };
    let condition = Condition::new(&PAGE, place, FaultName::FalseLink, silence.since.at)
        .confidence(confidence)
        .or_at(FaultName::NicDamaged, Place::Host, CARD)
        .or_at(FaultName::HostDrops, Place::Host, CARD)
        .or_at(FaultName::CableDegraded, first_link(model), CARD);
    if place != network || model.sees_all_orders {
        return condition;
    }
    // Nobody can be asked for counters: whatever spoils every frame looks so.
    condition
        .or(FaultName::DeviceInternal, CARD)
        .or(FaultName::TransmitterDamaged, CARD / 2.0)
        .or(FaultName::ReceiverDamaged, CARD / 2.0)
}

/// Frames do come back, but damaged, and no counter can be asked where.
fn spoiling(model: &NetworkModel, at: Instant) -> Condition {
    let place = Place::Network { network: model.network };
    Condition::new(&PAGE, place, FaultName::CableDegraded, at)
        .confidence(0.4)
        .or(FaultName::TransmitterDamaged, 0.15)
        .or(FaultName::DeviceInternal, 0.15)
        .or(FaultName::EmcNoise, 0.1)
        .or_at(FaultName::NicDamaged, Place::Host, CARD)
}

/// Whether the card had a link during a silence; `None` when neither the host says so nor anybody who searched
/// for the place, which nobody does without one, nor frames that went on leaving it.
fn carrier_during(model: &NetworkModel, silence: &Silence) -> Option<bool> {
    let card = model.host.card(Path::A);
    let Some(carrier) = card.carrier else {
        return (search::began(model, silence).is_some() || went_on_leaving(model, silence))
            .then_some(true);
    };
    let came_back = carrier.value && card.carrier_changes > 0 && carrier.at >= silence.since.at;
    Some(carrier.value && !came_back)
}

/// Whether frames were seen to leave the card itself for so long that it had a link: the system hands none to a card
/// without one, once it knows.
fn went_on_leaving(model: &NetworkModel, silence: &Silence) -> bool {
    let is_host = model.traffic.requests.senders().iter().any(|sender| sender.is_host);
    is_host && silence.last.at.since(silence.since.at) >= CARRIER_KNOWN
}

/// Frames come back as they went out.
fn ignored(view: &View<'_>) -> Condition {
    let traffic = &view.model.traffic;
    let first = traffic.datagrams.first_unanswered();
    let at = first.map_or(view.now, |first| first.at);
    let text = format!(
        "{} frames came back, but no SubDevice processed any of their {} datagrams",
        traffic.returns.count(),
        traffic.datagrams.unanswered()
    );
    let frame = first.and_then(|first| first.frame).unwrap_or(0);
    Condition::new(&PAGE, first_link(view.model), FaultName::ForeignFrames, at)
        .confidence(0.4)
        .or(FaultName::FalseLink, 0.3)
        .confirmed(at)
        .shown_by(Evidence::frame(at, frame, text))
        .advise(
            "Check that the card is wired to an EtherCAT SubDevice, not to a switch, a loop or an \
             office network.",
        )
        .advise("Check that the right card was chosen: `linesman interfaces` lists all of them.")
}

fn advise(condition: Condition, carrier: Option<bool>) -> Condition {
    let condition = match carrier {
        Some(true) => condition.advise(
            "The card has a link: look for what shows one without forwarding, such as a media \
             converter, a switch, or a device that is not EtherCAT.",
        ),
        Some(false) | None => condition.advise(
            "Check the cable from the card to the first SubDevice: plugged at both ends, link LED \
             on at the card and at the IN port.",
        ),
    };
    condition
        .advise("Check the supply of the first SubDevice: its RUN and power LEDs.")
        .advise(
            "Check that the right card was chosen: `linesman interfaces` lists all cards with \
             their links.",
        )
        .advise("Plug the cable into the IN port (port A) of the first SubDevice.")
        .advise("Exchange the cable; then try the first SubDevice alone, then another card.")
}

/// The end of the first link at the first controller.
fn first_end(model: &NetworkModel) -> Option<LinkEnd> {
    let mut links = model.links();
    links.find(|link| link.upstream == End::MainDevice(Path::A)).map(|link| link.downstream)
}

/// From the card to the first controller, whose end is not known before it was seen.
fn first_link(model: &NetworkModel) -> Place {
    let a: LinkEnd = End::MainDevice(Path::A);
    Place::Link { network: model.network, a, b: first_end(model), direction: None }
}

fn first_device(model: &NetworkModel) -> Option<DeviceId> {
    first_end(model).and_then(|end| end.node())
}
