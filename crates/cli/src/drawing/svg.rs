//! The drawing as SVG: boxes, references, the keys to the colours.

use linesman_proto::address::Path;
use linesman_proto::state::AlState;
use linesman_proto::topology::{End, Link};
use maud::{Markup, PreEscaped, html};

use super::badge::{self, Group, badges};
use super::layout::{Cell, Course, Item, Layout, below, item_at};
use super::scene::{Label, Mark, Scene};
use super::wire::{ASIDE_AT, DOWN_AT, letter};
use crate::text::finding::severity_word;
use crate::text::quantity::grouped;

/// Pixels from one box to the next.
pub(super) const CELL: (usize, usize) = (184, 110);
/// Pixels of a box.
pub(super) const BOX: (usize, usize) = (120, 66);
/// Pixels around all.
const MARGIN: usize = 28;
/// Letters that fit in a box.
const LETTERS: usize = 16;

/// Columns of boxes on a screen or a sheet of paper, and on a telephone.
pub(crate) const WIDE: usize = 7;
pub(crate) const NARROW: usize = 2;

/// Colours and strokes, for the page or file that the picture is part of. Severity is told by words
/// and dashes too, not by colour alone.
pub(crate) const STYLE: &str = "\
.line{font:11px system-ui,sans-serif;background:#fff}\
.line .box,.line .card{fill:#f7f7f8;stroke:#767b85;stroke-width:1.2}\
.line .key{fill:#f7f7f8;stroke:#767b85;stroke-width:1}\
.line .op{fill:#dbe8fb}.line .safeop{fill:#dff2e2}.line .preop{fill:#fdf0c4}.line .init{fill:#fbdcd9}\
.line .unseen{fill:#f7f7f8;stroke-dasharray:4 3}.line .error{stroke:#b3261e;stroke-width:2.6}\
.line .gone{fill:#fff;stroke:#b3261e;stroke-width:2.6;stroke-dasharray:5 3}\
.line .missing{fill:#fbe9e7;stroke:#b3261e;stroke-width:2.6;stroke-dasharray:2 4}\
.line text.absent{fill:#b3261e;font-weight:700}\
.line .reference{fill:#fff;stroke:#767b85;stroke-dasharray:3 2}\
.line text{fill:#1b1d21}.line .name{font-weight:600}.line .faint{fill:#5b606b}\
.line .port{fill:#5b606b;font-size:9px}.line .rises{fill:#b3261e;font-weight:600}\
.line .link,.line .stub{fill:none;stroke:#4c515b;stroke-width:1.6}.line .closing{stroke-dasharray:6 3}\
.line .at-error{stroke:#b3261e;stroke-width:4}\
.line .at-warning{stroke:#b26a00;stroke-width:4;stroke-dasharray:10 3}\
.line .at-info{stroke:#3b6ea8;stroke-width:3;stroke-dasharray:3 3}\
.line .badge-error{fill:#b3261e}.line .badge-warning{fill:#b26a00}.line .badge-info{fill:#3b6ea8}\
.line .badge{fill:#fff;font-weight:700;font-size:10px;text-anchor:middle}";

/// The drawing by itself, as a file.
pub(crate) fn file(scene: &Scene<'_>) -> String {
    let drawing = draw(scene, WIDE, true).into_string();
    format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{drawing}\n")
}

/// The drawing in so many columns; with its own colours, or as part of a page that has [`STYLE`].
pub(crate) fn draw(scene: &Scene<'_>, columns: usize, styled: bool) -> Markup {
    let layout = Layout::of(scene.tree, columns);
    let width = (layout.size.column - 1) * CELL.0 + BOX.0 + 2 * MARGIN;
    let width = width.max(CELL.0 + BOX.0 + 2 * MARGIN);
    let floor = MARGIN + layout.size.row * CELL.1;
    let keys = keys(scene, floor, width);
    let height = keys.last().map_or(floor, |key| key.at.1 + LEGEND) + MARGIN / 2;
    let pen = Pen { scene, layout };
    html! {
        svg xmlns="http://www.w3.org/2000/svg" class="line" role="img"
            viewBox={ "0 0 " (width) " " (height) } width=(width) height=(height) {
            title { "The line: " (scene.tree.len()) " SubDevices" }
            @if styled { style { (PreEscaped(STYLE)) } }
            @for link in scene.tree.links() { (pen.reference(link)) (pen.link(link)) }
            @for path in Path::ALL { (pen.card(path)) }
            @for (node, label) in scene.boxes.iter().enumerate() { (pen.device(node, label)) }
            @for key in keys {
                @let (x, y) = key.at;
                rect class={ "key " (key.class) } x=(x) y=(y) width="10" height="10" rx="2" {}
                text class="port" x=(x + 14) y=(y + 9) { (key.text) }
            }
        }
    }
}

