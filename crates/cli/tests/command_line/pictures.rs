//! Drawings and the report page, through the command line.

use std::fs;
use std::path::Path;

use crate::support::drawing::{Element, elements, line, star, tree};
use crate::support::linesman;
use tempfile::TempDir;

fn scan_drawing(folder: &Path, name: &str, segment: &str) -> Vec<Element> {
    let file = folder.join(format!("{name}.toml"));
    let svg = folder.join(format!("{name}.svg"));
    fs::write(&file, segment).unwrap();
    let ran =
        linesman(["scan", &format!("sim:{}", file.display()), "--svg", svg.to_str().unwrap()]);
    assert_eq!(ran.status, 0, "{name}: {}", ran.all());
    elements(&fs::read_to_string(&svg).unwrap())
}

/// Where the corner of a box is.
fn corner(element: &Element) -> (i64, i64) {
    (element.get("x").parse().unwrap(), element.get("y").parse().unwrap())
}

#[test]
fn every_shape_is_drawn_with_all_boxes_apart_and_all_links() {
    let folder = TempDir::new().unwrap();
    let ring = format!("{}[ring]\ncloses_at = \"B12.B\"\n", line(12));
    let shapes = [
        ("one", line(1), 1, 1),
        ("line", line(30), 30, 30),
        ("long", line(300), 300, 300),
        ("tree", tree(6, 7), 48, 48),
        ("star", star(), 13, 13),
        ("ring", ring, 12, 13),
    ];
    for (name, segment, devices, links) in shapes {
        let all = scan_drawing(folder.path(), name, &segment);
        let mut boxes: Vec<(i64, i64)> =
            all.iter().filter(|one| one.has_class("box")).map(corner).collect();
        assert_eq!(boxes.len(), devices + 1, "{name}: SubDevices and the MainDevice");
        boxes.sort_unstable();
        for (index, a) in boxes.iter().enumerate() {
            for b in &boxes[index + 1..] {
                assert!(
                    (a.0 - b.0).abs() >= 120 || (a.1 - b.1).abs() >= 66,
                    "{name}: {a:?} on {b:?}"
                );
            }
        }
        let drawn: Vec<&str> =
            all.iter().filter(|one| one.has_class("link")).map(|one| one.title.as_str()).collect();
        assert_eq!(drawn.len(), links, "{name}: {drawn:?}");
        let (width, height) = (all[0].get("width"), all[0].get("height"));
        let (width, height): (i64, i64) = (width.parse().unwrap(), height.parse().unwrap());
        assert!(boxes.iter().all(|(x, y)| x + 120 <= width && y + 66 <= height), "{name}");
        if name == "star" {
            assert!(drawn.contains(&"1.C – 6.A") || drawn.contains(&"1.C – 10.A"), "{drawn:?}");
        }
        if name == "ring" {
            assert!(drawn.contains(&"12.B – MainDevice B"), "{drawn:?}");
        }
    }
}

// A recorded table of states has the same tree as a live line.
// proves: DIA-12, JCT-14
#[test]
fn drawing_of_an_observation_has_states_ports_red_borders_and_the_marked_link() {
    let folder = TempDir::new().unwrap();
    let svg = folder.path().join("line.svg");
    let name =
        format!("{}/../../scenarios/observations/break-behind-14.toml", env!("CARGO_MANIFEST_DIR"));
    let told = linesman(["diagnose", &name, "--svg", svg.to_str().unwrap()]);
    assert_eq!(told.status, 1, "{}", told.all());
    let place = "link Term 63 (EK1110) port B";
    assert!(
        told.stdout.contains(place) && told.stdout.contains("H101 link-lost"),
        "{}",
        told.stdout
    );
    let all = elements(&fs::read_to_string(&svg).unwrap());
    let boxes =
        |class: &str| all.iter().filter(|one| one.has_class("box") && one.has_class(class)).count();
    // 15 to 21 do not answer; the others are in OP.
    assert_eq!((boxes("op"), boxes("gone")), (21, 7));
    let links: Vec<&Element> = all.iter().filter(|one| one.has_class("link")).collect();
    assert!(links.iter().any(|one| one.title.starts_with("1.B – 2.A")), "ports by position");
    let marked: Vec<&&Element> =
        links.iter().filter(|one| one.get("class").contains("at-")).collect();
    assert_eq!(marked.len(), 1, "one link is marked");
    assert!(marked[0].title.starts_with("14.B – 15.A"), "{}", marked[0].title);
}

