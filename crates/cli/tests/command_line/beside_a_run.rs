//! Services for single SubDevices beside a running MainDevice, through its control socket.

use std::collections::BTreeSet;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::os::unix::net::UnixStream;
use std::time::Duration;

use crate::support::running::{PLANT, Running};
use crate::support::{assert_valid, linesman};
use linesman_sim::device::files::FirmwareImage;
use serde_json::{Value, json};
use tempfile::TempDir;

// proves: DIA-08 partial: requests beside a run
#[test]
fn subdevices_are_asked_while_the_line_runs() {
    let running = Running::start(PLANT);
    let socket = running.socket();
    let states = linesman(["state", &socket, "--json"]).json();
    assert_valid(&states, "states");
    assert_eq!(states["devices"].as_array().unwrap().len(), 3);
    let vendor = linesman(["sdo", &socket, "3", "read", "0x1018:1"]);
    assert_eq!(vendor.status, 0, "{}", vendor.all());
    assert!(vendor.stdout.contains("0x00000002"), "{}", vendor.stdout);
    assert!(
        !vendor.stderr.contains("taken to PREOP"),
        "its state is left alone: {}",
        vendor.stderr
    );
    let status = linesman(["reg", &socket, "0x1002", "read", "0x0130"]);
    assert!(status.stdout.contains("OP"), "{}", status.all());
    let refused =
        linesman(["sdo", &socket, "3", "write", "0x1018:1", "5", "--type", "udint", "--json"]);
    assert_eq!(refused.status, 1, "{}", refused.all());
    assert_valid(&refused.json(), "refusal");
    let down = linesman(["state", &socket, "3", "--to", "preop"]);
    assert_eq!(down.status, 0, "{}", down.all());
    let states = linesman(["state", &socket, "3", "--json"]).json();
    assert_eq!(states["devices"][0]["al_state"], "PREOP", "it stays where it was asked to go");
    let up = linesman(["state", &socket, "3", "--to", "op"]);
    assert_eq!(up.status, 0, "{}", up.all());
}

// S0 L1568, L2431-2440: "clear error".
// proves: DIA-08
#[test]
fn an_error_is_cleared_while_the_line_runs() {
    let running = Running::start(&format!(
        "{PLANT}\n[[fault]]\nkind = \"config-mismatch\"\ndevice = \"T3\"\nfrom_ms = 2000\n"
    ));
    let socket = running.socket();
    // From then on it refuses SAFEOP, which nobody notices until it is asked for that.
    let refused = (0..100).any(|_| {
        let down = linesman(["state", &socket, "3", "--to", "preop"]);
        assert_eq!(down.status, 0, "{}", down.all());
        linesman(["state", &socket, "3", "--to", "safeop", "--json"]).status == 1
    });
    assert!(refused, "it never refuses");
    let state = || linesman(["state", &socket, "3", "--json"]).json()["devices"][0].clone();
    let erroneous = (0..100).any(|_| state()["al_error"] == true);
    assert!(erroneous, "{}", state());
    let cleared = linesman(["state", &socket, "3", "--acknowledge", "--json"]);
    assert_eq!(cleared.status, 0, "{}", cleared.all());
    let device = &cleared.json()["devices"][0];
    assert_eq!(
        (&device["al_state"], &device["al_error"]),
        (&"PREOP".into(), &false.into()),
        "{device}"
    );
    // The others have run on meanwhile.
    let states = linesman(["state", &socket, "--json"]).json();
    assert_eq!(states["devices"][1]["al_state"], "OP");
}

/// What a register command reports of a running line.
fn registers(socket: &str, rest: &[&str], status: i32) -> Value {
    let run = linesman([&["reg", socket], rest, &["--json"]].concat());
    assert_eq!(run.status, status, "{rest:?}: {}", run.all());
    let json = run.json();
    assert_valid(&json, if status == 0 { "registers" } else { "error" });
    json
}

