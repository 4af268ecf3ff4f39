//! Recordings of the virtual segment under other MainDevices (SOEM, libethercat, KickCAT), through `linesman diagnose`.
//!
//! What was broken is known; each row says what the first finding must name, and what no finding may say.

use std::env;
use std::path::{Path, PathBuf};

use crate::support::{assert_valid, linesman};
use serde_json::Value;

/// The directory of the recordings; `None`, said aloud, where they are not.
fn recordings() -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let data =
        env::var_os("LINESMAN_DATA").map_or_else(|| root.join("../shared/data"), PathBuf::from);
    let directory = data.join("foreign");
    if directory.is_dir() {
        return Some(directory);
    }
    eprintln!("SKIPPED: no foreign recordings at {}; set LINESMAN_DATA", directory.display());
    None
}

fn diagnose(directory: &Path, name: &str) -> (i32, Value) {
    let file = directory.join(format!("{name}.pcapng.gz"));
    let run = linesman(["diagnose".as_ref(), file.as_os_str(), "--json".as_ref()]);
    assert!(run.stderr.is_empty(), "{name}: {}", run.stderr);
    let diagnosis = run.json();
    assert_valid(&diagnosis, "diagnosis");
    (run.status, diagnosis)
}

/// The place in a word: `2`, `3.B-4.A`, `host`, `network`.
fn place(place: &Value) -> String {
    let end = |end: &Value| match end.is_null() {
        true => "?".to_owned(),
        false => format!("{}.{}", end["no"], end["port"].as_str().unwrap()),
    };
    match place["kind"].as_str().unwrap() {
        "device" => place["no"].to_string(),
        "link" => format!("{}-{}", end(&place["a"]), end(&place["b"])),
        other => other.to_owned(),
    }
}

/// Findings that are no notes: code, cause and place.
fn roots(diagnosis: &Value) -> Vec<(String, String, String)> {
    let findings = diagnosis["findings"].as_array().unwrap().iter();
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    findings
        .filter(|finding| finding["severity"] != "info")
        .map(|one| (text(&one["code"]), text(&one["cause"]), place(&one["place"])))
        .collect()
}

fn codes(finding: &Value) -> Vec<String> {
    let own = finding["code"].as_str().unwrap().to_owned();
    let below = finding["consequences"].as_array().unwrap().iter().flat_map(codes);
    std::iter::once(own).chain(below).collect()
}

/// Recording, SubDevices, findings.
type Row = (&'static str, u64, &'static [(&'static str, &'static str, &'static str)]);

const ROWS: [Row; 6] = [
    ("device-off", 5, &[("H150", "device-off", "5")]),
    ("ecs-device-off-late", 4, &[("H150", "device-off", "4")]),
    ("emergency", 5, &[("S240", "emergency", "4")]),
    ("lec-link-open-early", 5, &[("H102", "link-open", "3.B-4.A")]),
    ("soem-link-open-early", 5, &[("H102", "link-open", "3.B-4.A")]),
    ("soem-link-open-late", 5, &[("H102", "link-open", "4.A-?")]),
];

#[test]
fn an_outage_beside_another_maindevice_is_one_finding_at_its_place() {
    let Some(directory) = recordings() else { return };
    for (name, devices, findings) in ROWS {
        let (status, diagnosis) = diagnose(&directory, name);
        assert_eq!((status, &diagnosis["verdict"]), (1, &"faulty".into()), "{name}");
        assert_eq!(diagnosis["network"]["devices"], devices, "{name}");
        let found = roots(&diagnosis);
        let expected: Vec<_> = findings
            .iter()
            .map(|(code, cause, place)| (code.to_string(), cause.to_string(), place.to_string()))
            .collect();
        assert_eq!(found, expected, "{name}");
    }
}

#[test]
fn a_subdevice_that_is_set_up_again_does_not_take_back_that_it_was_missing() {
    let Some(directory) = recordings() else { return };
    // SOEM writes the FMMUs of SubDevice 5 when it is back: 773 cycles had lacked its share before.
    let (_, diagnosis) = diagnose(&directory, "device-off");
    let first = &diagnosis["findings"][0];
    assert!(codes(first).contains(&"S210".to_owned()), "{:?}", codes(first));
    let lasted = first["closed_ns"].as_u64().unwrap() - first["opened_ns"].as_u64().unwrap();
    assert!((3_000_000_000..3_500_000_000).contains(&lasted), "{lasted} ns");
}

#[test]
fn frames_that_the_computer_lost_are_a_finding_with_an_open_place() {
    let Some(directory) = recordings() else { return };
    let (status, diagnosis) = diagnose(&directory, "host-drops");
    assert_eq!(status, 1);
    let first = &diagnosis["findings"][0];
    assert_eq!((&first["code"], place(&first["place"])), (&"H114".into(), "network".to_owned()));
    let causes = first["alternatives"].as_array().unwrap().iter().map(|one| &one["cause"]);
    assert!(causes.into_iter().any(|cause| cause == "host-drops"), "{first}");
}

#[test]
fn the_second_card_of_soem_is_no_second_maindevice() {
    let Some(directory) = recordings() else { return };
    let (_, diagnosis) = diagnose(&directory, "soem-ring");
    assert_eq!(diagnosis["network"]["devices"], 9);
    let wrong = roots(&diagnosis).into_iter().find(|(_, cause, _)| cause == "second-maindevice");
    assert_eq!(wrong, None);
    let unanswered = diagnosis["network"]["unanswered"].as_u64().unwrap();
    assert!(unanswered < 20, "{unanswered} unanswered: its looks round the ring ask for nothing");
}
