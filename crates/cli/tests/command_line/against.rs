//! `linesman scan --against`: what is there beside what was planned.

use std::fmt::Write as _;
use std::path::PathBuf;

use crate::support::{Run, assert_valid, linesman};
use serde_json::Value;
use tempfile::TempDir;

/// Segment files and projects of a test.
struct Desk(TempDir);

impl Desk {
    fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Scans `plant` and saves the project.
    fn plan(&self, plant: &str) {
        std::fs::write(self.path("planned.toml"), plant).unwrap();
        let place = format!("sim:{}", self.path("planned.toml").display());
        let project = self.path("machine.toml");
        let run = linesman(["scan", &place, "--save", project.to_str().unwrap()]);
        assert_eq!(run.status, 0, "{}", run.all());
    }

    /// Holds `plant` against that project.
    fn compare(&self, plant: &str, more: &[&str]) -> Run {
        std::fs::write(self.path("found.toml"), plant).unwrap();
        let place = format!("sim:{}", self.path("found.toml").display());
        let project = self.path("machine.toml");
        linesman([&["scan", &place, "--against", project.to_str().unwrap()], more].concat())
    }
}

/// A segment file; each device as (name, type, where it hangs).
fn plant(devices: &[(String, &str, String)]) -> String {
    let mut text = "name = \"plant\"\n".to_owned();
    for (name, kind, on) in devices {
        write!(text, "[[device]]\nname = \"{name}\"\ntype = \"{kind}\"\non = \"{on}\"\n").unwrap();
    }
    text
}

fn press() -> Vec<(String, &'static str, String)> {
    [
        ("K1", "EK1100", "maindevice"),
        ("T1", "EL2008", "K1.B"),
        ("T2", "EL1008", "T1.B"),
        ("K2", "EK1100", "K1.C"),
        ("T3", "EL1008", "K2.B"),
    ]
    .map(|(name, kind, on)| (name.to_owned(), kind, on.to_owned()))
    .to_vec()
}

#[test]
fn a_line_as_planned_is_told_so() {
    let desk = Desk::new();
    desk.plan(&plant(&press()));
    let run = desk.compare(&plant(&press()), &[]);
    assert_eq!(run.status, 0, "{}", run.all());
    assert!(run.stdout.contains("All is as planned."), "{}", run.stdout);
}

/// A line of 28: a coupler with 12 terminals and an extension, and behind its two sockets a group of seven
/// each. `moved` plugs the second group where the first belongs, which is left out.
fn twenty_eight(moved: bool) -> String {
    let mut devices = vec![("D50".to_owned(), "EK1100", "maindevice".to_owned())];
    for no in 51..=62 {
        let kind = if no % 2 == 0 { "EL2008" } else { "EL1008" };
        devices.push((format!("D{no}"), kind, format!("D{}.B", no - 1)));
    }
    devices.push(("D63".to_owned(), "EK1110", "D62.B".to_owned()));
    let mut group = |first: u32, kinds: [&'static str; 7], on: &str| {
        for (no, kind) in (first..).zip(kinds) {
            let on = if no == first { on.to_owned() } else { format!("D{}.B", no - 1) };
            devices.push((format!("D{no}"), kind, on));
        }
    };
    let first = ["EK1100", "EL1004", "EL2004", "EL7041", "EL7041", "EL4102", "EL3102"];
    let second = ["EK1828", "EL1008", "EL1008", "EL1004", "EL1004", "EL2008", "EL2008"];
    if moved {
        group(71, second, "D63.B");
    } else {
        group(64, first, "D63.B");
        group(71, second, "D50.C");
    }
    plant(&devices)
}

// proves: HW-01, HW-02
#[test]
fn the_table_of_28_shows_what_a_cable_in_the_wrong_place_does() {
    let desk = Desk::new();
    desk.plan(&twenty_eight(false));
    let run = desk.compare(&twenty_eight(true), &["--json"]);
    assert_eq!(run.status, 1, "{}", run.all());
    let report = run.json();
    assert_valid(&report, "scan");
    let against = &report["against"];
    let states: Vec<&str> = against["devices"]
        .as_array()
        .unwrap()
        .iter()
        .map(|row| row["state"].as_str().unwrap())
        .collect();
    assert_eq!(states.len(), 28);
    // A scan finds all in INIT; the words behind the state are those of the online list.
    assert_eq!(states[0], "INIT LNK_MIS C", "the socket of the coupler is empty");
    assert!(states[1..14].iter().all(|state| *state == "INIT"), "{states:?}");
    assert!(states[14..21].iter().all(|state| state.starts_with("INIT VPRS")), "{states:?}");
    assert!(states[21..].iter().all(|state| *state == "INIT NO_COMM"), "{states:?}");
    // One cable and one group, and not fourteen devices.
    let differences: Vec<(&str, u64)> = against["differences"]
        .as_array()
        .unwrap()
        .iter()
        .map(|one| (one["kind"].as_str().unwrap(), one["planned"].as_u64().unwrap()))
        .collect();
    assert_eq!(differences, [("missing", 15), ("moved", 22)], "{against:#}");
    let moved = &against["differences"][1]["action"];
    assert!(moved.as_str().unwrap().contains("into port C of SubDevice 1 ("), "{moved}");
    let text = desk.compare(&twenty_eight(true), &[]).stdout;
    for words in ["LNK_MIS C", "VPRS", "NO_COMM", "cables are plugged in the wrong order"] {
        assert!(text.contains(words), "`{words}` is missing:\n{text}");
    }
}

#[test]
fn an_additional_link_and_a_reversed_coupler_are_told() {
    let desk = Desk::new();
    desk.plan(&plant(&press()));
    let mut more = press();
    more.push(("K3".to_owned(), "EK1100", "K2.C".to_owned()));
    let report = desk.compare(&plant(&more), &["--json"]).json();
    let kinds = |report: &Value| -> Vec<String> {
        let all = report["against"]["differences"].as_array().unwrap();
        all.iter().map(|one| one["kind"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(kinds(&report), ["extra"], "{report:#}");
    assert_eq!(report["against"]["devices"][3]["state"], "INIT LNK_ADD C", "{report:#}");
    let reversed = format!("{}[[fault]]\nkind = \"ports-swapped\"\ndevice = \"K2\"\n", {
        let mut all = press();
        all.push(("K3".to_owned(), "EK1100", "K2.C".to_owned()));
        desk_plan(&desk, &all)
    });
    let report = desk.compare(&reversed, &["--json"]).json();
    assert_eq!(kinds(&report), ["reversed"], "{report:#}");
    let action = report["against"]["differences"][0]["action"].as_str().unwrap();
    assert!(action.contains("exchange the cables at ports A and C of SubDevice 4 ("), "{action}");
}

/// Plans another line on the same desk, and gives its text.
fn desk_plan(desk: &Desk, devices: &[(String, &'static str, String)]) -> String {
    std::fs::remove_file(desk.path("machine.toml")).unwrap();
    let text = plant(devices);
    desk.plan(&text);
    text
}
