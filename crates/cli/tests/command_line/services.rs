//! `state`, `sdo`, `foe`, `sii`, `reg` and `history` on a virtual segment.

use std::path::{Path, PathBuf};

use crate::support::{Run, assert_valid, linesman};
use serde_json::Value;
use tempfile::TempDir;

const PLANT: &str = r#"
name = "services"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "A1"
type = "EL3102"
on = "K1.B"
[[device]]
name = "M1"
type = "EL7041"
on = "A1.B"
[[device]]
name = "M2"
type = "EL7041"
on = "M1.B"
[[device]]
name = "C1"
type = "EL6601"
on = "M2.B"
"#;

pub(crate) struct Plant {
    directory: TempDir,
}

impl Plant {
    fn new() -> Self {
        Self::with(PLANT)
    }

    pub(crate) fn with(toml: &str) -> Self {
        let plant = Self { directory: TempDir::new().unwrap() };
        std::fs::write(plant.path("plant.toml"), toml).unwrap();
        plant
    }

    fn path(&self, name: &str) -> PathBuf {
        self.directory.path().join(name)
    }

    /// Runs `linesman COMMAND sim:plant.toml REST…`.
    pub(crate) fn run(&self, command: &str, rest: &[&str]) -> Run {
        let place = format!("sim:{}", self.path("plant.toml").display());
        linesman([&[command, &place], rest].concat())
    }

    /// The same with `--json`, valid by the schema of this name.
    pub(crate) fn json(&self, command: &str, rest: &[&str], schema: &str, status: i32) -> Value {
        let run = self.run(command, &[rest, &["--json"]].concat());
        assert_eq!(run.status, status, "{}", run.all());
        let json = run.json();
        assert_valid(&json, schema);
        json
    }
}

fn text(path: &Path) -> String {
    path.display().to_string()
}

// proves: DIA-08 partial: every state is asked for; clearing an error is not tried
#[test]
fn states_are_asked_for_and_errors_cleared() {
    let plant = Plant::new();
    let all = plant.json("state", &[], "states", 0);
    assert_eq!(all["devices"].as_array().unwrap().len(), 5);
    assert_eq!(all["devices"][2]["al_state"], "INIT");
    for (device, to) in [("M1", "PREOP"), ("3", "SAFEOP"), ("0x1003", "BOOT"), ("K1", "OP")] {
        let one = plant.json("state", &[device, "--to", to], "states", 0);
        assert_eq!(one["devices"][0]["al_state"], to, "{device}");
        assert_eq!(one["devices"][0]["before"], "INIT", "{device}");
    }
    // A coupler without software has no BOOT.
    let refused = plant.json("state", &["K1", "--to", "BOOT"], "error", 2);
    assert!(refused["reason"].as_str().unwrap().contains("K1 (EK1100)"), "{refused}");
    let run = plant.run("state", &["M1", "--to", "OP"]);
    assert_eq!(run.status, 2, "{}", run.all());
    assert!(run.stderr.contains("linesman run"), "{}", run.stderr);
    let run = plant.run("state", &["M1", "--to", "RUN"]);
    assert!(run.stderr.contains("SAFEOP"), "{}", run.stderr);
}

#[test]
fn an_error_of_a_state_is_told_with_its_code_and_acknowledged() {
    let faulty =
        format!("{PLANT}\n[[fault]]\nkind = \"config-mismatch\"\ndevice = \"M1\"\nfrom_ms = 0\n");
    let plant = Plant::with(&faulty);
    let refused = plant.json("state", &["M1", "--to", "SAFEOP"], "refusal", 1);
    assert_eq!(refused["kind"], "al-status", "{refused}");
    let code = refused["code"].as_u64().unwrap();
    assert!(refused["reason"].as_str().unwrap().contains(&format!("0x{code:04X}")), "{refused}");
    assert!(refused["next_step"].is_string(), "{refused}");
}

