//! Clocks, frames of others, and work that takes too long: what is told of them, and what looks alike.

#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]

mod support;

use linesman_config::fault::FaultName;
use linesman_diagnosis::report::{PlaceReport, Severity};
use linesman_diagnosis::{Asked, Direction, Setup};
use linesman_proto::address::RegisterAddress;
use linesman_proto::command::Command;
use linesman_proto::mailbox::coe::ObjectAddress;
use support::plant::{PROCESS, Plant, codes, plant};
use support::script::{Datagram, Script, brd, fpwr, frame, lrw};
use support::text;

fn is_device(place: &PlaceReport, number: u32) -> bool {
    matches!(place, PlaceReport::Device { no, .. } if u64::from(*no) == u64::from(number))
}

// fires: T420
#[test]
fn one_clock_that_goes_astray_drifts_and_what_it_misses_hangs_beneath() {
    let mut plant = plant();
    for ns in [40, 100_000, 300_000] {
        plant.ahead(0x1002, ns);
        plant.ahead(0x1003, 60);
        plant.cycles(200);
    }
    plant.left_op(0x1002, 0x1A);
    let report = plant.report();
    assert_eq!(codes(&report), ["T420"], "{}", text(&report));
    let finding = &report.findings[0];
    assert_eq!(finding.cause, FaultName::ClockDrift);
    assert!(is_device(&finding.place, 2), "{}", text(&report));
    assert_eq!(finding.consequences[0].code, "T400", "{}", text(&report));
    assert!(finding.evidence[0].text.contains("1000 parts"), "{}", finding.evidence[0].text);
}

// fires: T420
#[test]
fn when_all_that_follow_go_astray_with_it_the_reference_runs_wrong() {
    let mut plant = plant();
    plant.pace = 1_001_000;
    for ns in [40, 200_000, 600_000, 1_000_000] {
        plant.read(0x1002, 0x092C, &u32::to_le_bytes(ns));
        plant.read(0x1003, 0x092C, &u32::to_le_bytes(ns));
        plant.cycles(400);
    }
    let report = plant.report();
    assert_eq!(codes(&report), ["T420"], "{}", text(&report));
    assert!(is_device(&report.findings[0].place, 1), "{}", text(&report));
}

// silent: T420
// silent: T421
#[test]
fn clocks_that_stay_near_or_are_set_are_no_finding() {
    let mut plant = plant();
    for ns in [40, 900, 3_000, 500] {
        plant.ahead(0x1002, ns);
        plant.cycles(200);
    }
    // A new offset: what it is off then, and that its time jumps, is the doing of whoever set it.
    for station in [0x1001, 0x1002] {
        plant.script.exchange(&[fpwr(station, 0x0920, &[0; 8])]);
    }
    plant.time = 5_000;
    plant.ahead(0x1002, 900_000);
    plant.cycles(200);
    let report = plant.report();
    assert_eq!(codes(&report), <[&str; 0]>::default(), "{}", text(&report));
}

// fires: T421
#[test]
fn a_reference_clock_that_stands_is_lost_and_leads_all_others_astray() {
    let mut plant = plant();
    plant.ahead(0x1002, 40);
    plant.pace = 0;
    plant.cycles(20);
    plant.ahead(0x1002, 900_000);
    plant.left_op(0x1003, 0x2C);
    let report = plant.report();
    assert_eq!(codes(&report), ["T421"], "{}", text(&report));
    let finding = &report.findings[0];
    assert_eq!(finding.cause, FaultName::ReferenceClockLost);
    assert!(is_device(&finding.place, 1), "{}", text(&report));
    assert_eq!(finding.consequences[0].code, "T400", "{}", text(&report));
}

#[test]
fn a_reference_clock_that_goes_back_is_lost() {
    let mut plant = plant();
    plant.time = 1_000;
    plant.cycles(20);
    let report = plant.report();
    assert_eq!(codes(&report), ["T421"], "{}", text(&report));
    assert!(report.findings[0].evidence[0].text.contains("went back"), "{}", text(&report));
}

#[test]
fn work_that_takes_too_long_is_told_from_signals_that_do_not_come_by_code() {
    for (code, cause) in [(0x1A, FaultName::CycleTooFast), (0x2C, FaultName::SyncLost)] {
        let mut plant = plant();
        plant.left_op(0x1003, code);
        let report = plant.report();
        assert_eq!(codes(&report), ["T400"], "{}", text(&report));
        assert_eq!(report.findings[0].cause, cause);
    }
}

