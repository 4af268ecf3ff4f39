//! # A SubDevice does not answer a request for a state
//!
//! A state was asked for, and AL status stays as it was: neither the new state nor an error.
//!
//! **How it is found.** AL control (0x0120) was written. AL status (0x0130) is read again and again since, and
//! shows the old state without the error bit, for longer than such a step may take: 3 s to PREOP, 10 s to
//! SAFEOP and OP, 5 s back (ETG.1020); a second at least. That the MainDevice asks anew, or for another state,
//! is no answer. As long as the firmware has not fetched a request, the controller takes no further one
//! (working counter 0): with one that was not taken it is the firmware for sure.
//!
//! **What it means.** The controller answers: cable, address and supply are well. The firmware behind it does
//! not fetch the request, or does not come to an end with it; a SubDevice that minds the request, but cannot
//! follow it, says so with the error bit and a code. Process data and mailbox may go on as before. Where its
//! processor has stopped altogether (`S206`), this follows. What takes its time and gets there is no finding.
//!
//! **What to do.** Power it off and on. If it comes again at the same step, look at what is done in that step:
//! start-up commands, a long self-test, a first start after new firmware; then ask its maker, with a capture.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::address::RegisterAddress;

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};
use crate::model::{Device, NetworkModel, StateRequest};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "S207",
    name: "state-unanswered",
    severity: Severity::Error,
    class: Class::Software,
    source: include_str!("state_unanswered.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

const AL_CONTROL: RegisterAddress = RegisterAddress(0x0120);
const AL_STATUS: RegisterAddress = RegisterAddress(0x0130);

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    for device in &view.model.devices {
        // A later order may be in a frame that is not in the recording.
        let is_seen = |request: &StateRequest| {
            let until = request.polled.map_or(request.asked.at, |polled| polled.at);
            !view.model.traffic.may_lack(request.asked.at, until)
        };
        let overdue = device.al.requests.iter().rev();
        let overdue = overdue.filter(|one| one.is_overdue()).find(|one| is_seen(one));
        conditions.extend(overdue.map(|request| condition(view.model, device, request)));
    }
}

fn condition(model: &NetworkModel, device: &Device, request: &StateRequest) -> Condition {
    let id = device.id;
    let label = model.label(id);
    let asked = &request.asked;
    let polled = request.polled.map_or(asked.at, |polled| polled.at);
    let again = match (request.times, request.asked.value.state() == Some(request.to)) {
        (1, _) => String::new(),
        (times, true) => format!(", {times} times by now"),
        (times, false) => format!(", {times} times by now, for {} at last", request.to),
    };
    let (from, seconds) = (request.from, request.waited().as_secs_f64());
    let stays = format!(
        "AL status of {label}: still {from} and no error, read {} times within {seconds:.1} s",
        request.polls
    );
    let untaken = match request.untaken {
        0 => String::new(),
        times => format!("; {times} times the one before was not fetched yet (working counter 0)"),
    };
    let control = format!("AL control: {} asked for{again}{untaken}", asked.value);
    let state = Some(u64::from(from.bits()));
    let condition =
        Condition::new(&PAGE, Place::device(model.network, id), FaultName::FirmwareFault, asked.at)
            .confidence(if request.untaken > 0 { 0.9 } else { 0.75 })
            .or(FaultName::CycleTooFast, 0.05)
            .confirmed(polled)
            .about([Symptom::StateLost(id)])
            .explaining([Symptom::WorkingCounter(id)]);
    let mut condition = match &request.polled {
        Some(seen) => {
            condition.shown_by(Evidence::register(id, AL_STATUS, seen, stays).values(state, state))
        }
        None => condition,
    };
    let wanted = Some(u64::from(asked.value.bits()));
    condition = condition
        .shown_by(Evidence::register(id, AL_CONTROL, asked, control).values(None, wanted))
        .advise(format!("Power {label} off and on, and ask for the state again."))
        .advise(
            "Ask for the states one by one: at the step that hangs, look at start-up commands and at what \
             its firmware does there.",
        )
        .advise("Note its firmware version and ask its maker, with a capture.");
    match request.ended {
        Some(at) => condition.ended(at),
        None => condition,
    }
}
