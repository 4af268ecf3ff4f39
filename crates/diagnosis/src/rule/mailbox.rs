//! # Mailbox errors
//!
//! A SubDevice refuses requests to its mailbox, answers them late, or not at all.
//!
//! **How it is found.** Requests and answers are seen in the mailbox areas behind 0x1000. `S250`: an SDO is
//! aborted, or the mailbox answers with an error of its own. `S251`: an answer was not in the mailbox for 300 ms or longer after
//! its request (one that lies there until the MainDevice fetches it is not late), or a fragment of an Ethernet frame (EoE), which nothing answers, was not taken for so long; from 100 ms on it is
//! told and is no warning yet. `S252`: for nearly a second a request is not taken (working counter 0: the one before is
//! still in the mailbox, or status 0x0805 reads full all the time), or it is taken and the MainDevice looks for the answer in vain, while the controller answers as always.
//!
//! **What it means.** The mailbox is served by another part of the firmware than process data and states:
//! errors in it leave the state machine alone (S0 L2399), and a SubDevice with a stuck mailbox may run on in
//! OP. An abort says that a request does not suit an object: another index than the device has, a
//! value out of range, a write in the wrong state. That an object is not there is asked for by many
//! tools on purpose and is no finding; nor is one of the communication profile (before
//! 0x2000) that is not given at once, by complete access.
//!
//! **What to do.** Look the code up with `linesman explain`. Of a slow or stuck mailbox: ask less often, and
//! one at a time; look for a second tool that uses the same mailbox; read the diagnosis history; then new
//! firmware. Power off and on frees a stuck mailbox.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::mailbox::abort_code::SdoAbortCode;
use linesman_proto::mailbox::coe::ObjectIndex;
use linesman_proto::time::{Instant, Span};

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};
use crate::model::mailbox::{MailboxRefusal, SLOW as SLOW_ANSWER, STUCK};
use crate::model::{Device, NetworkModel, Seen};

/// Requests are refused.
pub const REFUSED: RulePage = RulePage {
    code: "S250",
    name: "mailbox-refusal",
    severity: Severity::Warning,
    class: Class::Software,
    source: include_str!("mailbox.rs"),
};

/// Answers are late.
pub const SLOW: RulePage = RulePage {
    code: "S251",
    name: "mailbox-slow",
    severity: Severity::Warning,
    class: Class::Software,
    source: include_str!("mailbox.rs"),
};

