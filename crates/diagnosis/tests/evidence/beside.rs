//! What frames alone tell of a line that another MainDevice drives, above all to whoever begins to listen in the middle
//! of a run: no counters are read, no wiring, few states.

use crate::support::script::{Datagram, Script, apwr, brd, fprd, fpwr, frame_of, lrw};
use crate::support::text;
use linesman_config::fault::FaultName;
use linesman_diagnosis::coverage::InputKind;
use linesman_diagnosis::report::{Diagnosis, FindingReport, PlaceReport, Severity, Verdict};
use linesman_diagnosis::{Direction, Setup};
use linesman_proto::address::{LogicalAddress, RegisterAddress};
use linesman_proto::ethernet::MacAddress;
use linesman_proto::register::FmmuConfig;

const SOEM: MacAddress = MacAddress([0x01; 6]);
const KICKCAT: MacAddress = MacAddress([0xCA, 0xDE, 0xCA, 0xDE, 0xDE, 0xFF]);
const ETHERCRAB: MacAddress = MacAddress([0x10; 6]);
const PROCESS: u32 = 0x0100_0000;
/// In the event field: DL status of a SubDevice has changed.
const DL_STATUS: u16 = 0x0004;
const OP: [u8; 6] = [8, 0, 0, 0, 0, 0];

fn listening(sender: MacAddress) -> Script {
    let setup = Setup { input: InputKind::Listened, ..Setup::default() };
    Script { sender, is_live: true, ..Script::with(setup) }
}

/// A cycle of 2 ms: process data, then these.
fn cycles(script: &mut Script, count: u64, others: impl Fn(u64) -> Vec<Datagram>) {
    cycles_with(0, script, count, others);
}

/// The same with events in each frame.
fn cycles_with(
    events: u16,
    script: &mut Script,
    count: u64,
    others: impl Fn(u64) -> Vec<Datagram>,
) {
    let begin = script.now;
    for cycle in 0..count {
        script.now = script.now.max(begin + cycle * 2_000_000);
        script.exchange(&[lrw(PROCESS, 8, 6).events(events)]);
        let others: Vec<_> = others(cycle).into_iter().map(|one| one.events(events)).collect();
        if !others.is_empty() {
            script.exchange(&others);
        }
    }
}

