//! Division of work between MainDevice and user in a project, once the line runs.

use std::fs;

use crate::support::linesman;
use serde_json::Value;
use tempfile::TempDir;

const PLANT: &str = r#"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "T2"
type = "EL3102"
on = "K1.B"
[[device]]
name = "T3"
type = "EL4102"
on = "T2.B"
"#;

/// Drives the plant with this fault by a project with these keys for the network and for the second device; gives whose
/// process data were valid at the end, and the log.
fn driven(fault: &str, network: &str, device: &str) -> (Vec<bool>, String) {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let on = format!("sim:{}", path("plant.toml"));
    fs::write(path("plant.toml"), PLANT).unwrap();
    let saved = linesman(["scan", &on, "--save", &path("machine.toml")]);
    assert_eq!(saved.status, 0, "{}", saved.all());
    let text = fs::read_to_string(path("machine.toml")).unwrap();
    let name = "name = \"SubDevice 2 (EL3102)\"";
    assert!(text.contains(name), "{text}");
    let text = text.replace(name, &format!("{name}\n{device}"));
    let first = text.find("[[device]]").unwrap();
    let text = format!("{}[network]\n{network}\n{}", &text[..first], &text[first..]);
    fs::write(path("machine.toml"), text).unwrap();
    fs::write(path("plant.toml"), format!("{PLANT}{fault}")).unwrap();
    let run = linesman([
        "run",
        &path("machine.toml"),
        "--on",
        &on,
        "--seconds",
        "8",
        "--no-diagnosis",
        "--json",
        "--log",
        &path("log"),
    ]);
    assert!(run.status < 2, "{}", run.all());
    let devices = run.json()["devices"].as_array().unwrap().clone();
    let state = |device: &Value| device["valid"].as_bool().unwrap();
    (devices.iter().map(state).collect(), linesman(["log", &path("log")]).stdout)
}

/// The device's processor starts anew: INIT, with an error.
const RESTART: &str = "[[fault]]\nkind = \"firmware-fault\"\ndevice = \"T2\"\nhow = \"restarts\"\nboot_ms = 40\nfrom_ms = 2000\nto_ms = 2100\n";
/// It has no supply for a second.
const OFF: &str =
    "[[fault]]\nkind = \"device-off\"\ndevice = \"T3\"\nfrom_ms = 2000\nto_ms = 3000\n";

// S0 L1453-1459: restore states by itself, set up anew after a loss, log changes of communication.
// proves: SW-15
#[test]
fn states_are_restored_and_devices_set_up_anew_unless_the_project_leaves_that_to_the_user() {
    let (states, log) = driven(RESTART, "", "");
    assert_eq!(states, [true, true, true], "{log}");
    let (states, log) = driven(RESTART, "", "restore_state = false");
    assert_eq!(states, [true, false, true], "{log}");
    assert!(log.contains("abnormal state change (from OP to INIT)"), "{log}");
    // What holds for all holds for it.
    let (states, _) = driven(RESTART, "restore_state = false", "");
    assert_eq!(states, [true, false, true]);
    let (states, _) = driven(RESTART, "restore_state = false", "restore_state = true");
    assert_eq!(states, [true, true, true]);

    let (states, log) = driven(OFF, "", "");
    assert_eq!(states, [true, true, true], "{log}");
    assert!(log.contains("Communication interrupted") && log.contains("re-established"), "{log}");
    let (states, log) = driven(OFF, "reinitialise = false", "");
    assert_eq!(states, [true, true, false], "{log}");
}

/// Symbols are destroyed on the way into the second device.
const NOISE: &str =
    "[[fault]]\nkind = \"emc-noise\"\nat = \"K1.B>T2.A\"\nhits_per_s = 400\nfrom_ms = 500\n";

// proves: DIA-09 partial: counters are left alone where another tool clears them
#[test]
fn counters_are_not_cleared_where_the_project_says_so() {
    let counted = |network: &str| {
        let (_, log) = driven(NOISE, network, "");
        let rises =
            log.lines().filter_map(|line| line.split("physical-layer errors, port A +").nth(1));
        let digits =
            rises.map(|rest| rest.chars().take_while(char::is_ascii_digit).collect::<String>());
        digits.map(|digits| digits.parse::<u32>().unwrap()).sum::<u32>()
    };
    assert!(counted("") > 1_000);
    assert!(counted("clear_counters = false") <= 255);
}

