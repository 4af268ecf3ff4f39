//! Tasks, sync units and repeats of a project, from its file to a line that runs.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use crate::support::linesman;
use linesman::{DeviceHandle, Next, RunOptions};
use serde_json::{Value, json};
use tempfile::TempDir;

/// A project, the segment that is made of it, and faults of that segment.
struct Bench {
    _folder: TempDir,
    project: PathBuf,
    segment: PathBuf,
}

impl Bench {
    fn new(project: &str, faults: &str) -> Self {
        let folder = TempDir::new().unwrap();
        let file = |name: &str| folder.path().join(name);
        let (project_file, segment) = (file("project.toml"), file("line.toml"));
        fs::write(&project_file, project).unwrap();
        let words =
            ["plan", project_file.to_str().unwrap(), "--segment", segment.to_str().unwrap()];
        let made = linesman(words);
        assert!(made.status <= 1, "{}", made.all());
        let text = fs::read_to_string(&segment).unwrap();
        fs::write(&segment, format!("{text}\n{faults}")).unwrap();
        Self { _folder: folder, project: project_file, segment }
    }

    /// One of the tables of the sources.
    fn of(file: &str) -> Self {
        let path = format!("{}/tests/data/plan/{file}.toml", env!("CARGO_MANIFEST_DIR"));
        Self::new(&fs::read_to_string(path).unwrap(), "")
    }

    fn plan(&self) -> Value {
        let run = linesman(["plan", self.project.to_str().unwrap(), "--json"]);
        assert!(run.status <= 1, "{}", run.all());
        run.json()
    }

    fn run(&self, seconds: &str) -> Value {
        let on = format!("sim:{}", self.segment.display());
        let project = self.project.to_str().unwrap();
        let words = ["run", project, "--on", &on, "--seconds", seconds, "--json", "--no-diagnosis"];
        let run = linesman(words);
        assert!(run.status <= 1, "{}", run.all());
        let report = run.json();
        assert!(!report["reached_ns"].is_null(), "{report}");
        report
    }
}

// S0 L379-388.
// proves: SYN-16
#[test]
fn earlier_fetch_is_planned_a_whole_number_of_base_ticks_ahead() {
    let path = format!("{}/tests/data/plan/separate-inputs.toml", env!("CARGO_MANIFEST_DIR"));
    let text = fs::read_to_string(path).unwrap();
    let planned = |base_time_us: u32, pre_ticks: &str| {
        let text = text.replace("pre_ticks = 3", &format!("pre_ticks = {pre_ticks}")).replace(
            "name = \"separate-inputs\"",
            &format!("name = \"ticks\"\nnetwork = {{ base_time_us = {base_time_us} }}"),
        );
        let folder = TempDir::new().unwrap();
        let project = folder.path().join("project.toml");
        fs::write(&project, text).unwrap();
        linesman(["plan", project.to_str().unwrap(), "--json"])
    };
    for (base_time_us, pre_ticks) in [(1_000, 3), (1_000, 1), (250, 3), (50, 7), (1_000, 0)] {
        let plan = planned(base_time_us, &pre_ticks.to_string());
        assert!(plan.status <= 1, "{}", plan.all());
        let report = plan.json();
        let frames = report["tasks"][0]["frames"].as_array().unwrap();
        let ahead: Vec<u64> = frames.iter().map(|one| one["ahead_ns"].as_u64().unwrap()).collect();
        // A smaller base time makes it finer.
        let expected = 1_000 * u64::from(base_time_us) * pre_ticks;
        assert_eq!((ahead[0], ahead[1]), (expected, 0), "{base_time_us} µs, {pre_ticks}");
    }
    let half = planned(1_000, "1.5");
    assert_eq!(half.status, 2, "half a tick: {}", half.all());
    assert!(half.stderr.contains("pre_ticks"), "{}", half.stderr);
}

