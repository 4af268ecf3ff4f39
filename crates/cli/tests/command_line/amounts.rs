//! Durations and counts on the command line, with a unit and without.

use crate::support::running::PLANT;
use crate::support::{Run, linesman};
use tempfile::TempDir;

struct Place {
    _folder: TempDir,
    on: String,
}

impl Place {
    fn new() -> Self {
        let folder = TempDir::new().unwrap();
        let path = folder.path().join("plant.toml");
        std::fs::write(&path, PLANT).unwrap();
        let on = format!("sim:{}", path.display());
        Self { _folder: folder, on }
    }

    fn run(&self, command: &str, more: &[&str]) -> Run {
        let place: &[&str] = if command == "run" { &["--on", &self.on] } else { &[&self.on] };
        linesman([command].iter().chain(place).chain(more).copied())
    }
}

#[test]
fn times_take_a_unit_or_none() {
    let place = Place::new();
    let lasted = |more: &[&str]| {
        let run = place.run("run", &[more, &["--json", "--no-diagnosis"]].concat());
        assert_eq!(run.status, 0, "{more:?}: {}", run.all());
        run.json()["time_ns"].as_u64().unwrap() / 1_000_000
    };
    for words in [["--seconds", "2"], ["--seconds", "2s"], ["--for", "2000ms"], ["--for", "2.0"]] {
        assert_eq!(lasted(&words), 2_000, "{words:?}");
    }
    let cycles = |more: &[&str]| {
        let fixed = ["--for", "1s", "--json", "--no-diagnosis"];
        let run = place.run("run", &[&fixed[..], more].concat());
        run.json()["counts"]["cycles"].as_u64().unwrap()
    };
    for words in [["--cycle-us", "4000"], ["--cycle-us", "4ms"], ["--cycle", "4ms"]] {
        assert!((200..=251).contains(&cycles(&words)), "{words:?}");
    }
    let watched = |more: &[&str]| {
        let report = place.run("counters", &[more, &["--json"]].concat()).json();
        (report["seconds"].as_f64().unwrap(), report["readings"].as_u64().unwrap())
    };
    assert_eq!(watched(&["--for", "2", "--every-ms", "100"]), (2.0, 21));
    assert_eq!(watched(&["--for", "2s", "--every", "100ms"]), (2.0, 21));
    assert_eq!(place.run("diagnose", &["--for", "200ms", "--json"]).status, 0);
    assert_eq!(place.run("online", &["--for", "1s", "--interval", "500ms", "--json"]).status, 0);
}

#[test]
fn counts_take_a_multiple_or_none() {
    let place = Place::new();
    for (word, least) in [("500", 500), ("2k", 2_000)] {
        let run = place.run("probe", &["--frames", word, "--json"]);
        assert_eq!(run.status, 0, "{word}: {}", run.all());
        assert!(run.json()["sent"].as_u64().unwrap() >= least, "{word}: {}", run.stdout);
    }
}

#[test]
fn what_is_no_time_is_told_with_examples_and_the_range() {
    let place = Place::new();
    let rows: [(&str, &[&str], &str); 7] = [
        ("run", &["--seconds", "soon"], "such as 2s, 500ms"),
        ("run", &["--seconds", "1e3"], "a plain number is in seconds"),
        ("run", &["--cycle-us", "0"], "expected 1us to 10s"),
        ("run", &["--cycle-us", "1m"], "expected 1us to 10s"),
        ("counters", &["--for", "2", "--every-ms", "x"], "is in milliseconds"),
        ("online", &["--interval-ms", "1"], "expected 20ms to 60s"),
        ("probe", &["--frames", "many"], "such as 1000, 10k or 1M"),
    ];
    for (command, words, expected) in rows {
        let run = place.run(command, words);
        assert_eq!(run.status, 2, "{words:?}: {}", run.all());
        assert!(run.stderr.contains(expected), "{words:?}: {}", run.stderr);
    }
}
