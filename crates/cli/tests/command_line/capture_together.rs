//! Files that were recorded at the same time, as at the two cards of a ring, taken as one recording.

use std::path::{Path, PathBuf};

use crate::support::{assert_valid, linesman};
use serde_json::{Value, json};

const RING: &str = r#"
name = "ring"
seed = 1
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "I1"
type = "EL1008"
on = "K1.B"
[[device]]
name = "O1"
type = "EL2008"
on = "I1.B"
[[device]]
name = "X1"
type = "EK1110"
on = "O1.B"
[ring]
closes_at = "X1.B"
"#;

/// A recording of the ring by both cards, and what each of them has seen in a file of its own.
fn recorded(folder: &Path, faults: &str) -> (String, [String; 2]) {
    let segment = folder.join("ring.toml");
    std::fs::write(&segment, format!("{RING}{faults}")).unwrap();
    let both = folder.join("both.pcapng").display().to_string();
    let place = format!("sim:{}", segment.display());
    let run = linesman(["diagnose", &place, "--seconds", "3", "--record", &both]);
    assert!(run.status <= 1, "{}", run.all());
    let cards = ["a", "b"].map(|card| {
        let path: PathBuf = folder.join(format!("card-{card}.pcapng"));
        let path = path.display().to_string();
        let number = if card == "a" { "0" } else { "1" };
        let condition = format!("frame.interface_id == {number}");
        let run = linesman(["capture", "filter", &both, &condition, "-o", &path]);
        assert_eq!(run.status, 0, "{}", run.all());
        path
    });
    (both, cards)
}

#[test]
fn captures_of_both_cards_of_a_ring_are_judged_as_one() {
    let folder = tempfile::tempdir().unwrap();
    let cut = "[[fault]]\nkind = \"link-open\"\nat = \"I1.B-O1.A\"\nfrom_ms = 1500\n";
    let (both, [a, b]) = recorded(folder.path(), cut);
    let found = |arguments: &[&str]| {
        let run = linesman([&["diagnose", "--json"], arguments].concat());
        assert_eq!(run.status, 1, "{}", run.all());
        let judged = run.json();
        let findings = judged["findings"].as_array().unwrap().clone();
        findings
            .iter()
            .map(|one| format!("{} {} at {}", one["code"], one["cause"], one["place"]))
            .collect::<Vec<_>>()
    };
    let as_one = found(&[&both]);
    assert!(as_one[0].contains("ring-open"), "{as_one:?}");
    // In either order of the names.
    assert_eq!(found(&["--together", &a, &b]), as_one);
    assert_eq!(found(&["--together", &b, &a]), as_one);
}

#[test]
fn network_of_a_ring_is_surveyed_from_captures_of_both_cards() {
    let folder = tempfile::tempdir().unwrap();
    let (both, [a, b]) = recorded(folder.path(), "");
    let one = linesman(["capture", "info", "--json", &both]).json();
    let run = linesman(["capture", "info", "--json", "--together", &a, &b]);
    assert_eq!(run.status, 0, "{}", run.all());
    let merged = run.json();
    for part in ["devices", "links", "commands", "network", "image"] {
        assert_eq!(merged[part], one[part], "{part}");
    }
    assert_eq!(merged["recording"]["requests"], one["recording"]["requests"]);
    assert_eq!(merged["recording"]["interfaces"].as_array().unwrap().len(), 2);
    // Each request goes out by both cards, and is one.
    let states = one["states"].as_array().unwrap();
    let asked: Vec<_> = states.iter().filter(|one| one["what"] == "asked").collect();
    assert!(!asked.is_empty());
    for request in asked {
        assert!(request["wkc"].as_u64() > Some(0), "somebody has taken it: {request}");
    }
}

