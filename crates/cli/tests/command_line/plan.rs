//! `linesman plan`: the tables of the sources, and configurations of other tools, through the command line.

use std::path::{Path, PathBuf};

use crate::support::{assert_valid, linesman};
use serde_json::{Value, json};
use tempfile::TempDir;

fn data(file: &str) -> String {
    format!("{}/tests/data/plan/{file}.toml", env!("CARGO_MANIFEST_DIR"))
}

fn plan(file: &str) -> Value {
    let run = linesman(["plan", &data(file), "--json"]);
    assert!(run.status <= 1, "{}", run.all());
    let report = run.json();
    assert_valid(&report, "plan");
    report
}

fn frame(report: &Value, number: u64) -> Value {
    let tasks = report["tasks"].as_array().unwrap().iter();
    let mut frames = tasks.flat_map(|task| {
        let cycle = task["cycle_ns"].clone();
        task["frames"].as_array().unwrap().iter().map(move |frame| {
            let mut frame = frame.clone();
            frame["cycle_ns"] = cycle.clone();
            frame
        })
    });
    frames.find(|frame| frame["no"] == number).unwrap()
}

// S0 L137, L1250, L1524-1527, L2179, L2741 ff.; S1 L192; and the others that the requirements name.
// proves: FRM-07, FRM-08, FRM-09, FRM-12
#[test]
fn the_eleven_frames_of_the_sources() {
    for (file, number, size, wire_ns, cycle_ms, percent) in [
        ("387-bytes", 0, 387, 32_880, 2, 1.64),
        ("452-bytes", 0, 452, 38_080, 2, 1.90),
        ("153-and-58-bytes", 0, 153, 14_160, 2, 0.70),
        ("153-and-58-bytes", 1, 58, 13_440, 2, 0.67),
        ("195-bytes", 0, 195, 17_520, 2, 0.87),
        ("110-bytes", 0, 110, 10_720, 4, 0.27),
        ("44-bytes", 0, 44, 6_720, 2, 0.33),
        ("49-44-50-bytes", 0, 49, 6_720, 2, 0.33),
        ("49-44-50-bytes", 1, 44, 6_720, 5, 0.13),
        ("49-44-50-bytes", 2, 50, 6_720, 10, 0.07),
        ("516-bytes", 0, 516, 43_200, 2, 2.16),
    ] {
        let frame = frame(&plan(file), number);
        assert_eq!(frame["size"], size, "{file} {number}");
        assert_eq!(frame["wire_ns"], wire_ns, "{file} {number}");
        assert_eq!(frame["cycle_ns"], cycle_ms * 1_000_000, "{file} {number}");
        let load = frame["load_percent"].as_f64().unwrap();
        // The sources round now up, now down.
        assert!((load - percent).abs() <= 0.01, "{file} {number}: {load}");
    }
}

// S0 L1520-1527: Drives 80 bytes and 12, inputs 2 bytes and 4, outputs 2 bytes and 2.
// proves: FRM-23
#[test]
fn each_sync_unit_has_its_row_and_its_counter() {
    let report = plan("153-and-58-bytes");
    let rows = |number| -> Vec<Value> {
        let datagrams = frame(&report, number)["datagrams"].as_array().unwrap().clone();
        let units = datagrams.iter().filter(|row| !row["sync_unit"].is_null());
        units.map(|row| json!([row["command"], row["len"], row["wkc"], row["sync_unit"]])).collect()
    };
    assert_eq!(rows(0), [json!(["LRW", 80, 12, "Drives"])]);
    assert_eq!(
        rows(1),
        [json!(["LRD", 2, 4, "DigitalInputs"]), json!(["LWR", 2, 2, "DigitalOutputs"])]
    );
}

// S1 L331-361: the budget is first negative at terminal 20, by 40 mA, and by 1,000 mA at the end.
// proves: HW-04, HW-05
#[test]
fn the_budget_of_the_ebus_and_where_the_feed_goes() {
    let run = linesman(["plan", &data("ebus")]);
    assert_eq!(run.status, 1, "an overload is an error: {}", run.all());
    assert!(run.stdout.contains("insert a power feed terminal (EL94xx) before Term 20"));
    let report = plan("ebus");
    let group = &report["ebus"][0];
    assert_eq!(group["supply_ma"], 2000);
    assert_eq!(group["first_negative"], 20);
    let left = |no: u64| {
        let members = group["members"].as_array().unwrap();
        members.iter().find(|member| member["no"] == no).unwrap()["remaining_ma"].clone()
    };
    assert_eq!((left(19), left(20), left(26)), (json!(120), json!(-40), json!(-1000)));
}

