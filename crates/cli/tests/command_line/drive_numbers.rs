//! `linesman soe`: IDNs of a drive on a virtual segment, beside a run, and in a capture.

use crate::services::Plant;
use crate::support::running::Running;
use crate::support::{assert_valid, linesman};
use serde_json::Value;

const PLANT: &str = "\
[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
[[device]]\nname = \"C1\"\ntype = \"EL6601\"\non = \"K1.B\"\n\
[[device]]\nname = \"X1\"\ntype = \"AX5103-0012\"\non = \"K1.C\"\n";

fn idns(report: &Value) -> Vec<&str> {
    let idns = report["idns"].as_array().unwrap();
    idns.iter().map(|one| one["idn"].as_str().unwrap()).collect()
}

#[test]
fn idns_of_a_drive_are_listed_with_names_and_with_all_that_is_told_of_them() {
    let plant = Plant::with(PLANT);
    let list = plant.json("soe", &["X1", "list"], "soe", 0);
    assert_eq!(list["action"], "list");
    assert!(idns(&list).contains(&"S-0-0017") && idns(&list).contains(&"P-0-0150"), "{list}");
    assert!(list["idns"].as_array().unwrap().iter().all(|one| one["name"].is_string()), "{list}");
    let all = plant.json("soe", &["X1", "list", "--all"], "soe", 0);
    assert_eq!(idns(&all), idns(&list));
    let brake = all["idns"].as_array().unwrap().iter().find(|one| one["idn"] == "P-0-0150");
    let brake = brake.unwrap();
    assert_eq!((&brake["value"], &brake["unit"]), (&50.0.into(), &"ms".into()), "{brake}");
    assert_eq!((&brake["minimum"], &brake["maximum"]), (&0.0.into(), &1000.0.into()), "{brake}");
    assert_eq!(brake["attribute"]["writable"], "PREOP", "{brake}");
    let table = plant.run("soe", &["X1", "list", "--all"]);
    assert!(table.stdout.contains("Reset class 1 diagnostic (command)"), "{}", table.all());
    assert!(table.stderr.contains("is in INIT"), "{}", table.all());
    let second = plant.json("soe", &["X1", "list", "--drive", "1"], "refusal", 1);
    assert_eq!((&second["kind"], &second["code"]), (&"soe-error".into(), &0x1001.into()));
}

#[test]
fn idn_is_read_as_its_attribute_says_and_element_by_element() {
    let plant = Plant::with(PLANT);
    let read = plant.run("soe", &["X1", "read", "S-0-0091"]);
    for words in ["X1 (AX5103-0012): S-0-0091 Bipolar velocity limit value", "26214400 2^-18 rev/s"]
    {
        assert!(read.stdout.contains(words), "{words}: {}", read.all());
    }
    let list = plant.json("soe", &["X1", "read", "S-0-0016"], "soe", 0);
    assert_eq!(list["idns"][0]["value"], serde_json::json!(["S-0-0135", "S-0-0051"]), "{list}");
    for (element, shown) in [
        ("value", "50.0"),
        ("name", "Switch-off delay of the brake"),
        ("unit", "ms"),
        ("min", "0.0"),
        ("max", "1000.0"),
        ("attribute", "0x61110001: 2 bytes; unsigned; 1 decimal place; writable in PREOP"),
        ("data-state", "0x0000: no procedure command"),
    ] {
        let one = plant.json("soe", &["X1", "read", "P-0-0150", "--element", element], "soe", 0);
        assert_eq!(one["idns"][0]["text"], shown, "{one}");
    }
    let raw = plant.json("soe", &["X1", "read", "P-0-0150", "--raw"], "soe", 0);
    assert_eq!(
        (&raw["idns"][0]["bytes"], &raw["idns"][0]["value"]),
        (&"F4 01".into(), &Value::Null)
    );
    for (rest, code) in [
        (&["X1", "read", "S-0-0052"][..], 0x1001),
        (&["X1", "read", "S-0-0017", "--element", "unit"], 0x4001),
        (&["X1", "read", "S-0-0017", "--element", "default"], 0x1009),
    ] {
        let refused = plant.json("soe", rest, "refusal", 1);
        assert_eq!(refused["code"], code, "{refused}");
    }
    // Who speaks no SoE, has no mailbox, and what is no IDN.
    assert_eq!(plant.run("soe", &["C1", "list"]).status, 2);
    let none = plant.run("soe", &["K1", "list"]);
    assert!(none.stderr.contains("has no mailbox"), "{}", none.all());
    let wrong = plant.run("soe", &["X1", "read", "S-0-5000"]);
    assert!(wrong.stderr.contains("expected an IDN such as S-0-0036"), "{}", wrong.all());
}

