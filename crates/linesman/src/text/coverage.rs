//! Coverage of a verdict in words: what was judged, what was not, and the next step that would get it.

use linesman_diagnosis::coverage::Extent;
use linesman_diagnosis::report::coverage::{GapReport, SubjectReport};
use linesman_diagnosis::report::{Diagnosis, PlaceReport, Verdict};

use super::finding::Writer;
use crate::output::wrapped;

/// Places that are named one by one.
const NAMED: usize = 3;

/// What was judged and what not.
pub(crate) fn write(diagnosis: &Diagnosis, writer: &Writer<'_>) -> String {
    let mut text = String::new();
    if diagnosis.verdict == Verdict::Inconclusive {
        for gap in diagnosis.coverage.essential_gaps() {
            add(&mut text, "missing", &with_places(gap, writer), writer);
            if let Some(step) = &gap.next_step {
                add(&mut text, "", &format!("do: {step}"), writer);
            }
        }
    }
    let subjects = &diagnosis.coverage.subjects;
    let of = |extent: Extent| subjects.iter().filter(move |one| one.extent == extent);
    let names: Vec<&str> = of(Extent::Judged).map(|one| one.subject.words()).collect();
    if !names.is_empty() {
        add(&mut text, "judged", &names.join(", "), writer);
    }
    for (heading, extent) in [("in part", Extent::InPart), ("not", Extent::NotJudged)] {
        let lacking: Vec<String> = of(extent).map(|one| with_reasons(one, writer)).collect();
        if !lacking.is_empty() {
            add(&mut text, heading, &lacking.join("; "), writer);
        }
    }
    text
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
