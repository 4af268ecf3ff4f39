//! Observation files through `linesman diagnose`: counters and states read with another tool.

use std::path::{Path, PathBuf};

use crate::support::{assert_valid, linesman};
use serde_json::{Value, json};
use tempfile::TempDir;

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/observations").join(name)
}

/// The one finding of an observation file.
#[track_caller]
fn finding(name: &str) -> Value {
    let path = file(name);
    let run = linesman(["diagnose".as_ref(), path.as_os_str(), "--json".as_ref()]);
    assert_eq!(run.status, 1, "{}", run.all());
    let diagnosis = run.json();
    assert_valid(&diagnosis, "diagnosis");
    assert_eq!(diagnosis["verdict"], "faulty");
    let findings = diagnosis["findings"].as_array().expect("findings");
    assert_eq!(findings.len(), 1, "one cause is one finding: {diagnosis:#}");
    findings[0].clone()
}

// proves: HW-22, HW-23
#[test]
fn counters_of_fifteen_subdevices_lead_to_one_link() {
    for name in ["fifteen-frame-errors.toml", "fifteen-rx-registers.toml"] {
        let finding = finding(name);
        let place = &finding["place"];
        assert_eq!(place["kind"], "link", "{name}");
        assert_eq!(place["a"], json!({ "no": 6, "port": "C" }), "{name}");
        assert_eq!(place["b"], json!({ "no": 14, "port": "A" }), "{name}");
        let evidence = finding["evidence"].as_array().unwrap();
        assert_eq!(evidence[0]["no"], 14, "{name}: the first in the order of checks");
        assert_eq!(evidence[0]["port"], "A", "{name}");
    }
}

// proves: HW-10
#[test]
fn a_table_of_states_leads_to_the_break_and_what_follows_hangs_beneath() {
    let finding = finding("break-behind-14.toml");
    assert_eq!(finding["place"]["a"], json!({ "no": 14, "port": "B" }));
    assert_eq!(finding["cause"], "link-open");
    let silent: Vec<_> = finding["consequences"]
        .as_array()
        .unwrap()
        .iter()
        .map(|one| one["place"]["no"].as_u64().unwrap())
        .collect();
    assert_eq!(silent, [15, 16, 17, 18, 19, 20, 21]);
}

// fires: C306
// proves: HW-01, HW-02
#[test]
fn a_list_of_wrong_devices_leads_to_the_cable_and_what_follows_hangs_beneath() {
    let finding = finding("wrong-order.toml");
    assert_eq!(finding["code"], "C306", "{finding:#}");
    assert_eq!(finding["place"]["a"], json!({ "no": 14, "port": "B" }));
    let evidence = finding["evidence"].as_array().unwrap();
    let texts: Vec<&str> = evidence.iter().map(|one| one["text"].as_str().unwrap()).collect();
    assert!(texts[0].contains("Term 64 (EK1100)") && texts[0].contains("6 others"), "{texts:?}");
    assert!(texts[1].contains("port C of Term 50 (EK1100)"), "{texts:?}");
    assert!(
        finding["actions"][0].as_str().unwrap().contains("port C of Term 50 (EK1100)"),
        "{finding:#}"
    );
    // A device is missing, or cables are plugged in the wrong order.
    let others = finding["alternatives"].as_array().unwrap().iter();
    let causes: Vec<&serde_json::Value> =
        std::iter::once(&finding["cause"]).chain(others.map(|other| &other["cause"])).collect();
    for cause in ["device-missing", "devices-swapped", "ports-swapped"] {
        assert!(causes.contains(&&json!(cause)), "{cause}: {finding:#}");
    }
}

// proves: JCT-11 partial: read from a table, not seen on a line
#[test]
fn a_cable_pulled_at_a_junction_is_told_by_its_port() {
    let finding = finding("junction-cable-pulled.toml");
    assert_eq!(finding["place"]["a"], json!({ "no": 2, "port": "D" }));
    assert_eq!(finding["place"]["b"], json!({ "no": 3, "port": "A" }));
}

#[test]
fn a_file_that_is_none_is_refused_with_what_it_should_be() {
    let directory = TempDir::new().unwrap();
    let path = directory.path().join("read.toml");
    std::fs::write(&path, "[[device]]\nname = \"K1\"\non = \"maindevice\"\nsate = \"OP\"\n")
        .unwrap();
    let run = linesman(["diagnose".as_ref(), path.as_os_str()]);
    assert_eq!(run.status, 2, "{}", run.all());
    assert!(run.stderr.contains("read.toml") && run.stderr.contains("sate"), "{}", run.stderr);
    assert!(run.stderr.contains("linesman schema observations"), "{}", run.stderr);
}

#[test]
fn what_was_not_given_is_not_said_to_be_judged() {
    let folder = TempDir::new().unwrap();
    let extents = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        let run = linesman(["diagnose".as_ref(), path.as_os_str(), "--json".as_ref()]);
        let diagnosis = run.json();
        let subjects = diagnosis["coverage"]["subjects"].as_array().unwrap().clone();
        ["states", "link-status", "wiring"].map(|subject| {
            let found = subjects.iter().find(|one| one["subject"] == subject).unwrap();
            found["extent"].as_str().unwrap().to_owned()
        })
    };
    // One state, and no word of links; and one line of a kernel log, of no SubDevice.
    let one_state = "[[device]]\nname = \"K1\"\non = \"maindevice\"\nstate = \"OP\"\n";
    assert_eq!(extents("state.toml", one_state), ["judged", "not-judged", "in-part"]);
    let timed_out = "[12.5] EtherCAT WARNING 0: 3 datagrams TIMED OUT!\n";
    assert_eq!(extents("log.txt", timed_out), ["not-judged", "not-judged", "not-judged"]);
}
