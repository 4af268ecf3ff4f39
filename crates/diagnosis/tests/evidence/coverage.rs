//! Healthy is earned: one missing piece of evidence, and the same line is not called healthy any more.

use crate::support::script::{Script, brd, fprd, fpwr, lrw};
use crate::support::text;
use linesman_diagnosis::report::{Diagnosis, Verdict};
use linesman_proto::address::{LogicalAddress, RegisterAddress};
use linesman_proto::register::FmmuConfig;

const PROCESS: u32 = 0x0100_0000;
/// Both SubDevices that have process data answer.
const ALL: u16 = 3;

/// Three SubDevices, scanned and brought to OP: the second gives inputs, the third takes outputs.
fn running() -> Script {
    let mut script = Script::scanned(3);
    let inputs = FmmuConfig::inputs(LogicalAddress(PROCESS), 2, RegisterAddress(0x1180));
    let outputs = FmmuConfig::outputs(LogicalAddress(PROCESS + 2), 2, RegisterAddress(0x1100));
    script.exchange(&[fpwr(0x1002, 0x0600, &inputs.to_bytes())]);
    script.exchange(&[fpwr(0x1003, 0x0600, &outputs.to_bytes())]);
    for station in 0x1001..=0x1003 {
        raise(&mut script, station, &[4, 8]);
    }
    script.exchange(&[brd(0x0130, &[8, 0], 3)]);
    cycles(&mut script);
    script
}

/// Orders a SubDevice from state to state, and reads that it got there.
fn raise(script: &mut Script, station: u16, states: &[u8]) {
    for state in states {
        script.exchange(&[fpwr(station, 0x0120, &[*state, 0])]);
        script.exchange(&[fprd(station, 0x0130, &[*state, 0, 0, 0, 0, 0])]);
    }
}

fn cycles(script: &mut Script) {
    for _ in 0..200 {
        script.exchange(&[lrw(PROCESS, 4, ALL)]);
    }
}

fn report(mut script: Script) -> Diagnosis {
    cycles(&mut script);
    script.finish();
    script.engine.diagnosis()
}

/// Not healthy, without a finding, and a gap that says this.
#[track_caller]
fn lacks(script: Script, words: &str) {
    let report = report(script);
    let said = text(&report);
    assert_eq!(report.verdict, Verdict::Inconclusive, "{said}");
    assert!(said.contains(words), "{words}: {said}");
}

#[test]
fn a_line_of_which_all_was_seen_is_healthy() {
    let report = report(running());
    assert_eq!(report.verdict, Verdict::Healthy, "{}", text(&report));
}

#[test]
fn a_station_address_that_nobody_answers_at_is_missed_even_if_asked_once() {
    let mut script = running();
    script.exchange(&[fprd(0x1004, 0x0130, &[0, 0]).wkc(0)]);
    lacks(script, "nobody answered at station address 0x1004");
}

#[test]
fn one_lost_frame_of_a_short_recording_is_not_passed_over() {
    let mut script = running();
    script.vanish(&[lrw(PROCESS, 4, ALL)]);
    lacks(script, "1 frame did not come back, and nothing tells where");
}

#[test]
fn a_subdevice_that_does_not_take_a_request_is_told() {
    let mut script = running();
    script.exchange(&[fpwr(0x1002, 0x0120, &[8, 0]).wkc(0)]);
    lacks(script, "did not take the request for OP, working counter 0");
}

#[test]
fn one_subdevice_sent_back_to_init_alone_has_a_reason_that_was_not_seen() {
    let mut script = running();
    raise(&mut script, 0x1002, &[1, 2, 4, 8]);
    lacks(script, "sent SubDevice 2 alone back to INIT: why was not seen");
}

#[test]
fn all_subdevices_sent_back_to_init_are_a_new_start() {
    let mut script = running();
    for states in [[1], [2], [4], [8]] {
        for station in 0x1001..=0x1003 {
            raise(&mut script, station, &states);
        }
    }
    let report = report(script);
    assert!(!text(&report).contains("alone back to INIT"), "{}", text(&report));
    assert_ne!(report.verdict, Verdict::Faulty, "{}", text(&report));
}

#[test]
fn a_link_that_came_up_meanwhile_was_away_before() {
    let mut script = running();
    // Port D of the last one: no link when the line was scanned, and one now.
    script.exchange(&[fprd(0x1003, 0x0110, &[0x97, 0x56])]);
    lacks(script, "had no link at first and has one now");
}

/// Diagnosis when the input ends `after_ms` behind the last frame.
fn ended(script: &mut Script, after_ms: u64) -> Diagnosis {
    script.now += after_ms * 1_000_000;
    script.finish();
    script.engine.diagnosis()
}

#[test]
fn line_on_which_nothing_is_sent_any_more_is_not_healthy() {
    let said = |after_ms| {
        let report = ended(&mut running(), after_ms);
        (report.verdict, text(&report))
    };
    let (verdict, words) = said(2_000);
    assert_eq!(verdict, Verdict::Inconclusive, "{words}");
    let expected =
        "nothing was sent in the last 2 s, although process data had been exchanged every 100 µs";
    assert!(words.contains(expected), "{words}");
    // A program may wait for a moment.
    assert_eq!(said(200).0, Verdict::Healthy);
}

#[test]
fn maindevice_that_has_taken_the_subdevices_out_of_op_may_end() {
    let mut script = running();
    cycles(&mut script);
    for station in 0x1001..=0x1003 {
        raise(&mut script, station, &[1]);
    }
    let report = ended(&mut script, 2_000);
    assert!(!text(&report).contains("nothing was sent"), "{}", text(&report));
}

/// Code, cause and place of what is found where the last request does not come back, and nothing follows for 2 s.
fn last_one_lost(script: &mut Script) -> Vec<String> {
    cycles(script);
    script.vanish(&[lrw(PROCESS, 4, ALL)]);
    let report = ended(script, 2_000);
    report
        .findings
        .iter()
        .map(|one| format!("{} {} at {}", one.code, one.cause, one.place))
        .collect()
}

#[test]
fn last_request_that_is_lost_before_a_stillness_names_no_cable_where_the_program_may_have_ended() {
    // Nobody knows this MainDevice: it may end when one request does not come back.
    assert_eq!(last_one_lost(&mut running()), Vec::<String>::new());
}