/// The rows of all frames: command, bytes, working counter, sync unit.
fn rows(report: &Value) -> Vec<(u64, Value)> {
    let mut rows = Vec::new();
    for task in report["tasks"].as_array().unwrap() {
        for frame in task["frames"].as_array().unwrap() {
            for row in frame["datagrams"].as_array().unwrap() {
                let row = json!([row["command"], row["len"], row["wkc"], row["sync_unit"]]);
                rows.push((frame["no"].as_u64().unwrap(), row));
            }
        }
    }
    rows
}

/// Drives that share sync units.
fn drives(unit: impl Fn(usize) -> &'static str, more: &str) -> String {
    let mut text = "name = \"axes\"\n[[task]]\nname = \"motion\"\ncycle_us = 2000\n\
                    [[device]]\nname = \"Coupler\"\non = \"maindevice\"\n[device.description]\n"
        .to_owned();
    let mut on = "Coupler.B".to_owned();
    for drive in 1..=6 {
        let unit = unit(drive);
        write!(
            text,
            "[[device]]\nname = \"Drive {drive}\"\non = \"{on}\"\nsync_unit = \"{unit}\"\n{more}\
             [device.description]\n\
             mailbox = {{ receive = [0x1000, 128], send = [0x1080, 128], protocols = [\"CoE\"] }}\n\
             outputs_bits = 48\ninputs_bits = 48\n"
        )
        .unwrap();
        on = format!("Drive {drive}.B");
    }
    text
}

// S0 L1492-1518: with all drives in one unit one that fails takes the data of all with it; in two
// units only those of its own.
// proves: FRM-22
#[test]
fn a_drive_that_fails_costs_the_data_of_its_sync_unit_only() {
    // Its watchdog expires: it goes to SAFEOP by itself and takes no outputs any more.
    let fails = "[[fault]]\nkind = \"watchdog-starved\"\ndevice = \"Drive 5\"\nwatchdog_ms = 0.5\n\
                 from_ms = 500\nto_ms = 600\n";
    type Unit = fn(usize) -> &'static str;
    let units: [(Unit, &[u32]); 2] = [
        (|_| "all", &[2, 3, 4, 5, 6, 7]),
        (|drive| if drive <= 3 { "left" } else { "right" }, &[5, 6, 7]),
    ];
    for (unit, expected) in units {
        let bench = Bench::new(&drives(unit, ""), fails);
        let mut line = linesman::open(&format!("sim:{}", bench.segment.display())).unwrap();
        let plan = line.load(&bench.project).unwrap();
        let mut discarded = BTreeSet::new();
        let mut cycles = 0;
        line.run(plan, RunOptions::us(2_000), |io| {
            cycles += 1;
            if cycles > 200 {
                let bad = io.devices().filter(|device| !io.quality(*device).valid);
                discarded.extend(bad.map(DeviceHandle::no));
            }
            if cycles < 400 { Next::Continue } else { Next::Stop }
        })
        .unwrap();
        assert_eq!(discarded.into_iter().collect::<Vec<_>>(), expected);
    }
}

// S1 L1134-1138: tasks of 2, 5 and 10 ms, each with frames of its own.
// proves: FRM-30
#[test]
fn three_tasks_run_in_their_own_cycles() {
    let bench = Bench::of("49-44-50-bytes");
    let cycles: Vec<Value> = bench.plan()["tasks"]
        .as_array()
        .unwrap()
        .iter()
        .map(|task| task["cycle_ns"].clone())
        .collect();
    assert_eq!(cycles, [json!(2_000_000), json!(5_000_000), json!(10_000_000)]);
    let report = bench.run("1");
    // In one second, its begin and its end among them.
    assert_eq!(report["counts"]["cyclic_sent"], 501 + 201 + 101);
    assert_eq!(report["counts"]["working_counter_errors"], 0);
    let names: Vec<&Value> =
        report["frames"].as_array().unwrap().iter().map(|frame| &frame["task"]).collect();
    assert_eq!(names, ["fast", "middle", "slow"]);
    assert!(report["devices"].as_array().unwrap().iter().all(|device| device["valid"] == true));
}

