//! `linesman counters` and `linesman probe` on virtual segments with and without faults.

use std::path::PathBuf;

use crate::support::{Run, assert_valid, linesman};
use tempfile::TempDir;

const PLANT: &str = r#"
name = "press"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "T1"
type = "EL2008"
on = "K1.B"
[[device]]
name = "K2"
type = "EK1100"
on = "K1.C"
cable_m = 20.0
[[device]]
name = "T2"
type = "EL1008"
on = "K2.B"
"#;

/// Damage on the cable between the couplers, away from the MainDevice.
const NOISE: &str = r#"
[[fault]]
kind = "emc-noise"
at = "K1.C>K2.A"
"#;

struct Desk(TempDir);

impl Desk {
    fn new(fault: &str) -> Self {
        let desk = Self(TempDir::new().unwrap());
        std::fs::write(desk.path("plant.toml"), format!("{PLANT}{fault}")).unwrap();
        desk
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn run(&self, command: &str, rest: &[&str]) -> Run {
        let place = format!("sim:{}", self.path("plant.toml").display());
        linesman([&[command, &place], rest].concat())
    }
}

// proves: HW-20
#[test]
fn one_command_clears_watches_exports_and_judges() {
    let desk = Desk::new(&format!("{NOISE}hits_per_s = 200.0\n"));
    let csv = desk.path("trace.csv");
    let rest =
        ["--clear", "--for", "3", "--every-ms", "100", "--csv", csv.to_str().unwrap(), "--json"];
    let run = desk.run("counters", &rest);
    assert_eq!(run.status, 1, "{}", run.all());
    let report = run.json();
    assert_valid(&report, "counters");
    assert_eq!((report["cleared"].as_bool(), report["readings"].as_u64()), (Some(true), Some(31)));
    let finding = &report["diagnosis"]["findings"][0];
    assert_eq!(
        (finding["place"]["a"]["no"].as_u64(), finding["place"]["a"]["port"].as_str()),
        (Some(1), Some("C"))
    );
    let text = std::fs::read_to_string(&csv).unwrap();
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("time_s,no,name,register,port,counter,value"));
    // 31 readings of four SubDevices, each with the counters that a controller has.
    assert!(lines.clone().count() >= 31 * 4 * 10, "{}", lines.count());
    for register in ["0x0300", "0x0302", "0x0304", "0x0306", "0x0310", "0x0312"] {
        assert!(text.contains(&format!(",{register},")), "{register} is missing");
    }
}

#[test]
fn counters_of_a_healthy_line_are_dots_and_healthy() {
    let desk = Desk::new("");
    let run = desk.run("counters", &["--for", "2"]);
    assert_eq!(run.status, 0, "{}", run.all());
    assert!(run.stdout.contains("HEALTHY"), "{}", run.stdout);
    let once = desk.run("counters", &[]);
    assert_eq!(once.status, 0);
    assert!(once.stdout.contains("1   K1    ."), "{}", once.stdout);
}

// proves: HW-06
#[test]
fn a_probe_tells_link_by_link_what_became_of_many_frames() {
    let desk = Desk::new(&format!("{NOISE}hits_per_s = 20000.0\n"));
    let run = desk.run("probe", &["--frames", "500", "--json"]);
    assert_eq!(run.status, 1, "{}", run.all());
    let report = run.json();
    assert_valid(&report, "probe");
    assert_eq!(report["sent"], 500);
    let links = report["links"].as_array().unwrap();
    assert_eq!(links.len(), 4);
    let bad: Vec<&str> = links
        .iter()
        .filter(|link| link["away"] != serde_json::json!([0, 0]))
        .map(|link| link["far"].as_str().unwrap())
        .collect();
    assert_eq!(bad, ["K2 (EK1100).A"], "{report:#}");
    let finding = &report["diagnosis"]["findings"][0];
    assert_eq!(finding["place"]["a"]["port"], "C", "{finding:#}");
    let run = desk.run("probe", &["--frames", "50"]);
    assert!(run.stdout.contains("50 frames sent"), "{}", run.stdout);
}

#[test]
fn a_probe_of_a_healthy_line_finds_nothing() {
    let run = Desk::new("").run("probe", &["--frames", "200"]);
    assert_eq!(run.status, 0, "{}", run.all());
    assert!(run.stdout.contains("200 frames sent, 0 not answered."), "{}", run.stdout);
    assert!(!run.stdout.contains("errors"), "{}", run.stdout);
}

#[test]
fn a_line_that_cannot_be_asked_is_refused_with_the_way() {
    let run = linesman(["probe", "capture:trace.pcapng"]);
    assert_eq!(run.status, 2);
    assert!(run.stderr.contains("name a network card"), "{}", run.stderr);
}