/// The plant with noise on the way to its last device, which moves counters.
const DISTURBED: &str =
    "[[fault]]\nkind = \"emc-noise\"\nat = \"T2.B>T3.A\"\nhits_per_s = 400\nfrom_ms = 1500\n";

/// Kinds and texts of what `run` logs of the plant with these options.
fn logged(options: &[&str]) -> Vec<(String, String)> {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    fs::write(path("plant.toml"), format!("{PLANT}{DISTURBED}")).unwrap();
    let (on, log) = (format!("sim:{}", path("plant.toml")), path("log"));
    let usual = ["run", "--on", &on, "--seconds", "4", "--no-diagnosis", "--log", &log];
    let run = linesman([&usual, options].concat());
    assert!(run.status < 2, "{}", run.all());
    let told = linesman(["log", &log, "--json"]).json();
    let text = |entry: &Value, key: &str| entry[key].as_str().unwrap().to_owned();
    let entries = told["entries"].as_array().unwrap();
    entries.iter().map(|entry| (text(entry, "kind"), text(entry, "text"))).collect()
}

// S1 L1316-1337: start-up state, staying in PREOP until the task runs, what is logged, the toggle of the inputs.
// proves: SW-16
#[test]
fn start_state_waiting_and_what_is_logged_are_options() {
    // The state that all are driven to.
    for (to, others) in [("SAFEOP", "OP"), ("PREOP", "SAFEOP"), ("OP", "BOOT")] {
        let log = logged(&["--to", to]);
        let reached = |state: &str| {
            let words = format!(": {state} reached");
            log.iter().filter(|(kind, text)| kind == "state" && text.ends_with(&words)).count()
        };
        assert_eq!((reached(to), reached(others)), (3, 0), "{to}: {log:#?}");
    }
    // What is logged: counters, or not.
    let has = |log: &[(String, String)], kind: &str| log.iter().any(|(one, _)| one == kind);
    let all = logged(&[]);
    assert!(has(&all, "counter") && has(&all, "state"), "{all:#?}");
    let quiet = logged(&["--log-without", "counter"]);
    assert!(!has(&quiet, "counter") && has(&quiet, "state"), "{quiet:#?}");
    let quiet = logged(&["--log-without", "counter", "--log-without", "state"]);
    assert!(!has(&quiet, "counter") && !has(&quiet, "state"), "{quiet:#?}");
    // All stay in PREOP, with frames going round, until the application gives outputs.
    let folder = TempDir::new().unwrap();
    let plant = folder.path().join("plant.toml");
    fs::write(&plant, PLANT).unwrap();
    let mut line = linesman::open(&format!("sim:{}", plant.display())).unwrap();
    let plan = line.scan().unwrap().plan().unwrap();
    let (mut calls, mut waiting, mut toggles, mut ready_at) = (0, Vec::new(), 0, None);
    let mut last = None;
    let cycle = linesman::RunOptions::us(1_000).wait_for_outputs();
    line.run(plan, cycle, |io| {
        calls += 1;
        let states: Vec<u16> = io.devices().map(|device| io.state(device).0 & 0xF).collect();
        let toggle = io.frame_status(0, 0).unwrap().input_toggle;
        toggles += u32::from(last.replace(toggle) != Some(toggle));
        if calls < 3_000 {
            waiting.push(states);
            io.outputs_are_old();
        } else if states == [8; 3] {
            ready_at.get_or_insert(calls);
        }
        if calls < 5_000 { linesman::Next::Continue } else { linesman::Next::Stop }
    })
    .unwrap();
    assert_eq!(waiting.last(), Some(&vec![2; 3]), "PREOP for three seconds");
    assert!(waiting.iter().flatten().all(|state| *state <= 2), "never further");
    assert!(ready_at.is_some_and(|at| at < 4_000), "{ready_at:?}");
    assert!(toggles > 4_000, "the inputs' toggle turns over: {toggles}");
}
