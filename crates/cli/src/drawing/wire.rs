//! Wires: the course of a link over the paper, the letters of its ports, its badges.

use linesman_proto::address::Path;
use linesman_proto::topology::{End, Link};
use maud::{Markup, html};

use super::badge::{self, Group, badges};
use super::layout::{Course, item_at};
use super::scene::Mark;
use super::svg::{BOX, CELL, Pen, corner};
use crate::text::finding::severity_word;

/// From the left edge of a box to the wire of a branch straight down, and to that of one aside.
pub(super) const DOWN_AT: usize = 24;
pub(super) const ASIDE_AT: usize = 100;
/// Pixels beside the rows that a wire around them takes.
const AROUND: usize = 16;

/// A link as it is drawn.
struct Wire {
    /// Its corners.
    points: Vec<(usize, usize)>,
    badges: Group,
    arrows: badge::Arrows,
}

impl Pen<'_> {
    /// A link with its letters and badges; nothing for one whose ends are not drawn.
    pub(super) fn link(&self, link: &Link) -> Markup {
        let Some(wire) = self.wire(link) else { return html! {} };
        let marks: Vec<&Mark> = self.scene.on_link((link.upstream, link.downstream)).collect();
        let worst = marks.iter().map(|mark| mark.severity).max();
        let closing = matches!(link.downstream, End::MainDevice(_));
        let class = format!(
            "link{}{}",
            if closing { " closing" } else { "" },
            worst.map(|severity| format!(" at-{}", severity_word(severity))).unwrap_or_default()
        );
        let points: Vec<String> = wire.points.iter().map(|(x, y)| format!("{x},{y}")).collect();
        let (from, to) = (letter_at_begin(&wire.points), letter_at_end(&wire.points));
        html! {
            polyline class=(class) points=(points.join(" ")) {
                title { (ends(link)) @for mark in &marks { "\n" (mark.title) } }
            }
            text class="port" x=(from.0) y=(from.1) { (letter(link.upstream)) }
            text class="port" x=(to.0) y=(to.1) { (letter(link.downstream)) }
            (badges(&marks, wire.badges, wire.arrows))
        }
    }

    fn wire(&self, link: &Link) -> Option<Wire> {
        let placed = self.layout.placed(item_at(link.downstream))?;
        let (course, b) = (placed.course?, corner(placed.cell));
        let upper = match course {
            Course::Referred(reference) => reference,
            Course::Beside | Course::Around | Course::Down | Course::Aside => {
                self.layout.placed(item_at(link.upstream))?.cell
            }
        };
        let a = corner(upper);
        let (right, middle) = (a.0 + BOX.0, a.1 + BOX.1 / 2);
        let entry = b.1 + BOX.1 / 2;
        Some(match course {
            Course::Beside | Course::Referred(_) => Wire {
                points: vec![(right, middle), (b.0, entry)],
                badges: Group::Stack { x: (right + b.0) / 2, y: middle, most: 3 },
                arrows: badge::RIGHT,
            },
            Course::Around => {
                let between = b.1 - (CELL.1 - BOX.1) / 2;
                let turns = (right + AROUND, b.0 - AROUND);
                Wire {
                    points: vec![
                        (right, middle),
                        (turns.0, middle),
                        (turns.0, between),
                        (turns.1, between),
                        (turns.1, entry),
                        (b.0, entry),
                    ],
                    badges: Group::Row { x: (turns.0 + turns.1) / 2, y: between },
                    arrows: badge::LEFT,
                }
            }
            Course::Down => {
                let (x, from) = (a.0 + DOWN_AT, a.1 + BOX.1);
                Wire {
                    points: vec![(x, from), (x, b.1)],
                    badges: Group::Row { x, y: (from + b.1) / 2 },
                    arrows: badge::DOWN,
                }
            }
            Course::Aside => {
                let x = a.0 + ASIDE_AT;
                Wire {
                    points: vec![(x, a.1 + BOX.1), (x, entry), (b.0, entry)],
                    badges: Group::Stack { x: (x + b.0 - 10) / 2, y: entry, most: 2 },
                    arrows: badge::RIGHT,
                }
            }
        })
    }
}

/// The baseline of the letter at the begin of a wire, which leaves a box to the right or downwards.
fn letter_at_begin(points: &[(usize, usize)]) -> (usize, usize) {
    match points {
        [(x, y), next, ..] if next.0 == *x => (x + 4, y + 11),
        [(x, y), ..] => (x + 3, y - 4),
        [] => (0, 0),
    }
}

/// The baseline of the letter at the end of a wire, which enters a box from the left or from above.
fn letter_at_end(points: &[(usize, usize)]) -> (usize, usize) {
    match points {
        [.., before, (x, y)] if before.0 == *x => (x + 4, y - 5),
        [.., (x, y)] => (x - 10, y - 4),
        [] => (0, 0),
    }
}

/// The letter of a port or card.
pub(super) const fn letter(end: End) -> char {
    match end {
        End::MainDevice(Path::A) => 'A',
        End::MainDevice(Path::B) => 'B',
        End::Controller(_, port) => port.letter(),
    }
}

/// `1.B – 2.A`.
fn ends(link: &Link) -> String {
    let end = |end: End| match end {
        End::MainDevice(path) => format!("MainDevice {path}"),
        End::Controller(node, port) => format!("{}.{port}", node + 1),
    };
    format!("{} – {}", end(link.upstream), end(link.downstream))
}