// S1 L882: the register editor of the sources. What it must not do by accident needs a word of consent.
// proves: ESC-16
#[test]
fn any_register_is_read_and_written_while_the_line_runs() {
    let running = Running::start(PLANT);
    let socket = running.socket();
    let reg = |rest: &[&str]| registers(&socket, rest, 0);
    // By address and by name, one of many and many at once, each with its meaning.
    for (named, address) in [
        ("al-status", "0x0130"),
        ("dl-status", "0x0110"),
        ("fmmu-1", "0x0610"),
        ("user-ram", "0x0F80"),
    ] {
        let (by_name, by_address) = (reg(&["2", "read", named]), reg(&["2", "read", address]));
        assert_eq!(by_name["registers"][0]["name"], by_address["registers"][0]["name"]);
        assert_eq!(by_name["address"], by_address["address"]);
    }
    assert_eq!(reg(&["2", "read", "al-status"])["registers"][0]["meaning"], "OP");
    let station = reg(&["2", "read", "0x0010"]);
    assert_eq!(station["bytes"], "02 10", "{station}");
    let counters = reg(&["2", "read", "rx-error-counter-port-b"]);
    assert_eq!(counters["address"], 0x0302);
    assert_eq!(counters["registers"][0]["name"], "RX error counter, port B");
    // Written, and read again: bytes, and a number of the length of its register.
    reg(&["2", "write", "0x0F80", "DE AD BE EF"]);
    assert_eq!(reg(&["2", "read", "0x0F80", "--len", "4"])["bytes"], "DE AD BE EF");
    reg(&["2", "write", "ecat-event-mask", "0x0005"]);
    let mask = reg(&["2", "read", "0x0200"]);
    assert_eq!(mask["bytes"], "05 00", "{mask}");
    // What would take it off the line, out of OP, or away from its process data is refused in words and changes
    // nothing; so is what nobody can write.
    for (register, value, words) in [
        ("0x0010", "0x2000", "frames that are meant for the SubDevice"),
        ("dl-control", "0", "a port that is closed"),
        ("al-control", "1", "linesman state"),
        ("watchdog-time-process-data", "1", "outputs fall"),
        ("0x0500", "1", "linesman sii"),
        ("fmmu-0", "0", "go elsewhere"),
        ("syncmanager-0", "0", "go elsewhere"),
        ("0x1000", "1", "process data"),
        ("al-status", "1", "only read"),
    ] {
        let write = ["2", "write", register, value, "--len", "1"];
        let refused = registers(&socket, if value.len() > 3 { &write[..4] } else { &write }, 2);
        assert!(refused["reason"].as_str().unwrap().contains(words), "{refused}");
        assert!(refused["next_step"].as_str().unwrap().contains("--force"), "{refused}");
    }
    assert_eq!(reg(&["2", "read", "0x0010"])["bytes"], "02 10");
    assert_eq!(reg(&["2", "read", "al-status"])["registers"][0]["meaning"], "OP");
    // With consent it is written: a longer watchdog, which harms nobody here.
    let before = reg(&["2", "read", "watchdog-time-process-data"]);
    let write = ["2", "write", "watchdog-time-process-data", "5000"];
    registers(&socket, &write, 2);
    assert_eq!(reg(&["2", "read", "0x0420"])["bytes"], before["bytes"]);
    let written = reg(&[&write[..], &["--force"]].concat());
    assert_eq!(written["registers"][0]["address"], 0x0420, "{written}");
    assert_eq!(reg(&["2", "read", "0x0420"])["bytes"], "88 13");
    // The line has run on.
    let report = running.until("is shown", |_| true);
    assert!(report["devices"].as_array().unwrap().iter().all(|one| one["al_state"] == "OP"));
}

#[test]
fn a_socket_without_a_run_is_told() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("socket");
    drop(std::os::unix::net::UnixListener::bind(&path).unwrap());
    let run = linesman(["state", path.to_str().unwrap()]);
    assert_eq!(run.status, 2, "{}", run.all());
    assert!(run.stderr.contains("is it still running?"), "{}", run.stderr);
    let running = Running::start(PLANT);
    let nobody = linesman(["state", &running.socket(), "9"]);
    assert_eq!(nobody.status, 2, "{}", nobody.all());
}

