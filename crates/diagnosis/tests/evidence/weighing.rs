//! What weighs how much: full counters, old counts, what one cause explains together, and what is told once.

use crate::support::script::{Script, brd, fprd, fpwr, lrw};
use crate::support::text;
use linesman_config::fault::FaultName;
use linesman_diagnosis::observation_file::ObservationFile;
use linesman_diagnosis::report::{
    Diagnosis, FindingReport, FindingState, PlaceReport, Severity, Verdict,
};
use linesman_diagnosis::{Setup, pasted};
use linesman_proto::address::{LogicalAddress, RegisterAddress};
use linesman_proto::register::FmmuConfig;

fn judge(text: &str) -> Diagnosis {
    ObservationFile::parse(text).unwrap().diagnosis(Setup::default())
}

fn codes(diagnosis: &Diagnosis) -> Vec<&str> {
    diagnosis.findings.iter().map(|finding| finding.code.as_str()).collect()
}

#[track_caller]
fn only(report: &Diagnosis) -> &FindingReport {
    let [finding] = &report.findings[..] else { panic!("one finding expected: {}", text(report)) };
    finding
}

fn link(finding: &FindingReport) -> Option<(u32, u32)> {
    link_of(&finding.place)
}

fn link_of(place: &PlaceReport) -> Option<(u32, u32)> {
    match place {
        PlaceReport::Link { a, b, .. } => Some((a.no, b.as_ref()?.no)),
        PlaceReport::Device { .. } | PlaceReport::Network { .. } | PlaceReport::Host => None,
    }
}

fn no(finding: &FindingReport) -> Option<u32> {
    match finding.place {
        PlaceReport::Device { no, .. } => Some(no),
        // The way into one, from somewhere.
        PlaceReport::Link { a, b: None, .. } => Some(a.no),
        PlaceReport::Link { .. } | PlaceReport::Network { .. } | PlaceReport::Host => None,
    }
}

/// SubDevices in a row, K1 to Kn, each with the lines given.
fn row(each: &[&str]) -> String {
    let device = |(index, lines): (usize, &&str)| {
        let on = if index == 0 { "maindevice".to_owned() } else { format!("K{index}.B") };
        format!("[[device]]\nname = \"K{}\"\non = \"{on}\"\n{lines}\n", index + 1)
    };
    each.iter().enumerate().map(device).collect()
}

/// A line of three that was scanned and runs: the second gives inputs, the third takes outputs.
fn running() -> Script {
    let mut script = Script::scanned(3);
    let inputs = FmmuConfig::inputs(LogicalAddress(PROCESS), 2, RegisterAddress(0x1180));
    let outputs = FmmuConfig::outputs(LogicalAddress(PROCESS + 2), 2, RegisterAddress(0x1100));
    script.exchange(&[fpwr(0x1002, 0x0600, &inputs.to_bytes())]);
    script.exchange(&[fpwr(0x1003, 0x0600, &outputs.to_bytes())]);
    for state in [4_u8, 8] {
        for station in 0x1001..=0x1003 {
            script.exchange(&[fpwr(station, 0x0120, &[state, 0])]);
            script.exchange(&[fprd(station, 0x0130, &[state, 0, 0, 0, 0, 0])]);
        }
    }
    cycles(&mut script, 100, 3);
    script
}

const PROCESS: u32 = 0x0100_0000;

fn cycles(script: &mut Script, count: usize, wkc: u16) {
    for _ in 0..count {
        script.exchange(&[lrw(PROCESS, 4, wkc)]);
    }
}

fn report(script: &mut Script) -> Diagnosis {
    script.finish();
    script.engine.diagnosis()
}

#[test]
fn full_counter_weighs_as_much_as_one_before_its_end() {
    // First in line, behind an earlier source that counts less, and behind one with symbols of its own.
    let first = |full: &str| {
        row(&[
            &format!("ports.A = {{ rx = \"0x{full}{full}\" }}"),
            "ports.A = { rx = \"0x000C\" }",
            "ports.A = { rx = \"0x000B\" }",
        ])
    };
    let behind = |full: &str| {
        row(&[
            "ports.A = { rx = \"0x0905\" }",
            &format!("ports.A = {{ rx = \"0x00{full}\" }}"),
            &format!("ports.A = {{ rx = \"0x00{full}\" }}"),
        ])
    };
    for file in [&first as &dyn Fn(&str) -> String, &behind] {
        let places = |full: &str| {
            let diagnosis = judge(&file(full));
            let found = diagnosis.findings.iter().map(|one| (one.code.clone(), one.place.clone()));
            found.collect::<Vec<_>>()
        };
        assert_eq!(places("FF"), places("FE"));
        assert!(!places("FF").is_empty());
    }
    let diagnosis = judge(&behind("FF"));
    let inside = diagnosis.findings.iter().find(|one| one.code == "H111").unwrap();
    assert_eq!(no(inside), Some(1));
    assert!(inside.evidence[0].text.contains("at least 250 of its own"), "{inside:#?}");
}

