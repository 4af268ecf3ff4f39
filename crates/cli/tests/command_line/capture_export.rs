//! `linesman capture export`, `wireshark-profile`, records of capture probes, and files of one ring.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::Command;

use linesman_capture::wireshark::{RULES, buttons};
use linesman_proto::esl::EslRecord;
use parquet::file::reader::{FileReader as _, SerializedFileReader};

use crate::support::capture::Pcap;
use crate::support::linesman;

/// A broadcast read of AL status: on its way out, or back from two SubDevices in OP.
fn broadcast(index: u8, is_back: bool) -> Vec<u8> {
    let (source, counter) = if is_back { (0x02, 2) } else { (0x00, 0) };
    let mut frame = vec![0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, source, 0x10, 0x10, 0x10, 0x10, 0x10];
    frame.extend([0x88, 0xA4, 14, 0x10, 7, index, counter, 0, 0x30, 0x01, 2, 0, 0, 0]);
    frame.extend([counter * 4, 0, counter, 0]);
    frame.resize(60, 0);
    frame
}

/// Exchanges of which some do not come back.
fn lossy() -> Pcap {
    let mut capture = Pcap::new();
    for number in 0..2_000_u64 {
        capture.frame(number * 1_000, &broadcast(number as u8, false));
        if number % 100 != 57 {
            capture.frame(number * 1_000 + 40, &broadcast(number as u8, true));
        }
    }
    capture
}

/// Standard output of tshark; `None`, said aloud, where there is none.
fn tshark(arguments: &[&str], settings: Option<&Path>) -> Option<String> {
    let mut command = Command::new("tshark");
    if let Some(settings) = settings {
        command.env("WIRESHARK_CONFIG_DIR", settings);
    }
    let Ok(output) = command.args(arguments).output() else {
        eprintln!("SKIPPED: no tshark on this computer");
        return None;
    };
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "tshark {arguments:?}: {said}");
    Some(String::from_utf8(output.stdout).unwrap())
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn table_has_a_row_for_each_datagram() {
    let folder = tempfile::tempdir().unwrap();
    let (file, table) = (folder.path().join("lossy.pcap"), folder.path().join("rows.csv"));
    std::fs::write(&file, lossy().0).unwrap();
    let run = linesman(["capture", "export", text(&file), "--csv", text(&table)]);
    assert_eq!(run.status, 0, "{}", run.stderr);
    let rows = std::fs::read_to_string(&table).unwrap();
    let mut lines = rows.lines();
    let heading: Vec<&str> = lines.next().unwrap().split(',').collect();
    let column = |name: &str| heading.iter().position(|word| *word == name).unwrap();
    let cells: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    assert_eq!(cells.len(), 3_980);
    let back = cells.iter().filter(|row| row[column("way")] == "back");
    let counters = back.map(|row| (row[column("wkc")], row[column("wkc_expected")]));
    assert_eq!(counters.collect::<Vec<_>>(), vec![("2", "2"); 1_980]);
    assert_eq!(cells[1][column("time_ns")], "40000");
    let again = linesman(["capture", "export", text(&file), "--csv", text(&table)]);
    assert_eq!(again.status, 2, "a file that is there is not written over");
}

#[test]
fn columns_have_the_rows_of_the_table() {
    let folder = tempfile::tempdir().unwrap();
    let (file, table) = (folder.path().join("lossy.pcap"), folder.path().join("rows.parquet"));
    std::fs::write(&file, lossy().0).unwrap();
    let run = linesman(["capture", "export", text(&file), "--parquet", text(&table)]);
    assert_eq!(run.status, 0, "{}", run.stderr);
    let reader = SerializedFileReader::new(File::open(&table).unwrap()).unwrap();
    let rows: Vec<_> = reader.get_row_iter(None).unwrap().map(Result::unwrap).collect();
    assert_eq!(rows.len(), 3_980);
    let cell = |row: usize, wanted: &str| {
        let mut columns = rows[row].get_column_iter();
        columns.find(|(name, _)| *name == wanted).unwrap().1.to_string()
    };
    assert_eq!(cell(1, "time_ns"), "40000");
    assert_eq!(cell(1, "way"), "\"back\"");
    assert_eq!(cell(1, "wkc_expected"), "2");
    let again = linesman(["capture", "export", text(&file), "--parquet", text(&table)]);
    assert_eq!(again.status, 2, "a file that is there is not written over");
}

#[test]
fn findings_are_comments_that_tshark_shows() {
    let folder = tempfile::tempdir().unwrap();
    let (file, target) = (folder.path().join("lossy.pcap"), folder.path().join("told.pcapng"));
    std::fs::write(&file, lossy().0).unwrap();
    let judged = linesman(["diagnose", text(&file), "--json"]).json();
    let finding = &judged["findings"][0];
    let run = linesman(["capture", "export", text(&file), "--pcapng", text(&target)]);
    assert_eq!(run.status, 0, "{}", run.stderr);
    let words = ["-r", text(&target), "-Y", "frame.comment", "-T", "fields", "-e", "frame.comment"];
    let Some(comments) = tshark(&words, None) else { return };
    let expected =
        format!("{} {}", finding["id"].as_str().unwrap(), finding["code"].as_str().unwrap());
    assert!(comments.contains(&expected), "{expected}: {comments}");
}

