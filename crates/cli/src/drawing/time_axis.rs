//! Time line of a capture as SVG: a lane for the states of each SubDevice, and lanes for what happened.

use linesman_capture::CaptureReport;
use linesman_capture::network::states::StateEvent;
use linesman_capture::timing::timeline::{TimelineEventKind, TimelineReport};
use maud::{Markup, PreEscaped, html};

use crate::text::names::Names;
use crate::text::quantity::time;

/// Most SubDevices that have a lane.
const MOST_LANES: usize = 64;
/// Columns of names, and of time.
const NAMES: f64 = 180.0;
const TIMES: f64 = 820.0;
/// Height of a lane.
const LANE: usize = 20;
/// The narrowest bar.
const LEAST: f64 = 1.5;
/// Steps of the axis.
const STEPS: u64 = 5;

/// Colours, for the page or file that the drawing is part of.
pub(crate) const STYLE: &str = "\
.time-axis text{font:11px sans-serif;fill:#222}.time-axis .faint{fill:#777}.time-axis .grid{stroke:#ddd}\
.time-axis .INIT{fill:#b9c0c8}.time-axis .BOOT{fill:#b59be0}.time-axis .PREOP{fill:#f2d16b}\
.time-axis .SAFEOP{fill:#8fc7ee}.time-axis .OP{fill:#7cc98a}.time-axis .error{fill:#d9534f}\
.time-axis .trouble{fill:#d9534f}.time-axis .event{fill:#4a6fa5}";

/// Lanes beside those of states.
const KINDS: [(TimelineEventKind, &str); 6] = [
    (TimelineEventKind::StateAsked, "states asked for"),
    (TimelineEventKind::Mailbox, "mailboxes"),
    (TimelineEventKind::WorkingCounter, "working counters too low"),
    (TimelineEventKind::Counter, "error counters"),
    (TimelineEventKind::Gap, "no frames"),
    (TimelineEventKind::Finding, "findings"),
];

/// The drawing as a file.
pub(crate) fn file(told: &TimelineReport, report: &CaptureReport, names: &Names) -> String {
    draw(told, report, names, true).into_string()
}

/// The drawing; with `styled` it brings its colours along.
pub(crate) fn draw(
    told: &TimelineReport,
    report: &CaptureReport,
    names: &Names,
    styled: bool,
) -> Markup {
    let end = told.lasts_ns.0.max(1);
    let devices = &report.devices[..report.devices.len().min(MOST_LANES)];
    let kinds: Vec<_> = KINDS
        .iter()
        .filter(|(kind, _)| told.events.iter().any(|event| event.kind == *kind))
        .collect();
    let height = LANE * (devices.len() + kinds.len() + 2);
    let width = NAMES + TIMES + 20.0;
    let lanes = devices.iter().enumerate();
    html! {
        svg xmlns="http://www.w3.org/2000/svg" class="time-axis" viewBox=(format!("0 0 {width} {height}"))
            width=(width) height=(height) {
            @if styled { style { (PreEscaped(STYLE)) } }
            (axis(end, height))
            @for (lane, device) in lanes {
                @let no = device.about.no;
                text x="4" y=(LANE * lane + 14) { (names.device(no)) }
                @for (from, to, state, is_error) in states(report, no, end) {
                    (bar(from, to, end, LANE * lane, if is_error { "error" } else { &state }, &state))
                }
            }
            @for (index, (kind, name)) in kinds.iter().enumerate() {
                @let top = LANE * (devices.len() + index);
                text x="4" y=(top + 14) { (name) }
                @for event in told.events.iter().filter(|event| event.kind == *kind) {
                    @let is_open = event.to_ns.is_none() && *kind == TimelineEventKind::Finding;
                    @let to = event.to_ns.map_or(if is_open { end } else { event.at_ns.0 }, |to| to.0);
                    @let class = if event.trouble { "trouble" } else { "event" };
                    (bar(event.at_ns.0, to, end, top, class, &event.text))
                }
            }
        }
    }
}

fn axis(end: u64, height: usize) -> Markup {
    let ticks = (0..=STEPS).map(|step| end / STEPS * step);
    html! {
        @for at in ticks {
            @let x = format!("{:.1}", place(at, end));
            line class="grid" x1=(x) x2=(x) y1="0" y2=(height - LANE) {}
            text class="faint" x=(x) y=(height - 6) text-anchor="middle" { (time(at)) }
        }
    }
}

fn bar(from: u64, to: u64, end: u64, top: usize, class: &str, title: &str) -> Markup {
    let (left, right) = (place(from, end), place(to, end));
    html! {
        rect class=(class) x=(format!("{left:.1}")) y=(top + 3) height=(LANE - 6)
            width=(format!("{:.1}", (right - left).max(LEAST))) {
            title { (time(from)) " " (title) }
        }
    }
}

fn place(at: u64, end: u64) -> f64 {
    NAMES + TIMES * (at.min(end) as f64 / end as f64)
}

/// Stretches of time in which a SubDevice was read in one state: from, to, state, whether with an error.
fn states(report: &CaptureReport, no: u32, end: u64) -> Vec<(u64, u64, String, bool)> {
    let known: Vec<&str> = vec!["INIT", "BOOT", "PREOP", "SAFEOP", "OP"];
    let mut all: Vec<(u64, u64, String, bool)> = Vec::new();
    let read =
        report.states.iter().filter(|one| one.what == StateEvent::Read && one.no == Some(no));
    for one in read {
        let Some(state) = one.state.clone().filter(|state| known.contains(&state.as_str())) else {
            continue;
        };
        if let Some(last) = all.last_mut() {
            last.1 = one.at_ns.0;
        }
        all.push((one.at_ns.0, end, state, one.error));
    }
    all
}
