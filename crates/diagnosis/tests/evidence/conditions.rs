//! States, working counters and restarts: what must be found, and what looks like it and must not.

use crate::support::plant::Plant;
use crate::support::script::{Script, brd, fprd, fpwr, lrw};
use crate::support::text;
use linesman_config::fault::FaultName;
use linesman_diagnosis::report::{Diagnosis, FindingReport, FindingState, PlaceReport, Verdict};
use linesman_diagnosis::{Asked, EventKind, HostEvent, HostObservation};
use linesman_proto::address::{LogicalAddress, Network, Path, RegisterAddress};
use linesman_proto::register::FmmuConfig;
use linesman_proto::time::{Instant, Span};

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
    assert_ne!(report.verdict, Verdict::Faulty, "{}", text(&report));
    assert!(script.engine.poll_event().is_none());
}

// fires: S200
// silent: S201, S202
// proves: SW-01, DIA-02 partial
#[test]
fn a_refused_state_names_device_transition_and_code() {
    let mut script = Script::scanned(3);
    script.exchange(&[fpwr(0x1002, 0x0120, &[4, 0])]);
    let asked = script.number;
    // First the error, the code with the next read.
    script.exchange(&[fprd(0x1002, 0x0130, &[0x12, 0])]);
    let refused = script.number;
    script.exchange(&[fprd(0x1002, 0x0134, &[0x1E, 0])]);
    let report = report(&mut script);
    let finding = only(&report);
    assert_eq!(finding.name, "state-refused");
    assert_eq!(finding.cause, FaultName::ConfigMismatch);
    assert_eq!(no(finding), Some(2));
    assert_eq!(finding.state, FindingState::Confirmed);
    let [status, code, control] = &finding.evidence[..] else { panic!("{}", text(&report)) };
    assert_eq!((status.register, status.frame.unwrap().0), (Some(0x0130), refused));
    assert!(status.text.contains("PREOP") && status.text.contains("SAFEOP"), "{}", status.text);
    assert_eq!((code.register, code.after.unwrap().0), (Some(0x0134), 0x1E));
    assert!(code.text.to_lowercase().contains("input"), "{}", code.text);
    assert_eq!((control.register, control.frame.unwrap().0), (Some(0x0120), asked));
    assert!(finding.actions.len() > 1);
}

#[test]
fn a_refusal_is_over_when_the_state_is_reached_and_not_when_it_is_acknowledged() {
    let mut script = Script::scanned(1);
    script.exchange(&[fpwr(0x1001, 0x0120, &[4, 0])]);
    script.exchange(&[fprd(0x1001, 0x0130, &[0x12, 0, 0, 0, 0x1E, 0])]);
    script.exchange(&[fpwr(0x1001, 0x0120, &[0x12, 0])]);
    script.exchange(&[fprd(0x1001, 0x0130, &[0x02, 0, 0, 0, 0, 0])]);
    let acknowledged = report(&mut script);
    let finding = only(&acknowledged);
    assert_eq!((finding.name.as_str(), finding.state), ("state-refused", FindingState::Confirmed));
    script.exchange(&[fpwr(0x1001, 0x0120, &[4, 0])]);
    script.exchange(&[fprd(0x1001, 0x0130, &[0x04, 0, 0, 0, 0, 0])]);
    let reached = report(&mut script);
    assert_eq!(only(&reached).state, FindingState::Closed);
    assert_eq!(reached.verdict, Verdict::Faulty, "it was there");
}

// silent: S200
#[test]
fn a_copied_acknowledge_bit_is_no_error() {
    let mut script = Script::scanned(2);
    // A coupler without processor shows what was written, acknowledge bit and all.
    script.exchange(&[fpwr(0x1001, 0x0120, &[0x14, 0])]);
    script.exchange(&[fprd(0x1001, 0x0130, &[0x14, 0, 0, 0, 0, 0])]);
    let report = report(&mut script);
    assert_ne!(report.verdict, Verdict::Faulty, "{}", text(&report));
}

// fires: S202
// proves: SW-03 partial
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