/// What is drawn, and where.
pub(super) struct Pen<'a> {
    pub(super) scene: &'a Scene<'a>,
    pub(super) layout: Layout,
}

/// The upper left corner of a box.
pub(super) const fn corner(cell: Cell) -> (usize, usize) {
    (MARGIN + cell.column * CELL.0, MARGIN + cell.row * CELL.1)
}

impl Pen<'_> {
    /// A small copy of the box that a branch hangs on, and beneath that box the number of the branch;
    /// nothing where a wire leads there.
    fn reference(&self, link: &Link) -> Markup {
        let lower_end = item_at(link.downstream);
        let course = self.layout.placed(lower_end).and_then(|placed| placed.course);
        let Some(Course::Referred(cell)) = course else { return html! {} };
        let (x, y) = corner(cell);
        let (port, number) = (letter(link.upstream), |node: usize| node + 1);
        let upper = match link.upstream {
            End::MainDevice(_) => "MainDevice".to_owned(),
            End::Controller(node, _) => self
                .scene
                .boxes
                .get(node)
                .map_or_else(|| number(node).to_string(), |label| headed(node, label)),
        };
        let branch = match lower_end {
            Item::Card(path) => format!("MainDevice {path}"),
            Item::Node(node) => number(node).to_string(),
        };
        let from = self.layout.placed(item_at(link.upstream)).map(|placed| corner(placed.cell));
        // The first and the second branch of a box lead away where their wires would.
        let is_second = self.is_second(link);
        let at = if is_second { ASIDE_AT - 40 } else { DOWN_AT - 16 };
        html! {
            g {
                title { "SubDevice " (upper) " again: the branch at its port " (port) }
                rect class="reference" x=(x) y=(y + 13) width=(BOX.0) height=(BOX.1 - 26) rx="3" {}
                text class="faint" x=(x + 8) y=(y + 29) { "from" }
                text class="faint" x=(x + 8) y=(y + 43) { (short(&upper)) }
            }
            @if let Some((x, y)) = from {
                polyline class="stub" points={ (x + at) "," (y + BOX.1) " " (x + at) "," (y + BOX.1 + 12) } {}
                text class="port" x=(x + at + 4) y=(y + BOX.1 + 11) { (port) " → " (branch) }
            }
        }
    }

    /// Whether the link leads to a further branch of its box.
    fn is_second(&self, link: &Link) -> bool {
        let all = below(self.scene.tree, item_at(link.upstream));
        all.get(2) == Some(&item_at(link.downstream))
    }

    /// A card of the MainDevice; findings on the MainDevice stand on the first.
    fn card(&self, path: Path) -> Markup {
        let Some(placed) = self.layout.placed(Item::Card(path)) else { return html! {} };
        let (x, y) = corner(placed.cell);
        let marks: Vec<&Mark> = self.scene.on_main_device().collect();
        // The card that closes a ring is the MainDevice again.
        let class = if placed.course.is_some() { "card" } else { "box" };
        html! {
            g {
                rect class=(class) x=(x) y=(y) width=(BOX.0) height=(BOX.1) rx="3" {}
                text class="name" x=(x + 8) y=(y + 22) { "MainDevice" }
                text class="faint" x=(x + 8) y=(y + 38) { "card " (path) }
                @if path == Path::A { (self.on_box(&marks, (x, y))) }
            }
        }
    }

    /// Badges on the upper edge of a box, clear of its text and of wires.
    fn on_box(&self, marks: &[&Mark], (x, y): (usize, usize)) -> Markup {
        badges(marks, Group::Before { x: x + BOX.0 - 3, y }, badge::RIGHT)
    }

    fn device(&self, node: usize, label: &Label) -> Markup {
        let Some(placed) = self.layout.placed(Item::Node(node)) else { return html! {} };
        let (x, y) = corner(placed.cell);
        let marks: Vec<&Mark> = self.scene.on_device(node).collect();
        let worst = marks.iter().map(|mark| mark.severity).max();
        let class = format!(
            "box {}{}{}",
            fill(label),
            if label.state.as_ref().is_some_and(|state| state.error) { " error" } else { "" },
            worst.map(|severity| format!(" at-{}", severity_word(severity))).unwrap_or_default()
        );
        let class = if label.is_missing { "box missing".to_owned() } else { class };
        let head = headed(node, label);
        let state = match &label.state {
            _ if label.is_missing => "missing",
            None => "not seen",
            Some(state) => state.text.as_str(),
        };
        let is_absent = label.is_missing || fill(label) == "gone";
        let rises: Vec<String> =
            label.rises.iter().map(|(port, rise)| format!("{port} +{}", grouped(*rise))).collect();
        html! {
            g {
                title {
                    (head) " " (label.type_name) ", " (state)
                    @if !rises.is_empty() { "; errors counted at ports: " (rises.join(", ")) }
                    @for mark in &marks { "\n" (mark.title) }
                }
                rect class=(class) x=(x) y=(y) width=(BOX.0) height=(BOX.1) rx="3" {}
                text class="name" x=(x + 8) y=(y + 19) { (short(&head)) }
                text class="faint" x=(x + 8) y=(y + 33) { (short(&label.type_name)) }
                text class=[is_absent.then_some("absent")] x=(x + 8) y=(y + 47) { (short(state)) }
                @if !rises.is_empty() {
                    text class="rises" x=(x + 8) y=(y + 60) { (short(&rises.join(" "))) }
                }
                (self.on_box(&marks, (x, y)))
            }
        }
    }
}

