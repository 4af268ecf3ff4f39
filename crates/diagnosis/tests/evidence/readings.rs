//! Observation files with counts of any size, several readings in time, working counters, and what was exchanged.

use linesman_config::fault::FaultName;
use linesman_diagnosis::observation_file::ObservationFile;
use linesman_diagnosis::report::{FindingReport, PlaceReport, Severity};
use linesman_diagnosis::{Diagnosis, Setup};
use linesman_proto::address::DeviceId;
use linesman_proto::port::Port;
use linesman_proto::register::ErrorCounter;
use linesman_proto::time::Span;

fn judge(text: &str) -> Diagnosis {
    ObservationFile::parse(text).unwrap().diagnosis(Setup::default())
}

fn codes(diagnosis: &Diagnosis) -> Vec<&str> {
    diagnosis.findings.iter().map(|finding| finding.code.as_str()).collect()
}

#[track_caller]
fn finding<'d>(diagnosis: &'d Diagnosis, code: &str) -> &'d FindingReport {
    let found = diagnosis.findings.iter().find(|finding| finding.code == code);
    found.unwrap_or_else(|| panic!("{code} is missing: {:#?}", diagnosis.findings))
}

fn texts(finding: &FindingReport) -> String {
    finding.evidence.iter().map(|one| one.text.as_str()).collect::<Vec<_>>().join("\n")
}

/// A coupler and another one behind it, in OP.
const TWO: &str = r#"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
state = "OP"

[[device]]
name = "K2"
type = "EK1100"
on = "K1.C"
state = "OP"
"#;

#[test]
fn counts_above_255_are_totals_and_255_of_a_register_is_its_end() {
    let text = format!(
        "{TWO}ports.A = {{ frame = 154656, physical = 300000, before = {{ frame = 154000, physical = \
         290000 }} }}\nports.B = {{ lost_link = 255 }}\n"
    );
    let file = ObservationFile::parse(&text).unwrap();
    let model = file.model(None);
    let counters = &model.device(DeviceId(1)).unwrap().counters;
    let frames = counters.track(ErrorCounter::InvalidFrame(Port::A)).unwrap();
    assert_eq!((frames.total.rise(), frames.last.value, frames.is_at_end()), (656, 154_656, false));
    assert!(!frames.may_be_old && !frames.total.is_lower_bound());
    let lost = counters.track(ErrorCounter::LostLink(Port::B)).unwrap();
    assert!(lost.is_at_end() && lost.may_be_old);
    let diagnosis = file.diagnosis(Setup::default());
    let evidence = texts(finding(&diagnosis, "H110"));
    assert!(evidence.contains("656 of its own"), "{evidence}");
    // A tool that adds counters up does not stop at 255.
    let totals = ObservationFile::parse(&format!("totals = true\n{text}")).unwrap();
    let model = totals.model(None);
    let lost = model.device(DeviceId(1)).unwrap().counters.track(ErrorCounter::LostLink(Port::B));
    assert!(!lost.unwrap().is_at_end());
}

#[test]
fn several_readings_are_a_history_of_rises_clears_and_states() {
    let reading = |at: &str, frame: u32, state: &str| {
        format!(
            "[[reading]]\nat = {at}\n[[reading.device]]\nname = \"K2\"\nstate = \"{state}\"\nports.A = {{ \
             frame = {frame}, physical = 0 }}\n[[reading.device]]\nno = 1\nstate = \"OP\"\n"
        )
    };
    let wiring = TWO.replace("state = \"OP\"\n", "");
    let text = [
        wiring,
        reading("\"2026-11-20T10:00:00\"", 700, "OP"),
        reading("2026-11-20T10:05:00", 900, "OP"),
        reading("\"2026-11-20T10:06:00\"", 4, "ERR SAFEOP\"\nal_code = \"0x001B"),
    ]
    .concat();
    let file = ObservationFile::parse(&text).unwrap();
    let model = file.model(None);
    let device = model.device(DeviceId(1)).unwrap();
    let track = device.counters.track(ErrorCounter::InvalidFrame(Port::A)).unwrap();
    let rises: Vec<_> = track.rises.iter().map(|rise| (rise.before, rise.after)).collect();
    assert_eq!(rises, [(700, 900), (900, 4)], "the first reading is history");
    assert_eq!(track.rises[0].at.since(track.rises[0].after_time), Span::s(300));
    assert_eq!((track.total.rise(), track.total.clears()), (204, 1));
    assert_eq!(file.start().as_deref(), Some("2026-11-20T09:59:00"));
    // It had been in OP: it left it, and did not refuse it.
    let error = device.al.errors.front().unwrap();
    assert!(error.had_arrived, "{error:?}");
    let diagnosis = file.diagnosis(Setup::default());
    let damage = finding(&diagnosis, "H111");
    assert_eq!(damage.consequences[0].code, "S202", "{damage:#?}");
}

