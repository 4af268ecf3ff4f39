//! `linesman plan --timing`: verdicts with margins, advice that mends, plots of a cycle.

use std::fs;
use std::path::PathBuf;

use crate::support::{assert_valid, linesman};
use serde_json::{Value, json};
use tempfile::TempDir;

/// A coupler, a drive with outputs and inputs, and a measuring terminal with inputs only; a task of 2 ms.
fn project(network: &str, task: &str, drive: &str) -> String {
    format!(
        "name = \"axes\"\n[network]\nbase_time_us = 100\n{network}\n[[task]]\nname = \"motion\"\ncycle_us = 2000\n\
         {task}\n[[device]]\nname = \"K1\"\non = \"maindevice\"\n[device.description]\nports = \"YK\"\n\
         [[device]]\nname = \"Drive\"\non = \"K1.B\"\nclock = {{ assign_activate = 0x0300 }}\n{drive}\n\
         [device.description]\nports = \"KK\"\noutputs_bits = 16\ninputs_bits = 16\n\
         [[device]]\nname = \"Probe\"\non = \"Drive.B\"\nclock = {{ assign_activate = 0x0300 }}\n\
         sync_times = {{ inputs = {{ min_cycle_ns = 150000, calc_and_copy_ns = 20000 }} }}\n\
         [device.description]\nports = \"KK\"\ninputs_bits = 16\n"
    )
}

const TIMES: &str = "sync_times = { outputs = { min_cycle_ns = 100000, calc_and_copy_ns = 12000 }, \
                     inputs = { calc_and_copy_ns = 30000, shift_ns = 5000 } }";

struct Bench {
    folder: TempDir,
}

impl Bench {
    fn new(project: &str) -> Self {
        let bench = Self { folder: TempDir::new().unwrap() };
        fs::write(bench.path("machine.toml"), project).unwrap();
        bench
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        self.path(name).display().to_string()
    }

    /// The status and the timing in JSON.
    fn timing(&self, more: &[&str]) -> (i32, Value) {
        let file = self.text("machine.toml");
        let mut words = vec!["plan", &file, "--timing", "--json", "--cable-m", "20"];
        words.extend(more);
        let run = linesman(words);
        let report = run.json();
        assert_valid(&report, "plan");
        (run.status, report["timing"].clone())
    }
}

#[test]
fn plan_that_is_in_time_passes_with_margins_and_tells_what_it_assumes() {
    let bench = Bench::new(&project("", "", TIMES));
    let (status, timing) = bench.timing(&["--jitter", "20us"]);
    assert_eq!((status, &timing["verdict"]), (0, &json!("pass")), "{timing:#}");
    assert_eq!(timing["devices"][0]["reference"], "outputs");
    assert_eq!(timing["devices"][1]["reference"], "inputs");
    assert_eq!(timing["devices"][1]["times"]["sync0_ns"], 1_800_000, "200 µs before the frames");
    assert_eq!(timing["devices"][1]["times"]["sync0_after_outputs_shift_ns"], -800_000);
    assert_eq!(timing["inputs_estimate"]["total_ns"], 170_000);
    assert_eq!(timing["assumed"], json!([]));
    // Jitter that is not given is assumed, and told.
    let (_, timing) = bench.timing(&[]);
    assert_eq!(timing["jitter_ns"], 200_000);
    assert!(timing["assumed"][0].as_str().unwrap().contains("jitter"), "{timing:#}");
    let run = linesman(["plan", &bench.text("machine.toml"), "--timing", "--jitter", "20"]);
    for words in ["Timing: pass", "Drive", "against outputs shift", "f frame", "S SYNC0"] {
        assert!(run.stdout.contains(words), "{words}: {}", run.all());
    }
    // Without it there is none.
    let plain = linesman(["plan", &bench.text("machine.toml"), "--json"]).json();
    assert_valid(&plain, "plan");
    assert_eq!(plain["timing"], Value::Null);
    assert_eq!(plain["clock"]["inputs_shift_ns"], -200_000);
}

