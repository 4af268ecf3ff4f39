//! What the host, other tools and SubDevices themselves leave in frames: pauses, jitter, cleared counters,
//! messages; and what looks like it and must not be found.

use crate::support::script::{Script, fprd, fpwr, lrw};
use crate::support::text;
use linesman_config::fault::FaultName;
use linesman_diagnosis::report::{Diagnosis, PlaceReport, Severity};
use linesman_diagnosis::{HostEvent, HostObservation};
use linesman_proto::address::{LogicalAddress, Network, Path, RegisterAddress};
use linesman_proto::mailbox::coe::sdo::{Initial, Response};
use linesman_proto::mailbox::coe::{
    DiagnosisMessage, Message, ObjectAddress, Severity as Seriousness,
};
use linesman_proto::mailbox::{Counter, Header, MailboxType};
use linesman_proto::register::FmmuConfig;
use linesman_proto::time::Instant;

const PROCESS: u32 = 0x0100_0000;

/// Two devices in OP; the second takes two bytes of outputs. A cycle takes 100 µs.
fn running() -> Script {
    let mut script = Script::scanned(2);
    let outputs = FmmuConfig::outputs(LogicalAddress(PROCESS), 2, RegisterAddress(0x1100));
    script.exchange(&[fpwr(0x1002, 0x0600, &outputs.to_bytes())]);
    for state in [4_u8, 8] {
        for station in 0x1001..=0x1002 {
            script.exchange(&[fpwr(station, 0x0120, &[state, 0])]);
            script.exchange(&[fprd(station, 0x0130, &[state, 0, 0, 0, 0, 0])]);
        }
    }
    cycles(&mut script, 60);
    script
}

fn cycles(script: &mut Script, count: usize) {
    for _ in 0..count {
        script.exchange(&[lrw(PROCESS, 2, 2)]);
    }
}

fn report(script: &mut Script) -> Diagnosis {
    script.finish();
    script.engine.diagnosis()
}

fn codes(report: &Diagnosis) -> Vec<&str> {
    report.findings.iter().map(|finding| finding.code.as_str()).collect()
}

/// The second SubDevice is in SAFEOP: its watchdog has expired.
fn expired(script: &mut Script) {
    script.exchange(&[fprd(0x1002, 0x0130, &[0x14, 0, 0, 0, 0x1B, 0])]);
    cycles(script, 5);
}

// fires: X513
#[test]
fn a_maindevice_that_sent_nothing_for_longer_than_the_watchdog_is_to_blame() {
    let mut script = running();
    script.now += 112_000_000;
    cycles(&mut script, 2);
    expired(&mut script);
    let report = report(&mut script);
    assert_eq!(codes(&report), ["X513"], "{}", text(&report));
    let finding = &report.findings[0];
    assert_eq!((&finding.place, finding.cause), (&PlaceReport::Host, FaultName::WatchdogStarved));
    let evidence = &finding.evidence[0].text;
    assert!(evidence.contains("nothing was sent to the outputs for 112.1 ms"), "{evidence}");
    assert!(evidence.contains("holds for 100.0 ms"), "{evidence}");
    assert_eq!(finding.consequences[0].code, "S202", "{}", text(&report));
}

// silent: X513
#[test]
fn a_pause_shorter_than_the_watchdog_is_not() {
    let mut script = running();
    // 200 ms: 2,000 ticks of 0.1 ms.
    script.exchange(&[fpwr(0x1002, 0x0420, &2_000_u16.to_le_bytes())]);
    script.now += 112_000_000;
    cycles(&mut script, 2);
    expired(&mut script);
    let report = report(&mut script);
    assert_eq!(codes(&report), ["S202"], "{}", text(&report));
}

// fires: S201
// silent: X513
#[test]
fn a_state_that_is_left_for_another_reason_is_no_pause() {
    let mut script = running();
    script.exchange(&[fprd(0x1002, 0x0130, &[0x14, 0, 0, 0, 0x01, 0])]);
    cycles(&mut script, 5);
    let report = report(&mut script);
    assert_eq!(codes(&report), ["S201"], "{}", text(&report));
}

// fires: S205
// silent: S201, H150
#[test]
fn a_fall_without_an_error_is_the_doing_of_the_firmware() {
    let mut script = running();
    script.exchange(&[fprd(0x1002, 0x0130, &[4, 0, 0, 0, 0, 0])]);
    cycles(&mut script, 5);
    let report = report(&mut script);
    assert_eq!(codes(&report), ["S205"], "{}", text(&report));
}

// silent: S205
#[test]
fn a_lower_state_that_was_asked_for_is_no_fall() {
    let mut script = running();
    script.exchange(&[fpwr(0x1002, 0x0120, &[4, 0])]);
    script.exchange(&[fprd(0x1002, 0x0130, &[4, 0, 0, 0, 0, 0])]);
    cycles(&mut script, 5);
    let report = report(&mut script);
    assert_eq!(codes(&report), <[&str; 0]>::default(), "{}", text(&report));
}

