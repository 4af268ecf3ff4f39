//! The report: a diagnosis as one self-contained page, to be mailed, printed and taken to the cabinet.
//!
//! No script, no file beside it, nothing fetched. [`findings`] says what is wrong and what to do,
//! [`timeline`] and [`events`] when, the [`drawing`](crate::drawing) where; [`devices`] lists what every SubDevice
//! showed.

mod coverage;
mod devices;
mod events;
mod findings;
mod prose;
pub(crate) mod scene;
mod timeline;
mod wall_clock;

use linesman_capture::CaptureReport;
use linesman_diagnosis::model::NetworkModel;
use linesman_diagnosis::report::{Diagnosis, Understood, Verdict};
use linesman_proto::time::Instant;
use maud::{DOCTYPE, Markup, PreEscaped, html};

use self::prose::prose;
use self::wall_clock::WallClock;
use crate::drawing::{self, time_axis};
use crate::text::diagnosis::{NOT_COMPLETE, numbers, source_name, told, word};
use crate::text::finding::Writer;
use crate::text::quantity::{count, date};

/// What the page looks like; on paper it is black on white, with boxes to tick.
const STYLE: &str = include_str!("style.css");

/// Statements of the user on the page's origin.
#[derive(Clone, Default, Debug, clap::Args)]
pub(crate) struct Origin {
    /// On the page: the machine that the line belongs to
    #[arg(long, value_name = "NAME", requires = "html")]
    machine: Option<String>,
    /// On the page: the person who made it
    #[arg(long, value_name = "NAME", requires = "html")]
    author: Option<String>,
}

/// The whole page. `at` is the end of the run; `capture` is what a recording shows by time.
pub(crate) fn page(
    diagnosis: &Diagnosis,
    line: Option<&NetworkModel>,
    capture: Option<&CaptureReport>,
    writer: &Writer<'_>,
    at: Instant,
    origin: &Origin,
) -> String {
    let clock = WallClock::of(diagnosis.start.as_deref());
    let scene = line.and_then(|line| scene::of_diagnosis(line, diagnosis, writer.names));
    let subject = origin.machine.as_deref().unwrap_or_else(|| source_name(&diagnosis.source));
    let title = format!("{subject}: {}", word(diagnosis.verdict));
    let is_inconclusive = diagnosis.verdict == Verdict::Inconclusive;
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="generator" content=(diagnosis.tool);
                title { (title) }
                style { (PreEscaped(STYLE)) (PreEscaped(drawing::STYLE)) (PreEscaped(time_axis::STYLE)) }
            }
            body {
                (head(diagnosis, origin, writer))
                main {
                    @if is_inconclusive { (coverage::section(diagnosis, writer)) }
                    (findings::overview(&diagnosis.findings, writer))
                    @if !is_inconclusive { (coverage::section(diagnosis, writer)) }
                    @if let Some(scene) = &scene {
                        section {
                            h2 { "The line" }
                            @let is_wide = scene.tree.len() >= drawing::NARROW;
                            div class={ "picture" @if is_wide { " spread" } } {
                                (drawing::draw(scene, drawing::WIDE, false))
                            }
                            @if is_wide {
                                div class="picture narrow" aria-hidden="true" {
                                    (drawing::draw(scene, drawing::NARROW, false))
                                }
                            }
                            p class="faint" {
                                "Boxes are SubDevices in their last known state, letters the ports of a \
                                 link. F1 marks the place of a finding; its arrow is the direction \
                                 of the frames that are concerned. A +12: errors counted at port A \
                                 during this look. From: a branch, drawn in a row of its own."
                            }
                        }
                    } @else if !diagnosis.devices.is_empty() {
                        section {
                            h2 { "The line" }
                            p class="faint" { "No drawing: how the line is wired was not seen." }
                        }
                    }
                    @if writer.timed { (timeline::section(&diagnosis.findings, at, clock, writer)) }
                    @if let Some(capture) = capture {
                        (events::section(capture, diagnosis, clock, writer.names))
                    }
                    (findings::section(&diagnosis.findings, clock, writer))
                    (devices::section(&diagnosis.devices, line))
                }
                footer { (foot(diagnosis, writer)) }
            }
        }
    }
    .into_string()
}

/// The style class of a verdict.
const fn class(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Healthy => "healthy",
        Verdict::Faulty => "faulty",
        Verdict::Inconclusive => "inconclusive",
    }
}

fn head(diagnosis: &Diagnosis, origin: &Origin, writer: &Writer<'_>) -> Markup {
    let start = diagnosis.start.as_deref().map(date);
    let origin = [("Machine", &origin.machine), ("Author", &origin.author)];
    html! {
        header class=(class(diagnosis.verdict)) {
            h1 { (word(diagnosis.verdict)) }
            p class="told" { (told(diagnosis)) }
            dl class="origin" {
                @for (field, name) in origin {
                    @if let Some(name) = name { dt { (field) } dd { (name) } }
                }
                dt { "Input" } dd { (source_name(&diagnosis.source)) }
                @if let Some(start) = &start {
                    dt { "Begun" } dd { (start) "; times count from there" }
                }
            }
            ul class="numbers" { @for number in numbers(diagnosis, writer.timed) { li { (number) } } }
            @if !diagnosis.complete { p class="warning" { (NOT_COMPLETE) } }
            @if let Some(understood) = &diagnosis.understood { (reading_of(understood)) }
        }
    }
}

/// What was understood of a pasted text, and what not.
fn reading_of(understood: &Understood) -> Markup {
    html! {
        ul {
            @for block in &understood.blocks {
                li { "understood, lines " (block.from) " to " (block.to) ": " (prose(&block.what)) }
            }
            @for assumed in &understood.assumed { li { "assumed: " (prose(assumed)) } }
            @if understood.ignored_count > 0 {
                li { (count(understood.ignored_count as u64, "line")) " not understood" }
            }
        }
    }
}

fn foot(diagnosis: &Diagnosis, writer: &Writer<'_>) -> Markup {
    html! {
        p {
            (diagnosis.tool) ". Times count from the start of the run"
            @if writer.timed { "; clock: " (diagnosis.clock) }
            ". How each finding is made: " code { "linesman explain CODE" } "."
        }
    }
}
