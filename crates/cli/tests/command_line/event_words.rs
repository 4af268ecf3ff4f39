//! Events of SubDevices, in the words of the sources: in the log, with times, and exported.

use crate::support::{assert_valid, linesman};
use serde_json::Value;
use tempfile::TempDir;

const PLANT: &str = r#"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "I1"
type = "EL3102"
on = "K1.B"
[[device]]
name = "K2"
type = "EK1100"
on = "K1.C"
[[device]]
name = "O1"
type = "EL2008"
on = "K2.B"
"#;

/// Runs the plant with faults and keeps a log; gives the folder with it, and its entries.
fn logged(faults: &str, seconds: &str) -> (TempDir, Vec<Value>) {
    let folder = TempDir::new().unwrap();
    let plant = folder.path().join("plant.toml");
    let log = folder.path().join("log.sqlite");
    std::fs::write(&plant, format!("{PLANT}{faults}")).unwrap();
    let on = format!("sim:{}", plant.display());
    let ran = linesman([
        "run",
        "--on",
        &on,
        "--seconds",
        seconds,
        "--no-diagnosis",
        "--log",
        log.to_str().unwrap(),
    ]);
    assert!(ran.status < 2, "{}", ran.all());
    let told = linesman(["log", log.to_str().unwrap(), "--json"]).json();
    assert_valid(&told, "log");
    let entries = told["entries"].as_array().unwrap().clone();
    (folder, entries)
}

fn texts(entries: &[Value]) -> Vec<&str> {
    entries.iter().map(|entry| entry["text"].as_str().unwrap()).collect()
}

// S0 L2230-2233: a state that is refused is a pair of entries.
// proves: SW-02
#[test]
fn an_aborted_state_change_is_logged_with_what_was_asked_and_what_was_read() {
    let refused = "[[fault]]\nkind = \"init-refused\"\ndevice = \"I1\"\nto = \"PREOP\"\ncode = 0x14\nrefusals = 1\n";
    let (folder, entries) = logged(refused, "4");
    let texts = texts(&entries);
    let at = texts.iter().position(|text| text.contains("state change aborted"));
    let at = at.unwrap_or_else(|| panic!("{texts:#?}"));
    assert_eq!(
        texts[at],
        "'SubDevice 2 (EL3102)' (1002): state change aborted (requested PREOP, back to INIT)"
    );
    assert!(
        texts[at + 1].starts_with(
            "'SubDevice 2 (EL3102)' (1002): INIT to PREOP failed, read 0x0011, expected 0x0002, AL 0x0014 no valid firmware"
        ),
        "{texts:#?}"
    );
    assert_eq!(entries[at]["kind"], "state-aborted");
    assert_eq!(entries[at]["severity"], "error");
    // Found again by its kind.
    let log = folder.path().join("log.sqlite");
    let found = linesman(["log", log.to_str().unwrap(), "--kind", "state-aborted"]);
    assert!(found.stdout.contains("read 0x0011, expected 0x0002"), "{}", found.all());
}

// S0 L1345-1346, S1 L412-422: interrupted, then restored, each with its time; exported.
// proves: DIA-13
#[test]
fn a_line_that_is_cut_and_mended_is_logged_with_times_and_exported() {
    let cut = "[[fault]]\nkind = \"link-open\"\nat = \"K1.C-K2.A\"\nfrom_ms = 2000\nto_ms = 4000\n";
    let (folder, entries) = logged(cut, "7");
    let when = |part: &str| {
        let found: Vec<&Value> =
            entries.iter().filter(|entry| entry["text"].as_str().unwrap().contains(part)).collect();
        assert!(!found.is_empty(), "{part}: {:#?}", texts(&entries));
        found
    };
    let lost = when(
        "'SubDevice 3 (EK1100)' (1003) - 'SubDevice 4 (EL2008)' (1004) Communication interrupted",
    );
    let back = when("Communication re-established");
    let time = |entry: &Value| entry["time"].as_str().unwrap().to_owned();
    assert!(time(lost[0]) < time(back[0]), "{} {}", time(lost[0]), time(back[0]));
    assert_eq!(lost[0]["severity"], "error");
    assert!(back.iter().any(|entry| entry["no"] == 3), "{back:#?}");
    // All of the entries are in the table for a spreadsheet.
    let log = folder.path().join("log.sqlite");
    let csv = linesman(["log", log.to_str().unwrap(), "--csv"]);
    assert_eq!(csv.stdout.lines().count(), entries.len() + 1, "{}", csv.all());
    for text in texts(&entries) {
        assert!(csv.stdout.contains(text.split(',').next().unwrap()), "{text}: {}", csv.stdout);
    }
}