// fires: H102
#[test]
fn a_subdevice_that_answers_no_more_is_told() {
    let mut script = running();
    for _ in 0..3 {
        script.exchange(&[fprd(0x1002, 0x0130, &[8, 0, 0, 0, 0, 0]).wkc(0)]);
        cycles(&mut script, 5);
    }
    let report = report(&mut script);
    assert_eq!(codes(&report), ["H102"], "{}", text(&report));
}

fn host(script: &mut Script, what: HostEvent) {
    script.now += 1_000_000;
    let (network, path) = (Network(0), Path::A);
    let time = Instant::from_nanos(script.now);
    script.engine.handle_host(&HostObservation { network, path, time, what });
}

// fires: X512
#[test]
fn a_card_that_cannot_send_is_told() {
    let mut script = running();
    host(&mut script, HostEvent::SendFailures(3));
    let report = report(&mut script);
    assert_eq!(codes(&report), ["X512"], "{}", text(&report));
}

/// Who refuses frames for a while and then takes all of them stood still; damage comes again, or stays.
#[test]
fn what_kept_a_card_from_sending_is_told_by_whether_it_comes_again() {
    // Between the first refusal and the last, in ms; whether frames come back behind it.
    let table = [
        (0, true, FaultName::WatchdogStarved),
        (1_500, true, FaultName::WatchdogStarved),
        (1_500, false, FaultName::NicDamaged),
        (2_500, true, FaultName::NicDamaged),
    ];
    for (apart_ms, is_back, cause) in table {
        let mut script = running();
        host(&mut script, HostEvent::SendFailures(3));
        cycles(&mut script, apart_ms * 10);
        host(&mut script, HostEvent::SendFailures(1));
        if is_back {
            cycles(&mut script, 100);
        }
        let report = report(&mut script);
        assert_eq!(codes(&report), ["X512"], "{}", text(&report));
        assert_eq!(report.findings[0].cause, cause, "{apart_ms} ms, {is_back}: {}", text(&report));
    }
}

// The evidence says when the link went, also once it is back.
// fires: H101
#[test]
fn a_card_lost_its_link_when_it_went_and_not_when_it_came_back() {
    let mut script = running();
    host(&mut script, HostEvent::Carrier(true));
    let before = script.now;
    host(&mut script, HostEvent::Carrier(false));
    script.now += 2_000_000_000;
    host(&mut script, HostEvent::Carrier(true));
    cycles(&mut script, 100);
    let report = report(&mut script);
    assert_eq!(codes(&report), ["H101"], "{}", text(&report));
    let evidence = &report.findings[0].evidence;
    let shown = evidence.iter().find(|one| one.text == "card A has no link");
    let at = shown.and_then(|one| one.time_ns).unwrap_or_else(|| panic!("{}", text(&report)));
    assert!((before..before + 1_000_000_000).contains(&at.0), "{}", text(&report));
}

// silent: X512
#[test]
fn a_card_without_a_cable_need_not_send() {
    let mut script = running();
    host(&mut script, HostEvent::Carrier(true));
    host(&mut script, HostEvent::Carrier(false));
    host(&mut script, HostEvent::SendFailures(3));
    let report = report(&mut script);
    assert!(!codes(&report).contains(&"X512"), "{}", text(&report));
}

/// Thirty cycles of which every third is late by so much, in ns.
fn uneven(script: &mut Script, late: u64) {
    for _ in 0..10 {
        cycles(script, 2);
        script.now += late;
        cycles(script, 1);
    }
}

// fires: T410
// proves: SYN-31
#[test]
fn jitter_of_20_percent_is_a_warning_and_of_30_an_error() {
    for (late, severity) in [(25_000, Severity::Warning), (35_000, Severity::Error)] {
        let mut script = running();
        script.exchange(&[lrw(PROCESS, 2, 2), fpwr(0x1002, 0x0980, &[0, 3])]);
        uneven(&mut script, late);
        let report = report(&mut script);
        assert_eq!(codes(&report), ["T410"], "{}", text(&report));
        let finding = &report.findings[0];
        assert_eq!(finding.severity, severity, "{}", text(&report));
        let percent = format!("that is {} %", late / 1_000);
        assert!(finding.evidence[0].text.contains(&percent), "{}", finding.evidence[0].text);
    }
}

// silent: T410
#[test]
fn less_jitter_is_no_finding_nor_is_jitter_of_a_live_line_without_sync_signals() {
    let mut script = running();
    script.exchange(&[lrw(PROCESS, 2, 2), fpwr(0x1002, 0x0980, &[0, 3])]);
    uneven(&mut script, 15_000);
    let little = report(&mut script);
    assert_eq!(codes(&little), <[&str; 0]>::default(), "{}", text(&little));
    // Whoever runs the line knows what its computer does; of a recording it is worth a note.
    for (is_live, expected) in [(true, vec![]), (false, vec![("T410", Severity::Info)])] {
        let mut script = Script::new();
        script.is_live = is_live;
        script.scan(3);
        cycles(&mut script, 200);
        uneven(&mut script, 80_000);
        let free = report(&mut script);
        let said = free.findings.iter().map(|one| (one.code.as_str(), one.severity));
        assert!(said.eq(expected), "{}", text(&free));
    }
}