// fires: S210
// silent: H102
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
fn devices_that_do_not_answer_either_are_the_ones() {
    let mut script = running();
    cycles(&mut script, 10, 0);
    script.exchange(&[fprd(0x1003, 0x0130, &[0, 0]).wkc(0)]);
    script.exchange(&[fprd(0x1002, 0x0130, &[0, 0]).wkc(0)]);
    cycles(&mut script, 100, 0);
    let report = report(&mut script);
    // All behind one link: it is that link, and what is missing follows.
    let link = only(&report);
    assert_eq!((link.code.as_str(), link.cause), ("H102", FaultName::LinkOpen));
    assert!(
        matches!(link.place, PlaceReport::Link { a, b: Some(b), .. } if (a.no, b.no) == (1, 2))
    );
    let below: Vec<_> = link.consequences.iter().map(|one| one.name.as_str()).collect();
    assert_eq!(below.iter().filter(|name| **name == "not-answering").count(), 2, "{below:?}");
    assert!(below.contains(&"working-counter-low"), "{}", text(&report));
}

/// Two that share one working counter alike: which of them misses is not known, but whatever explains it of both
/// explains it.
#[test]
fn a_share_that_may_be_anybodys_hangs_beneath_what_explains_it_of_all() {
    let play = |is_silent: bool| {
        let mut script = running();
        let inputs = FmmuConfig::inputs(LogicalAddress(PROCESS + 4), 2, RegisterAddress(0x1180));
        for station in [0x1002, 0x1003] {
            script.exchange(&[fpwr(station, 0x0610, &inputs.to_bytes())]);
        }
        let both = |script: &mut Script, wkc| script.exchange(&[lrw(PROCESS + 4, 2, wkc)]);
        for _ in 0..100 {
            both(&mut script, 2);
        }
        for _ in 0..if is_silent { 60 } else { 0 } {
            script.vanish(&[lrw(PROCESS + 4, 2, 2)]);
        }
        for _ in 0..20 {
            both(&mut script, 1);
        }
        for _ in 0..100 {
            both(&mut script, 2);
        }
        report(&mut script)
    };
    let alone = play(false);
    assert_eq!(only(&alone).name, "working-counter-low", "{}", text(&alone));
    let after_silence = play(true);
    let finding = only(&after_silence);
    assert_eq!(finding.name, "nobody-answers", "{}", text(&after_silence));
    assert!(finding.consequences.iter().any(|below| below.name == "working-counter-low"));
}

// silent: S210
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
    assert_ne!(report.verdict, Verdict::Faulty, "{}", text(&report));
}

/// What starts anew so often that it has an address only now and then is hardly ever missed. Its links come up each
/// time, and leave errors in its counters.
// silent: H110
#[test]
fn errors_of_a_start_that_nobody_missed_are_no_damage() {
    let play = |starts_anew: bool| {
        let mut script = running();
        script.exchange(&[fprd(0x1002, 0x0300, &[0; 20])]);
        cycles(&mut script, 20, 3);
        if starts_anew {
            script.exchange(&[fprd(0x1002, 0x0130, &[1, 0, 0, 0, 0, 0])]);
        }
        let mut counted = [0; 20];
        (counted[0], counted[1]) = (3, 3);
        script.exchange(&[fprd(0x1002, 0x0300, &counted)]);
        for station in [0x1001, 0x1003] {
            script.exchange(&[fprd(station, 0x0300, &[0; 20])]);
        }
        report(&mut script)
    };
    let damaged = play(false);
    assert_eq!(only(&damaged).code, "H110", "{}", text(&damaged));
    let restarted = play(true);
    assert_eq!(only(&restarted).code, "H150", "{}", text(&restarted));
}

// fires: H150
// silent: S205
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

// proves: FRM-19 partial
#[test]
fn probes_are_asked_for_once_something_is_wrong() {
    let mut script = Script::with(linesman_diagnosis::Setup {
        input: linesman_diagnosis::InputKind::Driven,
        probes: true,
        ..linesman_diagnosis::Setup::default()
    });
    script.scan(2);
    cycles(&mut script, 200, 3);
    assert!(script.engine.poll_probe().is_none());
    cycles(&mut script, 200, 1);
    let probes: Vec<_> = std::iter::from_fn(|| script.engine.poll_probe()).collect();
    assert_eq!(probes.len(), 2 * 3);
    let counters = Asked::Register { address: RegisterAddress(0x0300), len: 20 };
    assert!(probes.iter().any(|probe| probe.what == counters));
}

