//! Damaged frames, through the command line: for every link of a tree, each direction, 1, 10 and
//! 1,000 hits, with and without controllers that count forwarded errors, the place is named.
//!
//! What a hit does to a frame follows from the way of the frame through the segment; the places
//! expected here follow from nothing but the segment file.

use std::fmt::Write as _;
use std::process::Command;

use serde_json::Value;

/// A branched line in processing order: name, type, where it hangs. The numbers that people see
/// are places in this list, from 1.
const LINE: [(&str, &str, &str); 9] = [
    ("K1", "EK1100", "maindevice"),
    ("T2", "EL1008", "K1.B"),
    ("T3", "EL2008", "T2.B"),
    ("J4", "EK1122", "T3.B"),
    ("K5", "EK1100", "J4.D"),
    ("T6", "EL1004", "K5.B"),
    ("K7", "EK1100", "J4.B"),
    ("T8", "EL2004", "K7.B"),
    ("T9", "EL1008", "J4.C"),
];

/// One end of a link: the number of the SubDevice (0: MainDevice) and its port.
type End = (u64, String);

struct Link {
    /// As segment files write the ends.
    ends: [String; 2],
    a: End,
    b: End,
}

fn links() -> Vec<Link> {
    let no = |name: &str| 1 + LINE.iter().position(|device| device.0 == name).unwrap() as u64;
    let links = LINE.iter().map(|(name, _, on)| {
        let a = match on.rsplit_once('.') {
            Some((upstream, port)) => (no(upstream), port.to_owned()),
            None => (0, "A".to_owned()),
        };
        Link { ends: [(*on).to_owned(), format!("{name}.A")], a, b: (no(name), "A".to_owned()) }
    });
    links.collect()
}

fn segment(forwarded: bool, old_counters: bool, fault: &str) -> String {
    let mut text = format!(
        "name = \"branched\"\nseed = 11\ncounts_forwarded = {forwarded}\nold_counters = {old_counters}\n"
    );
    for (name, kind, on) in LINE {
        writeln!(text, "[[device]]\nname = \"{name}\"\ntype = \"{kind}\"\non = \"{on}\"").unwrap();
    }
    text + fault
}

/// Runs `diagnose sim:… --json` and gives its status and its answer.
fn diagnose(name: &str, segment: &str) -> (i32, Value) {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join(format!("{name}.toml"));
    std::fs::write(&file, segment).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_linesman"))
        .args(["diagnose", &format!("sim:{}", file.display()), "--json", "--seconds", "8"])
        .output()
        .unwrap();
    let answer = serde_json::from_slice(&output.stdout).unwrap_or_else(|error| {
        panic!("{name}: {error}\n{}", String::from_utf8_lossy(&output.stderr))
    });
    (output.status.code().unwrap(), answer)
}

/// Whether a place is this link and direction.
fn is_at(place: &Value, link: &Link, direction: &str) -> bool {
    let end = |end: &End| serde_json::json!({ "no": end.0, "port": end.1 });
    place["kind"] == "link"
        && place["a"] == end(&link.a)
        && place["b"] == end(&link.b)
        && place["direction"] == direction
}

/// What one fault led to: nothing when the place was named.
fn complaint(forwarded: bool, hits: u32, link: &Link, towards: usize) -> Option<String> {
    let direction = ["b-to-a", "a-to-b"][towards];
    let at = format!("{}>{}", link.ends[1 - towards], link.ends[towards]);
    let fault = format!(
        "[[fault]]\nkind = \"cable-degraded\"\nat = \"{at}\"\nfrom_ms = 4000\nto_ms = 6000\nhits = {hits}\n"
    );
    let name = format!("{at}, {hits} hits, forwarded counting: {forwarded}");
    let (status, answer) = diagnose("hits", &segment(forwarded, true, &fault));
    let findings = answer["findings"].as_array().unwrap();
    let right = findings.iter().filter(|finding| is_at(&finding["place"], link, direction)).count();
    let others: Vec<String> = findings
        .iter()
        .filter(|finding| !is_at(&finding["place"], link, direction))
        .filter(|finding| finding["severity"] != "info")
        .map(|finding| format!("{} {} {}", finding["code"], finding["cause"], finding["place"]))
        .collect();
    if status == 1 && right == 1 && others.is_empty() {
        return None;
    }
    Some(format!("{name}: status {status}, {right} findings at the place, others: {others:#?}"))
}

fn all_places(forwarded: bool, hits: u32) {
    let links = links();
    let complaints: Vec<String> = links
        .iter()
        .flat_map(|link| (0..2).filter_map(move |to| complaint(forwarded, hits, link, to)))
        .collect();
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

// proves: HW-18
#[test]
fn a_single_hit_is_located() {
    all_places(true, 1);
}

#[test]
fn ten_hits_are_located() {
    all_places(true, 10);
}

#[test]
fn a_thousand_hits_are_located() {
    all_places(true, 1_000);
}

#[test]
fn a_single_hit_is_located_by_controllers_that_count_everything() {
    all_places(false, 1);
}

#[test]
fn ten_hits_are_located_by_controllers_that_count_everything() {
    all_places(false, 10);
}

#[test]
fn a_thousand_hits_are_located_by_controllers_that_count_everything() {
    all_places(false, 1_000);
}

#[test]
fn old_counters_are_history() {
    for forwarded in [true, false] {
        let (status, answer) = diagnose("old", &segment(forwarded, true, ""));
        assert_eq!((status, &answer["verdict"]), (0, &Value::from("healthy")), "{answer:#}");
        assert_eq!(answer["findings"].as_array().unwrap().len(), 0);
        assert_eq!(answer["network"]["al_state_highest"], "OP");
    }
}
