//! Requests for a state that stay unanswered: what is told of them, and what looks alike.

use crate::support::plant::codes;
use crate::support::script::{Script, fprd, fpwr};
use crate::support::text;
use linesman_config::fault::FaultName;
use linesman_diagnosis::report::{Diagnosis, FindingState, PlaceReport, Severity};

const SECOND: u64 = 1_000_000_000;

/// Three SubDevices in PREOP; the second is asked for SAFEOP.
fn asked() -> Script {
    let mut script = Script::scanned(3);
    script.exchange(&[fpwr(0x1002, 0x0120, &[4, 0])]);
    script
}

/// AL status of the second SubDevice is read ten times a second, for so long.
fn polled(script: &mut Script, status: u8, seconds: u64) {
    for _ in 0..seconds * 10 {
        script.now += SECOND / 10 - 100_000;
        script.exchange(&[fprd(0x1002, 0x0130, &[status, 0, 0, 0, 0, 0])]);
    }
}

fn report(script: &mut Script) -> Diagnosis {
    script.finish();
    script.engine.diagnosis()
}

// fires: S207
#[test]
fn a_request_that_stays_unanswered_is_told_when_the_step_may_take_no_longer() {
    let mut script = asked();
    let asked = script.number;
    polled(&mut script, 2, 9);
    assert!(codes(&report(&mut script)).is_empty(), "a step to SAFEOP may take ten seconds");
    polled(&mut script, 2, 2);
    let report = report(&mut script);
    assert_eq!(codes(&report), ["S207"], "{}", text(&report));
    let finding = &report.findings[0];
    assert!(matches!(finding.place, PlaceReport::Device { no: 2, .. }), "{}", text(&report));
    assert_eq!((finding.severity, finding.cause), (Severity::Error, FaultName::FirmwareFault));
    assert_eq!(finding.state, FindingState::Confirmed);
    let [status, control] = &finding.evidence[..] else { panic!("{}", text(&report)) };
    assert!(status.text.contains("still PREOP"), "{}", status.text);
    assert!(control.text.contains("SAFEOP asked for"), "{}", control.text);
    assert_eq!(control.frame.unwrap().0, asked);
}

// fires: S207
#[test]
fn a_maindevice_that_gives_up_and_tries_again_is_not_answered_by_it() {
    let mut script = asked();
    for _ in 0..4 {
        polled(&mut script, 2, 3);
        // Back to where it is, with an acknowledge, and up again.
        script.exchange(&[fpwr(0x1002, 0x0120, &[0x12, 0])]);
        polled(&mut script, 2, 1);
        script.exchange(&[fpwr(0x1002, 0x0120, &[4, 0])]);
    }
    let report = report(&mut script);
    assert_eq!(codes(&report), ["S207"], "{}", text(&report));
    let control = &report.findings[0].evidence[1];
    assert!(control.text.contains("5 times by now"), "{}", control.text);
}

// fires: S207
#[test]
fn a_controller_that_takes_no_further_request_is_not_silent() {
    let mut script = asked();
    for _ in 0..6 {
        polled(&mut script, 2, 2);
        script.exchange(&[fpwr(0x1002, 0x0120, &[4, 0]).wkc(0)]);
    }
    polled(&mut script, 2, 1);
    let report = report(&mut script);
    assert_eq!(codes(&report), ["S207"], "{}", text(&report));
    let control = &report.findings[0].evidence[1];
    assert!(control.text.contains("6 times the one before was not fetched"), "{}", control.text);
}

// fires: S207
#[test]
fn it_is_over_when_the_state_moves_after_all() {
    let mut script = asked();
    polled(&mut script, 2, 12);
    polled(&mut script, 4, 1);
    let report = report(&mut script);
    assert_eq!(codes(&report), ["S207"], "{}", text(&report));
    assert_eq!(report.findings[0].state, FindingState::Closed);
}

// silent: S207
#[test]
fn who_takes_its_time_refuses_or_does_not_answer_at_all_is_another_matter() {
    let mut slow = asked();
    polled(&mut slow, 2, 9);
    polled(&mut slow, 4, 5);
    let mut refusing = asked();
    polled(&mut refusing, 2, 2);
    polled(&mut refusing, 0x12, 20);
    let mut gone = asked();
    polled(&mut gone, 2, 2);
    for _ in 0..200 {
        gone.now += SECOND / 10;
        gone.exchange(&[fprd(0x1002, 0x0130, &[2, 0, 0, 0, 0, 0]).wkc(0)]);
    }
    // Asked for what it is in.
    let mut there = Script::scanned(3);
    there.exchange(&[fpwr(0x1002, 0x0120, &[2, 0])]);
    polled(&mut there, 2, 30);
    let reports = [&mut slow, &mut refusing, &mut gone, &mut there].map(report);
    for report in &reports {
        assert!(!codes(report).contains(&"S207"), "{}", text(report));
    }
    assert!(codes(&reports[0]).is_empty(), "{}", text(&reports[0]));
    assert_eq!(codes(&reports[1]), ["S200"], "{}", text(&reports[1]));
    assert!(codes(&reports[3]).is_empty(), "{}", text(&reports[3]));
}

// A SubDevice whose processor stands still does not answer requests either.
// silent: S207
#[test]
fn beneath_a_processor_that_has_stopped_it_is_a_consequence() {
    let mut script = Script::scanned(3);
    script.exchange(&[fprd(0x1002, 0x0110, &0x5A37_u16.to_le_bytes())]);
    script.exchange(&[fprd(0x1002, 0x0110, &0x5A35_u16.to_le_bytes())]);
    script.exchange(&[fpwr(0x1002, 0x0120, &[4, 0])]);
    polled(&mut script, 2, 12);
    let report = report(&mut script);
    assert_eq!(codes(&report), ["S206"], "{}", text(&report));
    let beneath: Vec<&str> =
        report.findings[0].consequences.iter().map(|one| one.code.as_str()).collect();
    assert_eq!(beneath, ["S207"], "{}", text(&report));
}
