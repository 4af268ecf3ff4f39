//! The event log, through the command line.

use std::path::Path;

use crate::support::capture::Pcap;
use crate::support::{PROGRAM, assert_valid, linesman};
use linesman_link::unix_time::UnixTime;
use linesman_maindevice::watch::{EntryKind, Severity};
use linesman_runtime::event_log::{EventLog, StoredEntry};
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
        finding: None,
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
        all.stdout
            .contains("2016-11-17 10:16:50.182 +00:00  error    'Term 64 (EK1100)' (1015) - "),
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

/// Runs the program in Central Europe.
fn in_berlin(words: &[&str]) -> String {
    let mut command = std::process::Command::new(PROGRAM);
    // As a rule, so that no table of time zones is needed.
    command.args(words).env("TZ", "CET-1CEST,M3.5.0,M10.5.0/3");
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn people_read_times_of_their_zone_and_programs_utc() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("log.sqlite");
    write(&path);
    let file = path.to_str().unwrap();
    let all = in_berlin(&["log", file]);
    assert!(all.contains("2016-11-17 11:16:50.182 +01:00  error "), "{all}");
    assert!(in_berlin(&["log", file, "--runs"]).contains("2016-11-16 09:00:00.000 +01:00"));
    // A time without a zone is one of this host; what is shown is taken back.
    for since in ["2016-11-17 11:16:51", "2016-11-17T11:16:51", "2016-11-17 11:16:51.000 +01:00"] {
        let some = in_berlin(&["log", file, "--since", since]);
        assert!(some.contains("re-established") && some.contains("1 of 3 entries"), "{some}");
    }
    assert!(in_berlin(&["log", file, "--since", "2016-11-17"]).contains("2 of 3 entries"));
    for machine in ["--csv", "--json"] {
        let text = in_berlin(&["log", file, machine]);
        assert!(text.contains("2016-11-17T10:16:50.182000000Z"), "{text}");
    }
    // A diagnosis, too: the capture begins at 22:13:20 UTC.
    let path = folder.path().join("trace.pcap");
    let mut capture = Pcap::new();
    capture.exchanges(100);
    std::fs::write(&path, &capture.0).unwrap();
    let capture = path.to_str().unwrap();
    let text = in_berlin(&["diagnose", capture]);
    assert!(
        text.contains("begun 2023-11-14 23:13:20.000 +01:00; times count from there"),
        "{text}"
    );
    assert!(in_berlin(&["diagnose", capture, "--json"]).contains("2023-11-14T22:13:20.000000000Z"));
}

// S0 L2272-2390, S1 L975-1006: 2,630 of 38,332 events are those of one source, found and exported after the
// program that wrote them has ended. That the log of the system has them, too, is in `beside_programs.rs`.
// proves: SW-07
#[test]
fn of_38332_events_the_2630_of_one_source_are_filtered_and_exported() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("log.sqlite");
    let mut log = EventLog::create(&path).unwrap();
    let began = UnixTime::parse("2016-11-17T10:00:00Z").unwrap();
    let run = log.begin(began, "eth0", "plant", "linesman 0.1.0").unwrap();
    // Those of the source are spread over all.
    let mut of_source = 0;
    let entries: Vec<StoredEntry> = (0..38_332_u64)
        .map(|number| {
            let is_one = number * 2_630 / 38_332 != (number + 1) * 2_630 / 38_332;
            of_source += u32::from(is_one);
            StoredEntry {
                run,
                at: began + linesman::Span::ms(number),
                severity: if is_one { Severity::Error } else { Severity::Info },
                kind: if is_one { EntryKind::AbnormalState } else { EntryKind::Counter },
                device_no: Some(if is_one { 14 } else { 3 }),
                device_name: Some(if is_one { "Term 14" } else { "Term 3" }.to_owned()),
                text: format!("event {number}"),
                finding: None,
            }
        })
        .collect();
    assert_eq!(of_source, 2_630);
    log.append(&entries).unwrap();
    drop(log);
    let file = path.to_str().unwrap();
    for filter in [["--device", "Term 14"], ["--kind", "abnormal-state"], ["--severity", "error"]] {
        let shown = linesman(["log", file, filter[0], filter[1]]);
        assert!(
            shown.stdout.contains("2630 of 38332 entries"),
            "{}",
            &shown.stdout[shown.stdout.len() - 200..]
        );
        let csv = linesman(["log", file, filter[0], filter[1], "--csv"]);
        assert_eq!(csv.stdout.lines().count(), 2_631, "with the headings");
        let json = linesman(["log", file, filter[0], filter[1], "--json"]).json();
        assert_eq!(json["of"], 38_332);
        let all = json["entries"].as_array().unwrap();
        assert!(all.len() == 2_630 && all.iter().all(|entry| entry["no"] == 14));
    }
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

/// A line on which error counters rise for a hundred seconds, as a file in the folder.
fn noisy(folder: &Path) -> String {
    let plant = folder.join("noisy.toml");
    let text = "[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
                [[device]]\nname = \"T2\"\ntype = \"EL2008\"\non = \"K1.B\"\n\
                [[fault]]\nkind = \"emc-noise\"\nat = \"K1.B>T2.A\"\nhits_per_s = 600\n\
                bursts_per_s = 40\nfrom_ms = 500\n";
    std::fs::write(&plant, text).unwrap();
    format!("sim:{}", plant.display())
}

#[test]
fn a_full_disk_under_the_log_costs_entries_and_no_cycle() {
    let folder = TempDir::new().unwrap();
    let place = noisy(folder.path());
    let disk = folder.path().join("disk");
    std::fs::create_dir(&disk).unwrap();
    // A disk of its own, so small that the log does not fit.
    let script = "mount -t tmpfs -o size=64k none \"$1\" || exit 77; shift; exec \"$@\"";
    let run = std::process::Command::new("unshare")
        .args(["--mount", "--map-root-user", "sh", "-c", script, "sh"])
        .arg(&disk)
        .arg(PROGRAM)
        .args(["run", "--on", &place, "--seconds", "100", "--no-diagnosis", "--json", "--log"])
        .arg(disk.join("log.sqlite"))
        .output();
    let run = match run {
        Ok(run) if run.status.code() == Some(0) => run,
        other => {
            let why = other.map(|run| String::from_utf8_lossy(&run.stderr).into_owned());
            assert!(!why.as_ref().is_ok_and(|why| why.contains("panicked")), "{why:?}");
            eprintln!("SKIPPED: no small disk can be had here: {why:?}");
            return;
        }
    };
    let told = String::from_utf8_lossy(&run.stderr);
    assert!(told.contains("entries are missing in the event log"), "{told}");
    assert!(told.contains("the disk is full") && told.contains("make room"), "{told}");
    let report: serde_json::Value = serde_json::from_slice(&run.stdout).unwrap();
    assert!(report["counts"]["cycles"].as_u64().unwrap() > 99_000, "{}", report["counts"]);
    assert_eq!(report["counts"]["cycles_missed"], 0);
}

#[test]
fn a_log_on_a_full_disk_is_refused_before_anything_is_driven() {
    let folder = TempDir::new().unwrap();
    let run =
        linesman(["run", "--on", &noisy(folder.path()), "--seconds", "1", "--log", "/dev/full"]);
    assert_eq!(run.status, 2, "{}", run.all());
    assert!(run.stderr.contains("/dev/full: the disk is full"), "{}", run.stderr);
}
