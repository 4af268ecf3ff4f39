//! `linesman capture info`: what the network is, from frames alone.

use std::fs;
use std::path::Path;

use crate::captures::captures;
use crate::support::capture::Pcap;
use crate::support::{assert_valid, linesman};
use serde_json::{Value, json};
use tempfile::TempDir;

/// The JSON of a capture, held against its schema.
pub(crate) fn info(path: &Path) -> Value {
    let run = linesman(["capture", "info", path.to_str().unwrap(), "--json"]);
    assert_eq!(run.status, 0, "{}", run.all());
    let value = run.json();
    assert_valid(&value, "capture");
    value
}

/// The published frame of 516 bytes: command, the two words of its address as sent, length, working counter.
const SEVEN: [(u8, u16, u16, u16, u16); 7] = [
    (0, 0, 0x0900, 4, 0),
    (13, 0xFFED, 0x0910, 4, 46),
    (10, 0, 0x0900, 3, 18),
    (12, 0, 0x0100, 150, 21),
    (11, 0x0800, 0x0100, 33, 17),
    (10, 0x1000, 0x0100, 220, 19),
    (7, 0, 0x0130, 2, 46),
];

/// The frame on its way out, or back.
fn seven(is_back: bool) -> Vec<u8> {
    let source = if is_back { 2 } else { 0 };
    let mut bytes = vec![0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, source, 1, 5, 1, 0, 0, 0x88, 0xA4];
    bytes.extend([0xF4, 0x11]);
    for (number, (command, adp, ado, len, wkc)) in (0_u8..).zip(SEVEN) {
        let more = if number == 6 { 0 } else { 0x8000_u16 };
        let passed = if is_back && matches!(command, 7 | 13) { 46 } else { 0 };
        bytes.extend([command, 0xB0 + number]);
        bytes.extend(adp.wrapping_add(passed).to_le_bytes());
        bytes.extend(ado.to_le_bytes());
        bytes.extend((len | more).to_le_bytes());
        bytes.extend([0, 0]);
        let state = is_back && command == 7;
        bytes.extend((0..len).map(|at| if state && at == 0 { 8 } else { 0 }));
        bytes.extend(if is_back { wkc } else { 0 }.to_le_bytes());
    }
    assert_eq!(bytes.len(), 516);
    bytes
}

fn file(folder: &TempDir, capture: Pcap) -> std::path::PathBuf {
    let path = folder.path().join("made.pcap");
    fs::write(&path, capture.0).unwrap();
    path
}

/// What the published frame says of its network.
fn assert_published(info: &Value) {
    assert_eq!(info["network"]["devices"], 46, "{info}");
    assert_eq!(info["network"]["reference_clock"]["no"], 20, "{info}");
    assert_eq!(info["network"]["reference_clock"]["takes_part"], 46);
    assert_eq!(info["network"]["mailboxes"], json!({ "count": 18, "by": "status-bits" }));
    let frame = &info["cyclic"][0];
    assert_eq!((&frame["bytes"], &frame["data_bytes"]), (&json!(516), &json!(416)));
    let wkc: Vec<u64> = frame["datagrams"]
        .as_array()
        .unwrap()
        .iter()
        .map(|one| one["working_counters"][0]["value"].as_u64().unwrap())
        .collect();
    assert_eq!(wkc, [0, 46, 18, 21, 17, 19, 46]);
}

// S0 L2696-2757: frames 3 µs apart out and back, 2 ms from one to the next; 46 SubDevices, the twentieth has the
// reference clock, 18 have a mailbox.
// proves: WS-05, WS-04
#[test]
fn published_frames_name_46_subdevices_the_clock_and_18_mailboxes() {
    let folder = TempDir::new().unwrap();
    let mut capture = Pcap::new();
    for cycle in 0..40 {
        capture.frame(cycle * 1_992, &seven(false));
        capture.frame(cycle * 1_992 + 3, &seven(true));
    }
    let path = file(&folder, capture);
    let whole = info(&path);
    assert_published(&whole);
    assert_eq!(whole["recording"]["ways"], "both");
    assert_eq!(whole["recording"]["began_in_run"], true);
    let frame = &whole["cyclic"][0];
    assert_eq!((&frame["cycle_ns"], &frame["task"]), (&json!(1_992_000), &json!(1)));
    assert_eq!(frame["response"]["median_ns"], 3_000);
    // 516 bytes take 43.2 µs of 1.992 ms.
    assert_eq!((&frame["wire_ns"], &frame["load_percent"]), (&json!(43_200), &json!(2.17)));
    assert_eq!(
        (&frame["missing"], &frame["off"], &frame["lost"]),
        (&json!(0), &json!(0), &json!(0))
    );
    let text = linesman(["capture", "info", path.to_str().unwrap()]);
    for words in ["46 SubDevices, 18 mailboxes", "SubDevice 20 is the reference clock", "516"] {
        assert!(text.stdout.contains(words), "{words}: {}", text.stdout);
    }
}

