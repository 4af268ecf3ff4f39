//! Coverage of the verdict in the report.

use linesman_config::fault::FaultName;
use serde::{Deserialize, Serialize};

use super::{PlaceReport, build};
use crate::coverage::{Coverage, Extent, Gap, Reason, Subject};

/// What could be judged, and what not.
#[derive(Clone, PartialEq, Default, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct CoverageReport {
    /// Whether enough was judged to call a line healthy of which nothing is said.
    pub suffices: bool,
    /// Subject by subject: kinds of fault that show in the same evidence.
    pub subjects: Vec<SubjectReport>,
}

/// How far one subject was judged.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SubjectReport {
    /// The subject.
    pub subject: Subject,
    /// How far it was judged.
    pub extent: Extent,
    /// The kinds of fault that show in it.
    pub faults: Vec<FaultName>,
    /// What was missing; whatever is not named here was judged.
    pub gaps: Vec<GapReport>,
}

/// Something that was missing.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct GapReport {
    /// Why.
    pub reason: Reason,
    /// Whether the line cannot be called healthy because of it.
    pub essential: bool,
    /// Where: links with the direction, SubDevices; empty for the network as a whole.
    pub places: Vec<PlaceReport>,
    /// In words.
    pub text: String,
    /// The next step that would get it; `null` where there is none.
    pub next_step: Option<String>,
}

impl CoverageReport {
    /// What keeps the line from being called healthy.
    pub fn essential_gaps(&self) -> impl Iterator<Item = &GapReport> {
        self.subjects.iter().flat_map(|one| &one.gaps).filter(|gap| gap.essential)
    }
}

/// The coverage as part of the answer.
#[must_use]
pub fn report(coverage: &Coverage) -> CoverageReport {
    let subjects = coverage.assessments.iter().map(|one| SubjectReport {
        subject: one.subject,
        extent: one.extent,
        faults: one.subject.faults().collect(),
        gaps: one.gaps.iter().map(gap).collect(),
    });
    CoverageReport { suffices: coverage.suffices(), subjects: subjects.collect() }
}

fn gap(gap: &Gap) -> GapReport {
    GapReport {
        reason: gap.reason,
        essential: gap.is_essential,
        places: gap.places.iter().map(build::place).collect(),
        text: gap.text.clone(),
        next_step: Some(gap.next_step.clone()).filter(|step| !step.is_empty()),
    }
}