fn eni_files() -> Option<Vec<PathBuf>> {
    let root = std::env::var_os("LINESMAN_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    let Ok(folder) = std::fs::read_dir(root.join("eni")) else {
        eprintln!("skipped: no configurations in {}: set LINESMAN_DATA", root.display());
        return None;
    };
    let mut files: Vec<PathBuf> = folder.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    Some(
        files.into_iter().filter(|file| file.extension().is_some_and(|end| end == "xml")).collect(),
    )
}

#[test]
fn configurations_of_other_tools_are_planned_exported_and_planned_again() {
    let Some(files) = eni_files() else { return };
    assert!(!files.is_empty());
    let folder = TempDir::new().unwrap();
    for file in files {
        let file = file.to_str().unwrap();
        let copy = folder.path().join("copy.xml");
        // What is there is never written over.
        let _ = std::fs::remove_file(&copy);
        let first = linesman(["plan", file, "--json", "--export", copy.to_str().unwrap()]);
        assert!(first.status <= 1, "{file}: {}", first.all());
        let again = linesman(["plan", copy.to_str().unwrap(), "--json"]);
        let (mut first, mut again) = (first.json(), again.json());
        for report in [&mut first, &mut again] {
            report["name"] = Value::Null;
        }
        assert_eq!(first, again, "{file}");
    }
}

#[test]
fn the_branched_configuration_runs_on_a_segment_that_is_made_of_it() {
    let Some(files) = eni_files() else { return };
    let branched = |file: &&PathBuf| file.to_str().unwrap().contains("junction");
    let file = files.iter().find(branched).unwrap().to_str().unwrap();
    let folder = TempDir::new().unwrap();
    let segment = folder.path().join("segment.toml");
    let made = linesman(["plan", file, "--segment", segment.to_str().unwrap()]);
    assert!(made.status <= 1, "{}", made.all());
    let on = format!("sim:{}", segment.display());
    let run = linesman(["run", file, "--on", &on, "--seconds", "3", "--json"]);
    assert_eq!(run.status, 0, "{}", run.all());
    let report = run.json();
    assert!(!report["reached_ns"].is_null(), "{report}");
    let devices = report["devices"].as_array().unwrap();
    assert_eq!(devices.len(), 9);
    assert!(devices.iter().all(|device| device["valid"] == true), "{report}");
}

// S0 L1505-1507, S1 L169: what works closely together into one sync unit, what is independent apart.
// proves: FRM-25
#[test]
fn many_devices_in_one_sync_unit_are_advised_to_part() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("wide.toml");
    let advised = |terminals: usize, parted: bool| {
        let mut text = "name = \"wide\"\n".to_owned();
        for no in 1..=terminals {
            let on = if no == 1 { "maindevice".to_owned() } else { format!("B{}.B", no - 1) };
            let unit = if parted { no % 2 } else { 0 };
            text += &format!(
                "[[device]]\nname = \"B{no}\"\non = \"{on}\"\nsync_unit = \"unit {unit}\"\n\
                 [device.description]\noutputs_bits = 8\n"
            );
        }
        std::fs::write(&file, text).unwrap();
        let run = linesman(["plan", file.to_str().unwrap()]);
        assert!(run.status <= 1, "{}", run.all());
        let words = run.all().split_whitespace().collect::<Vec<_>>().join(" ");
        words.contains("put what works closely together into one sync unit")
    };
    assert!(advised(100, false), "a hundred in one");
    assert!(!advised(100, true), "fifty in each of two");
    assert!(!advised(30, false), "thirty in one");
}

#[test]
fn what_cannot_be_planned_is_refused_with_its_place() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    std::fs::write(path("key.toml"), "name = \"x\"\n[[devise]]\nname = \"K1\"\n").unwrap();
    std::fs::write(path("cut.xml"), "<EtherCATConfig><Config><Master>").unwrap();
    std::fs::write(path("other.xml"), "<html><body/></html>").unwrap();
    for (file, words) in
        [("key.toml", "devise"), ("cut.xml", "cut.xml"), ("other.xml", "other.xml")]
    {
        let run = linesman(["plan", &path(file), "--json"]);
        assert_eq!(run.status, 2, "{file}: {}", run.all());
        let report = run.json();
        assert_valid(&report, "error");
        assert!(report["reason"].as_str().unwrap().contains(words), "{file}: {report}");
    }
    assert_eq!(linesman(["plan", &path("none.toml")]).status, 2);
}
