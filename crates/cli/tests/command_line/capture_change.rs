//! `linesman capture timeline` and `capture compare`: what happened, and what differs after a repair.

use std::fs;
use std::path::PathBuf;

use crate::captures::captures;
use crate::support::capture::Pcap;
use crate::support::drawing::elements;
use crate::support::{assert_valid, linesman};
use serde_json::{Value, json};
use tempfile::TempDir;

/// A cycle of 1 ms with an LRD of two bytes, whose working counter is 2; from 400 ms to 404 ms it is `low`.
fn capture(folder: &TempDir, name: &str, low: u16) -> PathBuf {
    let mut capture = Pcap::new();
    for cycle in 0..600_u64 {
        let wkc = if (400..404).contains(&cycle) { low } else { 2 };
        for (is_back, at) in [(false, 0), (true, 30)] {
            let source = if is_back { 2 } else { 0 };
            let mut frame = vec![0xFF; 6];
            frame.extend([source, 1, 5, 1, 0, 0, 0x88, 0xA4, 28, 0x10]);
            // BRD of AL status, which two in OP answer, then the LRD.
            let passed = if is_back { 2 } else { 0 };
            frame.extend([7, cycle as u8, passed, 0, 0x30, 1, 2, 0x80, 0, 0]);
            frame.extend([if is_back { 8 } else { 0 }, 0, passed, 0]);
            frame.extend([10, cycle as u8, 0, 0, 1, 0, 2, 0, 0, 0, 0, 0]);
            frame.extend(if is_back { wkc } else { 0 }.to_le_bytes());
            capture.frame(cycle * 1_000 + at, &frame);
        }
    }
    let path = folder.path().join(name);
    fs::write(&path, capture.0).unwrap();
    path
}

fn json_of(arguments: &[&str], schema: &str) -> (i32, Value) {
    let run = linesman(arguments.iter().chain(&["--json"]));
    let value = run.json();
    assert_valid(&value, schema);
    (run.status, value)
}

#[test]
fn working_counters_that_are_too_low_are_found_in_a_capture_alone() {
    let folder = TempDir::new().unwrap();
    let path = capture(&folder, "low.pcap", 1);
    let path = path.to_str().unwrap();
    let (_, info) = json_of(&["capture", "info", path], "capture");
    let lrd = &info["cyclic"][0]["datagrams"][1];
    assert_eq!((&lrd["command"], &lrd["expected"]), (&json!("LRD"), &json!(2)), "{info}");
    let counters = json!([{ "value": 1, "count": 4 }, { "value": 2, "count": 596 }]);
    assert_eq!(lrd["working_counters"], counters);
    let miss = &lrd["misses"][0];
    assert_eq!(
        (&miss["count"], &miss["lowest"], &miss["frame"]),
        (&json!(4), &json!(1), &json!(802))
    );
    assert_eq!((&miss["from_ns"], &miss["to_ns"]), (&json!(400_030_000), &json!(404_030_000)));
    let (_, told) = json_of(&["capture", "timeline", path, "--trouble"], "capture-timeline");
    let events = told["events"].as_array().unwrap();
    assert!(
        events.iter().any(|one| one["kind"] == "working-counter" && one["frame"] == 802),
        "{told}"
    );
    // The verdict of the same capture.
    let (status, verdict) = json_of(&["diagnose", path], "diagnosis");
    assert_eq!((status, &verdict["verdict"]), (1, &json!("faulty")), "{verdict}");
    assert!(events.iter().any(|one| one["kind"] == "finding"), "{told}");
}

#[test]
fn repair_is_seen_in_the_comparison_and_equal_captures_do_not_differ() {
    let folder = TempDir::new().unwrap();
    let (before, after) = (capture(&folder, "before.pcap", 1), capture(&folder, "after.pcap", 2));
    let (before, after) = (before.to_str().unwrap(), after.to_str().unwrap());
    let (status, found) = json_of(&["capture", "compare", before, after], "capture-comparison");
    assert_eq!(status, 1, "{found}");
    let changes = found["changes"].as_array().unwrap();
    let low = changes.iter().find(|one| one["what"] == "working counters too low").unwrap();
    let (from, to) = (&low["before"], &low["after"]);
    assert_eq!((from, to, &low["tendency"]), (&json!("4"), &json!("0"), &json!("better")));
    let gone = changes.iter().find(|one| one["what"] == "finding").unwrap();
    assert_eq!((&gone["after"], &gone["tendency"]), (&Value::Null, &json!("better")), "{gone}");
    let (_, back) = json_of(&["capture", "compare", after, before], "capture-comparison");
    assert!(back["changes"].to_string().contains("worse"), "{back}");
    let (status, same) = json_of(&["capture", "compare", after, after], "capture-comparison");
    assert_eq!((status, &same["changes"]), (0, &json!([])), "{same}");
    let text = linesman(["capture", "compare", before, after]);
    assert!(text.stdout.contains("working counters too low"), "{}", text.stdout);
}

#[test]
fn start_up_is_told_and_drawn_in_order_of_time() {
    let Some(directory) = captures() else { return };
    let path = directory.join("ec-replay-ek1914-el3004-mailbox.pcapng");
    let folder = TempDir::new().unwrap();
    let svg = folder.path().join("line.svg");
    let (capture, drawing) = (path.to_str().unwrap(), svg.to_str().unwrap());
    let (status, told) =
        json_of(&["capture", "timeline", capture, "--svg", drawing], "capture-timeline");
    assert_eq!(status, 0);
    let events = told["events"].as_array().unwrap();
    let times: Vec<u64> = events.iter().map(|one| one["at_ns"].as_u64().unwrap()).collect();
    assert!(times.is_sorted(), "{times:?}");
    for kind in ["state-asked", "state", "mailbox"] {
        assert!(events.iter().any(|one| one["kind"] == kind), "{kind}: {told}");
    }
    let all = elements(&fs::read_to_string(&svg).unwrap());
    let states = all.iter().filter(|one| one.name == "rect" && one.has_class("PREOP"));
    assert_eq!(states.count(), 2, "both reach PREOP once");
    let again = linesman(["capture", "timeline", capture, "--svg", drawing]);
    assert_eq!(again.status, 2, "a file that is there stays: {}", again.all());
}

#[test]
fn page_of_a_capture_tells_the_events_of_its_time_line() {
    let folder = TempDir::new().unwrap();
    let (path, page) = (capture(&folder, "low.pcap", 1), folder.path().join("report.html"));
    let path = path.to_str().unwrap();
    let (_, told) = json_of(&["capture", "timeline", path], "capture-timeline");
    let run = linesman(["diagnose", path, "--html", page.to_str().unwrap()]);
    assert_eq!(run.status, 1, "{}", run.all());
    let page = fs::read_to_string(&page).unwrap();
    let (_, section) = page.split_once("<h2>What happened</h2>").unwrap();
    let (section, _) = section.split_once("</section>").unwrap();
    let events = told["events"].as_array().unwrap();
    assert_eq!(section.matches("<tr").count(), events.len() + 1, "{section}");
    for event in events {
        assert!(section.contains(event["text"].as_str().unwrap()), "{event}: {section}");
    }
    // The verdict is the same with and without the page.
    let (_, with) = json_of(&["diagnose", path], "diagnosis");
    let other = folder.path().join("other.html");
    let (_, without) = json_of(&["diagnose", path, "--html", other.to_str().unwrap()], "diagnosis");
    assert_eq!(with, without);
}
