//! Findings of a page, worst first: where, why, how it is known, what to do, what follows from it.

use linesman_diagnosis::report::{EvidenceReport, FindingReport, FindingState, Number};
use maud::{Markup, html};

use super::prose::prose;
use super::wall_clock::WallClock;
use crate::hint;
use crate::text::finding::{Writer, others, percent, register_value, severity_word, when_by};
use crate::text::quantity::time;

/// Most pieces of evidence in a table; a page with thousands of rows helps nobody.
const MOST_EVIDENCE: usize = 200;

/// What to look at first: place and first action of each finding, to tick off.
pub(super) fn overview(findings: &[FindingReport], writer: &Writer<'_>) -> Markup {
    html! {
        @if !findings.is_empty() {
            section {
                h2 { "What to do" }
                ol class="checklist" {
                    @for finding in findings {
                        li {
                            a href={ "#" (finding.id) } { (finding.id) } " "
                            b { (writer.names.place(&finding.place)) } ": "
                            (finding.cause) " (" (percent(finding.confidence)) ")"
                            ul {
                                @for action in &finding.actions {
                                    li { span class="tick" {} (prose(&hint::complete(action, writer.place))) }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Each finding in full.
pub(super) fn section(findings: &[FindingReport], clock: WallClock, writer: &Writer<'_>) -> Markup {
    html! {
        @if !findings.is_empty() {
            section {
                h2 { "Findings" }
                @for finding in findings { (article(finding, clock, writer)) }
            }
        }
    }
}

fn article(finding: &FindingReport, clock: WallClock, writer: &Writer<'_>) -> Markup {
    html! {
        article id=(finding.id) class=(severity_word(finding.severity)) {
            h3 {
                span class="tag" { (severity_word(finding.severity)) } " "
                (finding.id) " " (finding.code) " " (finding.name)
                span class="faint" { (over(finding.state)) }
            }
            dl {
                dt { "Where" } dd { (writer.names.place(&finding.place)) }
                dt { "Why" }
                dd {
                    b { (finding.cause) } " (" (percent(finding.confidence)) "): " (finding.cause.meaning())
                }
                @for other in others(finding) {
                    dt { "Or" }
                    dd {
                        b { (other.cause) } " (" (percent(other.confidence)) "): " (other.cause.meaning())
                        @if let Some(place) = &other.place { " There: " (writer.names.place(place)) "." }
                        @if let Some(by) = &other.told_apart_by {
                            br; span class="faint" { "Told apart by: " (prose(by)) "." }
                        }
                    }
                }
                @if writer.timed { dt { "When" } dd { (when_by(finding, |ns| clock.both(ns))) } }
            }
            (evidence(&finding.evidence, clock, writer))
            (consequences(&finding.consequences, clock, writer))
        }
    }
}

fn evidence(all: &[EvidenceReport], clock: WallClock, writer: &Writer<'_>) -> Markup {
    html! {
        @if !all.is_empty() {
            details open[all.len() <= 12] {
                summary { "How it is known (" (all.len()) ")" }
                div class="wide" { table {
                    thead {
                        tr {
                            @if writer.timed {
                                th { "time" }
                                @if clock.is_known() { th { "clock" } }
                                th { "frame" }
                            }
                            th { "SubDevice" } th { "register" } th { "before" } th { "after" }
                            th { "what was seen" }
                        }
                    }
                    tbody {
                        @for one in all.iter().take(MOST_EVIDENCE) { (row(one, clock, writer)) }
                    }
                } }
                @if all.len() > MOST_EVIDENCE {
                    p class="faint" {
                        "and " (all.len() - MOST_EVIDENCE) " more, in the JSON of the same diagnosis"
                    }
                }
            }
        }
    }
}

fn row(one: &EvidenceReport, clock: WallClock, writer: &Writer<'_>) -> Markup {
    let moment = one.time_ns.and_then(|Number(at)| clock.time_of_day(at));
    let value = |value: Option<Number>| value.map(|Number(value)| register_value(one, value));
    html! {
        tr {
            @if writer.timed {
                td class="number" { @if let Some(Number(at)) = one.time_ns { (time(at)) } }
                @if clock.is_known() { td class="number" { (moment.unwrap_or_default()) } }
                td class="number" { @if let Some(Number(frame)) = one.frame { (frame) } }
            }
            td {
                @if let Some(no) = one.no {
                    (writer.names.device(no)) @if let Some(port) = one.port { " port " (port) }
                }
            }
            td { @if let Some(register) = one.register { (format!("0x{register:04X}")) } }
            td class="number" { (value(one.before).unwrap_or_default()) }
            td class="number" { (value(one.after).unwrap_or_default()) }
            td { (prose(&one.text)) }
        }
    }
}

fn consequences(all: &[FindingReport], clock: WallClock, writer: &Writer<'_>) -> Markup {
    html! {
        @if !all.is_empty() {
            details open[all.len() <= 8] {
                summary { "What follows from it (" (all.len()) ")" }
                ul {
                    @for one in all {
                        li {
                            (one.id) " " (one.code) " " (one.name) ": " (writer.names.place(&one.place))
                            @if writer.timed { ", " (when_by(one, |ns| clock.both(ns))) }
                            (consequences(&one.consequences, clock, writer))
                        }
                    }
                }
            }
        }
    }
}

const fn over(state: FindingState) -> &'static str {
    match state {
        FindingState::Opened => " not certain yet",
        FindingState::Confirmed => "",
        FindingState::Closed => " over",
    }
}
