//! Listeners that join a line late: findings about what happened before the first frame that they hear.

use crate::support::script::{Datagram, Script, apwr, fprd, fpwr, lrw};
use crate::support::text;
use linesman_config::fault::FaultName;
use linesman_config::project::Project;
use linesman_diagnosis::Setup;
use linesman_diagnosis::coverage::InputKind;
use linesman_diagnosis::report::{Diagnosis, FindingReport, PlaceReport, Severity, Verdict};
use linesman_proto::ethernet::MacAddress;

const SOEM: MacAddress = MacAddress([0x01; 6]);
const KICKCAT: MacAddress = MacAddress([0xCA, 0xDE, 0xCA, 0xDE, 0xDE, 0xFF]);
const INIT: [u8; 6] = [1, 0, 0, 0, 0, 0];
const SAFE_OP: [u8; 6] = [4, 0, 0, 0, 0, 0];
const OP: [u8; 6] = [8, 0, 0, 0, 0, 0];
/// SAFEOP with error, sync manager watchdog.
const WATCHDOG: [u8; 6] = [0x14, 0, 0, 0, 0x1B, 0];
/// SAFEOP with error, synchronization error.
const OUT_OF_STEP: [u8; 6] = [0x14, 0, 0, 0, 0x1A, 0];

fn listening(sender: MacAddress, project: Option<Project>) -> Script {
    let setup = Setup { input: InputKind::Listened, project, ..Setup::default() };
    Script { sender, is_live: true, ..Script::with(setup) }
}

/// Cycles of 2 ms with this working counter; every 20 ms the states of stations from `base` on, none where one is away.
fn cycles(script: &mut Script, count: u64, counter: u16, base: u16, states: &[Option<[u8; 6]>]) {
    let begin = script.now;
    for cycle in 0..count {
        script.now = script.now.max(begin + cycle * 2_000_000);
        script.exchange(&[lrw(0x0100_0000, 8, counter)]);
        if cycle.is_multiple_of(10) && !states.is_empty() {
            let polled = states.iter().zip(base..);
            let polls: Vec<Datagram> = polled
                .map(|(state, station)| match state {
                    Some(state) => fprd(station, 0x0130, state),
                    None => fprd(station, 0x0130, &[0; 6]).wkc(0),
                })
                .collect();
            script.exchange(&polls);
        }
    }
}

fn report(script: &mut Script) -> Diagnosis {
    script.finish();
    script.engine.diagnosis()
}

fn codes(report: &Diagnosis) -> Vec<&str> {
    report.findings.iter().map(|finding| finding.code.as_str()).collect()
}

fn device(finding: &FindingReport) -> Option<u32> {
    match finding.place {
        PlaceReport::Device { no, .. } => Some(no),
        PlaceReport::Link { .. } | PlaceReport::Network { .. } | PlaceReport::Host => None,
    }
}

fn is_network(finding: &FindingReport) -> bool {
    matches!(finding.place, PlaceReport::Network { .. })
}

#[test]
fn watchdog_expired_before_the_first_reading_leaves_the_place_open() {
    let mut script = listening(SOEM, None);
    cycles(&mut script, 100, 6, 0x1001, &[Some(OP), Some(OP), Some(WATCHDOG)]);
    cycles(&mut script, 600, 6, 0x1001, &[Some(OP); 3]);
    let report = report(&mut script);
    assert_eq!(codes(&report), ["S202"], "{}", text(&report));
    let finding = &report.findings[0];
    assert!(is_network(finding), "{}", text(&report));
    let others: Vec<_> = finding.alternatives.iter().map(|other| other.cause).collect();
    assert!(others.contains(&FaultName::LinkOpen), "{}", text(&report));
}