#[test]
fn who_is_in_a_lower_state_while_others_stay_left_it_and_all_together_were_asked() {
    let reading = |at: u32, one: &str, other: &str| {
        format!(
            "[[reading]]\nat_s = {at}\n[[reading.device]]\nname = \"K1\"\nstate = \"{one}\"\n\
             [[reading.device]]\nname = \"K2\"\nstate = \"{other}\"\n"
        )
    };
    let wiring = TWO.replace("state = \"OP\"\n", "");
    let alone = format!("{wiring}{}{}", reading(20, "OP", "OP"), reading(30, "OP", "INIT"));
    assert_eq!(codes(&judge(&alone)), ["H150"], "it started anew");
    let asked = format!("{wiring}{}{}", reading(20, "OP", "OP"), reading(30, "INIT", "INIT"));
    assert_eq!(codes(&judge(&asked)), [""; 0]);
}

// fires: H114
#[test]
fn lost_frames_with_a_clean_card_blame_the_computer_and_not_a_cable() {
    let text = format!("{TWO}[maindevice]\nsent = 1_000_000\nlost = 370\ncrc = 0\n");
    let diagnosis = judge(&text);
    let lost = finding(&diagnosis, "H114");
    assert_eq!((&lost.place, lost.cause), (&PlaceReport::Host, FaultName::HostDrops));
    assert!(texts(lost).contains("370 frames of 1000000"), "{lost:#?}");
    assert_eq!(lost.severity, Severity::Warning);
    // Without the card's counters nobody knows.
    let diagnosis = judge(&text.replace("crc = 0\n", ""));
    let lost = finding(&diagnosis, "H114");
    assert_eq!(
        (&lost.place, lost.cause),
        (&PlaceReport::Network { network: 0 }, FaultName::CableDegraded)
    );
    // Damaged frames at the card, and nobody read the counters of the SubDevices.
    let diagnosis = judge(&format!("{TWO}[maindevice]\ncrc = 154656\n"));
    let damaged = finding(&diagnosis, "H114");
    assert!(texts(damaged).contains("its card dropped 154656 damaged frames"), "{damaged:#?}");
}

// silent: H114
#[test]
fn lost_frames_that_a_place_explains_are_told_there_alone() {
    // The counters of the SubDevices name the link.
    let text = format!(
        "{TWO}ports.A = {{ frame = 37, physical = 80 }}\n[maindevice]\nlost = 37\ncrc = 37\n"
    );
    assert_eq!(codes(&judge(&text)), ["H110"]);
    // Nothing was lost.
    let text = format!("{TWO}[maindevice]\nsent = 1_000_000\nlost = 0\ncrc = 0\n");
    assert_eq!(codes(&judge(&text)), [""; 0]);
    // A few of very many, and none now: the time when the line started.
    let text = format!("{TWO}[maindevice]\nsent = 10_000_000\nlost = 37\nlost_per_s = 0.0\n");
    assert_eq!(finding(&judge(&text), "H114").severity, Severity::Info);
}

// fires: H115
#[test]
fn a_total_of_a_subdevice_names_it_and_invents_no_port() {
    let text = TWO.replace("on = \"K1.C\"\n", "on = \"K1.C\"\ncrc = 154656\n");
    let diagnosis = judge(&text);
    let errors = finding(&diagnosis, "H115");
    assert_eq!(errors.place, PlaceReport::Device { network: 0, no: 2 });
    assert!(errors.evidence.iter().all(|one| one.port.is_none()), "{errors:#?}");
    assert!(texts(errors).contains("154656 damaged frames, of whatever time"), "{errors:#?}");
}

