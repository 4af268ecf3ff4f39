//! Segments whose devices come from files, through the command line.

use std::fs;

use crate::support::{Run, assert_valid, linesman};
use tempfile::TempDir;

/// A lamp on the E-bus with two revisions, and a pump with two kinds of modules.
const MAKER: &str = r##"<?xml version="1.0" encoding="ISO-8859-1"?>
<EtherCATInfo><Vendor><Id>#xE0000815</Id><Name>Maker</Name></Vendor><Descriptions>
<Groups><Group><Type>L</Type><Name>Lamps</Name></Group></Groups><Devices>
<Device Physics="KK"><Type ProductCode="#x77" RevisionNo="#x10000">LAMP-4</Type><Name>Lamp, old</Name><GroupType>L</GroupType>
 <Fmmu>Outputs</Fmmu><Sm StartAddress="#xf00" ControlByte="#x44" Enable="1" DefaultSize="1">Outputs</Sm>
 <RxPdo Fixed="1" Sm="0"><Index>#x1600</Index><Name>Channel 1</Name>
 <Entry><Index>#x7000</Index><SubIndex>1</SubIndex><BitLen>1</BitLen><Name>Out</Name><DataType>BOOL</DataType></Entry></RxPdo>
 <Eeprom><ByteSize>1024</ByteSize><ConfigData>0401000000000100</ConfigData></Eeprom></Device>
<Device Physics="KK"><Type ProductCode="#x77" RevisionNo="#x20000">LAMP-4</Type><HideType RevisionNo="#x10000"/><Name>Lamp</Name><GroupType>L</GroupType>
 <Fmmu>Outputs</Fmmu><Sm StartAddress="#xf00" ControlByte="#x44" Enable="1" DefaultSize="1">Outputs</Sm>
 <RxPdo Fixed="1" Sm="0"><Index>#x1600</Index><Name>Channel 1</Name>
 <Entry><Index>#x7000</Index><SubIndex>1</SubIndex><BitLen>1</BitLen><Name>Out</Name><DataType>BOOL</DataType></Entry></RxPdo>
 <Eeprom><ByteSize>1024</ByteSize><ConfigData>0401000000000100</ConfigData></Eeprom></Device>
<Device Physics="YY"><Type ProductCode="#x99" RevisionNo="1">PUMP</Type><Name>Pump</Name><GroupType>L</GroupType>
 <Fmmu>Outputs</Fmmu><Fmmu>Inputs</Fmmu>
 <Sm DefaultSize="128" StartAddress="#x1000" ControlByte="#x26" Enable="1">MBoxOut</Sm>
 <Sm DefaultSize="128" StartAddress="#x1080" ControlByte="#x22" Enable="1">MBoxIn</Sm>
 <Sm StartAddress="#x1100" ControlByte="#x64" Enable="1">Outputs</Sm>
 <Sm StartAddress="#x1180" ControlByte="#x20" Enable="1">Inputs</Sm>
 <Mailbox><CoE SdoInfo="1" PdoAssign="1"/></Mailbox><Eeprom><ByteSize>2048</ByteSize><ConfigData>0500</ConfigData></Eeprom>
 <Slots SlotPdoIncrement="16" SlotIndexIncrement="#x800"><Slot MinInstances="1" MaxInstances="2"><Name>Axis</Name>
 <ModuleIdent Default="1">#x10</ModuleIdent><ModuleIdent>#x20</ModuleIdent></Slot></Slots></Device>
<Device Physics="KK"><Type>END-CAP</Type><Name>Cap</Name></Device>
</Devices><Modules>
<Module><Type ModuleIdent="#x10">Slow</Type><Name>Slow axis</Name><TxPdo Sm="3"><Index DependOnSlot="1">#x1A00</Index><Name>Slow</Name>
 <Entry><Index DependOnSlot="1">#x6000</Index><SubIndex>1</SubIndex><BitLen>16</BitLen><Name>Speed</Name><DataType>INT</DataType></Entry></TxPdo></Module>
<Module><Type ModuleIdent="#x20">Fast</Type><Name>Fast axis</Name><TxPdo Sm="3"><Index DependOnSlot="1">#x1A00</Index><Name>Fast</Name>
 <Entry><Index DependOnSlot="1">#x6000</Index><SubIndex>1</SubIndex><BitLen>32</BitLen><Name>Speed</Name><DataType>DINT</DataType></Entry></TxPdo></Module>
</Modules></Descriptions></EtherCATInfo>"##;

/// Runs a command on a coupler with a lamp, and a pump; both types are given.
fn with_types(command: &str, lamp: &str, pump: &str, more: &[&str]) -> Run {
    let directory = TempDir::new().expect("a temporary directory");
    fs::create_dir(directory.path().join("esi")).expect("a folder");
    fs::write(directory.path().join("esi/maker.xml"), MAKER).expect("a file can be written");
    fs::write(directory.path().join("blank.bin"), [0xFF; 256]).expect("a file can be written");
    let text = format!(
        "name = \"files\"\n[[device]]\nname = \"K\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
         [[device]]\nname = \"L\"\ntype = \"{lamp}\"\non = \"K.B\"\n\
         [[device]]\nname = \"P\"\ntype = \"{pump}\non = \"K.C\"\n"
    );
    let path = directory.path().join("plant.toml");
    fs::write(&path, text).expect("a file can be written");
    let place = format!("sim:{}", path.display());
    linesman([command, &place].into_iter().chain(more.iter().copied()))
}