#[test]
fn watchdog_expired_while_it_is_listened_is_at_its_subdevice() {
    let mut script = listening(SOEM, None);
    cycles(&mut script, 100, 6, 0x1001, &[Some(OP); 3]);
    cycles(&mut script, 600, 6, 0x1001, &[Some(OP), Some(OP), Some(WATCHDOG)]);
    let report = report(&mut script);
    assert_eq!((codes(&report), device(&report.findings[0])), (vec!["S202"], Some(3)));
}

#[test]
fn frames_late_by_less_than_a_watchdog_holds_explain_a_lost_step_and_no_expired_watchdog() {
    let rows = [(WATCHDOG, "S202"), (OUT_OF_STEP, "T411")];
    for (error, expected) in rows {
        let mut script = listening(SOEM, None);
        cycles(&mut script, 600, 6, 0x1001, &[Some(OP); 3]);
        let late = [lrw(0x0100_0000, 8, 6)];
        for _ in 0..3 {
            script.send(&late);
            script.now += 1_500_000;
            script.give_back(&late);
            script.index = script.index.wrapping_add(1);
            cycles(&mut script, 20, 6, 0x1001, &[Some(OP), Some(OP), Some(error)]);
            cycles(&mut script, 20, 6, 0x1001, &[Some(OP); 3]);
        }
        let report = report(&mut script);
        let first = &report.findings[0];
        assert_eq!(first.code, expected, "{}", text(&report));
        let lost_step = first.consequences.iter().any(|one| one.code == "T400");
        assert_eq!(lost_step, expected == "T411", "{}", text(&report));
    }
}

#[test]
fn watchdog_that_expires_whenever_op_is_asked_for_is_no_refusal() {
    let mut script = listening(SOEM, None);
    cycles(&mut script, 100, 4, 0x1001, &[Some(OP), Some(OP), Some(SAFE_OP)]);
    for _ in 0..5 {
        script.exchange(&[fpwr(0x1003, 0x0120, &[8, 0])]);
        cycles(&mut script, 20, 4, 0x1001, &[Some(OP), Some(OP), Some(WATCHDOG)]);
        script.exchange(&[fpwr(0x1003, 0x0120, &[0x14, 0])]);
        cycles(&mut script, 20, 4, 0x1001, &[Some(OP), Some(OP), Some(SAFE_OP)]);
    }
    let report = report(&mut script);
    let first = &report.findings[0];
    assert_eq!((first.code.as_str(), device(first)), ("S202", Some(3)), "{}", text(&report));
    assert!(!codes(&report).contains(&"S200"), "{}", text(&report));
}

#[test]
fn subdevice_that_is_given_its_address_anew_has_started_anew() {
    let mut script = listening(SOEM, None);
    cycles(&mut script, 20, 4, 0x1001, &[Some(OP), Some(OP), None]);
    script.exchange(&[apwr(2, 0x0010, &[0x03, 0x10], 3)]);
    cycles(&mut script, 20, 4, 0x1001, &[Some(OP), Some(OP), Some(INIT)]);
    let begun = script.engine.diagnosis();
    let restarted = begun.findings.iter().find(|finding| finding.code == "H150").unwrap();
    assert_eq!((restarted.cause, device(restarted)), (FaultName::BrownOut, Some(3)));
    assert_eq!(restarted.closed_ns, None, "in INIT it is not back: {}", text(&begun));
    cycles(&mut script, 600, 6, 0x1001, &[Some(OP); 3]);
    let report = report(&mut script);
    assert_eq!(report.findings[0].code, "H150", "{}", text(&report));
    assert!(report.findings[0].closed_ns.is_some(), "{}", text(&report));
}

#[test]
fn working_counter_that_rises_unasked_was_short_before() {
    let mut script = listening(SOEM, None);
    cycles(&mut script, 100, 4, 0x1001, &[Some(OP); 3]);
    cycles(&mut script, 600, 6, 0x1001, &[Some(OP); 3]);
    let report = report(&mut script);
    assert_eq!(codes(&report), ["S210"], "{}", text(&report));
    assert!(is_network(&report.findings[0]) && report.findings[0].closed_ns.is_some());
}