// proves: JCT-14
#[test]
fn the_report_marks_both_faults_of_a_plant_where_they_are() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("plant.toml");
    let faults = "[[fault]]\nkind = \"emc-noise\"\nat = \"K2.C>K3.A\"\nfrom_ms = 1000\nto_ms = 2500\n\
                  hits_per_s = 60.0\n[[fault]]\nkind = \"device-off\"\ndevice = \"K5T3\"\nfrom_ms = 3500\n";
    fs::write(&file, format!("seed = 7\n{}{faults}", tree(5, 7))).unwrap();
    let place = format!("sim:{}", file.display());
    let (html, svg) = (folder.path().join("report.html"), folder.path().join("line.svg"));
    let (html_name, svg_name) = (html.to_str().unwrap(), svg.to_str().unwrap());
    let ran = linesman(["diagnose", &place, "--html", html_name, "--svg", svg_name, "--json"]);
    assert_eq!(ran.status, 1, "{}", ran.all());
    let diagnosis = ran.json();
    let page = fs::read_to_string(&html).unwrap();
    // One file, which fetches nothing and runs nothing.
    for outside in ["<script", "<link", "src=", "@import", "url("] {
        assert!(!page.contains(outside), "{outside}");
    }
    for finding in diagnosis["findings"].as_array().unwrap() {
        let head = format!("<article id=\"{}\"", finding["id"].as_str().unwrap());
        assert!(page.contains(&head), "{head}");
        for action in finding["actions"].as_array().unwrap() {
            let action = action.as_str().unwrap().replace('&', "&amp;");
            assert!(page.contains(&action), "{action}");
        }
    }
    // The drawing in the page is that of the file, but for its colours.
    let all = elements(&fs::read_to_string(&svg).unwrap());
    let link =
        |title: &str| all.iter().find(|one| one.has_class("link") && one.title.starts_with(title));
    assert!(link("9.C – 17.A").unwrap().get("class").contains("at-"), "the cable with the noise");
    assert!(link("35.B – 36.A").unwrap().has_class("at-error"), "the contact to the dead terminal");
    let marked = all.iter().filter(|one| one.has_class("link") && one.get("class").contains("at-"));
    assert_eq!(marked.count(), 2, "no other link is marked");
    let silent = all.iter().filter(|one| one.title.contains("no answer")).count();
    assert_eq!(silent, 5, "the dead terminal and the four behind it");
    let gone: Vec<&Element> = all.iter().filter(|one| one.has_class("gone")).collect();
    assert_eq!(gone.len(), 5 + 1, "they have the red border, and the legend its key");
    assert!(page.contains("35.B – 36.A"));
}

// S0 L2184-2192, S4 L39-46: the tree as it was planned and as it is, ports by their places, states by colour, a red border
// for who does not answer, errors at their port; taken over by other software.
// proves: DIA-12
#[test]
fn the_tree_is_drawn_of_a_scan_and_of_a_running_line_and_given_to_other_programs() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("plant.toml");
    let faults = "[[fault]]\nkind = \"emc-noise\"\nat = \"K1.C>K2.A\"\nfrom_ms = 1000\nhits_per_s = 60.0\n\
                  [[fault]]\nkind = \"link-open\"\nat = \"K2.C-K3.A\"\nfrom_ms = 4000\n";
    fs::write(&file, format!("seed = 7\n{}{faults}", tree(3, 3))).unwrap();
    let place = format!("sim:{}", file.display());
    // At rest: all are in INIT, and nothing is marked.
    let (rest, run) = (folder.path().join("rest.svg"), folder.path().join("run.svg"));
    let scan = linesman(["scan", &place, "--svg", rest.to_str().unwrap(), "--json"]);
    assert_eq!(scan.status, 0, "{}", scan.all());
    let rest = elements(&fs::read_to_string(&rest).unwrap());
    let boxes = |all: &[Element], class: &str| {
        all.iter().filter(|one| one.has_class("box") && one.has_class(class)).count()
    };
    assert_eq!((boxes(&rest, "init"), boxes(&rest, "gone")), (12, 0));
    // The same tree for a program: who hangs on which port of whom.
    let scan = scan.json();
    let devices = scan["devices"].as_array().unwrap();
    let links = devices.iter().filter_map(|device| {
        let entry = device["ports"].as_array().unwrap().iter().find(|port| port["port"] == "A")?;
        let to = &entry["to"];
        (to["no"] != 0).then(|| {
            let (no, port) = (&to["no"], to["port"].as_str().unwrap());
            format!("{no}.{port} – {}.A", device["no"])
        })
    });
    for title in links {
        let drawn = |one: &Element| one.has_class("link") && one.title.starts_with(&title);
        assert!(rest.iter().any(drawn), "{title}");
    }
    // At work: those in OP are blue, those behind the cut have a red border, errors stand at their port.
    let told = linesman(["diagnose", &place, "--svg", run.to_str().unwrap()]);
    assert_eq!(told.status, 1, "{}", told.all());
    let text = fs::read_to_string(&run).unwrap();
    let run = elements(&text);
    assert_eq!((boxes(&run, "op"), boxes(&run, "gone")), (8, 4));
    assert!(text.contains(">A +"), "errors at port A");
    let marked = run.iter().filter(|one| one.has_class("rises")).count();
    assert_eq!(marked, 1, "at one port");
}

#[test]
fn files_are_not_overwritten_and_need_a_folder() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("plant.toml");
    fs::write(&file, line(2)).unwrap();
    let place = format!("sim:{}", file.display());
    let there = folder.path().join("there.html");
    fs::write(&there, "mine").unwrap();
    let nowhere = folder.path().join("no/such/folder.svg");
    let rows = [
        (
            ["diagnose", place.as_str(), "--html", there.to_str().unwrap()],
            "the file is there already",
        ),
        (["diagnose", place.as_str(), "--svg", nowhere.to_str().unwrap()], "there is no folder"),
        (["scan", place.as_str(), "--svg", nowhere.to_str().unwrap()], "there is no folder"),
    ];
    for (words, why) in rows {
        let ran = linesman(words);
        assert_eq!(ran.status, 2, "{}", ran.all());
        assert!(ran.stderr.contains(why), "{}", ran.stderr);
    }
    assert_eq!(fs::read_to_string(&there).unwrap(), "mine");
}