#[test]
fn frames_of_both_cards_are_listed_filtered_exported_and_told_in_the_order_of_their_times() {
    let folder = tempfile::tempdir().unwrap();
    let cut = "[[fault]]\nkind = \"link-open\"\nat = \"I1.B-O1.A\"\nfrom_ms = 1500\n";
    let (both, [a, b]) = recorded(folder.path(), cut);
    let told = |arguments: &[&str]| {
        let run = linesman([&["capture"], arguments].concat());
        assert_eq!(run.status, 0, "{}", run.all());
        run.stdout
    };
    // The order of frames of one time is that of the files: all else is as in one file.
    let rows = |arguments: &[&str]| {
        let text = told(&[&["list", "--json"], arguments].concat());
        let rows: Vec<Value> =
            text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        let part = |row: &Value, name: &str| row[name].as_u64().unwrap();
        assert!(rows.is_sorted_by_key(|row| part(row, "frame")));
        let is_sorted = rows.is_sorted_by_key(|row| part(row, "time_ns"));
        let mut shown: Vec<(u64, u64, String)> = rows
            .iter()
            .map(|row| {
                let what = ["way", "index", "command", "adp", "ado", "logical", "wkc"]
                    .map(|name| &row[name]);
                (part(row, "time_ns"), part(row, "interface"), format!("{what:?}"))
            })
            .collect();
        shown.sort();
        (is_sorted, shown)
    };
    let one = rows(&[&both]);
    assert!(one.0 && one.1.len() > 1000);
    assert!(rows(&["--together", &a, &b]) == one, "the frames differ");
    // Without it the second file follows the first one.
    assert!(!rows(&[&a, &b]).0);
    let counted = |arguments: &[&str]| {
        let text = told(&[&["filter", "--json"], arguments].concat());
        serde_json::from_str::<Value>(&text).unwrap()["matched"].as_u64().unwrap()
    };
    let returns = "ecat.cmd == \"LRW\" && ecat.cnt == 3";
    assert!(counted(&[&both, returns]) > 100);
    assert_eq!(counted(&["--together", &a, &b, returns]), counted(&[&both, returns]));
    let happened = |arguments: &[&str]| {
        let text = told(&[&["timeline", "--json"], arguments].concat());
        let events = serde_json::from_str::<Value>(&text).unwrap()["events"].clone();
        let events = events.as_array().unwrap().iter();
        events
            .map(|one| format!("{} {} {}", one["at_ns"], one["no"], one["text"]))
            .collect::<Vec<_>>()
    };
    assert_eq!(happened(&["--together", &a, &b]), happened(&[&both]));
    let [whole, merged] = ["whole.csv", "merged.csv"].map(|name| {
        let path = folder.path().join(name).display().to_string();
        let files =
            if name == "whole.csv" { vec![both.as_str()] } else { vec!["--together", &a, &b] };
        told(&[&["export", "--csv", &path], files.as_slice()].concat());
        std::fs::read_to_string(path).unwrap().lines().count()
    });
    assert_eq!(whole, merged);
}

#[test]
fn halves_of_an_open_ring_are_told_with_their_times() {
    let folder = tempfile::tempdir().unwrap();
    let cut = "[[fault]]\nkind = \"link-open\"\nat = \"I1.B-O1.A\"\nfrom_ms = 1500\n";
    let (both, [a, b]) = recorded(folder.path(), cut);
    let ring = |arguments: &[&str]| {
        let run = linesman([&["capture", "info", "--json"], arguments].concat());
        assert_eq!(run.status, 0, "{}", run.all());
        let told = run.json();
        assert_valid(&told, "capture");
        told["ring"].clone()
    };
    let told = ring(&[&both]);
    assert_eq!(ring(&["--together", &a, &b]), told);
    let spells = told["open"].as_array().unwrap();
    let last = spells.last().unwrap_or_else(|| panic!("{told}"));
    let half = |card: &str| (last[card]["devices"].clone(), last[card]["count"].clone());
    assert_eq!(half("card_a"), (json!([1, 2]), json!(2)), "{told}");
    assert_eq!(half("card_b"), (json!([3, 4]), json!(2)), "{told}");
    assert_eq!((&last["not_known"], &last["ended_ns"]), (&json!([]), &Value::Null), "{told}");
    assert!(last["after_ns"].as_u64() < last["from_ns"].as_u64(), "{told}");
    let text = linesman(["capture", "info", &both]);
    for words in ["card A: SubDevice 1-2 (2 SubDevices answer broadcasts)", "card B: SubDevice 3-4"]
    {
        assert!(text.stdout.contains(words), "{words}: {}", text.stdout);
    }
}

#[test]
fn ring_that_stays_closed_has_no_halves_and_a_line_is_none() {
    let folder = tempfile::tempdir().unwrap();
    let (both, [a, _]) = recorded(folder.path(), "");
    let whole = linesman(["capture", "info", "--json", &both]).json();
    assert_eq!(whole["ring"], json!({ "open": [], "left_out": 0 }));
    // One card alone shows no second one.
    let alone = linesman(["capture", "info", "--json", &a]).json();
    assert_eq!(alone["ring"], Value::Null);
}

#[test]
fn files_that_are_no_recording_together_are_refused_with_the_next_step() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    std::fs::write(path("one.pcapng"), "").unwrap();
    let (one, inside) = (path("one.pcapng"), folder.path().display().to_string());
    for command in
        [&["diagnose"][..], &["capture", "info"], &["capture", "list"], &["capture", "timeline"]]
    {
        for (other, expected) in [
            (path("not-there.pcapng"), "not-there.pcapng: there is no such file"),
            (inside.clone(), "this is no file"),
            (one.clone(), "one.pcapng: the file is named twice"),
        ] {
            let run = linesman([command, &["--together", &one, &other]].concat());
            assert_eq!(run.status, 2, "{}", run.all());
            assert!(run.stderr.contains(expected), "{expected}: {}", run.stderr);
        }
    }
    let run = linesman(["capture", "info", "before.pcapng", "after.pcapng"]);
    assert_eq!(run.status, 2, "{}", run.all());
    assert!(run.stderr.contains("add --together"), "{}", run.stderr);
}
