//! # The reference clock is lost
//!
//! The clock that all others follow stands, or has started anew.
//!
//! **How it is found.** In each cycle a datagram (ARMW or FRMW at 0x0910) takes the time of the reference
//! clock to all others, and it comes back with it. The time in it is the same several times in a row, though
//! frames were sent milliseconds apart; or it goes backwards, and nobody has set the clock (0x0920).
//!
//! **What it means.** All clocks that follow are led astray, each as fast as its control allows: their
//! difference (0x092C) leaves its window, SYNC signals come at the wrong time, and SubDevices that need them
//! leave OP one by one, the reference itself first. They are well; they are listed beneath. When the SubDevice
//! itself has started anew, that is another finding.
//!
//! **What to do.** Exchange this SubDevice, or choose another one as reference clock. The clocks have to be
//! set again in any case: restart the network.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::address::RegisterAddress;
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};
use crate::model::{NetworkModel, Reference, Seen};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "T421",
    name: "reference-clock-lost",
    severity: Severity::Error,
    class: Class::Timing,
    source: include_str!("reference_clock.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

const SYSTEM_TIME: RegisterAddress = RegisterAddress(0x0910);
/// A restart of the SubDevice, and what its clock shows then, are read so far apart.
const AROUND: Span = Span::s(3);

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    if view.model.traffic.recording.cut() > 0 {
        // The time that a frame brings back may be among what was cut off.
        return;
    }
    let lost =
        view.model.references.iter().filter_map(|reference| condition(view.model, reference));
    conditions.extend(lost);
}

/// Whether a reference clock of the line stands, or went backwards: then no other one can be judged by it.
#[must_use]
pub fn is_lost(model: &NetworkModel) -> bool {
    model.references.iter().any(|one| one.stood.is_some() || one.went_back.is_some())
}

fn condition(model: &NetworkModel, reference: &Reference) -> Option<Condition> {
    let stood = reference.stood.map(|stood| stood.since.at);
    let back = reference.went_back.map(|back| back.at);
    let since = match (stood, back) {
        (Some(stood), Some(back)) => stood.min(back),
        (stood, back) => stood.or(back)?,
    };
    let id = reference.device;
    if has_restarted(model, reference, since) {
        return None;
    }
    let mut condition = Condition::new(
        &PAGE,
        Place::device(model.network, id),
        FaultName::ReferenceClockLost,
        since,
    )
    .confidence(0.9)
    .confirmed(since);
    if let Some(stood) = reference.stood {
        let ms = stood.last.since(stood.since.at).as_secs_f64() * 1e3;
        let goes = if stood.is_over { "; it goes on since" } else { "" };
        let text = format!(
            "the time of reference clock {} was the same, {} ns, in all frames for {ms:.1} ms{goes}",
            model.label(id),
            stood.since.value
        );
        condition = condition.shown_by(Evidence::register(id, SYSTEM_TIME, &stood.since, text));
    }
    if let Some(back) = reference.went_back {
        let text = format!(
            "the time of reference clock {} went back by {:.3} ms, and nobody had set it",
            model.label(id),
            back.value.unsigned_abs() as f64 / 1e6
        );
        let seen = Seen::new((), back.at, back.frame);
        condition = condition.shown_by(Evidence::register(id, SYSTEM_TIME, &seen, text));
    }
    // Who goes on after a while is still wrong by what was lost, and so are all that follow.
    if let Some(mended) = reference.mended {
        condition = condition.ended(mended);
    }
    let follows = model.devices.iter().flat_map(|device| {
        let id = device.id;
        [Symptom::StateLost(id), Symptom::WorkingCounter(id), Symptom::Emergency(id)]
    });
    Some(
        condition
            .explaining(follows)
            .advise("Restart the network: all clocks have to be set again.")
            .advise(
                "If it comes again, exchange this SubDevice, or choose another reference clock.",
            ),
    )
}

fn has_restarted(model: &NetworkModel, reference: &Reference, since: Instant) -> bool {
    let Some(device) = model.device(reference.device) else { return false };
    let is_near = |at: Instant| at <= since + AROUND && at + AROUND >= since;
    let falls = device.al.changes.iter().filter(|change| change.is_own_fall());
    let mut to_init = falls.filter(|change| change.to.state().state() == Some(AlState::Init));
    to_init.any(|change| is_near(change.at))
        || device.absences.iter().any(|absence| is_near(absence.since.at))
}
