//! Frames spoiled on one direction of one link: every link, each direction, with and without
//! counters of forwarded errors, once, ten times and a thousand times.

use std::fs;

use crate::support::linesman;
use serde_json::{Value, json};
use tempfile::TempDir;

/// A port in the answer: number and letter.
type End = (u32, &'static str);

/// Link by link: the end nearer the MainDevice and the far one, as in the file and as in the answer.
const LINKS: [(&str, &str, End, End); 9] = [
    ("maindevice", "K1.A", (0, "A"), (1, "A")),
    ("K1.B", "T1.A", (1, "B"), (2, "A")),
    ("T1.B", "J1.A", (2, "B"), (3, "A")),
    ("J1.D", "K3.A", (3, "D"), (4, "A")),
    ("K3.B", "T4.A", (4, "B"), (5, "A")),
    ("T4.B", "T5.A", (5, "B"), (6, "A")),
    ("J1.B", "K2.A", (3, "B"), (7, "A")),
    ("K2.B", "T3.A", (7, "B"), (8, "A")),
    ("J1.C", "T2.A", (3, "C"), (9, "A")),
];

/// A line with a junction and its branches; all terminals are of one type.
fn plant(terminal: &str, head: &str) -> String {
    let device = |name: &str, kind: &str, on: &str| {
        format!("[[device]]\nname = \"{name}\"\ntype = \"{kind}\"\non = \"{on}\"\n")
    };
    [
        head.to_owned(),
        device("K1", "EK1100", "maindevice"),
        device("T1", terminal, "K1.B"),
        device("J1", "EK1122", "T1.B"),
        device("K3", "EK1100", "J1.D"),
        device("T4", terminal, "K3.B"),
        device("T5", terminal, "T4.B"),
        device("K2", "EK1100", "J1.B"),
        device("T3", terminal, "K2.B"),
        device("T2", terminal, "J1.C"),
    ]
    .concat()
}

fn diagnose(text: &str) -> (i32, Value) {
    let directory = TempDir::new().expect("a temporary directory");
    let path = directory.path().join("plant.toml");
    fs::write(&path, text).expect("a file can be written");
    let run = linesman(["diagnose", &format!("sim:{}", path.display()), "--json"]);
    (run.status, run.json())
}

/// Spoils frames on each direction of each link and holds the answer against it.
fn each_direction_of_each_link(terminal: &str, head: &str) {
    for (near, far, a, b) in LINKS {
        for (from, to, direction) in [(near, far, "a-to-b"), (far, near, "b-to-a")] {
            for hits in [1, 10, 1000] {
                let fault = format!(
                    "[[fault]]\nkind = \"emc-noise\"\nat = \"{from}>{to}\"\nfrom_ms = 1500\n\
                     to_ms = 4500\nhits = {hits}\n"
                );
                let (status, diagnosis) = diagnose(&(plant(terminal, head) + &fault));
                let what = format!("{from}>{to}, {hits} hits: {:#}", diagnosis["findings"]);
                assert_eq!(status, 1, "{what}");
                assert_eq!(diagnosis["network"]["lost"], hits, "{what}");
                let findings = diagnosis["findings"].as_array().expect("findings");
                assert_eq!(findings.len(), 1, "{what}");
                let finding = &findings[0];
                let end = |(no, port): End| json!({ "no": no, "port": port });
                let place = json!({
                    "kind": "link", "network": 0, "a": end(a), "b": end(b), "direction": direction
                });
                assert_eq!(finding["place"], place, "{what}");
                // Symbol errors do not tell who made them: the true cause is one of the set.
                let others = finding["alternatives"].as_array().expect("alternatives");
                let mut causes = others.iter().chain([finding]).map(|one| &one["cause"]);
                assert!(causes.any(|cause| cause == "emc-noise"), "{what}");
            }
        }
    }
}

// proves: HW-18 partial: on a virtual segment, HW-23 partial: on a virtual segment
#[test]
fn damage_is_found_where_forwarded_errors_are_counted() {
    each_direction_of_each_link("EL2008", "seed = 5\n");
}

#[test]
fn damage_is_found_where_no_terminal_counts_forwarded_errors() {
    each_direction_of_each_link("EL3102", "seed = 5\n");
}

#[test]
fn damage_is_found_where_no_controller_counts_forwarded_errors() {
    each_direction_of_each_link("EL2008", "seed = 5\ncounts_forwarded = false\n");
}

#[test]
fn old_counters_and_noise_of_power_on_are_no_fault() {
    for terminal in ["EL2008", "EL3102"] {
        let (status, diagnosis) = diagnose(&plant(terminal, "seed = 5\nold_counters = true\n"));
        assert_eq!(status, 0, "{diagnosis:#}");
        assert_eq!(diagnosis["verdict"], "healthy");
    }
}
