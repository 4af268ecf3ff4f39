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
//! A recording may show one lost request alone: once a card has lost its link, the system hands it no more frames, and none
//! is recorded. A last request that did not come back, and nothing sent from then on until the recorder noted that it ended,
//! is taken for that; `tcpdump -w` notes no end. Programs with ethercrab end when one request does not come back, wherever
//! it was lost: nothing is told there, nor of a MainDevice that is not known to go on.
//! If the card counts damaged frames meanwhile, the way round is whole and something on it spoils
//! every frame; which link it is, no counter can be asked.
//! In a ring the frames of card B may come round untouched while those of card A, which SubDevices process,
//! vanish: no link is down, or the ring would have opened; something takes the frames of one direction, or those
//! that go into a branch.
//!
//! **What to do.** Look at the LED of the card and of the IN port of the first SubDevice, then at
//! supply, cable and the choice of the card, in this order.

mod causes;
mod outage_location;
mod restarted;
mod vanished;

use linesman_config::fault::{Class, FaultName};
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::topology::End;

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, LinkEnd, Place, Severity, Symptom};
use crate::model::{NetworkModel, Seen};

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

/// Requests in a row without a return that are no accident.
pub(super) const CERTAIN: u64 = 8;
/// With fewer, the end of the input may have cut off the answer.
const FEW: u64 = 3;

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let model = view.model;
    let traffic = &model.traffic;
    conditions.extend(told(view));
    // Of frames that were cut off nobody knows whether they were answered.
    if traffic.is_one_sided() || traffic.recording.cut() * 2 > traffic.recording.frames() {
        return;
    }
    if let Some((silence, is_swallowed)) = vanished::latest(view) {
        conditions.extend(vanished::condition(view, &silence, is_swallowed));
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
    let condition = causes::cut(model, at, carrier, false)
        .confirmed(at)
        .shown_by(Evidence::host(Some(at), text))
        .about([Symptom::NobodyAnswers])
        .explaining(follows)
        .explaining([Symptom::FramesLost, Symptom::NoCarrier]);
    Some(advise(condition, carrier))
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
