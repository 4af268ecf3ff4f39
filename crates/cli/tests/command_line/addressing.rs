//! Addressing, identity checks and repetition of SubDevices: by choice of the project, else as
//! their makers say.

use std::fs;
use std::path::{Path, PathBuf};

use crate::support::{Run, linesman};
use serde_json::Value;
use tempfile::TempDir;

/// A coupler and these terminals in a row: name, type, more lines.
fn line(terminals: &[(&str, &str, &str)]) -> String {
    let mut text = "[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n".to_owned();
    let mut before = "K1";
    for (name, kind, more) in terminals {
        text.push_str(&format!(
            "[[device]]\nname = \"{name}\"\ntype = \"{kind}\"\non = \"{before}.B\"\n{more}\n"
        ));
        before = name;
    }
    text
}

fn write(folder: &TempDir, name: &str, text: &str) -> PathBuf {
    let path = folder.path().join(name);
    fs::write(&path, text).unwrap();
    path
}

/// The project that a scan of a segment saves.
fn saved(folder: &TempDir, segment: &Path) -> String {
    let project = folder.path().join("saved.toml");
    let on = format!("sim:{}", segment.display());
    let run = linesman(["scan", &on, "--save", project.to_str().unwrap()]);
    assert_eq!(run.status, 0, "{}", run.all());
    fs::read_to_string(project).unwrap()
}

fn drive(project: &Path, segment: &Path, more: &[&str]) -> Run {
    let on = format!("sim:{}", segment.display());
    let words = ["run", project.to_str().unwrap(), "--on", &on, "--seconds", "2", "--no-diagnosis"];
    linesman(words.iter().chain(more))
}

fn valid(report: &Value) -> Vec<bool> {
    let devices = report["devices"].as_array().unwrap();
    devices.iter().map(|device| device["valid"] == true).collect()
}

const AS_BUILT: [(&str, &str, &str); 3] =
    [("T1", "EL1008", "alias = 11"), ("T2", "EL2008", ""), ("T3", "EL1008", "alias = 13")];

// S0 L1433, L1457: "no auto-inc, use second address".
// proves: FRM-28 partial: by the second address
#[test]
fn a_device_that_is_plugged_in_elsewhere_is_found_by_its_alias() {
    let folder = TempDir::new().unwrap();
    let segment = write(&folder, "built.toml", &line(&AS_BUILT));
    let plain = saved(&folder, &segment);
    let by_alias = |alias: u16| format!("alias = {alias}\naddressing = \"alias\"");
    let text = plain.replace("alias = 11", &by_alias(11)).replace("alias = 13", &by_alias(13));
    let project = write(&folder, "project.toml", &text);
    // All other ways round, the coupler apart.
    let moved = [AS_BUILT[2], AS_BUILT[0], AS_BUILT[1]];
    let moved = write(&folder, "moved.toml", &line(&moved));
    for segment in [&segment, &moved] {
        let run = drive(&project, segment, &["--json"]);
        let report = run.json();
        assert_eq!(valid(&report), [true; 4], "{}", run.all());
        assert!(!report["reached_ns"].is_null(), "{report}");
    }
    // Without the choice the place counts.
    let project = write(&folder, "plain.toml", &plain);
    let run = drive(&project, &moved, &[]);
    assert_eq!(run.status, 2, "{}", run.all());
    assert!(run.all().contains("place 3: expected SubDevice 3 (EL2008)"), "{}", run.all());
    // The way through a network configuration of another tool is the same.
    let eni = folder.path().join("line.xml");
    let project = folder.path().join("project.toml");
    let words = ["plan", project.to_str().unwrap(), "--export", eni.to_str().unwrap()];
    let made = linesman(words);
    assert!(made.status <= 1, "{}", made.all());
    let xml = fs::read_to_string(&eni).unwrap();
    let bare: String = xml.split_whitespace().collect();
    assert!(
        bare.contains("<Cmd>5</Cmd><Adp>11</Adp><Ado>16</Ado>"),
        "FPWR of the station address: {xml}"
    );
    let run = drive(&eni, &moved, &["--json"]);
    assert_eq!(valid(&run.json()), [true; 4], "{}", run.all());
}

#[test]
fn an_alias_that_two_have_is_refused_and_told() {
    let folder = TempDir::new().unwrap();
    let segment = write(&folder, "built.toml", &line(&AS_BUILT));
    let plain = saved(&folder, &segment);
    let text = plain.replace("alias = 11", "alias = 11\naddressing = \"alias\"");
    let project = write(&folder, "project.toml", &text);
    let twice = [AS_BUILT[0], AS_BUILT[1], ("T3", "EL1008", "alias = 11")];
    let twice = write(&folder, "twice.toml", &line(&twice));
    let run = drive(&project, &twice, &[]);
    assert!(run.all().contains("2 SubDevices answer to its alias 11"), "{}", run.all());
    assert!(run.all().contains("linesman sii WHERE DEVICE alias N"), "{}", run.all());
    let table = [
        ("alias = 11", "addressing = \"alias\"", "expected `alias`, 1 to 65535"),
        (
            "alias = 11",
            "alias = 0x1003\naddressing = \"alias\"",
            "is an address of `SubDevice 3 (EL2008)` too",
        ),
        ("alias = 11", "alias = 11\naddressing = \"allias\"", "allias"),
    ];
    for (from, to, expected) in table {
        let project = write(&folder, "wrong.toml", &plain.replace(from, to));
        let run = drive(&project, &segment, &[]);
        assert_eq!(run.status, 2, "{to}: {}", run.all());
        assert!(run.stderr.contains(expected), "{to}: {}", run.stderr);
    }
}