// S0 L1430, L1480: a frame that is sent twice survives the loss of one.
// proves: FRM-27
#[test]
fn repeated_frames_survive_losses_where_every_device_allows_it() {
    // Single frames are lost on their way back, far apart.
    let drops = "[[fault]]\nkind = \"host-drops\"\nfrom_ms = 1000\nto_ms = 2900\nhits = 40\n";
    let project = |repeats: u32, more: &str| {
        drives(|_| "all", more)
            .replace("cycle_us = 2000\n", &format!("cycle_us = 2000\nrepeats = {repeats}\n"))
    };
    let bad = |repeats, more: &str| {
        let report = Bench::new(&project(repeats, more), drops).run("3");
        let counts = &report["counts"];
        let lost = counts["cyclic_lost"].as_u64().unwrap();
        (lost, counts["cyclic_sent"].as_u64().unwrap())
    };
    let (lost_once, sent_once) = bad(0, "frame_repeat = true\n");
    let (lost_twice, sent_twice) = bad(1, "frame_repeat = true\n");
    assert!(lost_once >= 20, "{lost_once} cycles without their frame");
    assert!(lost_twice < lost_once / 4, "{lost_twice} of {lost_once}");
    assert!(sent_twice > sent_once * 19 / 10, "{sent_twice} for {sent_once}");
    // A device that does not take repeated frames keeps them from being sent.
    let (_, sent_refused) = bad(1, "");
    assert_eq!(sent_refused, sent_once);
}

// S0 L361-375: before, all in one frame; after, inputs in a frame of their own, three ticks earlier.
// proves: SYN-15, SYN-16 partial: the plan; how much earlier the frame leaves is not measured
#[test]
fn inputs_are_fetched_by_a_frame_of_their_own() {
    let unit = "<default>";
    let joint = Bench::of("joint-inputs");
    assert_eq!(
        rows(&joint.plan()),
        [
            (0, json!(["LWR", 1, 1, unit])),
            (0, json!(["LRD", 1, 1, unit])),
            (0, json!(["BRD", 2, 3, null])),
        ]
    );
    let apart = Bench::of("separate-inputs");
    assert_eq!(
        rows(&apart.plan()),
        [
            (0, json!(["LRD", 1, 1, unit])),
            (1, json!(["LWR", 1, 1, unit])),
            (1, json!(["BRD", 2, 3, null])),
        ]
    );
    for bench in [joint, apart] {
        let report = bench.run("1");
        assert_eq!(report["counts"]["working_counter_errors"], 0, "{report}");
        assert!(report["devices"].as_array().unwrap().iter().all(|device| device["valid"] == true));
    }
    // A time of 3.5 ticks cannot be written at all.
    let text = fs::read_to_string(format!(
        "{}/tests/data/plan/separate-inputs.toml",
        env!("CARGO_MANIFEST_DIR")
    ));
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("project.toml");
    fs::write(&file, text.unwrap().replace("pre_ticks = 3", "pre_ticks = 3.5")).unwrap();
    let refused = linesman(["plan", file.to_str().unwrap()]);
    assert_eq!(refused.status, 2);
    assert!(refused.stderr.contains("pre_ticks"), "{}", refused.stderr);
}

// S0 L1428, L1460: read and write apart count 1 and 1, together 3.
// proves: FRM-26
#[test]
fn a_device_may_be_read_and_written_apart() {
    for (access, expected) in [
        ("read-write", vec![json!(["LRW", 72, 18, "all"])]),
        ("separate", vec![json!(["LRD", 36, 6, "all"]), json!(["LWR", 36, 6, "all"])]),
    ] {
        let project = drives(|_| "all", &format!("access = \"{access}\"\n"));
        let bench = Bench::new(&project, "");
        let mut units: Vec<Value> = rows(&bench.plan())
            .into_iter()
            .map(|(_, row)| row)
            .filter(|row| !row[3].is_null())
            .collect();
        units.sort_by_key(ToString::to_string);
        assert_eq!(units, expected, "{access}");
        let report = bench.run("1");
        assert_eq!(report["counts"]["working_counter_errors"], 0);
        assert!(report["devices"].as_array().unwrap().iter().all(|device| device["valid"] == true));
    }
}

