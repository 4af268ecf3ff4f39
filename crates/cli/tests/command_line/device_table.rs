//! The SubDevices of an input: who they are, in text, JSON and page.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

use crate::support::{PROGRAM, assert_valid, linesman, run};
use serde_json::{Value, json};
use tempfile::TempDir;

const PLANT: &str = "seed = 7\nname = \"press\"\n\
[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
[[device]]\nname = \"T1\"\ntype = \"EL1008\"\non = \"K1.B\"\n\
[[device]]\nname = \"T2\"\ntype = \"EL2004\"\non = \"T1.B\"\n\
[[fault]]\nkind = \"device-off\"\ndevice = \"T2\"\nfrom_ms = 3500\n";

/// A recording of the plant from its start, and the plant.
fn recorded(folder: &Path) -> (String, String) {
    let (file, record) = (folder.join("plant.toml"), folder.join("trace.pcapng"));
    fs::write(&file, PLANT).unwrap();
    let place = format!("sim:{}", file.display());
    let ran = linesman(["diagnose", &place, "--record", record.to_str().unwrap()]);
    assert_eq!(ran.status, 1, "{}", ran.all());
    (record.to_str().unwrap().to_owned(), place)
}

#[test]
fn recording_names_its_subdevices_without_a_project() {
    let folder = TempDir::new().unwrap();
    let (record, _) = recorded(folder.path());
    let ran = linesman(["diagnose", &record, "--json"]);
    let diagnosis = ran.json();
    assert_valid(&diagnosis, "diagnosis");
    let devices = diagnosis["devices"].as_array().unwrap();
    let types: Vec<&Value> = devices.iter().map(|device| &device["type"]).collect();
    assert_eq!(types, ["EK1100", "EL1008", "EL2004"]);
    for (device, product) in devices.iter().zip([0x044C_2C52, 0x03F0_3052, 0x07D4_3052]) {
        assert_eq!(device["name"], Value::Null, "{device}");
        assert_eq!(device["vendor_id"], 2, "{device}");
        assert_eq!(device["product_code"], product, "{device}");
        assert!(device["revision"].as_u64().unwrap() > 0, "{device}");
        assert_eq!(device["station"], 0x1000 + device["no"].as_u64().unwrap(), "{device}");
    }
    let stands = |index: usize| json!([devices[index]["state"], devices[index]["answers"]]);
    assert_eq!(stands(0), json!(["OP", true]));
    assert_eq!(stands(2)[1], false, "{}", devices[2]);

    let text = linesman(["diagnose", &record]).stdout;
    let (findings, table) = text.split_once("\nno  name").unwrap();
    let rows: Vec<Vec<&str>> =
        table.lines().skip(1).map(|row| row.split_whitespace().collect()).collect();
    assert_eq!(rows.len(), 3, "{text}");
    assert_eq!(rows[0][..5], ["1", "EK1100", "0x1001", "0x2", "0x044C2C52"]);
    assert_eq!(rows[0].last(), Some(&"OP"));
    assert!(table.lines().nth(3).unwrap().ends_with("no answer"), "{table}");
    assert!(findings.contains("SubDevice 3 (EL2004)"), "{findings}");
    // Whoever has a recording only can neither scan nor name a project.
    assert!(!text.contains("--project machine.toml") && !text.contains("scan WHERE"), "{text}");
    assert!(text.contains("linesman explain"), "{text}");
}

#[test]
fn table_fits_in_sixty_columns() {
    let folder = TempDir::new().unwrap();
    let (record, _) = recorded(folder.path());
    // Where no terminal says its width, COLUMNS does.
    let output =
        Command::new(PROGRAM).args(["diagnose", &record]).env("COLUMNS", "60").output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let (_, table) = text.split_once("\nno  name").unwrap();
    for line in table.lines() {
        assert!(line.chars().count() <= 60, "{line}");
    }
    for word in ["EL1008", "0x1002", "0x2", "0x03F03052", "OP"] {
        assert!(table.contains(word), "{word}: {table}");
    }
}

