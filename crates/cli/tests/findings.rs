//! Every code that `linesman explain` has a page for is shown to fire, and to be silent where something only
//! looks like it: by a story of `scenarios/`, or by a test that says so.
//!
//! A story shows a code with `expect finding CODE`, and its silence with `expect no finding CODE`. What no
//! story can play, such as a recording of one direction, is shown by a Rust test with `// fires: CODE` or
//! `// silent: CODE` above it.

#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]

mod support;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use linesman_diagnosis::rule;
use support::linesman;

fn house() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Codes that are shown to fire, and codes that are shown to be silent.
#[derive(Default)]
struct Shown {
    fires: BTreeSet<String>,
    silent: BTreeSet<String>,
}

impl Shown {
    fn story(&mut self, text: &str) {
        for step in text.lines().filter(|line| line.starts_with("- ")) {
            let words: Vec<&str> = step.split_whitespace().collect();
            for three in words.windows(3) {
                match three {
                    ["expect", "finding", code] => drop(self.fires.insert((*code).to_owned())),
                    ["no", "finding", code] => drop(self.silent.insert((*code).to_owned())),
                    _ => {}
                }
            }
        }
    }

    fn test(&mut self, text: &str) {
        let mut lines = text.lines().peekable();
        while let Some(line) = lines.next() {
            let (set, codes) =
                match (line.strip_prefix("// fires: "), line.strip_prefix("// silent: ")) {
                    (Some(codes), _) => (&mut self.fires, codes),
                    (None, Some(codes)) => (&mut self.silent, codes),
                    (None, None) => continue,
                };
            let next = lines.peek().copied().unwrap_or_default();
            assert!(next.starts_with("// ") || next == "#[test]", "`{line}` stands above no test");
            set.extend(codes.split(", ").map(str::to_owned));
        }
    }
}

fn files(folder: &Path, extension: &str) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let fits = |path: &PathBuf| path.extension().is_some_and(|found| found == extension);
    entries.filter(fits).map(|path| fs::read_to_string(path).unwrap()).collect()
}

#[test]
fn every_page_has_a_case_that_fires_and_a_look_alike_that_does_not() {
    let mut shown = Shown::default();
    for story in files(&house().join("scenarios"), "md") {
        shown.story(&story);
    }
    for folder in ["crates/diagnosis/tests", "crates/cli/tests"] {
        for test in files(&house().join(folder), "rs") {
            shown.test(&test);
        }
    }
    let codes = || rule::catalogue().into_iter().map(|page| page.code.to_owned());
    let never: Vec<String> = codes().filter(|code| !shown.fires.contains(code)).collect();
    assert!(never.is_empty(), "no story and no test shows them: {never:?}");
    let always: Vec<String> = codes().filter(|code| !shown.silent.contains(code)).collect();
    assert!(always.is_empty(), "no look-alike without them: {always:?}");
}

#[test]
fn every_code_has_a_page() {
    for page in rule::catalogue() {
        let run = linesman(["explain", page.code]);
        assert_eq!(run.status, 0, "{}: {}", page.code, run.all());
        for part in ["How it is found.", "What it means.", "What to do."] {
            assert!(run.stdout.contains(part), "{}: {part}", page.code);
        }
    }
}

/// What the page of a topic says, in one line.
fn topic(name: &str) -> String {
    let run = linesman(["explain", name]);
    assert_eq!(run.status, 0, "{name}: {}", run.all());
    run.stdout.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Fails unless all of it is said, in this order.
#[track_caller]
fn in_order(text: &str, wanted: &[&str]) {
    let mut rest = text;
    for words in wanted {
        let at = rest.find(words).unwrap_or_else(|| panic!("`{words}` is missing in: {text}"));
        rest = &rest[at + words.len()..];
    }
}

// proves: HW-25, HW-03
#[test]
fn once_located_there_is_a_list_in_order_and_a_checklist_of_ground_and_shield() {
    in_order(
        &topic("located"),
        &[
            "power cables",
            "plug made by hand",
            "shield",
            "supply",
            "E-bus",
            "ground",
            "ETG.1600",
            "Exchange",
        ],
    );
    in_order(&topic("located"), &["Checklist of ground and shield", "one common ground potential"]);
}

// proves: HW-11, HW-16, HW-17
#[test]
fn lamps_line_codes_and_the_two_counters_are_explained() {
    in_order(
        &topic("lamps"),
        &["Link/Activity", "flickers", "last lamp that flickers is before the break"],
    );
    in_order(&topic("line-codes"), &["MLT-3", "LVDS", "TIA/EIA-644", "Manchester"]);
    in_order(
        &topic("two counters"),
        &["no no some", "no yes some", "inside a device", "yes no some", "between", "yes yes some"],
    );
    in_order(&topic("lost-links"), &["Cable or plug", "E-bus contact", "Supply"]);
}

// proves: SW-05
#[test]
fn start_up_errors_have_ordered_advice() {
    in_order(
        &topic("start-up-errors"),
        &["0x1018", "defaults", "Modules", "slot by slot", "jitter", "shift"],
    );
}

// proves: SW-06 partial: the order itself
#[test]
fn running_errors_have_ordered_advice_hardware_first() {
    in_order(
        &topic("running-errors"),
        &["Hardware first", "Watchdog", "task run", "20 to 30 %", "capture"],
    );
}
