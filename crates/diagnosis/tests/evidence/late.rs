//! Frames that come late or stay away for a while, watchdogs that are too short, links that are up too early:
//! what is told of them, and what looks alike.

use crate::support::plant::{Plant, codes, plant};
use crate::support::script::{Script, fprd, fpwr, lrw};
use crate::support::text;
use linesman_config::fault::FaultName;
use linesman_diagnosis::report::{Diagnosis, FindingReport, Severity};
use linesman_diagnosis::{HostEvent, HostObservation, Setup};
use linesman_proto::address::{Network, Path};
use linesman_proto::time::Instant;

// fires: T411
#[test]
fn one_frame_that_comes_back_late_is_told_without_alarm() {
    let mut plant = plant();
    plant.late_cycles(&[300]);
    plant.cycles(50);
    let report = plant.report();
    assert_eq!(codes(&report), ["T411"], "{}", text(&report));
    let finding = &report.findings[0];
    assert_eq!((finding.severity, finding.cause), (Severity::Info, FaultName::HostJitter));
    assert!(finding.evidence[0].text.contains("0.300 ms"), "{}", finding.evidence[0].text);
}

/// A recording of a line where nobody keeps step, in which one frame comes back so much later than the others.
fn recorded(late_ns: u64) -> Diagnosis {
    let mut script = Script::scanned(2);
    let data = [lrw(0x0100_0000, 8, 3)];
    let mut next = script.now;
    for cycle in 0..700 {
        next = (next + 1_000_000).max(script.now);
        script.now = next;
        script.send(&data);
        script.now += if cycle == 650 { late_ns } else { 0 };
        script.give_back(&data);
        script.index = script.index.wrapping_add(1);
    }
    script.finish();
    script.engine.diagnosis()
}

// fires: T411
// silent: T411
#[test]
fn a_recording_notes_frames_that_are_late_by_a_tenth_of_the_cycle_where_nobody_keeps_step() {
    for (late_ns, shown) in
        [(1_300_000, "1.300 ms at most, 130 %"), (300_000, "0.300 ms at most, 30 %")]
    {
        let report = recorded(late_ns);
        assert_eq!(codes(&report), ["T411"], "{}", text(&report));
        let finding = &report.findings[0];
        assert_eq!(finding.severity, Severity::Info);
        let [frame, harm] = &finding.evidence[..] else { panic!("{}", text(&report)) };
        assert!(frame.text.starts_with("one frame came back"), "{}", frame.text);
        assert!(frame.text.contains(shown), "{}", frame.text);
        assert!(harm.text.contains("nobody missed them"), "{}", harm.text);
    }
    // Less is what times of recordings wander by.
    let report = recorded(90_000);
    assert!(codes(&report).is_empty(), "{}", text(&report));
}

/// Whether a finding with this code hangs beneath another, at whatever remove.
fn hangs(root: &FindingReport, code: &str) -> bool {
    root.consequences.iter().any(|beneath| beneath.code == code || hangs(beneath, code))
}

// fires: T411
#[test]
fn when_most_frames_are_late_they_wait_in_a_queue_and_a_lost_step_hangs_beneath() {
    let mut plant = plant();
    let late: Vec<u64> = (0..60).map(|nth| 70 + nth * 53 % 500).collect();
    plant.late_cycles(&late);
    plant.left_op(0x1002, 0x1A);
    plant.cycles(50);
    let report = plant.report();
    let finding = report.findings.iter().find(|finding| finding.code == "T411");
    assert!(report.findings.iter().any(|root| hangs(root, "T400")), "{}", text(&report));
    // Beside the finding of uneven process data it is what that consists of.
    match finding {
        Some(finding) => assert_eq!(finding.cause, FaultName::LateFrames, "{}", text(&report)),
        None => assert!(hangs(&report.findings[0], "T411"), "{}", text(&report)),
    }
}

// silent: T411
#[test]
fn a_way_that_is_longer_from_now_on_is_not_late() {
    let mut plant = plant();
    plant.late_cycles(&[100; 200]);
    let report = plant.report();
    assert_eq!(codes(&report), <[&str; 0]>::default(), "{}", text(&report));
}

fn watchdog(plant: &mut Plant, ticks: u16) {
    plant.script.exchange(&[fpwr(0x1002, 0x0420, &ticks.to_le_bytes())]);
    plant.cycles(50);
}