// proves: WS-11
#[test]
fn profile_colours_frames_in_tshark_and_all_its_filters_compile() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("lossy.pcap");
    std::fs::write(&file, lossy().0).unwrap();
    let profile = folder.path().join("settings/profiles/EtherCAT");
    let run = linesman(["capture", "wireshark-profile", text(&profile)]);
    assert_eq!(run.status, 0, "{}", run.stderr);
    let settings = folder.path().join("settings");
    let words = ["-C", "EtherCAT", "--color", "-r", text(&file), "-T", "fields"];
    let words = [&words[..], &["-e", "frame.coloring_rule.name"]].concat();
    let Some(names) = tshark(&words, Some(&settings)) else { return };
    assert!(names.lines().all(|name| name == "State request or state"), "{names}");
    let rules = std::fs::read_to_string(profile.join("colorfilters")).unwrap();
    for rule in RULES {
        assert!(rules.contains(&format!("@{}@{}@[", rule.name, rule.filter)));
        tshark(&["-r", text(&file), "-Y", rule.filter], None);
    }
    for (label, filter) in buttons() {
        assert!(!label.is_empty());
        tshark(&["-r", text(&file), "-Y", filter], None);
    }
}

// proves: WS-06
#[test]
fn record_of_a_probe_is_read_in_both_forms_as_tshark_reads_it() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("probe.pcap");
    let mut capture = Pcap::new();
    for number in 0..40_u64 {
        let is_back = number % 2 == 1;
        let record = EslRecord {
            port: Some((number % 4) as u8),
            crc_error: number == 21,
            alignment_error: number == 22,
            time_ns: 183_570_258_760 + number * 1_003,
        };
        let (frame, record) = (broadcast((number / 2) as u8, is_back), record.to_bytes().to_vec());
        let parts = if number < 30 { [frame, record] } else { [record, frame] };
        // The computer that records notes it late and unevenly.
        capture.frame(number * 1_000 + number % 3 * 200, &parts.concat());
    }
    std::fs::write(&file, &capture.0).unwrap();
    for condition in ["esl.port == 1", "esl.crcerror == 1", "esl.alignerror == 1 || esl.port > 2"] {
        let run = linesman(["capture", "filter", text(&file), condition, "--numbers"]);
        assert_eq!(run.status, 0, "{}", run.stderr);
        assert!(!run.stdout.is_empty(), "{condition}");
        let words = ["--enable-heuristic", "esl_eth", "-r", text(&file), "-Y", condition];
        let words = [&words[..], &["-T", "fields", "-e", "frame.number"]].concat();
        let Some(theirs) = tshark(&words, None) else { return };
        assert_eq!(run.stdout, theirs, "{condition}");
    }
    let listed = linesman(["capture", "list", text(&file), "--where", "frame.number == 4"]);
    assert!(listed.stdout.contains("0.000003009"), "by the clock of the probe: {}", listed.stdout);
    assert!(listed.stdout.contains("probe port 3"), "{}", listed.stdout);
    let judged = linesman(["diagnose", text(&file), "--json"]).json();
    assert_eq!(judged["network"]["damaged"], 2, "{}", judged["network"]);
}

#[test]
fn files_of_one_ring_are_judged_as_one_recording() {
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole.pcap");
    std::fs::write(&whole, lossy().0).unwrap();
    let part = |number: u32, condition: &str| -> PathBuf {
        let target = folder.path().join(format!("part_{number:05}.pcapng"));
        let run = linesman(["capture", "filter", text(&whole), condition, "-o", text(&target)]);
        assert_eq!(run.status, 0, "{}", run.stderr);
        target
    };
    // The cut lies between a request and its return.
    let parts = [part(1, "frame.number <= 1001"), part(2, "frame.number > 1001")];
    let judged = linesman(["diagnose", text(&whole), "--json"]).json();
    for order in [[0, 1], [1, 0]] {
        let [first, second] = order.map(|index: usize| text(&parts[index]));
        let together = linesman(["diagnose", first, second, "--json"]).json();
        assert_eq!(together["network"], judged["network"]);
        assert_eq!(together["verdict"], judged["verdict"]);
        let listed = linesman(["capture", "filter", first, second, "frame.number == 1002"]);
        assert!(listed.stdout.starts_with("1 of 3,980"), "{}", listed.stdout);
    }
    let apart =
        linesman(["diagnose", text(&parts[0]), text(&parts[1]), "--separate", "--json"]).json();
    assert_eq!(apart["files"].as_array().unwrap().len(), 2);
}