// S0 L1434, L1458: "auto-inc only".
// proves: FRM-28
#[test]
fn a_device_that_is_addressed_by_its_position_only_runs_without_a_station_address() {
    let folder = TempDir::new().unwrap();
    let segment = write(&folder, "built.toml", &line(&AS_BUILT));
    let text = saved(&folder, &segment).replace("alias = 13", "addressing = \"position\"");
    let project = write(&folder, "project.toml", &text);
    let run = drive(&project, &segment, &["--json"]);
    assert_eq!(valid(&run.json()), [true; 4], "{}", run.all());
    let eni = folder.path().join("line.xml");
    let words = ["plan", project.to_str().unwrap(), "--export", eni.to_str().unwrap()];
    assert!(linesman(words).status <= 1);
    let run = drive(&eni, &segment, &["--json"]);
    assert_eq!(valid(&run.json()), [true; 4], "{}", run.all());
}

/// A description of a device with eight inputs, with more in its elements.
fn description(type_more: &str, more: &str) -> String {
    format!(
        "<EtherCATInfo><Vendor><Id>2</Id><Name>x</Name></Vendor><Descriptions><Devices>\
         <Device Physics=\"KK\"><Type ProductCode=\"#x03f03052\" RevisionNo=\"#x00120000\" {type_more}>EL1008</Type>\
         <Name>EL1008</Name>{more}<Fmmu>Inputs</Fmmu>\
         <Sm StartAddress=\"#x1000\" ControlByte=\"#x00\" Enable=\"1\" DefaultSize=\"1\">Inputs</Sm>\
         <TxPdo Sm=\"0\" Fixed=\"1\"><Index>#x1a00</Index><Name>Channel 1</Name><Entry><Index>#x6000</Index>\
         <SubIndex>1</SubIndex><BitLen>8</BitLen><Name>Input</Name><DataType>USINT</DataType></Entry></TxPdo>\
         <Eeprom><ByteSize>256</ByteSize><ConfigData>040c010000000000</ConfigData></Eeprom></Device>\
         </Devices></Descriptions></EtherCATInfo>"
    )
}

/// The plan of a line of one such device.
fn plan(type_more: &str, more: &str, wanted: &str) -> Value {
    let folder = TempDir::new().unwrap();
    write(&folder, "one.xml", &description(type_more, more));
    let project = format!(
        "esi = [\"one.xml\"]\n[[task]]\nname = \"fast\"\ncycle_us = 1000\nrepeats = 1\n\
         [[device]]\nname = \"In\"\ntype = \"EL1008\"\non = \"maindevice\"\n{wanted}\n"
    );
    let project = write(&folder, "project.toml", &project);
    let run = linesman(["plan", project.to_str().unwrap(), "--json"]);
    assert!(run.status <= 1, "{}", run.all());
    run.json()
}

#[test]
fn frames_are_repeated_where_the_maker_allows_it_unless_the_project_says_otherwise() {
    let repeats = |more: &str, wanted: &str| {
        plan("", more, wanted)["tasks"][0]["frames"][0]["copies"].as_u64().unwrap() - 1
    };
    let allowed = "<Su FrameRepeatSupport=\"1\">Inputs</Su>";
    assert_eq!(repeats(allowed, ""), 1);
    assert_eq!(repeats("<Su>Inputs</Su>", ""), 0);
    assert_eq!(repeats("", ""), 0);
    assert_eq!(repeats(&format!("{allowed}<Su>Others</Su>"), ""), 0, "all of its sync units");
    assert_eq!(repeats(allowed, "frame_repeat = false"), 0);
    assert_eq!(repeats("", "frame_repeat = true"), 1);
}

// ETG.2000, CheckRevisionNo; S0 L1584.
// proves: HC-03 partial: the rule of the maker
#[test]
fn revisions_are_compared_as_the_maker_wants_unless_the_project_says_otherwise() {
    let folder = TempDir::new().unwrap();
    // The segment's device has revision 0x00120000.
    let segment = write(&folder, "line.toml", &line(&[("In", "EL1008", "")]));
    let runs = |type_more: &str, wanted: &str| {
        write(&folder, "one.xml", &description(type_more, ""));
        let project = format!(
            "esi = [\"one.xml\"]\n[[device]]\nname = \"K1\"\non = \"maindevice\"\n[device.description]\n\
             [[device]]\nname = \"In\"\ntype = \"EL1008\"\non = \"K1.B\"\n\
             vendor_id = 2\nproduct_code = 0x03F03052\n{wanted}\n"
        );
        let project = write(&folder, "project.toml", &project);
        let run = drive(&project, &segment, &["--json"]);
        !run.json()["reached_ns"].is_null()
    };
    assert!(!runs("", "revision = 0x00110000"), "equal unless said");
    assert!(runs("CheckRevisionNo=\"EQ_OR_G\"", "revision = 0x00110000"));
    assert!(!runs("CheckRevisionNo=\"EQ_OR_G\"", "revision = 0x00130000"));
    assert!(runs("CheckRevisionNo=\"LW_EQ\"", "revision = 0x00130000"));
    assert!(!runs("CheckRevisionNo=\"LW_EQ\"", "revision = 0x00130000\nrevision_rule = \"equal\""));
    assert!(runs("", ""), "any where the project gives none");
}
