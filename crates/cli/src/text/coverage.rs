//! Coverage of a verdict in words: what was judged, what was not, and the next step that would get it.

use linesman_diagnosis::coverage::Extent;
use linesman_diagnosis::report::coverage::{GapReport, SubjectReport};
use linesman_diagnosis::report::{Diagnosis, PlaceReport, Verdict};

use super::finding::Writer;
use crate::hint;
use crate::output::wrapped;

/// Places that are named one by one.
const NAMED: usize = 3;

/// A statement on the coverage, for text and page alike.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Row {
    /// The kind of statement.
    pub(crate) kind: Kind,
    /// The statement.
    pub(crate) words: String,
}

/// Kinds of statements on the coverage.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Kind {
    /// Evidence without which the line cannot be called healthy.
    Missing,
    /// The step that gets the evidence named before.
    NextStep,
    /// Subjects that were judged.
    Judged,
    /// Subjects that were judged in part, with the reasons.
    InPart,
    /// Subjects that were not judged, with the reasons.
    NotJudged,
}

impl Kind {
    /// The heading of the statement.
    pub(crate) const fn heading(self) -> &'static str {
        match self {
            Self::Missing => "missing",
            Self::NextStep => "do",
            Self::Judged => "judged",
            Self::InPart => "in part",
            Self::NotJudged => "not",
        }
    }
}

/// The coverage as lines of text.
pub(crate) fn write(diagnosis: &Diagnosis, writer: &Writer<'_>) -> String {
    let mut text = String::new();
    for row in rows(diagnosis, writer) {
        match row.kind {
            // It belongs to what is missing, above it.
            Kind::NextStep => add(&mut text, "", &format!("do: {}", row.words), writer),
            kind @ (Kind::Missing | Kind::Judged | Kind::InPart | Kind::NotJudged) => {
                add(&mut text, kind.heading(), &row.words, writer);
            }
        }
    }
    text
}

/// All statements on the coverage, in the order in which they are read.
pub(crate) fn rows(diagnosis: &Diagnosis, writer: &Writer<'_>) -> Vec<Row> {
    let mut rows = Vec::new();
    let mut add = |kind: Kind, words: String| rows.push(Row { kind, words });
    if diagnosis.verdict == Verdict::Inconclusive {
        for gap in diagnosis.coverage.essential_gaps() {
            add(Kind::Missing, with_places(gap, writer));
            if let Some(step) = &gap.next_step {
                add(Kind::NextStep, hint::complete(step, writer.place));
            }
        }
    }
    let subjects = &diagnosis.coverage.subjects;
    let of = |extent: Extent| subjects.iter().filter(move |one| one.extent == extent);
    let names: Vec<&str> = of(Extent::Judged).map(|one| one.subject.words()).collect();
    if !names.is_empty() {
        add(Kind::Judged, names.join(", "));
    }
    for (kind, extent) in [(Kind::InPart, Extent::InPart), (Kind::NotJudged, Extent::NotJudged)] {
        let lacking: Vec<String> = of(extent).map(|one| with_reasons(one, writer)).collect();
        if !lacking.is_empty() {
            add(kind, lacking.join("; "));
        }
    }
    rows
}

/// `error counters (nobody read them)`.
fn with_reasons(subject: &SubjectReport, writer: &Writer<'_>) -> String {
    let reasons: Vec<String> = subject.gaps.iter().map(|gap| with_places(gap, writer)).collect();
    format!("{} ({})", subject.subject.words(), reasons.join("; "))
}

fn with_places(gap: &GapReport, writer: &Writer<'_>) -> String {
    // Most texts name SubDevices themselves.
    let links: Vec<String> = gap
        .places
        .iter()
        .filter(|place| matches!(place, PlaceReport::Link { .. }))
        .map(|place| writer.names.place(place))
        .collect();
    match links.len() {
        0 => gap.text.clone(),
        1..=NAMED => format!("{}: {}", gap.text, links.join(", ")),
        more => format!("{}: {}, and {} more", gap.text, links[..NAMED].join(", "), more - NAMED),
    }
}

fn add(text: &mut String, heading: &str, words: &str, writer: &Writer<'_>) {
    let first = format!("  {}", writer.paint.faint(&format!("{heading:<9}")));
    text.push_str(&wrapped(&first, words, writer.width));
}
