//! `linesman lab replay`: recordings of real lines, whole, cut, doubled, one-sided, and what is none.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use crate::support::capture::{HEADER, Pcap};
use crate::support::{assert_valid, linesman};
use serde_json::Value;
use tempfile::TempDir;

/// The recordings; none, said aloud, where they are not.
fn captures() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let data = std::env::var_os("LINESMAN_DATA").map_or(root, PathBuf::from);
    let Ok(entries) = fs::read_dir(data.join("pcap")) else {
        eprintln!("SKIPPED: no captures in {}; set LINESMAN_DATA", data.display());
        return Vec::new();
    };
    let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    paths.sort();
    paths
}

fn replay(path: &Path) -> (i32, Value) {
    let run = linesman(["lab".as_ref(), "replay".as_ref(), path.as_os_str(), "--json".as_ref()]);
    let report = run.json();
    assert_valid(&report, "replay");
    (run.status, report)
}

fn number(report: &Value, field: &str) -> u64 {
    report[field].as_u64().unwrap_or_else(|| panic!("{field}: {report}"))
}

/// The datagrams that agree but for a class, of those that are no time and no counter.
fn without_field(report: &Value) -> Vec<&str> {
    let exempt = report["equal_but"].as_array().unwrap();
    let reasons = exempt.iter().filter_map(|one| one["reason"].as_str());
    reasons.filter(|reason| !["time", "counter"].contains(reason)).collect()
}

#[test]
fn every_recording_comes_out_the_same() {
    for path in captures() {
        let (status, report) = replay(&path);
        let name = path.display();
        if name.to_string().contains("no-slaves") {
            assert_eq!((status, &report["verdict"]), (2, &"nothing judged".into()), "{name}");
            assert_eq!(number(&report, "unanswered"), 19, "{name}");
            continue;
        }
        assert_eq!((status, &report["verdict"]), (0, &"agrees".into()), "{name}: {report}");
        assert_eq!(number(&report, "different"), 0, "{name}");
        assert!(number(&report, "compared") > 0, "{name}");
        let bytes = without_field(&report);
        assert!(bytes.iter().all(|one| *one == "closing byte of a mailbox"), "{name}: {bytes:?}");
    }
}

/// Records of a classic capture, whose frames are of 60 bytes each: one request and one return a ms.
fn made(exchanges: u64) -> (Vec<u8>, Vec<Vec<u8>>) {
    let mut capture = Pcap::new();
    capture.exchanges(exchanges);
    let records = capture.0[HEADER..].chunks(16 + 60).map(<[u8]>::to_vec).collect();
    (capture.0[..HEADER].to_vec(), records)
}

fn written(directory: &TempDir, name: &str, parts: &[&[u8]]) -> PathBuf {
    let path = directory.path().join(name);
    fs::write(&path, parts.concat()).unwrap();
    path
}

#[test]
fn a_recording_may_be_doubled_mixed_and_cut_off() {
    let directory = TempDir::new().unwrap();
    let (header, records) = made(50);
    let whole = written(&directory, "whole.pcap", &[&header, &records.concat()]);
    let (status, report) = replay(&whole);
    assert_eq!((status, number(&report, "compared")), (0, 50), "{report}");

    let twice: Vec<u8> =
        records.iter().flat_map(|one| [one.clone(), one.clone()].concat()).collect();
    let (status, report) = replay(&written(&directory, "twice.pcap", &[&header, &twice]));
    assert_eq!((status, number(&report, "compared")), (0, 50), "{report}");

    // An ARP frame behind each.
    let mut other = records[0].clone();
    other[16 + 12..16 + 14].copy_from_slice(&[0x08, 0x06]);
    let mixed: Vec<u8> =
        records.iter().flat_map(|one| [one.clone(), other.clone()].concat()).collect();
    let (status, report) = replay(&written(&directory, "mixed.pcap", &[&header, &mixed]));
    assert_eq!((status, number(&report, "compared")), (0, 50), "{report}");
    assert_eq!(number(&report, "other_traffic"), 100, "{report}");

    // In the middle of a record: what was before is played, and the end is told.
    let all = records.concat();
    let cut = written(&directory, "cut.pcap", &[&header, &all[..all.len() - 90]]);
    let run = linesman(["lab".as_ref(), "replay".as_ref(), cut.as_os_str()]);
    assert_eq!(run.status, 0, "{}", run.all());
    assert!(run.stdout.contains("All answers agree: 49 datagrams."), "{}", run.all());
    assert!(run.stderr.contains("cut.pcap"), "{}", run.all());
}

#[test]
fn one_direction_alone_is_not_judged_and_says_why() {
    let directory = TempDir::new().unwrap();
    let (header, records) = made(50);
    for (name, from, counted, said) in [
        ("requests.pcap", 0, "unanswered", "only one direction was recorded"),
        ("returns.pcap", 1, "returns_alone", "only frames that came back"),
    ] {
        let half: Vec<u8> =
            records.iter().skip(from).step_by(2).flat_map(|one| one.iter().copied()).collect();
        let path = written(&directory, name, &[&header, &half]);
        let (status, report) = replay(&path);
        assert_eq!((status, number(&report, counted)), (2, 50), "{name}: {report}");
        let run = linesman(["lab".as_ref(), "replay".as_ref(), path.as_os_str()]);
        assert!(run.stdout.contains(said), "{name}: {}", run.all());
    }
}

#[test]
fn an_answer_that_no_device_gives_is_a_difference() {
    let directory = TempDir::new().unwrap();
    let (header, mut records) = made(50);
    // The last return says that three answered, where all others say two.
    let last = records.last_mut().unwrap();
    last[16 + 28] = 3;
    let path = written(&directory, "wrong.pcap", &[&header, &records.concat()]);
    let (status, report) = replay(&path);
    assert_eq!((status, &report["verdict"]), (1, &"differs".into()), "{report}");
    assert_eq!((number(&report, "different"), number(&report, "unexplained")), (1, 1), "{report}");
    let what = report["differences"][0]["what"].as_str().unwrap();
    assert_eq!(what, "BRD 0x0130 AL status: working counter");
}

#[test]
fn what_is_no_recording_is_refused_with_its_name() {
    let directory = TempDir::new().unwrap();
    let (header, records) = made(2);
    let mut other = records[0].clone();
    other[16 + 12..16 + 14].copy_from_slice(&[0x08, 0x06]);
    let rows: [(&str, &[u8]); 4] = [
        ("empty.pcap", &[]),
        ("text.pcapng", b"this is no capture, whatever its name says"),
        ("nothing.pcap", &header),
        ("other.pcap", &[header.clone(), other].concat()),
    ];
    for (name, bytes) in rows {
        let path = written(&directory, name, &[bytes]);
        let run = linesman(["lab".as_ref(), "replay".as_ref(), path.as_os_str()]);
        assert_eq!(run.status, 2, "{name}: {}", run.all());
        assert!(run.stderr.contains(name), "{name}: {}", run.all());
    }
    let run = linesman(["lab", "replay", "missing.pcapng"].map(OsStr::new));
    assert_eq!(run.status, 2);
    assert!(run.stderr.contains("missing.pcapng"), "{}", run.all());
}