#[test]
fn objects_are_read_written_and_explained() {
    let plant = Plant::new();
    let read = plant.json("sdo", &["A1", "read", "0x1018:01"], "sdo", 0);
    assert_eq!(read["objects"][0]["value"], 2, "{read}");
    assert_eq!(read["objects"][0]["bytes"], "02 00 00 00");
    let whole = plant.json("sdo", &["M1", "read", "0x1018"], "sdo", 0);
    assert_eq!(whole["objects"].as_array().unwrap().len(), 5, "{whole}");
    assert_eq!(whole["objects"][2]["name"], "Product code");
    let complete = plant.json("sdo", &["M1", "read", "0x1018", "--complete"], "sdo", 0);
    assert!(complete["objects"][0]["bytes"].as_str().unwrap().starts_with("04 00 02 00 00 00"));
    let named = plant.json("sdo", &["A1", "read", "1008", "--type", "STRING"], "sdo", 0);
    assert_eq!(named["objects"][0]["value"], "EL3102");
    let wrote = plant.json("sdo", &["M1", "write", "0x8010:01", "1200"], "sdo", 0);
    assert_eq!(wrote["objects"][0]["bytes"], "B0 04", "{wrote}");
    let info = plant.json("sdo", &["M1", "info", "0x8010"], "objects", 0);
    let entry = &info["objects"][0]["entries"][1];
    assert_eq!(entry["name"], "Maximal current", "{info}");
    assert_eq!(entry["write"], serde_json::json!(["PREOP", "SAFEOP", "OP"]), "{info}");
    assert_eq!(entry["maximum"], "5000 (0x1388)", "{info}");
}

// proves: SW-13
#[test]
fn a_dictionary_is_browsed_with_its_flags() {
    let plant = Plant::new();
    let list = plant.json("sdo", &["M1", "list", "--entries"], "objects", 0);
    let objects = list["objects"].as_array().unwrap();
    let index = |wanted: u64| objects.iter().find(|one| one["index"] == wanted).unwrap();
    assert_eq!(index(0x1018)["kind"], "RECORD");
    let flags = &index(0x8010)["entries"][1]["flags"];
    assert!(flags.as_array().unwrap().contains(&"backup".into()), "{flags}");
    let mapped = plant.json("sdo", &["M1", "list", "--list", "rx"], "objects", 0);
    let mapped = mapped["objects"].as_array().unwrap();
    assert!(!mapped.is_empty() && mapped.len() < objects.len());
}

// proves: SW-10
#[test]
fn an_abort_is_an_answer_with_text_and_code() {
    let plant = Plant::new();
    for (rest, code, words) in [
        (&["M1", "write", "0x1018:01", "5"][..], 0x0601_0002_u64, "read only"),
        (&["A1", "read", "0x5555"], 0x0602_0000, "does not exist"),
        (&["A1", "read", "0x1018:09"], 0x0609_0011, "Subindex does not exist"),
        (&["A1", "read", "0x1018", "--complete"], 0x0601_0004, "Complete access"),
        (&["M1", "write", "0x8010:01", "65535"], 0x0609_0031, "too high"),
    ] {
        let refused = plant.json("sdo", rest, "refusal", 1);
        assert_eq!(refused["code"], code, "{refused}");
        let reason = refused["reason"].as_str().unwrap();
        assert!(reason.contains(words) && reason.contains("object 0x"), "{reason}");
    }
    // SW-09: the state machine is not touched by it.
    let run = plant.run("sdo", &["A1", "read", "0x5555"]);
    assert!(run.stderr.contains("error:") && run.stderr.contains("do:"), "{}", run.stderr);
}

#[test]
fn what_cannot_be_asked_is_refused_with_what_would_be_right() {
    let plant = Plant::new();
    for (command, rest, words) in [
        ("sdo", &["9", "read", "0x1018"][..], "none of its 5 SubDevices"),
        ("sdo", &["EL7041", "read", "0x1018"], "may be any of 3, 4"),
        ("sdo", &["alias:x", "read", "0x1018"], "an alias"),
        ("sdo", &["K1", "read", "0x1018"], "no mailbox"),
        ("sdo", &["A1", "read", "index"], "0x1018:01"),
        ("sdo", &["M1", "write", "0x8010:01", "many"], "whole number"),
        ("sdo", &["M1", "write", "0x8010:01", "70000"], "0 to 65535"),
        ("reg", &["A1", "read", "no-register"], "0x0130"),
        ("reg", &["A1", "write", "0x0010", "70000"], "does not fit"),
        ("reg", &["A1", "write", "dl-control", "0", "--len", "2"], "--force"),
        ("foe", &["C1", "write", "a.efw", "/nowhere/a.efw"], "/nowhere/a.efw"),
        ("sii", &["A1", "verify", "/nowhere/image"], "/nowhere/image"),
    ] {
        let run = plant.run(command, rest);
        assert_eq!(run.status, 2, "{command} {rest:?}: {}", run.all());
        assert!(run.stderr.contains(words), "{command} {rest:?}: {}", run.stderr);
    }
    let run = linesman(["sdo", "capture:x.pcap", "1", "read", "0x1018"]);
    assert_eq!(run.status, 2);
    assert!(run.stderr.contains("nothing can be driven there"), "{}", run.stderr);
}