#[test]
fn live_the_diagnosis_asks_for_clocks_and_for_what_a_subdevice_counts_of_its_cycles() {
    let mut plant = Plant::new(Setup { probes: true, ..Setup::default() });
    plant.cycles(500);
    let asked = |plant: &mut Plant| -> Vec<Asked> {
        let engine = &mut plant.script.engine;
        std::iter::from_fn(|| engine.poll_probe()).map(|probe| probe.what).collect()
    };
    let difference = Asked::Register { address: RegisterAddress(0x092C), len: 4 };
    assert!(asked(&mut plant).contains(&difference));
    plant.left_op(0x1003, 0x1A);
    plant.cycles(20);
    let exceeded = Asked::Object(ObjectAddress::new(0x1C32, 0x0C));
    assert!(asked(&mut plant).contains(&exceeded));
}

/// A frame of somebody else comes back.
fn other(script: &mut Script, datagram: &Datagram, direction: Direction) {
    let mut bytes = frame(std::slice::from_ref(datagram), script.index, true);
    bytes[11] = 0x77;
    script.index = script.index.wrapping_add(1);
    script.feed(&bytes, direction, 10_000);
}

// fires: C330
#[test]
fn one_frame_that_nobody_here_sent_is_a_second_maindevice_live() {
    let mut plant = plant();
    other(&mut plant.script, &brd(0x0130, &[8, 0], 3), Direction::Received);
    plant.cycles(50);
    let report = plant.report();
    assert_eq!(codes(&report), ["C330"], "{}", text(&report));
    assert_eq!(report.findings[0].severity, Severity::Warning, "it only reads");
}

// fires: C330
#[test]
fn in_a_recording_it_takes_four_and_what_it_orders_is_its_doing() {
    let mut script = Script::scanned(3);
    for _ in 0..50 {
        script.exchange(&[lrw(PROCESS, 2, 2)]);
    }
    let order = Datagram { command: Command::Bwr, sent: vec![2, 0], ..brd(0x0120, &[2, 0], 3) };
    for _ in 0..4 {
        other(&mut script, &order, Direction::Unknown);
    }
    for _ in 0..150 {
        script.exchange(&[lrw(PROCESS, 2, 2)]);
    }
    script.finish();
    let report = script.engine.diagnosis();
    assert_eq!(codes(&report), ["C330"], "{}", text(&report));
    assert_eq!(report.findings[0].severity, Severity::Error, "it writes");
}

/// An address resolution request of an office computer.
fn office_frame() -> Vec<u8> {
    let mut bytes = vec![0xFF; 6];
    bytes.extend([0x00, 0x1B, 0x21, 0x01, 0x02, 0x03, 0x08, 0x06]);
    bytes.resize(60, 0);
    bytes
}

// fires: C333
#[test]
fn a_frame_that_is_not_ethercat_and_comes_in_is_told() {
    let mut plant = plant();
    plant.script.feed(&office_frame(), Direction::Received, 10_000);
    plant.cycles(50);
    let report = plant.report();
    assert_eq!(codes(&report), ["C333"], "{}", text(&report));
    assert_eq!(report.findings[0].severity, Severity::Warning);
    assert!(report.findings[0].evidence[0].text.contains("ARP"), "{}", text(&report));
}

fn counters(plant: &mut Plant, port_errors: u8, unit_errors: u8) {
    for station in 0x1001..=0x1003 {
        let mut data = [0; 20];
        if station == 0x1001 {
            (data[0], data[12]) = (port_errors, unit_errors);
        }
        plant.read(station, 0x0300, &data);
        plant.cycles(20);
    }
}

// fires: C333
#[test]
fn frames_that_a_processing_unit_destroys_with_clean_ports_are_foreign() {
    let mut plant = plant();
    counters(&mut plant, 0, 0);
    counters(&mut plant, 0, 5);
    let report = plant.report();
    assert_eq!(codes(&report), ["C333"], "{}", text(&report));
    assert_eq!(report.findings[0].cause, FaultName::ForeignFrames);
}

// silent: C333
#[test]
fn a_processing_unit_that_finds_damaged_frames_says_nothing_of_foreign_ones() {
    let mut plant = plant();
    counters(&mut plant, 0, 0);
    counters(&mut plant, 5, 5);
    let report = plant.report();
    assert!(!codes(&report).contains(&"C333"), "{}", text(&report));
}
