//! # Damaged frames and symbols
//!
//! Frames are spoiled, or symbols between them, on a link or inside a device.
//!
//! **How it is found.** A controller checks each frame where it comes in from outside: at the IN port
//! on the way out, at the other ports on the way back. Bad frames count in the low byte of the RX error
//! register of the port (0x0300, 0x0302, 0x0304, 0x0306), symbols that cannot be decoded in the high
//! byte, also those between frames. A controller behind the first one counts a bad frame as forwarded
//! (0x0308 to 0x030B) or, if its type does not have these counters, once more as bad. So the ports are
//! put in the order in which a frame meets them, and the *first* one that counts lies directly behind
//! the damage. Only rises during the watch count: old values, and errors at the moment a link comes or
//! goes, are history. Counts that somebody typed in without earlier ones may be old: a warning, until they are
//! cleared and rise again.
//!
//! **What it means.**
//!
//! * Bad frames and bad symbols, or symbols alone: the signal suffers between the output of one device
//!   and the input of the next. Cable, plug, contact, interference, or one of the two port circuits.
//!   Both directions of one link point to the cable; several links at the same moments to interference;
//!   one direction that counts steadily to the sender's output or the receiver's input. While several
//!   links count, a live diagnosis reads the counters of those devices every 5 ms: one source hits them in
//!   the same bursts, and begins and ends for all of them together; two faults each go their own way. Three links or more
//!   that are hit in the same stretch of time, and about as often, are taken to have one source: so many cables
//!   seldom fail at a time.
//! * Bad frames with clean symbols (`H111`): the device before the port spoils frames inside, before
//!   they are coded. Changing the cable will not help.
//! * The way from the first SubDevice back to the card is checked by nobody but the card. If its own
//!   counters are known, they tell; if not, frames that are lost without any counter moving (`H112`)
//!   may have been spoiled on that last piece of cable or lost in the computer: then all of these are
//!   named.
//!
//! **What to do.** Look at the place first: cable beside power cables, self-made plugs, shield, supply
//! and ground of both devices. Then exchange cable or devices and see whether the errors stay at the
//! place or move with the part.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::address::DeviceId;
use linesman_proto::register::ErrorCounter;
use linesman_proto::state::AlStatusCode;
use linesman_proto::state::status_code::Class as CodeClass;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::End;
use linesman_proto::topology::route::Direction;

use super::{Rule, RulePage, View, state_error};
use crate::finding::{Alternative, Condition, Evidence, LinkDirection, Place, Severity, Symptom};
use crate::locate::cause::CausePlace;
use crate::locate::{Damage, LastHop, LocateInput, Located, Suspicion};
use crate::model::AlError;

/// The signal suffers on a link.
pub const ON_LINK: RulePage = RulePage {
    code: "H110",
    name: "damage-on-link",
    severity: Severity::Error,
    class: Class::Hardware,
    source: include_str!("frame_errors.rs"),
};

/// A device, or the card, spoils frames before they are coded.
pub const INSIDE: RulePage = RulePage {
    code: "H111",
    name: "damage-in-device",
    severity: Severity::Error,
    class: Class::Hardware,
    source: include_str!("frame_errors.rs"),
};

/// Frames are lost where nobody counts.
pub const LAST_HOP: RulePage = RulePage {
    code: "H112",
    name: "lost-on-last-hop",
    severity: Severity::Warning,
    class: Class::Hardware,
    source: include_str!("frame_errors.rs"),
};

/// Errors that did not come again for this long are over.
const QUIET: Span = Span::s(2);

/// Damaged frames at the card that a link may have cut off when it opened and when it was back.
const CUT_OFF: u64 = 4;

/// The rule.
pub const RULE: Rule = Rule { pages: &[ON_LINK, INSIDE, LAST_HOP], judge };

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let Some(input) = LocateInput::of(view.model, view.has_ended) else { return };
    let located = Located::on(&input);
    for suspicion in Suspicion::all(&input, &located) {
        add(view, &input, &suspicion, None, conditions);
    }
}