// fires: S203
#[test]
fn a_watchdog_of_two_cycles_is_too_short() {
    let mut plant = plant();
    watchdog(&mut plant, 20);
    let report = plant.report();
    assert_eq!(codes(&report), ["S203"], "{}", text(&report));
    assert_eq!(report.findings[0].severity, Severity::Warning);
    watchdog(&mut plant, 3);
    let report = plant.report();
    assert_eq!(report.findings[0].severity, Severity::Error, "{}", text(&report));
}

// silent: S203
#[test]
fn a_watchdog_of_many_cycles_or_none_is_not() {
    for ticks in [0, 50, 1_000] {
        let mut plant = plant();
        watchdog(&mut plant, ticks);
        let report = plant.report();
        assert_eq!(codes(&report), <[&str; 0]>::default(), "{ticks}: {}", text(&report));
    }
}

/// Counters of all: the first port of the second SubDevice lost its link so often.
fn counters(plant: &mut Plant, links_lost: u8) {
    for station in 0x1001..=0x1003 {
        let mut data = [0; 20];
        data[16] = if station == 0x1002 { links_lost } else { 0 };
        plant.read(station, 0x0300, &data);
        plant.cycles(10);
    }
}

/// For a while no frame comes back; error counters are read before and after it.
fn all_lost_for_a_while(plant: &mut Plant, links_lost: u8) -> Diagnosis {
    counters(plant, 0);
    plant.lost_cycles(40);
    plant.cycles(50);
    counters(plant, links_lost);
    plant.report()
}

// fires: X513
#[test]
fn frames_that_all_stay_away_while_nothing_moves_on_the_line_and_the_card_takes_none_did_not_leave()
{
    let mut plant = plant();
    counters(&mut plant, 0);
    plant.lost_cycles(40);
    plant.script.engine.handle_host(&HostObservation {
        network: Network(0),
        path: Path::A,
        time: Instant::from_nanos(plant.script.now),
        what: HostEvent::SendFailures(40),
    });
    plant.cycles(50);
    counters(&mut plant, 0);
    let report = plant.report();
    let stalled = report.findings.iter().find(|one| one.code == "X513");
    let stalled = stalled.unwrap_or_else(|| panic!("{}", text(&report)));
    assert_eq!(stalled.cause, FaultName::WatchdogStarved);
}

/// A recording has no frames that the card did not take.
// silent: X513
// fires: H100
#[test]
fn frames_of_a_recording_that_all_stay_away_while_nothing_moves_on_the_line_were_sent() {
    let mut plant = plant();
    let report = all_lost_for_a_while(&mut plant, 0);
    assert_eq!(codes(&report), ["H100"], "{}", text(&report));
    assert_eq!(report.findings[0].cause, FaultName::FalseLink);
}

// silent: X513
// fires: H100
#[test]
fn a_card_that_is_watched_and_refused_nothing_sent_them_and_nobody_answered() {
    let mut plant = Plant::new(Setup { host_counters: true, ..Setup::default() });
    let report = all_lost_for_a_while(&mut plant, 0);
    assert_eq!(codes(&report), ["H100"], "{}", text(&report));
}

/// A recording of a line where nobody keeps step: cycles of 1 ms, each sent so many µs after its time.
fn cycles(script: &mut Script, late_us: &[u64]) {
    let begin = script.now;
    for (late, nth) in late_us.iter().zip(1..) {
        script.now = begin + nth * 1_000_000 + late * 1_000;
        script.exchange(&[lrw(0x0100_0000, 8, 3)]);
    }
}

// fires: X513
// silent: X513
#[test]
fn a_recording_in_which_nothing_was_sent_for_a_while_is_a_note_unless_a_link_was_lost() {
    for (ms, links_lost, is_noted) in [(60, 0, true), (8, 0, false), (60, 1, false)] {
        let mut script = Script::scanned(2);
        cycles(&mut script, &[0; 200]);
        script.now += ms * 1_000_000;
        cycles(&mut script, &[0; 200]);
        for station in [0x1001, 0x1002] {
            let mut counters = [0; 20];
            counters[16] = links_lost;
            script.exchange(&[fprd(station, 0x0300, &counters)]);
        }
        script.finish();
        let report = script.engine.diagnosis();
        let noted = report.findings.iter().find(|one| one.code == "X513");
        assert_eq!(noted.is_some(), is_noted, "{ms} ms, {links_lost}: {}", text(&report));
        assert!(noted.is_none_or(|note| note.severity == Severity::Info), "{}", text(&report));
    }
}

