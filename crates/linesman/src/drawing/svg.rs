//! The strokes.

use linesman_diagnosis::report::DirectionReport;
use linesman_proto::address::Path;
use linesman_proto::state::AlState;
use linesman_proto::topology::{End, Link};
use maud::{Markup, PreEscaped, html};

use super::layout::{Cell, Layout};
use super::scene::{Label, Mark, Scene, direction};
use crate::text::finding::severity_word;
use crate::text::quantity::grouped;

/// Pixels from one box to the next.
const CELL: (usize, usize) = (156, 92);
/// Pixels of a box.
const BOX: (usize, usize) = (116, 62);
/// Pixels around all.
const MARGIN: usize = 24;
/// Letters that fit in a box.
const LETTERS: usize = 17;

/// Colours and strokes, for the page or file that the picture is part of. Severity is told by words
/// and dashes too, not by colour alone.
pub(crate) const STYLE: &str = "\
.line{font:11px system-ui,sans-serif;background:#fff}\
.line .box{fill:#f7f7f8;stroke:#767b85;stroke-width:1.2}\
.line .key{stroke:#767b85;stroke-width:1}\
.line .op{fill:#dbe8fb}.line .safeop{fill:#dff2e2}.line .preop{fill:#fdf0c4}.line .init{fill:#fbdcd9}\
.line .unseen{fill:#f7f7f8}.line .error{stroke:#b3261e;stroke-width:2.6}\
.line .gone{fill:#fff;stroke:#b3261e;stroke-width:2.6;stroke-dasharray:5 3}\
.line text{fill:#1b1d21}.line .name{font-weight:600}.line .faint{fill:#5b606b}\
.line .port{fill:#5b606b;font-size:9px}.line .rises{fill:#b3261e;font-weight:600}\
.line .link{fill:none;stroke:#4c515b;stroke-width:1.6}.line .closing{stroke-dasharray:6 3}\
.line .at-error{stroke:#b3261e;stroke-width:4}\
.line .at-warning{stroke:#b26a00;stroke-width:4;stroke-dasharray:10 3}\
.line .at-info{stroke:#3b6ea8;stroke-width:3;stroke-dasharray:3 3}\
.line .badge-error{fill:#b3261e}.line .badge-warning{fill:#b26a00}.line .badge-info{fill:#3b6ea8}\
.line .badge{fill:#fff;font-weight:700;font-size:10px;text-anchor:middle}";

/// The picture by itself, as a file.
pub(crate) fn file(scene: &Scene<'_>) -> String {
    format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{}\n", draw(scene, true).into_string())
}

/// The picture; with its own colours, or as part of a page that has [`STYLE`].
pub(crate) fn draw(scene: &Scene<'_>, styled: bool) -> Markup {
    let layout = Layout::of(scene.tree);
    let ring = scene.tree.closes_at().is_some();
    let width = layout.size.column * CELL.0 + 2 * MARGIN;
    // The line that closes a ring runs beneath all.
    let floor = layout.size.row * CELL.1 + MARGIN + if ring { MARGIN } else { 0 };
    let width = width.max(KEYS.iter().map(|(_, _, key)| key).sum::<usize>() + 2 * MARGIN);
    let height = floor + MARGIN + LEGEND;
    let pen = Pen { scene, layout, floor };
    html! {
        svg xmlns="http://www.w3.org/2000/svg" class="line" role="img"
            viewBox={ "0 0 " (width) " " (height) } width=(width) height=(height) {
            title { "The line: " (scene.tree.len()) " SubDevices" }
            @if styled { style { (PreEscaped(STYLE)) } }
            @for link in scene.tree.links() { (pen.link(link)) }
            (pen.main_device())
            @for (node, label) in scene.boxes.iter().enumerate() { (pen.device(node, label)) }
            (legend(scene, height))
        }
    }
}

struct Pen<'a> {
    scene: &'a Scene<'a>,
    layout: Layout,
    floor: usize,
}

/// The upper left corner of a box.
const fn corner(cell: Cell) -> (usize, usize) {
    (MARGIN + cell.column * CELL.0, MARGIN + cell.row * CELL.1)
}

/// A way over the paper: corners from its begin to its end.
type Way = Vec<(usize, usize)>;

