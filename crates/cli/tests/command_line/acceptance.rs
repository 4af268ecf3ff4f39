//! Acceptance cases of the requirements that show on the virtual segment, as a user sees them.

use std::fs;

use crate::support::{assert_valid, linesman};
use serde_json::{Value, json};
use tempfile::TempDir;

/// Runs a command on a segment and gives its JSON, which must fit the schema of that name.
#[track_caller]
fn on_segment(command: &str, schema: &str, segment: &str, status: i32) -> Value {
    let directory = TempDir::new().expect("a temporary directory");
    let path = directory.path().join("plant.toml");
    fs::write(&path, segment).expect("a file can be written");
    let run = linesman([command, &format!("sim:{}", path.display()), "--json"]);
    assert_eq!(run.status, status, "{}", run.all());
    let value = run.json();
    assert_valid(&value, schema);
    value
}

#[track_caller]
fn scan(segment: &str) -> Value {
    on_segment("scan", "scan", segment, 0)
}

#[track_caller]
fn diagnose(segment: &str, status: i32) -> Value {
    on_segment("diagnose", "diagnosis", segment, status)
}

/// Devices as name, type, and what they hang on.
fn plant(devices: &[(&str, &str, &str)]) -> String {
    let tables = devices.iter().map(|(name, kind, on)| {
        format!("[[device]]\nname = \"{name}\"\ntype = \"{kind}\"\non = \"{on}\"\n")
    });
    tables.collect::<String>() + "\n"
}

/// The error findings at the top, consequences not counted.
fn errors(diagnosis: &Value) -> Vec<&Value> {
    let findings = diagnosis["findings"].as_array().expect("findings are a list");
    findings.iter().filter(|finding| finding["severity"] == "error").collect()
}

/// Every `no` that a finding or what hangs beneath it names.
fn numbers(finding: &Value) -> Vec<u64> {
    let mut found = vec![];
    let mut left = vec![finding];
    while let Some(value) = left.pop() {
        match value {
            Value::Object(map) => {
                found.extend(map.get("no").and_then(Value::as_u64));
                left.extend(map.values());
            }
            Value::Array(list) => left.extend(list),
            Value::Null | Value::Bool(_) | Value::Number(_) | Value::String(_) => {}
        }
    }
    found.sort_unstable();
    found.dedup();
    found
}

// proves: ESC-13
#[test]
fn the_line_of_fifteen_is_found_with_every_port() {
    // Where each hangs: SubDevices 1, 6 and 9 branch; numbers are processing order.
    let on = [
        (0, "A"),
        (1, "B"),
        (2, "B"),
        (3, "B"),
        (4, "B"),
        (5, "B"),
        (6, "B"),
        (7, "B"),
        (8, "B"),
        (9, "D"),
        (9, "C"),
        (11, "B"),
        (12, "B"),
        (6, "C"),
        (1, "C"),
    ];
    let mut text = String::new();
    for (at, (no, port)) in on.iter().enumerate() {
        let place = if *no == 0 { "maindevice".to_owned() } else { format!("D{no}.{port}") };
        text += &plant(&[(&format!("D{}", at + 1), "CU1124", &place)]);
    }
    let scan = scan(&text);
    let devices = scan["devices"].as_array().unwrap();
    assert_eq!(devices.len(), on.len());
    for (device, (no, port)) in devices.iter().zip(on) {
        let ports = device["ports"].as_array().unwrap();
        assert_eq!(ports[0]["to"], json!({ "no": no, "port": port }), "{}", device["no"]);
        // The other end says the same.
        if no > 0 {
            let above = devices[no - 1]["ports"].as_array().unwrap();
            let above = above.iter().find(|one| one["port"] == port).unwrap();
            assert_eq!(above["to"], json!({ "no": device["no"], "port": "A" }));
        }
    }
}

/// A coupler, a junction on its E-bus, a coupler at the junction's last port, an analogue terminal.
fn junction() -> String {
    plant(&[
        ("K1", "EK1100", "maindevice"),
        ("J2", "EK1122", "K1.B"),
        ("K3", "EK1100", "J2.D"),
        ("A4", "EL3104", "K3.B"),
    ])
}

