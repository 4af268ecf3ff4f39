//! When each finding was there: a bar on the time of the run.

use linesman_diagnosis::report::{FindingReport, Number};
use linesman_proto::time::Instant;
use maud::{Markup, html};

use crate::text::finding::{Writer, severity_word};
use crate::text::quantity::time;

/// Most bars; consequences beyond are left out.
const MOST: usize = 60;
/// Pixels of a row.
const ROW: usize = 20;
/// Where the time begins and how wide it is, in pixels.
const LEFT: usize = 300;
const WIDTH: usize = 640;
/// The narrowest bar, in pixels.
const LEAST: f64 = 3.0;

/// The bars, causes in front of what follows from them.
pub(super) fn section(findings: &[FindingReport], at: Instant, writer: &Writer<'_>) -> Markup {
    let mut rows = Vec::new();
    for finding in findings {
        flatten(finding, 0, &mut rows);
    }
    rows.truncate(MOST);
    let latest = rows.iter().flat_map(|(_, one)| [Some(one.opened_ns), one.closed_ns]);
    let end =
        latest.flatten().map(|Number(ns)| ns).chain([at.as_nanos()]).max().unwrap_or(0).max(1);
    let x = |ns: u64| LEFT as f64 + ns as f64 / end as f64 * WIDTH as f64;
    let height = rows.len() * ROW + 30;
    html! {
        @if !rows.is_empty() {
            section {
                h2 { "Time line" }
                div class="picture" {
                    svg class="timeline" xmlns="http://www.w3.org/2000/svg" role="img"
                        width=(LEFT + WIDTH + 40) height=(height)
                        viewBox={ "0 0 " (LEFT + WIDTH + 40) " " (height) } {
                        title { "When each finding was there" }
                        @for quarter in 0..=4u64 {
                            @let ns = end / 4 * quarter;
                            line class="grid" x1=(tenth(x(ns))) x2=(tenth(x(ns))) y1="0" y2=(height - 20) {}
                            text class="faint" x=(tenth(x(ns))) y=(height - 6) text-anchor="middle" { (time(ns)) }
                        }
                        @for (index, (depth, one)) in rows.iter().enumerate() {
                            @let y = index * ROW;
                            @let from = x(one.opened_ns.0);
                            @let to = x(one.closed_ns.map_or(end, |Number(ns)| ns));
                            g {
                                title { (one.id) " " (writer.names.place(&one.place)) }
                                text x=(8 + depth * 14) y=(y + 14) { (one.id) " " (one.code) " " (one.name) }
                                rect class={ "bar " (severity_word(one.severity)) } x=(tenth(from)) y=(y + 4)
                                    width=(tenth((to - from).max(LEAST))) height=(ROW - 8) {}
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Tenths of a pixel are fine enough, and the same on every machine.
fn tenth(pixels: f64) -> String {
    format!("{pixels:.1}")
}

fn flatten<'a>(
    finding: &'a FindingReport,
    depth: usize,
    rows: &mut Vec<(usize, &'a FindingReport)>,
) {
    rows.push((depth, finding));
    for one in &finding.consequences {
        flatten(one, depth + 1, rows);
    }
}