// fires: T410
// silent: T410
#[test]
fn a_recording_notes_frames_that_came_to_the_card_unevenly_where_nobody_keeps_step() {
    for (late, is_noted) in [(300, true), (120, true), (80, false)] {
        let mut script = Script::scanned(2);
        let times: Vec<u64> =
            (0..400).map(|nth| if nth > 300 && nth % 20 == 0 { late } else { 0 }).collect();
        cycles(&mut script, &times);
        script.finish();
        let report = script.engine.diagnosis();
        let noted = report.findings.iter().find(|one| one.code == "T410");
        assert_eq!(noted.is_some(), is_noted, "{late} µs: {}", text(&report));
        let is_note = |note: &FindingReport| {
            note.severity == Severity::Info && note.cause == FaultName::HostJitter
        };
        assert!(noted.is_none_or(is_note), "{}", text(&report));
    }
}

// silent: X513
#[test]
fn with_a_link_that_was_lost_meanwhile_it_is_not_the_computer() {
    let mut plant = plant();
    let report = all_lost_for_a_while(&mut plant, 1);
    assert!(!codes(&report).contains(&"X513"), "{}", text(&report));
}

/// A frame that was just being sent on when a link behind opened is cut off: who comes next counts it.
#[test]
fn a_frame_cut_off_by_a_link_that_opens_is_no_damage_of_the_next_link() {
    for is_lost in [true, false] {
        let mut plant = plant();
        counters(&mut plant, 0);
        let value: u16 = if is_lost { 0x5617 } else { 0x5A37 };
        plant.read(0x1002, 0x0110, &value.to_le_bytes());
        plant.lost_cycles(1);
        plant.cycles(20);
        for station in 0x1001..=0x1003 {
            let mut data = [0; 20];
            match station {
                // An invalid frame at port B, which faces the second.
                0x1001 => data[2] = 1,
                0x1002 => data[17] = u8::from(is_lost),
                _ => {}
            }
            plant.read(station, 0x0300, &data);
            plant.cycles(10);
        }
        plant.read(0x1002, 0x0110, &0x5A37_u16.to_le_bytes());
        plant.cycles(50);
        let report = plant.report();
        let damage = codes(&report).iter().any(|code| code.starts_with("H11"));
        assert_eq!(damage, !is_lost, "{}", text(&report));
    }
}

/// The link between the second and the third SubDevice is lost for a while; so many frames vanish when it is
/// back.
fn link_lost_and_back(vanish: usize) -> Plant {
    let mut plant = plant();
    lose_link(&mut plant, vanish);
    plant
}

fn lose_link(plant: &mut Plant, vanish: usize) {
    let status = |plant: &mut Plant, value: u16| plant.read(0x1002, 0x0110, &value.to_le_bytes());
    status(plant, 0x5617);
    plant.cycles(30);
    plant.lost_cycles(vanish);
    plant.cycles(10);
    status(plant, 0x5A37);
    plant.cycles(100);
}

// fires: H103
#[test]
fn a_link_that_swallows_all_frames_when_it_is_back_was_up_too_early() {
    let mut plant = link_lost_and_back(20);
    let report = plant.report();
    assert_eq!(codes(&report), ["H103"], "{}", text(&report));
    let finding = &report.findings[0];
    assert_eq!(finding.cause, FaultName::EarlyLink);
    assert!(finding.consequences.iter().any(|one| one.code == "H101"), "{}", text(&report));
}

// silent: H103
#[test]
fn a_link_that_is_lost_and_carries_frames_at_once_is_just_lost() {
    let mut plant = link_lost_and_back(1);
    let report = plant.report();
    assert_eq!(codes(&report), ["H101"], "{}", text(&report));
}

// silent: H103
#[test]
fn frames_that_were_damaged_elsewhere_were_not_swallowed_by_a_link() {
    let mut plant = plant();
    let counters = |plant: &mut Plant, frames: u8| {
        for station in 0x1001..=0x1003 {
            let mut data = [0; 20];
            // Port A of the second one: frames and symbols.
            data[..2].fill(if station == 0x1002 { frames } else { 0 });
            plant.read(station, 0x0300, &data);
        }
    };
    counters(&mut plant, 0);
    lose_link(&mut plant, 20);
    counters(&mut plant, 20);
    plant.cycles(100);
    counters(&mut plant, 20);
    let report = plant.report();
    assert_eq!(codes(&report), ["H101", "H110"], "{}", text(&report));
}