const LAMP: &str = "esi:esi/maker.xml#LAMP-4";
const PUMP: &str = "esi:esi/maker.xml#0x00000099\"";

#[test]
fn devices_of_a_maker_are_scanned_and_go_to_op() {
    let scan = with_types("scan", LAMP, PUMP, &["--json"]).json();
    assert_valid(&scan, "scan");
    let devices = scan["devices"].as_array().expect("a list");
    let told: Vec<_> = devices.iter().map(|one| (&one["type"], &one["revision"])).collect();
    assert_eq!(told.len(), 3);
    assert_eq!((told[1].0.as_str(), told[1].1.as_u64()), (Some("LAMP-4"), Some(0x20000)));
    assert_eq!((told[2].0.as_str(), told[2].1.as_u64()), (Some("PUMP"), Some(1)));
    let run = with_types("diagnose", LAMP, PUMP, &["--seconds", "2"]);
    assert_eq!(run.status, 0, "{}", run.all());
}

#[test]
fn a_revision_and_modules_can_be_chosen() {
    let old = format!("{LAMP}@0x00010000");
    let pump = format!("{PUMP}\nslots = [\"Fast\", \"0x10\"]");
    let run = with_types("scan", &old, &pump, &["--json"]);
    assert_eq!(run.json()["devices"][1]["revision"].as_u64(), Some(0x10000), "{}", run.all());
    let run = with_types("diagnose", &old, &pump, &["--seconds", "1"]);
    assert_eq!(run.status, 0, "{}", run.all());
}

#[test]
fn what_is_wrong_is_told_with_file_and_reason() {
    let no_cap = "esi:esi/maker.xml#END-CAP";
    let slots = format!("{PUMP}\nslots = [\"Turbo\"]");
    for (lamp, pump, expected) in [
        ("esi:esi/maker.xml#LAMP-5", PUMP, "it has no device \"LAMP-5\"; it has LAMP-4 and 2 more"),
        ("esi:esi/maker.xml#LAMP-4@3", PUMP, "it has no revision 0x00000003 of \"LAMP-4\""),
        ("esi:maker.xml#LAMP-4", PUMP, "maker.xml: No such file"),
        (no_cap, PUMP, "END-CAP: it has neither EEPROM nor SyncManagers"),
        ("sii:blank.bin", PUMP, "SII image is blank"),
        ("esi:blank.bin#X", PUMP, "`blank.bin`: "),
        ("EL9999", PUMP, "a type from a file is written `esi:FILE#TYPE` or `sii:FILE`"),
        (LAMP, &slots, "slot 1: no module \"Turbo\" fits there; what fits: \"Slow\" (0x10)"),
    ] {
        let run = with_types("scan", lamp, pump, &[]);
        assert_eq!(run.status, 2, "{lamp}: {}", run.all());
        assert!(run.stderr.contains(expected), "{lamp}: {}", run.stderr);
        assert!(run.stderr.contains("plant.toml"), "{lamp}: {}", run.stderr);
    }
}

// A terminal takes frames in by port 0 and passes them on by 1, a junction by 3 as well; who has but one port ends
// the line.
// proves: JCT-09
#[test]
fn a_device_with_a_single_port_ends_the_line() {
    let directory = TempDir::new().expect("a temporary directory");
    // The lamp with an entry and no exit.
    let maker = MAKER.replace("Physics=\"KK\"", "Physics=\"K\"");
    fs::write(directory.path().join("maker.xml"), maker).expect("a file can be written");
    let device = |name: &str, kind: &str, on: &str| {
        format!("[[device]]\nname = \"{name}\"\ntype = \"{kind}\"\non = \"{on}\"\n")
    };
    let line = "name = \"single\"\n".to_owned()
        + &device("K", "EK1100", "maindevice")
        + &device("J", "EK1122", "K.B")
        + &device("L", "EK1100", "J.D")
        + &device("T", "EL1008", "L.B")
        + &device("E", "esi:maker.xml#LAMP-4", "T.B");
    let scan = |text: &str| {
        let path = directory.path().join("plant.toml");
        fs::write(&path, text).expect("a file can be written");
        linesman(["scan", &format!("sim:{}", path.display()), "--json"])
    };
    let whole = scan(&line);
    assert_eq!(whole.status, 0, "{}", whole.stderr);
    assert_eq!(whole.json()["devices"].as_array().map(Vec::len), Some(5), "{}", whole.stdout);
    let beyond = scan(&(line + &device("X", "EL1008", "E.B")));
    assert_eq!(beyond.status, 2, "{}", beyond.stdout);
    assert!(beyond.stderr.contains("`E` has no port B: a LAMP-4 has A"), "{}", beyond.stderr);
}
