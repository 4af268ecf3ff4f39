//! Geometry of drawings: wires run straight, inside, apart from boxes and from each other; badges cover
//! neither letters of ports nor texts.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use crate::support::drawing::{Element, elements, line, star, tree};
use crate::support::linesman;
use tempfile::TempDir;

/// A rectangle: left, top, right, bottom.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Area(f64, f64, f64, f64);

impl Area {
    fn of_rect(rect: &Element) -> Self {
        let number = |key: &str| rect.get(key).parse::<f64>().unwrap();
        let (x, y) = (number("x"), number("y"));
        Self(x, y, x + number("width"), y + number("height"))
    }

    /// About as large as the letters are: `centred` ones stand around their place.
    fn of_text(text: &Element) -> Self {
        let number = |key: &str| text.get(key).parse::<f64>().unwrap();
        let (x, y) = (number("x"), number("y"));
        let (size, centred) = match () {
            () if text.has_class("port") => (9.0, false),
            () if text.has_class("badge") => (10.0, true),
            () => (11.0, false),
        };
        let width = text.text.chars().count() as f64 * size * 0.62;
        let left = if centred { x - width / 2.0 } else { x };
        Self(left, y - size * 0.75, left + width, y)
    }

    fn meets(&self, other: &Self) -> bool {
        self.0 < other.2 && other.0 < self.2 && self.1 < other.3 && other.1 < self.3
    }

    fn holds(&self, (x, y): (f64, f64)) -> bool {
        self.0 <= x && x <= self.2 && self.1 <= y && y <= self.3
    }
}

type Point = (f64, f64);

fn points(wire: &Element) -> Vec<Point> {
    let pair = |pair: &str| {
        let (x, y) = pair.split_once(',').unwrap();
        (x.parse().unwrap(), y.parse().unwrap())
    };
    wire.get("points").split_whitespace().map(pair).collect()
}

/// The stretches of a wire, each as an area without width.
fn stretches(wire: &Element) -> Vec<Area> {
    let points = points(wire);
    let stretch = |pair: &[Point]| {
        let (a, b) = (pair[0], pair[1]);
        Area(a.0.min(b.0), a.1.min(b.1), a.0.max(b.0), a.1.max(b.1))
    };
    points.windows(2).map(stretch).collect()
}

fn touch(a: &Area, b: &Area) -> bool {
    a.0 <= b.2 && b.0 <= a.2 && a.1 <= b.3 && b.1 <= a.3
}

/// Holds a drawing against the rules of its geometry.
fn check(name: &str, all: &[Element]) {
    let number = |key: &str| all[0].get(key).parse::<f64>().unwrap();
    let (width, height) = (number("width"), number("height"));
    assert_eq!(all[0].get("viewBox"), format!("0 0 {width} {height}"), "{name}");
    let paper = Area(0.0, 0.0, width, height);
    let with = |class: &'static str| all.iter().filter(move |one| one.has_class(class));
    let boxes: Vec<Area> =
        ["box", "card", "reference"].into_iter().flat_map(with).map(Area::of_rect).collect();
    let badges: Vec<Area> = all
        .iter()
        .filter(|one| one.get("class").starts_with("badge-"))
        .map(Area::of_rect)
        .collect();
    let texts: Vec<(&str, Area)> = all
        .iter()
        .filter(|one| one.name == "text" && !one.has_class("badge"))
        .map(|one| (one.text.as_str(), Area::of_text(one)))
        .collect();
    let wires: Vec<&Element> = with("link").chain(with("stub")).collect();
    for area in boxes.iter().chain(&badges).chain(texts.iter().map(|(_, area)| area)) {
        let inside = paper.holds((area.0, area.1)) && paper.holds((area.2, area.3));
        assert!(inside, "{name}: {area:?} is not on the paper of {width} x {height}");
    }
    for (index, a) in boxes.iter().enumerate() {
        assert!(boxes[index + 1..].iter().all(|b| !a.meets(b)), "{name}: a box on {a:?}");
    }
    for (index, wire) in wires.iter().enumerate() {
        let points = points(wire);
        let title = &wire.title;
        assert!(points.iter().all(|point| paper.holds(*point)), "{name}: {title}: {points:?}");
        for pair in points.windows(2) {
            let is_straight = pair[0].0 == pair[1].0 || pair[0].1 == pair[1].1;
            assert!(is_straight, "{name}: {title} runs at a slant: {points:?}");
        }
        let stretches = stretches(wire);
        for stretch in &stretches {
            // A wire ends at the edge of a box and never enters one.
            let entered = boxes.iter().find(|one| one.meets(&widened(stretch)));
            assert!(entered.is_none(), "{name}: {title} runs through {entered:?}: {points:?}");
        }
        for other in &wires[index + 1..] {
            let crossed = stretches_of(other)
                .iter()
                .any(|theirs| stretches.iter().any(|ours| touch(ours, theirs)));
            assert!(!crossed, "{name}: {title} meets {}", other.title);
        }
    }
    for (index, badge) in badges.iter().enumerate() {
        let covered = texts.iter().find(|(_, text)| badge.meets(text));
        assert!(covered.is_none(), "{name}: {badge:?} covers {covered:?}");
        assert!(badges[index + 1..].iter().all(|other| !badge.meets(other)), "{name}: {badge:?}");
    }
    for (index, (letter, area)) in texts.iter().enumerate() {
        let other = texts[index + 1..].iter().find(|(_, other)| area.meets(other));
        assert!(other.is_none(), "{name}: {letter} at {area:?} on {other:?}");
    }
}

