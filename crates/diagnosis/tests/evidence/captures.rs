//! Captures of real hardware through the whole engine: how many SubDevices, which state, how many
//! datagrams, and no fault that is not there.

use crate::support::{read_capture, read_some_of_capture, real_captures, text};
use linesman_config::fault::Class;
use linesman_diagnosis::report::{FindingState, PlaceReport, Severity, Verdict};
use linesman_proto::address::Network;

/// Name, SubDevices, highest AL state, datagrams of requests.
///
/// The SubDevices are those of the data's description; states and datagrams are what tshark shows:
/// the highest value of AL status, and the datagrams of frames without the mark of returning ones
/// (where requests are missing, those of returns).
const ROWS: [(&str, u64, Option<&str>, u64); 17] = [
    ("ec-replay-ek1100-alias-address", 3, Some("PREOP"), 650),
    ("ec-replay-ek1100-el2828-el2889", 3, Some("OP"), 2062),
    ("ec-replay-ek1914-el3004-configure", 2, Some("PREOP"), 552),
    ("ec-replay-ek1914-el3004-mailbox", 2, Some("PREOP"), 497),
    ("ec-replay-ek1914-segmented-upload", 2, Some("PREOP"), 482),
    ("ec-rs-detect-slaves-ek1100-el1004", 2, None, 1),
    ("ec-soem-sdinfo-ek1100-el1004", 2, Some("SAFEOP"), 290),
    ("ec-soem-sdinfo-ek1100-only", 1, Some("SAFEOP"), 94),
    ("ec-soem-sdinfo-no-slaves", 0, None, 19),
    ("ec-soem-single-lan9252", 1, Some("SAFEOP"), 499),
    ("ec-twincat-run-ek1100-el1004", 2, Some("PREOP"), 291),
    ("ec-twincat-scan-devices-2", 2, None, 6),
    ("echist-no-reborrow-202307", 3, Some("OP"), 2850),
    ("echist-replay-el2828-el2889-202405", 3, Some("OP"), 9982),
    ("echist-replay-mailbox-el3004", 2, Some("PREOP"), 896),
    ("echist-replay-no-complete-access-202308", 1, Some("OP"), 1996),
    ("echist-replay-segmented-upload-202401", 1, Some("PREOP"), 312),
];

// proves: WS-04 partial, WS-13 partial
#[test]
fn every_real_capture_is_read_as_what_it_is() {
    let Some(folder) = real_captures() else { return };
    for (name, devices, state, datagrams) in ROWS {
        let engine = read_capture(&folder.join(format!("{name}.pcapng")));
        let report = engine.diagnosis();
        let network = &report.network;
        assert_eq!(network.devices.0, devices, "{name}");
        assert_eq!(network.al_state_highest.as_deref(), state, "{name}");
        assert_eq!(network.datagrams.0, datagrams, "{name}");
        assert!(report.complete, "{name}");
        if name != "ec-soem-sdinfo-no-slaves" {
            // Of two and of ten frames nobody can say that a line is healthy.
            let wanted = if datagrams < 10 { Verdict::Inconclusive } else { Verdict::Healthy };
            assert_eq!(report.verdict, wanted, "{name}: {}", text(&report));
            let said = report.findings.iter().map(|finding| finding.code.as_str());
            let noted = NOTES.iter().filter(|(of, ..)| *of == name).map(|(_, code, _)| *code);
            assert!(said.eq(noted), "{name}: {}", text(&report));
        }
    }
}

/// What is worth knowing of captures in which nothing is wrong: name, code, and a part of the evidence.
const NOTES: [(&str, &str, &str); 2] = [
    (
        "ec-replay-ek1100-el2828-el2889",
        "T410",
        "83 times: by 1.861 ms of a cycle of 4.790 ms at most",
    ),
    ("echist-no-reborrow-202307", "T410", "45 times: by 3.972 ms of a cycle of 5.167 ms at most"),
];

// The computers that were recorded sent when they came to it, and nobody was in step.
// fires: T410
#[test]
fn notes_of_real_captures_are_no_more_than_notes() {
    let Some(folder) = real_captures() else { return };
    for (name, code, evidence) in NOTES {
        let report = read_capture(&folder.join(format!("{name}.pcapng"))).diagnosis();
        let [note] = &report.findings[..] else { panic!("{name}: {}", text(&report)) };
        assert_eq!((note.code.as_str(), note.severity), (code, Severity::Info), "{name}");
        assert_eq!(note.place, PlaceReport::Host, "{name}");
        assert!(note.evidence[0].text.contains(evidence), "{name}: {}", text(&report));
        assert!(note.evidence[0].text.contains("nobody keeps step"), "{name}: {}", text(&report));
    }
}