#[test]
fn counts_without_earlier_values_are_warnings_that_say_so() {
    let cases = [
        (["", "ports.A = { frame = 37, physical = 80 }"], "H110"),
        (["", "ports.A = { frame = 255, physical = 0 }"], "H111"),
        (["ports.B = { lost_link = 9 }", "ports.A = { lost_link = 9 }"], "H101"),
        (["processing_unit = 70", ""], "C333"),
        (
            ["ports.A = { frame = 0 }", "ports.A = { frame = 0, physical = 0, forwarded = 40 }"],
            "H115",
        ),
        (["crc = 900", ""], "H115"),
    ];
    for (each, code) in cases {
        let diagnosis = judge(&row(&each));
        let finding = only(&diagnosis);
        assert_eq!(
            (finding.code.as_str(), finding.severity),
            (code, Severity::Warning),
            "{each:?}"
        );
        assert!(finding.actions[0].contains("may be old"), "{:?}", finding.actions);
        assert!(finding.actions[0].contains("clear the counters and watch"));
    }
}

#[test]
fn counts_that_rose_since_an_earlier_value_are_errors() {
    let damage = "ports.A = { frame = 37, physical = 80, before = { frame = 30, physical = 70 } }";
    let lost = "ports.A = { lost_link = 9, before = { lost_link = 4 } }";
    for each in [damage, lost] {
        let diagnosis = judge(&row(&["", each]));
        let finding = only(&diagnosis);
        assert_eq!(finding.severity, Severity::Error, "{finding:#?}");
        assert!(!finding.actions[0].contains("may be old"));
    }
    // Frames that are being lost now say the same.
    let now = format!(
        "{}[maindevice]\nlost = 37\nlost_per_s = 2.5\ncrc = 37\n",
        row(&["", "ports.A = { frame = 37, physical = 80 }"])
    );
    assert_eq!(only(&judge(&now)).severity, Severity::Error);
}

// fires: C304
// silent: H101
#[test]
fn reversed_entry_is_c304_and_no_open_link() {
    let links = |a: bool, b: bool| {
        format!("state = \"OP\"\nports.A = {{ link = {a} }}\nports.B = {{ link = {b} }}")
    };
    let first = "state = \"OP\"\nports.B = { link = true }";
    let diagnosis = judge(&row(&[first, &links(false, true)]));
    let reversed = only(&diagnosis);
    assert_eq!((reversed.code.as_str(), no(reversed)), ("C304", Some(2)));
    assert_eq!(reversed.cause, FaultName::PortsSwapped);
    // The first one of all: the MainDevice is plugged into the wrong port.
    let diagnosis = judge(&row(&[&links(false, true)]));
    assert_eq!(only(&diagnosis).cause, FaultName::MainDeviceWrongPort);
    // The right way round, and one that does not answer.
    assert_eq!(codes(&judge(&row(&[first, &links(true, false)]))), [""; 0]);
    let gone = "state = \"INIT NO_COMM\"";
    assert!(
        !codes(&judge(&row(&["state = \"OP\"\nports.B = { link = false }", gone])))
            .contains(&"C304")
    );
}

// fires: C304
#[test]
fn reversed_entry_shows_in_polled_dl_status_without_a_plan() {
    let mut script = Script::new();
    script.exchange(&[brd(0x0000, &[0x11, 0], 2)]);
    // Port A of the second has no link, port B has one.
    for (station, dl) in [(0x1001_u16, 0x5A37_u16), (0x1002, 0x5927)] {
        script.exchange(&[fprd(station, 0x0110, &dl.to_le_bytes())]);
        script.exchange(&[fprd(station, 0x0130, &[8, 0, 0, 0, 0, 0])]);
    }
    let report = report(&mut script);
    let reversed = only(&report);
    assert_eq!((reversed.code.as_str(), no(reversed)), ("C304", Some(2)), "{}", text(&report));
}

