//! Real captures, as `data/README.md` describes them, through `linesman diagnose`.

use std::env;
use std::path::{Path, PathBuf};

use crate::support::{assert_valid, linesman};
use serde_json::Value;

/// File, SubDevices, highest state that a SubDevice showed, datagrams judged, of them unanswered
/// (`None` where working counter 0 leaves room for opinion).
type Row = (&'static str, u64, Option<&'static str>, u64, Option<u64>);

const CAPTURES: [Row; 17] = [
    ("ec-replay-ek1100-alias-address", 3, Some("PREOP"), 650, Some(0)),
    ("ec-replay-ek1100-el2828-el2889", 3, Some("OP"), 2062, Some(0)),
    ("ec-replay-ek1914-el3004-configure", 2, Some("PREOP"), 552, Some(0)),
    ("ec-replay-ek1914-el3004-mailbox", 2, Some("PREOP"), 497, Some(0)),
    ("ec-replay-ek1914-segmented-upload", 2, Some("PREOP"), 482, Some(0)),
    ("ec-rs-detect-slaves-ek1100-el1004", 2, None, 1, Some(0)),
    ("ec-soem-sdinfo-ek1100-el1004", 2, Some("SAFEOP"), 290, None),
    ("ec-soem-sdinfo-ek1100-only", 1, Some("SAFEOP"), 94, None),
    ("ec-soem-sdinfo-no-slaves", 0, None, 19, Some(19)),
    ("ec-soem-single-lan9252", 1, Some("SAFEOP"), 499, None),
    ("ec-twincat-run-ek1100-el1004", 2, Some("PREOP"), 291, Some(1)),
    ("ec-twincat-scan-devices-2", 2, None, 6, Some(0)),
    ("echist-no-reborrow-202307", 3, Some("OP"), 2850, Some(0)),
    ("echist-replay-el2828-el2889-202405", 3, Some("OP"), 9982, Some(0)),
    ("echist-replay-mailbox-el3004", 2, Some("PREOP"), 896, Some(0)),
    ("echist-replay-no-complete-access-202308", 1, Some("OP"), 1996, Some(0)),
    ("echist-replay-segmented-upload-202401", 1, Some("PREOP"), 312, Some(0)),
];

/// The directory of the captures; `None`, said aloud, where they are not.
pub(crate) fn captures() -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let data =
        env::var_os("LINESMAN_DATA").map_or_else(|| root.join("../shared/data"), PathBuf::from);
    let directory = data.join("pcap");
    if directory.is_dir() {
        return Some(directory);
    }
    eprintln!("SKIPPED: no captures at {}; set LINESMAN_DATA", directory.display());
    None
}

fn diagnose(directory: &Path, name: &str) -> (i32, Value) {
    let file = directory.join(format!("{name}.pcapng"));
    let run = linesman(["diagnose".as_ref(), file.as_os_str(), "--json".as_ref()]);
    assert!(run.stderr.is_empty(), "{name}: {}", run.stderr);
    (run.status, run.json())
}

#[test]
fn every_capture_is_judged_by_the_contract() {
    let Some(directory) = captures() else { return };
    for (name, devices, highest, datagrams, unanswered) in CAPTURES {
        let (status, diagnosis) = diagnose(&directory, name);
        assert_valid(&diagnosis, "diagnosis");
        assert_eq!(diagnosis["schema"], "linesman.diagnosis/1", "{name}");
        assert_eq!(diagnosis["complete"], true, "{name}");
        let network = &diagnosis["network"];
        assert_eq!(network["devices"], devices, "{name}");
        assert_eq!(network["al_state_highest"].as_str(), highest, "{name}");
        assert_eq!(network["datagrams"], datagrams, "{name}");
        if let Some(unanswered) = unanswered {
            assert_eq!(network["unanswered"], unanswered, "{name}");
        }
        let expected = match diagnosis["verdict"].as_str() {
            Some("healthy") => 0,
            Some("faulty") => 1,
            Some("inconclusive") => 3,
            other => panic!("{name}: verdict {other:?}"),
        };
        assert_eq!(status, expected, "{name}");
        let start = diagnosis["start"].as_str().expect("these captures have times");
        assert!(start.starts_with("20") && start.ends_with('Z'), "{name}: {start}");
    }
}

#[test]
fn text_names_the_verdict_first() {
    let Some(directory) = captures() else { return };
    let file = directory.join("ec-replay-ek1100-el2828-el2889.pcapng");
    let run = linesman(["diagnose".as_ref(), file.as_os_str()]);
    assert_eq!(run.status, 0, "{}", run.all());
    // Its computer kept single frames back.
    let expected = "HEALTHY  ec-replay-ek1100-el2828-el2889.pcapng: nothing wrong was found in what was judged; 1";
    assert!(run.stdout.starts_with(expected), "{}", run.stdout);
    assert!(run.stdout.contains("3 SubDevices, highest state OP"), "{}", run.stdout);
}

#[test]
fn following_ends_with_the_same_diagnosis() {
    let Some(directory) = captures() else { return };
    let name = "ec-twincat-run-ek1100-el1004";
    let (status, whole) = diagnose(&directory, name);
    let file = directory.join(format!("{name}.pcapng"));
    let arguments = ["diagnose".as_ref(), file.as_os_str(), "--json".as_ref(), "--follow".as_ref()];
    let run = linesman(arguments);
    assert_eq!(run.status, status);
    let events: Vec<Value> =
        run.stdout.lines().map(|line| serde_json::from_str(line).expect("a JSON object")).collect();
    for event in &events {
        assert_valid(event, "event");
    }
    let (last, before) = events.split_last().expect("one event at least");
    assert_eq!(last["event"], "ended");
    assert_eq!(last["diagnosis"], whole);
    assert!(before.iter().all(|event| event["finding"].is_object()));
}