#[test]
fn a_mailbox_that_is_stuck_is_told_with_object_and_step() {
    let faulty =
        format!("{PLANT}\n[[fault]]\nkind = \"mailbox-stuck\"\ndevice = \"A1\"\nfrom_ms = 0\n");
    let run = Plant::with(&faulty).run("sdo", &["A1", "read", "0x1008"]);
    assert_eq!(run.status, 2, "{}", run.all());
    assert!(run.stderr.contains("A1 (") && run.stderr.contains("0x1008"), "{}", run.stderr);
}

#[test]
fn registers_are_read_with_their_meaning() {
    let plant = Plant::new();
    let read = plant.json("reg", &["A1", "read", "al-status"], "registers", 0);
    assert_eq!(read["registers"][0]["meaning"], "INIT", "{read}");
    let many = plant.json("reg", &["A1", "read", "0x0000", "--len", "8"], "registers", 0);
    assert_eq!(many["registers"][0]["name"], "ESC type", "{many}");
    let wrote = plant.json("reg", &["A1", "write", "0x0F80", "01 02 03 04"], "registers", 0);
    assert_eq!(wrote["bytes"], "01 02 03 04");
}

// S3 L81: what nobody took is sent again, and its fate is told; so is what was lost on the way.
// proves: FRM-21
#[test]
fn acyclic_datagrams_are_sent_again_and_their_fate_is_told() {
    let plant = Plant::new();
    // Nobody can write there: the working counter stays 0, however often it is sent.
    let write = ["A1", "write", "al-status", "1", "--force"];
    let refused = plant.json("reg", &write, "error", 2);
    let reason = refused["reason"].as_str().unwrap();
    assert!(reason.contains("A1 (EL3102): FPWR 0x1002:0x0130, 2 bytes"), "{reason}");
    assert!(reason.contains("working counter 0, expected 1, sent 4 times"), "{reason}");
    // Every frame is lost for a while now and then: all that is asked is answered all the same.
    let whole = plant.json("sii", &["M1", "read", "--whole"], "sii", 0);
    let drops = "[[fault]]\nkind = \"host-drops\"\nfrom_ms = 0\nto_ms = 2000\nhits = 66\n";
    let lossy = Plant::with(&format!("{PLANT}{drops}"));
    let same = lossy.json("sii", &["M1", "read", "--whole"], "sii", 0);
    assert_eq!(same["image"], whole["image"]);
    let on = format!("sim:{}", lossy.path("plant.toml").display());
    let run = linesman(["run", "--on", &on, "--seconds", "2", "--no-diagnosis", "--json"]).json();
    assert!(run["counts"]["repeats"].as_u64().unwrap() >= 1, "{}", run["counts"]);
    assert!(!run["reached_ns"].is_null(), "every start-up request was carried out: {run}");
}

// proves: SW-11, SW-14 partial: files both ways, every error named; in BOOT no firmware is taken
#[test]
fn files_go_to_and_from_a_subdevice_and_errors_say_why() {
    let plant = Plant::new();
    let (log, firmware) = (plant.path("log"), plant.path("x.efw"));
    std::fs::write(&firmware, vec![7; 3_000]).unwrap();
    let refused = |rest: &[&str]| plant.json("foe", rest, "refusal", 1)["code"].as_u64().unwrap();
    // Name, not in BOOT, password.
    assert_eq!(refused(&["C1", "read", "nothing.bin", &text(&log)]), 0x8001);
    assert_eq!(refused(&["C1", "write", "x.efw", &text(&firmware)]), 0x8008);
    assert_eq!(refused(&["C1", "write", "x.efw", &text(&firmware), "--boot"]), 0x800B);
    assert_eq!(refused(&["C1", "read", "settings.txt", &text(&log), "--boot"]), 0x8009);
    assert_eq!(refused(&["C1", "read", "service.bin", &text(&log)]), 0x800A);
    let long = plant.path("long");
    std::fs::write(&long, vec![7; 5_000]).unwrap();
    assert_eq!(refused(&["C1", "write", "settings.txt", &text(&long)]), 0x8003);
    assert!(!log.exists());
    let read = ["C1", "read", "service.bin", &text(&log), "--password", "0x4711"];
    assert_eq!(plant.json("foe", &read, "file", 0)["size"], 32);
    assert_eq!(std::fs::read(&log).unwrap(), [0; 32]);
    let wrote = plant.json("foe", &["C1", "write", "settings.txt", &text(&log)], "file", 0);
    assert_eq!(wrote["size"], 32, "{wrote}");
    let again = plant.run("foe", &read);
    assert_eq!(again.status, 2, "no local file is overwritten: {}", again.all());
}