// proves: WS-05
#[test]
fn single_published_frame_and_returns_alone_name_the_same() {
    let folder = TempDir::new().unwrap();
    let mut capture = Pcap::new();
    capture.frame(0, &seven(false));
    capture.frame(3, &seven(true));
    let single = info(&file(&folder, capture));
    assert_published(&single);
    assert_eq!(single["cyclic"][0]["cycle_ns"], Value::Null, "one frame has no cycle");
    let mut capture = Pcap::new();
    for cycle in 0..40 {
        capture.frame(cycle * 2_000, &seven(true));
    }
    let returns = info(&file(&folder, capture));
    assert_published(&returns);
    assert_eq!(returns["recording"]["ways"], "returns");
    assert_eq!(returns["timing"]["response"], Value::Null);
    let unknown = returns["unknown"].to_string();
    assert!(unknown.contains("no requests"), "{unknown}");
}

#[test]
fn start_up_of_a_coupler_with_an_analogue_terminal_is_told_in_full() {
    let Some(directory) = captures() else { return };
    let info = info(&directory.join("ec-replay-ek1914-el3004-mailbox.pcapng"));
    let terminal = &info["devices"][1];
    assert_eq!((&terminal["type"], &terminal["station"]), (&json!("EL3004"), &json!(0x1001)));
    assert_eq!(
        (&terminal["product_code"], &terminal["state"]),
        (&json!(0x0BBC_3052), &json!("PREOP"))
    );
    let managers = terminal["sync_managers"].as_array().unwrap();
    let modes: Vec<&str> = managers.iter().map(|one| one["mode"].as_str().unwrap()).collect();
    assert_eq!(modes[..2], ["mailbox", "mailbox"]);
    assert_eq!((&managers[0]["start"], &managers[0]["length"]), (&json!(0x1000), &json!(128)));
    let transfers = info["transfers"].as_array().unwrap();
    let told: Vec<_> = transfers
        .iter()
        .map(|one| {
            (
                one["what"].as_str().unwrap(),
                one["index"].as_u64().unwrap(),
                one["data"].as_str().unwrap(),
            )
        })
        .collect();
    let expected = [
        ("upload", 0x100A, "3038"),
        ("download", 0xF008, "01000000"),
        ("upload", 0xF008, "01000000"),
    ];
    assert_eq!(told, expected);
    let links = info["links"].as_array().unwrap();
    assert_eq!(links[1], json!({ "a": { "no": 1, "port": "B" }, "b": { "no": 2, "port": "A" } }));
    assert_eq!(info["network"]["mailboxes"], json!({ "count": 2, "by": "sync-managers" }));
}

#[test]
fn type_of_a_subdevice_is_taken_from_a_device_description() {
    let Some(directory) = captures() else { return };
    let path = directory.join("ec-replay-ek1100-el2828-el2889.pcapng");
    let folder = TempDir::new().unwrap();
    let esi = folder.path().join("esi.xml");
    fs::write(
        &esi,
        "<EtherCATInfo><Vendor><Id>2</Id><Name>V</Name></Vendor><Descriptions><Groups/><Devices><Device>\
         <Type ProductCode=\"#x0b0c3052\" RevisionNo=\"#x00110000\">EL2828-described</Type></Device></Devices>\
         </Descriptions></EtherCATInfo>",
    )
    .unwrap();
    let run = linesman([
        "capture",
        "info",
        path.to_str().unwrap(),
        "--esi",
        esi.to_str().unwrap(),
        "--json",
    ]);
    let devices = run.json()["devices"].clone();
    assert_eq!(devices[1]["described_as"], "EL2828-described", "{}", run.all());
    assert_eq!(devices[0]["described_as"], Value::Null);
    let missing = linesman(["capture", "info", path.to_str().unwrap(), "--esi", "nowhere"]);
    assert_eq!(missing.status, 2);
    assert!(missing.stderr.contains("nowhere"), "{}", missing.stderr);
}

