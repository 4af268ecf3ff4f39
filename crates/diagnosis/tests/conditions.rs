//! States, working counters and restarts: what must be found, and what looks like it and must not.

#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]

mod support;

use linesman_config::fault::FaultName;
use linesman_diagnosis::EventKind;
use linesman_diagnosis::report::{Diagnosis, FindingReport, FindingState, PlaceReport, Verdict};
use linesman_proto::address::{LogicalAddress, RegisterAddress};
use linesman_proto::register::FmmuConfig;
use support::script::{Script, brd, fprd, fpwr, lrw};
use support::text;

const PROCESS: u32 = 0x0100_0000;

/// Three devices in OP: the second gives two bytes of inputs, the third takes two bytes of outputs.
fn running() -> Script {
    let mut script = Script::scanned(3);
    let inputs = FmmuConfig::inputs(LogicalAddress(PROCESS), 2, RegisterAddress(0x1180));
    let outputs = FmmuConfig::outputs(LogicalAddress(PROCESS + 2), 2, RegisterAddress(0x1100));
    script.exchange(&[fpwr(0x1002, 0x0600, &inputs.to_bytes())]);
    script.exchange(&[fpwr(0x1003, 0x0600, &outputs.to_bytes())]);
    // Before SAFEOP nobody serves process data; that is no deficit later.
    for wkc in [0, 1, 3] {
        script.exchange(&[lrw(PROCESS, 4, wkc)]);
    }
    for state in [4_u8, 8] {
        for station in 0x1001..=0x1003 {
            script.exchange(&[fpwr(station, 0x0120, &[state, 0])]);
            script.exchange(&[fprd(station, 0x0130, &[state, 0, 0, 0, 0, 0])]);
        }
    }
    cycles(&mut script, 100, 3);
    script
}

fn cycles(script: &mut Script, count: usize, wkc: u16) {
    for _ in 0..count {
        script.exchange(&[lrw(PROCESS, 4, wkc)]);
    }
}

fn report(script: &mut Script) -> Diagnosis {
    script.finish();
    script.engine.diagnosis()
}

fn only(report: &Diagnosis) -> &FindingReport {
    let [finding] = &report.findings[..] else { panic!("one finding expected: {}", text(report)) };
    finding
}

fn no(finding: &FindingReport) -> Option<u32> {
    match finding.place {
        PlaceReport::Device { no, .. } => Some(no),
        PlaceReport::Link { .. } | PlaceReport::Network { .. } | PlaceReport::Host => None,
    }
}

#[test]
fn all_well() {
    let mut script = running();
    let report = report(&mut script);
    assert_eq!(report.verdict, Verdict::Healthy, "{}", text(&report));
    assert!(script.engine.poll_event().is_none());
}

#[test]
fn a_refused_state_names_device_transition_and_code() {
    let mut script = Script::scanned(3);
    script.exchange(&[fpwr(0x1002, 0x0120, &[4, 0])]);
    let asked = script.number;
    // First the error, the code with the next read.
    script.exchange(&[fprd(0x1002, 0x0130, &[0x12, 0])]);
    let refused = script.number;
    script.exchange(&[fprd(0x1002, 0x0134, &[0x1D, 0])]);
    let report = report(&mut script);
    let finding = only(&report);
    assert_eq!(finding.name, "state-refused");
    assert_eq!(finding.cause, FaultName::InitRefused);
    assert_eq!(no(finding), Some(2));
    assert_eq!(finding.state, FindingState::Confirmed);
    let [status, code, control] = &finding.evidence[..] else { panic!("{}", text(&report)) };
    assert_eq!((status.register, status.frame.unwrap().0), (Some(0x0130), refused));
    assert!(status.text.contains("PREOP") && status.text.contains("SAFEOP"), "{}", status.text);
    assert_eq!((code.register, code.after.unwrap().0), (Some(0x0134), 0x1D));
    assert!(code.text.to_lowercase().contains("output"), "{}", code.text);
    assert_eq!((control.register, control.frame.unwrap().0), (Some(0x0120), asked));
    assert!(finding.actions.len() > 1);
}

#[test]
fn an_acknowledged_refusal_is_closed_but_not_forgotten() {
    let mut script = Script::scanned(1);
    script.exchange(&[fpwr(0x1001, 0x0120, &[4, 0])]);
    script.exchange(&[fprd(0x1001, 0x0130, &[0x12, 0, 0, 0, 0x1E, 0])]);
    script.exchange(&[fpwr(0x1001, 0x0120, &[0x12, 0])]);
    script.exchange(&[fprd(0x1001, 0x0130, &[0x02, 0, 0, 0, 0, 0])]);
    let report = report(&mut script);
    let finding = only(&report);
    assert_eq!((finding.name.as_str(), finding.state), ("state-refused", FindingState::Closed));
    assert_eq!(report.verdict, Verdict::Faulty);
}

#[test]
fn a_copied_acknowledge_bit_is_no_error() {
    let mut script = Script::scanned(2);
    // A coupler without processor shows what was written, acknowledge bit and all.
    script.exchange(&[fpwr(0x1001, 0x0120, &[0x14, 0])]);
    script.exchange(&[fprd(0x1001, 0x0130, &[0x14, 0, 0, 0, 0, 0])]);
    let report = report(&mut script);
    assert_eq!(report.verdict, Verdict::Healthy, "{}", text(&report));
}

