//! A listener's answer held against the fault of its case.

use linesman_config::fault::FaultName::{self, *};
use linesman_diagnosis::report::{Diagnosis, FindingReport, Verdict};

use super::super::judge::{Accusations, Candidates, Judged, judge};
use super::super::trace::Trace;
use super::{Listened, Outcome};
use crate::verdict::judge::{JudgedFault, is_left_open, may_be};
use crate::verdict::{Naming, Scene, Truth};

/// What lost frames may be, where nothing but the frames is known.
pub(super) const LOSSES: [FaultName; 9] = [
    CableDegraded,
    EmcNoise,
    TransmitterDamaged,
    ReceiverDamaged,
    DeviceInternal,
    NicDamaged,
    HostDrops,
    LinkFlapping,
    FalseLink,
];

/// Holds what a listener said against the fault; `traces` are signs of trouble in the frames that it heard.
pub(in crate::score) fn judge_listener(
    said: Option<&Diagnosis>,
    truth: &Truth,
    all: &[Truth],
    scene: &Scene<'_>,
    context: JudgedFault,
    naming: Naming<'_>,
    traces: &[Trace],
) -> Listened {
    let Some(diagnosis) = said else {
        return Listened {
            judged: Judged { said: "nothing was heard".to_owned(), ..Judged::silence() },
            outcome: Outcome::Open,
            is_named: false,
            verdict: None,
        };
    };
    let mut judged =
        judge(diagnosis, truth, all, scene, Candidates { context, among: 1, taken: None }, naming);
    let first = diagnosis.findings.first();
    let is_quiet = Accusations::of(diagnosis).alarms.is_empty();
    let outcome = if judged.fits.place.is_right() {
        Outcome::Found
    } else if is_quiet && traces.is_empty() {
        Outcome::NoTrace
    } else if is_quiet {
        match diagnosis.verdict {
            Verdict::Inconclusive | Verdict::Faulty => Outcome::Open,
            Verdict::Healthy => Outcome::Missed,
        }
    } else if first.is_some_and(|first| is_left_open(first, truth, scene, naming)) {
        Outcome::Open
    } else {
        Outcome::Wrong
    };
    if judged.said.is_empty() || (is_quiet && outcome != Outcome::Found) {
        judged.said = match diagnosis.verdict {
            Verdict::Healthy => {
                let traces: Vec<&str> = traces.iter().map(|trace| trace.name()).collect();
                let beside = if traces.is_empty() { "" } else { " beside " };
                format!("healthy{beside}{}", traces.join(", "))
            }
            Verdict::Faulty => "faulty".to_owned(),
            Verdict::Inconclusive => {
                let gaps = diagnosis.coverage.essential_gaps().map(|gap| gap.text.as_str());
                format!("inconclusive: {}", gaps.collect::<Vec<_>>().join("; "))
            }
        };
    }
    let is_named =
        judged.fits.cause.is_right() || first.is_some_and(|first| names(first, truth.name));
    Listened { judged, outcome, is_named, verdict: Some(diagnosis.verdict) }
}

/// Whether a finding names a fault as its cause, or as one of the others that it may be. Of what may cost frames, all
/// that it names must be able to.
fn names(finding: &FindingReport, fault: FaultName) -> bool {
    let mut named = may_be(finding);
    let is_set = !LOSSES.contains(&fault) || named.clone().all(|one| LOSSES.contains(&one));
    is_set && named.any(|one| one == fault)
}
