use linesman_proto::mailbox::coe::DataType;
use linesman_proto::mailbox::coe::information::Access;
use linesman_proto::port::PortMap;
use linesman_proto::sii::{Direction, Image, PortKind, ProcessData, Protocols};

use super::dictionary::Shape;
use super::*;

/// A pump with mailbox, dictionary and clocks, and a lamp without.
const PUMPS: &str = r##"<?xml version="1.0" encoding="UTF-8"?>
<!-- made up -->
<EtherCATInfo xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" Version="1.2">
  <Vendor><Id>#xE0000815</Id><Name LcId="1031">Pumpen</Name><Name LcId="1033">Pumps &amp; Co</Name></Vendor>
  <Descriptions>
    <Groups><Group><Type>PUMP</Type><Name LcId="1033">All pumps</Name></Group></Groups>
    <Devices>
      <Device Physics="YK K">
        <Type ProductCode="#x1234" RevisionNo="#x00020001">P-100</Type>
        <HideType RevisionNo="#x00010000"/>
        <Name LcId="1031"><![CDATA[Pumpe <100>]]></Name>
        <Name LcId="1033"><![CDATA[Pump <100>]]></Name>
        <Info>
          <Electrical><EBusCurrent>070</EBusCurrent></Electrical>
          <StateMachine><Timeout><PreopTimeout>2000</PreopTimeout><SafeopOpTimeout>9000</SafeopOpTimeout></Timeout></StateMachine>
          <IdentificationReg134>true</IdentificationReg134>
        </Info>
        <GroupType>PUMP</GroupType>
        <Profile>
          <ProfileNo>5001</ProfileNo>
          <Dictionary>
            <DataTypes>
              <DataType><Name>UINT</Name><BitSize>16</BitSize></DataType>
              <DataType><Name>MODE</Name><BaseType>UINT</BaseType><BitSize>16</BitSize></DataType>
              <DataType><Name>LOOP</Name><BaseType>LOOP2</BaseType><BitSize>16</BitSize></DataType>
              <DataType><Name>LOOP2</Name><BaseType>LOOP</BaseType><BitSize>16</BitSize></DataType>
              <DataType><Name>ARR</Name><BaseType>UINT</BaseType><BitSize>48</BitSize>
                <ArrayInfo><LBound>1</LBound><Elements>3</Elements></ArrayInfo></DataType>
              <DataType><Name>DT8000</Name><BitSize>64</BitSize>
                <SubItem><SubIdx>0</SubIdx><Name>SubIndex 000</Name><Type>USINT</Type><BitSize>8</BitSize><BitOffs>0</BitOffs>
                  <Flags><Access>ro</Access></Flags></SubItem>
                <SubItem><Name>Elements</Name><Type>ARR</Type><BitSize>48</BitSize><BitOffs>16</BitOffs>
                  <Flags><Access WriteRestrictions="PreOP">rw</Access><Backup>1</Backup></Flags></SubItem></DataType>
              <DataType><Name>DT9000</Name><BitSize>40</BitSize>
                <SubItem><SubIdx>1</SubIdx><Name>Mode</Name><Type>MODE</Type><BitSize>16</BitSize><BitOffs>16</BitOffs></SubItem>
                <SubItem><SubIdx>5</SubIdx><Name>Fast</Name><Type>BOOL</Type><BitSize>1</BitSize><BitOffs>32</BitOffs>
                  <Flags><Access>ro</Access><PdoMapping>T</PdoMapping></Flags></SubItem></DataType>
            </DataTypes>
            <Objects>
              <Object><Index>#x1000</Index><Name>Device type</Name><Type>UDINT</Type><BitSize>32</BitSize>
                <Info><DefaultData>89130000</DefaultData></Info><Flags><Access>ro</Access></Flags></Object>
              <Object><Index>#x1008</Index><Name>Name</Name><Type>STRING(5)</Type><BitSize>40</BitSize>
                <Info><DefaultString>P-100</DefaultString></Info></Object>
              <Object><Index>#x8000</Index><Name>Settings</Name><Type>DT8000</Type><BitSize>64</BitSize>
                <Info>
                  <SubItem><Name>SubIndex 000</Name><Info><DefaultData>03</DefaultData></Info></SubItem>
                  <SubItem><Name>Ramp</Name><Info><DefaultValue>10</DefaultValue><MaxValue>99</MaxValue></Info></SubItem>
                  <SubItem><Name>SubIndex 002</Name><Info><DefaultData>0B00</DefaultData></Info></SubItem>
                  <SubItem><Name>SubIndex 003</Name><Info/></SubItem>
                </Info></Object>
              <Object><Index>#x9000</Index><Name>State</Name><Type>DT9000</Type><BitSize>40</BitSize>
                <Info><SubItem><Name>Fast</Name><Info><DefaultValue>1</DefaultValue></Info></SubItem></Info></Object>
              <Object><Index>#x9100</Index><Name>Circle</Name><Type>LOOP</Type><BitSize>16</BitSize></Object>
              <Object><Index>no</Index><Name>Broken</Name><Type>UINT</Type><BitSize>16</BitSize></Object>
            </Objects>
          </Dictionary>
        </Profile>
        <Fmmu>Outputs</Fmmu><Fmmu>Inputs</Fmmu><Fmmu>MBoxState</Fmmu>
        <Sm DefaultSize="128" StartAddress="#x1000" ControlByte="#x26" Enable="1">MBoxOut</Sm>
        <Sm DefaultSize="#x80" StartAddress="#x1080" ControlByte="#x22" Enable="1">MBoxIn</Sm>
        <Sm DefaultSize="2" StartAddress="#x1100" ControlByte="#x64" Enable="1">Outputs</Sm>
        <Sm DefaultSize="0" StartAddress="#x1180" ControlByte="#x20" Enable="1" OpOnly="1">Inputs</Sm>
        <Sm StartAddress="#x09ae" Virtual="true">Inputs</Sm>
        <RxPdo Fixed="1" Mandatory="1" Sm="2"><Index>#x1600</Index><Name>Speed</Name><Exclude>#x1601</Exclude>
          <Entry><Index>#x7000</Index><SubIndex>1</SubIndex><BitLen>16</BitLen><Name>Speed</Name><DataType>INT</DataType></Entry></RxPdo>
        <TxPdo Fixed="0" Sm="3"><Index>#x1A00</Index><Name>State</Name>
          <Entry><Index>#x9000</Index><SubIndex>5</SubIndex><BitLen>1</BitLen><Name>Fast</Name><DataType>BOOL</DataType></Entry>
          <Entry><Index>0</Index><BitLen>7</BitLen></Entry></TxPdo>
        <Mailbox DataLinkLayer="true"><CoE SdoInfo="1" PdoAssign="1" CompleteAccess="1">
          <InitCmd><Transition>PS</Transition><Index>#x8000</Index><SubIndex>1</SubIndex><Data>0A00</Data></InitCmd></CoE><FoE/></Mailbox>
        <Dc><OpMode><Name>DC</Name><Desc>With SYNC0</Desc><AssignActivate>#x300</AssignActivate>
          <CycleTimeSync0 Factor="1">0</CycleTimeSync0><ShiftTimeSync0>-500</ShiftTimeSync0></OpMode></Dc>
        <Eeprom><ByteSize>2048</ByteSize><ConfigData>050C</ConfigData><BootStrap>0010f400f410f400</BootStrap>
          <Category><CatNo>2049</CatNo><Data>010203</Data></Category></Eeprom>
      </Device>
      <Device Physics="YY">
        <Type ProductCode="#x1234" RevisionNo="#x00030000">P-100</Type><Name>Pump</Name>
        <Sm StartAddress="hm">Inputs</Sm>
      </Device>
      <Device Physics="YY"><Type ProductCode="#x55">LAMP-1</Type><Name>Lamp</Name></Device>
    </Devices>
  </Descriptions>
