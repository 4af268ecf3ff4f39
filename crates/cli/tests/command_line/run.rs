//! `linesman run` on virtual segments.

use std::fs;
use std::path::PathBuf;

use crate::support::{Run, assert_valid, linesman};
use tempfile::TempDir;

const PLANT: &str = r#"
name = "branch"
seed = 11
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
"#;

struct Place {
    folder: TempDir,
}

impl Place {
    fn new(plant: &str) -> Self {
        let place = Self { folder: TempDir::new().expect("a temporary directory") };
        fs::write(place.path("plant.toml"), plant).unwrap();
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn run(&self, file: Option<&str>, more: &[&str]) -> Run {
        let on = format!("sim:{}", self.path("plant.toml").display());
        let mut arguments = vec!["run".to_owned()];
        arguments.extend(file.map(|file| self.path(file).display().to_string()));
        arguments.extend(["--on".to_owned(), on]);
        arguments.extend(more.iter().map(|one| (*one).to_owned()));
        linesman(arguments)
    }

    /// The project of what is there.
    fn save(&self) {
        let on = format!("sim:{}", self.path("plant.toml").display());
        let run =
            linesman(["scan", &on, "--save", &self.path("machine.toml").display().to_string()]);
        assert_eq!(run.status, 0, "{}", run.stderr);
    }
}

// proves: FRM-16 partial: of a line as found
#[test]
fn a_line_runs_as_its_scan_was_saved() {
    let place = Place::new(PLANT);
    place.save();
    let run = place.run(Some("machine.toml"), &["--seconds", "2", "--json"]);
    assert_eq!(run.status, 0, "{}", run.all());
    let report = run.json();
    assert_valid(&report, "run");
    assert_eq!(report["settled"], true);
    assert!(report["reached_ns"].as_u64().unwrap() < 1_000_000_000, "{report}");
    assert_eq!(report["responding"], 3);
    assert!(report["counts"]["cycles"].as_u64().unwrap() > 1_500);
    for zero in ["cyclic_lost", "cycles_missed", "frames_stray", "undiagnosed"] {
        assert_eq!(report["counts"][zero], 0, "{zero}");
    }
    let devices = report["devices"].as_array().unwrap();
    assert!(devices.iter().all(|device| device["valid"] == true), "{report}");
    assert_eq!(run.stderr, "");
    let again = place.run(Some("machine.toml"), &["--seconds", "2", "--json"]);
    assert_eq!(again.stdout, run.stdout, "virtual time gives the same bytes");
}

#[test]
fn people_read_what_happens() {
    let place = Place::new(PLANT);
    let run = place.run(None, &["--seconds", "1", "--to", "safeop"]);
    assert_eq!(run.status, 0, "{}", run.all());
    for words in
        ["to SAFEOP", "all 3 SubDevices have reached their states", "stopping", "none lost"]
    {
        assert!(run.stdout.contains(words), "{words}: {}", run.stdout);
    }
}

#[test]
fn another_line_than_the_project_says_is_not_driven() {
    let place = Place::new(PLANT);
    place.save();
    fs::write(place.path("plant.toml"), PLANT.replace("EL2008", "EL2004")).unwrap();
    let run = place.run(Some("machine.toml"), &["--seconds", "1"]);
    assert_eq!(run.status, 2, "{}", run.all());
    assert!(run.stderr.contains("place 3: expected SubDevice 3 (EL2008)"), "{}", run.stderr);
    assert!(run.stderr.contains("product code"), "{}", run.stderr);
    fs::write(place.path("plant.toml"), PLANT.split("[[device]]\nname = \"O1\"").next().unwrap())
        .unwrap();
    let run = place.run(Some("machine.toml"), &["--seconds", "1", "--json"]);
    assert_eq!(run.status, 2, "{}", run.all());
    assert!(run.json()["reason"].as_str().unwrap().contains("found 2 SubDevices"), "{}", run.all());
}

#[test]
fn a_fault_while_it_runs_is_told_and_gives_status_1() {
    let place = Place::new(&format!("{PLANT}{O1_IS_OFF}"));
    let run = place.run(None, &["--seconds", "4"]);
    assert_eq!(run.status, 1, "{}", run.all());
    for words in ["Communication interrupted", "Communication re-established"] {
        assert!(run.stdout.contains(words), "{words}: {}", run.stdout);
    }
}

const O1_IS_OFF: &str =
    "[[fault]]\nkind = \"device-off\"\ndevice = \"O1\"\nfrom_ms = 1000\nto_ms = 1500\n";

#[test]
fn findings_of_a_run_stand_in_its_log_and_at_its_end() {
    let place = Place::new(&format!("{PLANT}{O1_IS_OFF}"));
    let log = place.path("log.sqlite").display().to_string();
    let run = place.run(None, &["--seconds", "4", "--log", &log]);
    assert_eq!(run.status, 1, "{}", run.all());
    let (_, end) = run.stdout.split_once("Findings: ").unwrap();
    for words in ["error", "ERROR", "where", "cause", "when", "do  ", "`linesman explain "] {
        assert!(end.contains(words), "{words}: {end}");
    }
    let read = linesman(["log", &log, "--kind", "finding", "--json"]).json();
    assert_valid(&read, "log");
    let entries = read["entries"].as_array().unwrap();
    let mine = entries.iter().filter(|entry| entry["finding"]["code"] == "H101");
    let of_link: Vec<(&str, &str)> = mine
        .map(|entry| (&entry["finding"]["event"], &entry["severity"]))
        .map(|(event, severity)| (event.as_str().unwrap(), severity.as_str().unwrap()))
        .collect();
    let expected = [("opened", "error"), ("confirmed", "error"), ("closed", "info")];
    assert_eq!(of_link, expected, "{entries:#?}");
    let link = entries.iter().find(|entry| entry["finding"]["code"] == "H101").unwrap();
    assert_eq!((&link["no"], &link["finding"]["cause"]), (&3.into(), &"link-open".into()));
    assert!(link["finding"]["place"].as_str().unwrap().contains("port B"), "{link}");
    let text = linesman(["log", &log, "--text", "H101"]).stdout;
    assert!(text.contains("H101 link-lost opened: link ") && text.contains("link-open"), "{text}");
    // Who does not want them gets none.
    let quiet = place.path("quiet.sqlite").display().to_string();
    place.run(None, &["--seconds", "2", "--log", &quiet, "--log-without", "finding"]);
    let read = linesman(["log", &quiet, "--kind", "finding", "--json"]).json();
    assert_eq!(read["entries"], serde_json::json!([]));
}

#[test]
fn the_report_of_a_run_has_the_diagnosis() {
    let place = Place::new(&format!("{PLANT}{O1_IS_OFF}"));
    let run = place.run(None, &["--seconds", "4", "--json"]);
    assert_eq!(run.status, 1, "{}", run.all());
    let report = run.json();
    assert_valid(&report, "run");
    assert_valid(&report["diagnosis"], "diagnosis");
    assert_eq!(report["diagnosis"]["verdict"], "faulty");
    assert!(report["diagnosis"]["tool"].as_str().unwrap().starts_with("linesman "));
    let run = place.run(None, &["--seconds", "4", "--json", "--no-diagnosis"]);
    assert_eq!((run.status, &run.json()["diagnosis"]), (0, &serde_json::Value::Null));
    let place = Place::new(PLANT);
    let run = place.run(None, &["--seconds", "2"]);
    assert!(run.stdout.ends_with("\nNo findings.\n"), "{}", run.stdout);
}

#[test]
fn what_cannot_be_driven_is_refused() {
    let place = Place::new(PLANT);
    let on = |word: &str| linesman(["run", "--on", word]);
    assert!(on("trace.pcap").stderr.contains("nothing can be driven there"));
    assert_eq!(on("listen:eth0").status, 2);
    fs::write(place.path("wrong.toml"), "nme = \"x\"\n").unwrap();
    let run = place.run(Some("wrong.toml"), &["--seconds", "1"]);
    assert_eq!(run.status, 2);
    assert!(run.stderr.contains("unknown field `nme`"), "{}", run.stderr);
    let run = place.run(None, &["--to", "BOOT"]);
    assert_eq!(run.status, 2);
}