// silent: H115
#[test]
fn a_total_that_does_not_rise_or_that_ports_explain_is_no_finding() {
    let still = TWO.replace("on = \"K1.C\"\n", "on = \"K1.C\"\ncrc = 9\nbefore.crc = 9\n");
    assert_eq!(codes(&judge(&still)), [""; 0]);
    let ports = "on = \"K1.C\"\ncrc = 9\nports.A = { frame = 9, physical = 20 }\n";
    assert_eq!(codes(&judge(&TWO.replace("on = \"K1.C\"\n", ports))), ["H110"]);
}

// fires: T412
#[test]
fn frames_that_came_back_late_are_the_computers() {
    for told in ["late = 156", "unmatched = 40\ntimed_out = 40", "skipped = 12", "late_cycles = 5"]
    {
        let diagnosis = judge(&format!("{TWO}[maindevice]\ncycle_us = 1000\n{told}\n"));
        let late = finding(&diagnosis, "T412");
        assert_eq!((&late.place, late.severity), (&PlaceReport::Host, Severity::Warning), "{told}");
        assert_eq!(codes(&diagnosis), ["T412"], "{told}: late is not lost");
    }
}

// silent: T412
#[test]
fn frames_that_are_lost_are_not_late() {
    let diagnosis = judge(&format!("{TWO}[maindevice]\ntimed_out = 40\nunmatched = 0\nlate = 0\n"));
    assert_eq!(codes(&diagnosis), ["H114"]);
}

// fires: H104
#[test]
fn fewer_answers_than_devices_name_the_link_behind_the_last_that_answers() {
    let three = format!(
        "{}[[device]]\nname = \"K3\"\non = \"K2.C\"\n",
        TWO.replace("state = \"OP\"\n", "")
    );
    let diagnosis = judge(&format!("{three}[maindevice]\nanswering = 2\n"));
    let fewer = finding(&diagnosis, "H104");
    assert!(
        matches!(fewer.place, PlaceReport::Link { a, b: Some(b), .. } if (a.no, b.no) == (2, 3))
    );
    assert_eq!(fewer.consequences.len(), 1, "the third is silent: {fewer:#?}");
    assert_eq!(codes(&diagnosis), ["H104"]);
    // Nobody at all: the first link.
    let diagnosis = judge(&format!("{three}[maindevice]\nanswering = 0\n"));
    let none = finding(&diagnosis, "H104");
    assert!(matches!(none.place, PlaceReport::Link { a, .. } if a.no == 0), "{none:#?}");
    assert_eq!(codes(&diagnosis), ["H104"]);
}

// silent: H104
#[test]
fn as_many_answers_as_devices_are_no_finding() {
    assert_eq!(codes(&judge(&format!("{TWO}[maindevice]\nanswering = 2\n"))), [""; 0]);
}

// fires: S208
#[test]
fn what_another_tool_reports_of_a_subdevice_is_told_of_it() {
    for (told, expected) in [
        ("configuration_failed = true", FaultName::ConfigMismatch),
        ("state_changes = 3", FaultName::FirmwareFault),
        ("absences = 2", FaultName::LinkFlapping),
        ("clock_failed = true", FaultName::ClockDrift),
    ] {
        let diagnosis = judge(&format!("{TWO}{told}\n"));
        let trouble = finding(&diagnosis, "S208");
        assert_eq!(trouble.place, PlaceReport::Device { network: 0, no: 2 }, "{told}");
        assert_eq!(trouble.cause, expected, "{told}");
    }
    let diagnosis = judge(
        &TWO.replace("on = \"K1.C\"\nstate = \"OP\"", "on = \"K1.C\"\nstate = \"OP LNK_ERR B\""),
    );
    assert!(texts(finding(&diagnosis, "S208")).contains("port B of K2"));
    // A broadcast read shows several states, and the error bit.
    let diagnosis =
        judge(&format!("{}[maindevice]\nstates = 0x1C\n", TWO.replace("state = \"OP\"\n", "")));
    assert!(texts(finding(&diagnosis, "S208")).contains("SAFEOP and OP, with the error bit"));
}