// S0 L2431-2461: BOOT, and files both ways, from the tool; beside a line that runs on.
// proves: SW-14
#[test]
fn firmware_is_taken_in_boot_and_files_go_both_ways() {
    let plant = format!("{PLANT}[[device]]\nname = \"C4\"\ntype = \"EL6601\"\non = \"T3.B\"\n");
    let running = Running::start(&plant);
    let socket = running.socket();
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let done = |words: &[&str]| {
        let run = linesman(words);
        assert_eq!(run.status, 0, "{words:?}: {}", run.all());
        run
    };
    let state =
        || linesman(["state", &socket, "4", "--json"]).json()["devices"][0]["al_state"].clone();
    // A file there and back.
    let settings: Vec<u8> = (0..300).map(|byte| byte as u8).collect();
    std::fs::write(path("settings"), &settings).unwrap();
    done(&["foe", &socket, "4", "write", "settings.txt", &path("settings")]);
    done(&["foe", &socket, "4", "read", "settings.txt", &path("back")]);
    assert_eq!(std::fs::read(path("back")).unwrap(), settings);
    assert_eq!(state(), "OP", "that needs no other state");
    // Firmware: it is taken in BOOT only, and the SubDevice is brought back to where it was.
    let version = || done(&["sdo", &socket, "4", "read", "0x100A", "--type", "STRING"]).stdout;
    let before = version();
    let image = FirmwareImage::build("EL6601", "47", &[0x5A; 200_000]);
    std::fs::write(path("new.efw"), &image).unwrap();
    let refused = linesman(["foe", &socket, "4", "write", "new.efw", &path("new.efw"), "--json"]);
    assert_eq!(
        (refused.status, refused.json()["code"].as_u64()),
        (1, Some(0x8008)),
        "{}",
        refused.all()
    );
    // Meanwhile the run tells how far it has come.
    let mut told = BTreeSet::new();
    let firmware = path("new.efw");
    let command = ["foe", &socket, "4", "write", "new.efw", &firmware, "--boot", "--json"];
    let wrote = std::thread::scope(|scope| {
        let writer = scope.spawn(|| linesman(command));
        while !writer.is_finished() {
            let files = running.ask(r#"{"do":"files"}"#)["files"].clone();
            for file in files.as_array().unwrap() {
                assert_eq!(
                    (&file["no"], &file["total"]),
                    (&json!(4), &json!(image.len())),
                    "{file}"
                );
                told.insert(file["text"].as_str().unwrap().to_owned());
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        writer.join().unwrap()
    });
    assert_eq!(wrote.status, 0, "{}", wrote.all());
    assert_eq!(wrote.json()["size"], image.len(), "{}", wrote.all());
    let whole = format!(" of {} bytes", image.len());
    assert!(told.iter().any(|text| text.contains(&whole)), "{told:?}");
    let files = running.ask(r#"{"do":"files"}"#);
    assert_eq!(files["files"], json!([]), "none is under way");
    running.until("is back in OP", |report| report["devices"][3]["al_state"] == "OP");
    assert!(!before.contains("47") && version().contains("47"), "{before} then {}", version());
    let others = linesman(["state", &socket, "--json"]).json();
    assert!(others["devices"].as_array().unwrap().iter().all(|one| one["al_state"] == "OP"));
}

#[test]
fn long_requests_are_read_a_few_at_a_time() {
    let running = Running::start(PLANT);
    let send = |bytes: &[u8]| {
        let mut stream = UnixStream::connect(running.socket()).unwrap();
        stream.write_all(bytes).unwrap();
        stream
    };
    let error = |stream: UnixStream| {
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        let mut line = String::new();
        BufReader::new(stream).read_line(&mut line).unwrap();
        let answer: Value = serde_json::from_str(&line).unwrap();
        answer["error"].as_str().unwrap().to_owned()
    };
    let mut long = vec![b'x'; 200_000];
    long.push(b'\n');
    let told = error(send(&long));
    assert!(told.contains("cannot be read"), "{told}");
    // Whoever begins and does not go on keeps no place for ever.
    let stall = || -> Vec<UnixStream> { (0..4).map(|_| send(&long[..100_000])).collect() };
    let is_refused = || error(send(&long)).contains("4 long requests are under way");
    // On a host that stands still, those that stall may have been given up before a fifth comes.
    let stalled = (0..30).find_map(|_| Some(stall()).filter(|_| (0..100).any(|_| is_refused())));
    for mut stream in stalled.expect("a fifth is refused") {
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        let ended = stream.read_to_end(&mut Vec::new());
        assert!(ended.is_ok(), "the connection of one that stalls is closed: {ended:?}");
    }
    let told = error(send(&long));
    assert!(told.contains("cannot be read"), "{told}");
}

/// A stepper stage, and what it notes of itself: severity and number of the text, and when.
fn noting(messages: &[(u8, u16, u32)]) -> String {
    let mut plant = format!("{PLANT}[[device]]\nname = \"M4\"\ntype = \"EL7041\"\non = \"T3.B\"\n");
    for (severity, text, at_ms) in messages {
        let [low, high] = text.to_le_bytes();
        plant += &format!(
            "[[fault]]\nkind = \"emergency\"\ndevice = \"M4\"\ncode = 0xFF00\n\
             data = \"{severity:02X} {low:02X} {high:02X}\"\nfrom_ms = {at_ms}\n"
        );
    }
    plant
}

// S0 L2388-2397, S1 L1010-1025: five messages, with type, flag, time and text; three have been acknowledged, two
// are new.
// proves: SW-08
#[test]
fn the_five_messages_of_the_sources_are_read_acknowledged_and_exported() {
    let later = 9_000;
    let plant = noting(&[
        (0, 0x0003, 1_500),
        (2, 0x8406, 1_700),
        (1, 0x4101, later),
        (1, 0x4413, later + 200),
    ]);
    let running = Running::start(&plant);
    let socket = running.socket();
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let texts = [
        (0x0002, "Communication established"),
        (0x0003, "Initialization: 0x0, 0x0, 0xFF"),
        (0x8406, "Undervoltage DC-Link"),
        (0x4101, "Terminal-Overtemperature"),
        (0x4413, "I2T Amplifier overload"),
    ];
    let messages: String = texts
        .iter()
        .map(|(id, text)| {
            format!(
                "<DiagMessage><TextId>#x{id:04X}</TextId><MessageText LcId=\"1033\">{text}</MessageText></DiagMessage>"
            )
        })
        .collect();
    let esi = format!(
        "<EtherCATInfo><Vendor><Id>2</Id></Vendor><Descriptions><Devices><Device>\
         <Type ProductCode=\"#x1B813052\" RevisionNo=\"#x001A0000\">EL7041</Type><Name LcId=\"1033\">Stepper</Name>\
         <Profile><DiagMessages>{messages}</DiagMessages></Profile></Device></Devices></Descriptions></EtherCATInfo>"
    );
    std::fs::write(path("texts.xml"), esi).unwrap();
    let esi = path("texts.xml");
    let history = |more: &[&str]| {
        let words = ["history", &socket, "4", "--esi", &esi, "--json"];
        let run = linesman([&words, more].concat());
        assert_eq!(run.status, 0, "{}", run.all());
        let report = run.json();
        assert_valid(&report, "history");
        report
    };
    // Whether it is new, its severity, its text; the newest first or last, as the program has it.
    let rows = |report: &Value| -> Vec<(bool, String, String)> {
        let text = |one: &Value, key: &str| {
            one[key].as_str().unwrap_or(&one["raw"].to_string()).to_owned()
        };
        let all = report["messages"].as_array().unwrap().iter();
        let row = |one: &Value| (one["new"] == true, text(one, "severity"), text(one, "text"));
        all.map(row).collect()
    };
    let wait_for = |count: usize| {
        (0..400).find(|_| {
            let report = history(&[]);
            let here = report["messages"].as_array().unwrap().len() == count;
            std::thread::sleep(std::time::Duration::from_millis(if here { 0 } else { 50 }));
            here
        })
    };
    let row =
        |new: bool, severity: &str, at: usize| (new, severity.to_owned(), texts[at].1.to_owned());
    assert!(wait_for(3).is_some(), "{}", history(&[]));
    let first = history(&["--acknowledge"]);
    let mut seen = rows(&first);
    seen.sort();
    let mut expected =
        [row(true, "information", 0), row(true, "information", 1), row(true, "error", 2)];
    expected.sort();
    assert_eq!(seen, expected);
    assert!(wait_for(5).is_some(), "{}", history(&[]));
    let mut seen = rows(&history(&[]));
    seen.sort();
    let mut expected = [
        row(false, "information", 0),
        row(false, "information", 1),
        row(false, "error", 2),
        row(true, "warning", 3),
        row(true, "warning", 4),
    ];
    expected.sort();
    assert_eq!(seen, expected);
    // Only the new ones, for a spreadsheet.
    let csv = path("new.csv");
    let new = history(&["--only-new", "--export", &csv, "--acknowledge"]);
    assert_eq!(rows(&new).len(), 2, "{new}");
    let csv = std::fs::read_to_string(csv).unwrap();
    assert!(csv.lines().count() == 3 && csv.contains("I2T Amplifier overload"), "{csv}");
    assert_eq!(rows(&history(&["--only-new"])), []);
    assert_eq!(history(&[])["messages"].as_array().unwrap().len(), 5, "they are kept");
}
