//! # Frames of one direction only
//!
//! The recording has requests without returns, or returns without requests.
//!
//! **How it is found.** Either all frames are marked and answered as frames on their way back are, or
//! none is, though the MainDevice goes on to talk to single SubDevices, which it does only after
//! answers.
//!
//! **What it means.** Nothing is wrong with the line. The tap or the mirror port passes one direction,
//! or the recorder filters the other one. Without both, lost frames and answers cannot be told apart.
//!
//! **What to do.** Record both directions: on the MainDevice's own card, or with a tap that has both.

use linesman_config::fault::{Class, FaultName};

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "X500",
    name: "one-direction",
    severity: Severity::Info,
    class: Class::Host,
    source: include_str!("one_direction.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

/// Fewer frames say nothing.
const ENOUGH: u64 = 8;

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let traffic = &view.model.traffic;
    if !traffic.is_one_sided() || traffic.requests.sent() + traffic.returns.count() < ENOUGH {
        return;
    }
    let at = traffic.recording.first().unwrap_or_default();
    let text = if traffic.requests.sent() == 0 {
        format!(
            "all {} frames are on their way back; no request was recorded",
            traffic.returns.count()
        )
    } else {
        format!(
            "all {} frames are on their way out; {} of their datagrams go to single SubDevices, so \
             answers came and were not recorded",
            traffic.requests.sent(),
            traffic.datagrams.lost_addressed()
        )
    };
    conditions.push(
        Condition::new(&PAGE, Place::Host, FaultName::OneSidedRecording, at)
            .confidence(0.9)
            .confirmed(view.now)
            .shown_by(Evidence::host(Some(at), text))
            .advise(
                "Record both directions: on the MainDevice's own card, or with a tap that passes \
                 both.",
            )
            .advise(
                "Check the recorder's filter, and whether a mirror port mirrors both directions.",
            )
            .explaining([Symptom::FramesLost]),
    );
}
