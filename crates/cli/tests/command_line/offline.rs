//! Objects of a device that is not there, from its maker's description, and values that become start-up commands.

use std::fs;

use crate::support::{assert_valid, linesman};
use tempfile::TempDir;

const ESI: &str = r##"<EtherCATInfo><Vendor><Id>2</Id><Name>Maker</Name></Vendor><Descriptions><Devices>
<Device Physics="YY"><Type ProductCode="#x1234" RevisionNo="#x10000">GAIN-1</Type><Name>Amplifier</Name>
<Profile><Dictionary><DataTypes>
<DataType><Name>USINT</Name><BitSize>8</BitSize></DataType><DataType><Name>UINT</Name><BitSize>16</BitSize></DataType>
<DataType><Name>DT8010</Name><BitSize>32</BitSize>
<SubItem><SubIdx>0</SubIdx><Name>SubIndex 000</Name><Type>USINT</Type><BitSize>8</BitSize><BitOffs>0</BitOffs><Flags><Access>ro</Access></Flags></SubItem>
<SubItem><SubIdx>1</SubIdx><Name>Gain</Name><Type>UINT</Type><BitSize>16</BitSize><BitOffs>16</BitOffs><Flags><Access>rw</Access><Backup>1</Backup></Flags></SubItem>
</DataType></DataTypes><Objects>
<Object><Index>#x8010</Index><Name>Settings</Name><Type>DT8010</Type><BitSize>32</BitSize><Info>
<SubItem><Name>SubIndex 000</Name><Info><DefaultData>01</DefaultData></Info></SubItem>
<SubItem><Name>Gain</Name><Info><DefaultData>0a00</DefaultData></Info></SubItem></Info></Object>
</Objects></Dictionary></Profile>
<Fmmu>Outputs</Fmmu><Fmmu>Inputs</Fmmu><Fmmu>MBoxState</Fmmu>
<Sm StartAddress="#x1000" ControlByte="#x26" DefaultSize="128" Enable="1">MBoxOut</Sm>
<Sm StartAddress="#x1080" ControlByte="#x22" DefaultSize="128" Enable="1">MBoxIn</Sm>
<Mailbox><CoE SdoInfo="1" CompleteAccess="1"/></Mailbox>
<Eeprom><ByteSize>2048</ByteSize><ConfigData>050603440a00</ConfigData></Eeprom></Device>
</Devices></Descriptions></EtherCATInfo>"##;

const PROJECT: &str = "# The machine.\nesi = [\"gain.xml\"]\n\n[[device]]\nname = \"Front\" # left\ntype = \"GAIN-1\"\n\
                       on = \"maindevice\"\n\n[[device]]\nname = \"Rear\"\ntype = \"GAIN-1\"\non = \"Front.B\"\n";

// S0 L493-524, L2401-2420.
// proves: SW-13
#[test]
fn objects_are_browsed_without_the_device_and_added_to_the_start_up_list() {
    let folder = TempDir::new().unwrap();
    let (esi, project) = (folder.path().join("gain.xml"), folder.path().join("machine.toml"));
    fs::write(&esi, ESI).unwrap();
    fs::write(&project, PROJECT).unwrap();
    let place = format!("esi:{}#GAIN-1", esi.display());
    let listed = linesman(["sdo", &place, "offline", "list", "--entries", "--values", "--json"]);
    assert_eq!(listed.status, 0, "{}", listed.all());
    assert_valid(&listed.json(), "objects");
    assert!(
        listed.stdout.contains("Gain") && listed.stdout.contains("Settings"),
        "{}",
        listed.stdout
    );
    let project_word = project.to_str().unwrap();
    let write = |value: &str, more: &[&str]| {
        let words =
            ["sdo", &place, "offline", "write", "0x8010:01", value, "--start-up", project_word];
        linesman(words.iter().chain(more))
    };
    // The description says what fits, and what may be written.
    let added = write("300", &["--as", "Rear"]);
    assert_eq!(added.status, 0, "{}", added.all());
    assert!(added.stdout.contains("a start-up command of Rear, at PS"), "{}", added.all());
    let text = fs::read_to_string(&project).unwrap();
    assert!(text.starts_with("# The machine.") && text.contains("\"Front\" # left"), "{text}");
    assert!(text.contains("data = \"2c 01\"") && text.contains("comment = \"Gain\""), "{text}");
    let plan = linesman(["plan", project_word, "--json", "-v"]);
    assert!(plan.status <= 1, "{}", plan.all());
    let rear = &plan.json()["devices"][1];
    assert!(rear.to_string().contains("0x8010:01"), "{rear}");
    assert_eq!(write("70000", &["--as", "Rear"]).status, 2, "too large for its type");
    let refused =
        linesman(["sdo", &place, "offline", "write", "0x8010:00", "1", "--start-up", project_word]);
    assert_eq!(refused.status, 1, "{}", refused.all());
    let nobody = write("1", &["--as", "Middle"]);
    assert_eq!(nobody.status, 2, "{}", nobody.all());
    assert!(nobody.stderr.contains("Front, Rear"), "{}", nobody.stderr);
    assert_eq!(write("1", &["--at", "XY"]).status, 2);
    assert_eq!(fs::read_to_string(&project).unwrap(), text, "only what was done is in the file");
    let unknown = linesman(["sdo", &format!("esi:{}#GAIN-9", esi.display()), "1", "list"]);
    assert_eq!(unknown.status, 2, "{}", unknown.all());
    assert!(unknown.stderr.contains("GAIN-1"), "what there is: {}", unknown.stderr);
}
