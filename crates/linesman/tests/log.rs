//! The event log, through the command line.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod support;

use std::path::Path;

use linesman_link::unix_time::UnixTime;
use linesman_maindevice::watch::{EntryKind, Severity};
use linesman_runtime::event_log::{EventLog, StoredEntry};
use support::{assert_valid, linesman};
use tempfile::TempDir;

/// A log with the message window of the sources (S1 L412-422) and a run before it.
fn write(path: &Path) {
    let mut log = EventLog::create(path).unwrap();
    let at = |text: &str| UnixTime::parse(text).unwrap();
    let old = log.begin(at("2016-11-16T08:00:00Z"), "eth0", "plant", "linesman 0.1.0").unwrap();
    let run = log.begin(at("2016-11-17T10:00:00Z"), "eth0", "plant", "linesman 0.1.0").unwrap();
    let entry = |run, time: &str, severity, kind, no, text: &str| StoredEntry {
        run,
        at: at(time),
        severity,
        kind,
        device_no: Some(no),
        device_name: Some(format!("Term {}", 63 + no)),
        text: text.to_owned(),
    };
    let lost = "'Term 64 (EK1100)' (1015) - 'Term 70 (EL1262)' (101b) Communication interrupted";
    let back = "'Term 64 (EK1100)' (1015) Communication re-established";
    let (error, info) = (Severity::Error, Severity::Info);
    log.append(&[
        entry(old, "2016-11-16T09:00:00Z", info, EntryKind::State, 1, "'Term 64' is in 'OP'"),
        entry(run, "2016-11-17T10:16:50.182Z", error, EntryKind::Communication, 1, lost),
        entry(run, "2016-11-17T10:16:55.274Z", info, EntryKind::Communication, 1, back),
    ])
    .unwrap();
}

// proves: SW-07 partial: a file of our own instead of the system's, DIA-13 partial: filtered and exported
#[test]
fn a_log_is_read_filtered_and_exported() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("log.sqlite");
    write(&path);
    let file = path.to_str().unwrap();
    let all = linesman(["log", file]);
    assert_eq!(all.status, 0, "{}", all.all());
    assert!(
        all.stdout.contains("2016-11-17 10:16:50.182  error    'Term 64 (EK1100)' (1015) - "),
        "{}",
        all.stdout
    );
    assert!(all.stdout.contains("3 of 3 entries"));
    let errors = linesman(["log", file, "--severity", "error", "--run", "last"]);
    assert!(errors.stdout.contains("1 of 3 entries"), "{}", errors.stdout);
    let since = linesman(["log", file, "--since", "2016-11-17T10:16:51Z"]);
    assert!(since.stdout.contains("re-established"), "{}", since.stdout);
    assert!(since.stdout.contains("1 of 3 entries"));
    let csv = linesman(["log", file, "--csv", "--kind", "communication"]);
    let lines: Vec<_> = csv.stdout.lines().collect();
    assert_eq!(lines.len(), 3);
    assert!(
        lines[1].starts_with("2,2016-11-17T10:16:50.182000000Z,error,communication,1,Term 64,")
    );
    let json = linesman(["log", file, "--json", "--device", "Term 64"]).json();
    assert_valid(&json, "log");
    assert_eq!(json["entries"].as_array().unwrap().len(), 3);
    assert_eq!(json["runs"].as_array().unwrap().len(), 2);
    let runs = linesman(["log", file, "--runs"]);
    assert!(runs.stdout.contains("2016-11-17 10:00:00.000"), "{}", runs.stdout);
}

#[test]
fn what_is_no_log_or_no_time_is_refused_with_the_next_step() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("log.sqlite");
    let file = path.to_str().unwrap();
    let missing = linesman(["log", file]);
    assert_eq!(missing.status, 2);
    assert!(missing.stderr.contains("no such event log"), "{}", missing.stderr);
    std::fs::write(
        &path,
        "not a database, but long enough to look like the header of one, perhaps",
    )
    .unwrap();
    let other = linesman(["log", file, "--json"]);
    assert_eq!(other.status, 2);
    assert_valid(&other.json(), "error");
    std::fs::remove_file(&path).unwrap();
    write(&path);
    for wrong in [["--since", "yesterday"], ["--run", "9"]] {
        let refused = linesman(["log", file, wrong[0], wrong[1]]);
        assert_eq!(refused.status, 2, "{}", refused.all());
        assert!(refused.stderr.contains("do:"), "{}", refused.stderr);
    }
}