fn add(
    view: &View<'_>,
    input: &LocateInput<'_>,
    suspicion: &Suspicion,
    leader: Option<&Suspicion>,
    conditions: &mut Vec<Condition>,
) {
    let Some(most_likely) = suspicion.suspects.first() else { return };
    let (first, last) = match (suspicion.first(), suspicion.last()) {
        (Some(first), Some(last)) => (first, last),
        (None, _) | (_, None) => return,
    };
    let is_unknown = matches!(suspicion.last_hop, Some(LastHop::Unknown { .. }));
    let page = match (is_unknown, most_likely.spot) {
        (true, _) => &LAST_HOP,
        (false, CausePlace::Link(..)) => &ON_LINK,
        (false, CausePlace::Device(_) | CausePlace::Host) => &INSIDE,
    };
    let at = place(input, most_likely.spot);
    let mut condition =
        Condition::new(page, at, most_likely.cause, first).confidence(most_likely.weight);
    condition.severity = match suspicion.frames() {
        0 => Severity::Warning,
        // One frame may get lost on a good line; it is worth knowing, no more.
        1 if is_unknown => Severity::Info,
        _ => condition.severity,
    };
    for other in &suspicion.suspects[1..] {
        let place = place(input, other.spot);
        condition.alternatives.push(Alternative {
            cause: other.cause,
            place: (place != at).then_some(place),
            confidence: other.weight,
        });
    }
    if !is_unknown {
        condition = condition.confirmed(first);
    }
    // A full counter does not show whether it goes on; frames that are still missing do.
    let is_full = suspicion.damages.iter().any(|damage| damage.is_lower_bound);
    let latest_lost =
        view.model.traffic.losses.latest().filter(|_| is_full && suspicion.frames() > 0);
    let last = latest_lost.map_or(last, |lost| last.max(lost.at));
    if last + QUIET < view.model.now {
        condition = condition.ended(last);
    }
    for damage in &suspicion.damages {
        show(input, damage, &mut condition);
    }
    if let Some(last_hop) = &suspicion.last_hop {
        condition.evidence.push(card_evidence(last_hop));
    }
    if is_history(input, suspicion) {
        condition = condition.may_be_old();
    }
    // What follows from sums alone, while SubDevices went away and came back, is not claimed.
    if condition.evidence.is_empty() {
        return;
    }
    for action in actions(input, most_likely.cause, most_likely.spot) {
        condition = condition.advise(action);
    }
    let mine = symptoms(input, suspicion);
    condition.symptoms.extend(mine.iter().copied());
    condition.explains.extend(mine);
    for other in &suspicion.beneath {
        condition.explains.extend(symptoms(input, other));
    }
    if suspicion.frames() > 0 {
        condition.explains.push(Symptom::FramesLost);
        condition.explains.push(Symptom::CardErrors);
        condition.explains.extend(starved(view));
    }
    if leader.is_some() {
        // Only the one that leads explains; the others hang beneath it.
        condition.explains.clear();
    }
    conditions.push(condition);
    for other in &suspicion.beneath {
        add(view, input, other, Some(suspicion), conditions);
    }
}

/// Whether all that shows a damage was read but once, and nothing says that it goes on: it may have been counted
/// long ago.
fn is_history(input: &LocateInput<'_>, suspicion: &Suspicion) -> bool {
    let may_be_old = |node: usize, counter: ErrorCounter| {
        input.track(node, counter).is_none_or(|track| track.may_be_old || track.total.rise() == 0)
    };
    let is_old = |damage: &Damage| {
        let End::Controller(node, port) = damage.hop.to else { return false };
        let own = [ErrorCounter::InvalidFrame(port), ErrorCounter::PhysicalLayer(port)];
        own.into_iter().all(|counter| may_be_old(node, counter))
            && damage
                .shown_at
                .is_none_or(|(node, port)| may_be_old(node, ErrorCounter::Forwarded(port)))
    };
    let goes_on = input.model().reported.loss_rate.is_some_and(|rate| rate > 0.0);
    let damages = &suspicion.damages;
    !goes_on && suspicion.last_hop.is_none() && !damages.is_empty() && damages.iter().all(is_old)
}