/// Bit 0x02 of the first byte of the source address: set by the first controller.
fn comes_back(frame: &[u8]) -> bool {
    frame.get(6).is_some_and(|first| first & 0x02 != 0)
}

#[test]
fn half_a_capture_is_no_fault_of_the_line() {
    let Some(folder) = real_captures() else { return };
    for (name, devices, state, _) in ROWS {
        let path = folder.join(format!("{name}.pcapng"));
        // Broadcasts alone that nobody answers are just that.
        if !["ec-soem-sdinfo-no-slaves", "ec-twincat-scan-devices-2"].contains(&name) {
            let report = read_some_of_capture(&path, |frame| !comes_back(frame)).diagnosis();
            assert_ne!(report.verdict, Verdict::Faulty, "{name}, sent: {}", text(&report));
        }
        if name == "ec-soem-sdinfo-no-slaves" {
            continue;
        }
        let report = read_some_of_capture(&path, comes_back).diagnosis();
        assert_ne!(report.verdict, Verdict::Faulty, "{name}, returned: {}", text(&report));
        assert_eq!(report.network.devices.0, devices, "{name}, returned");
        assert_eq!(report.network.al_state_highest.as_deref(), state, "{name}, returned");
    }
}

#[test]
fn unanswered_datagrams_are_those_without_an_answer() {
    let Some(folder) = real_captures() else { return };
    let unanswered = |name: &str| {
        read_capture(&folder.join(format!("{name}.pcapng"))).diagnosis().network.unanswered.0
    };
    assert_eq!(unanswered("ec-soem-sdinfo-no-slaves"), 19);
    // Its last frame has no return.
    assert_eq!(unanswered("ec-twincat-run-ek1100-el1004"), 1);
    // The controller took no AL control twice: processed, working counter 0.
    assert_eq!(unanswered("ec-soem-single-lan9252"), 2);
    // Clock registers of devices without clocks, and SyncManagers they do not have, are none.
    assert_eq!(unanswered("ec-replay-ek1914-el3004-mailbox"), 0);
    assert_eq!(unanswered("ec-replay-ek1100-el2828-el2889"), 0);
}

#[test]
fn no_answer_at_all_is_one_finding_that_says_what_to_check() {
    let Some(folder) = real_captures() else { return };
    let engine = read_capture(&folder.join("ec-soem-sdinfo-no-slaves.pcapng"));
    let report = engine.diagnosis();
    assert_eq!(report.verdict, Verdict::Faulty);
    let [finding] = &report.findings[..] else { panic!("{}", text(&report)) };
    assert_eq!(finding.name, "nobody-answers");
    assert_eq!((finding.severity, finding.class), (Severity::Error, Class::Hardware));
    assert_eq!(finding.state, FindingState::Confirmed);
    let PlaceReport::Link { a, b: None, .. } = finding.place else { panic!("{}", text(&report)) };
    assert_eq!((a.no, a.port), (0, 'A'));
    assert_eq!(finding.evidence[0].frame.unwrap().0, 1);
    assert!(finding.actions.len() >= 3);
    let others: f64 = finding.alternatives.iter().map(|other| other.confidence).sum();
    assert!(finding.confidence + others <= 1.0);
}

/// Vendor, product code and revision as the SII images of these devices have them.
#[test]
fn identities_and_stations_are_learnt_from_the_frames() {
    let Some(folder) = real_captures() else { return };
    let engine = read_capture(&folder.join("ec-replay-ek1100-el2828-el2889.pcapng"));
    let model = engine.model(Network(0)).unwrap();
    let found: Vec<_> = model
        .devices
        .iter()
        .map(|device| {
            let identity = device.identity.identity().unwrap();
            (device.station.unwrap().0, identity.vendor_id, identity.product_code)
        })
        .collect();
    let expected = [(0x1000, 2, 0x044C_2C52), (0x1001, 2, 0x0B0C_3052), (0x1002, 2, 0x0B49_3052)];
    assert_eq!(found, expected);
    // A coupler with two terminals behind it.
    let tree = model.tree.as_ref().unwrap();
    assert_eq!((tree.parent(1), tree.parent(2)), (Some(0), Some(1)));
}
