//! Observation files through the public surface: the fixtures of the sources, and bad input.

#![allow(clippy::wildcard_enum_match_arm, reason = "a test that meets another one fails")]

use std::path::PathBuf;

use linesman_config::fault::FaultName;
use linesman_diagnosis::observation_file::ObservationFile;
use linesman_diagnosis::report::{DirectionReport, EndReport, FindingReport, PlaceReport, Verdict};
use linesman_diagnosis::{Diagnosis, Setup};

#[expect(clippy::disallowed_methods, reason = "the fixtures are files of the project")]
fn fixture(name: &str) -> Diagnosis {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/observations");
    let text = std::fs::read_to_string(root.join(name)).unwrap();
    judge(&text)
}

fn judge(text: &str) -> Diagnosis {
    ObservationFile::parse(text).unwrap().diagnosis(Setup::default())
}

fn link(finding: &FindingReport) -> ((u32, char), (u32, char), Option<DirectionReport>) {
    match finding.place {
        PlaceReport::Link { a, b: Some(b), direction, .. } => {
            let end = |end: EndReport| (end.no, end.port);
            (end(a), end(b), direction)
        }
        ref other => panic!("not a link: {other:?}"),
    }
}

// proves: HW-22, HW-23, HW-24 partial
#[test]
fn both_counter_tables_lead_to_the_link_between_6_and_14() {
    for name in ["fifteen-rx-registers.toml", "fifteen-frame-errors.toml"] {
        let diagnosis = fixture(name);
        assert_eq!(diagnosis.verdict, Verdict::Faulty);
        assert_eq!(diagnosis.findings.len(), 1, "{name}: {:#?}", diagnosis.findings);
        let finding = &diagnosis.findings[0];
        let both = Some(DirectionReport::Both);
        assert_eq!(link(finding), ((6, 'C'), (14, 'A'), both), "{name}");
        let first = &finding.evidence[0];
        assert_eq!((first.no, first.port, first.register), (Some(14), Some('A'), Some(0x0300)));
        let sum: f64 = finding.alternatives.iter().map(|other| other.confidence).sum();
        assert!(finding.confidence + sum <= 1.0 + 1e-9, "{name}: {finding:#?}");
        assert!(finding.actions.iter().any(|action| action.contains("cable")));
    }
}

// proves: HW-24
#[test]
fn forward_and_return_damage_are_told_apart_by_counts() {
    let diagnosis = fixture("fifteen-rx-registers.toml");
    let texts: Vec<_> = diagnosis.findings[0].evidence.iter().map(|e| e.text.as_str()).collect();
    let of = |needle: &str| texts.iter().filter(|text| text.contains(needle)).count();
    assert_eq!(of("port A, is the first in the order of checks that counts bad frames"), 1);
    assert_eq!(of("5 of its own"), 1, "{texts:#?}");
    assert_eq!(of("13 of its own"), 1, "{texts:#?}");
}

// silent: C306
// proves: HW-10
#[test]
fn a_permanent_break_is_one_finding_with_its_consequences() {
    let diagnosis = fixture("break-behind-14.toml");
    assert_eq!(diagnosis.findings.len(), 1, "{:#?}", diagnosis.findings);
    let finding = &diagnosis.findings[0];
    assert_eq!(link(finding), ((14, 'B'), (15, 'A'), Some(DirectionReport::Both)));
    assert_eq!(finding.cause, FaultName::LinkOpen);
    assert!(finding.alternatives.iter().any(|other| other.cause == FaultName::DeviceOff));
    let below: Vec<u32> = finding.consequences.iter().map(no).collect();
    assert_eq!(below, [15, 16, 17, 18, 19, 20, 21]);
    assert_eq!(diagnosis.network.devices.0, 28);
    assert_eq!(diagnosis.network.al_state_highest.as_deref(), Some("OP"));
}

fn no(finding: &FindingReport) -> u32 {
    match finding.place {
        PlaceReport::Device { no, .. } => no,
        ref other => panic!("not a device: {other:?}"),
    }
}

// proves: JCT-11 partial: the list, not the frames
#[test]
fn a_cable_pulled_at_a_junction_is_found_there() {
    let diagnosis = fixture("junction-cable-pulled.toml");
    assert_eq!(diagnosis.findings.len(), 1, "{:#?}", diagnosis.findings);
    let finding = &diagnosis.findings[0];
    assert_eq!(link(finding), ((2, 'D'), (3, 'A'), Some(DirectionReport::Both)));
    assert_eq!(finding.consequences.iter().map(no).collect::<Vec<_>>(), [3, 4]);
}