/// Who is asked for counters how often in 100 ms, after these two stations counted symbols at port A.
fn asked_for_counters(noisy: &[u16]) -> Vec<(u16, usize)> {
    let setup = linesman_diagnosis::Setup { probes: true, ..linesman_diagnosis::Setup::default() };
    let mut plant = Plant::new(setup);
    for symbols in [0, 3] {
        for station in 0x1001..=0x1003 {
            let mut data = [0; 20];
            data[1] = if noisy.contains(&station) { symbols } else { 0 };
            plant.read(station, 0x0300, &data);
        }
        plant.cycles(10);
    }
    while plant.script.engine.poll_probe().is_some() {}
    plant.cycles(100);
    let counters = Asked::Register { address: RegisterAddress(0x0300), len: 20 };
    let mut asked = std::collections::BTreeMap::new();
    while let Some(probe) = plant.script.engine.poll_probe() {
        assert_eq!(probe.effect, linesman_diagnosis::ProbeEffect::Reads);
        if probe.what == counters {
            *asked.entry(probe.station.0).or_default() += 1;
        }
    }
    asked.into_iter().collect()
}

// proves: FRM-19 partial, FRM-29 partial
#[test]
fn counters_of_two_noisy_links_are_read_closely_and_those_of_one_are_not() {
    let asked = asked_for_counters(&[0x1002, 0x1003]);
    let stations: Vec<u16> = asked.iter().map(|(station, _)| *station).collect();
    assert_eq!(stations, [0x1002, 0x1003]);
    assert!(asked.iter().all(|(_, times)| (15..=21).contains(times)), "{asked:?}");
    assert_eq!(asked_for_counters(&[0x1002]), []);
}

fn host(script: &mut Script, what: HostEvent) {
    script.now += 1_000_000;
    let observation = HostObservation {
        network: Network(0),
        path: Path::A,
        time: Instant::from_nanos(script.now),
        what,
    };
    script.engine.handle_host(&observation);
}

// fires: X510
// silent: X511, X512
#[test]
fn a_host_that_drops_frames_is_blamed_itself() {
    let mut script = running();
    host(&mut script, HostEvent::SocketDrops(0));
    host(&mut script, HostEvent::SocketDrops(12));
    let report = report(&mut script);
    let finding = only(&report);
    assert_eq!((finding.name.as_str(), finding.cause), ("host-drops-frames", FaultName::HostDrops));
    assert_eq!(finding.place, PlaceReport::Host);
}

// fires: X511
// silent: X510
#[test]
fn late_cycles_are_a_warning_once_they_are_many() {
    let mut script = running();
    host(&mut script, HostEvent::Late(Span::us(300)));
    host(&mut script, HostEvent::Late(Span::us(1500)));
    script.engine.finish(Instant::from_nanos(script.now), true);
    assert_eq!(script.engine.diagnosis().verdict, Verdict::Healthy, "two are none");
    host(&mut script, HostEvent::Late(Span::us(900)));
    let report = report(&mut script);
    assert_eq!(only(&report).cause, FaultName::HostJitter);
}

