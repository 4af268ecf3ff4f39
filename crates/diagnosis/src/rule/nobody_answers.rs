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
//! If the card counts damaged frames meanwhile, the way round is whole and something on it spoils
//! every frame; which link it is, no counter can be asked.
//!
//! **What to do.** Look at the LED of the card and of the IN port of the first SubDevice, then at
//! supply, cable and the choice of the card, in this order.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::time::Instant;
use linesman_proto::topology::End;

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, LinkEnd, Place, Severity, Symptom};
use crate::line::{Line, Silence};

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
const CERTAIN: u64 = 8;
/// More in a row than noise takes from a line that still answers.
const LONG: u64 = 32;
/// How likely it is the card.
const CARD: f64 = 0.1;
/// With fewer, the end of the input may have cut off the answer.
const FEW: u64 = 3;

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let line = view.line;
    let traffic = &line.traffic;
    if traffic.is_one_sided() {
        return;
    }
    // One condition: the latest silence, or the one that lasts.
    let is_long =
        |silence: &&Silence| silence.frames >= CERTAIN || (silence.frames >= FEW && view.has_ended);
    if let Some(silence) = traffic.silences.iter().rev().find(is_long) {
        conditions.push(vanished(view, silence));
    } else if traffic.answered == 0 && traffic.returned >= FEW && traffic.unanswered >= CERTAIN {
        conditions.push(ignored(view));
    }
}

/// Nothing comes back.
fn vanished(view: &View<'_>, silence: &Silence) -> Condition {
    let line = view.line;
    let was_answered = line.traffic.answered > 0;
    let carrier = carrier_during(line, silence);
    let since = silence.since;
    let text = if was_answered {
        format!("from here on {} requests in a row did not come back", silence.frames)
    } else {
        format!("first of {} requests; none came back", silence.frames)
    };
    let spoiled = line.host.card(Path::A).crc;
    let is_spoiled = spoiled.of_spell() > 0 && spoiled.last.is_some_and(|last| last >= since.at);
    let frame = since.frame.unwrap_or(0);
    let mut condition =
        if is_spoiled { spoiling(line, since.at) } else { cut(line, since.at, carrier) };
    condition = condition.shown_by(Evidence::frame(since.at, frame, text));
    if is_spoiled {
        let text = format!(
            "the card received {} damaged frames meanwhile: the way round is whole, but something on \
             it spoils every frame",
            spoiled.of_spell()
        );
        condition = condition.shown_by(Evidence::host(spoiled.last, text));
    }
    if was_answered && let Some(returned) = line.traffic.latest_returned {
        let frame = returned.frame.unwrap_or(0);
        let text = "the last frame that came back".to_owned();
        if returned.at <= since.at {
            condition = condition.shown_by(Evidence::frame(returned.at, frame, text));
        }
    }
    if let Some(carrier) = carrier {
        let text = if carrier { "card A has a link" } else { "card A had no link meanwhile" };
        let at = line.host.card(Path::A).carrier.map(|carrier| carrier.at);
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
    let devices = line.devices.iter().map(|device| device.id);
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
    advise(condition, carrier)
}

/// Frames do not come back at all: the first hop, or what is behind it.
fn cut(line: &Line, at: Instant, carrier: Option<bool>) -> Condition {
    // Without a carrier it is the first hop for sure; with one, something forwards nothing.
    let (open, off, dead_link) = match carrier {
        Some(false) => (0.6, 0.3, 0.0),
        Some(true) => (0.35, 0.25, 0.2),
        None => (0.45, 0.3, 0.1),
    };
    let condition =
        Condition::new(&PAGE, first_link(line), FaultName::LinkOpen, at).confidence(open);
    let condition = match first_device(line) {
        Some(id) => condition.or_at(FaultName::DeviceOff, Place::device(line.network, id), off),
        None => condition.or(FaultName::DeviceOff, off),
    };
    let condition = match carrier {
        Some(false) => condition,
        Some(true) | None => condition.or(FaultName::FalseLink, dead_link),
    };
    condition.or_at(FaultName::NicDamaged, Place::Host, CARD)
}

/// Frames do come back, but damaged, and no counter can be asked where.
fn spoiling(line: &Line, at: Instant) -> Condition {
    let place = Place::Network { network: line.network };
    Condition::new(&PAGE, place, FaultName::CableDegraded, at)
        .confidence(0.4)
        .or(FaultName::TransmitterDamaged, 0.15)
        .or(FaultName::DeviceInternal, 0.15)
        .or(FaultName::EmcNoise, 0.1)
        .or_at(FaultName::NicDamaged, Place::Host, CARD)
}

/// Whether the card had a link during a silence; `None` when the host does not say.
fn carrier_during(line: &Line, silence: &Silence) -> Option<bool> {
    let card = line.host.card(Path::A);
    let carrier = card.carrier?;
    let came_back = carrier.value && card.carrier_changes > 0 && carrier.at >= silence.since.at;
    Some(carrier.value && !came_back)
}

/// Frames come back as they went out.
fn ignored(view: &View<'_>) -> Condition {
    let traffic = &view.line.traffic;
    let first = traffic.first_unanswered;
    let at = first.map_or(view.now, |first| first.at);
    let text = format!(
        "{} frames came back, but no SubDevice processed any of their {} datagrams",
        traffic.returned, traffic.unanswered
    );
    let frame = first.and_then(|first| first.frame).unwrap_or(0);
    Condition::new(&PAGE, first_link(view.line), FaultName::ForeignFrames, at)
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

/// From the card to the first controller, whose end is not known before it was seen.
fn first_link(line: &Line) -> Place {
    let a: LinkEnd = End::MainDevice(Path::A);
    let mut links = line.links();
    let b = links.find(|link| link.upstream == a).map(|link| link.downstream);
    Place::Link { network: line.network, a, b, direction: None }
}

fn first_device(line: &Line) -> Option<DeviceId> {
    let mut links = line.links();
    let link = links.find(|link| link.upstream == End::MainDevice(Path::A));
    link.and_then(|link| link.downstream.node())
}
