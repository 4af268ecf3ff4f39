//! The report: a diagnosis as one self-contained page, to be mailed, printed and taken to the cabinet.
//!
//! No script, no file beside it, nothing fetched. [`findings`] says what is wrong and what to do,
//! [`timeline`] when, the [`drawing`](crate::drawing) where; [`devices`] lists what every SubDevice
//! showed.

mod devices;
mod findings;
pub(crate) mod scene;
mod timeline;

use linesman_diagnosis::line::Line;
use linesman_diagnosis::report::{Diagnosis, Understood, Verdict};
use linesman_proto::time::Instant;
use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::command::diagnose::READINGS;
use crate::drawing;
use crate::text::finding::{Writer, tally};
use crate::text::quantity::count;

/// What the page looks like; on paper it is black on white, with boxes to tick.
const STYLE: &str = include_str!("style.css");

/// The whole page. `at` is the end of the run.
pub(crate) fn page(
    diagnosis: &Diagnosis,
    line: Option<&Line>,
    writer: &Writer<'_>,
    at: Instant,
) -> String {
    let scene = line.and_then(|line| scene::of_diagnosis(line, diagnosis, writer.names));
    let title = format!("{}: {}", diagnosis.source, word(diagnosis.verdict));
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="generator" content=(diagnosis.tool);
                title { (title) }
                style { (PreEscaped(STYLE)) (PreEscaped(drawing::STYLE)) }
            }
            body {
                (head(diagnosis, writer))
                main {
                    (findings::overview(&diagnosis.findings, writer))
                    @if let Some(scene) = &scene {
                        section {
                            h2 { "The line" }
                            div class="picture" { (drawing::draw(scene, false)) }
                            p class="faint" {
                                "Boxes are SubDevices in their last known state, letters the ports of a \
                                 link. A disc marks the place of a finding, → away from the \
                                 MainDevice, ← towards it. +n: errors counted at that port during \
                                 this look."
                            }
                        }
                    }
                    @if writer.timed { (timeline::section(&diagnosis.findings, at, writer)) }
                    (findings::section(&diagnosis.findings, writer))
                    @if let Some(line) = line { (devices::section(line)) }
                }
                footer { (foot(diagnosis, writer)) }
            }
        }
    }
    .into_string()
}

const fn word(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Healthy => "healthy",
        Verdict::Faulty => "faulty",
        Verdict::Inconclusive => "inconclusive",
    }
}

fn head(diagnosis: &Diagnosis, writer: &Writer<'_>) -> Markup {
    let network = &diagnosis.network;
    let told = match diagnosis.verdict {
        Verdict::Healthy => "Nothing is wrong with the line.".to_owned(),
        Verdict::Faulty => format!("{}.", tally(&diagnosis.findings)),
        Verdict::Inconclusive => "Too little was seen to call the line healthy.".to_owned(),
    };
    html! {
        header class=(word(diagnosis.verdict)) {
            h1 { (word(diagnosis.verdict).to_uppercase()) }
            p class="told" { (told) }
            p { (diagnosis.source) @if let Some(start) = &diagnosis.start { ", begun " (start) } }
            ul class="numbers" {
                li { (count(network.devices.0, "SubDevice")) }
                @if let Some(state) = &network.al_state_highest { li { "highest state " (state) } }
                @if writer.timed && diagnosis.clock != READINGS {
                    li { (count(network.frames.0, "frame")) }
                    li { (count(network.datagrams.0, "datagram")) ", " (network.unanswered.0) " unanswered" }
                    li { (count(network.lost.0, "frame")) " lost" }
                    li { (count(network.damaged.0, "frame")) " seen damaged" }
                }
            }
            @if !diagnosis.complete {
                p class="warning" { "The input could not be read to its end: judged as far as it goes." }
            }
            @if let Some(understood) = &diagnosis.understood { (reading_of(understood)) }
        }
    }
}

/// What was understood of a pasted text, and what not.
fn reading_of(understood: &Understood) -> Markup {
    html! {
        ul {
            @for block in &understood.blocks {
                li { "understood, lines " (block.from) " to " (block.to) ": " (block.what.replace('`', "")) }
            }
            @for assumed in &understood.assumed { li { "assumed: " (assumed) } }
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
            @if let Some(start) = &diagnosis.start { " (" (start) ")" }
            @if writer.timed { "; clock: " (diagnosis.clock) }
            ". How each finding is made: " code { "linesman explain CODE" } "."
        }
    }
}
