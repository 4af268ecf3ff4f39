//! Examples, each run as a program of its own would be.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![allow(dead_code, unreachable_pub, reason = "examples are programs of their own, too")]

use std::path::Path;
use std::process::Command;

use linesman::prelude::*;

#[path = "../examples/blink.rs"]
mod blink;
#[path = "../examples/drive.rs"]
mod drive;
#[path = "../examples/findings.rs"]
mod findings;
#[path = "../examples/own_maindevice.rs"]
mod own_maindevice;
#[path = "../examples/ring.rs"]
mod ring;
#[path = "../examples/sdo_beside.rs"]
mod sdo_beside;

fn machine(devices: &[(&str, &str)]) -> SegmentFile {
    SegmentFile::in_a_row("machine", 1, devices)
}

#[test]
fn blink_example_runs_five_thousand_good_cycles() {
    let devices = [("K1", "EK1100"), ("Buttons", "EL1008"), ("Lamps", "EL2008")];
    let mut segment = Segment::simulated(&machine(&devices)).unwrap();
    let report = blink::blink(&mut segment).unwrap();
    assert!(report.counts.cycles >= 5_000, "{}", report.counts.cycles);
    assert_eq!(report.counts.working_counter_errors, 0);
}

#[test]
fn drive_example_turns_the_drive_to_and_fro() {
    let mut segment = Segment::simulated(&machine(&[("Drive", "CiA402-Drive")])).unwrap();
    let positions = drive::turn(&mut segment).unwrap();
    assert_eq!(positions.len(), 30);
    let (least, most) = (positions.iter().min().unwrap(), positions.iter().max().unwrap());
    assert!(most - least > 1_000, "{positions:?}");
}

#[test]
fn sdo_example_reads_identity_and_name_beside_the_cycle() {
    let devices = [("K1", "EK1100"), ("Sensor", "EL3104")];
    let mut segment = Segment::simulated(&machine(&devices)).unwrap();
    let (product, name) = sdo_beside::ask(&mut segment).unwrap();
    assert_eq!(product, 0x0C20_3052, "{product:#x}");
    assert_eq!(name, "EL3104");
}

#[test]
fn ring_example_keeps_data_and_says_where_the_ring_was_open() {
    let mut segment = Segment::simulated(&SegmentFile::parse(ring::RING).unwrap()).unwrap();
    let (found, bad) = ring::break_and_mend(&mut segment).unwrap();
    assert!(bad < 20, "the lamps had no good data in {bad} cycles");
    let has = |change: &str| {
        found.iter().any(|line| line.starts_with(change) && line.contains("1.C - 2.A"))
    };
    assert!(has("Confirmed") && has("Closed"), "{found:#?}");
}

#[test]
fn findings_example_tells_opening_closing_place_and_evidence() {
    let devices = [("K1", "EK1100"), ("In", "EL1008"), ("Out", "EL2008"), ("In2", "EL1008")];
    let mut segment = Segment::simulated(&machine(&devices)).unwrap();
    let cut = linesman::FaultEntry::new(linesman::FaultName::LinkOpen).at("In.B-Out.A");
    segment.inject(&cut.from_to(1_000.0, Some(3_000.0))).unwrap();
    let mut lines = Vec::new();
    let report = findings::watch(&mut segment, |line| lines.push(line)).unwrap();
    let starts = |start: &str| lines.iter().any(|line| line.starts_with(start));
    assert!(starts("Opened") && starts("Closed"), "{lines:#?}");
    assert!(lines.iter().any(|line| line.contains("at link 2.B - 3.A")), "{lines:#?}");
    let evidence = "  SubDevice 2 lost the link of port B once";
    assert!(starts(evidence), "{lines:#?}");
    let diagnosis = report.diagnosis.unwrap();
    assert!(
        diagnosis.findings.iter().any(|finding| finding.cause == linesman::FaultName::LinkOpen)
    );
}

#[test]
fn own_maindevice_example_counts_who_is_there_before_and_after_the_fault() {
    let devices = [("K1", "EK1100"), ("Buttons", "EL1008"), ("Lamps", "EL2008")];
    let (counts, diagnosis) = own_maindevice::poll(&machine(&devices)).unwrap();
    assert_eq!(counts.first(), Some(&3));
    assert_eq!(counts.last(), Some(&2));
    // The diagnosis listens beside another MainDevice, and says which by its requests.
    assert!(diagnosis.main_device.is_some());
}

/// Runs an example as cargo builds it before it runs all tests of a crate; gives what it prints.
fn program(name: &str, folder: &Path) -> String {
    let test = std::env::current_exe().unwrap();
    let built = test.ancestors().nth(2).unwrap().join("examples").join(name);
    assert!(built.exists(), "{}: build it with `cargo build --examples`", built.display());
    let run = Command::new(built).current_dir(folder).output().unwrap();
    assert!(run.status.success(), "{name}: {}", String::from_utf8_lossy(&run.stderr));
    String::from_utf8(run.stdout).unwrap()
}

#[test]
fn example_programs_end_without_an_error() {
    let folder = std::env::temp_dir();
    for name in ["blink", "drive", "findings", "own_maindevice", "ring", "sdo_beside"] {
        assert!(!program(name, &folder).is_empty(), "{name} prints nothing");
    }
}

#[test]
fn first_program_prints_the_cut_cable() {
    let folder = std::env::temp_dir().join(format!("linesman-first-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("line.toml"), include_str!("../examples/line.toml")).unwrap();
    let text = program("first_finding", &folder);
    std::fs::remove_dir_all(&folder).unwrap();
    assert!(text.contains("link-open at link 2.B - 3.A"), "{text}");
}