impl Pen<'_> {
    fn cell(&self, end: End) -> Option<Cell> {
        match end {
            End::MainDevice(path) => Some(self.layout.cards[path.index()]),
            End::Controller(node, _) => self.layout.cells.get(node).copied().flatten(),
        }
    }

    /// How a link runs between two boxes.
    fn way(&self, link: &Link) -> Option<Way> {
        let (from, to) = (self.cell(link.upstream)?, self.cell(link.downstream)?);
        let (a, b) = (corner(from), corner(to));
        let middle = BOX.1 / 2;
        if matches!(link.downstream, End::MainDevice(_)) {
            // Back to the second card: beneath all, and up at the left edge.
            let edge = MARGIN / 2;
            let x = a.0 + BOX.0;
            return Some(vec![
                (x, a.1 + middle + 12),
                (x + 10, a.1 + middle + 12),
                (x + 10, self.floor),
                (edge, self.floor),
                (edge, b.1 + middle + 12),
                (b.0, b.1 + middle + 12),
            ]);
        }
        Some(if from.row == to.row {
            vec![(a.0 + BOX.0, a.1 + middle), (b.0, b.1 + middle)]
        } else if from.column >= to.column && self.goes_on(link) {
            // The row goes on in the next.
            let between = b.1 - (CELL.1 - BOX.1) / 2;
            vec![
                (a.0 + BOX.0, a.1 + middle),
                (a.0 + BOX.0 + 10, a.1 + middle),
                (a.0 + BOX.0 + 10, between),
                (b.0 - 20, between),
                (b.0 - 20, b.1 + middle),
                (b.0, b.1 + middle),
            ]
        } else {
            // A branch: down in the gap at the left.
            vec![
                (a.0 + 10, a.1 + BOX.1),
                (a.0 + 10, a.1 + BOX.1 + 8),
                (a.0 - 10, a.1 + BOX.1 + 8),
                (a.0 - 10, b.1 + middle),
                (b.0, b.1 + middle),
            ]
        })
    }

    /// Whether the lower end is the first child, which continues its parent's chain.
    fn goes_on(&self, link: &Link) -> bool {
        match (link.upstream, link.downstream) {
            (End::Controller(parent, _), End::Controller(child, _)) => {
                self.scene.tree.children(parent).next().is_some_and(|(_, first)| first == child)
            }
            _ => true,
        }
    }

    fn link(&self, link: &Link) -> Markup {
        let Some(way) = self.way(link) else { return html! {} };
        let marks: Vec<&Mark> = self.scene.on_link((link.upstream, link.downstream)).collect();
        let worst = marks.iter().map(|mark| mark.severity).max();
        let closing = matches!(link.downstream, End::MainDevice(_));
        let class = format!(
            "link{}{}",
            if closing { " closing" } else { "" },
            worst.map(|severity| format!(" at-{}", severity_word(severity))).unwrap_or_default()
        );
        let points: Vec<String> = way.iter().map(|(x, y)| format!("{x},{y}")).collect();
        let letter = |end: End| match end {
            End::MainDevice(Path::A) => 'A',
            End::MainDevice(Path::B) => 'B',
            End::Controller(_, port) => port.letter(),
        };
        let (first, last) = (way.first().copied(), way.last().copied());
        html! {
            polyline class=(class) points=(points.join(" ")) {
                title { (ends(link)) @for mark in &marks { "\n" (mark.title) } }
            }
            @if let Some((x, y)) = first {
                @if way.get(1).is_some_and(|next| next.0 == x) {
                    text class="port" x=(x + 4) y=(y + 10) { (letter(link.upstream)) }
                } @else {
                    text class="port" x=(x + 3) y=(y - 4) { (letter(link.upstream)) }
                }
            }
            @if let Some((x, y)) = last {
                text class="port" x=(x - 9) y=(y - 4) { (letter(link.downstream)) }
            }
            @if let Some((x, y)) = badge_at(&way) { (badges(&marks, x, y)) }
        }
    }

    fn main_device(&self) -> Markup {
        let second = self.scene.tree.first(Path::B).is_some();
        let marks: Vec<&Mark> = self.scene.on_main_device().collect();
        html! {
            @for path in Path::ALL {
                @if path == Path::A || second {
                    @let (x, y) = corner(self.layout.cards[path.index()]);
                    g {
                        rect class="box" x=(x) y=(y) width=(BOX.0) height=(BOX.1) rx="3" {}
                        text class="name" x=(x + 8) y=(y + 18) { "MainDevice" }
                        text class="faint" x=(x + 8) y=(y + 34) {
                            @if path == Path::A { "card A" } @else { "card B" }
                        }
                        @if path == Path::A { (badges(&marks, x + BOX.0 - 12, y + 12)) }
                    }
                }
            }
        }
    }

    fn device(&self, node: usize, label: &Label) -> Markup {
        let Some(cell) = self.layout.cells.get(node).copied().flatten() else { return html! {} };
        let (x, y) = corner(cell);
        let marks: Vec<&Mark> = self.scene.on_device(node).collect();
        let worst = marks.iter().map(|mark| mark.severity).max();
        let class = format!(
            "box {}{}{}",
            fill(label),
            if label.state.as_ref().is_some_and(|state| state.error) { " error" } else { "" },
            worst.map(|severity| format!(" at-{}", severity_word(severity))).unwrap_or_default()
        );
        let head = match label.name.as_str() {
            "" => (node + 1).to_string(),
            name => format!("{} {name}", node + 1),
        };
        let state = label.state.as_ref().map_or("not seen", |state| state.text.as_str());
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
                text class="name" x=(x + 8) y=(y + 16) { (short(&head)) }
                text class="faint" x=(x + 8) y=(y + 30) { (short(&label.type_name)) }
                text x=(x + 8) y=(y + 44) { (short(state)) }
                @if !rises.is_empty() {
                    text class="rises" x=(x + 8) y=(y + 57) { (short(&rises.join(" "))) }
                }
                (badges(&marks, x + BOX.0 - 12, y + 12))
            }
        }
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