</EtherCATInfo>"##;

fn pump(esi: &Esi) -> &EsiDevice {
    esi.find(&Selection::parse("p-100").unwrap()).unwrap()
}

#[test]
fn a_device_is_read_with_all_its_parts() {
    let esi = Esi::parse(PUMPS.as_bytes()).unwrap();
    assert_eq!((esi.vendor_id, esi.vendor.as_str()), (0xE000_0815, "Pumps & Co"));
    assert_eq!((esi.group("PUMP"), esi.devices.len()), ("All pumps", 3));
    let pump = pump(&esi);
    assert_eq!((pump.product_code, pump.revision, pump.line), (0x1234, 0x0002_0001, 8));
    assert_eq!((pump.name(), pump.ebus_current_ma), ("Pump <100>", Some(70)));
    assert_eq!(
        pump.ports,
        PortMap([PortKind::Mii, PortKind::EBus, PortKind::None, PortKind::EBus])
    );
    assert_eq!((pump.timeouts.preop_ms, pump.timeouts.safeop_op_ms), (2_000, 9_000));
    assert!(pump.identification_by_al_status);
    let mailbox = pump.mailbox.as_ref().unwrap();
    assert_eq!(mailbox.protocols, Protocols(Protocols::COE | Protocols::FOE));
    assert_eq!((mailbox.coe.0, mailbox.data_link_layer), (0x27, true));
    assert_eq!(
        (mailbox.commands[0].index, mailbox.commands[0].data.as_slice()),
        (0x8000, &[10, 0][..])
    );
    assert_eq!(pump.sync_managers[1].size, 128);
    assert!(pump.sync_managers[3].op_only && pump.sync_managers[4].is_virtual);
    assert_eq!((pump.op_modes[0].assign_activate, pump.op_modes[0].sync0_shift_ns), (0x300, -500));
    assert_eq!(pump.eeprom.as_ref().unwrap().bootstrap.send.size, 244);
    assert_eq!(pump.pdos[0].excludes, [0x1601]);
}