// S0 L1252-1278: a removable branch with data and counter of its own.
// proves: FRM-24 partial: by name alone
#[test]
fn devices_are_put_into_sync_units_by_name() {
    let rows = rows(&Bench::of("452-bytes").plan());
    assert!(rows.contains(&(0, json!(["LRW", 282, 9, "RemovableBranch"]))), "{rows:?}");
}

/// Drives and boxes in units of their own, of two tasks.
fn in_units() -> String {
    let mut text =
        "name = \"units\"\n[[task]]\nname = \"NC-Task 1 SAF\"\ncycle_us = 2000\nrepeats = 1\n\
                    [[task]]\nname = \"Task 2\"\ncycle_us = 10000\n\
                    [[device]]\nname = \"Coupler\"\non = \"maindevice\"\n[device.description]\n"
            .to_owned();
    let mut on = "Coupler.B".to_owned();
    for (name, choices) in [
        ("Drive 1", "sync_unit = \"Axes\"\nframe_repeat = true\n"),
        ("Drive 2", "sync_unit = \"Axes\"\nframe_repeat = true\n"),
        ("Box 10", "sync_unit = \"RemovableBranch\"\ntask = \"Task 2\"\n"),
        ("Box 11", "sync_unit = \"RemovableBranch\"\ntask = \"Task 2\"\n"),
        ("Term 5", "task = \"Task 2\"\n"),
    ] {
        write!(
            text,
            "[[device]]\nname = \"{name}\"\non = \"{on}\"\n{choices}[device.description]\ninputs_bits = 16\n"
        )
        .unwrap();
        on = format!("{name}.B");
    }
    text
}

// S0 L1252-1278: the columns of the source's table: device, sync unit, repeat, task.
// proves: FRM-24
#[test]
fn devices_are_put_into_sync_units_by_name_task_and_repetition() {
    let text = in_units();
    let bench = Bench::new(&text, "");
    let plan = bench.plan();
    let tasks: Vec<Value> = plan["tasks"]
        .as_array()
        .unwrap()
        .iter()
        .map(|task| {
            let frames = task["frames"].as_array().unwrap();
            let rows = frames.iter().flat_map(|frame| {
                let rows = frame["datagrams"].as_array().unwrap().iter();
                rows.filter(|row| !row["sync_unit"].is_null()).map(move |row| {
                    json!([row["sync_unit"], row["len"], row["wkc"], frame["copies"]])
                })
            });
            json!([task["name"], rows.collect::<Vec<_>>()])
        })
        .collect();
    // The default unit comes first or last, as its devices do.
    assert_eq!(tasks[0], json!(["NC-Task 1 SAF", [["Axes", 4, 2, 2]]]), "sent twice: {plan}");
    let second = tasks[1][1].as_array().unwrap();
    assert_eq!((&tasks[1][0], second.len()), (&json!("Task 2"), 2), "{plan}");
    assert!(second.contains(&json!(["RemovableBranch", 4, 2, 1])), "{plan}");
    assert!(second.contains(&json!(["<default>", 2, 1, 1])), "{plan}");
    // A task that is not there is refused by name.
    let wrong = text.replace("task = \"Task 2\"", "task = \"Task 9\"");
    fs::write(&bench.project, wrong).unwrap();
    let refused = linesman(["plan", bench.project.to_str().unwrap()]);
    assert_eq!(refused.status, 2);
    assert!(refused.stderr.contains("Task 9"), "{}", refused.stderr);
}

