//! A saved view of a network, shown without the network: every row and column from what the file says.

use std::fs;

use crate::support::linesman;
use linesman_runtime::online::report::{
    Count, Neighbour, OnlineDevice, OnlineIdentity, OnlineMailbox, OnlinePort, OnlineReport,
    SCHEMA, Word,
};
use tempfile::TempDir;

/// State, and its text, of SubDevices 14 to 16; all others are in OP.
const STATES: [(u32, u16, &str); 3] =
    [(14, 0x2408, "OP LNK_MIS B"), (15, 0x0101, "INIT NO_COMM"), (16, 0x0014, "ERR SAFEOP")];

fn port(no: u32, name: &str) -> OnlinePort {
    let is_used = matches!((no, name), (_, "A")) || (no < 28 && name == "B");
    let count = |value: u64| is_used.then_some(Count { register: value as u8, total: value });
    let to = |no: u32, port: &str| Neighbour {
        no,
        station: 0x1000 + no as u16,
        auto_increment: 1_u16.wrapping_sub(no as u16),
        port: port.to_owned(),
    };
    OnlinePort {
        port: name.to_owned(),
        link: Some(is_used),
        communication: Some(is_used),
        to: match name {
            "A" if no > 1 => Some(to(no - 1, "B")),
            "B" if no < 28 => Some(to(no + 1, "A")),
            _ => None,
        },
        invalid_frames: count(if (no, name) == (7, "A") { 18 } else { 0 }),
        physical_layer: count(if (no, name) == (7, "A") { 4 } else { 0 }),
        // Each third is of the first generation.
        forwarded: count(0).filter(|_| !no.is_multiple_of(3)),
        lost_links: count(u64::from((no, name) == (14, "B"))),
    }
}

fn device(no: u32) -> OnlineDevice {
    let (_, word, text) = STATES.into_iter().find(|(of, ..)| *of == no).unwrap_or((no, 8, "OP"));
    let identity = OnlineIdentity {
        vendor_id: 2,
        product_code: 0x0C20_3052,
        revision: 0x0014_0000,
        serial: 100 + no,
    };
    OnlineDevice {
        no,
        name: format!("Term {no}"),
        r#type: "EL3104".to_owned(),
        station: 0x1000 + no as u16,
        auto_increment: 1_u16.wrapping_sub(no as u16),
        present: Some(no != 15),
        state: Word { word, text: text.to_owned() },
        planned: Some(identity),
        // One of another revision sits in the place of 20.
        found: (no != 15).then_some(OnlineIdentity {
            revision: if no == 20 { 0x0015_0000 } else { identity.revision },
            ..identity
        }),
        ports: ["A", "B", "C", "D"].map(|name| port(no, name)).to_vec(),
        errors: if no == 7 { 22 } else { 0 },
        presence_changes: if no == 15 { 3 } else { 1 },
        mailbox: Some(OnlineMailbox { out_size: 128, in_size: 256, ..OnlineMailbox::default() }),
        ..OnlineDevice::default()
    }
}

/// A line of 28 SubDevices, as `linesman online --save` writes it.
fn report() -> OnlineReport {
    OnlineReport {
        schema: SCHEMA.to_owned(),
        on: "eth1".to_owned(),
        driven: true,
        state: Word { word: 0x0D00, text: "Not OK".to_owned() },
        planned: 28,
        present: 27,
        devices: (1..=28).map(device).collect(),
        ..OnlineReport::default()
    }
}

fn shown(words: &[&str]) -> String {
    let folder = TempDir::new().unwrap();
    let kept = folder.path().join("kept.json");
    fs::write(&kept, serde_json::to_string(&report()).unwrap()).unwrap();
    let run = linesman([&["online", kept.to_str().unwrap()], words].concat());
    assert!(run.status < 2, "{}", run.all());
    run.stdout
}

// S0 L1535-1577.
// proves: DIA-07, DIA-10
#[test]
fn saved_view_shows_number_type_station_state_and_errors_of_each_of_28() {
    let table = shown(&[]);
    let rows: Vec<&str> = table
        .lines()
        .filter(|line| line.starts_with(|first: char| first.is_ascii_digit()))
        .collect();
    let rows: Vec<&&str> = rows.iter().filter(|row| row.contains("EL3104")).collect();
    assert_eq!(rows.len(), 28, "{table}");
    for (no, row) in (1..).zip(rows) {
        let state = STATES.into_iter().find(|(of, ..)| *of == no).map_or("OP", |(.., text)| text);
        let errors = if no == 7 { "22/0/" } else { "0/" };
        for words in [&format!("Term {no} "), &format!("0x{:04X}", 0x1000 + no), state, errors] {
            assert!(row.contains(words), "`{words}` is missing in: {row}");
        }
        assert_eq!(
            row.contains("--/--/--/--"),
            u32::is_multiple_of(no, 3),
            "forwarded errors: {row}"
        );
    }
    assert!(table.contains("27 of 28 SubDevices there"), "{table}");
}

// S1 L1265-1304.
// proves: PLC-11, PLC-12
#[test]
fn saved_view_of_one_subdevice_tells_planned_and_found_mailbox_and_neighbours() {
    let view = shown(&["20"]);
    let lines = |word: &str| view.lines().find(|line| line.contains(word)).unwrap_or_default();
    assert!(view.starts_with("Term 20 (EL3104), 0x1014 on "), "{view}");
    let identity = "vendor 0x00000002, product 0x0C203052, revision 0x00140000, serial 120";
    assert!(lines("planned: ").contains(identity), "{view}");
    assert!(lines("found: ").contains("revision 0x00150000, serial 120"), "{view}");
    assert!(lines("mailbox: ").contains("128 bytes out, 256 bytes in"), "{view}");
    assert!(view.contains("19 port B") && view.contains("21 port A"), "{view}");
    let gone = shown(&["15"]);
    assert!(gone.contains("planned: ") && !gone.contains("found: "), "{gone}");
    assert!(gone.contains("absent 2 times"), "{gone}");
}