/// SubDevices that lost nothing but time: frames that are damaged or lost bring neither outputs nor the
/// time of the reference clock. A hardware cause wins over what software shows of it (SW-06). One that counts cycles in
/// which it was not done is too slow by itself.
pub(super) fn starved(view: &View<'_>) -> impl Iterator<Item = Symptom> {
    let is_of_time = |error: &AlError| {
        let code = error.code.map(|code| code.value);
        code.is_some_and(|code| {
            code == AlStatusCode::SYNC_MANAGER_WATCHDOG || code.explain().class == CodeClass::Timing
        })
    };
    let starved = view.model.devices.iter().filter(move |device| {
        !device.al.errors.is_empty()
            && device.al.errors.iter().all(is_of_time)
            && state_error::exceeded(device).is_none()
    });
    starved.map(|device| Symptom::StateLost(device.id))
}

/// What the damage is about: the ports that found it first, and the card.
fn symptoms(input: &LocateInput<'_>, suspicion: &Suspicion) -> Vec<Symptom> {
    let ports = suspicion.damages.iter().filter_map(|damage| match input.name(damage.hop.to) {
        End::Controller(id, port) => Some(Symptom::PortErrors(id, port)),
        End::MainDevice(_) => None,
    });
    let card = suspicion.last_hop.as_ref().and_then(|hop| match hop {
        // A link that opens cuts off a frame or two; those that were damaged long after it are no work of its.
        LastHop::Damaged { frames, last, .. }
            if *frames > CUT_OFF
                && input.any_link_changed(Instant::ZERO, *last)
                && !input.any_link_changed(*last, *last) =>
        {
            None
        }
        // What controllers counted is taken off: other damage on the line explains none of these.
        LastHop::Damaged { frames, carried: 1.., first, last, .. }
            if *frames > CUT_OFF
                && suspicion.damages.is_empty()
                && !input.any_link_changed(*first, *last) =>
        {
            None
        }
        LastHop::Damaged { .. } => Some(Symptom::CardErrors),
        // Nor does a link that opens or closes take so many, at moments at which none did.
        LastHop::Unknown { lost, first, last, .. }
            if *lost > CUT_OFF
                && input.any_link_changed(Instant::ZERO, *last)
                && !input.any_link_changed(*first, *last) =>
        {
            None
        }
        LastHop::Unknown { is_beside: false, .. } => Some(Symptom::FramesLost),
        // The other damage, which explains lost frames, does not explain these.
        LastHop::Unknown { is_beside: true, .. } => None,
    });
    ports.chain(card).collect()
}

fn place(input: &LocateInput<'_>, spot: CausePlace) -> Place {
    let network = input.model().network;
    match spot {
        CausePlace::Link(link, direction) => {
            let direction = match direction {
                Some(Direction::Downstream) => LinkDirection::AToB,
                Some(Direction::Upstream) => LinkDirection::BToA,
                None => LinkDirection::Both,
            };
            let link = input.tree().links()[link].map(|node| DeviceId(node as u32));
            Place::link(network, link, Some(direction))
        }
        CausePlace::Device(node) => Place::device(network, DeviceId(node as u32)),
        CausePlace::Host => Place::Host,
    }
}