/// Height of the keys to the colours.
const LEGEND: usize = 18;

/// What the colours mean; those that people know from other tools (S0: INIT red, PREOP yellow, SAFEOP
/// green, OP blue).
const KEYS: [(&str, &str, usize); 6] = [
    ("init", "INIT", 52),
    ("preop", "PREOP, BOOT", 96),
    ("safeop", "SAFEOP", 68),
    ("op", "OP", 42),
    ("error", "error", 54),
    ("gone", "no answer", 76),
];

/// The keys to the colours, beneath all. A drawing of a plan, which nobody has looked at, has none.
fn legend(scene: &Scene<'_>, bottom: usize) -> Markup {
    let mut x = MARGIN;
    let places = KEYS.map(|(_, _, width)| {
        let at = x;
        x += width;
        at
    });
    html! {
        @if scene.boxes.iter().any(|label| label.state.is_some()) {
            @for ((class, text, _), x) in KEYS.into_iter().zip(places) {
                rect class={ "key " (class) } x=(x) y=(bottom - 16) width="10" height="10" rx="2" {}
                text class="port" x=(x + 14) y=(bottom - 7) { (text) }
            }
        }
    }
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

/// In the middle of the last stretch of a way, or of the one before where that is too short.
fn badge_at(way: &Way) -> Option<(usize, usize)> {
    let pairs = way.windows(2).rev();
    let longest =
        pairs.max_by_key(|pair| pair[0].0.abs_diff(pair[1].0) + pair[0].1.abs_diff(pair[1].1))?;
    Some(((longest[0].0 + longest[1].0) / 2, (longest[0].1 + longest[1].1) / 2))
}

/// The names of findings in discs, with an arrow for the direction.
fn badges(marks: &[&Mark], x: usize, y: usize) -> Markup {
    html! {
        @for (index, mark) in marks.iter().enumerate() {
            @let y = y + index * 20;
            g {
                title { (mark.title) }
                circle class={ "badge-" (severity_word(mark.severity)) } cx=(x) cy=(y) r="11" {}
                text class="badge" x=(x) y=(y + 4) { (mark.id) }
                @if let Some(arrow) = arrow(mark) {
                    text class="port" x=(x - 5) y=(y + 21) { (arrow) }
                }
            }
        }
    }
}

/// Away from the MainDevice, or towards it.
fn arrow(mark: &Mark) -> Option<&'static str> {
    Some(match direction(mark)? {
        DirectionReport::AToB => "→",
        DirectionReport::BToA => "←",
        DirectionReport::Both => "↔",
    })
}

/// So much of a text as fits in a box.
fn short(text: &str) -> String {
    if text.chars().count() <= LETTERS {
        return text.to_owned();
    }
    text.chars().take(LETTERS - 1).chain(['…']).collect()
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
        let drawn = draw(&Scene { tree: &tree, boxes: boxes.clone(), marks: Vec::new() }, true);
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
        let drawn = draw(&Scene { tree: &tree, boxes, marks: Vec::new() }, true).into_string();
        assert!(drawn.contains("class=\"box safeop error\"") && drawn.contains("B +12"), "{drawn}");
        let offline =
            draw(&Scene { tree: &tree, boxes: vec![Label::default(); 5], marks: Vec::new() }, true);
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
        let drawn = draw(&scene, false).into_string();
        assert!(drawn.contains("class=\"link at-error\""), "{drawn}");
        assert!(["F1", "F2", "F3"].iter().all(|id| drawn.contains(id)), "{drawn}");
    }
}