#[test]
fn working_counter_that_rises_as_the_line_comes_up_is_no_finding() {
    // A state that rises tells it; where nobody reads states, nobody knows.
    let unread: &[Option<[u8; 6]>] = &[];
    let before = [Some(OP), Some(OP), Some(SAFE_OP)];
    let rows = [
        (&before[..], &[Some(OP); 3][..], Verdict::Healthy),
        (unread, unread, Verdict::Inconclusive),
    ];
    for (first, then, verdict) in rows {
        let mut script = listening(SOEM, None);
        cycles(&mut script, 100, 4, 0x1001, first);
        cycles(&mut script, 600, 6, 0x1001, then);
        let report = report(&mut script);
        assert_eq!((codes(&report), report.verdict), (vec![], verdict), "{}", text(&report));
    }
}

#[test]
fn branches_that_fall_silent_at_once_have_a_supply_in_common() {
    let mut script = listening(SOEM, None);
    cycles(&mut script, 100, 6, 0x1001, &[Some(OP); 6]);
    let dark = [Some(OP), None, Some(OP), Some(OP), None, Some(OP)];
    cycles(&mut script, 600, 4, 0x1001, &dark);
    let report = report(&mut script);
    let finding = &report.findings[0];
    assert_eq!((finding.code.as_str(), finding.cause), ("H102", FaultName::SupplyOff));
    assert_eq!((device(finding), report.findings.len()), (Some(2), 1), "{}", text(&report));
    let places = finding.alternatives.iter().filter(|other| other.cause == FaultName::SupplyOff);
    assert_eq!(places.count(), 1, "the other one: {}", text(&report));
}

#[test]
fn planned_subdevices_have_the_addresses_of_the_maindevice_that_drives() {
    // In the file K3 comes before T2, in the order of frames behind it.
    let project = Project::parse(
        "name = \"p\"\n[[device]]\nname = \"K1\"\non = \"maindevice\"\n[[device]]\nname = \"K3\"\non = \"K1.C\"\n\
         [[device]]\nname = \"T2\"\non = \"K1.B\"\n",
    )
    .unwrap();
    for (sender, base) in [(SOEM, 0x1001), (KICKCAT, 1001)] {
        let mut script = listening(sender, Some(project.clone()));
        cycles(&mut script, 300, 4, base, &[Some(OP), Some(OP), None]);
        let report = report(&mut script);
        assert_eq!(report.devices.len(), 3, "{}", text(&report));
        let cut = &report.findings[0];
        assert_eq!(
            (cut.code.as_str(), cut.cause),
            ("H102", FaultName::LinkOpen),
            "{}",
            text(&report)
        );
        let PlaceReport::Link { a, b: Some(b), .. } = cut.place else {
            panic!("{}", text(&report))
        };
        assert_eq!((a.no, b.no), (1, 2), "K3 is the second of the file: {}", text(&report));
    }
}

#[test]
fn one_lost_frame_is_a_note_with_all_that_it_may_be() {
    let mut script = listening(SOEM, None);
    cycles(&mut script, 300, 6, 0x1001, &[Some(OP); 3]);
    script.vanish(&[lrw(0x0100_0000, 8, 6)]);
    cycles(&mut script, 300, 6, 0x1001, &[Some(OP); 3]);
    let report = report(&mut script);
    assert_eq!(report.verdict, Verdict::Inconclusive, "{}", text(&report));
    let finding = &report.findings[0];
    assert_eq!((finding.code.as_str(), finding.severity), ("H114", Severity::Info));
    assert!(finding.alternatives.iter().any(|other| other.cause == FaultName::ReceiverDamaged));
}