#[test]
fn subdevice_is_asked_by_ads_and_given_a_net_id() {
    let plant = Plant::with(&PLANT.replace("EL6601", "EL6692"));
    let info = plant.json("aoe", &["C1", "info"], "ads", 0);
    assert_eq!(info["info"]["name"], "EL6692", "{info}");
    assert_eq!(plant.json("aoe", &["C1", "state"], "ads", 0)["state"], serde_json::json!([5, 2]));
    let read = plant.run("aoe", &["C1", "read", "0xF302", "0x10180001"]);
    assert!(read.stdout.contains("C1 (EL6692): 02 00 00 00"), "{}", read.all());
    let both = ["C1", "read-write", "0xF302", "0x10F10002", "05 00", "2"];
    assert_eq!(plant.json("aoe", &both, "ads", 0)["data"], "0500");
    let written = plant.run("aoe", &["C1", "set-net-id", "10.0.0.1.3.1"]);
    assert!(written.stdout.contains("C1 (EL6692): written"), "{}", written.all());
    let refused = plant.json("aoe", &["C1", "read", "0xF302", "0x55550000"], "refusal", 1);
    assert_eq!((&refused["kind"], &refused["code"]), (&"ads-error".into(), &0x70C.into()));
    let reason = refused["reason"].as_str().unwrap();
    assert!(reason.contains("C1 (EL6692)") && reason.contains("0x70C not found"), "{reason}");
    // What speaks no ADS, and what is no row of bytes.
    assert_eq!(plant.json("aoe", &["A1", "info"], "refusal", 1)["kind"], "mailbox-error");
    for nothing in ["0x", "", " "] {
        let none = plant.run("aoe", &["C1", "write", "0xF302", "0x10F10002", nothing]);
        assert_eq!(none.status, 2, "{nothing:?}: {}", none.all());
        assert!(
            none.stderr.contains("is no row of bytes: expected one at least"),
            "{}",
            none.stderr
        );
    }
    let wrong = plant.run("aoe", &["C1", "write", "0xF302", "0x10F10002", "5"]);
    assert_eq!(wrong.status, 2, "{}", wrong.all());
}

// proves: SW-08 partial: one message, not the five of the source
#[test]
fn a_history_is_read_with_texts_exported_and_acknowledged() {
    let plant = Plant::new();
    let esi = plant.path("texts.xml");
    std::fs::write(
        &esi,
        r##"<?xml version="1.0"?><EtherCATInfo><Vendor><Id>2</Id></Vendor><Descriptions><Devices>
        <Device><Type ProductCode="#x1B813052" RevisionNo="#x001A0000">EL7041</Type>
        <Name LcId="1033">Stepper</Name><Profile><DiagMessages>
        <DiagMessage><TextId>#x0002</TextId>
        <MessageText LcId="1031">Gestartet</MessageText><MessageText LcId="1033">Communication established</MessageText>
        </DiagMessage></DiagMessages></Profile></Device></Devices></Descriptions></EtherCATInfo>"##,
    )
    .unwrap();
    let export = plant.path("history.csv");
    let rest =
        ["M1", "--esi", &text(&esi), "--acknowledge", "--only-new", "--export", &text(&export)];
    let history = plant.json("history", &rest, "history", 0);
    let message = &history["messages"][0];
    assert_eq!(message["text"], "Communication established", "{history}");
    assert_eq!(message["severity"], "information");
    assert_eq!(message["new"], true);
    assert_eq!(history["acknowledged"], 6);
    let csv = std::fs::read_to_string(&export).unwrap();
    assert_eq!(csv.lines().count(), 2, "{csv}");
    assert!(csv.lines().next().unwrap().starts_with("subindex,new,severity"), "{csv}");
    let none = plant.run("history", &["K1"]);
    assert_eq!(none.status, 2, "{}", none.all());
}