// fires: C330
// silent: C330
#[test]
fn two_senders_are_two_maindevices_but_two_cards_are_not() {
    let other = |script: &mut Script, datagram: &crate::support::script::Datagram| {
        for is_back in [false, true] {
            let index = script.index;
            let mut bytes =
                crate::support::script::frame(std::slice::from_ref(datagram), index, is_back);
            bytes[11] = 0x77;
            script.feed(&bytes, linesman_diagnosis::Direction::Unknown, 10_000);
        }
        script.index = script.index.wrapping_add(1);
    };
    let mut script = running();
    for _ in 0..30 {
        cycles(&mut script, 1, 3);
        other(&mut script, &brd(0x0130, &[8, 0], 3));
    }
    let report_of_two = report(&mut script);
    let finding = only(&report_of_two);
    assert_eq!(finding.cause, FaultName::SecondMainDevice);
    assert!(finding.evidence[0].text.contains("10:10:10:10:10:77"), "{}", finding.evidence[0].text);
    // The second card of a ring repeats each request while the first one is out.
    let mut script = running();
    for _ in 0..30 {
        let datagrams = [brd(0x0130, &[8, 0], 3)];
        script.send(&datagrams);
        let index = script.index;
        let mut copy = crate::support::script::frame(&datagrams, index, false);
        copy[11] = 0x77;
        script.feed(&copy, linesman_diagnosis::Direction::Unknown, 1_000);
        script.give_back(&datagrams);
        let mut back = crate::support::script::frame(&datagrams, index, true);
        back[11] = 0x77;
        script.feed(&back, linesman_diagnosis::Direction::Unknown, 1_000);
        script.index = script.index.wrapping_add(1);
    }
    let report_of_ring = report(&mut script);
    assert_eq!(report_of_ring.verdict, Verdict::Healthy, "{}", text(&report_of_ring));
}

#[test]
fn a_live_card_that_receives_what_nobody_here_sent_sees_another_maindevice() {
    let mut script = Script::new();
    script.is_live = true;
    script.scan(2);
    for _ in 0..30 {
        cycles(&mut script, 1, 3);
        let index = script.index.wrapping_add(100);
        let mut bytes = crate::support::script::frame(&[brd(0x0130, &[2, 0], 2)], index, true);
        bytes[11] = 0x77;
        script.feed(&bytes, linesman_diagnosis::Direction::Received, 10_000);
    }
    let report = report(&mut script);
    assert_eq!(only(&report).cause, FaultName::SecondMainDevice);
}

/// A mailbox read that brings a CoE emergency.
fn emergency(station: u16, code: u16) -> crate::support::script::Datagram {
    let [low, high] = code.to_le_bytes();
    // Mailbox header: 10 bytes, from nobody, CoE, counter 1; CoE header: service 1.
    let message = [10, 0, 0, 0, 0, 0x13, 0, 0x10, low, high, 0x09, 1, 2, 3, 4, 5];
    fprd(station, 0x1080, &message)
}

// fires: S240
#[test]
fn an_emergency_is_read_and_withdrawn_by_its_device() {
    let mut script = running();
    script.exchange(&[emergency(0x1002, 0x4210)]);
    let sent = report(&mut script);
    let finding = only(&sent);
    assert_eq!((finding.cause, no(finding)), (FaultName::Emergency, Some(2)));
    assert_eq!(finding.state, FindingState::Confirmed);
    let shown = &finding.evidence[0].text;
    assert!(shown.contains("0x4210") && shown.contains("temperature"), "{shown}");
    script.exchange(&[emergency(0x1002, 0x0000)]);
    assert_eq!(only(&report(&mut script)).state, FindingState::Closed);
}

// silent: S240
#[test]
fn a_device_that_says_all_is_well_has_no_emergency() {
    let mut script = running();
    script.exchange(&[emergency(0x1002, 0x0000)]);
    let report = report(&mut script);
    assert_ne!(report.verdict, Verdict::Faulty, "{}", text(&report));
}

