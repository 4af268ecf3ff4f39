//! One diagnosis held against the faults of a case.

use linesman_diagnosis::report::{Diagnosis, FindingReport, FindingState, Severity};
use linesman_proto::address::DeviceId;
use linesman_proto::time::Instant;
use linesman_proto::topology::End;

use crate::verdict::{Claim, Grade, Match, Scene, Site, Truth, matches};

/// How a diagnosis calls the SubDevices: by the identity of the project, unless it had none.
pub type Naming<'a> = &'a dyn Fn(DeviceId) -> DeviceId;

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
    /// Cycles from the first effect to the first finding at the right place, where that is known.
    pub cycles: Option<u64>,
}

/// A finding's claim, with SubDevices by the identity of the project.
#[must_use]
pub fn claim(finding: &FindingReport, naming: Naming<'_>) -> Claim {
    let claim = Claim::of(finding);
    let end = |end: End<DeviceId>| match end {
        End::Controller(id, port) => End::Controller(naming(id), port),
        End::MainDevice(_) => end,
    };
    let site = match claim.site {
        Site::Device(id) => Site::Device(naming(id)),
        Site::Link { a, b, way } => Site::Link { a: end(a), b: b.map(end), way },
        Site::Host | Site::Network => claim.site,
    };
    Claim { site, ..claim }
}

/// Holds the first `among` findings of a diagnosis against one of the faults of its case.
#[must_use]
pub fn judge(
    diagnosis: &Diagnosis,
    truth: &Truth,
    all: &[Truth],
    scene: &Scene<'_>,
    (began, among): (Instant, usize),
    naming: Naming<'_>,
) -> Judged {
    let of_its_time: Vec<&FindingReport> = diagnosis
        .findings
        .iter()
        .filter(|finding| finding.closed_ns.is_none_or(|closed| closed.0 >= began.as_nanos()))
        .collect();
    let graded = of_its_time.iter().take(among).map(|finding| {
        let fits = matches(truth, scene, claim(finding, naming));
        (*finding, fits)
    });
    let best = graded.max_by_key(|(_, fits)| (fits.cause.is_right(), fits.place, fits.cause));
    let others = of_its_time.iter().filter(|finding| {
        finding.severity != Severity::Info && !is_explained(finding, all, scene, naming)
    });
    let others = others.count() as u64;
    match best {
        Some((finding, fits)) => Judged {
            fits,
            said: text(finding, naming),
            confidence: finding.confidence,
            others,
            cycles: None,
        },
        None => {
            Judged { fits: Match::NONE, said: String::new(), confidence: 0.0, others, cycles: None }
        }
    }
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