fn counters(script: &mut Script, station: u16, first: u8) {
    let mut data = [0; 20];
    data[0] = first;
    script.exchange(&[fprd(station, 0x0300, &data)]);
    cycles(script, 20);
}

// fires: C331
#[test]
fn counters_that_another_tool_clears_are_told() {
    let mut script = running();
    counters(&mut script, 0x1002, 0);
    counters(&mut script, 0x1002, 7);
    counters(&mut script, 0x1002, 0);
    let report = report(&mut script);
    let cleared = report.findings.iter().find(|finding| finding.code == "C331");
    let cleared = cleared.unwrap_or_else(|| panic!("{}", text(&report)));
    assert_eq!(cleared.severity, Severity::Info);
    assert!(cleared.evidence[0].text.contains("fell from 7 to 0"), "{}", cleared.evidence[0].text);
}

// silent: C331
#[test]
fn counters_that_the_maindevice_clears_itself_are_not() {
    let mut script = running();
    counters(&mut script, 0x1002, 7);
    script.exchange(&[fpwr(0x1002, 0x0300, &[0])]);
    counters(&mut script, 0x1002, 0);
    let report = report(&mut script);
    assert!(!codes(&report).contains(&"C331"), "{}", text(&report));
}

// fires: H113
#[test]
fn a_counter_that_was_full_from_the_start_is_told_once_others_rise() {
    let mut script = Script::new();
    script.exchange(&[crate::support::script::brd(0x0000, &[0x11, 0], 2)]);
    for (station, first) in [(0x1001_u16, 0_u8), (0x1002, 255)] {
        script.exchange(&[crate::support::script::apwr(
            station - 0x1001,
            0x0010,
            &station.to_le_bytes(),
            2,
        )]);
        counters(&mut script, station, first);
    }
    counters(&mut script, 0x1001, 3);
    let report = report(&mut script);
    let full = report.findings.iter().find(|finding| finding.code == "H113");
    let full = full.unwrap_or_else(|| panic!("{}", text(&report)));
    assert!(matches!(full.place, PlaceReport::Device { no: 2, .. }), "{}", text(&report));
}

// silent: H113
#[test]
fn a_full_counter_on_a_quiet_line_is_history() {
    let mut script = Script::new();
    script.exchange(&[crate::support::script::brd(0x0000, &[0x11, 0], 1)]);
    script.exchange(&[crate::support::script::apwr(0, 0x0010, &0x1001_u16.to_le_bytes(), 1)]);
    counters(&mut script, 0x1001, 255);
    counters(&mut script, 0x1001, 255);
    let report = report(&mut script);
    assert_eq!(codes(&report), <[&str; 0]>::default(), "{}", text(&report));
}

/// The second SubDevice gives a message of its diagnosis history.
fn message(script: &mut Script, severity: Seriousness) {
    let message = DiagnosisMessage {
        code: 0x8105_E800,
        severity,
        local_time: true,
        text: 0x4413,
        time_ns: 1_234_567_000,
        count: 0,
        parameters: &[],
    };
    let mut value = [0; 64];
    let len = message.write(&mut value).unwrap();
    let object = ObjectAddress::new(0x10F3, 6);
    let initial = Initial::Normal { size: len as u32, data: &value[..len] };
    let response = Response::Upload { object, complete: false, initial };
    let mut mailbox = [0; 128];
    Header::new(MailboxType::Coe, Counter::FIRST, 0)
        .write_message(&mut mailbox, |body| Message::SdoResponse(response).write(body))
        .unwrap();
    script.exchange(&[fprd(0x1002, 0x1080, &mailbox)]);
    cycles(script, 5);
}

// fires: S241
// proves: SW-08 partial: messages merged into the findings, from frames
#[test]
fn a_message_of_the_history_stands_among_the_findings() {
    let mut script = running();
    message(&mut script, Seriousness::Error);
    message(&mut script, Seriousness::Error);
    let report = report(&mut script);
    assert_eq!(codes(&report), ["S241"], "{}", text(&report));
    let finding = &report.findings[0];
    assert_eq!(finding.evidence.len(), 1, "read twice is one message");
    let words = &finding.evidence[0].text;
    assert!(words.contains("emergency 0x8105 (error), text 0x4413, at 1.234567 s"), "{words}");
}

#[test]
fn a_message_beneath_a_state_that_was_left_belongs_to_it() {
    let mut script = running();
    script.exchange(&[fprd(0x1002, 0x0130, &[0x14, 0, 0, 0, 0x2C, 0])]);
    message(&mut script, Seriousness::Error);
    let report = report(&mut script);
    assert_eq!(codes(&report), ["T400"], "{}", text(&report));
    assert_eq!(report.findings[0].consequences[0].code, "S241");
}

// silent: S241
#[test]
fn messages_for_information_are_no_finding() {
    let mut script = running();
    message(&mut script, Seriousness::Information);
    let report = report(&mut script);
    assert_eq!(codes(&report), <[&str; 0]>::default(), "{}", text(&report));
}
