//! # A link changed, and nobody has read which
//!
//! While process data are exchanged, a SubDevice reports in passing that its DL status has changed.
//!
//! **How it is found.** Each controller ORs its events into the frames that pass it (event field of datagrams, 0x0210),
//! as far as the MainDevice's mask (0x0200) lets them through; SOEM and KickCAT let the change of DL status through.
//! The bit came while frames went on, and stands until somebody reads DL status (0x0110) of that SubDevice. Where
//! another finding tells of a link, or of a SubDevice that was away at that time, this is what it brought about, and
//! is no finding of its own. A bit that stands from the first frame on may be old: it only keeps the line from being
//! called healthy.
//!
//! **What it means.** A port of one of the SubDevices has lost its link, or found one: a contact that opened for a
//! moment, a cable that was moved, a device that started anew. DL status has also a bit for the processor of the
//! SubDevice, which falls when that stops. The field is one for all of them, so it does not say where.
//!
//! **What to do.** Read DL status (0x0110) and the lost-link counters (0x0310 to 0x0313) of all SubDevices: the counter
//! that has risen names the link.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::time::{Instant, Span};

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "H105",
    name: "link-changed",
    severity: Severity::Warning,
    class: Class::Hardware,
    source: include_str!("link_changed.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

/// What tells of a link is noticed so long before or after the event at most.
const AROUND: Span = Span::s(3);
/// So long after it the findings that explain it are there.
const SETTLED: Span = Span::s(1);
/// So many changes are a contact that comes and goes.
const FLAPS: u64 = 3;

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let model = view.model;
    let track = &model.events.dl_status;
    let (Some(first), Some(last)) = (track.first_came, model.changed_link()) else { return };
    let is_settled = view.has_ended || view.now.since(last.at) >= SETTLED;
    if !is_settled || is_told(conditions, last.at) {
        return;
    }
    let network = Place::Network { network: model.network };
    let (cause, sure, other) = if track.times >= FLAPS {
        (FaultName::LinkFlapping, 0.5, FaultName::LinkOpen)
    } else {
        (FaultName::LinkOpen, 0.35, FaultName::LinkFlapping)
    };
    let often = match track.times {
        1 => String::new(),
        times => format!(", {times} times by now"),
    };
    let text = format!(
        "the frames tell that DL status of a SubDevice has changed{often} (event field, bit 2); nobody has read whose"
    );
    let condition = Condition::new(&PAGE, network, cause, first.at)
        .confidence(sure)
        .or(other, 0.2)
        .or(FaultName::BrownOut, 0.15)
        .or(FaultName::FirmwareFault, 0.1)
        .confirmed(first.at)
        .shown_by(Evidence::frame(last.at, last.frame.unwrap_or(0), text))
        .advise(
            "Read DL status (0x0110) and the lost-link counters (0x0310 to 0x0313) of all SubDevices: the counter that \
             has risen names the link.",
        )
        .advise("Look at the lamps of the ports, and move the cables one after the other.");
    conditions.push(condition);
}

/// Whether another finding is about a link, a SubDevice that was away or a processor that stopped at that time.
fn is_told(conditions: &[Condition], at: Instant) -> bool {
    conditions.iter().any(|one| {
        let is_then =
            one.since.before(AROUND) <= at && one.ended.is_none_or(|ended| ended + AROUND >= at);
        let has_stopped = matches!(one.cause, FaultName::FirmwareFault | FaultName::MailboxStuck);
        let is_it = one.explains.iter().chain(&one.symptoms).any(|symptom| {
            matches!(
                symptom,
                Symptom::Silent(_)
                    | Symptom::LinkDown(..)
                    | Symptom::LinkCounted(..)
                    | Symptom::NobodyAnswers
                    | Symptom::WorkingCounter(_)
            )
        });
        is_then && (is_it || has_stopped || one.page.code == "S210")
    })
}
