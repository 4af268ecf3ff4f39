//! # Frames come back late, as the MainDevice itself counts
//!
//! The MainDevice gave frames up that came back after all, or could not send because others were still out.
//!
//! **How it is found.** An observation file or a kernel log tells it: late frames, datagrams `UNMATCHED` (they came
//! back, and nobody waited for them any more), `SKIPPED` (not sent, since the one before was still out), cycles of
//! the application that began late. Datagrams that `TIMED OUT` alone are lost as likely as late (`H114`).
//!
//! **What it means.** The line is well: a frame that comes back late was not damaged. The computer reads its card too
//! late, the card holds frames back (interrupt moderation), the cycle is shorter than the frames take, or a switch
//! stands in between. While links come and go frames are late and lost, too: then it is listed beneath.
//!
//! **What to do.** `linesman host --measure 10` tells how late this computer is, and what mends it. Switch off
//! interrupt moderation (`ethtool -C eth0 rx-usecs 0`), and take a driver that polls. Let the cycle be longer than
//! the frames of all domains together.

use linesman_config::fault::{Class, FaultName};

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};
use crate::model::Tally;

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "T412",
    name: "late-as-counted",
    severity: Severity::Warning,
    class: Class::Timing,
    source: include_str!("reported_late.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

/// So few are what any computer has now and then.
const FEW: u64 = 2;

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let reported = &view.model.reported;
    let told = [
        (reported.late, "frames came back after they were given up"),
        (reported.unmatched, "datagrams came back and nobody waited for them any more (UNMATCHED)"),
        (
            reported.skipped,
            "datagrams were not sent, because the one before was still out (SKIPPED)",
        ),
        (reported.late_cycles, "cycles of the application began late"),
    ];
    let told: Vec<(Tally, &str)> = told
        .into_iter()
        .filter_map(|(tally, what)| Some((tally.filter(|tally| tally.sum > 0)?, what)))
        .collect();
    let Some(first) = told.iter().filter_map(|(tally, _)| tally.first).min() else { return };
    let sum = told.iter().fold(0_u64, |sum, (tally, _)| sum.saturating_add(tally.sum));
    let begins_late = reported.late_cycles.is_some_and(|tally| tally.sum > 0);
    let (cause, other) = match begins_late {
        true => (FaultName::HostJitter, FaultName::LateFrames),
        false => (FaultName::LateFrames, FaultName::HostJitter),
    };
    // Where a link came or went, frames are lost and late for that.
    let is_cut = conditions.iter().any(|one| {
        matches!(one.page.code, "H100" | "H101" | "H104")
            && one.explains.contains(&Symptom::FramesLost)
    });
    let symptom = if is_cut { Symptom::FramesLost } else { Symptom::FramesLate };
    let mut condition = Condition::new(&PAGE, Place::Host, cause, first)
        .confidence(0.5)
        .or(other, 0.3)
        .or_at(FaultName::SecondMainDevice, Place::Network { network: view.model.network }, 0.05)
        .confirmed(first)
        .about([symptom])
        .advise("Run `linesman host --measure 10`: it tells what makes this computer late, and what mends it.")
        .advise("Switch off interrupt moderation of the card: `ethtool -C eth0 rx-usecs 0`.");
    if sum <= FEW {
        condition.severity = Severity::Info;
    }
    for (tally, what) in told {
        let text = match reported.cycle {
            Some(cycle) => format!("{} {what}; the cycle is {cycle}", tally.sum),
            None => format!("{} {what}", tally.sum),
        };
        condition = condition.shown_by(Evidence::host(tally.last, text));
    }
    if reported.skipped.is_some_and(|tally| tally.sum > 0) {
        condition =
            condition.advise("Lengthen the cycle, or spread the domains over several cycles.");
    }
    let devices = view.model.devices.iter().map(|device| device.id);
    conditions.push(condition.explaining(devices.map(Symptom::StateLost).filter(|_| begins_late)));
}