#[test]
fn frames_lost_before_subdevices_lose_their_step_explain_it() {
    let mut script = listening(SOEM, None);
    cycles(&mut script, 100, 6, 0x1001, &[Some(OP); 3]);
    for _ in 0..4 {
        script.vanish(&[lrw(0x0100_0000, 8, 6)]);
        cycles(&mut script, 2, 6, 0x1001, &[]);
    }
    cycles(&mut script, 100, 4, 0x1001, &[Some(OP), Some(OP), Some(OUT_OF_STEP)]);
    cycles(&mut script, 600, 6, 0x1001, &[Some(OP); 3]);
    let report = report(&mut script);
    assert_eq!(codes(&report), ["H114"], "{}", text(&report));
    let lost = &report.findings[0];
    assert_eq!(lost.severity, Severity::Error, "a SubDevice has left OP");
    assert!(lost.consequences.iter().any(|one| one.code == "T400"), "{}", text(&report));
}

#[test]
fn error_of_step_before_the_first_reading_may_come_of_lost_frames() {
    let mut script = listening(SOEM, None);
    cycles(&mut script, 100, 6, 0x1001, &[Some(OP), Some(OP), Some(OUT_OF_STEP)]);
    cycles(&mut script, 600, 6, 0x1001, &[Some(OP); 3]);
    let report = report(&mut script);
    assert_eq!(codes(&report), ["T400"], "{}", text(&report));
    let others: Vec<_> = report.findings[0].alternatives.iter().map(|one| one.cause).collect();
    for cause in [FaultName::LinkOpen, FaultName::LateFrames, FaultName::CableDegraded] {
        assert!(others.contains(&cause), "{cause:?}: {others:?}");
    }
}

#[test]
fn recording_that_begins_with_a_return_has_one_maindevice() {
    let mut script = listening(MacAddress([0x00, 0x1B, 0x21, 1, 2, 3]), None);
    for _ in 0..3 {
        script.give_back(&[lrw(0x0100_0000, 8, 6)]);
    }
    cycles(&mut script, 600, 6, 0x03E9, &[Some(OP); 3]);
    let report = report(&mut script);
    assert_eq!(codes(&report), Vec::<&str>::new(), "{}", text(&report));
}

/// A hundred cycles, then a hundred whose frames come back a millisecond later than those.
fn late_frames(script: &mut Script, states: &[Option<[u8; 6]>]) {
    for _ in 0..100 {
        script.exchange(&[lrw(0x0100_0000, 8, 6)]);
        script.now += 1_900_000;
    }
    cycles(script, 20, 6, 0x1001, states);
    for _ in 0..100 {
        script.send(&[lrw(0x0100_0000, 8, 6)]);
        script.now += 1_000_000;
        script.give_back(&[lrw(0x0100_0000, 8, 6)]);
        script.index = script.index.wrapping_add(1);
        script.now += 900_000;
    }
}

fn frames_late(report: &Diagnosis) -> &FindingReport {
    report.findings.iter().find(|finding| finding.code == "T411").unwrap()
}

#[test]
fn late_frames_before_subdevices_lose_their_step_explain_it() {
    let mut script = listening(SOEM, None);
    late_frames(&mut script, &[Some(OP); 3]);
    cycles(&mut script, 100, 4, 0x1001, &[Some(OP), Some(OP), Some(OUT_OF_STEP)]);
    cycles(&mut script, 600, 6, 0x1001, &[Some(OP); 3]);
    let report = report(&mut script);
    let late = frames_late(&report);
    assert_eq!(late.severity, Severity::Error, "{}", text(&report));
    assert!(late.consequences.iter().any(|one| one.code == "T400"), "{}", text(&report));
    assert!(!codes(&report).contains(&"T400"), "{}", text(&report));
}

#[test]
fn late_frames_beside_error_bits_that_are_echoes_stay_a_note() {
    let mut script = listening(KICKCAT, None);
    late_frames(&mut script, &[]);
    cycles(&mut script, 100, 6, 0x1001, &[Some([0x18, 0, 0, 0, 0, 0]); 3]);
    let report = report(&mut script);
    assert_eq!(frames_late(&report).severity, Severity::Info, "{}", text(&report));
}
