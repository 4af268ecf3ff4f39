//! Every code that `linesman explain` has a page for is shown to fire, and to be silent where something only
//! looks like it: by a story of `scenarios/`, or by a test that says so.
//!
//! A story shows a code with `expect finding CODE`, and its silence with `expect no finding CODE`. What no
//! story can play, such as a recording of one direction, is shown by a Rust test with `// fires: CODE` or
//! `// silent: CODE` above it.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use crate::support::{linesman, schema};
use linesman_diagnosis::rule;

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
    for folder in ["crates/diagnosis/tests/evidence", "crates/cli/tests/command_line"] {
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

// proves: DIA-02
#[test]
fn every_finding_carries_its_class_in_text_and_json() {
    let finding = &schema("diagnosis")["$defs"]["FindingReport"];
    assert!(finding["required"].as_array().unwrap().contains(&"class".into()), "{finding:#}");
    let classes = [
        ('H', "hardware"),
        ('S', "software"),
        ('C', "configuration"),
        ('T', "timing"),
        ('X', "host"),
    ];
    for page in rule::catalogue() {
        let class = classes.iter().find(|(letter, _)| page.code.starts_with(*letter));
        let (_, class) = class.unwrap_or_else(|| panic!("{} is of no class", page.code));
        let title = linesman(["explain", page.code]).stdout;
        let title = title.lines().next().unwrap_or_default();
        assert!(title.ends_with(&format!(", {class})")), "{}: {title}", page.code);
    }
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

/// The numbered steps of a topic's page, each in one line.
fn steps(name: &str) -> Vec<String> {
    let mut steps: Vec<String> = Vec::new();
    for line in linesman(["explain", name]).stdout.lines() {
        let words = line.trim();
        match words.split_once(". ") {
            Some((number, rest)) if number == (steps.len() + 1).to_string() => {
                steps.push(rest.to_owned());
            }
            // A step goes on with deeper lines.
            _ if line.starts_with("     ") => {
                if let Some(step) = steps.last_mut() {
                    step.push(' ');
                    step.push_str(words);
                }
            }
            _ => {}
        }
    }
    steps
}

/// Fails unless a page has these steps first, each with all of its words.
#[track_caller]
fn has_steps(name: &str, wanted: &[&[&str]]) {
    let steps = steps(name);
    for (at, words) in wanted.iter().enumerate() {
        let step = steps.get(at).unwrap_or_else(|| panic!("{name} has no step {}", at + 1));
        for word in *words {
            assert!(step.contains(word), "{name}, step {}: `{word}` is missing in: {step}", at + 1);
        }
    }
}

// S0 L2096-2105.
// proves: HW-25, HW-03
#[test]
fn once_located_there_is_a_list_in_order_and_a_checklist_of_ground_and_shield() {
    has_steps(
        "located",
        &[
            &["cable between the two devices", "power cables", "plug made by hand", "shield"],
            &["supply of both devices", "E-bus"],
            &["ground", "same potential", "ETG.1600"],
            &["Exchange", "with each other", "moves with a device", "belongs to the place"],
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
}

// S0 L1749-1752.
// proves: HW-09
#[test]
fn lost_link_has_its_three_reasons_in_order() {
    has_steps(
        "lost-links",
        &[
            &["Cable or plug", "damaged", "unplugged", "locks"],
            &["E-bus contact", "not pushed in fully", "vibration"],
            &["Supply", "without power", "fuse"],
        ],
    );
}

// S0 L1847-1856.
// proves: HW-14
#[test]
fn symbols_inside_and_between_frames_are_why_the_two_counters_differ() {
    in_order(
        &topic("two-counters"),
        &[
            "the low byte counts frames whose check sequence is wrong",
            "the high byte counts symbols that the line code does not know",
            "between frames nobody checks a sequence",
            "a letter that is none within a word: both counters rise",
            "hits within and between them",
            "Bad frames without bad symbols come from inside a device",
            "Bad symbols without bad frames",
        ],
    );
}

// S0 L2253-2260.
// proves: SW-05
#[test]
fn start_up_errors_have_ordered_advice() {
    has_steps(
        "start-up-errors",
        &[
            &["description", "ESI", "product code and revision", "0x1018"],
            &["Changed settings", "maker's defaults", "0x001D", "0x001E"],
            &["Modules", "slot by slot", "0x0003"],
            &["Clocks", "jitter", "shift", "0x0035"],
        ],
    );
    // The same order in what is to be done about a single code, behind what is its own.
    for code in ["al:0x001D", "al:0x001E", "al:0x0003"] {
        let page = linesman(["explain", code, "--json"]).json();
        let sections = page["readings"][0]["sections"].as_array().unwrap();
        let advice = sections.iter().find(|one| one["heading"] == "do").unwrap().to_string();
        let slots = if code == "al:0x0003" { "" } else { "slot by slot" };
        in_order(&advice, &["0x1018", "defaults", slots, "ask the manufacturer"]);
    }
}

// proves: SW-06 partial: the order itself
#[test]
fn running_errors_have_ordered_advice_hardware_first() {
    in_order(
        &topic("running-errors"),
        &["Hardware first", "Watchdog", "task run", "20 to 30 %", "capture"],
    );
}