/// The counters that show a damage, with what they mean.
fn show(input: &LocateInput<'_>, damage: &Damage, condition: &mut Condition) {
    let End::Controller(node, port) = damage.hop.to else { return };
    let id = DeviceId(node as u32);
    let from = end_text(input, damage.hop.from);
    let at_least = if damage.is_lower_bound { "at least " } else { "" };
    let label = input.model().label(id);
    let frames = damage.frames;
    let frames_text = format!(
        "{label}, port {port}, is the first in the order of checks that counts bad frames \
         from {from}: {at_least}{frames} of its own"
    );
    let symbols_text = match damage.symbols {
        Some(symbols) => format!(
            "{label}, port {port}, could not decode {at_least}{symbols} symbols from {from}"
        ),
        None => String::new(),
    };
    let shown = [
        (ErrorCounter::InvalidFrame(port), frames, frames_text),
        (ErrorCounter::PhysicalLayer(port), damage.symbols.unwrap_or(0), symbols_text),
    ];
    for (counter, count, mut text) in shown {
        let track = input.track(node, counter);
        if let Some(rise) = track.filter(|_| count > 0).and_then(|track| track.last_rise()) {
            let first = track.and_then(|track| input.rises(track).next()).unwrap_or(rise);
            // Else the values beside it would contradict it.
            if count > rise.after.saturating_sub(first.before) {
                text += "; the counter was cleared in between";
            }
            let evidence = Evidence::rise(id, counter.address(), Some(port), rise, text)
                .values(Some(first.before), Some(rise.after));
            condition.evidence.push(evidence);
        }
    }
    if let Some((node, marked_at)) = damage.shown_at {
        let (by, counter) = (DeviceId(node as u32), ErrorCounter::Forwarded(marked_at));
        if let Some(rise) = input.track(node, counter).and_then(|track| track.last_rise()) {
            let text = format!(
                "{} counts {frames} frames that were bad already when they came; port {port} of \
                 {label}, whose own counter tells nothing, has let them pass",
                input.model().label(by),
            );
            let evidence = Evidence::rise(by, counter.address(), Some(marked_at), rise, text);
            condition.evidence.push(evidence);
        }
    }
}

fn card_evidence(last_hop: &LastHop) -> Evidence {
    let (card, frames) = (last_hop.card(), last_hop.frames());
    let text = match last_hop {
        LastHop::Damaged { .. } => format!(
            "card {card} dropped {frames} bad frames that no SubDevice had found bad: they were \
             spoiled on the last way, from the first SubDevice to the card"
        ),
        LastHop::Unknown { is_beside, .. } => {
            let when = if *is_beside { " at these moments" } else { "" };
            format!(
                "{frames} frames did not come back to card {card}, and no counter of any SubDevice \
                 moved{when}; the counters of the card are not known"
            )
        }
    };
    Evidence::host(Some(last_hop.last()), text)
}

fn end_text(input: &LocateInput<'_>, end: End) -> String {
    match input.name(end) {
        End::MainDevice(card) => format!("the MainDevice (card {card})"),
        End::Controller(id, port) => format!("{}, port {port}", input.model().label(id)),
    }
}

/// What to do, in the order in which it is worth doing. Reference: HW-25.
fn actions(input: &LocateInput<'_>, cause: FaultName, spot: CausePlace) -> Vec<String> {
    let ends = |link: usize| {
        let link = input.tree().links()[link];
        (end_text(input, link.upstream), end_text(input, link.downstream))
    };
    match spot {
        CausePlace::Link(link, _) => {
            let (a, b) = ends(link);
            let mut list = Vec::new();
            if cause == FaultName::EmcNoise {
                list.push(
                    "Look for what switches at the moments of the errors: drives, contactors, welding."
                        .to_owned(),
                );
            }
            list.push(format!(
                "Check the cable or contact between {a} and {b}: near power cables or other sources of \
                 noise, self-made plugs, shield, bend, seat of the plug."
            ));
            list.push(format!(
                "Check supply and ground of {a} and {b}: E-bus current, difference in ground potential."
            ));
            list.push(
                "Exchange the cable, then swap one of the two devices: see whether the errors stay or \
                 move with the part."
                    .to_owned(),
            );
            list
        }
        CausePlace::Device(node) => {
            let label = input.model().label(DeviceId(node as u32));
            vec![
                format!("Exchange {label}: symbols after it are clean, frames are not."),
                "Before that, check its supply; the cable behind it is not the cause.".to_owned(),
            ]
        }
        CausePlace::Host => vec![
            "Try another network card, or another socket of the computer.".to_owned(),
            "Check the plug and the cable at the card.".to_owned(),
        ],
    }
}