const TWO: &str = r#"
[[device]]
name = "K1"
on = "maindevice"
state = "OP"
ports.A = { link = true, rx = 0 }
ports.B = { link = true, open = true, rx = "0x0203", before = { rx = "0x0203" } }

[[device]]
name = "E2"
on = "K1.B"
state = "OP"
ports.A = { frame = 200, physical = 20, forwarded = 0, lost_link = 3 }
before.ports.A = { frame = 200, physical = 20, lost_link = 3 }
"#;

// proves: HW-23 partial
#[test]
fn old_values_are_healthy_and_new_ones_are_not() {
    let diagnosis = judge(TWO);
    assert_eq!(diagnosis.verdict, Verdict::Healthy, "{:#?}", diagnosis.findings);
    let diagnosis = judge(&TWO.replace(
        "frame = 200, physical = 20, forwarded",
        "frame = 202, \
                                        physical = 20, forwarded",
    ));
    assert_eq!(diagnosis.verdict, Verdict::Faulty);
    assert_eq!(diagnosis.findings.len(), 1);
    // Clean symbols: the device before the port.
    assert_eq!(diagnosis.findings[0].cause, FaultName::DeviceInternal);
    assert_eq!(no(&diagnosis.findings[0]), 1);
    // Somebody cleared the counters in between, and some came since.
    let cleared =
        TWO.replace("frame = 200, physical = 20, forwarded", "frame = 4, physical = 5, forwarded");
    let diagnosis = judge(&cleared);
    assert_eq!(link(&diagnosis.findings[0]), ((1, 'B'), (2, 'A'), Some(DirectionReport::AToB)));
}

#[test]
fn wrong_files_say_where_and_what() {
    let cases = [
        ("", "no [[device]]"),
        ("speed = 3", "unknown field `speed`"),
        ("[[device]]\non = \"maindevice\"\ncolour = 1", "unknown field `colour`"),
        ("[[device]]\non = \"maindevice\"\nports.E = {}", "unknown field `E`"),
        ("[[device]]\non = \"maindevice\"\nports.A = { rx = \"0x10000\" }", "0x0412"),
        ("[[device]]\non = \"maindevice\"\nports.A = { frame = -3 }", "a count from 0 up"),
        ("[[device]]\non = \"maindevice\"\nports.A = { frame = 3, rx = 3 }", "either it"),
        ("[[device]]\non = \"maindevice\"\nstate = \"RUN\"", "`RUN` is no state"),
        ("[[device]]\non = \"K1.B\"", "no device is called `K1`"),
        ("[[device]]\non = \"maindevice\"\nno = 2", "but 1 is missing"),
        ("[[device]]\non = \"maindevice\"\nno = 0", "0 is no number"),
        (
            "[[device]]\non = \"maindevice\"\nno = 1\n[[device]]\non = \"1.B\"\nno = 1",
            "1 is given twice",
        ),
        ("[[device]", "line 1"),
        ("\u{0}\u{1}x", "line 1"),
    ];
    for (text, expected) in cases {
        let error = ObservationFile::parse(text).unwrap_err().to_string();
        assert!(error.contains(expected), "{text:?}: {error}");
    }
}

#[test]
fn the_schema_knows_all_keys() {
    let schema = serde_json::to_value(schemars::schema_for!(ObservationFile)).unwrap();
    let text = schema.to_string();
    for key in ["device", "maindevice", "al_code", "lost_link", "before", "ring", "rx"] {
        assert!(text.contains(&format!("\"{key}\"")), "{key}");
    }
}

/// What the card counted, and nobody else, was spoiled on the last hop.
#[test]
fn the_cards_own_errors_point_to_the_last_hop() {
    let text = format!("{}\n[maindevice]\nlost = 3\ncrc = 3\n", TWO);
    let diagnosis = judge(&text);
    assert_eq!(diagnosis.findings.len(), 1, "{:#?}", diagnosis.findings);
    let expected = ((0, 'A'), (1, 'A'), Some(DirectionReport::BToA));
    assert_eq!(link(&diagnosis.findings[0]), expected);
}