/// All of these stations in turn, one every ten cycles; those that are away do not answer.
fn polls(base: u16, count: u16, away: &'static [u16]) -> impl Fn(u64) -> Vec<Datagram> {
    move |cycle| {
        let station = base + (cycle / 10 % u64::from(count)) as u16;
        let answer = fprd(station, 0x0130, &OP);
        match (cycle % 10, away.contains(&station)) {
            (0, false) => vec![answer],
            (0, true) => vec![answer.wkc(0)],
            (_, _) => Vec::new(),
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

fn no(finding: &FindingReport) -> Option<u32> {
    match finding.place {
        PlaceReport::Device { no, .. } => Some(no),
        // The way into one, from somewhere.
        PlaceReport::Link { a, b: None, .. } => Some(a.no),
        PlaceReport::Link { .. } | PlaceReport::Network { .. } | PlaceReport::Host => None,
    }
}

fn is_network(finding: &FindingReport) -> bool {
    matches!(finding.place, PlaceReport::Network { .. })
}

#[test]
fn missing_subdevice_has_the_number_of_its_station_address_though_nobody_has_counted() {
    for (sender, base) in [(SOEM, 0x1001), (KICKCAT, 1001), (ETHERCRAB, 0x1000)] {
        let mut script = listening(sender);
        // All in one frame, the first to answer not the first of the line.
        let away = base + 3;
        let all = move |cycle: u64| {
            let first = cycle % 6;
            let stations = (0..6).map(|step| base + ((first + step) % 6) as u16);
            stations
                .map(|station| fprd(station, 0x0130, &OP).wkc(u16::from(station != away)))
                .collect()
        };
        cycles(&mut script, 300, all);
        let report = report(&mut script);
        assert_eq!(codes(&report), ["H102"], "{sender}: {}", text(&report));
        assert_eq!(no(&report.findings[0]), Some(4), "{sender}: {}", text(&report));
    }
}

#[test]
fn subdevices_that_come_back_have_the_numbers_that_they_had() {
    let mut script = listening(SOEM);
    let polled = |away: &'static [u16], present: u16| {
        let polls = polls(0x1001, 4, away);
        move |cycle: u64| {
            let mut all = polls(cycle);
            all.extend(cycle.is_multiple_of(25).then(|| brd(0x0130, &[8, 0], present)));
            all
        }
    };
    cycles(&mut script, 300, polled(&[0x1003], 3));
    cycles(&mut script, 1_200, polled(&[], 4));
    let report = report(&mut script);
    assert_eq!(report.network.devices.0, 4, "{}", text(&report));
    assert!(report.findings.iter().all(|one| one.closed_ns.is_some()), "{}", text(&report));
    let stations: Vec<_> = report.devices.iter().map(|device| device.station).collect();
    assert_eq!(stations, [Some(0x1001), Some(0x1002), Some(0x1003), Some(0x1004)]);
}

#[test]
fn subdevices_that_vanish_in_the_middle_of_the_order_hang_on_somebody_before_them() {
    let mut script = listening(SOEM);
    cycles(&mut script, 300, polls(0x1001, 6, &[]));
    // Those behind one port of a coupler: whoever hangs on its next port still answers.
    cycles(&mut script, 600, polls(0x1001, 6, &[0x1002, 0x1003, 0x1004]));
    let report = report(&mut script);
    let cut = &report.findings[0];
    assert_eq!((cut.code.as_str(), cut.cause), ("H102", FaultName::LinkOpen), "{}", text(&report));
    assert_eq!(no(cut), Some(2), "{}", text(&report));
    assert_eq!(cut.consequences.len(), 3, "{}", text(&report));
    assert!(cut.evidence[0].text.contains("what SubDevice 2 hangs on was not seen"));
}

/// A coupler and its terminals have started anew; whoever hangs behind them answers on.
// fires: H102
#[test]
fn subdevices_through_which_frames_go_have_started_anew() {
    let mut script = listening(ETHERCRAB);
    cycles(&mut script, 300, polls(0x1000, 6, &[]));
    cycles(&mut script, 600, polls(0x1000, 6, &[0x1000, 0x1001, 0x1002, 0x1003]));
    let report = report(&mut script);
    let anew = &report.findings[0];
    assert_eq!(codes(&report), ["H102"], "{}", text(&report));
    assert_eq!((anew.cause, no(anew)), (FaultName::BrownOut, Some(1)), "{}", text(&report));
    assert!(anew.evidence[0].text.contains("and 3 that follow upon it"), "{}", text(&report));
}

// fires: H100
#[test]
fn addresses_that_are_given_anew_after_a_silence_are_a_restart_of_the_first() {
    let mut script = listening(SOEM);
    for _ in 0..400 {
        script.now += 4_000_000;
        script.vanish(&[lrw(PROCESS, 8, 6)]);
    }
    let states = |away: u16| {
        let answer = |station| fprd(station, 0x0130, &OP).wkc(u16::from(station > away));
        (0x1001..=0x1004).map(answer).collect::<Vec<_>>()
    };
    script.exchange(&states(0x1002));
    for position in 0..2 {
        let station = (0x1001_u16 + position).to_le_bytes();
        script.exchange(&[apwr(position, 0x0010, &station, 4)]);
    }
    cycles(&mut script, 300, |_| states(0));
    let report = report(&mut script);
    let anew = &report.findings[0];
    assert_eq!(codes(&report), ["H100"], "{}", text(&report));
    assert_eq!((anew.cause, no(anew)), (FaultName::BrownOut, Some(1)), "{}", text(&report));
    assert!(text(&report).contains("2 SubDevices, SubDevice 1 the first of them"));
}

// fires: H105
#[test]
fn event_that_comes_while_the_line_runs_is_a_link_that_changed_somewhere() {
    let mut script = listening(SOEM);
    cycles(&mut script, 300, polls(0x1001, 3, &[]));
    cycles_with(DL_STATUS, &mut script, 900, polls(0x1001, 3, &[]));
    let report = report(&mut script);
    let finding = &report.findings[0];
    assert_eq!(codes(&report), ["H105"], "{}", text(&report));
    assert!(is_network(finding) && finding.severity == Severity::Warning, "{}", text(&report));
}

// silent: H105
#[test]
fn event_that_stands_from_the_first_frame_on_only_keeps_the_line_from_being_healthy() {
    for (events, verdict) in [(0, Verdict::Healthy), (DL_STATUS, Verdict::Inconclusive)] {
        let mut script = listening(SOEM);
        cycles_with(events, &mut script, 600, polls(0x1001, 3, &[]));
        let report = report(&mut script);
        assert_eq!(report.verdict, verdict, "{}", text(&report));
        assert!(codes(&report).is_empty(), "{}", text(&report));
        let is_told = text(&report).contains("nobody has read since whose");
        assert_eq!(is_told, events != 0, "{}", text(&report));
    }
}

// silent: H105
#[test]
fn event_of_a_subdevice_that_fell_silent_is_what_that_brought_about() {
    let mut script = listening(SOEM);
    cycles(&mut script, 300, polls(0x1001, 3, &[]));
    cycles_with(DL_STATUS, &mut script, 900, polls(0x1001, 3, &[0x1003]));
    let report = report(&mut script);
    assert_eq!(codes(&report), ["H102"], "{}", text(&report));
}

/// SubDevices without a processor copy the acknowledgement that KickCAT writes with each request.
// silent: S200, S201
#[test]
fn acknowledgement_that_stood_before_anybody_listened_is_no_error() {
    let state = |data: &'static [u8]| {
        move |cycle: u64| match cycle % 10 {
            0 => (1001..=1003).map(|station| fprd(station, 0x0130, data)).collect(),
            _ => Vec::new(),
        }
    };
    let mut script = listening(KICKCAT);
    cycles(&mut script, 600, state(&[0x18, 0, 0, 0, 0, 0]));
    let read = report(&mut script);
    assert_eq!((read.verdict, codes(&read).len()), (Verdict::Healthy, 0), "{}", text(&read));
    // Where the code is not read, the kind of the MainDevice decides.
    for (sender, verdict) in [(KICKCAT, Verdict::Healthy), (ETHERCRAB, Verdict::Inconclusive)] {
        let mut script = listening(sender);
        cycles(&mut script, 600, state(&[0x18, 0]));
        let unread = report(&mut script);
        assert_eq!((unread.verdict, codes(&unread).len()), (verdict, 0), "{}", text(&unread));
    }
    // What has a code is meant.
    let mut script = listening(KICKCAT);
    cycles(&mut script, 600, state(&[0x14, 0, 0, 0, 0x1B, 0]));
    assert_eq!(report(&mut script).verdict, Verdict::Faulty);
}

/// One of three is in SAFEOP with an error, and nobody reads its code.
fn starved(cycle: u64) -> Vec<Datagram> {
    let states = [[8, 0], [8, 0], [0x14, 0]].into_iter().zip(0x1000..);
    match cycle % 10 {
        0 => states.map(|(state, station)| fprd(station, 0x0130, &state)).collect(),
        _ => Vec::new(),
    }
}

// fires: S201
#[test]
fn safeop_with_an_error_whose_code_nobody_reads_is_most_likely_a_watchdog() {
    let mut script = listening(ETHERCRAB);
    cycles(&mut script, 600, starved);
    let report = report(&mut script);
    let finding = &report.findings[0];
    assert_eq!(codes(&report), ["S201"], "{}", text(&report));
    assert_eq!((finding.cause, no(finding)), (FaultName::WatchdogStarved, Some(3)));
    assert!(finding.confidence <= 0.5, "{}", text(&report));
    assert!(text(&report).contains("nobody has read its AL status code"), "{}", text(&report));
}

// fires: X513
#[test]
fn watchdog_that_expired_before_anybody_listened_is_explained_by_pauses_that_go_on() {
    let mut script = listening(ETHERCRAB);
    for _ in 0..3 {
        cycles(&mut script, 400, starved);
        script.now += 300_000_000;
    }
    cycles(&mut script, 400, starved);
    let report = report(&mut script);
    let told = |finding: &&FindingReport| finding.code == "X513";
    let paused = report.findings.iter().find(told).unwrap_or_else(|| panic!("{}", text(&report)));
    assert!(matches!(paused.place, PlaceReport::Host), "{}", text(&report));
    assert!(codes(&report).iter().all(|code| *code == "X513"), "{}", text(&report));
}

// fires: X513
// silent: H100
#[test]
fn pause_of_another_maindevice_is_a_note_and_no_open_link() {
    let mut script = listening(KICKCAT);
    cycles(&mut script, 400, polls(1001, 3, &[]));
    script.now += 300_000_000;
    cycles(&mut script, 400, polls(1001, 3, &[]));
    let report = report(&mut script);
    assert_eq!(codes(&report), ["X513"], "{}", text(&report));
    assert_eq!(report.findings[0].severity, Severity::Info, "{}", text(&report));
}

// fires: S252
#[test]
fn mailbox_that_reads_full_all_the_time_is_stuck() {
    let looks = |status: u8| {
        move |cycle: u64| match cycle % 200 {
            0 => vec![fprd(0x1002, 0x0805, &[status])],
            10 => (0x1001..=0x1003).map(|station| fprd(station, 0x0130, &OP)).collect(),
            _ => Vec::new(),
        }
    };
    let mut script = listening(SOEM);
    cycles(&mut script, 900, looks(1 << 3));
    let full = report(&mut script);
    assert_eq!(codes(&full), ["S252"], "{}", text(&full));
    assert_eq!(no(&full.findings[0]), Some(2), "{}", text(&full));
    let mut script = listening(SOEM);
    cycles(&mut script, 900, looks(0));
    assert!(codes(&report(&mut script)).is_empty());
}

// fires: H114
// silent: H100
#[test]
fn few_frames_lost_at_the_end_where_few_were_lost_before_are_no_open_link() {
    let lose = |script: &mut Script, count: u64| {
        for _ in 0..count {
            script.now += 40_000_000;
            script.vanish(&[lrw(PROCESS, 8, 6)]);
        }
    };
    let mut script = listening(KICKCAT);
    for _ in 0..8 {
        cycles(&mut script, 100, polls(1001, 3, &[]));
        lose(&mut script, 4);
    }
    let noisy = report(&mut script);
    assert_eq!(codes(&noisy), ["H114"], "{}", text(&noisy));
    // With nothing lost before, a line that ends in silence has lost its first link.
    let mut script = listening(KICKCAT);
    cycles(&mut script, 800, polls(1001, 3, &[]));
    lose(&mut script, 4);
    let silent = report(&mut script);
    assert_eq!(codes(&silent), ["H100"], "{}", text(&silent));
}

// fires: H100
#[test]
fn frames_that_go_on_leaving_the_card_show_that_it_has_a_link() {
    for (lasts_ms, cause) in [(400, FaultName::LinkOpen), (3_000, FaultName::FalseLink)] {
        let mut script = listening(SOEM);
        cycles(&mut script, 300, polls(0x1001, 3, &[]));
        for _ in 0..lasts_ms / 4 {
            script.now += 4_000_000;
            script.vanish(&[lrw(PROCESS, 8, 6)]);
        }
        let report = report(&mut script);
        let finding = &report.findings[0];
        assert_eq!((finding.code.as_str(), finding.cause), ("H100", cause), "{}", text(&report));
        assert_eq!(is_network(finding), cause == FaultName::FalseLink, "{}", text(&report));
    }
}

/// The inputs of an analogue terminal: a status with a bit that flips, and a value, twice.
fn inputs(cycle: u64, still_from: u64, others: u64) -> Datagram {
    let moving = cycle.min(still_from);
    let toggle = (moving as u8 & 1) << 7;
    let value = (moving as u16).wrapping_mul(7).to_le_bytes();
    let channel = [0, toggle, value[0], value[1]];
    let other = (others as u32).to_le_bytes();
    let back: Vec<u8> = [channel, channel, other].concat();
    Datagram { sent: vec![0xEE; 12], ..lrw(PROCESS, 12, 2) }.back(&back)
}

/// Two SubDevices with inputs, set up and in OP; those of the first end after this cycle, the others move on.
fn with_inputs(still_from: u64) -> Diagnosis {
    let mut script = Script::scanned(2);
    for (station, start, len) in [(0x1001, 0, 8), (0x1002, 8, 4)] {
        let fmmu =
            FmmuConfig::inputs(LogicalAddress(PROCESS + start), len, RegisterAddress(0x1180));
        script.exchange(&[fpwr(station, 0x0600, &fmmu.to_bytes())]);
        for state in [4, 8] {
            script.exchange(&[fpwr(station, 0x0120, &[state, 0])]);
            script.exchange(&[fprd(station, 0x0130, &[state, 0, 0, 0, 0, 0])]);
        }
    }
    for cycle in 0..2_000 {
        script.now += 900_000;
        script.exchange(&[inputs(cycle, still_from, cycle.min(1_000))]);
    }
    report(&mut script)
}

// fires: S211
// silent: S211
#[test]
fn toggle_bits_that_stop_are_an_application_that_has_stopped_and_values_that_stop_are_none() {
    let stopped = with_inputs(900);
    assert_eq!(codes(&stopped), ["S211"], "{}", text(&stopped));
    let finding = &stopped.findings[0];
    assert_eq!((finding.cause, no(finding)), (FaultName::FirmwareFault, Some(1)));
    // The second one has a value alone, which stops, too.
    let running = with_inputs(u64::MAX);
    assert!(codes(&running).is_empty(), "{}", text(&running));
}

/// An SDO to the second SubDevice, and its abort.
fn aborted(script: &mut Script, command: u8, index: u16) {
    let message = |service: u8, body: [u8; 8]| {
        let head = [10, 0, 0, 0, 0, 0x13, 0, service << 4];
        [head.as_slice(), &body].concat()
    };
    let [low, high] = index.to_le_bytes();
    let request = message(2, [command, low, high, 1, 0, 0, 0, 0]);
    let abort = message(2, [0x80, low, high, 1, 0x02, 0x00, 0x01, 0x06]);
    script.exchange(&[fpwr(0x1002, 0x1000, &request)]);
    script.exchange(&[fprd(0x1002, 0x1080, &abort)]);
}

// fires: S250
// silent: S250
#[test]
fn identity_that_is_not_given_at_once_is_no_finding_and_what_else_is_refused_is_a_note() {
    const UPLOAD: u8 = 0x40;
    const COMPLETE: u8 = 0x50;
    const DOWNLOAD: u8 = 0x23;
    let rows =
        [(COMPLETE, 0x1018, 0), (UPLOAD, 0x1018, 1), (COMPLETE, 0x6000, 1), (DOWNLOAD, 0x1C12, 1)];
    for (command, index, found) in rows {
        let mut script = listening(SOEM);
        cycles(&mut script, 100, polls(0x1001, 3, &[]));
        aborted(&mut script, command, index);
        cycles(&mut script, 100, polls(0x1001, 3, &[]));
        let report = report(&mut script);
        let count = codes(&report).iter().filter(|code| **code == "S250").count();
        assert_eq!(count, found, "0x{index:04X}: {}", text(&report));
    }
}

#[test]
fn error_that_the_maindevice_acknowledges_and_nobody_has_read_keeps_the_line_from_being_healthy() {
    let mut script = listening(SOEM);
    let all = |cycle: u64| match cycle % 10 {
        0 => (0x1001..=0x1003).map(|station| fprd(station, 0x0130, &OP)).collect(),
        _ => Vec::new(),
    };
    cycles(&mut script, 600, all);
    script.exchange(&[fpwr(0x1002, 0x0120, &[0x14, 0])]);
    script.exchange(&[fpwr(0x1002, 0x0120, &[0x08, 0])]);
    cycles(&mut script, 600, all);
    let report = report(&mut script);
    assert_eq!(codes(&report), <[&str; 0]>::default(), "{}", text(&report));
    assert_eq!(report.verdict, Verdict::Inconclusive, "{}", text(&report));
    assert!(text(&report).contains("acknowledged an error of SubDevice 2"), "{}", text(&report));
}

/// A frame of somebody who tries what the line bears.
fn odd(script: &mut Script, datagram: &Datagram, wkc_sent: u16) {
    let sender = MacAddress([0x66; 6]);
    let datagrams = std::slice::from_ref(datagram);
    let mut sent = frame_of(sender, datagrams, 0x77, false);
    let at = 16 + 10 + datagram.sent.len();
    sent[at..at + 2].copy_from_slice(&wkc_sent.to_le_bytes());
    script.feed(&sent, Direction::Sent, 10_000);
    let mut back = frame_of(sender, datagrams, 0x77, true);
    let added = wkc_sent.wrapping_add(datagram.wkc);
    back[at..at + 2].copy_from_slice(&added.to_le_bytes());
    script.feed(&back, Direction::Received, 10_000);
}

#[test]
fn odd_frames_do_not_make_a_line_of_thousands() {
    let mut script = listening(SOEM);
    cycles(&mut script, 300, polls(0x1001, 3, &[]));
    // A count that was there before, an address that nobody has, a position far beyond the end.
    odd(&mut script, &brd(0x0130, &[8, 0], 3), 0x7FF0);
    odd(&mut script, &fprd(0x4321, 0x0130, &[8, 0]).wkc(0), 0x0007);
    let far = Datagram { passed: 0x9001, ..brd(0x0130, &[8, 0], 3) };
    odd(&mut script, &far, 0);
    cycles(&mut script, 300, polls(0x1001, 3, &[]));
    let report = report(&mut script);
    assert_eq!(report.network.devices.0, 3, "{}", text(&report));
    let named = |finding: &&FindingReport| finding.code != "C330";
    assert_eq!(report.findings.iter().filter(named).count(), 0, "{}", text(&report));
}

/// Frames that come back a second time.
#[test]
fn frames_that_come_back_twice_keep_the_line_from_being_healthy() {
    let mut script = listening(SOEM);
    cycles(&mut script, 300, polls(0x1001, 3, &[]));
    for _ in 0..4 {
        let data = [lrw(PROCESS, 8, 6)];
        let back = frame_of(SOEM, &data, script.index, true);
        script.exchange(&data);
        script.feed(&back, Direction::Received, 200_000);
    }
    cycles(&mut script, 300, polls(0x1001, 3, &[]));
    let report = report(&mut script);
    assert_eq!(report.verdict, Verdict::Inconclusive, "{}", text(&report));
    assert!(text(&report).contains("4 frames came back a second time"), "{}", text(&report));
    assert!(codes(&report).is_empty(), "{}", text(&report));
}

// fires: H114
#[test]
fn frames_lost_at_equal_intervals_are_told_with_their_rhythm() {
    for (every, words) in [(50, "about every 98"), (0, "in bursts")] {
        let mut script = listening(SOEM);
        for round in 0..24_u64 {
            let calm = match every {
                0 if round % 8 == 0 => 400,
                0 => 2,
                every => every,
            };
            cycles(&mut script, calm, polls(0x1001, 3, &[]));
            script.vanish(&[lrw(PROCESS, 8, 6)]);
        }
        cycles(&mut script, 100, polls(0x1001, 3, &[]));
        let report = report(&mut script);
        assert_eq!(codes(&report), ["H114"], "{}", text(&report));
        assert!(text(&report).contains(words), "{words}: {}", text(&report));
    }
}

#[test]
fn more_that_answer_than_at_first_were_away_before() {
    let counted = |count: u16| {
        move |cycle: u64| match cycle % 25 {
            0 => vec![brd(0x0130, &[8, 0], count)],
            _ => Vec::new(),
        }
    };
    let mut script = listening(SOEM);
    cycles(&mut script, 300, counted(4));
    cycles(&mut script, 300, counted(6));
    let report = report(&mut script);
    assert_eq!(report.verdict, Verdict::Inconclusive, "{}", text(&report));
    assert!(text(&report).contains("4 SubDevices answered a broadcast at first"));
}

/// A coupler with three terminals on port B and two boxes on port C; a frame is away behind port B for so many ns.
fn branched(script: &mut Script) {
    script.exchange(&[brd(0x0000, &[0x11, 0], 6)]);
    for position in 0..6 {
        let station = (0x1001_u16 + position).to_le_bytes();
        script.exchange(&[apwr(position, 0x0010, &station, 6)]);
    }
    // Links and communication of ports A, B and C, of A and B, and of A alone, as DL status has them.
    let statuses: [u16; 6] = [0x6A73, 0x5A33, 0x5A33, 0x5613, 0x5A33, 0x5613];
    for (station, status) in (0x1001..).zip(statuses) {
        script.exchange(&[fprd(station, 0x0110, &status.to_le_bytes())]);
        script.exchange(&[fprd(station, 0x0130, &OP)]);
    }
    let times: Vec<u8> =
        [1_000_u32, 4_000, 6_200, 0].into_iter().flat_map(u32::to_le_bytes).collect();
    script.exchange(&[fprd(0x1001, 0x0900, &times)]);
}

/// Nobody asks anybody: a broadcast counts fewer, and which branch is gone the time of the frames tells.
// fires: H104
#[test]
fn step_in_the_time_of_frames_tells_which_of_two_branches_is_gone() {
    for (shorter, expected) in [(3_000, (1, 2)), (2_200, (1, 5))] {
        let gone = if expected.1 == 2 { 3 } else { 2 };
        let mut script = listening(SOEM);
        branched(&mut script);
        let mut play = |count: u64, present: u16, took: u64| {
            for _ in 0..count {
                let data = [brd(0x0130, &[8, 0], present), lrw(PROCESS, 8, 6)];
                script.send(&data);
                script.now -= 20_000;
                script.now += took;
                script.give_back(&data);
                script.index = script.index.wrapping_add(2);
                script.now += 1_900_000;
            }
        };
        play(400, 6, 50_000);
        play(400, 6 - gone, 50_000 - shorter);
        let report = report(&mut script);
        let cut = &report.findings[0];
        assert_eq!(codes(&report), ["H104"], "{}", text(&report));
        let PlaceReport::Link { a, b, .. } = cut.place else { panic!("{}", text(&report)) };
        assert_eq!((a.no, b.unwrap().no), expected, "{}", text(&report));
        let sooner = format!("come back {} sooner", linesman_proto::time::Span::ns(shorter));
        assert!(text(&report).contains(&sooner), "{sooner}: {}", text(&report));
    }
}