#[test]
fn a_broadcast_of_states_is_not_a_state() {
    let mut script = Script::scanned(2);
    // One in INIT with error, one in OP: 0x19 names neither.
    script.exchange(&[brd(0x0130, &[0x19, 0], 2)]);
    let report = report(&mut script);
    assert_eq!(report.network.al_state_highest.as_deref(), Some("OP"));
    assert_ne!(report.verdict, Verdict::Faulty, "{}", text(&report));
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

#[test]
fn a_run_joined_in_the_middle_is_put_in_the_order_of_stations() {
    let mut script = Script::new();
    // Polled from the middle on, as a MainDevice that goes round does.
    for station in [0x1003, 0x1001, 0x1002] {
        let dl: u16 = if station == 0x1003 { 0x5617 } else { 0x5A37 };
        script.exchange(&[fprd(station, 0x0110, &dl.to_le_bytes())]);
        script.exchange(&[fprd(station, 0x0130, &[8, 0, 0, 0, 0, 0])]);
    }
    script.exchange(&[brd(0x0130, &[8, 0], 3)]);
    script.finish();
    let model = script.engine.model(Network(0)).unwrap();
    let stations: Vec<_> = model.devices.iter().map(|device| device.station.unwrap().0).collect();
    assert_eq!(stations, [0x1001, 0x1002, 0x1003]);
    let tree = model.tree.as_ref().unwrap();
    assert_eq!([tree.parent(0), tree.parent(1), tree.parent(2)], [None, Some(0), Some(1)]);
}

// fires: S206
#[test]
fn a_processor_that_stops_shows_in_dl_status() {
    let mut script = running();
    script.exchange(&[fprd(0x1002, 0x0110, &[0x37, 0x5A])]);
    script.exchange(&[fprd(0x1002, 0x0110, &[0x35, 0x5A])]);
    // What it says of synchronisation follows.
    script.exchange(&[fprd(0x1002, 0x0130, &[0x14, 0, 0, 0, 0x1A, 0])]);
    let lasting = report(&mut script);
    let finding = only(&lasting);
    assert_eq!((finding.name.as_str(), no(finding)), ("processor-stopped", Some(2)));
    assert_eq!(finding.cause, FaultName::FirmwareFault);
    assert_eq!(finding.consequences.len(), 1, "{}", text(&lasting));
    script.exchange(&[fprd(0x1002, 0x0110, &[0x37, 0x5A])]);
    let again = report(&mut script);
    assert_eq!(only(&again).state, FindingState::Closed);
}

// silent: S206
#[test]
fn a_device_that_was_without_supply_has_no_stopped_processor() {
    let mut script = running();
    script.exchange(&[fprd(0x1002, 0x0110, &[0x37, 0x5A]).wkc(0)]);
    // Its firmware is not up yet.
    script.exchange(&[fprd(0x1002, 0x0110, &[0x35, 0x5A])]);
    let report = report(&mut script);
    assert!(report.findings.iter().all(|one| one.code != "S206"), "{}", text(&report));
}

/// Some read the second byte of DL status alone, and the whole of it later: of the first one nothing was known.
// silent: S206
#[test]
fn a_bit_that_was_never_read_has_not_fallen() {
    let mut script = Script::new();
    script.exchange(&[brd(0x0000, &[0x11, 0], 2)]);
    for (station, high) in [(0x1001, 0x5A), (0x1002, 0x56)] {
        script.exchange(&[fprd(station, 0x0111, &[high])]);
        script.exchange(&[fprd(station, 0x0110, &[0x31, high])]);
    }
    let report = report(&mut script);
    assert!(report.findings.iter().all(|one| one.code != "S206"), "{}", text(&report));
}

// fires: C332
#[test]
fn two_answers_to_one_address_are_found_and_nothing_is_learnt_of_them() {
    let mut script = running();
    // The third one has taken the second one's address: it does not answer to its own any more.
    script.exchange(&[fprd(0x1003, 0x0130, &[8, 0, 0, 0, 0, 0]).wkc(0)]);
    script.exchange(&[fprd(0x1002, 0x0300, &[0x5A; 20]).wkc(2)]);
    script.exchange(&[fprd(0x1002, 0x0110, &[0x11, 0x11]).wkc(2)]);
    let report = report(&mut script);
    let finding = only(&report);
    assert_eq!((finding.code.as_str(), no(finding)), ("C332", Some(3)), "{}", text(&report));
    assert_eq!(finding.cause, FaultName::DuplicateAddress);
    assert!(finding.evidence[0].text.contains("working counter 2"), "{}", text(&report));
}

// silent: C332
#[test]
fn one_answer_each_is_no_shared_address() {
    let mut script = running();
    // One silent SubDevice, and one that reads and writes at once: 3 is what one of them adds.
    script.exchange(&[fprd(0x1003, 0x0130, &[8, 0, 0, 0, 0, 0]).wkc(0)]);
    let mut both = fprd(0x1002, 0x0120, &[8, 0]);
    both.command = linesman_proto::command::Command::Fprw;
    script.exchange(&[both.wkc(3)]);
    let report = report(&mut script);
    assert!(report.findings.iter().all(|one| one.code != "C332"), "{}", text(&report));
}
