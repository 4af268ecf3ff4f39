//! One diagnosis held against the faults of a case.

use linesman_diagnosis::report::{Diagnosis, FindingReport, FindingState, Severity};
use linesman_proto::time::{Instant, Span};

use crate::verdict::judge::{JudgedFault, may_be_common};
use crate::verdict::{Claim, Grade, Match, Naming, Scene, Truth, matches};

/// What was said of a fault.
#[derive(Clone, PartialEq, Debug)]
pub struct Judged {
    /// How well the first findings fit: as many of them as there are faults.
    pub fits: Match,
    /// The finding, in words; empty when nothing was said.
    pub said: String,
    /// How sure it was.
    pub confidence: f64,
    /// Findings beside it that no fault explains.
    pub others: u64,
    /// All that was said, in the order in which it was said.
    pub findings: Vec<String>,
    /// Cycles from the first effect to the first finding at the right place, where that is known.
    pub cycles: Option<u64>,
    /// From the first effect to the first finding with the right cause at the right place, where that is
    /// known.
    pub named_after: Option<Span>,
}

/// A finding's claim, with SubDevices by the identity of the project.
#[must_use]
pub fn claim(finding: &FindingReport, naming: Naming<'_>) -> Claim {
    Claim::of(finding).renamed(naming)
}

/// Holds the first `among` findings of a diagnosis against one of the faults of its case.
#[must_use]
pub fn judge(
    diagnosis: &Diagnosis,
    truth: &Truth,
    all: &[Truth],
    scene: &Scene<'_>,
    (context, among): (JudgedFault, usize),
    naming: Naming<'_>,
) -> Judged {
    let began = context.began.unwrap_or(Instant::ZERO);
    let of_its_time: Vec<&FindingReport> = diagnosis
        .findings
        .iter()
        .filter(|finding| finding.closed_ns.is_none_or(|closed| closed.0 >= began.as_nanos()))
        .collect();
    let first = || of_its_time.iter().take(among).copied();
    // Two faults that began together may look like one source: then one of them hangs beneath.
    let beneath = first()
        .filter(|finding| context.is_shared && may_be_common(finding.cause))
        .flat_map(|finding| &finding.consequences);
    let graded = first().chain(beneath).map(|finding| {
        let fits = matches(truth, scene, claim(finding, naming));
        (finding, fits)
    });
    let best = graded.max_by_key(|(_, fits)| (fits.cause.is_right(), fits.place, fits.cause));
    let others = of_its_time.iter().filter(|finding| {
        finding.severity != Severity::Info && !is_explained(finding, all, scene, naming)
    });
    let others = others.count() as u64;
    let findings = of_its_time.iter().map(|finding| text(finding, naming)).collect();
    let is_silent = of_its_time.iter().all(|finding| finding.severity == Severity::Info);
    let (fits, said, confidence) = match best {
        _ if is_silent && let Some(set) = truth.unseen => {
            let silence = Grade::Admitted(set.why);
            (Match { place: silence, cause: silence }, String::new(), 0.0)
        }
        Some((finding, fits)) => (fits, text(finding, naming), finding.confidence),
        None => (Match::NONE, String::new(), 0.0),
    };
    Judged { fits, said, confidence, others, findings, cycles: None, named_after: None }
}

/// Whether any of the faults allows a finding at its place.
fn is_explained(
    finding: &FindingReport,
    all: &[Truth],
    scene: &Scene<'_>,
    naming: Naming<'_>,
) -> bool {
    let claim = claim(finding, naming);
    // It may have been made while the line was silent, or since.
    let scenes = [false, true].map(|answered_again| Scene { answered_again, ..*scene });
    all.iter()
        .any(|truth| scenes.iter().any(|scene| matches(truth, scene, claim).place != Grade::Wrong))
}

/// What a healthy line was accused of.
#[must_use]
pub fn alarms(diagnosis: &Diagnosis) -> Vec<String> {
    let warned = diagnosis.findings.iter().filter(|finding| finding.severity != Severity::Info);
    warned.map(|finding| text(finding, &|id| id)).collect()
}

/// A finding in a line.
fn text(finding: &FindingReport, naming: Naming<'_>) -> String {
    let claim = claim(finding, naming);
    let state = if finding.state == FindingState::Closed { ", closed" } else { "" };
    format!("{} {} at {}{state}", finding.code, claim.cause, claim.site)
}