// S0 L1346, L2240-2245: it was in OP, and leaves it by itself: from where, to where, and with which code.
// proves: SW-03
#[test]
fn a_fall_from_op_by_a_fault_of_its_own_is_logged_with_its_code() {
    let device = "[[device]]\nname = \"O2\"\ntype = \"EL4102\"\non = \"I1.B\"\n";
    for (fault, expected, words) in [
        // Its watchdog is shorter than the cycle, while all others get their outputs in time.
        (
            "kind = \"watchdog-starved\"\ndevice = \"O2\"\nwatchdog_ms = 0.3\n",
            "'SubDevice 3 (EL4102)' (1003): abnormal state change (from OP to SAFEOP), AL 0x001B sync manager watchdog",
            "task which sends the outputs",
        ),
        // Its firmware crashes and starts anew.
        (
            "kind = \"firmware-fault\"\ndevice = \"O2\"\nhow = \"restarts\"\n",
            "'SubDevice 3 (EL4102)' (1003): abnormal state change (from OP to INIT), AL 0x0060",
            "",
        ),
    ] {
        let fault = format!("{device}[[fault]]\n{fault}from_ms = 3000\nto_ms = 3500\n");
        let (folder, entries) = logged(&fault, "5");
        let texts = texts(&entries);
        let at = texts.iter().position(|text| text.starts_with(expected));
        let at = at.unwrap_or_else(|| panic!("{expected}: {texts:#?}"));
        assert_eq!(
            (&entries[at]["kind"], &entries[at]["severity"]),
            (&"abnormal-state".into(), &"error".into())
        );
        assert_eq!(entries[at]["no"], 3);
        assert!(
            texts[at + 1].starts_with("'SubDevice 3 (EL4102)' (1003): ")
                && texts[at + 1].contains(words),
            "{texts:#?}"
        );
        // It was up before, and it is nobody else's.
        assert!(
            texts[..at].iter().any(|text| text.contains("have reached their states")),
            "{texts:#?}"
        );
        let abnormal = entries.iter().filter(|entry| entry["kind"] == "abnormal-state");
        assert!(abnormal.clone().all(|entry| entry["no"] == 3), "{texts:#?}");
        let log = folder.path().join("log.sqlite");
        let found = linesman([
            "log",
            log.to_str().unwrap(),
            "--kind",
            "abnormal-state",
            "--severity",
            "error",
        ]);
        assert!(found.stdout.contains(expected), "{}", found.all());
    }
}

// S0 L1485-1490, S1 L133-151: a working counter that is wrong names neither who nor why; what is read because
// of it does.
// proves: FRM-19
#[test]
fn a_wrong_working_counter_is_followed_at_once_by_what_was_read_because_of_it() {
    let cut = "[[fault]]\nkind = \"link-open\"\nat = \"K1.C-K2.A\"\nfrom_ms = 2000\n";
    let (_folder, entries) = logged(cut, "4");
    let first = |kind: &str| {
        let found = entries.iter().find(|entry| entry["kind"] == kind);
        found.unwrap_or_else(|| panic!("{kind}: {:#?}", texts(&entries)))
    };
    let nanos = |entry: &Value| {
        let time = linesman_link::unix_time::UnixTime::parse(entry["time"].as_str().unwrap());
        time.unwrap().as_nanos()
    };
    let counter = first("working-counter");
    assert!(counter["no"].is_null(), "it accuses nobody: {counter}");
    let text = counter["text"].as_str().unwrap();
    assert!(text.starts_with("working counter of task '") && text.contains(" expected"), "{text}");
    // Who is gone, and the port behind which they were, are known long before anything would have been read
    // at its turn, ten times a second.
    let (gone, port) = (first("communication"), first("link"));
    assert!(port["text"].as_str().unwrap().contains("port C lost its neighbour"), "{port}");
    assert_eq!(port["no"], 1);
    for entry in [gone, port] {
        let after = nanos(entry) - nanos(counter);
        assert!((0..40_000_000).contains(&after), "{after} ns: {entry}");
    }
    let text = entries
        .iter()
        .find(|entry| entry["text"].as_str().unwrap().contains("Communication interrupted"));
    assert!(
        text.unwrap()["text"]
            .as_str()
            .unwrap()
            .contains("'SubDevice 3 (EK1100)' (1003) - 'SubDevice 4 (EL2008)'")
    );
}

/// Steady noise moves counters with every reading, and those of everybody behind.
#[test]
fn steady_noise_is_told_to_people_once_in_a_while_and_logged_each_time() {
    let noise =
        "[[fault]]\nkind = \"emc-noise\"\nat = \"K1.B>I1.A\"\nhits_per_s = 400\nfrom_ms = 500\n";
    let folder = TempDir::new().unwrap();
    let plant = folder.path().join("plant.toml");
    let log = folder.path().join("log.sqlite");
    std::fs::write(&plant, format!("{PLANT}{noise}")).unwrap();
    let on = format!("sim:{}", plant.display());
    let log = log.to_str().unwrap();
    let ran = linesman(["run", "--on", &on, "--seconds", "8", "--log", log]);
    let told = ran.stdout.lines().filter(|line| line.contains("error counters rose")).count();
    assert!((1..=3).contains(&told), "{}", ran.all());
    let kept = linesman(["log", log, "--json", "--kind", "counter"]).json();
    let kept = kept["entries"].as_array().unwrap();
    assert!(kept.len() > 30, "{}", kept.len());
    // Who only passes on what another one has marked is no warning.
    let severities = |no: u64| {
        kept.iter()
            .filter(|entry| entry["no"] == no)
            .map(|entry| entry["severity"].as_str().unwrap())
            .collect::<std::collections::BTreeSet<_>>()
    };
    assert!(severities(2).contains("warning"), "{kept:#?}");
    assert!(!severities(4).contains("warning"), "{kept:#?}");
    // Registers stop at 255; what is counted does not.
    let symbols: u64 = kept
        .iter()
        .filter_map(|entry| entry["text"].as_str()?.split("physical-layer errors, port A +").nth(1))
        .map(|rest| rest.chars().take_while(char::is_ascii_digit).collect::<String>())
        .map(|digits| digits.parse::<u64>().unwrap())
        .sum();
    assert!(symbols > 1_000, "{symbols}");
}
