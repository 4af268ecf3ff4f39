//! Virtual segments through `scan` and `diagnose`, in virtual time.

use std::fs;

use crate::support::bench::plant;
use crate::support::{Run, assert_valid, linesman};
use serde_json::Value;
use tempfile::TempDir;

/// What hangs on the second port of the coupler.
const BRANCH: &str = r#"
[[device]]
name = "K2"
type = "EK1100"
on = "K1.C"
cable_m = 20.0
[[device]]
name = "O2"
type = "EL2008"
on = "K2.B"
"#;

/// A coupler, two terminals behind it, and a box on its second port.
fn branch() -> String {
    format!("{}{BRANCH}", plant("branch", 11).to_toml())
}

fn with_segment(command: &str, faults: &str, more: &[&str]) -> Run {
    let directory = TempDir::new().expect("a temporary directory");
    let path = directory.path().join("plant.toml");
    fs::write(&path, format!("{}{faults}", branch())).expect("a file can be written");
    let place = format!("sim:{}", path.display());
    linesman([command, &place].into_iter().chain(more.iter().copied()))
}

#[track_caller]
fn diagnosis(run: &Run, status: i32) -> Value {
    assert_eq!(run.status, status, "{}", run.all());
    let diagnosis = run.json();
    assert_valid(&diagnosis, "diagnosis");
    diagnosis
}

#[test]
fn a_scan_draws_the_branch() {
    let run = with_segment("scan", "", &[]);
    assert_eq!(run.status, 0, "{}", run.all());
    assert!(run.stdout.starts_with("5 SubDevices\n"), "{}", run.stdout);
    let scan = with_segment("scan", "", &["--json"]).json();
    assert_valid(&scan, "scan");
    let devices = scan["devices"].as_array().unwrap();
    let branch = &devices[3]["ports"][0]["to"];
    assert_eq!(branch, &serde_json::json!({ "no": 1, "port": "C" }));
    assert_eq!(scan["start"], Value::Null, "virtual time has no date");
}

// proves: HW-05 partial: told by `scan`, from what each SII says
#[test]
fn a_scan_names_the_terminal_that_needs_a_feed_before_it() {
    let scan = |terminals: usize| {
        let mut text =
            "name = \"press\"\n[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n"
                .to_owned();
        for no in 1..=terminals {
            let before = if no == 1 { "K1".to_owned() } else { format!("T{}", no - 1) };
            text +=
                &format!("[[device]]\nname = \"T{no}\"\ntype = \"EL2008\"\non = \"{before}.B\"\n");
        }
        let directory = TempDir::new().expect("a temporary directory");
        let path = directory.path().join("press.toml");
        fs::write(&path, text).expect("a file can be written");
        let place = format!("sim:{}", path.display());
        (linesman(["scan", &place]), linesman(["scan", &place, "--json"]).json())
    };
    // 2,000 mA are supplied, each terminal takes 110 mA.
    let (text, json) = scan(19);
    let said = text.stdout.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        said.contains("overloaded from SubDevice 20 (EL2008) on: 90 mA are missing"),
        "{}",
        text.all()
    );
    assert!(
        said.contains("power feed terminal (EL94xx) before SubDevice 20 (EL2008)"),
        "{}",
        text.all()
    );
    assert_valid(&json, "scan");
    assert_eq!(json["ebus"][0]["first_negative"], 20);
    let (text, json) = scan(18);
    assert!(!text.stdout.contains("overloaded"), "{}", text.all());
    assert_eq!(json["ebus"][0]["members"][17]["remaining_ma"], 20);
}

#[test]
fn a_sound_plant_is_healthy_in_op() {
    let found = diagnosis(&with_segment("diagnose", "", &["--json"]), 0);
    assert_eq!(found["verdict"], "healthy");
    assert_eq!(found["network"]["devices"], 5);
    assert_eq!(found["network"]["al_state_highest"], "OP");
    let lower = diagnosis(&with_segment("diagnose", "", &["--json", "--to", "SAFEOP"]), 0);
    assert_eq!(lower["network"]["al_state_highest"], "SAFEOP");
}

#[test]
fn a_cut_cable_is_one_finding_that_names_the_link() {
    let cut = "[[fault]]\nkind = \"link-open\"\nat = \"K1.C-K2.A\"\nfrom_ms = 2000\n";
    let found = diagnosis(&with_segment("diagnose", cut, &["--json"]), 1);
    assert_eq!(found["verdict"], "faulty");
    let findings = found["findings"].as_array().unwrap();
    let errors: Vec<_> = findings.iter().filter(|one| one["severity"] == "error").collect();
    assert_eq!(errors.len(), 1, "{found:#}");
    let place = &errors[0]["place"];
    assert_eq!(place["kind"], "link", "{place}");
    assert_eq!(place["a"], serde_json::json!({ "no": 1, "port": "C" }));
    assert_eq!(place["b"], serde_json::json!({ "no": 4, "port": "A" }));
    let text = with_segment("diagnose", cut, &[]);
    assert!(text.stdout.contains("K1 (EK1100) port C"), "names: {}", text.stdout);
}

#[test]
fn the_same_file_gives_the_same_answer() {
    let noise =
        "[[fault]]\nkind = \"emc-noise\"\nat = \"K1.C>K2.A\"\nfrom_ms = 2000\nto_ms = 3000\n";
    let runs = [(); 2].map(|()| with_segment("diagnose", noise, &["--json"]));
    let [one, other] = runs.map(|run| {
        let mut value = run.json();
        // The directory of the file is another one.
        value["source"] = Value::Null;
        value
    });
    assert_eq!(one, other);
}

#[test]
fn a_capture_selector_is_no_line_to_scan() {
    let run = linesman(["scan", "trace.pcapng"]);
    assert_eq!(run.status, 2);
    assert!(run.stderr.contains("`linesman diagnose trace.pcapng`"), "{}", run.stderr);
}

#[test]
fn the_same_file_gives_the_same_bytes_and_they_are_judged_alike() {
    let directory = TempDir::new().expect("a temporary directory");
    let noise =
        "[[fault]]\nkind = \"emc-noise\"\nat = \"K1.C>K2.A\"\nfrom_ms = 1500\nto_ms = 2500\n";
    let record = |name: &str| {
        let path = directory.path().join(name);
        let run = with_segment("diagnose", noise, &["--json", "--record", path.to_str().unwrap()]);
        (path.clone(), fs::read(&path).expect("a recording"), run)
    };
    let (path, one, run) = record("one.pcapng");
    let (_, other, _) = record("other.pcapng");
    assert!(one == other, "{} and {} bytes differ", one.len(), other.len());
    let live = run.json();
    let again = linesman(["diagnose".as_ref(), path.as_os_str(), "--json".as_ref()]).json();
    assert_valid(&again, "diagnosis");
    for key in ["devices", "frames", "datagrams", "al_state_highest"] {
        assert_eq!(live["network"][key], again["network"][key], "{key}");
    }
    let place = |diagnosis: &Value| diagnosis["findings"][0]["place"].clone();
    assert_eq!(place(&live), place(&again), "{live:#}\n{again:#}");
    let run = with_segment("diagnose", "", &["--record", path.to_str().unwrap()]);
    assert_eq!(run.status, 2, "a file that is there stays");
}