#[test]
fn types_of_the_dictionary_are_resolved() {
    let esi = Esi::parse(PUMPS.as_bytes()).unwrap();
    let pump = pump(&esi);
    let object = |index| pump.objects.iter().find(|object| object.index == index).unwrap();
    assert_eq!(object(0x1008).entries[0].default, b"P-100");
    let settings = object(0x8000);
    assert_eq!((settings.shape, settings.entries.len()), (Shape::Array, 4));
    let ramp = &settings.entries[1];
    assert_eq!((ramp.name.as_str(), ramp.data_type, ramp.bits), ("Ramp", DataType::UINT, 16));
    assert_eq!((ramp.default.as_slice(), ramp.maximum), (&[10, 0][..], Some(99)));
    let rights = Access::READ_PRE_OP
        | Access::READ_SAFE_OP
        | Access::READ_OP
        | Access::WRITE_PRE_OP
        | Access::BACKUP;
    assert_eq!(ramp.access.0, rights);
    let state = object(0x9000);
    let subindices: Vec<u8> = state.entries.iter().map(|entry| entry.subindex).collect();
    assert_eq!((state.shape, subindices), (Shape::Record, vec![0, 1, 5]));
    assert_eq!(state.entries[1].data_type, DataType::UINT, "through another name");
    assert_eq!(
        (state.entries[0].default.as_slice(), state.entries[2].default.as_slice()),
        (&[5][..], &[1][..])
    );
    assert_eq!(object(0x9100).entries[0].data_type, DataType::OCTET_STRING, "a circle of names");
    assert_eq!(pump.notes.len(), 1);
    assert_eq!(
        pump.notes[0].to_string(),
        "line 54, Dictionary/Index: \"no\", expected a number in range, decimal or #x…"
    );
}

#[test]
fn what_is_meant_is_found_or_named() {
    let esi = Esi::parse(PUMPS.as_bytes()).unwrap();
    let find = |text: &str| {
        let found = Selection::parse(text).and_then(|wanted| esi.find(&wanted));
        found.map(|device| device.revision).map_err(|error| error.to_string())
    };
    assert_eq!(find("P-100@0x00020001"), Ok(0x0002_0001));
    assert_eq!(find("0x1234@131073"), Ok(0x0002_0001));
    assert_eq!(
        find("P-100@0x00010000").unwrap_err(),
        "it has no revision 0x00010000 of \"P-100\"; it has 0x00020001; 0x00020001 stands for it"
    );
    assert_eq!(
        find("P-10").unwrap_err(),
        "it has no device \"P-10\"; it has P-100 and 1 more, and 1 that cannot be understood"
    );
    assert_eq!(
        find("").unwrap_err(),
        "it has 3 devices: say which, as `FILE#TYPE`; it has P-100, LAMP-1"
    );
    assert_eq!(find("P-100@x").unwrap_err(), "revision \"x\", expected a number, decimal or 0x…");
}

#[test]
fn a_broken_device_leaves_the_others() {
    let text = PUMPS.replace("Physics=\"YK K\"", "Physics=\"YQ\"");
    let esi = Esi::parse(text.as_bytes()).unwrap();
    let error = esi.find(&Selection::parse("P-100").unwrap()).unwrap_err().to_string();
    assert_eq!(error, "line 8, Device P-100/Device: Physics \"YQ\": 'Q', expected Y, K or H");
    assert!(esi.find(&Selection::parse("LAMP-1").unwrap()).is_ok());
}