#[test]
fn links_and_counters_that_no_plan_has_are_told_as_reported() {
    let state = |state: &str| {
        TWO.replace("on = \"K1.C\"\nstate = \"OP\"", &format!("on = \"K1.C\"\nstate = \"{state}\""))
    };
    let diagnosis = judge(&state("OP LNK_ADD C"));
    assert!(texts(finding(&diagnosis, "S208")).contains("port C of K2 (EK1100) has a link"));
    let diagnosis = judge(&state("OP LNK_MIS D"));
    let missing = finding(&diagnosis, "S208");
    assert!(
        matches!(missing.place, PlaceReport::Link { a, b: None, .. } if (a.no, a.port) == (2, 'D'))
    );
    assert_eq!(missing.severity, Severity::Error);
    let diagnosis = judge(&format!("{TWO}[maindevice]\nring_open = true\n"));
    assert_eq!(finding(&diagnosis, "S208").cause, FaultName::RingOpen);
    let diagnosis =
        judge(&format!("{TWO}[[working_counter]]\nname = \"d\"\nexpected = 3\nreceived = 4\n"));
    assert!(texts(finding(&diagnosis, "S208")).contains("working counter 4, and 3 is expected"));
}

// fires: T413
#[test]
fn a_delay_that_no_cable_has_is_noted_at_its_link() {
    let delays = |far: u32| {
        let near = TWO.replace("on = \"maindevice\"\n", "on = \"maindevice\"\ndelay_ns = 0\n");
        judge(&format!("{near}delay_ns = {far}\n"))
    };
    let diagnosis = delays(9_000);
    let long = finding(&diagnosis, "T413");
    assert_eq!(long.severity, Severity::Info);
    assert!(
        matches!(long.place, PlaceReport::Link { a, .. } if (a.no, a.port) == (1, 'C')),
        "{long:#?}"
    );
    assert!(texts(long).contains("frames take 9 µs"), "{long:#?}");
}

// silent: T413
#[test]
fn delays_of_cables_and_of_later_branches_are_no_finding() {
    let text = format!(
        "{}delay_ns = 5_000\n[[device]]\nname = \"T3\"\non = \"K1.B\"\ndelay_ns = 700\n",
        TWO.replace("on = \"maindevice\"\n", "on = \"maindevice\"\ndelay_ns = 0\n")
    );
    assert_eq!(codes(&judge(&text)), [""; 0], "what hangs on port B is passed before port C");
}

// silent: S208
#[test]
fn a_subdevice_that_signals_its_error_itself_is_not_told_twice() {
    let text = TWO
        .replace("on = \"K1.C\"\nstate = \"OP\"", "on = \"K1.C\"\nstate = \"ERR PREOP INIT_ERR\"");
    assert_eq!(codes(&judge(&text)), ["S200"]);
    let text = format!("{TWO}state_changes = 0\nabsences = 0\n[maindevice]\nstates = 8\n");
    assert_eq!(codes(&judge(&text)), [""; 0]);
}

#[test]
fn an_al_status_code_alone_is_an_error() {
    let text = TWO.replace("on = \"K1.C\"\nstate = \"OP\"", "on = \"K1.C\"\nal_code = \"0x001D\"");
    let diagnosis = judge(&text);
    assert!(texts(finding(&diagnosis, "S200")).contains("0x001D"), "{:#?}", diagnosis.findings);
    // A list that leaves out the error bit, and gives the code.
    let text = TWO.replace(
        "on = \"K1.C\"\nstate = \"OP\"",
        "on = \"K1.C\"\nstate = \"PREOP\"\nal_code = 0x1D",
    );
    assert_eq!(codes(&judge(&text)), ["S200"]);
}

#[test]
fn a_low_working_counter_leads_to_those_whose_shares_are_missing() {
    let counter =
        "[[working_counter]]\nname = \"task 1\"\nexpected = 6\nreceived = 3\ncount = 120\n";
    let diagnosis =
        judge(&format!("{TWO}{counter}inputs = [\"K1\", \"K2\"]\noutputs = [\"2\", \"K1\"]\n"));
    let low = finding(&diagnosis, "S210");
    assert!(texts(low).contains("LRW `task 1`"), "{low:#?}");
    assert!(texts(low).contains("3 instead of 6, 120 times"), "{low:#?}");
    assert_eq!(low.place, PlaceReport::Network { network: 0 }, "either of the two");
    // One of them is in trouble: it is the one.
    let fallen = TWO.replace(
        "on = \"K1.C\"\nstate = \"OP\"",
        "on = \"K1.C\"\nstate = \"ERR SAFEOP\"\nal_code = 0x1B",
    );
    let counter = format!("{counter}devices = [\"K1\", \"K2\"]\n");
    let diagnosis = judge(&format!("{fallen}{counter}"));
    assert_eq!(codes(&diagnosis), ["S202"], "{:#?}", diagnosis.findings);
    assert_eq!(diagnosis.findings[0].consequences[0].code, "S210");
    // As expected, or nothing known to expect.
    let right = counter.replace("received = 3", "received = 6");
    assert_eq!(codes(&judge(&format!("{TWO}{right}"))), [""; 0]);
}