#[test]
fn idn_is_written_in_the_type_of_its_attribute_or_refused_with_the_code() {
    let plant = Plant::with(PLANT);
    for (idn, value, bytes) in [
        ("S-0-0091", "1000", "E8 03 00 00"),
        ("P-0-0150", "50.5", "F9 01"),
        ("S-0-0016", "S-0-0135, S-0-0051", "04 00 04 00 87 00 33 00"),
        ("P-0-0151", "lift", "04 00 04 00 6C 69 66 74"),
    ] {
        let wrote = plant.json("soe", &["X1", "write", idn, value], "soe", 0);
        assert_eq!(wrote["idns"][0]["bytes"], bytes, "{wrote}");
    }
    let raw = plant.json("soe", &["X1", "write", "S-0-0091", "--raw", "0x01000000"], "soe", 0);
    assert_eq!(raw["idns"][0]["bytes"], "01 00 00 00", "{raw}");
    let long = "x".repeat(241);
    for (idn, value, code) in [
        ("S-0-0091", "26214401", 0x7007),
        ("S-0-0036", "1", 0x700A),
        ("S-0-0051", "1", 0x7004),
        ("S-0-0015", "5", 0x7008),
        ("P-0-0151", &long, 0x7003),
    ] {
        let refused = plant.json("soe", &["X1", "write", idn, value], "refusal", 1);
        assert_eq!(refused["code"], code, "{refused}");
    }
    for (rest, words) in [
        (&["S-0-0091", "-1"][..], "expected 0 to 4294967295"),
        (&["P-0-0150", "1.25"], "1 decimal place at most"),
        (&["S-0-0091", "--raw", "1"], "no row of bytes"),
        (&["S-0-0099", "3"], "is a procedure command"),
    ] {
        let wrong = plant.run("soe", &[&["X1", "write"], rest].concat());
        assert_eq!(wrong.status, 2, "{}", wrong.all());
        assert!(wrong.stderr.contains(words), "{words}: {}", wrong.all());
    }
}

#[test]
fn procedure_command_is_done_or_told_with_how_far_it_came() {
    let plant = Plant::with(PLANT);
    let done = plant.json("soe", &["X1", "execute", "S-0-0099"], "soe", 0);
    assert_eq!(done["progress"], "done", "{done}");
    // The axis is not enabled.
    let failed = plant.json("soe", &["X1", "execute", "P-0-0160"], "soe", 1);
    assert_eq!((&failed["progress"], &failed["idns"][0]["value"]), (&"error".into(), &15.into()));
    let told = plant.run("soe", &["X1", "execute", "P-0-0160"]);
    assert!(told.stderr.contains("error (data state 0x000F)"), "{}", told.all());
    let none = plant.run("soe", &["X1", "execute", "S-0-0091"]);
    assert_eq!(none.status, 2, "{}", none.all());
    assert!(none.stderr.contains("is no procedure command"), "{}", none.all());
}

#[test]
fn drive_is_asked_beside_a_run_and_keeps_what_is_written() {
    let folder = tempfile::TempDir::new().unwrap();
    let log = folder.path().join("log");
    let running = Running::with_options(PLANT, &["--log", log.to_str().unwrap()]);
    let socket = running.socket();
    let soe = |rest: &[&str]| linesman([&["soe", &socket, "3"], rest].concat());
    let written = soe(&["write", "S-0-0091", "5000"]);
    assert_eq!(written.status, 0, "{}", written.all());
    let notes = "n".repeat(200);
    assert_eq!(soe(&["write", "P-0-0151", &notes]).status, 0);
    let read = soe(&["read", "S-0-0091", "--json"]).json();
    assert_valid(&read, "soe");
    assert_eq!(read["idns"][0]["value"], 5_000, "{read}");
    assert_eq!(soe(&["read", "P-0-0151", "--json"]).json()["idns"][0]["value"], *notes);
    assert_eq!(soe(&["read", "S-0-0135", "--json"]).json()["idns"][0]["value"], 0x4000);
    let refused = soe(&["write", "P-0-0150", "1", "--json"]);
    assert_eq!((refused.status, &refused.json()["code"]), (1, &0x7005.into()), "{}", refused.all());
    let done = soe(&["execute", "S-0-0099"]);
    assert!(done.stdout.contains("Reset class 1 diagnostic: done"), "{}", done.all());
    // The drive notifies of that by itself.
    let text = |log: &std::path::Path| linesman(["log", log.to_str().unwrap()]).all();
    let notified = "drive 0 notifies: procedure command S-0-0099: done";
    let is_told = (0..100).any(|_| {
        std::thread::sleep(std::time::Duration::from_millis(50));
        text(&log).contains(notified)
    });
    assert!(is_told, "{}", text(&log));
}