#[test]
fn the_image_says_what_the_description_says() {
    let esi = Esi::parse(PUMPS.as_bytes()).unwrap();
    let pump = pump(&esi);
    let bytes = image::image(pump, esi.vendor_id, &pump.pdos).unwrap().build().unwrap();
    let image = Image::parse(&bytes).unwrap();
    assert!(image.oddities.is_empty(), "{:?}", image.oddities);
    assert_eq!((image.identity.vendor_id, image.identity.revision), (0xE000_0815, 0x0002_0001));
    assert_eq!(
        (image.order(), image.name(), image.group()),
        (Some("P-100"), Some("Pump <100>"), Some("PUMP"))
    );
    assert_eq!((image.ebus_current_ma(), bytes.len()), (Some(70), 2048));
    assert_eq!(image.mailbox().unwrap().to_words(), [0x1000, 128, 0x1080, 128]);
    let process: Vec<ProcessData> = image.process_data().collect();
    let bits: Vec<_> =
        process.iter().map(|one| (one.sync_manager, one.direction, one.bits)).collect();
    assert_eq!(
        bits,
        [(2, Direction::Outputs, 16), (3, Direction::Inputs, 8), (4, Direction::Inputs, 0)]
    );
    assert!(image.sync_managers()[4].enable.is_virtual());
    assert_eq!(image.op_modes().count(), 1);
}

#[test]
fn what_is_no_description_is_refused_with_its_place() {
    let refused = |text: &str| Esi::parse(text.as_bytes()).unwrap_err().to_string();
    assert_eq!(refused(""), "line 1, XML: there is no element in it");
    assert!(refused("<html>\n</html>").starts_with("line 1, html: no device description"));
    assert_eq!(refused("<EtherCATInfo>\n<Vendor>"), "line 2, Vendor: the file ends within it");
    let cut = refused("<EtherCATInfo>\n<Vendor");
    assert!(cut.starts_with("line 2, XML: the file ends within a tag or comment: "), "{cut}");
    assert!(refused("<EtherCATInfo>\n</Vendor>").starts_with("line 2, XML: "));
    let bomb = "<!DOCTYPE a [<!ENTITY x \"xxxxxxxx\">]><EtherCATInfo><Vendor><Name>&x;</Name>";
    assert_eq!(refused(bomb), "line 1, Name: an entity that XML does not know");
    let deep = format!("<EtherCATInfo><Vendor>{}", "<a>".repeat(1_000));
    assert_eq!(refused(&deep), "line 1, a: nested deeper than 64 elements");
    let long = format!("<EtherCATInfo><Vendor>{}", "x".repeat(3 << 20));
    assert_eq!(refused(&long), "line 1, Vendor: a text of more than 1048576 bytes");
    let wide = format!("<EtherCATInfo><Vendor {}>", "a='1' ".repeat(100));
    assert_eq!(refused(&wide), "line 1, Vendor: more than 64 attributes");
}

#[test]
fn a_file_of_modules_says_that_it_is_one() {
    let text = "<EtherCATModule><Vendor><Id>1</Id></Vendor><Modules><Module>\
                <Type ModuleIdent=\"#x10\">M</Type><Name>M</Name></Module></Modules></EtherCATModule>";
    let esi = Esi::parse(text.as_bytes()).unwrap();
    assert_eq!(
        esi.find(&Selection::parse("M").unwrap()).unwrap_err().to_string(),
        "an EtherCATModule file: it has 1 modules, but no devices; name the file of the device"
    );
}

#[test]
fn one_device_of_a_file_is_read_without_the_others() {
    let device = |name: &str, code: u32| {
        format!(
            "<Device Physics=\"YY\"><Type ProductCode=\"{code}\" RevisionNo=\"1\" \
             CheckRevisionNo=\"EQ_OR_G\">{name}</Type>\n<Name>{name}</Name><Su FrameRepeatSupport=\"1\">\
             unit</Su></Device>\n"
        )
    };
    let all: String = (0..50).map(|code| device(&format!("T{code}"), code)).collect();
    let text = format!(
        "<EtherCATInfo><Vendor><Id>2</Id></Vendor><Descriptions><Devices>{all}</Devices></Descriptions>\
         </EtherCATInfo>"
    );
    let headers = header::headers(text.as_bytes());
    assert_eq!(headers.len(), 50);
    let whole = Esi::parse(text.as_bytes()).unwrap();
    let some = Esi::parse_only(text.as_bytes(), &[headers[31].at, headers[7].at]).unwrap();
    let names = |esi: &Esi| esi.usable().map(|one| one.type_name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&some), ["T7", "T31"]);
    let of_whole: Vec<&EsiDevice> =
        whole.usable().filter(|one| [7, 31].contains(&one.product_code)).collect();
    assert_eq!(some.usable().collect::<Vec<_>>(), of_whole, "line numbers and all");
    assert_eq!(of_whole[0].revision_rule, Some(crate::identity::RevisionRule::EqualOrGreater));
    assert!(of_whole[0].frame_repeat);
    let cut = &text[..text.len() - 60];
    assert!(
        Esi::parse_only(cut.as_bytes(), &[headers[7].at]).is_err(),
        "a cut file is not believed"
    );
}