#[test]
fn a_working_counter_that_recovers_between_readings_is_over() {
    let reading = |at: u32, received: u32| {
        format!(
            "[[reading]]\nat_s = {at}\n[[reading.working_counter]]\nname = \"d\"\nreceived = {received}\n"
        )
    };
    let base = format!("{TWO}[[working_counter]]\nname = \"d\"\nexpected = 9\n");
    let text = [base, reading(20, 9), reading(30, 0), reading(40, 9)].concat();
    let model = ObservationFile::parse(&text).unwrap().model(None);
    let deficit = model.cyclic[0].wkc.deficits()[0];
    assert_eq!((deficit.lowest, deficit.ended.is_some()), (0, true));
}

/// Damage between the two couplers, and what was exchanged.
fn exchanged(exchange: &str) -> FindingReport {
    let clean = "on = \"maindevice\"\nports.A = { frame = 0, physical = 0 }\n";
    let two = TWO.replace("on = \"maindevice\"\n", clean);
    let text = format!(
        "{two}ports.A = {{ frame = 40, physical = 90 }}\n[[device]]\nname = \"K3\"\non = \"K2.C\"\n\
         [[exchange]]\n{exchange}\n"
    );
    let diagnosis = judge(&text);
    finding(&diagnosis, "H110").clone()
}

#[test]
fn errors_that_move_with_a_cable_blame_it_and_errors_that_stay_clear_it() {
    let moved =
        exchanged("what = \"cable\"\nat = \"K2.C-K3.A\"\nto = \"K1.C - K2.A\"\nmoved = true");
    assert_eq!(moved.cause, FaultName::CableDegraded);
    assert!(moved.confidence > 0.85, "{moved:#?}");
    assert!(texts(&moved).contains("and the errors went with it"), "{moved:#?}");
    let stayed = exchanged("what = \"cable\"\nat = \"K1.C\"\nmoved = false");
    assert_ne!(stayed.cause, FaultName::CableDegraded, "{stayed:#?}");
    let cable = stayed.alternatives.iter().find(|other| other.cause == FaultName::CableDegraded);
    assert!(cable.is_none_or(|cable| cable.confidence < 0.1), "{stayed:#?}");
    assert!(stayed.actions[0].starts_with("The cable is not it"), "{stayed:#?}");
    let sum: f64 = stayed.alternatives.iter().map(|other| other.confidence).sum();
    assert!(stayed.confidence + sum <= 1.0 + 1e-9);
    // What was exchanged elsewhere says nothing of this link.
    let elsewhere = exchanged("what = \"cable\"\nat = \"K2.C-K3.A\"\nmoved = false");
    assert_eq!(elsewhere.cause, FaultName::CableDegraded);
}

#[test]
fn errors_that_move_with_a_device_blame_it_and_errors_that_stay_clear_it() {
    let moved = exchanged("what = \"device\"\nat = \"K2\"\nmoved = true");
    assert_eq!(moved.cause, FaultName::ReceiverDamaged, "it receives there: {moved:#?}");
    let moved = exchanged("what = \"device\"\nat = \"K1\"\nmoved = true");
    assert!(
        matches!(moved.cause, FaultName::TransmitterDamaged | FaultName::DeviceInternal),
        "it sends there: {moved:#?}"
    );
    let stayed = exchanged("what = \"device\"\nat = \"K1\"\nmoved = false");
    let sender =
        stayed.alternatives.iter().find(|other| other.cause == FaultName::TransmitterDamaged);
    assert!(sender.is_none_or(|sender| sender.confidence < 0.05), "{stayed:#?}");
}