/// A stretch as a thin area, a little shorter than it is: its ends touch boxes.
fn widened(stretch: &Area) -> Area {
    let thin = 0.25;
    if stretch.0 == stretch.2 {
        Area(stretch.0 - thin, stretch.1 + thin, stretch.2 + thin, stretch.3 - thin)
    } else {
        Area(stretch.0 + thin, stretch.1 - thin, stretch.2 - thin, stretch.3 + thin)
    }
}

fn stretches_of(wire: &&Element) -> Vec<Area> {
    stretches(wire)
}

/// Junctions in a row, each with two branches; the third branch of a coupler; long names.
fn junctions(count: usize) -> String {
    let mut text = "name = \"plant\"\n".to_owned();
    let mut device = |name: &str, kind: &str, on: &str| {
        writeln!(text, "[[device]]\nname = \"{name}\"\ntype = \"{kind}\"\non = \"{on}\"").unwrap();
    };
    for junction in 1..=count {
        let on = if junction == 1 {
            "maindevice".to_owned()
        } else {
            format!("Junction of hall {}.D", junction - 1)
        };
        let name = format!("Junction of hall {junction}");
        device(&name, "CU1124", &on);
        for port in ["B", "C"] {
            device(&format!("{name} {port}1"), "EP2308-0001", &format!("{name}.{port}"));
            device(&format!("{name} {port}2"), "EP2308-0001", &format!("{name} {port}1.B"));
        }
    }
    text
}

/// The drawings of a page: the wide one, and that for telephones.
fn drawings(page: &str) -> Vec<Vec<Element>> {
    let all = page.split("<svg ").skip(1).filter(|one| one.contains("class=\"line\""));
    all.map(|one| {
        let (svg, _) = one.split_once("</svg>").unwrap();
        elements(&format!("<svg {svg}</svg>"))
    })
    .collect()
}

fn diagnosed(folder: &Path, name: &str, segment: &str) -> Vec<Vec<Element>> {
    let file = folder.join(format!("{name}.toml"));
    let (html, svg) = (folder.join(format!("{name}.html")), folder.join(format!("{name}.svg")));
    fs::write(&file, segment).unwrap();
    let place = format!("sim:{}", file.display());
    let files = [html.to_str().unwrap(), svg.to_str().unwrap()];
    let ran = linesman(["diagnose", &place, "--html", files[0], "--svg", files[1]]);
    let page = fs::read_to_string(&html).unwrap_or_else(|error| panic!("{error}: {}", ran.all()));
    let mut all = drawings(&page);
    all.push(elements(&fs::read_to_string(&svg).unwrap()));
    all
}

fn noise(at: &str) -> String {
    format!("[[fault]]\nkind = \"emc-noise\"\nat = \"{at}\"\nfrom_ms = 1000\nhits_per_s = 60.0\n")
}

