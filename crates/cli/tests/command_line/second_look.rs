//! `diagnose --after`: what became of a finding after something was exchanged.

use std::fs;
use std::path::PathBuf;

use serde_json::Value;
use tempfile::TempDir;

use crate::support::bench::plant;
use crate::support::{Run, assert_valid, linesman};

/// What hangs on the second port of the coupler, and one direction of its cable that is hit again and again.
const BRANCH: &str = r#"
[[device]]
name = "K2"
type = "EK1100"
on = "K1.C"
cable_m = 20.0
"#;

const DAMAGED: &str = r#"
[[fault]]
kind = "receiver-damaged"
at = "K1.C>K2.A"
from_ms = 2500
hits_per_s = 300.0
"#;

/// A folder with the plant as it was, the plant mended, and the diagnosis of the first.
struct Folder {
    _directory: TempDir,
    broken: String,
    mended: String,
    previous: PathBuf,
}

impl Folder {
    fn new() -> Self {
        let directory = TempDir::new().unwrap();
        let write = |name: &str, faults: &str| {
            let path = directory.path().join(name);
            let text = format!("{}{BRANCH}{faults}", plant("branch", 11).to_toml());
            fs::write(&path, text).unwrap();
            format!("sim:{}", path.display())
        };
        let (broken, mended) = (write("broken.toml", DAMAGED), write("mended.toml", ""));
        let previous = directory.path().join("previous.json");
        let run = linesman(["diagnose", &broken, "--for", "6s", "--json"]);
        assert_eq!(run.status, 1, "{}", run.all());
        fs::write(&previous, &run.stdout).unwrap();
        Self { _directory: directory, broken, mended, previous }
    }

    fn again(&self, place: &str, step: &str, more: &[&str]) -> Run {
        let previous = self.previous.to_str().unwrap();
        let words = ["diagnose", place, "--after", step, previous];
        linesman(words.into_iter().chain(more.iter().copied()))
    }
}

fn confidence(diagnosis: &Value, cause: &str) -> f64 {
    let finding = &diagnosis["findings"][0];
    let others = finding["alternatives"].as_array().unwrap();
    let mut all = std::iter::once(finding).chain(others);
    let found = all.find(|one| one["cause"] == cause);
    found.map_or(0.0, |one| one["confidence"].as_f64().unwrap())
}

#[test]
fn what_stays_after_an_exchange_clears_the_part() {
    let folder = Folder::new();
    let before: Value = serde_json::from_slice(&fs::read(&folder.previous).unwrap()).unwrap();
    assert_eq!(before["second_look"], Value::Null);
    let after = folder.again(&folder.broken, "exchanged-cable", &["--for", "6s", "--json"]);
    assert_eq!(after.status, 1, "{}", after.all());
    let after = after.json();
    assert_valid(&after, "diagnosis");
    let look = &after["second_look"];
    assert_eq!((&look["part"], &look["outcome"]), (&"cable".into(), &"stayed".into()), "{look}");
    let [was, is] = [&before, &after].map(|one| confidence(one, "cable-degraded"));
    assert!(is < was / 3.0, "{was} then {is}");
    let end = folder.again(&folder.broken, "exchanged-device:2", &["--for", "6s"]);
    assert_eq!(end.status, 2, "no end of that cable: {}", end.all());
    let text = folder.again(&folder.broken, "exchanged-device:4", &["--for", "6s"]).stdout;
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(text.contains("is there again: the SubDevice that was exchanged is not it"), "{text}");
}

#[test]
fn what_is_gone_blames_the_part_once_the_look_was_long_enough() {
    let folder = Folder::new();
    let look = |lasts: &str| {
        let run = folder.again(&folder.mended, "exchanged-device:4", &["--for", lasts, "--json"]);
        assert_eq!(run.status, 0, "{}", run.all());
        run.json()["second_look"]["outcome"].clone()
    };
    assert_eq!(look("3s"), "not-yet", "it had shown after two and a half seconds before");
    assert_eq!(look("30s"), "gone");
}

#[test]
fn a_second_look_says_what_is_wrong_with_its_words() {
    let folder = Folder::new();
    for (step, says) in [
        ("exchanged-luck", "expected exchanged-cable"),
        ("exchanged-cable:3", "only a device has a number"),
        ("exchanged-device:0", "from 1"),
        ("exchanged-card", "none of its"),
    ] {
        let run = folder.again(&folder.mended, step, &[]);
        assert_eq!(run.status, 2, "{}", run.all());
        assert!(run.stderr.contains(says), "{step}: {}", run.stderr);
    }
    fs::write(&folder.previous, "{").unwrap();
    let run = folder.again(&folder.mended, "exchanged-cable", &[]);
    assert_eq!(run.status, 2, "{}", run.all());
    assert!(run.stderr.contains("previous.json"), "{}", run.stderr);
}