/// Entries of PDOs in the process image of a capture: SubDevice, source, and where they are with their names.
fn entries(info: &Value) -> Vec<(u64, String, Vec<String>)> {
    let parts = info["image"].as_array().unwrap().iter();
    let parts = parts.flat_map(|datagram| datagram["parts"].as_array().unwrap());
    let entry = |one: &Value| {
        let text = |key: &str| one[key].as_str().unwrap_or("?").to_owned();
        let (pdo, index) = (one["pdo"].as_u64().unwrap(), one["index"].as_u64().unwrap());
        format!(
            "{}.{}+{} {pdo:04X} {}/{index:04X}:{} {}",
            one["byte"],
            one["bit"],
            one["bits"],
            text("pdo_name"),
            one["subindex"],
            text("name")
        )
    };
    parts
        .map(|part| {
            let by = part["entries_by"].as_str().unwrap_or("?").to_owned();
            let entries = part["entries"].as_array().unwrap().iter().map(entry);
            (part["no"].as_u64().unwrap(), by, entries.collect())
        })
        .collect()
}

#[test]
fn bits_of_the_process_image_have_the_names_of_the_pdos_in_the_sii() {
    let folder = TempDir::new().unwrap();
    let (plant, path) = (folder.path().join("plant.toml"), folder.path().join("own.pcapng"));
    let device = |name: &str, kind: &str, on: &str| {
        format!("[[device]]\nname = \"{name}\"\ntype = \"{kind}\"\non = \"{on}\"\n")
    };
    let devices = [
        device("K1", "EK1100", "maindevice"),
        device("I1", "EL1008", "K1.B"),
        device("A1", "EL3104", "I1.B"),
    ];
    fs::write(&plant, format!("name = \"names\"\nseed = 1\n{}", devices.concat())).unwrap();
    let place = format!("sim:{}", plant.display());
    let run = linesman(["diagnose", &place, "--seconds", "2", "--record", path.to_str().unwrap()]);
    assert!(run.status <= 1, "{}", run.all());
    let told = entries(&info(&path));
    assert_eq!(told.len(), 2, "{told:?}");
    let (digital, analogue) = (&told[0], &told[1]);
    assert_eq!((digital.0, digital.1.as_str(), digital.2.len()), (2, "sii", 8), "{told:?}");
    assert_eq!(digital.2[3], "0.3+1 1A03 Channel 4/6030:1 Input");
    assert_eq!((analogue.0, analogue.1.as_str()), (3, "sii"), "{told:?}");
    // Behind eight bits of inputs, and behind a status of 16 bits with gaps.
    assert!(
        analogue.2.contains(&"3.0+16 1A00 AI Standard Channel 1/6000:17 Value".to_owned()),
        "{told:?}"
    );
    let text = linesman(["capture", "info", path.to_str().unwrap(), "--all"]);
    assert!(
        text.stdout.contains("0x1A00 AI Standard Channel 1  0x6000:11  Value"),
        "{}",
        text.stdout
    );
}

#[test]
fn names_that_the_sii_was_not_read_for_come_from_a_device_description() {
    let Some(directory) = captures() else { return };
    let path = directory.join("ec-replay-ek1100-el2828-el2889.pcapng");
    let bare = entries(&info(&path));
    // FMMUs of the terminal with sixteen outputs lead to two SyncManagers.
    let lens: Vec<(u64, usize)> = bare.iter().map(|part| (part.0, part.2.len())).collect();
    assert_eq!(lens, [(3, 8), (3, 8), (2, 8)], "{bare:?}");
    assert_eq!(bare[2].2[1], "0.1+1 1601 ?/7010:1 ?");
    let folder = TempDir::new().unwrap();
    let esi = folder.path().join("esi.xml");
    let pdo = |no: u16| {
        format!(
            "<RxPdo Fixed=\"1\" Sm=\"0\"><Index>#x{:04X}</Index><Name>Channel {}</Name><Entry><Index>#x{:04X}</Index>\
             <SubIndex>1</SubIndex><BitLen>1</BitLen><Name>Output</Name><DataType>BOOL</DataType></Entry></RxPdo>",
            0x1600 + no,
            no + 1,
            0x7000 + 16 * no
        )
    };
    let pdos: String = (0..8).map(pdo).collect();
    let described = format!(
        "<EtherCATInfo><Vendor><Id>2</Id><Name>V</Name></Vendor><Descriptions><Groups/><Devices><Device Physics=\"YKY\">\
         <Type ProductCode=\"#x0b0c3052\" RevisionNo=\"#x00110000\">EL2828</Type><Name>Eight outputs</Name>\
         <Sm StartAddress=\"#x0f00\" ControlByte=\"#x44\" Enable=\"1\">Outputs</Sm>{pdos}\
         <Eeprom><ByteSize>2048</ByteSize><ConfigData>0601</ConfigData></Eeprom></Device></Devices></Descriptions></EtherCATInfo>"
    );
    fs::write(&esi, described).unwrap();
    let arguments = ["capture", "info", path.to_str().unwrap(), "--esi", esi.to_str().unwrap()];
    let run = linesman([&arguments[..], &["--json"]].concat());
    assert_eq!(run.status, 0, "{}", run.all());
    let named = entries(&run.json());
    assert_eq!(named[2].2[1], "0.1+1 1601 Channel 2/7010:1 Output", "{}", run.all());
    assert_eq!(named[2].1, "sii", "the SubDevice itself says what is there");
}

