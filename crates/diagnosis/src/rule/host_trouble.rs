//! # The computer is late, or drops frames
//!
//! The host sends unevenly, drops frames that came back, or cannot send.
//!
//! **How it is found.** The host's own observations: how late cycles began, what card and socket dropped
//! for want of room, what could not be sent. Frames on the line show none of this.
//!
//! **What it means.** `X510`: frames came back well and were thrown away by the computer; they look like
//! lost frames, and no cable is to blame. `X511`: the computer did not begin its cycles in time: another
//! program, power saving, a kernel without real-time scheduling. SubDevices that expect frames in
//! time may lose synchronisation, and watchdogs may expire. `X512`: frames did not even leave; where that was so for
//! a while and then no more, the computer or its driver stood still, else the card may be damaged.
//!
//! **What to do.** Give the program real-time priority, a CPU of its own and locked memory; switch off
//! power saving; use a card with a driver of its own and larger buffers.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::time::{Instant, Span};

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};
use crate::model::Tally;

/// Frames dropped after they came back.
pub const DROPS: RulePage = RulePage {
    code: "X510",
    name: "host-drops-frames",
    severity: Severity::Error,
    class: Class::Host,
    source: include_str!("host_trouble.rs"),
};

/// Cycles begin late.
pub const LATE: RulePage = RulePage {
    code: "X511",
    name: "host-late",
    severity: Severity::Warning,
    class: Class::Host,
    source: include_str!("host_trouble.rs"),
};

/// Frames do not leave.
pub const SENDING: RulePage = RulePage {
    code: "X512",
    name: "host-cannot-send",
    severity: Severity::Error,
    class: Class::Host,
    source: include_str!("host_trouble.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[DROPS, LATE, SENDING], judge };

/// What did not come again for this long is over.
const QUIET: Span = Span::s(2);
/// Less is what any computer does now and then.
const WORTH: Span = Span::ms(1);
/// So many late cycles are no accident.
const OFTEN: u64 = 3;

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    for path in Path::ALL {
        let card = view.model.host.card(path);
        let dropped = both(&card.card_drops, &card.socket_drops);
        if let Some((first, last)) = span(&dropped) {
            let text = format!(
                "card {path} dropped {} frames and its socket {} for want of room",
                card.card_drops.sum, card.socket_drops.sum
            );
            let condition = begin(view, &DROPS, FaultName::HostDrops, first, last)
                .confidence(0.85)
                .or(FaultName::HostJitter, 0.1)
                .confirmed(first)
                .shown_by(Evidence::host(Some(last), text))
                .explaining([Symptom::FramesLost])
                .advise("Give the program real-time priority and a CPU of its own.")
                .advise("Enlarge the receive buffers of card and socket.")
                .advise("Look for other programs that read from the same card.");
            conditions.push(condition);
        }
        let is_late = card.late.times >= OFTEN && card.late.largest >= WORTH.as_nanos();
        if let Some((first, last)) = span(&card.late).filter(|_| is_late) {
            let text = format!(
                "{} cycles began late, the worst by {:.3} ms",
                card.late.times,
                card.late.largest as f64 / 1e6
            );
            let devices = view.model.devices.iter().map(|device| device.id);
            let condition = begin(view, &LATE, FaultName::HostJitter, first, last)
                .confidence(0.85)
                .confirmed(first)
                .shown_by(Evidence::host(Some(last), text))
                .explaining(devices.map(late_symptom))
                .advise("Give the program real-time priority, a CPU of its own and locked memory.")
                .advise("Switch off power saving of the CPU and of the card.")
                .advise("Lengthen the cycle until the cause is found.");
            conditions.push(condition);
        }
        let carrier = card.carrier.is_none_or(|carrier| carrier.value);
        if let Some((first, last)) = span(&card.send_failures).filter(|_| carrier) {
            let text =
                format!("{} frames could not be sent by card {path}", card.send_failures.sum);
            // Who refuses frames for a while and then takes all of them stood still; damage comes again.
            let returned = view.model.traffic.returns.latest().map(|seen| seen.at);
            let stood_still = last.since(first) <= QUIET && returned.is_some_and(|at| at > last);
            let (cause, other) = match stood_still {
                true => (FaultName::WatchdogStarved, FaultName::NicDamaged),
                false => (FaultName::NicDamaged, FaultName::WatchdogStarved),
            };
            let condition = begin(view, &SENDING, cause, first, last)
                .confidence(0.5)
                .or(other, 0.25)
                .or(FaultName::HostDrops, 0.1)
                .shown_by(Evidence::host(Some(last), text))
                .explaining([Symptom::FramesLost])
                .about([Symptom::NobodyAnswers])
                .advise("Look into the system's log for messages of the card's driver.")
                .advise("Try another card.");
            conditions.push(condition);
        }
    }
}

/// A watchdog or a lost synchronisation may follow from late frames.
const fn late_symptom(device: DeviceId) -> Symptom {
    Symptom::StateLost(device)
}

fn begin(
    view: &View<'_>,
    page: &'static RulePage,
    cause: FaultName,
    first: Instant,
    last: Instant,
) -> Condition {
    let condition = Condition::new(page, Place::Host, cause, first);
    if last + QUIET < view.model.now { condition.ended(last) } else { condition }
}

fn span(tally: &Tally) -> Option<(Instant, Instant)> {
    tally.first.zip(tally.last)
}

fn both(one: &Tally, other: &Tally) -> Tally {
    Tally {
        sum: one.sum + other.sum,
        largest: one.largest.max(other.largest),
        times: one.times + other.times,
        first: match (one.first, other.first) {
            (Some(one), Some(other)) => Some(one.min(other)),
            (one, other) => one.or(other),
        },
        last: one.last.max(other.last),
        ..Tally::default()
    }
}