// fires: H102
#[test]
fn all_silent_behind_one_link_are_one_finding_at_that_link() {
    let gone = "state = \"INIT NO_COMM\"";
    let diagnosis = judge(&row(&["state = \"OP\"", gone, gone, gone]));
    let cut = only(&diagnosis);
    assert_eq!(
        (cut.code.as_str(), cut.cause, link(cut)),
        ("H102", FaultName::LinkOpen, Some((1, 2)))
    );
    let below: Vec<_> = cut.consequences.iter().map(no).collect();
    assert_eq!(below, [Some(2), Some(3), Some(4)]);
    // One alone is one finding, too.
    let diagnosis = judge(&row(&["state = \"OP\"", "state = \"OP\"", gone]));
    assert_eq!(link(only(&diagnosis)), Some((2, 3)));
    // A link that is told to be up is not open: the SubDevice behind it is it.
    let up = "state = \"OP\"\nports.B = { link = true }";
    let diagnosis = judge(&row(&[up, gone, gone]));
    assert_eq!((no(only(&diagnosis)), only(&diagnosis).cause), (Some(2), FaultName::DeviceOff));
    // Some of them answer: it is no link.
    let diagnosis = judge(&row(&["state = \"OP\"", gone, "state = \"OP\""]));
    assert_eq!(no(only(&diagnosis)), Some(2));
}

// fires: H100
#[test]
fn nobody_of_a_list_answers_is_the_first_link() {
    let gone = "state = \"INIT NO_COMM\"";
    let diagnosis = judge(&row(&[gone, gone, gone]));
    let nobody = only(&diagnosis);
    assert_eq!((nobody.code.as_str(), nobody.cause), ("H100", FaultName::LinkOpen));
    assert_eq!(link(nobody), Some((0, 1)));
    assert_eq!(nobody.consequences.len(), 3);
}

#[test]
fn trailing_subdevices_that_a_foreign_maindevice_stops_reaching_are_one_finding_at_the_first() {
    // A recording that joins late and shows states alone: no links, no wiring.
    let mut script = Script::new();
    let poll = |script: &mut Script, gone: bool| {
        script.exchange(&[brd(0x0130, &[8, 0], if gone { 2 } else { 4 })]);
        for station in 0x1001..=0x1004 {
            let answer = fprd(station, 0x0130, &[8, 0, 0, 0, 0, 0]);
            let is_silent = gone && station > 0x1002;
            script.exchange(&[if is_silent { answer.wkc(0) } else { answer }]);
        }
    };
    (0..5).for_each(|_| poll(&mut script, false));
    (0..250).for_each(|_| poll(&mut script, true));
    let judged = |script: &mut Script, state: FindingState| {
        let report = report(script);
        let cut = only(&report);
        assert_eq!((cut.code.as_str(), cut.cause), ("H102", FaultName::LinkOpen));
        // What it hangs on was not seen: on a line without branches it is the link before it.
        assert_eq!((no(cut), cut.state), (Some(3), state), "{}", text(&report));
        assert!(cut.evidence[0].text.contains("was not seen"), "{}", text(&report));
        let places = cut.alternatives.iter().filter(|other| other.cause == FaultName::LinkOpen);
        let links: Vec<_> = places.filter_map(|other| link_of(other.place.as_ref()?)).collect();
        assert_eq!(links, [(2, 3)], "{}", text(&report));
    };
    judged(&mut script, FindingState::Confirmed);
    // The same when they are back, all of them as they were.
    (0..5).for_each(|_| poll(&mut script, false));
    judged(&mut script, FindingState::Closed);
}

// fires: S210
#[test]
fn a_working_counter_that_lacks_all_behind_a_link_names_the_link() {
    // Nobody polls states or links.
    let mut script = running();
    cycles(&mut script, 100, 0);
    let report = report(&mut script);
    let cut = only(&report);
    assert_eq!(
        (cut.code.as_str(), cut.cause, link(cut)),
        ("S210", FaultName::LinkOpen, Some((1, 2)))
    );
    // Whoever still answers is not behind an open link.
    let mut script = running();
    cycles(&mut script, 10_000, 0);
    script.exchange(&[fprd(0x1003, 0x0130, &[8, 0, 0, 0, 0, 0])]);
    let report = self::report(&mut script);
    assert_ne!(only(&report).cause, FaultName::LinkOpen, "{}", text(&report));
    // Nor is anybody while a broadcast counts all.
    let mut script = running();
    cycles(&mut script, 10_000, 0);
    script.exchange(&[brd(0x0130, &[8, 0], 3)]);
    let report = self::report(&mut script);
    assert_ne!(only(&report).cause, FaultName::LinkOpen, "{}", text(&report));
}

