//! The AL status codes that people meet, brought about on a segment: `linesman run` names each, says
//! what to do, acknowledges it, and goes on where the cause is gone.

use std::fs;

use crate::support::{Run, linesman};
use tempfile::TempDir;

const PLANT: &str = r#"
name = "codes"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "I1"
type = "EL3102"
on = "K1.B"
[[device]]
name = "O1"
type = "EL4102"
on = "I1.B"
"#;

/// Outputs in step with SYNC0.
const IN_STEP: &str =
    "clock = { assign_activate = 0x0300, sync0_cycle_us = 1000, sync0_shift_ns = 300000 }";

/// Code, name, words of its cause, and of what to do first.
const SYNCHRONISATION: [(u16, &str, &str, &str); 9] = [
    (
        0x002D,
        "no sync error",
        "no SYNC signal",
        "DC settings of this SubDevice were changed by hand",
    ),
    (0x0030, "invalid DC SYNC configuration", "SYNC settings", "delete it from the configuration"),
    (0x0032, "PLL error", "cannot lock its own timing", "jitter"),
    (0x001A, "synchronization error", "cannot keep step", "jitter"),
    (0x0033, "DC sync IO error", "could not be synchronized", "off and on"),
    (0x0034, "DC sync timeout", "missed more SYNC signals", "jitter"),
    (0x0035, "DC invalid sync cycle time", "does not support the configured cycle", "0x1C33:05"),
    (0x0036, "DC SYNC0 cycle time", "SYNC0 does not fit", "0x1C32:05"),
    (0x0037, "DC SYNC1 cycle time", "SYNC1 does not fit", "lengthen the cycle"),
];

// S0 L703-714.
// proves: SYN-30
#[test]
fn codes_of_lost_synchronisation_have_their_cause_and_what_to_do_first() {
    for (code, name, cause, first) in SYNCHRONISATION {
        let page = linesman(["explain", &format!("al:0x{code:04X}"), "--json"]);
        assert_eq!(page.status, 0, "{code:04X}: {}", page.all());
        let page = page.json();
        let reading = &page["readings"][0];
        assert_eq!(reading["title"], format!("AL status code 0x{code:04X}: {name}"));
        let sections = reading["sections"].as_array().unwrap();
        let told = sections[0]["lines"][0].as_str().unwrap();
        assert!(told.contains(cause), "{code:04X}: {told}");
        let advice =
            sections.iter().find(|one| one["heading"] == "do" || one["heading"] == "first");
        let step = advice.unwrap()["lines"][0].as_str().unwrap();
        assert!(step.contains(first), "{code:04X}: {step}");
    }
}

/// When it happens.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum When {
    /// On the way up; the cause goes away after some seconds.
    AtStart,
    /// In OP; the cause goes away after some seconds.
    InOp,
    /// On the way up, and the cause stays: it is in the project.
    Planned,
}

/// Runs the plant with this fault, and this line in the project for the outputs.
fn run(when: When, fault: &str, clock: &str) -> Run {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let on = format!("sim:{}", path("plant.toml"));
    fs::write(path("plant.toml"), PLANT).unwrap();
    let saved = linesman(["scan", &on, "--save", &path("machine.toml")]);
    assert_eq!(saved.status, 0, "{}", saved.all());
    let text = fs::read_to_string(path("machine.toml")).unwrap();
    let name = "name = \"SubDevice 3 (EL4102)\"";
    assert!(text.contains(name), "{text}");
    fs::write(path("machine.toml"), text.replace(name, &format!("{name}\n{clock}"))).unwrap();
    let times = match when {
        When::AtStart => "from_ms = 0\nto_ms = 2500\n",
        When::InOp => "from_ms = 3000\nto_ms = 4500\n",
        When::Planned => "",
    };
    let fault = if fault.is_empty() { String::new() } else { format!("[[fault]]\n{fault}{times}") };
    fs::write(path("plant.toml"), format!("{PLANT}{fault}")).unwrap();
    linesman(["run", &path("machine.toml"), "--on", &on, "--seconds", "9"])
}

/// Holds what was said against the name of the code and the change that it belongs to.
fn told(when: When, fault: &str, clock: &str, code: &str) {
    let run = run(when, fault, clock);
    let all = run.all();
    let lines: Vec<&str> = run.stdout.lines().collect();
    let at = lines.iter().position(|line| line.contains(code));
    let at = at.unwrap_or_else(|| panic!("no {code} in {all}"));
    let change = match when {
        When::AtStart | When::Planned => "failed, read 0x001",
        When::InOp => "abnormal state change (from OP to SAFEOP)",
    };
    assert!(lines[at].contains(change), "{code}: {all}");
    // What to do is said in the next line, by the same SubDevice at the same moment.
    let who = lines[at].split("': ").next().unwrap().split(':').next().unwrap();
    let action = lines[at + 1];
    assert!(action.starts_with(who), "{code}: {who} in {action}");
    assert!(action.len() > lines[at].find(code).unwrap().min(60), "{code}: {action}");
    assert!(!all.contains("unknown code"), "{all}");
    let valid = run.stdout.contains("Process data of all 3 SubDevices valid at the end.");
    if when == When::Planned {
        // Acknowledged, tried again, refused again; the others go on.
        let tries = lines.iter().filter(|line| line.contains(code)).count();
        assert!(tries >= 2 && !valid, "{code}: {all}");
        assert_eq!(run.status, 1, "{all}");
    } else {
        // A device whose error was not acknowledged takes no request but INIT and gives no data.
        assert!(valid, "{code}: {all}");
    }
}

// proves: SW-04
#[test]
fn each_code_of_start_up_and_running_is_named_explained_and_acknowledged() {
    use When::{AtStart, InOp, Planned};
    let table = [
        (
            AtStart,
            "kind = \"init-refused\"\ndevice = \"I1\"\ncode = 3\n",
            "",
            "0x0003 invalid device setup",
        ),
        (
            AtStart,
            "kind = \"config-mismatch\"\ndevice = \"O1\"\n",
            "",
            "0x001D invalid output configuration",
        ),
        (
            AtStart,
            "kind = \"config-mismatch\"\ndevice = \"I1\"\n",
            "",
            "0x001E invalid input configuration",
        ),
        (
            Planned,
            "",
            "clock = { assign_activate = 0x0300, sync0_cycle_us = 0 }",
            "0x0035 DC invalid sync cycle time",
        ),
        (
            InOp,
            "kind = \"host-jitter\"\ndelays_per_s = 2000\ndelay_us = 900\n",
            IN_STEP,
            "0x001A synchronization error",
        ),
        (
            InOp,
            "kind = \"watchdog-starved\"\ndevice = \"O1\"\nwatchdog_ms = 0.3\n",
            "",
            "0x001B sync manager watchdog",
        ),
        (InOp, "kind = \"sync-lost\"\ndevice = \"O1\"\n", IN_STEP, "0x002C fatal sync error"),
        (
            InOp,
            "kind = \"sync-lost\"\ndevice = \"O1\"\nhow = \"bounces\"\n",
            IN_STEP,
            "0x0033 DC sync IO error",
        ),
    ];
    for (when, fault, clock, code) in table {
        told(when, fault, clock, code);
    }
}