#[test]
fn shift_that_is_proposed_mends_a_plan_that_is_not_in_time() {
    let bench = Bench::new(&project("outputs_shift_us = 30", "", TIMES));
    let (status, timing) = bench.timing(&["--jitter", "20us"]);
    assert_eq!((status, &timing["verdict"]), (1, &json!("fail")), "{timing:#}");
    let drive = &timing["devices"][0];
    assert_eq!(drive["after_frames"]["verdict"], "fail");
    assert!(drive["after_frames"]["margin_ns"].as_i64().unwrap() < 0);
    assert_eq!(drive["before_next"]["verdict"], "pass");
    let proposed = timing["proposed_outputs_shift_ns"].as_u64().unwrap();
    assert_eq!(proposed % 1_000, 0);
    let run = linesman(["plan", &bench.text("machine.toml"), "--timing", "--jitter", "20us"]);
    assert!(
        run.stdout.contains(&format!("outputs_shift_us = {}", proposed / 1_000)),
        "{}",
        run.all()
    );
    let network = format!("outputs_shift_us = {}", proposed / 1_000);
    let (status, timing) = Bench::new(&project(&network, "", TIMES)).timing(&["--jitter", "20us"]);
    assert_eq!((status, &timing["verdict"]), (0, &json!("pass")), "{timing:#}");
    // So does a shift of its own.
    let own = drive["proposed_sync0_shift_ns"].as_i64().unwrap();
    let mended = project("outputs_shift_us = 30", "", TIMES).replacen(
        "{ assign_activate = 0x0300 }",
        &format!("{{ assign_activate = 0x0300, sync0_shift_ns = {own} }}"),
        1,
    );
    let (status, timing) = Bench::new(&mended).timing(&["--jitter", "20us"]);
    assert_eq!((status, &timing["verdict"]), (0, &json!("pass")), "{timing:#}");
}

#[test]
fn subdevice_whose_times_nobody_knows_is_not_judged_and_that_is_no_pass() {
    let bench = Bench::new(&project("", "", ""));
    let (status, timing) = bench.timing(&["--jitter", "20us"]);
    assert_eq!((status, &timing["verdict"]), (3, &json!("not-judged")), "{timing:#}");
    let drive = &timing["devices"][0];
    assert_eq!(drive["after_frames"]["verdict"], "pass");
    assert!(drive["before_next"]["lacks"].as_str().unwrap().contains("0x1C32"));
    let run = linesman(["plan", &bench.text("machine.toml"), "--timing", "--jitter", "20us"]);
    assert_eq!(run.status, 3);
    assert!(
        run.stdout.contains("not judged") && run.stdout.contains("sync_times"),
        "{}",
        run.all()
    );
}

#[test]
fn cycle_too_short_for_a_subdevice_fails_with_a_slower_task() {
    let times = "sync_times = { outputs = { min_cycle_ns = 2500000, calc_and_copy_ns = 12000 }, inputs = { \
                 calc_and_copy_ns = 1000 } }";
    let bench = Bench::new(&project("", "", times));
    let (status, timing) = bench.timing(&["--jitter", "20us"]);
    assert_eq!(status, 1);
    let drive = &timing["devices"][0];
    assert_eq!(
        (&drive["too_fast_ns"], &drive["proposed_cycle_ns"]),
        (&json!(2_500_000), &json!(4_000_000))
    );
    let run = linesman(["plan", &bench.text("machine.toml"), "--timing"]);
    assert!(run.stdout.contains("cycle_us = 4000"), "{}", run.all());
}

/// Where the bars of a class of a lane are, in pixels of the plot: x and width.
fn bars(svg: &str, class: &str) -> Vec<(f64, f64)> {
    let number = |rect: &str, key: &str| {
        let from = rect.find(&format!(" {key}=\"")).unwrap() + key.len() + 3;
        rect[from..].split('"').next().unwrap().parse::<f64>().unwrap()
    };
    let rects =
        svg.split("<rect class=\"").skip(1).filter(|rect| rect.starts_with(&format!("{class}\"")));
    // The last is the key in the legend.
    let all: Vec<_> = rects.map(|rect| (number(rect, "x"), number(rect, "width"))).collect();
    all[..all.len().saturating_sub(1)].to_vec()
}