#[test]
fn devices_are_listed_when_asked_for_where_a_project_names_them() {
    let folder = TempDir::new().unwrap();
    let (_, place) = recorded(folder.path());
    let without = linesman(["diagnose", &place]).stdout;
    assert!(!without.contains("\nno  name"), "{without}");
    let with = linesman(["diagnose", &place, "--devices"]).stdout;
    let (before, table) = with.split_once("\nno  name").unwrap();
    assert_eq!(before, without.trim_end_matches('\n').to_owned() + "\n");
    assert!(table.contains("2   T1 (EL1008)"), "{table}");
    let several = linesman(["diagnose", "a.pcap", "b.pcap", "--devices"]);
    assert_eq!(several.status, 2, "{}", several.all());
    assert!(several.stderr.contains("leave out `--devices`"), "{}", several.stderr);
}

#[test]
fn page_has_the_identities_in_its_table() {
    let folder = TempDir::new().unwrap();
    let (record, _) = recorded(folder.path());
    let html = folder.path().join("report.html");
    let _ = run(Command::new(PROGRAM).args(["diagnose", &record, "--html"]).arg(&html));
    let page = fs::read_to_string(&html).unwrap();
    let (_, table) = page.split_once("<table class=\"devices\">").unwrap();
    let (table, _) = table.split_once("</table>").unwrap();
    for heading in ["vendor", "product", "revision", "serial", "chip", "state"] {
        assert!(table.contains(&format!("<th>{heading}</th>")), "{heading}");
    }
    for cell in ["EL2004", "0x1001", "0x2", "0x044C2C52", "no answer", "OP"] {
        assert!(table.contains(&format!(">{cell}</td>")), "{cell}: {table}");
    }
}

/// The directory of the captures; `None`, said aloud, where they are not.
fn captures() -> Option<PathBuf> {
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

// Types as the README of the captures has them; other MainDevices, which read no more of an SII than
// they need.
#[test]
fn real_captures_name_their_subdevices() {
    let Some(directory) = captures() else { return };
    let rows: [(&str, &[(&str, u32)]); 3] = [
        (
            "ec-replay-ek1100-el2828-el2889",
            &[("EK1100", 0x044C_2C52), ("EL2828", 0x0B0C_3052), ("EL2889", 0x0B49_3052)],
        ),
        ("ec-soem-sdinfo-ek1100-el1004", &[("EK1100", 0x044C_2C52), ("EL1004", 0x03EC_3052)]),
        ("ec-replay-ek1914-el3004-mailbox", &[("EK1914", 0x077A_2C52), ("EL3004", 0x0BBC_3052)]),
    ];
    for (name, expected) in rows {
        let file = directory.join(format!("{name}.pcapng"));
        let ran = linesman(["diagnose".as_ref(), file.as_os_str(), "--json".as_ref()]);
        let diagnosis = ran.json();
        let devices = diagnosis["devices"].as_array().unwrap();
        assert_eq!(devices.len(), expected.len(), "{name}");
        for (device, (kind, product)) in devices.iter().zip(expected) {
            assert_eq!(device["type"], *kind, "{name}: {device}");
            assert_eq!(device["product_code"], *product, "{name}: {device}");
            assert_eq!(device["vendor_id"], 2, "{name}: {device}");
        }
    }
}

#[test]
fn page_without_wiring_says_that_there_is_no_drawing() {
    let Some(directory) = captures() else { return };
    let folder = TempDir::new().unwrap();
    for (name, has_drawing) in
        [("ec-rs-detect-slaves-ek1100-el1004", false), ("ec-replay-ek1100-el2828-el2889", true)]
    {
        let (file, html) = (directory.join(format!("{name}.pcapng")), folder.path().join(name));
        let ran = run(Command::new(PROGRAM).arg("diagnose").arg(file).arg("--html").arg(&html));
        let page =
            fs::read_to_string(&html).unwrap_or_else(|error| panic!("{error}: {}", ran.all()));
        assert_eq!(page.contains("class=\"line\""), has_drawing, "{name}");
        assert_eq!(page.contains("No drawing: how the line is wired was not seen."), !has_drawing);
    }
}
