//! Register reads of other tools, pasted as they stand in the terminal: twice, a minute apart.

use crate::support::{assert_valid, linesman};
use serde_json::{Value, json};
use tempfile::TempDir;

/// Nothing was counted.
const CLEAN: [u8; 20] = [0; 20];
/// Port A counted 7 bad frames and 9 symbols.
const NOISY: [u8; 20] = [7, 9, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
/// The link of port B was lost twice.
const LOST_B: [u8; 20] = [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0];
/// That of port A was.
const LOST_A: [u8; 20] = [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0];

fn diagnosed(text: &str) -> Value {
    let directory = TempDir::new().unwrap();
    let path = directory.path().join("notes.txt");
    std::fs::write(&path, text).unwrap();
    let diagnosis = linesman(["diagnose", path.to_str().unwrap(), "--json"]).json();
    assert_valid(&diagnosis, "diagnosis");
    diagnosis
}

fn hex(bytes: &[u8], before: &str, between: &str) -> String {
    bytes.iter().map(|byte| format!("{before}{byte:02x}")).collect::<Vec<_>>().join(between)
}

fn igh(rounds: &[[[u8; 20]; 3]]) -> String {
    let mut text = String::new();
    for round in rounds {
        for (position, bytes) in round.iter().enumerate() {
            let bytes = hex(bytes, "0x", " ");
            text += &format!("root@box:~# ethercat reg_read -p {position} 0x0300 20\n{bytes}\n");
        }
        text += "root@box:~# sleep 60\n";
    }
    text
}

fn program(rounds: &[[[u8; 20]; 3]], line: impl Fn(usize, &[u8]) -> String) -> String {
    let lines = rounds.iter().flat_map(|round| {
        round.iter().enumerate().map(|(position, bytes)| line(position + 1, bytes) + "\n")
    });
    lines.collect()
}

fn kickcat(no: usize, bytes: &[u8]) -> String {
    let mut text = format!("slave {no}\n");
    for port in 0..4 {
        text += &format!(
            "Port {port} \n  invalid frame:  {} \n  physical layer: {} \n  forwarded:      {} \n  lost link:      {} \n",
            bytes[2 * port],
            bytes[2 * port + 1],
            bytes[8 + port],
            bytes[16 + port]
        );
    }
    text + " \n"
}

fn texts(rounds: &[[[u8; 20]; 3]]) -> Vec<(&'static str, String)> {
    vec![
        ("IgH", igh(rounds)),
        (
            "SOEM",
            program(rounds, |no, bytes| format!("slave {no} 0x0300: {}", hex(bytes, "", " "))),
        ),
        ("ethercrab", program(rounds, |no, bytes| format!("slave {no} 0x0300: {bytes:02x?}"))),
        (
            "pysoem",
            program(rounds, |no, bytes| format!("slave {no} 0x0300: {}", hex(bytes, "", ""))),
        ),
        ("KickCAT", program(rounds, kickcat)),
    ]
}

#[test]
fn counters_that_rose_between_two_rounds_name_the_link_and_its_direction() {
    for (tool, text) in texts(&[[CLEAN; 3], [CLEAN, CLEAN, NOISY]]) {
        let diagnosis = diagnosed(&text);
        let blocks = diagnosis["understood"]["blocks"].as_array().unwrap();
        assert_eq!(blocks.len(), 2, "{tool}: {blocks:?}");
        let finding = &diagnosis["findings"][0];
        assert_eq!(finding["code"], "H110", "{tool}: {diagnosis:#}");
        assert_eq!(finding["place"]["a"], json!({ "no": 2, "port": "B" }), "{tool}");
        assert_eq!(finding["place"]["b"], json!({ "no": 3, "port": "A" }), "{tool}");
        assert_eq!(finding["place"]["direction"], "a-to-b", "{tool}");
        let first = &finding["evidence"][0];
        assert_eq!((&first["register"], &first["after"]), (&json!(0x0300), &json!(7)), "{tool}");
    }
}

#[test]
fn counters_of_one_round_may_be_old() {
    for (tool, text) in texts(&[[CLEAN, CLEAN, NOISY]]) {
        let finding = &diagnosed(&text)["findings"][0];
        assert_eq!(finding["severity"], "warning", "{tool}: {finding:#}");
        assert!(
            finding["actions"].to_string().contains("clear the counters"),
            "{tool}: {finding:#}"
        );
    }
}

#[test]
fn lost_links_of_both_ends_name_the_link() {
    for (tool, text) in texts(&[[CLEAN; 3], [CLEAN, LOST_B, LOST_A]]) {
        let finding = &diagnosed(&text)["findings"][0];
        assert_eq!(finding["code"], "H101", "{tool}: {finding:#}");
        assert_eq!(finding["place"]["a"], json!({ "no": 2, "port": "B" }), "{tool}");
    }
}

#[test]
fn nothing_that_rose_is_judged_and_said_so() {
    for (tool, text) in texts(&[[NOISY; 3], [NOISY; 3]]) {
        let diagnosis = diagnosed(&text);
        assert_eq!(diagnosis["findings"], json!([]), "{tool}: {diagnosis:#}");
        let subjects = diagnosis["coverage"]["subjects"].as_array().unwrap();
        let quality = subjects.iter().find(|one| one["subject"] == "signal-quality").unwrap();
        assert_eq!(quality["extent"], "in-part", "{tool}: the card's own counters: {quality:#}");
    }
}

#[test]
fn what_is_missing_is_named_in_the_words_of_the_tool() {
    let diagnosis =
        diagnosed("root@box:~# ethercat reg_read -p 0 0x0130 6\n0x08 0x00 0x00 0x00 0x00 0x00\n");
    let steps = diagnosis["coverage"].to_string();
    assert!(steps.contains("ethercat reg_read -p N 0x0300 20"), "{steps}");
}