// S0 L447-475, L611-637, L665: diagrams 2, 3 and 5.
// proves: SYN-19 (U), SYN-29
#[test]
fn plots_of_task_end_separate_input_and_task_begin_show_each_frame_where_it_is() {
    let plot = |task: &str| {
        let bench = Bench::new(&project("", task, TIMES));
        let svg = bench.text("cycle.svg");
        let execution = ["--execution", "motion=400us", "--jitter", "0", "--svg", &svg];
        let (status, timing) = bench.timing(&[&execution[..], &["--task-jitter", "0"]].concat());
        assert!(status <= 1, "{timing:#}");
        (timing, fs::read_to_string(svg).unwrap())
    };
    // The program, then the frame, then SYNC0 and the work of the drive.
    let (timing, svg) = plot("io_at = \"task-end\"");
    let drive = &timing["devices"][0]["times"];
    assert_eq!(drive["frames"].as_array().unwrap().len(), 1);
    assert_eq!((&drive["sync0_ns"], &drive["outputs_read_ns"]), (&json!(600_000), &json!(12_000)));
    assert_eq!(
        (&drive["input_latch_ns"], &drive["inputs_written_ns"]),
        (&json!(5_000), &json!(35_000))
    );
    let (program, frames, sync0) =
        (bars(&svg, "program"), bars(&svg, "frame"), bars(&svg, "sync0"));
    assert!((program[0].0 + program[0].1 - frames[0].0).abs() < 1.0, "{program:?} {frames:?}");
    assert!(frames[0].0 + frames[0].1 < sync0[0].0);
    for class in ["read", "written", "latch", "next"] {
        assert!(!bars(&svg, class).is_empty(), "{class}: {svg}");
    }
    // The frame with inputs 3 ticks of 100 µs earlier, in the lane of the task and in that of the drive.
    let (timing, svg) = plot("io_at = \"task-end\"\nseparate_inputs = true\npre_ticks = 3");
    let frames = timing["devices"][0]["times"]["frames"].as_array().unwrap().clone();
    let early = frames.iter().find(|frame| frame["fetches"] == true).unwrap();
    let other = frames.iter().find(|frame| frame["fetches"] == false).unwrap();
    assert_eq!((&early["due_ns"], &other["due_ns"]), (&json!(-300_000), &json!(0)));
    let at = bars(&svg, "frame");
    assert_eq!(at.len(), 6 - 1, "two of the task, two of the drive, one of the probe: {at:?}");
    let per_us = bars(&svg, "program")[0].1 / 400.0;
    let apart = (at[1].0 - at[0].0) / per_us;
    assert!((apart - 300.0).abs() < 8.0, "{apart} µs in the lane of the task");
    assert!((at[2].0 - at[0].0).abs() < 1.0, "the same in the lane of the drive");
    // The frame, then the program.
    let (_, svg) = plot("io_at = \"task-begin\"");
    let (program, frames) = (bars(&svg, "program"), bars(&svg, "frame"));
    assert!((program[0].0 - frames[0].0).abs() < 1.0, "{program:?} {frames:?}");
}

#[test]
fn wrong_amounts_are_refused_with_what_is_expected() {
    let bench = Bench::new(&project("", "", TIMES));
    let file = bench.text("machine.toml");
    for (words, expected) in [
        (vec!["--timing", "--execution", "motor=5us"], "tasks: `motion`"),
        (vec!["--timing", "--execution", "motion"], "TASK=TIME"),
        (vec!["--timing", "--execution", "motion=soon"], "expected a time"),
        (vec!["--timing", "--jitter", "much"], "expected a time"),
        (vec!["--jitter", "20us"], "--timing"),
        (vec!["--svg", "x.svg"], "--timing"),
    ] {
        let mut all = vec!["plan", file.as_str()];
        all.extend(words);
        let run = linesman(all);
        assert_eq!(run.status, 2, "{}", run.all());
        assert!(run.all().contains(expected), "{expected}: {}", run.all());
    }
}