#[test]
fn each_sync_unit_gets_its_data_in_the_cycle_of_its_task() {
    let report = Bench::new(&in_units(), "").run("1");
    assert_eq!(report["counts"]["working_counter_errors"], 0, "{report}");
    assert!(report["devices"].as_array().unwrap().iter().all(|device| device["valid"] == true));
}

// S0 L131-137, L2741-2747.
// The source's equal plans of one frame bear map id 0 (S0 L2741) and 1 (S1 L185), those of one more tool start at 2 (S1
// L1140): it counts mappings of the vendor's whole system, of which a plan of one network knows nothing.
// proves: FRM-10 partial: without the map id, which no plan of one network gives, FRM-11, FRM-16
#[test]
fn the_plan_holds_clock_mailbox_states_process_data_and_presence() {
    let report = Bench::of("516-bytes").plan();
    let frame = &report["tasks"][0]["frames"][0];
    let rows: Vec<Value> = frame["datagrams"]
        .as_array()
        .unwrap()
        .iter()
        .map(|row| json!([row["command"], row["register"], row["role"], row["len"], row["wkc"]]))
        .collect();
    assert_eq!(
        rows,
        [
            json!(["NOP", 0x0900, "latched-time", 4, 0]),
            json!(["ARMW", 0x0910, "reference-clock", 4, 46]),
            json!(["LRD", null, "mailbox-states", 3, 18]),
            json!(["LRW", null, "process-data", 150, 21]),
            json!(["LWR", null, "process-data", 33, 17]),
            json!(["LRD", null, "process-data", 220, 19]),
            json!(["BRD", 0x0130, "presence", 2, 46]),
        ]
    );
    // The same for a person, with load and size.
    let text = linesman([
        "plan",
        &format!("{}/tests/data/plan/516-bytes.toml", env!("CARGO_MANIFEST_DIR")),
    ]);
    for word in [
        "Frame",
        "Cmd",
        "Addr",
        "Len",
        "WC",
        "Sync unit",
        "Cycle (ms)",
        "Utilization (%)",
        "516 / 43.20",
    ] {
        assert!(text.stdout.contains(word), "{word}: {}", text.stdout);
    }
    // Eight drives count 24, everybody is counted: 56, 16, 11, 7, 4, 46.
    let counter = |file: &str, command: &str, len: Option<u64>| {
        let rows = self::rows(&Bench::of(file).plan());
        let row = rows
            .iter()
            .map(|(_, row)| row)
            .find(|row| row[0] == command && len.is_none_or(|len| row[1] == len));
        row.unwrap()[2].as_u64().unwrap()
    };
    assert_eq!(counter("387-bytes", "LRW", None), 24);
    for (file, count) in [
        ("387-bytes", 56),
        ("452-bytes", 16),
        ("195-bytes", 11),
        ("110-bytes", 7),
        ("44-bytes", 4),
        ("516-bytes", 46),
    ] {
        assert_eq!(counter(file, "BRD", None), count, "{file}");
    }
    let drives_in_out = ["LRW", "LRD", "LWR"].map(|command| {
        let len = if command == "LRW" { 80 } else { 2 };
        counter("195-bytes", command, Some(len))
    });
    assert_eq!(drives_in_out, [12, 4, 2]);
}

/// SubDevices without vendor and product code are nobody's equals: each has its own EEPROM read.
#[test]
fn a_line_without_identities_runs_as_it_is_found() {
    let bench = Bench::new(&drives(|_| "all", ""), "");
    let on = format!("sim:{}", bench.segment.display());
    let run = linesman(["run", "--on", &on, "--seconds", "1", "--json"]);
    assert_eq!(run.status, 0, "{}", run.all());
    let report = run.json();
    let devices = report["devices"].as_array().unwrap();
    assert_eq!(devices.len(), 7);
    assert!(devices.iter().all(|device| device["valid"] == true), "{report}");
}