#[test]
fn a_watchdog_explains_the_missing_outputs() {
    let mut script = running();
    cycles(&mut script, 10, 1);
    script.exchange(&[fprd(0x1003, 0x0130, &[0x14, 0, 0, 0, 0x1B, 0])]);
    cycles(&mut script, 100, 1);
    let report = report(&mut script);
    let finding = only(&report);
    assert_eq!((finding.name.as_str(), no(finding)), ("watchdog-expired", Some(3)));
    assert_eq!(finding.cause, FaultName::WatchdogStarved);
    let [below] = &finding.consequences[..] else { panic!("{}", text(&report)) };
    assert_eq!((below.name.as_str(), no(below)), ("working-counter-low", Some(3)));
    assert!(below.evidence[0].text.contains("1 instead of 3"), "{}", below.evidence[0].text);
    // The deficit came first, and keeps its time.
    assert!(below.opened_ns < finding.opened_ns);
}

#[test]
fn a_missing_share_names_the_only_device_that_fits() {
    let mut script = running();
    cycles(&mut script, 100, 2);
    let report = report(&mut script);
    let finding = only(&report);
    // 2 of 3 left: the reader's 1 is missing.
    assert_eq!((finding.name.as_str(), no(finding)), ("working-counter-low", Some(2)));
}

#[test]
fn a_device_that_does_not_answer_either_is_the_one() {
    let mut script = running();
    cycles(&mut script, 10, 0);
    script.exchange(&[fprd(0x1003, 0x0130, &[0, 0]).wkc(0)]);
    script.exchange(&[fprd(0x1002, 0x0130, &[0, 0]).wkc(0)]);
    cycles(&mut script, 100, 0);
    let report = report(&mut script);
    let finding = report.findings.iter().find(|finding| finding.name == "working-counter-low");
    let finding = finding.unwrap_or_else(|| panic!("{}", text(&report)));
    assert_eq!(finding.cause, FaultName::DeviceOff, "{}", text(&report));
}

#[test]
fn process_data_that_the_maindevice_stops_are_not_missing() {
    let mut script = running();
    // It takes one device down on purpose, the others go on.
    script.exchange(&[fpwr(0x1003, 0x0120, &[2, 0])]);
    script.exchange(&[fprd(0x1003, 0x0130, &[2, 0, 0, 0, 0, 0])]);
    cycles(&mut script, 100, 1);
    // And then all of them.
    for station in 0x1001..=0x1003 {
        script.exchange(&[fpwr(station, 0x0120, &[1, 0])]);
        script.exchange(&[fprd(station, 0x0130, &[1, 0, 0, 0, 0, 0])]);
    }
    cycles(&mut script, 20, 0);
    let report = report(&mut script);
    assert_eq!(report.verdict, Verdict::Healthy, "{}", text(&report));
}

#[test]
fn a_fall_to_init_that_nobody_asked_for_is_a_restart() {
    let mut script = running();
    script.exchange(&[fprd(0x1002, 0x0130, &[1, 0, 0, 0, 0, 0])]);
    cycles(&mut script, 50, 2);
    let report = report(&mut script);
    let finding = only(&report);
    assert_eq!((finding.name.as_str(), no(finding)), ("restarted", Some(2)));
    assert_eq!(finding.cause, FaultName::BrownOut);
    assert_eq!(finding.consequences.len(), 1, "{}", text(&report));
}

#[test]
fn events_tell_the_life_of_a_finding_in_order() {
    let mut script = running();
    cycles(&mut script, 300, 2);
    cycles(&mut script, 300, 3);
    script.finish();
    let kinds: Vec<_> =
        std::iter::from_fn(|| script.engine.poll_event()).map(|event| event.kind).collect();
    assert_eq!(kinds, [EventKind::Opened, EventKind::Confirmed, EventKind::Closed]);
}

#[test]
fn probes_are_asked_for_once_something_is_wrong() {
    let mut script = Script::with(linesman_diagnosis::Setup {
        probes: true,
        ..linesman_diagnosis::Setup::default()
    });
    script.scan(2);
    cycles(&mut script, 200, 3);
    assert!(script.engine.poll_probe().is_none());
    cycles(&mut script, 200, 1);
    let probes: Vec<_> = std::iter::from_fn(|| script.engine.poll_probe()).collect();
    assert_eq!(probes.len(), 2 * 3);
    assert!(probes.iter().any(|probe| probe.register == RegisterAddress(0x0300)));
}

#[test]
fn a_broadcast_of_states_is_not_a_state() {
    let mut script = Script::scanned(2);
    // One in INIT with error, one in OP: 0x19 names neither.
    script.exchange(&[brd(0x0130, &[0x19, 0], 2)]);
    let report = report(&mut script);
    assert_eq!(report.network.al_state_highest.as_deref(), Some("OP"));
    assert_eq!(report.verdict, Verdict::Healthy, "{}", text(&report));
}

#[test]
fn the_report_is_read_back_as_it_was_written() {
    let mut script = running();
    cycles(&mut script, 100, 2);
    let report = report(&mut script);
    let json = serde_json::to_value(&report).unwrap();
    assert_eq!(json["schema"], "linesman.diagnosis/1");
    let finding = &json["findings"][0];
    for key in [
        "id",
        "code",
        "name",
        "severity",
        "class",
        "state",
        "opened_ns",
        "confirmed_ns",
        "closed_ns",
        "place",
        "cause",
        "confidence",
        "alternatives",
        "evidence",
        "actions",
        "consequences",
    ] {
        assert!(finding.get(key).is_some(), "{key}");
    }
    assert_eq!(finding["place"]["kind"], "device");
    assert_eq!(finding["place"]["no"], 2);
    assert_eq!(finding["evidence"][0]["kind"], "frame");
    let back: Diagnosis = serde_json::from_value(json).unwrap();
    assert_eq!(back, report);
}
