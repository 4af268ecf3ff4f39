//! Makes the committed corpora, all with our own code: nothing in them comes from a device or from
//! another program's file.

use std::error::Error;
use std::path::Path;

use linesman_link::capture::{
    CaptureInterfaceId, FrameDirection, FrameToWrite, InterfaceToWrite, LinkType, PcapWriter,
    PcapngWriter,
};
use linesman_link::unix_time::UnixTime;
use linesman_proto::address::LogicalAddress;
use linesman_proto::command::Command;
use linesman_proto::esl::EslRecord;
use linesman_proto::ethernet::{MAX_LEN, MacAddress};
use linesman_proto::frame::FrameBuilder;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::sii::{
    Category, FmmuUsage, General, Identity, Image, MailboxPair, Pdo, PdoEntry, Protocols, Strings,
    SyncManager,
};

mod ethernet;
mod texts;

use ethernet::ethernet_messages;
use texts::{bundles, observation_files, pasted_texts};

type Made = Vec<(&'static str, Vec<u8>)>;

fn main() -> Result<(), Box<dyn Error>> {
    let frames = frames()?;
    let captures = captures(&frames)?;
    let targets = [
        ("bundle", bundles(&captures)),
        ("capture_filter", conditions()?),
        ("segment", series(&frames)),
        ("diagnosis", series(&frames)),
        ("segment_file", segment_files()),
        ("observation_file", observation_files()),
        ("pasted", pasted_texts()),
        ("frame", frames),
        ("device_builder", [images()?, descriptions()].concat()),
        ("esi", descriptions()),
        ("sii", images()?),
        ("ethernet", ethernet_messages()?),
        ("gateway", gateway_frames()),
        ("mailbox", messages().into_iter().chain(conversations()).collect()),
        ("mailbox_client", hostile()),
        ("capture", captures),
    ];
    for (target, inputs) in targets {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(target);
        std::fs::create_dir_all(&folder)?;
        for (name, bytes) in inputs {
            std::fs::write(folder.join(name), bytes)?;
        }
    }
    Ok(())
}

/// Frames a MainDevice sends, in each form of wrapping.
fn frames() -> Result<Made, Box<dyn Error>> {
    let every: Vec<_> =
        (0..15).filter_map(Command::from_code).map(|command| (command, 4)).collect();
    let mut frames = vec![
        ("broadcast-read", frame(&[(Command::Brd, 2)])?),
        ("every-command", frame(&every)?),
        ("process-data", frame(&[(Command::Lrw, 120), (Command::Brd, 2), (Command::Frmw, 8)])?),
        ("longest", frame(&[(Command::Lrw, 1486)])?),
        ("no-datagram", frame(&[])?),
    ];
    let plain = frame(&[(Command::Fprd, 16), (Command::Fpwr, 3)])?;
    let mut tagged = plain.clone();
    tagged.splice(12..12, [0x81, 0x00, 0x60, 0x05]);
    frames.push(("tagged", tagged));
    // IPv4 and UDP to port 0x88A4, lengths as they should be.
    let payload = &plain[14..];
    let udp_len = (payload.len() as u16 + 8).to_be_bytes();
    let ip_len = (payload.len() as u16 + 28).to_be_bytes();
    let mut udp = plain[..12].to_vec();
    udp.extend([0x08, 0x00, 0x45, 0x00, ip_len[0], ip_len[1], 0, 1, 0, 0, 64, 17, 0, 0]);
    udp.extend([192, 168, 0, 1, 255, 255, 255, 255, 0x88, 0xA4, 0x88, 0xA4]);
    udp.extend([udp_len[0], udp_len[1], 0, 0]);
    udp.extend_from_slice(payload);
    frames.push(("in-udp", udp));
    let mut cut = frame(&[(Command::Aprd, 40), (Command::Aprd, 40)])?;
    cut.truncate(90);
    frames.push(("cut-off", cut));
    Ok(frames)
}

/// Frames of the mailbox gateway: one, several behind each other, and what is wrong with them.
fn gateway_frames() -> Made {
    let upload =
        [0x10, 0x50, 0x0A, 0, 0xE9, 0x03, 0, 0x23, 0, 0x20, 0x41, 0x80, 0xF9, 0x02, 0, 0, 0, 0];
    let empty = [0x06, 0x50, 0, 0, 0, 0, 0, 0x1F];
    let mut too_long = upload;
    too_long[2] = 0x0B;
    vec![
        ("upload", upload.to_vec()),
        ("stream", [&upload[..], &empty, &upload, &upload[..7]].concat()),
        ("padded", [&upload[..], &[0; 30]].concat()),
        ("longer-message", too_long.to_vec()),
        ("other-type", [0x10, 0x10, 1, 2, 0xFF, 4].to_vec()),
    ]
}

/// Conditions on frames, each with a frame behind it, with the record of a capture probe or without.
fn conditions() -> Result<Made, Box<dyn Error>> {
    let (frame, record) = (
        frame(&[(Command::Fprd, 2), (Command::Lrw, 4)])?,
        EslRecord { port: Some(0), crc_error: false, alignment_error: true, time_ns: 183_570 },
    );
    let record = record.to_bytes();
    let with = |text: &str, parts: &[&[u8]]| [text.as_bytes(), b"\n", &parts.concat()].concat();
    Ok(vec![
        ("status", with("ecat.cmd == \"FPRD\" && ecat.ado in {0x0120..0x0140}", &[&frame])),
        ("probe", with("esl.port == 0 and not (cyclic or ecat_mailbox)", &[&frame, &record])),
        ("front", with("datagram(ecat.cnt & 1) ^^ around(F1, 5ms)", &[&record, &frame])),
        ("fault", with("ecat.cmd = (4", &[])),
    ])
}

fn frame(datagrams: &[(Command, usize)]) -> Result<Vec<u8>, Box<dyn Error>> {
    let mut buffer = [0; MAX_LEN];
    let mut builder = FrameBuilder::new(&mut buffer, MacAddress([2, 0, 0, 0, 0, 1]));
    for (number, (command, len)) in datagrams.iter().enumerate() {
        let address = address(number);
        let data = builder.push(*command, number as u8, address, *len)?;
        for (at, byte) in data.iter_mut().enumerate() {
            *byte = (at * 7 + number) as u8;
        }
    }
    let len = builder.finish();
    Ok(buffer[..len].to_vec())
}

/// Addresses that hit registers of several kinds.
fn address(number: usize) -> DatagramAddress {
    const REGISTERS: [u32; 8] = [0x0110, 0x0130, 0x0134, 0x0300, 0x0502, 0x0600, 0x0800, 0x0910];
    DatagramAddress::Logical(LogicalAddress(REGISTERS[number % REGISTERS.len()] << 16 | 0x1001))
}

fn images() -> Result<Made, Box<dyn Error>> {
    let identity =
        Identity { vendor_id: 0xE0, product_code: 7, revision: 0x0001_0000, serial_number: 42 };
    let bare = Image { identity, ..Image::default() };
    let mut strings = Strings::new();
    let order = strings.intern("DEMO-8")?;
    let name = strings.intern("Demonstration box, 8 channels")?;
    let channel = strings.intern("Channel")?;
    let general = General { order, name, group: order, ebus_current_ma: 90, ..General::default() };
    let entry = |bits| {
        let mut record = [0x00, 0x60, 1, channel.0, 1, bits, 0, 0];
        record[4] = if bits == 1 { 1 } else { 6 };
        PdoEntry::from_bytes(record)
    };
    let pdo = |index, bits| Pdo {
        index,
        sync_manager: Some(0),
        name: channel,
        entries: vec![entry(bits); 8],
        ..Pdo::default()
    };
    let simple = Image {
        categories: vec![
            Category::Strings(strings.clone()),
            Category::General(Box::new(general.clone())),
            Category::Fmmu(vec![FmmuUsage::Outputs, FmmuUsage::Inputs]),
            Category::SyncManagers(vec![
                SyncManager::from_bytes([0x00, 0x0F, 1, 0, 0x44, 0, 9, 3]),
                SyncManager::from_bytes([0x00, 0x10, 1, 0, 0x20, 0, 1, 4]),
            ]),
            Category::TxPdos(vec![pdo(0x1A00, 1)]),
            Category::RxPdos(vec![pdo(0x1600, 1)]),
        ],
        ..bare.clone()
    };
    let mailbox = Image {
        standard_mailbox: MailboxPair::from_words([0x1000, 128, 0x1080, 128]),
        bootstrap_mailbox: MailboxPair::from_words([0x1000, 512, 0x1200, 512]),
        protocols: Protocols(0x000C),
        categories: vec![
            Category::Strings(strings),
            Category::General(Box::new(general)),
            Category::TxPdos(vec![pdo(0x1A00, 16), pdo(0x1A01, 16)]),
        ],
        ..bare.clone()
    };
    let mut unfinished = simple.build()?;
    unfinished.truncate(unfinished.len() / 2 + 1);
    Ok(vec![
        ("bare", bare.build()?),
        ("simple", simple.build()?),
        ("mailbox", mailbox.build()?),
        ("cut-off", unfinished),
        ("blank", vec![0xFF; 256]),
    ])
}

/// What is asked, and answers to it: empty, cut off, of another service, endless segments.
fn hostile() -> Made {
    let answers = |choice: u8, flags: u8, bodies: &[&[u8]]| {
        let mut input = vec![choice];
        for body in bodies {
            input.extend((body.len() as u16).to_le_bytes());
            input.extend([flags, 0]);
            input.extend_from_slice(body);
        }
        input
    };
    // SDO response; 0x41 is an upload of that many bytes in segments, 0x00 a segment that is not the last.
    let long = [0x41, 0x18, 0x10, 1, 0xFF, 0xFF, 0xFF, 0x7F];
    let segment = [0x00, 1, 2, 3, 4, 5, 6, 7];
    vec![
        ("nothing", answers(0x00, 0, &[&[0; 16], &[0; 16]])),
        ("all-ones", answers(0x41, 0, &[&[0xFF; 32], &[0xFF; 32]])),
        ("endless-upload", answers(0x00, 2, &[&long, &segment, &segment, &segment])),
        ("abort-of-another", answers(0x02, 2, &[&[0x80, 0, 0x20, 5, 0, 0, 2, 6]])),
        (
            "list-without-end",
            answers(0x04, 2, &[&[0x82, 0, 0xFF, 0xFF, 1, 0, 0, 16], &[0x82, 0, 0xFF, 0xFF]]),
        ),
        (
            "file",
            answers(
                0x87,
                1,
                &[&[3, 0, 1, 0, 0, 0, 9, 9], &[3, 0, 9, 0, 0, 0], &[6, 0, 0, 0, 0, 0]],
            ),
        ),
        (
            "no-mailbox-message",
            answers(0x55, 0, &[&[2, 0, 0, 0, 0, 0x10, 1, 0], &[2, 0, 0, 0, 0, 0x20, 9, 0]]),
        ),
    ]
}

/// Messages by hand: header of six bytes, CoE header of two, then the service.
fn messages() -> Made {
    let coe = |service: u8, body: &[u8]| {
        let len = (body.len() as u16 + 2).to_le_bytes();
        let mut message = vec![len[0], len[1], 0, 0, 0, 0x13, 0x00, service << 4];
        message.extend_from_slice(body);
        message
    };
    vec![
        ("upload-request", coe(2, &[0x40, 0x18, 0x10, 1, 0, 0, 0, 0])),
        ("upload-expedited", coe(3, &[0x43, 0x18, 0x10, 1, 0xE0, 0, 0, 0])),
        ("upload-normal", coe(3, &[0x41, 0x08, 0x10, 0, 4, 0, 0, 0, b'D', b'E', b'M', b'O'])),
        ("upload-segment", coe(3, &[0x00, b's', b'e', b'g', b'm', b'e', b'n', b't'])),
        ("download", coe(2, &[0x2F, 0x12, 0x1C, 0, 1, 0, 0, 0])),
        ("complete-access", coe(2, &[0x50, 0x12, 0x1C, 0, 0, 0, 0, 0])),
        ("abort", coe(2, &[0x80, 0xF0, 0x10, 1, 0x02, 0x00, 0x01, 0x06])),
        ("emergency", coe(1, &[0x30, 0x81, 0x11, 1, 2, 3, 4, 5])),
        ("list", coe(8, &[0x02, 0, 0, 0, 1, 0, 0x00, 0x10, 0x18, 0x10])),
        ("object", coe(8, &[0x04, 0, 0, 0, 0x00, 0x10, 7, 0, 0, 7, b'D', b'e', b'v'])),
        ("entry", coe(8, &[0x06, 0, 0, 0, 0x18, 0x10, 1, 0, 7, 0, 32, 0, 0x07, 0, b'V'])),
        ("error-reply", vec![4, 0, 0, 0, 0, 0x10, 1, 0, 2, 0]),
    ]
}

/// Conversations with a device, in the form that its target reads: steps with length, flags, pause.
fn conversations() -> Made {
    const FETCH: u8 = 0x80;
    let step = |flags: u8, bytes: &[u8]| {
        let mut step = (bytes.len() as u16).to_le_bytes().to_vec();
        step.extend([flags, 4]);
        step.extend_from_slice(bytes);
        step
    };
    let message = |kind: u8, body: &[u8]| {
        let len = (body.len() as u16).to_le_bytes();
        let head = [len[0], len[1], 0, 0, 0, kind];
        step(FETCH, &[&head[..], body].concat())
    };
    let sdo = |body: &[u8]| message(0x03, &[&[0x00, 0x20][..], body].concat());
    let foe = |body: &[u8]| message(0x04, body);
    let boot = step(10, &[]);
    let init = step(9, &[1]);
    vec![
        (
            "device-objects",
            [
                sdo(&[0x40, 0x08, 0x10, 0, 0, 0, 0, 0]),
                sdo(&[0x50, 0x12, 0x1C, 0, 0, 0, 0, 0]),
                sdo(&[0x2F, 0xF3, 0x10, 3, 0, 0, 0, 0]),
                sdo(&[0x40, 0xF3, 0x10, 6, 0, 0, 0, 0]),
                message(0x03, &[0, 0x80, 1, 0, 0, 0, 1, 0]),
                step(12, &[2]),
                step(8, &[]),
            ]
            .concat(),
        ),
        (
            "device-file",
            [
                foe(b"\x01\0\0\0\0\0settings.txt"),
                foe(b"\x04\0\x01\0\0\0"),
                foe(b"\x02\0\0\0\0\0settings.txt"),
                foe(b"\x03\0\x01\0\0\0new"),
            ]
            .concat(),
        ),
        (
            "device-firmware",
            [
                boot,
                foe(b"\x02\0\0\0\0\0a.efw"),
                foe(b"\x03\0\x01\0\0\0Linesman firmware EL6601 12 CBF43926\n123456789"),
                step(15, &[]),
                foe(b"\x03\0\x01\0\0\0Linesman firmware EL6601 12 CBF43926\n123456789"),
                init,
                step(11, &[]),
                sdo(&[0x40, 0x0A, 0x10, 0, 0, 0, 0, 0]),
            ]
            .concat(),
        ),
    ]
}

fn captures(frames: &Made) -> Result<Made, Box<dyn Error>> {
    let ethernet = LinkType::from_number(1);
    let write = |interface, number: usize, bytes| {
        let time = UnixTime::from_nanos(1_700_000_000_000_000_000 + number as i128 * 2_000_000);
        let direction = if number.is_multiple_of(2) {
            FrameDirection::Outgoing
        } else {
            FrameDirection::Incoming
        };
        FrameToWrite::new(interface, time, direction, bytes)
    };
    let mut pcap = PcapWriter::new(Vec::new(), ethernet, false)?;
    let mut pcapng = PcapngWriter::new(Vec::new(), "linesman")?;
    let mut interfaces = Vec::new();
    for name in ["eth0", "eth1"] {
        let description = "";
        interfaces.push(pcapng.add_interface(&InterfaceToWrite {
            name,
            description,
            link_type: ethernet,
        })?);
    }
    for (number, (_, bytes)) in frames.iter().filter(|(_, bytes)| bytes.len() < 400).enumerate() {
        pcap.write_frame(&write(CaptureInterfaceId(0), number, bytes))?;
        pcapng.write_frame(&write(interfaces[number % 2], number, bytes))?;
    }
    let end = UnixTime::from_nanos(1_700_000_001_000_000_000);
    pcapng.write_statistics(interfaces[0], end, 10, 1)?;
    let (pcap, pcapng) = (pcap.finish()?, pcapng.finish()?);
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    std::io::Write::write_all(&mut packed, &pcapng)?;
    let cut = pcapng[..pcapng.len() * 2 / 3].to_vec();
    Ok(vec![
        ("two-interfaces.bin", pcapng),
        ("nanoseconds.bin", pcap),
        ("packed.bin", packed.finish()?),
        ("cut-off.bin", cut),
        ("empty.bin", Vec::new()),
    ])
}

/// Series of frames: each alone twice, as if it came back, and all one after the other.
fn series(frames: &Made) -> Made {
    let put = |series: &mut Vec<u8>, flags: u8, bytes: &[u8]| {
        let len = (bytes.len() as u16).to_le_bytes();
        series.extend([len[0], len[1], flags, 5]);
        series.extend_from_slice(bytes);
    };
    let mut made = Vec::new();
    let mut all = Vec::new();
    for (name, bytes) in frames.iter().filter(|(_, bytes)| bytes.len() < 400) {
        let mut twice = Vec::new();
        put(&mut twice, 0, bytes);
        put(&mut twice, 9, bytes);
        put(&mut all, 2, bytes);
        made.push((*name, twice));
    }
    made.push(("all", all));
    made
}

fn segment_files() -> Made {
    let line = "name = \"line\"\nseed = 7\n[[device]]\nname = \"K1\"\ntype = \"EK1100\"\n\
        on = \"maindevice\"\ncable_m = 12.5\n[[device]]\nname = \"I1\"\ntype = \"EL1008\"\n\
        on = \"K1.B\"\ncounters = { \"A.frame\" = 3 }\n[[device]]\nname = \"O1\"\n\
        type = \"EL2008\"\non = \"I1.B\"\nserial = 5\nclock_ppm = -20.0\n";
    let tree = "[[device]]\nname = \"J\"\ntype = \"CU1124\"\n\
        on = \"K1.C\"\n[[device]]\nname = \"K2\"\ntype = \"EK1100\"\non = \"J.C\"\n";
    let faults = "[[fault]]\nkind = \"emc-noise\"\nat = \"K1.B>I1.A\"\nfrom_ms = 1\nto_ms = 4\n\
        hits_per_s = 4000.0\n[[fault]]\nkind = \"link-open\"\nat = \"I1.B-O1.A\"\nfrom_ms = 2\n\
        [[fault]]\nkind = \"device-off\"\ndevice = \"O1\"\nfrom_ms = 3\n";
    let coupler = "[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n";
    let text = |parts: &[&str]| parts.concat().into_bytes();
    let ring = "[ring]\ncloses_at = \"K1.C\"\n";
    vec![
        ("line.toml", text(&[line])),
        ("faults.toml", text(&[line, faults])),
        ("ring.toml", text(&[coupler, ring])),
        ("tree.toml", text(&["old_counters = true\n", coupler, tree])),
        ("unknown-key.toml", text(&[coupler, "colour = \"red\"\n"])),
    ]
}

/// Device descriptions: with and without mailbox, modular, odd.
fn descriptions() -> Made {
    let whole = |devices: &str, rest: &str| {
        format!(
            "<?xml version=\"1.0\"?><EtherCATInfo><Vendor><Id>#x815</Id><Name>V</Name></Vendor>\
             <Descriptions><Devices>{devices}</Devices>{rest}</Descriptions></EtherCATInfo>"
        )
        .into_bytes()
    };
    let lamp = "<Device Physics=\"KK\"><Type ProductCode=\"#x1234\" RevisionNo=\"7\">LAMP</Type>\
        <Name LcId=\"1033\"><![CDATA[Lamp <1>]]></Name><Info><Electrical><EBusCurrent>070</EBusCurrent>\
        </Electrical></Info><Fmmu>Outputs</Fmmu><Sm StartAddress=\"#xf00\" ControlByte=\"#x44\" \
        Enable=\"1\" DefaultSize=\"1\">Outputs</Sm><RxPdo Fixed=\"1\" Sm=\"0\"><Index>#x1600</Index>\
        <Name>Out &amp; on</Name><Entry><Index>#x7000</Index><SubIndex>1</SubIndex><BitLen>1</BitLen>\
        <Name>O</Name><DataType>BOOL</DataType></Entry></RxPdo><Eeprom><ByteSize>1024</ByteSize>\
        <ConfigData>0401000000000100</ConfigData></Eeprom></Device>";
    let pump = "<Device Physics=\"YY\"><Type ProductCode=\"#x1234\" RevisionNo=\"8\">P-100</Type>\
        <Name>Pump</Name><Profile><ProfileNo>5001</ProfileNo><Dictionary><DataTypes><DataType>\
        <Name>ARR</Name><BaseType>UINT</BaseType><BitSize>32</BitSize><ArrayInfo><LBound>1</LBound>\
        <Elements>2</Elements></ArrayInfo></DataType><DataType><Name>DT8000</Name><BitSize>48</BitSize>\
        <SubItem><SubIdx>0</SubIdx><Name>N</Name><Type>USINT</Type><BitSize>8</BitSize></SubItem>\
        <SubItem><Name>E</Name><Type>ARR</Type><BitSize>32</BitSize><Flags>\
        <Access WriteRestrictions=\"PreOP\">rw</Access><PdoMapping>R</PdoMapping></Flags></SubItem>\
        </DataType></DataTypes><Objects><Object><Index>#x8000</Index><Name>S</Name><Type>DT8000</Type>\
        <BitSize>48</BitSize><Info><SubItem><Name>E</Name><Info><DefaultData>0A00</DefaultData></Info>\
        </SubItem></Info></Object></Objects></Dictionary></Profile><Fmmu>Outputs</Fmmu>\
        <Fmmu>Inputs</Fmmu><Fmmu>MBoxState</Fmmu>\
        <Sm DefaultSize=\"128\" StartAddress=\"#x1000\" ControlByte=\"#x26\" Enable=\"1\">MBoxOut</Sm>\
        <Sm DefaultSize=\"128\" StartAddress=\"#x1080\" ControlByte=\"#x22\" Enable=\"1\">MBoxIn</Sm>\
        <Sm DefaultSize=\"2\" StartAddress=\"#x1100\" ControlByte=\"#x64\" Enable=\"1\">Outputs</Sm>\
        <Sm DefaultSize=\"4\" StartAddress=\"#x1180\" ControlByte=\"#x20\" Enable=\"1\">Inputs</Sm>\
        <RxPdo Sm=\"2\"><Index>#x1600</Index><Name>R</Name><Entry><Index>#x8000</Index>\
        <SubIndex>1</SubIndex><BitLen>16</BitLen></Entry></RxPdo><TxPdo Sm=\"3\"><Index>#x1A00</Index>\
        <Name>T</Name><Entry><Index>#x6000</Index><SubIndex>1</SubIndex><BitLen>20</BitLen></Entry>\
        <Entry><Index>0</Index><BitLen>12</BitLen></Entry></TxPdo><Mailbox><CoE SdoInfo=\"1\" \
        PdoAssign=\"1\" PdoConfig=\"1\"/><FoE/></Mailbox><Dc><OpMode><Name>DC</Name>\
        <AssignActivate>#x300</AssignActivate></OpMode></Dc><Eeprom><ByteSize>2048</ByteSize>\
        <ConfigData>050C</ConfigData><BootStrap>0010f400f410f400</BootStrap></Eeprom></Device>";
    let slots = "<Slots SlotPdoIncrement=\"16\" SlotIndexIncrement=\"#x800\"><Slot MaxInstances=\"2\">\
        <Name>Axis</Name><ModuleIdent Default=\"1\">#x10</ModuleIdent></Slot></Slots></Device>";
    let modular = pump.replace("</Device>", slots);
    let modules = "<Modules><Module><Type ModuleIdent=\"#x10\">M</Type><Name>M</Name><TxPdo Sm=\"3\">\
        <Index DependOnSlot=\"1\">#x1A10</Index><Name>P</Name><Entry><Index DependOnSlot=\"1\">#x6010\
        </Index><SubIndex>1</SubIndex><BitLen>8</BitLen></Entry></TxPdo></Module></Modules>";
    let made: Made = vec![
        ("lamp.xml", whole(lamp, "")),
        ("pump.xml", whole(pump, "")),
        ("modular.xml", whole(&modular, modules)),
        ("cut-off.xml", whole(pump, "")[..900].to_vec()),
        (
            "doctype.xml",
            b"<!DOCTYPE a [<!ENTITY x \"&x;\">]><EtherCATInfo><Vendor>&x;</Vendor>".to_vec(),
        ),
    ];
    // A text ends with a line feed.
    let ended = |mut bytes: Vec<u8>| {
        bytes.push(b'\n');
        bytes
    };
    made.into_iter().map(|(name, bytes)| (name, ended(bytes))).collect()
}