/// Nothing is taken, or nothing comes back.
pub const STUCK_PAGE: RulePage = RulePage {
    code: "S252",
    name: "mailbox-stuck",
    severity: Severity::Warning,
    class: Class::Software,
    source: include_str!("mailbox.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[REFUSED, SLOW, STUCK_PAGE], judge };

/// What did not come again for this long is over.
const QUIET: Span = Span::s(2);
/// A mailbox is asked, and its processor is missed by its watchdog, so long after it has stopped at most.
const STOPPED_WITHIN: Span = Span::s(2);
/// Shown of many.
const SHOWN: usize = 3;
/// Aborts by which a tool finds out what a SubDevice has: no such object, no such entry, complete access not
/// supported.
const ASKING: [u32; 3] = [0x0602_0000, 0x0609_0011, 0x0601_0004];

/// Objects before it are of the communication profile (ETG.1000.6): identity, mappings, assignments.
const FIRST_OF_MAKER: ObjectIndex = ObjectIndex(0x2000);

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    for device in &view.model.devices {
        conditions.extend(refused(view.model, device));
        conditions.extend(slow(view.model, device));
        conditions.extend(stuck(view, device));
    }
}

fn refused(model: &NetworkModel, device: &Device) -> Option<Condition> {
    // Whoever brings a SubDevice up tries to read objects at once, and does so entry by entry where that is refused.
    let counts = |seen: &&Seen<MailboxRefusal>| {
        !matches!(seen.value, MailboxRefusal::Abort { code, object, reads_whole }
            if ASKING.contains(&code) || (reads_whole && object.index < FIRST_OF_MAKER))
    };
    let all: Vec<_> = device.mailbox.refusals.iter().filter(counts).collect();
    let (first, last) = (all.first()?, all.last()?);
    let mut condition = begin(model, device, &REFUSED, FaultName::MailboxError, first.at, last.at)
        .confidence(0.8)
        .or(FaultName::ConfigMismatch, 0.15);
    if all.iter().all(|seen| matches!(seen.value, MailboxRefusal::Abort { .. })) {
        // The mailbox works; what was asked for did not suit.
        condition.severity = Severity::Info;
    }
    let label = model.label(device.id);
    for seen in all.iter().rev().take(SHOWN) {
        let text = match seen.value {
            MailboxRefusal::Abort { object, code, .. } => {
                format!("{label} aborts {object}: {}", SdoAbortCode(code))
            }
            MailboxRefusal::Error(code) => {
                format!("the mailbox of {label} answers with error {code}")
            }
        };
        condition = condition.shown_by(Evidence::frame(seen.at, seen.frame.unwrap_or(0), text));
    }
    if let Some(MailboxRefusal::Abort { code, .. }) = all.last().map(|seen| seen.value) {
        condition = condition.advise(SdoAbortCode(code).explain().action);
    }
    Some(
        condition
            .advise("Its state and its process data are not concerned; look at the request first."),
    )
}

fn slow(model: &NetworkModel, device: &Device) -> Option<Condition> {
    let all = &device.mailbox.slow;
    let (first, last) = (all.front()?, all.back()?);
    let since = first.value.asked;
    let mut condition = begin(model, device, &SLOW, FaultName::MailboxSlow, since, last.at)
        .confidence(0.7)
        .or(FaultName::FirmwareFault, 0.2)
        .about([Symptom::Mailbox(device.id)]);
    if all.iter().all(|seen| seen.value.took < SLOW_ANSWER) {
        // Slower than most, and no MainDevice minds.
        condition.severity = Severity::Info;
    }
    for seen in all.iter().rev().take(SHOWN) {
        let ms = seen.value.took.as_nanos() / 1_000_000;
        let what = seen.value.object.map_or_else(String::new, |object| format!(" to {object}"));
        let label = model.label(device.id);
        let text = match seen.value.carries_frame {
            true => format!("{label} takes no further Ethernet fragment for {ms} ms (EoE)"),
            false => format!("{label} has no answer to a request{what} for {ms} ms"),
        };
        condition = condition.shown_by(Evidence::frame(seen.at, seen.frame.unwrap_or(0), text));
    }
    Some(
        condition
            .advise("Ask this SubDevice less often, and one request at a time.")
            .advise("Allow a longer time for its answers."),
    )
}

fn stuck(view: &View<'_>, device: &Device) -> Option<Condition> {
    let mailbox = &device.mailbox;
    // Who does not answer at all is the matter of other rules.
    if device.silent.is_some() {
        return None;
    }
    let waiting = mailbox
        .waiting
        .filter(|_| mailbox.doubtful.is_empty())
        .zip(mailbox.polled)
        .map(|(waiting, polled)| (waiting.at, polled, waiting.frame))
        .filter(|(from, to, _)| to.since(*from) >= STUCK);
    let full = mailbox
        .full
        .map(|(since, until)| (since.at, until, since.frame))
        .filter(|(from, to, _)| to.since(*from) >= STUCK);
    let unfetched = mailbox
        .unfetched
        .map(|(since, until)| (since.at, until, since.frame))
        .filter(|(from, to, _)| to.since(*from) >= STUCK);
    let over = mailbox.stuck.back().map(|(from, to)| (*from, *to, None));
    let (since, until, frame) = full.or(waiting).or(unfetched).or(over)?;
    if view.model.traffic.may_lack(since, until) {
        // The answer may have been fetched by a frame that is not in the recording.
        return None;
    }
    let label = view.model.label(device.id);
    let ms = until.since(since).as_nanos() / 1_000_000;
    let text = if full.is_some() {
        format!("{label} takes no request out of its mailbox for {ms} ms")
    } else if waiting.is_none() && unfetched.is_some() {
        format!(
            "{label} has not fetched a request for {ms} ms: its mailbox was read full all the time"
        )
    } else {
        format!("{label} has not answered a request for {ms} ms; its controller answers")
    };
    let place = Place::device(view.model.network, device.id);
    let stopped = processor_stopped_about(view.model, since);
    let (cause, other) = match stopped {
        None => (FaultName::MailboxStuck, FaultName::FirmwareFault),
        Some(_) => (FaultName::FirmwareFault, FaultName::MailboxStuck),
    };
    let mut condition = Condition::new(&STUCK_PAGE, place, cause, since)
        .confidence(0.7)
        .or(other, 0.2)
        .confirmed(since + STUCK)
        .about([Symptom::Mailbox(device.id)])
        .explaining([Symptom::InputsStill(device.id)])
        .shown_by(Evidence::frame(since, frame.unwrap_or(0), text))
        .advise("Look for another tool that uses the mailbox of this SubDevice.")
        .advise("Power it off and on; its process data ran on meanwhile.")
        .advise("Ask its maker for newer firmware.");
    if let Some(event) = stopped {
        let text = "the frames tell that DL status of a SubDevice has changed then (event field, bit 2): a processor that \
                    stops shows there";
        condition = condition.shown_by(Evidence::frame(event.at, event.frame.unwrap_or(0), text));
    }
    if full.or(waiting).or(unfetched).is_none() {
        condition = condition.ended(until);
    }
    Some(condition)
}

/// The event by which a SubDevice told, about when its mailbox got stuck, that its DL status has changed.
fn processor_stopped_about(model: &NetworkModel, since: Instant) -> Option<Seen<()>> {
    let is_then =
        |came: &Seen<()>| came.at.since(since).max(since.since(came.at)) <= STOPPED_WITHIN;
    model.changed_link().filter(is_then)
}

pub(super) fn begin(
    model: &NetworkModel,
    device: &Device,
    page: &'static RulePage,
    cause: FaultName,
    first: Instant,
    last: Instant,
) -> Condition {
    let place = Place::device(model.network, device.id);
    let condition = Condition::new(page, place, cause, first).confirmed(first);
    if last + QUIET < model.now { condition.ended(last) } else { condition }
}
