//! One diagnosis held against the faults of a case.

use linesman_diagnosis::report::{Diagnosis, FindingReport, FindingState, Severity};
use linesman_proto::time::{Instant, Span};
use serde::{Deserialize, Serialize};

use super::parts::span_ns_or_none;
use crate::verdict::judge::{JudgedFault, may_be_common};
use crate::verdict::{Claim, Grade, Match, Naming, Scene, Truth, matches, repair};

/// What was said of a fault.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Judged {
    /// The finding that fits best among the first ones, by its name in the report; empty when nothing was said.
    pub finding: String,
    /// True if that finding is a note: nothing is wrong, but something is worth knowing.
    pub is_note: bool,
    /// True if the exchange of the part that it blames mends the fault.
    pub is_repaired: bool,
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
    #[serde(with = "span_ns_or_none")]
    pub named_after: Option<Span>,
}

impl Judged {
    /// Of a diagnosis that says nothing.
    pub(super) const fn silence() -> Self {
        Self {
            finding: String::new(),
            is_note: false,
            is_repaired: false,
            fits: Match::NONE,
            said: String::new(),
            confidence: 0.0,
            others: 0,
            findings: Vec::new(),
            cycles: None,
            named_after: None,
        }
    }

    /// True if cause and place are right or admitted.
    #[must_use]
    pub fn is_right(&self) -> bool {
        self.fits.cause.is_right() && self.fits.place.is_right()
    }
}

/// A finding's claim, with SubDevices by the identity of the project.
#[must_use]
pub fn claim(finding: &FindingReport, naming: Naming<'_>) -> Claim {
    Claim::of(finding).renamed(naming)
}

/// Findings of a diagnosis that are held against a fault.
#[derive(Clone, Copy, Debug)]
pub struct Candidates<'a> {
    /// When and in what company the fault acted.
    pub context: JudgedFault,
    /// Number of the first findings.
    pub among: usize,
    /// The finding that belongs to the other fault of the case.
    pub taken: Option<&'a str>,
}

/// Holds the first findings of a diagnosis against one of the faults of its case.
#[must_use]
pub fn judge(
    diagnosis: &Diagnosis,
    truth: &Truth,
    all: &[Truth],
    scene: &Scene<'_>,
    candidates: Candidates<'_>,
    naming: Naming<'_>,
) -> Judged {
    let Candidates { context, among, taken } = candidates;
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
    let free = |finding: &&FindingReport| taken != Some(finding.id.as_str());
    let graded = first().chain(beneath).filter(free).map(|finding| {
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
    let silence = Judged { others, findings, ..Judged::silence() };
    match best {
        _ if is_silent && let Some(set) = truth.unseen => {
            let admitted = Grade::Admitted(set.why);
            Judged { fits: Match { place: admitted, cause: admitted }, ..silence }
        }
        Some((finding, fits)) => Judged {
            finding: finding.id.clone(),
            is_note: finding.severity == Severity::Info,
            is_repaired: repair::mends(claim(finding, naming), truth, scene.tree),
            fits,
            said: text(finding, naming),
            confidence: finding.confidence,
            ..silence
        },
        None => silence,
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

/// Findings on a line on which nothing is wrong.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Accusations {
    /// Warnings and errors.
    pub alarms: Vec<String>,
    /// Notes.
    pub notes: Vec<String>,
}

impl Accusations {
    /// Of a diagnosis.
    #[must_use]
    pub fn of(diagnosis: &Diagnosis) -> Self {
        let is_note = |finding: &&FindingReport| finding.severity == Severity::Info;
        let (notes, alarms): (Vec<_>, Vec<_>) = diagnosis.findings.iter().partition(is_note);
        let texts = |findings: Vec<&FindingReport>| {
            findings.into_iter().map(|finding| text(finding, &|id| id)).collect()
        };
        Self { alarms: texts(alarms), notes: texts(notes) }
    }

    /// True if nothing was said at all.
    #[must_use]
    pub fn is_silent(&self) -> bool {
        self.alarms.is_empty() && self.notes.is_empty()
    }
}

/// A finding in a line.
fn text(finding: &FindingReport, naming: Naming<'_>) -> String {
    let claim = claim(finding, naming);
    let state = if finding.state == FindingState::Closed { ", closed" } else { "" };
    format!("{} {} at {}{state}", finding.code, claim.cause, claim.site)
}