/// The frames of a recording with NOP in place of reads of the SII from word 0x40 on: of its categories nobody read any.
fn without_categories(recorded: &Path) -> Pcap {
    /// Categories of a SII begin at this word.
    const CATEGORIES: u16 = 0x40;
    let mut reader = linesman_link::capture::CaptureReader::open(recorded).unwrap();
    let mut frames: Vec<Vec<u8>> = Vec::new();
    let mut times = Vec::new();
    let mut start = None;
    while let Some(frame) = reader.next_frame() {
        let time = frame.time.unwrap();
        times.push(time.since(*start.get_or_insert(time)).unwrap().as_nanos() / 1_000);
        frames.push(frame.bytes.to_vec());
    }
    let word = |bytes: &[u8], at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
    for number in 0..frames.len() {
        let (sent, rest) = frames.split_at_mut(number);
        let back = &mut rest[0];
        let is_sent = |frame: &&mut Vec<u8>| frame[6] & 2 == 0 && frame[17] == back[17];
        if back[6] & 2 == 0 {
            continue;
        }
        let Some(sent) = sent.iter_mut().rev().find(is_sent) else { continue };
        let mut at = 16;
        loop {
            let length = word(back, at + 6);
            let len = usize::from(length & 0x7FF);
            // Control, address and data in one read.
            if (back[at], word(back, at + 4), len) == (4, 0x0502, 14)
                && word(back, at + 12) >= CATEGORIES
            {
                for copy in [&mut *sent, back] {
                    copy[at] = 0;
                    copy[at + 10..at + 12 + len].fill(0);
                }
            }
            at += 12 + len;
            if length & 0x8000 == 0 {
                break;
            }
        }
    }
    let mut capture = Pcap::new();
    for (bytes, time) in frames.iter().zip(times) {
        capture.frame(time, bytes);
    }
    capture
}