#[test]
fn a_known_controller_tells_whether_bad_frames_are_counted_again() {
    // The second port counts as many as the first one; whether these are the same depends on its controller.
    let model = |controller: &str| {
        format!(
            "[[device]]\nname = \"K1\"\non = \"maindevice\"\nports.A = {{ frame = 20, physical = 50 }}\n\
             [[device]]\nname = \"K2\"\non = \"K1.B\"\n{controller}ports.A = {{ frame = 20, physical = 50 }}\n"
        )
    };
    let places =
        |text: &str| judge(text).findings.iter().map(|one| one.place.clone()).collect::<Vec<_>>();
    assert_eq!(places(&model("controller = \"ET1100\"\n")).len(), 2, "it counts its own alone");
    // What is counted again is one damage; so it is taken where nobody says.
    let frames_of = |text: &str| {
        let all = judge(text);
        all.findings.iter().map(texts).collect::<String>().matches("of its own").count()
    };
    assert_eq!(frames_of(&model("controller = \"fpga\"\n")), 1);
    assert_eq!(frames_of(&model("")), 1);
    assert_eq!(frames_of(&model("controller = \"asic\"\n")), 2);
}

#[test]
fn emergencies_and_refused_requests_are_taken() {
    let text = format!(
        "{TWO}[[emergency]]\ndevice = \"K2\"\ncode = \"0x8611\"\nregister = 0x11\nat = \"2026-11-20T10:00:00\"\n\
         [[abort]]\ndevice = \"2\"\nindex = \"0x1C12\"\ncode = \"0x06010002\"\n"
    );
    let diagnosis = judge(&text);
    assert!(texts(finding(&diagnosis, "S240")).contains("0x8611"), "{:#?}", diagnosis.findings);
    assert!(texts(finding(&diagnosis, "S250")).contains("0x06010002"), "{:#?}", diagnosis.findings);
}

#[test]
fn what_does_not_fit_together_is_refused_with_its_line() {
    let cases = [
        ("[[reading]]\n", "line 13, reading 1: it says no time"),
        ("[[reading]]\nat_s = 2\n[[reading]]\nat_s = 2\n", "line 15, reading 2: it is not later"),
        ("[[reading]]\nat_s = -1\n", "`at_s` is -1"),
        ("[[reading]]\nat_s = nan\n", "`at_s` is NaN"),
        (
            "[[reading]]\nat_s = 1\n[[reading]]\nat = \"2026-11-20T10:00:00\"\n",
            "both as `at` and as `at_s`",
        ),
        ("[[reading]]\nat = \"soon\"\n", "`soon` is no date with time"),
        (
            "[[reading]]\nat_s = 1\n[[reading.device]]\nname = \"K9\"\n",
            "line 15, reading.device `K9`: no device",
        ),
        ("[[reading]]\nat_s = 1\n[[reading.device]]\nstate = \"OP\"\n", "neither `name` nor `no`"),
        (
            "[[reading]]\nat_s = 1\n[[reading.device]]\nno = 1\nstate = \"RUN\"\n",
            "`RUN` is no state",
        ),
        (
            "[[working_counter]]\ndevices = [\"T9\"]\n",
            "line 13, working_counter 1: no device is called `T9`",
        ),
        ("[[working_counter]]\ncommand = \"BRD\"\n", "LRD"),
        ("[[emergency]]\ndevice = \"T9\"\ncode = 1\n", "expected one of `K1`, `K2`"),
        ("[[exchange]]\nwhat = \"cable\"\nat = \"K1.B\"\nmoved = true\n", "`K1.B` is no link"),
        ("[[exchange]]\nwhat = \"cable\"\nmoved = true\n", "such as `K1.C-K2.A`"),
        ("[[exchange]]\nwhat = \"hammer\"\nat = \"K1.B\"\nmoved = true\n", "hammer"),
        ("[[device]]\nname = \"K2\"\non = \"K2.C\"\n", "line 13, device `K2`: two devices"),
        ("[[device]]\nname = \"K3\"\non = \"K9.C\"\n", "line 13, device `K3`: "),
        (
            "[[device]]\nname = \"K3\"\non = \"K2.C\"\nstate = \"RUN\"\n",
            "line 13, device `K3`: state: `RUN`",
        ),
        ("controller = \"Z80\"\n", "ET1100"),
    ];
    for (more, expected) in cases {
        let error = ObservationFile::parse(&format!("{TWO}{more}")).unwrap_err().to_string();
        assert!(error.contains(expected), "{more:?}: {error}");
    }
}