/// `4 Press feed`: number and name.
fn headed(node: usize, label: &Label) -> String {
    match label.name.as_str() {
        "" => (node + 1).to_string(),
        name => format!("{} {name}", node + 1),
    }
}

/// Height of a line of keys to the colours.
const LEGEND: usize = 18;

/// What the colours mean; those that people know from other tools (S0: INIT red, PREOP yellow, SAFEOP
/// green, OP blue), each with the width of its text.
const KEYS: [(&str, &str, usize); 7] = [
    ("init", "INIT", 52),
    ("preop", "PREOP, BOOT", 96),
    ("safeop", "SAFEOP", 68),
    ("op", "OP", 42),
    ("error", "error", 54),
    ("gone", "no answer", 80),
    ("missing", "missing", 70),
];

/// A key to a colour.
struct LegendEntry {
    class: &'static str,
    text: &'static str,
    at: (usize, usize),
}

/// The keys to the colours, beneath all, in lines of the drawing's width. A drawing of a plan, which
/// nobody has looked at, has none.
fn keys(scene: &Scene<'_>, floor: usize, width: usize) -> Vec<LegendEntry> {
    if scene.boxes.iter().all(|label| label.state.is_none()) {
        return Vec::new();
    }
    let mut at = (MARGIN, floor);
    let place = |(class, text, length): (&'static str, &'static str, usize)| {
        if at.0 + length > width {
            at = (MARGIN, at.1 + LEGEND);
        }
        let key = LegendEntry { class, text, at };
        at.0 += length;
        key
    };
    KEYS.into_iter().map(place).collect()
}

fn fill(label: &Label) -> &'static str {
    match &label.state {
        None => "unseen",
        Some(state) => match state.state {
            Some(AlState::Op) => "op",
            Some(AlState::SafeOp) => "safeop",
            Some(AlState::PreOp | AlState::Boot) => "preop",
            Some(AlState::Init) => "init",
            None => "gone",
        },
    }
}