// proves: JCT-11
#[test]
fn a_cable_pulled_at_a_junction_is_found_there_with_those_behind_it() {
    let pulled = "[[fault]]\nkind = \"link-open\"\nat = \"J2.D-K3.A\"\nfrom_ms = 3000\n";
    let found = diagnose(&(junction() + pulled), 1);
    let errors = errors(&found);
    assert_eq!(errors.len(), 1, "{found:#}");
    assert_eq!(errors[0]["place"]["a"], json!({ "no": 2, "port": "D" }));
    assert_eq!(errors[0]["place"]["b"], json!({ "no": 3, "port": "A" }));
    let numbers = numbers(errors[0]);
    assert!(numbers.contains(&3) && numbers.contains(&4), "those behind it are named: {numbers:?}");
    assert!(!numbers.contains(&1), "those before it are not: {numbers:?}");
    // The junction closes its port within microseconds, so nearly all frames go on.
    let lost = found["network"]["lost"].as_u64().unwrap();
    assert!(lost <= 2, "{lost} frames lost");
}

// proves: ESC-07 partial: a junction; other wirings are in the tests of the segment
#[test]
fn each_subdevice_counts_once() {
    let found = diagnose(&junction(), 0);
    assert_eq!(found["network"]["devices"], 4);
}

// proves: SW-01
#[test]
fn a_refused_state_is_told_with_state_and_code() {
    let refused = "[[fault]]\nkind = \"init-refused\"\ndevice = \"A4\"\nto = \"SAFEOP\"\n\
                   code = 0x001E\n";
    let found = diagnose(&(junction() + refused), 1);
    let errors = errors(&found);
    assert_eq!(errors.len(), 1, "{found:#}");
    assert_eq!(errors[0]["place"]["no"], 4);
    let read = |register: u64| {
        let evidence = errors[0]["evidence"].as_array().unwrap();
        let one = evidence.iter().find(|one| one["register"] == register);
        one.unwrap_or_else(|| panic!("register {register:#06X}: {found:#}"))["after"].as_u64()
    };
    // PREOP with the error bit, and the code that says why.
    assert_eq!((read(0x0130), read(0x0134)), (Some(0x12), Some(0x1E)));
}

// proves: DIA-02
#[test]
fn every_finding_says_whether_it_is_hardware_or_software() {
    let cases = [
        ("kind = \"link-open\"\nat = \"J2.D-K3.A\"", "hardware"),
        ("kind = \"emc-noise\"\nat = \"K1.B>J2.A\"\nhits_per_s = 100.0", "hardware"),
        ("kind = \"init-refused\"\ndevice = \"A4\"\nto = \"OP\"\ncode = 0x001B", "software"),
    ];
    for (fault, class) in cases {
        let text = format!("{}[[fault]]\n{fault}\nfrom_ms = 2500\n", junction());
        // A refusal acts while the line starts.
        let text = text.replace("0x001B\nfrom_ms = 2500", "0x001B");
        let found = diagnose(&text, 1);
        let findings = found["findings"].as_array().unwrap();
        assert!(findings.iter().any(|finding| finding["class"] == class), "{fault}: {found:#}");
    }
}

// proves: DIA-06
#[test]
fn falling_presence_leads_to_the_place_where_the_tree_changed() {
    let off = "[[fault]]\nkind = \"link-open\"\nat = \"K3.B-A4.A\"\nfrom_ms = 3000\n";
    let found = diagnose(&(junction() + off), 1);
    let errors = errors(&found);
    assert_eq!(errors.len(), 1, "{found:#}");
    assert_eq!(errors[0]["place"]["a"], json!({ "no": 3, "port": "B" }));
    // The link state that was read because the count fell is the evidence.
    let evidence = errors[0]["evidence"].as_array().unwrap();
    assert!(evidence.iter().any(|one| one["register"] == 0x0110), "{evidence:#?}");
}