#[test]
fn wires_and_badges_keep_apart_in_every_shape() {
    let folder = TempDir::new().unwrap();
    let ring = |len: usize| format!("{}[ring]\ncloses_at = \"B{len}.B\"\n", line(len));
    let shapes = [
        ("line", format!("{}{}", line(30), noise("B6.B>B7.A")), 31),
        ("line-100", format!("{}{}", line(100), noise("B40.B>B41.A")), 101),
        ("line-200", line(200), 201),
        ("tree", format!("{}{}", tree(5, 12), noise("K2.C>K3.A")), 66),
        ("star", format!("{}{}", star(), noise("J.B>B1.A")), 14),
        ("star-c", format!("{}{}", star(), noise("J.C>C1.A")), 14),
        (
            "junctions",
            format!("{}{}", junctions(9), noise("Junction of hall 3.C>Junction of hall 3 C1.A")),
            46,
        ),
        ("ring", format!("{}{}", ring(30), noise("B12.B>B13.A")), 32),
    ];
    for (name, segment, boxes) in shapes {
        let all = diagnosed(folder.path(), name, &format!("seed = 7\n{segment}"));
        assert_eq!(all.len(), 3, "{name}: wide, narrow, and the file");
        for drawing in &all {
            check(name, drawing);
            let drawn = drawing.iter().filter(|one| one.has_class("box") || one.has_class("card"));
            assert_eq!(drawn.count(), boxes, "{name}: each box once");
            let marked = drawing.iter().any(|one| one.get("class").starts_with("badge-"));
            assert_eq!(marked, segment.contains("[[fault]]"), "{name}: {drawing:?}");
        }
        let width = |index: usize| all[index][0].get("width").parse::<u32>().unwrap();
        assert!(width(0) <= 1300, "{name}: fits on a screen of 1400 pixels");
        assert!(width(1) <= 362, "{name}: fits on a telephone of 390 pixels");
        // The file is the drawing of the page.
        let wires = |index: usize| -> Vec<&str> {
            let links = all[index].iter().filter(|one| one.has_class("link"));
            links.map(|link| link.get("points")).collect()
        };
        assert_eq!(wires(0), wires(2), "{name}");
    }
}

#[test]
fn branch_of_a_coupler_runs_straight_down_and_a_ring_ends_at_the_second_card() {
    let folder = TempDir::new().unwrap();
    let of = |name: &str, segment: &str| diagnosed(folder.path(), name, segment).swap_remove(0);
    let wire = |all: &[Element], title: &str| {
        points(
            all.iter().find(|one| one.has_class("link") && one.title.starts_with(title)).unwrap(),
        )
    };
    let plant = of("tree", &tree(4, 12));
    for title in ["1.C – 14.A", "14.C – 27.A", "27.C – 40.A"] {
        assert_eq!(wire(&plant, title).len(), 2, "{title}");
    }
    let ring = of("ring", &format!("{}[ring]\ncloses_at = \"B4.B\"\n", line(4)));
    let closing = wire(&ring, "4.B – MainDevice B");
    assert_eq!(closing.len(), 2, "{closing:?}");
    assert!(closing[1].0 - closing[0].0 < 100.0, "it does not run round the page: {closing:?}");
}

// A terminal that was planned and is not mounted.
#[test]
fn missing_subdevice_is_dashed_and_named() {
    let folder = TempDir::new().unwrap();
    let fault = "[[fault]]\nkind = \"device-missing\"\ndevice = \"K2T1\"\n";
    let all = diagnosed(folder.path(), "missing", &format!("{}{fault}", tree(2, 3)));
    for drawing in &all {
        check("missing", drawing);
        let missing: Vec<&Element> =
            drawing.iter().filter(|one| one.has_class("box") && one.has_class("missing")).collect();
        assert_eq!(missing.len(), 1);
        let words: Vec<&str> = drawing
            .iter()
            .filter(|one| one.has_class("absent"))
            .map(|one| one.text.as_str())
            .collect();
        assert_eq!(words, ["missing"]);
    }
    let svg = fs::read_to_string(folder.path().join("missing.svg")).unwrap();
    let (_, style) = svg.split_once(".line .missing{").unwrap();
    assert!(style.split('}').next().unwrap().contains("stroke-dasharray"));
}