/// So much of a text as fits in a box: its begin and its end, which tell names of a row apart.
fn short(text: &str) -> String {
    let count = text.chars().count();
    if count <= LETTERS {
        return text.to_owned();
    }
    let (begin, end) = (LETTERS / 2, LETTERS - LETTERS / 2 - 1);
    text.chars().take(begin).chain(['…']).chain(text.chars().skip(count - end)).collect()
}

#[cfg(test)]
mod tests {
    use linesman_diagnosis::report::{EndReport, PlaceReport, Severity};
    use linesman_proto::port::Port;
    use linesman_proto::topology::{Tree, Wired};

    use super::super::scene::State;
    use super::*;

    // proves: DIA-12 partial: colours and borders; the tree itself is drawn in tests/pictures.rs
    #[test]
    fn colours_are_those_of_the_legend() {
        let on = |node, port| Wired { on: End::Controller(node, port), entry: Port::A };
        let first = Wired { on: End::MainDevice(Path::A), entry: Port::A };
        let wiring = [first, on(0, Port::B), on(1, Port::B), on(2, Port::B), on(3, Port::B)];
        let tree = Tree::from_wiring(&wiring, None).unwrap();
        let label = |state: Option<AlState>, error| Label {
            state: Some(State { state, text: String::new(), error }),
            ..Label::default()
        };
        let states = [AlState::Init, AlState::PreOp, AlState::SafeOp, AlState::Op];
        let mut boxes: Vec<Label> = states.map(|state| label(Some(state), false)).into();
        boxes.push(label(None, false));
        let drawn =
            draw(&Scene { tree: &tree, boxes: boxes.clone(), marks: Vec::new() }, WIDE, true);
        let drawn = drawn.into_string();
        for (class, colour) in
            [("init", "fbdcd9"), ("preop", "fdf0c4"), ("safeop", "dff2e2"), ("op", "dbe8fb")]
        {
            assert!(drawn.contains(&format!("class=\"box {class}\"")), "{class}");
            assert!(drawn.contains(&format!("class=\"key {class}\"")), "{class}");
            assert!(drawn.contains(&format!(".line .{class}{{fill:#{colour}}}")), "{class}");
        }
        assert!(drawn.contains("class=\"box gone\""), "who does not answer");
        assert!(drawn.contains(".line .gone{fill:#fff;stroke:#b3261e"), "has a red border");
        boxes[2] = label(Some(AlState::SafeOp), true);
        boxes[3].rises.push((Port::B, 12));
        let drawn =
            draw(&Scene { tree: &tree, boxes, marks: Vec::new() }, WIDE, true).into_string();
        assert!(drawn.contains("class=\"box safeop error\"") && drawn.contains("B +12"), "{drawn}");
        let offline = draw(
            &Scene { tree: &tree, boxes: vec![Label::default(); 5], marks: Vec::new() },
            WIDE,
            true,
        );
        assert!(!offline.into_string().contains("class=\"key"), "a plan has no states");
    }

    #[test]
    fn of_several_marks_the_worst_is_drawn() {
        let first = Wired { on: End::MainDevice(Path::A), entry: Port::A };
        let tree = Tree::from_wiring(&[first], None).unwrap();
        let end = |no| EndReport { no, port: 'A' };
        let mark = |id: &str, severity| Mark {
            id: id.to_owned(),
            severity,
            place: PlaceReport::Link { network: 0, a: end(0), b: Some(end(1)), direction: None },
            title: String::new(),
        };
        let marks = vec![
            mark("F1", Severity::Info),
            mark("F2", Severity::Error),
            mark("F3", Severity::Warning),
        ];
        let scene = Scene { tree: &tree, boxes: vec![Label::default()], marks };
        let drawn = draw(&scene, WIDE, false).into_string();
        assert!(drawn.contains("class=\"link at-error\""), "{drawn}");
        assert!(["F1", "F2", "F3"].iter().all(|id| drawn.contains(id)), "{drawn}");
    }
}