#[test]
fn a_typed_working_counter_that_lacks_all_behind_a_link_names_the_link() {
    let counter = "[[working_counter]]\nname = \"task\"\nexpected = 6\nreceived = 2\n\
                   inputs = [\"K2\", \"K3\"]\noutputs = [\"K4\", \"K5\"]\n";
    let diagnosis = judge(&format!("{}{counter}", row(&["", "", "", "", ""])));
    let cut = only(&diagnosis);
    assert_eq!(
        (cut.code.as_str(), cut.cause, link(cut)),
        ("S210", FaultName::LinkOpen, Some((3, 4)))
    );
}

// silent: C331
#[test]
fn counters_read_behind_their_clearing_write_in_one_frame_count_as_before_it() {
    let counters = [0, 255, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
    let mut script = Script::scanned(2);
    script.exchange(&[
        fprd(0x1001, 0x0300, &counters),
        fpwr(0x1001, 0x0300, &[0; 20]),
        fprd(0x1001, 0x0300, &counters),
    ]);
    script.now += 100_000_000;
    script.exchange(&[fprd(0x1001, 0x0300, &[0; 20])]);
    script.finish();
    let report = script.engine.diagnosis();
    assert!(!codes(&report).contains(&"C331"), "{}", text(&report));
}

// silent: C331
#[test]
fn a_clear_whose_return_was_lost_is_nobody_elses() {
    let play = |is_ours: bool| {
        let mut script = running();
        let mut counters = [0_u8; 20];
        counters[0] = 7;
        script.exchange(&[fprd(0x1001, 0x0300, &counters)]);
        if is_ours {
            script.vanish(&[fpwr(0x1001, 0x0300, &[0])]);
        }
        script.exchange(&[fprd(0x1001, 0x0300, &[0; 20])]);
        cycles(&mut script, 100, 3);
        report(&mut script)
    };
    assert!(codes(&play(false)).contains(&"C331"));
    assert!(!codes(&play(true)).contains(&"C331"), "{}", text(&play(true)));
}

// silent: S200, S201
#[test]
fn an_error_from_before_the_start_is_a_note_once_acknowledged() {
    let play = |is_acknowledged: bool| {
        let mut script = Script::new();
        script.exchange(&[brd(0x0000, &[0x11, 0], 1)]);
        script.exchange(&[fprd(0x1001, 0x0130, &[0x14, 0, 0, 0, 0x1B, 0])]);
        if is_acknowledged {
            script.exchange(&[fpwr(0x1001, 0x0120, &[0x11, 0])]);
            for state in [1_u8, 2, 4, 8] {
                script.exchange(&[fpwr(0x1001, 0x0120, &[state, 0])]);
                script.exchange(&[fprd(0x1001, 0x0130, &[state, 0, 0, 0, 0, 0])]);
            }
        }
        report(&mut script)
    };
    let acknowledged = play(true);
    let note = only(&acknowledged);
    assert_eq!((note.severity, note.state), (Severity::Info, FindingState::Closed));
    assert_ne!(acknowledged.verdict, Verdict::Faulty);
    assert!(note.evidence[0].text.contains("left over from an earlier run"), "{note:#?}");
    // Where process data went on already, it is of this run.
    let mut script = Script::new();
    cycles(&mut script, 20, 3);
    script.exchange(&[fprd(0x1001, 0x0130, &[0x14, 0, 0, 0, 0x1B, 0])]);
    script.exchange(&[fpwr(0x1001, 0x0120, &[0x14, 0])]);
    let running = report(&mut script);
    assert!(running.findings.iter().any(|one| one.severity == Severity::Error));
    let standing = play(false);
    assert_eq!((only(&standing).severity, standing.verdict), (Severity::Error, Verdict::Faulty));
}

// fires: S202
#[test]
fn watchdogs_that_expire_together_are_one_finding_of_the_network() {
    let starved = "state = \"ERR SAFEOP\"\nal_code = 0x1B";
    let diagnosis = judge(&row(&["state = \"OP\"", starved, starved, starved]));
    let together = only(&diagnosis);
    assert_eq!((together.code.as_str(), together.cause), ("S202", FaultName::WatchdogStarved));
    assert_eq!(together.place, PlaceReport::Network { network: 0 });
    assert_eq!(together.consequences.len(), 3);
    // One alone is its own.
    assert_eq!(no(only(&judge(&row(&["state = \"OP\"", starved])))), Some(2));
    // At different times it is no one cause.
    let reading = |at: u32, one: &str, other: &str| {
        format!(
            "[[reading]]\nat_s = {at}\n[[reading.device]]\nname = \"K1\"\n{one}\n[[reading.device]]\nname = \
             \"K2\"\n{other}\n"
        )
    };
    let op = "state = \"OP\"";
    let apart = [
        row(&["", ""]),
        reading(20, op, op),
        reading(30, starved, op),
        reading(90, starved, starved),
    ];
    let places: Vec<_> = judge(&apart.concat()).findings.iter().map(no).collect();
    assert_eq!(places, [Some(1), Some(2)]);
}

// fires: H101
#[test]
fn a_drop_counted_at_both_ends_is_told_once_as_the_link() {
    let lost =
        |port: char| format!("ports.{port} = {{ lost_link = 3, before = {{ lost_link = 1 }} }}");
    let diagnosis = judge(&row(&[&lost('B'), &lost('A')]));
    let dropped = only(&diagnosis);
    assert_eq!((dropped.code.as_str(), link(dropped)), ("H101", Some((1, 2))));
    assert_eq!(dropped.evidence.len(), 2, "both ends show it");
}

// fires: S209
#[test]
fn a_subdevice_that_stays_below_the_others_is_a_finding() {
    for (state, severity) in [
        ("INIT", Severity::Warning),
        ("PREOP", Severity::Warning),
        ("SAFEOP", Severity::Warning),
        ("BOOT", Severity::Warning),
        ("ERR INIT", Severity::Error),
    ] {
        let low = format!("state = \"{state}\"");
        let diagnosis = judge(&row(&["state = \"OP\"", &low, "state = \"OP\""]));
        let behind = only(&diagnosis);
        assert_eq!((behind.code.as_str(), no(behind)), ("S209", Some(2)), "{state}");
        assert_eq!(behind.severity, severity, "{state}");
        assert_eq!(behind.actions[0].contains("firmware update"), state == "BOOT", "{behind:#?}");
    }
    // A list of `ethercat slaves`.
    let list = "0  0:0  OP     +  EK1100\n1  0:1  PREOP  +  EL1008\n2  0:2  OP     +  EL2008\n";
    let diagnosis = pasted::read(list).unwrap().file.diagnosis(Setup::default());
    assert_eq!((only(&diagnosis).code.as_str(), no(only(&diagnosis))), ("S209", Some(2)));
}

// silent: S209
#[test]
fn states_that_were_asked_for_or_that_most_are_in_are_no_finding() {
    assert_eq!(codes(&judge(&row(&["state = \"PREOP\"", "state = \"PREOP\""]))), [""; 0]);
    let low = "state = \"SAFEOP\"";
    assert_eq!(codes(&judge(&row(&["state = \"OP\"", low, low]))), [""; 0], "most are not in OP");
    // Seen being asked for.
    let mut script = running();
    script.exchange(&[fpwr(0x1002, 0x0120, &[4, 0])]);
    script.exchange(&[fprd(0x1002, 0x0130, &[4, 0, 0, 0, 0, 0])]);
    let asked = report(&mut script);
    assert!(!codes(&asked).contains(&"S209"), "{}", text(&asked));
}

// fires: S209
#[test]
fn a_recording_that_joins_late_tells_who_is_below_the_others() {
    let mut script = Script::new();
    for _ in 0..5 {
        script.exchange(&[brd(0x0130, &[0x0A, 0], 3)]);
        for (station, state) in [(0x1001, 8_u8), (0x1002, 2), (0x1003, 8)] {
            script.exchange(&[fprd(station, 0x0130, &[state, 0, 0, 0, 0, 0])]);
        }
    }
    let report = report(&mut script);
    assert_eq!((only(&report).code.as_str(), no(only(&report))), ("S209", Some(2)));
}

// fires: S200
#[test]
fn an_error_bit_with_a_code_is_no_echo() {
    let typed = judge(&row(&["state = \"OP\"", "state = \"ERR INIT\"\nal_code = 0x11"]));
    assert_eq!((only(&typed).code.as_str(), no(only(&typed))), ("S200", Some(2)));
    // Read from its registers, status and code at once, again and again.
    let mut script = Script::scanned(2);
    for _ in 0..5 {
        script.exchange(&[fprd(0x1002, 0x0130, &[0x11, 0, 0, 0, 0x16, 0])]);
    }
    let lasting = report(&mut script);
    let refused = only(&lasting);
    assert_eq!(no(refused), Some(2), "{}", text(&lasting));
    assert_eq!(refused.state, FindingState::Confirmed, "it goes on");
    // Without a code it is the bit that was written.
    let mut script = Script::scanned(2);
    script.exchange(&[fprd(0x1002, 0x0130, &[0x11, 0, 0, 0, 0, 0])]);
    assert_eq!(codes(&report(&mut script)), [""; 0]);
}

// fires: C332
#[test]
fn one_station_address_at_two_subdevices_of_a_list_names_both() {
    let station = |no: u16| format!("state = \"OP\"\nstation = {no}");
    let diagnosis = judge(&row(&[&station(1001), &station(1002), &station(1002)]));
    let shared = only(&diagnosis);
    assert_eq!((shared.code.as_str(), no(shared)), ("C332", Some(3)));
    assert!(shared.evidence[0].text.contains("K2") && shared.evidence[0].text.contains("K3"));
    // Each its own, and those that have none yet.
    assert_eq!(codes(&judge(&row(&[&station(1001), &station(1002)]))), [""; 0]);
    assert_eq!(codes(&judge(&row(&[&station(0), &station(0)]))), [""; 0]);
}

// fires: H104
#[test]
fn a_broadcast_that_fewer_answer_for_good_is_placed_where_the_missing_fit() {
    // Nobody asks single SubDevices any more.
    let mut script = Script::scanned(3);
    for _ in 0..20 {
        script.exchange(&[brd(0x0130, &[2, 0], 3)]);
    }
    for _ in 0..20 {
        script.exchange(&[brd(0x0130, &[2, 0], 1)]);
    }
    let lasting = report(&mut script);
    let fewer = only(&lasting);
    assert_eq!(
        (fewer.code.as_str(), fewer.cause, link(fewer)),
        ("H104", FaultName::LinkOpen, Some((1, 2)))
    );
    // All are back.
    script.exchange(&[brd(0x0130, &[2, 0], 3)]);
    assert_eq!(codes(&report(&mut script)), [""; 0]);
}

// silent: H104
#[test]
fn fewer_answers_that_a_lost_link_explains_are_told_there() {
    let mut script = Script::scanned(3);
    script.exchange(&[brd(0x0130, &[2, 0], 3)]);
    script.exchange(&[fprd(0x1001, 0x0110, &[0x17, 0x56])]);
    for _ in 0..20 {
        script.exchange(&[brd(0x0130, &[2, 0], 1)]);
    }
    let report = report(&mut script);
    assert_eq!(codes(&report), ["H101"], "{}", text(&report));
}

#[test]
fn what_only_may_be_old_is_a_warning_and_notes_alone_are_no_fault() {
    let old = judge(&row(&["", "ports.A = { frame = 37, physical = 80 }"]));
    assert_eq!(old.verdict, Verdict::Faulty, "a warning is one, whatever its time");
    let few = judge(&row(&["crc = 2", ""]));
    assert_eq!(only(&few).severity, Severity::Info);
    assert_ne!(few.verdict, Verdict::Faulty);
}

// silent: H100, H112
#[test]
fn a_burst_that_only_the_recording_lacks_blames_no_link() {
    let play = |is_recorded: bool| {
        let mut script = running();
        cycles(&mut script, 400, 3);
        for number in 0..40 {
            // Of the requests every other one is missing in the recording, and all returns are.
            match is_recorded || number % 2 == 0 {
                true => script.vanish(&[lrw(PROCESS, 4, 3)]),
                false => script.index = script.index.wrapping_add(1),
            }
        }
        cycles(&mut script, 400, 3);
        for station in 0x1001..=0x1003 {
            script.exchange(&[fprd(station, 0x0300, &[0; 20])]);
        }
        cycles(&mut script, 100, 3);
        report(&mut script)
    };
    let lost = play(true);
    assert!(codes(&lost).contains(&"H100"), "{}", text(&lost));
    let lacking = play(false);
    assert!(!codes(&lacking).iter().any(|code| code.starts_with('H')), "{}", text(&lacking));
}
