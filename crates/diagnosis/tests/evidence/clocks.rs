//! Clocks, frames of others, and work that takes too long: what is told of them, and what looks alike.

use crate::support::plant::{PROCESS, Plant, codes, frmw, plant};
use crate::support::script::{Datagram, Script, brd, fprd, fpwr, frame, lrw};
use crate::support::text;
use linesman_config::fault::FaultName;
use linesman_diagnosis::report::{AlternativeReport, Diagnosis, PlaceReport, Severity};
use linesman_diagnosis::{Asked, Direction, Setup};
use linesman_proto::address::{Path, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::mailbox::coe::ObjectAddress;

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

/// The clock of a SubDevice is near, then 20 µs off; before that it may have been gone for a while.
fn pulled_in(was_gone: bool) -> Diagnosis {
    let mut plant = plant();
    plant.ahead(0x1003, 40);
    if was_gone {
        for _ in 0..40 {
            let gone = Datagram { wkc: 0, ..fprd(0x1003, 0x0130, &[0; 6]) };
            plant.script.exchange(&[gone]);
            plant.cycles(5);
        }
        plant.read(0x1003, 0x0130, &[8, 0, 0, 0, 0, 0]);
    }
    plant.cycles(100);
    plant.ahead(0x1003, 4_000);
    plant.cycles(100);
    for ns in [20_000, 22_000, 19_000] {
        plant.ahead(0x1003, ns);
        plant.cycles(100);
    }
    plant.report()
}

// fires: T420
// silent: T420
#[test]
fn a_clock_that_is_pulled_in_after_its_device_was_gone_does_not_drift() {
    let report = pulled_in(false);
    assert_eq!(codes(&report), ["T420"], "{}", text(&report));
    let report = pulled_in(true);
    assert!(!codes(&report).contains(&"T420"), "{}", text(&report));
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

// silent: T421
#[test]
fn a_reference_clock_of_32_bits_comes_round() {
    let mut plant = plant();
    for station in [0x1001, 0x1002, 0x1003] {
        plant.script.exchange(&[fpwr(station, 0x0920, &[0; 8])]);
    }
    plant.time = (1 << 32) - 50_500_000;
    plant.cycles(50);
    plant.time = plant.time.wrapping_sub(1 << 32);
    plant.cycles(50);
    assert!(plant.time < 50_000_000, "it has come round");
    let report = plant.report();
    assert_eq!(codes(&report), <[&str; 0]>::default(), "{}", text(&report));
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

/// How far a clock goes off, in ns, and whether that is told, where nobody steered it for 400 ms: sound quartzes
/// are off by 300 parts per million at most.
const ALONE: [(u32, bool); 2] = [(80_000, false), (400_000, true)];

/// 0x092C of a SubDevice, which is ahead by so many ns.
fn ahead(station: u16, ns: u32) -> Datagram {
    fprd(station, 0x092C, &(ns | 1 << 31).to_le_bytes())
}

// fires: T420
// silent: T420
#[test]
fn a_clock_that_no_frame_steers_is_well_as_long_as_it_goes_off_no_faster_than_a_quartz() {
    for (ns, is_told) in ALONE {
        // No frame hands a time round here: who steers the clocks is not known.
        let mut script = Script::scanned(3);
        for _ in 0..500 {
            script.exchange(&[lrw(PROCESS, 2, 2)]);
        }
        script.exchange(&[ahead(0x1002, 60)]);
        for _ in 0..5_000 {
            script.vanish(&[lrw(PROCESS, 2, 2)]);
        }
        for _ in 0..100 {
            script.exchange(&[lrw(PROCESS, 2, 2)]);
        }
        script.exchange(&[ahead(0x1002, ns)]);
        script.finish();
        let report = script.engine.diagnosis();
        assert_eq!(codes(&report).contains(&"T420"), is_told, "{ns}: {}", text(&report));
    }
}

// fires: T420
// silent: T420
#[test]
fn a_clock_to_which_nobody_hands_a_time_is_well_likewise() {
    for (ns, is_told) in ALONE {
        let mut plant = plant();
        plant.ahead(0x1002, 60);
        for _ in 0..400 {
            plant.time += plant.pace;
            plant.next += 1_000_000;
            plant.script.now = plant.next;
            plant.script.exchange(&[lrw(PROCESS, 2, 2)]);
        }
        plant.cycles(20);
        plant.ahead(0x1002, ns);
        plant.cycles(100);
        let report = plant.report();
        assert_eq!(codes(&report).contains(&"T420"), is_told, "{ns}: {}", text(&report));
    }
}

// silent: T420
#[test]
fn clocks_that_go_off_when_the_reference_does_not_answer_or_has_just_come_back_were_led_astray() {
    // Whether the reference was silent, and for how many cycles it has answered again.
    for (was_silent, back_for, is_told) in [
        (false, None, true),
        (true, None, false),
        (true, Some(20), false),
        (true, Some(2_500), true),
    ] {
        let mut plant = plant();
        plant.ahead(0x1002, 60);
        if was_silent {
            for _ in 0..5 {
                plant.script.exchange(&[fprd(0x1001, 0x0130, &[0; 6]).wkc(0)]);
                plant.cycles(20);
            }
        }
        if let Some(cycles) = back_for {
            plant.script.exchange(&[fprd(0x1001, 0x0130, &[8, 0, 0, 0, 0, 0])]);
            plant.cycles(cycles);
            plant.ahead(0x1002, 60);
        }
        plant.ahead(0x1002, 900_000);
        plant.cycles(100);
        let report = plant.report();
        assert_eq!(codes(&report).contains(&"T420"), is_told, "{back_for:?} {}", text(&report));
    }
}

/// A ring in halves: each copy comes back to its card. The first two SubDevices are in the half of card A.
fn halves(script: &mut Script, datagrams: &[Datagram], other_half: &[Datagram]) {
    for (path, datagrams) in [(Path::A, datagrams), (Path::B, other_half)] {
        script.path = Some(path);
        script.send(datagrams);
        script.now -= 79_999;
    }
    for (path, datagrams) in [(Path::A, datagrams), (Path::B, other_half)] {
        script.path = Some(path);
        script.give_back(datagrams);
    }
    script.index = script.index.wrapping_add(datagrams.len() as u8);
    script.path = None;
}

// fires: T420
// silent: T420
#[test]
fn who_is_in_the_other_half_of_a_ring_gets_no_time_and_is_well_likewise() {
    for (ns, is_told) in ALONE {
        let mut plant = plant();
        plant.ahead(0x1003, 60);
        for _ in 0..400 {
            plant.time += plant.pace;
            plant.next += 1_000_000;
            plant.script.now = plant.next;
            let time = frmw(plant.time).wkc(2);
            let none = Datagram { back: time.sent.clone(), ..frmw(0).wkc(1) };
            let here = [brd(0x0130, &[8, 0], 2), time];
            halves(&mut plant.script, &here, &[brd(0x0130, &[8, 0], 1), none]);
        }
        let there = ahead(0x1003, ns);
        halves(&mut plant.script, &[there.clone().wkc(0)], &[there]);
        let report = plant.report();
        assert_eq!(codes(&report).contains(&"T420"), is_told, "{ns}: {}", text(&report));
    }
}

// fires: T420
// silent: T420
#[test]
fn a_reference_that_goes_otherwise_than_a_clock_that_is_set_right_runs_wrong() {
    // Parts per million; whether somebody is known to follow; whether it is told.
    for (ppm, is_followed, is_told) in
        [(400, true, false), (400, false, true), (700, true, true), (200, false, false)]
    {
        let mut plant = plant();
        if is_followed {
            plant.ahead(0x1002, 60);
        }
        plant.pace = 1_000_000 + ppm;
        plant.cycles(3_000);
        let report = plant.report();
        let told: &[&str] = if is_told { &["T420"] } else { &[] };
        assert_eq!(codes(&report), told, "{ppm}, {is_followed}: {}", text(&report));
        for finding in &report.findings {
            assert!(is_device(&finding.place, 1), "{}", text(&report));
            let host = |other: &AlternativeReport| other.place == Some(PlaceReport::Host);
            assert!(finding.alternatives.iter().any(host), "{}", text(&report));
        }
    }
}

/// Nothing else happens on this line that would have it judged anew.
#[test]
fn live_a_reference_that_runs_wrong_is_told_as_soon_as_its_speed_is_known() {
    let mut plant = plant();
    plant.pace = 1_001_000;
    let mut told = None;
    for cycle in 0..3_000 {
        plant.cycles(1);
        let event = std::iter::from_fn(|| plant.script.engine.poll_event()).next();
        told = told.or(event.filter(|event| event.finding.code == "T420").map(|_| cycle));
    }
    // Four stretches of 200 ms.
    assert!(told.is_some_and(|cycle| cycle < 1_000), "{told:?}");
}

// proves: DC-06
#[test]
fn several_that_lose_synchronisation_far_from_the_reference_have_a_nearer_one_proposed() {
    let proposals = |reference: u16, lost: &[u16]| {
        let mut plant = Plant::led_by(reference, Setup::default());
        for station in lost {
            plant.left_op(*station, 0x1A);
        }
        let report = plant.report();
        let advice = report.findings.iter().flat_map(|finding| finding.actions.clone());
        let all: Vec<String> = advice.filter(|one| one.contains("reference = true")).collect();
        (all, text(&report))
    };
    let (proposed, told) = proposals(0x1003, &[0x1001, 0x1002]);
    assert_eq!(proposed.len(), 2, "at each that lost it: {told}");
    for one in &proposed {
        assert!(one.contains("2 SubDevices lost"), "{one}");
        assert!(one.contains("the reference clock, SubDevice 3"), "where it is now: {one}");
        assert!(one.contains("let SubDevice 1 be it"), "where it would be: {one}");
    }
    // One alone is its own trouble; and nearer than the first nobody is.
    for (reference, lost) in [(0x1003, &[0x1002][..]), (0x1001, &[0x1002, 0x1003])] {
        let (proposed, told) = proposals(reference, lost);
        assert_eq!(proposed, <[String; 0]>::default(), "{told}");
    }
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

#[test]
fn who_only_clears_counters_makes_no_subdevice_leave_its_state() {
    let of = |ado| Datagram { command: Command::Bwr, sent: vec![0, 0], ..brd(ado, &[0, 0], 3) };
    // Whoever writes AL control may have made it leave OP; error counters do nothing to it.
    for (ado, expected) in [(0x0120, vec!["C330"]), (0x0300, vec!["T400", "C330"])] {
        let mut plant = plant();
        for _ in 0..4 {
            other(&mut plant.script, &of(ado), Direction::Received);
            plant.cycles(20);
        }
        plant.left_op(0x1003, 0x1A);
        let report = plant.report();
        assert_eq!(codes(&report), expected, "{}", text(&report));
        let other = report.findings.iter().find(|finding| finding.code == "C330").unwrap();
        let is_harmless = other.severity == Severity::Warning;
        assert_eq!(is_harmless, ado == 0x0300, "{}", text(&report));
    }
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