#[test]
fn an_eeprom_is_read_compared_written_and_its_alias_set() {
    let plant = Plant::new();
    let (image, backup) = (plant.path("m1.bin"), plant.path("backup.bin"));
    let read = plant.json("sii", &["M1", "read", "--whole", "--save", &text(&image)], "sii", 0);
    assert_eq!(read["image"]["product_code"], 0x1B81_3052, "{read}");
    assert_eq!(read["len"], read["size"], "{read}");
    let same = plant.json("sii", &["M1", "verify", &text(&image)], "sii", 0);
    assert_eq!(same["different_words"], 0, "{same}");
    // Another serial number, word 14.
    let mut bytes = std::fs::read(&image).unwrap();
    bytes[28] = 99;
    let changed = plant.path("changed.bin");
    std::fs::write(&changed, &bytes).unwrap();
    let differs = plant.json("sii", &["M1", "verify", &text(&changed)], "sii", 1);
    assert_eq!(differs["differences"][0]["word"], 14, "{differs}");
    let rest = ["M1", "write", &text(&changed), "--backup", &text(&backup)];
    let wrote = plant.json("sii", &rest, "sii", 0);
    assert_eq!(wrote["words_written"], 1, "{wrote}");
    assert!(std::fs::read(&image).unwrap().starts_with(&std::fs::read(&backup).unwrap()));
    let again = plant.run("sii", &rest);
    assert_eq!(again.status, 2, "the backup is not overwritten: {}", again.all());
    // The image of another device is refused.
    let other = plant.run("sii", &["A1", "write", &text(&image)]);
    assert_eq!(other.status, 2, "{}", other.all());
    assert!(other.stderr.contains("--force"), "{}", other.stderr);
    let second = plant.path("second.bin");
    let alias = plant.json("sii", &["M1", "alias", "7", "--backup", &text(&second)], "sii", 0);
    assert_eq!(alias["words_written"], 2, "{alias}");
    assert_eq!(alias["image"]["alias"], 7);
    assert_eq!(alias["image"]["checksum"], "valid");
}

// proves: ESC-15
#[test]
fn registers_are_dumped_word_by_word() {
    let plant = Plant::new();
    let run = plant.run("reg", &["A1", "dump", "--from", "0x0100", "--len", "64"]);
    assert_eq!(run.status, 0, "{}", run.all());
    let row = run.stdout.lines().find(|line| line.starts_with("0110")).unwrap();
    // Ports A and B with link, open, communicating.
    for cell in ["0x5A3", "23", "DL status"] {
        assert!(row.contains(cell), "`{cell}` is missing in `{row}`");
    }
    let json =
        plant.run("reg", &["A1", "dump", "--from", "0x0100", "--len", "64", "--json"]).json();
    assert_valid(&json, "registers");
    let words = json["words"].as_array().unwrap();
    assert_eq!((words.len(), words[0]["address"].as_u64()), (32, Some(0x0100)));
}

// proves: SYN-21
#[test]
fn entries_of_the_synchronisation_objects_are_read_and_explained_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let plant = folder.path().join("plant.toml");
    let text = "name = \"sync\"\n[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
                [[device]]\nname = \"O1\"\ntype = \"EL4102\"\non = \"K1.B\"\n";
    std::fs::write(&plant, text).unwrap();
    let on = format!("sim:{}", plant.display());
    let read = linesman(["sdo", &on, "O1", "read", "0x1C32"]);
    assert_eq!(read.status, 0, "{}", read.all());
    for words in ["in step with its own frames", "0 (0x00000000): 0 ns", "with SYNC0"] {
        assert!(read.stdout.contains(words), "{words}: {}", read.stdout);
    }
    for (entry, value, words) in [
        ("0x1C32:02", "0x00989680", "10 ms"),
        ("0x1C33:05", "0x000249F0", "150 µs"),
        ("0x1C32:01", "2", "in step with SYNC0"),
    ] {
        let told = linesman(["explain", entry, value]);
        assert_eq!(told.status, 0, "{}", told.all());
        assert!(told.stdout.contains(&format!("It says: {words}.")), "{}", told.stdout);
    }
}