#[test]
fn bits_of_the_process_image_have_the_names_of_a_device_description_where_frames_tell_none() {
    let folder = TempDir::new().unwrap();
    let (plant, recorded) = (folder.path().join("plant.toml"), folder.path().join("own.pcapng"));
    let devices = "[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
                   [[device]]\nname = \"I1\"\ntype = \"EL1008\"\non = \"K1.B\"\n\
                   [[device]]\nname = \"I2\"\ntype = \"EL1004\"\non = \"I1.B\"\n";
    fs::write(&plant, format!("name = \"names\"\nseed = 1\n{devices}")).unwrap();
    let place = format!("sim:{}", plant.display());
    let words = ["diagnose", &place, "--seconds", "1", "--record", recorded.to_str().unwrap()];
    assert!(linesman(words).status <= 1);
    let path = file(&folder, without_categories(&recorded));
    let bare = info(&path);
    let parts: Vec<(u64, usize)> =
        entries(&bare).iter().map(|part| (part.0, part.2.len())).collect();
    assert_eq!(parts, [(2, 0), (3, 0)], "who has bits is known by FMMUs, their names by nothing");
    let (product, revision) =
        (&bare["devices"][1]["product_code"], &bare["devices"][1]["revision"]);
    let esi = folder.path().join("esi.xml");
    let pdo = |no: u16| {
        format!(
            "<TxPdo Fixed=\"1\" Sm=\"0\"><Index>#x{:04X}</Index><Name>Lamp {}</Name><Entry><Index>#x{:04X}</Index>\
             <SubIndex>1</SubIndex><BitLen>1</BitLen><Name>Lit</Name><DataType>BOOL</DataType></Entry></TxPdo>",
            0x1A00 + no,
            no + 1,
            0x6000 + 16 * no
        )
    };
    let pdos: String = (0..8).map(pdo).collect();
    let described = format!(
        "<EtherCATInfo><Vendor><Id>2</Id><Name>V</Name></Vendor><Descriptions><Groups/><Devices><Device Physics=\"YKY\">\
         <Type ProductCode=\"{product}\" RevisionNo=\"{revision}\">EL1008</Type><Name>Eight inputs</Name>\
         <Sm StartAddress=\"#x1000\" ControlByte=\"#x00\" Enable=\"1\">Inputs</Sm>{pdos}\
         <Eeprom><ByteSize>2048</ByteSize><ConfigData>0601</ConfigData></Eeprom></Device></Devices></Descriptions></EtherCATInfo>"
    );
    fs::write(&esi, described).unwrap();
    let arguments = ["capture", "info", path.to_str().unwrap(), "--esi", esi.to_str().unwrap()];
    let run = linesman([&arguments[..], &["--json"]].concat());
    let named = entries(&run.json());
    assert_eq!((named[0].0, named[0].1.as_str(), named[0].2.len()), (2, "esi", 8), "{named:?}");
    assert_eq!(named[0].2[3], "0.3+1 1A03 Lamp 4/6030:1 Lit");
    assert_eq!((named[1].0, named[1].2.len()), (3, 0), "nothing describes it: {named:?}");
    let text = linesman([&arguments[..], &["--all"]].concat()).stdout;
    assert!(text.contains("0x1A03 Lamp 4  0x6030:01  Lit"), "{text}");
}

#[test]
fn line_that_nobody_answers_on_is_told_without_claims() {
    let Some(directory) = captures() else { return };
    let info = info(&directory.join("ec-soem-sdinfo-no-slaves.pcapng"));
    assert_eq!(
        (&info["network"]["devices"], &info["recording"]["ways"]),
        (&json!(0), &json!("requests"))
    );
    assert_eq!((&info["devices"], &info["network"]["reference_clock"]), (&json!([]), &Value::Null));
    let asked = info["states"].as_array().unwrap();
    assert!(asked.iter().all(|one| one["what"] == "asked" && one["wkc"].is_null()), "{asked:?}");
    assert!(info["unknown"].to_string().contains("no returns"));
}

#[test]
fn what_is_no_capture_is_refused_with_the_next_step() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("notes.txt");
    fs::write(&path, "slave 1 OP\n").unwrap();
    let text = linesman(["capture", "info", path.to_str().unwrap()]);
    assert_eq!(text.status, 2, "{}", text.all());
    assert!(text.stderr.contains("expected a capture"), "{}", text.stderr);
    let card = linesman(["capture", "info", "eth0"]);
    assert_eq!(card.status, 2);
    let json = linesman(["capture", "info", "missing.pcapng", "--json"]);
    assert_eq!((json.status, &json.json()["schema"]), (2, &json!("linesman.error/1")));
}

// S0 L2646-2692.
// proves: WS-01, WS-02, WS-03
#[test]
fn guide_names_the_capture_last_the_probe_and_three_set_ups_with_their_limits() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/guide/capture.md");
    let page = fs::read_to_string(path).unwrap();
    let steps = [
        "1. Look at the line: `linesman diagnose listen:",
        "2. Look at this computer",
        "3. Take a capture",
    ];
    let places: Vec<usize> = steps.iter().map(|step| page.find(step).unwrap()).collect();
    assert!(places.is_sorted(), "the capture comes last: {places:?}");
    for figure in [
        "eight ports",
        "four channels",
        "less than 1 µs",
        "resolution of 1 ns",
        "accuracy of 40 ns",
        "24 V",
    ] {
        assert!(page.contains(figure), "{figure}");
    }
    let rows: Vec<&str> = page.lines().filter(|line| line.starts_with("| ")).collect();
    assert_eq!(rows.len(), 4, "a heading and three set-ups: {rows:?}");
    for (row, words) in rows[1..].iter().zip(["own card", "time stamps", "closed system"]) {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        assert!(cells[1].contains(words) && cells[3].len() > 20, "{row}");
    }
}
