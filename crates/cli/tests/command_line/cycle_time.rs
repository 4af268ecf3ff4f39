//! Another cycle time than that of a file: `--cycle-us` of `run` and `plan`.

use std::fs;
use std::path::PathBuf;

use crate::support::{Run, linesman};
use tempfile::TempDir;

const TASK: &str = "[[task]]\nname = \"motion\"\ncycle_us = 2000\n";

/// A coupler and a drive, whose clock is as said.
fn project(tasks: &str, clock: &str) -> String {
    format!(
        "name = \"axis\"\n{tasks}[[device]]\nname = \"Coupler\"\non = \"maindevice\"\n\
         [device.description]\n[[device]]\nname = \"Drive\"\non = \"Coupler.B\"\n{clock}\n\
         [device.description]\n\
         mailbox = {{ receive = [0x1000, 128], send = [0x1080, 128], protocols = [\"CoE\"] }}\n\
         outputs_bits = 48\ninputs_bits = 48\n"
    )
}

/// The project, its ENI, and the segment that is made of it.
struct Bench {
    folder: TempDir,
}

impl Bench {
    fn new(project: &str) -> Self {
        let bench = Self { folder: TempDir::new().unwrap() };
        fs::write(bench.path("axis.toml"), project).unwrap();
        let file = |name: &str| bench.path(name).display().to_string();
        let (segment, eni) = (file("line.toml"), file("axis.xml"));
        let made = bench.run("plan", "axis.toml", &["--segment", &segment, "--export", &eni]);
        assert!(made.status <= 1, "{}", made.all());
        bench
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn run(&self, command: &str, file: &str, more: &[&str]) -> Run {
        let file = self.path(file).display().to_string();
        linesman([command, &file].into_iter().chain(more.iter().copied()))
    }

    /// Runs the line for a second.
    fn drive(&self, file: &str, more: &[&str]) -> Run {
        let on = format!("sim:{}", self.path("line.toml").display());
        let fixed = ["--on", &on, "--seconds", "1", "--json", "--no-diagnosis"];
        let words: Vec<&str> = fixed.into_iter().chain(more.iter().copied()).collect();
        self.run("run", file, &words)
    }
}

#[track_caller]
fn cycles(run: &Run) -> u64 {
    assert!(run.status <= 1, "{}", run.all());
    let report = run.json();
    assert!(!report["reached_ns"].is_null(), "{report}");
    report["counts"]["cycles"].as_u64().unwrap()
}

#[track_caller]
fn refused(run: &Run, words: &[&str]) {
    assert_eq!(run.status, 2, "{}", run.all());
    assert!(run.stderr.contains("\ndo: "), "{}", run.stderr);
    for word in words {
        assert!(run.stderr.contains(word), "`{word}`: {}", run.stderr);
    }
}

#[test]
fn a_cycle_time_holds_for_projects_and_eni_files() {
    let bench = Bench::new(&project(TASK, ""));
    for file in ["axis.toml", "axis.xml"] {
        assert!((400..=510).contains(&cycles(&bench.drive(file, &[]))), "2 ms of {file}");
        let faster = cycles(&bench.drive(file, &["--cycle-us", "500"]));
        assert!((1_600..=2_010).contains(&faster), "{file}: {faster}");
        let plan = bench.run("plan", file, &["--cycle-us", "500", "--json"]).json();
        assert_eq!(plan["tasks"][0]["cycle_ns"], 500_000, "{file}");
    }
    // One that says no cycle time takes it, too.
    let bench = Bench::new(&project("", ""));
    let faster = cycles(&bench.drive("axis.toml", &["--cycle-us", "500"]));
    assert!((1_600..=2_010).contains(&faster), "{faster}");
}

#[test]
fn an_eni_file_without_a_cycle_time_takes_the_one_that_is_said() {
    let bench = Bench::new(&project(TASK, ""));
    let text = fs::read_to_string(bench.path("axis.xml")).unwrap();
    let (begin, rest) = text.split_once("<CycleTime>").unwrap();
    let (_, end) = rest.split_once("</CycleTime>").unwrap();
    fs::write(bench.path("axis.xml"), format!("{begin}{end}")).unwrap();
    refused(&bench.drive("axis.xml", &[]), &["no CycleTime", "`--cycle-us 1000`"]);
    let said = cycles(&bench.drive("axis.xml", &["--cycle-us", "1000"]));
    assert!((800..=1_010).contains(&said), "{said}");
}

#[test]
fn a_cycle_time_that_cannot_be_had_is_refused() {
    let two = format!("{TASK}[[task]]\nname = \"slow\"\ncycle_us = 10000\n");
    let several = Bench::new(&project(&two, ""));
    let words = ["task `motion` every 2", "task `slow` every 10", "one cycle time"];
    refused(&several.drive("axis.toml", &["--cycle-us", "500"]), &words);
    // SYNC0 is set up for the time of the file, and so may be what else the drive was told.
    let own = "clock = { assign_activate = 0x0300, sync0_cycle_us = 2000 }";
    let clocked = Bench::new(&project(TASK, own));
    for file in ["axis.toml", "axis.xml"] {
        let run = clocked.run("plan", file, &["--cycle-us", "500"]);
        refused(&run, &["`Drive` has SYNC0 every 2"]);
        assert!(clocked.run("plan", file, &["--cycle-us", "2000"]).status <= 1, "it has that one");
    }
    // A clock that follows its task does so here.
    let follows = Bench::new(&project(TASK, "clock = { assign_activate = 0x0300 }"));
    let plan = follows.run("plan", "axis.toml", &["--cycle-us", "500", "--json"]).json();
    assert_eq!(plan["clock"]["devices"][0]["sync0_cycle_ns"], 500_000, "{}", plan["clock"]);
}

#[test]
fn the_target_state_holds_for_eni_files() {
    let bench = Bench::new(&project(TASK, ""));
    let run = bench.drive("axis.xml", &["--to", "preop"]);
    assert_eq!(run.json()["devices"][1]["target"], "PREOP", "{}", run.all());
}
