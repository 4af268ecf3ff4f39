//! Files of the tools, made in miniature, and all that there are.

use linesman_proto::address::{LogicalAddress, RegisterAddress, StationAddress, StationAlias};
use linesman_proto::ads::AmsNetId;
use linesman_proto::command::Command;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::frame::size::frame_size;
use linesman_proto::register::SmControl;
use linesman_proto::sii::{FmmuUsage, Identity, MailboxPair, Protocols};
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use linesman_proto::topology::{SeenController, derive};

use super::*;
use crate::identity::RevisionRule;
use crate::plan::layout::{Grouping, TaskOptions};
use crate::plan::*;
use crate::profile::{DeviceProfile, Mailbox, MappedEntry, MappedPdo, ProcessSyncManager};
use crate::start_up::{StartUpAction, StartUpCommand, Transition};
use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::port::Port;
use linesman_proto::sii::Direction;

/// Files of the collection of real data that are network configurations; none, and a word about it,
/// when it is not there.
#[expect(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    reason = "a test of real data has to get at them, and must not be silent when it cannot"
)]
fn files() -> Vec<(String, Vec<u8>)> {
    let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    let root = std::env::var("LINESMAN_DATA").unwrap_or_else(|_| beside.to_owned());
    let folder = std::path::Path::new(&root).join("eni");
    let Ok(entries) = std::fs::read_dir(&folder) else {
        eprintln!("SKIPPED: no real data in {} (set LINESMAN_DATA)", folder.display());
        return Vec::new();
    };
    let read = |entry: std::fs::DirEntry| {
        let name = entry.file_name().to_string_lossy().into_owned();
        (name, std::fs::read(entry.path()).unwrap())
    };
    let mut files: Vec<_> = entries.map(|entry| read(entry.unwrap())).collect();
    files.sort();
    files
}

#[test]
fn all_files_of_the_collection_load_and_come_back() {
    for (name, bytes) in files() {
        let eni = Eni::parse(&bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
        let again = write(&eni.name, &eni.plan);
        let back = Eni::parse(again.as_bytes()).unwrap_or_else(|error| panic!("{name}: {error}"));
        for (one, other) in back.plan.devices.iter().zip(&eni.plan.devices) {
            assert_eq!(one, other, "{name}");
        }
        assert_eq!(back.plan.tasks, eni.plan.tasks, "{name}");
        assert_eq!(
            back,
            Eni { notes: back.notes.clone(), is_wired: back.is_wired, ..eni },
            "{name}"
        );
    }
}

/// The elements of a file at a path below `Config`, read apart from what is tested.
fn elements(bytes: &[u8], path: &str) -> Vec<Element> {
    let text = encoding::decode(bytes).unwrap();
    let (top, rest) = path.split_once('/').unwrap();
    let mut all = Vec::new();
    let containers = |path: &[String]| path.len() <= 2;
    xml::walk(&text, &containers, &mut |_, element| {
        if element.name == top {
            all.push(element);
        }
        Ok(())
    })
    .unwrap();
    for name in rest.split('/') {
        all = all.iter().flat_map(|one| one.children(name).cloned()).collect();
    }
    all
}

// proves: FRM-16 partial: expected working counters of real configurations
#[test]
fn plans_agree_with_the_numbers_of_their_files() {
    for (name, bytes) in files() {
        let plan = Eni::parse(&bytes).unwrap().plan;
        let present = Presence::full(plan.devices.len());
        let commands = elements(&bytes, "Cyclic/Frame/Cmd");
        assert_eq!(commands.len(), plan.datagrams().count(), "{name}");
        for (element, (.., datagram)) in commands.iter().zip(plan.datagrams()) {
            let number = |name: &str| element.child_number::<u64>(name).unwrap();
            assert_eq!(number("Cmd"), Some(u64::from(datagram.command.code())), "{name}");
            assert_eq!(number("DataLength"), Some(datagram.len as u64), "{name}");
            if let DatagramAddress::Logical(address) = datagram.address {
                assert_eq!(number("Addr"), Some(u64::from(address.0)), "{name}");
            }
            let expected = expect::expect(datagram, &present, PathView::Merged).0;
            if let Some(counter) = number("Cnt") {
                assert_eq!(counter, u64::from(expected), "{name}: {}", datagram.command.name());
            }
            let process = matches!(datagram.command, Command::Lrd | Command::Lwr | Command::Lrw);
            let states = datagram.role == Role::MailboxStates;
            assert_eq!(datagram.role == Role::ProcessData, process && !states, "{name}");
        }
        let frames = elements(&bytes, "Cyclic/Frame");
        let sizes = plan.tasks.iter().flat_map(|task| &task.frames).map(FramePlan::size);
        let lens = |frame: &Element| -> Vec<usize> {
            frame
                .children("Cmd")
                .filter_map(|one| one.child_number("DataLength").unwrap())
                .collect()
        };
        assert!(frames.iter().map(|frame| frame_size(lens(frame))).eq(sizes), "{name}");

        let written = |device: &DevicePlan| -> Vec<(u16, u8, Vec<u8>)> {
            let objects = device.start_up.iter().filter_map(|command| match &command.action {
                StartUpAction::CoeDownload { object, data, .. } => {
                    Some((object.index.0, object.subindex, data.clone()))
                }
                StartUpAction::SetAddresses { .. }
                | StartUpAction::WriteIdn { .. }
                | StartUpAction::Ads { .. }
                | StartUpAction::WriteFile { .. }
                | StartUpAction::SendVendorMessage { .. }
                | StartUpAction::RegisterWrite { .. } => None,
            });
            objects.collect()
        };
        let planned: Vec<_> = plan.devices.iter().flat_map(written).collect();
        let said: Vec<_> = elements(&bytes, "Slave/Mailbox/CoE/InitCmds/InitCmd")
            .iter()
            .map(|command| {
                let number = |name: &str| command.child_number::<u16>(name).unwrap().unwrap();
                let data = crate::esi::value::bytes(command.child_text("Data")).unwrap();
                (number("Index"), number("SubIndex") as u8, data)
            })
            .collect();
        assert_eq!(planned, said, "{name}");
        // Each FMMU of the plan is a command of the file, to the byte.
        let fmmus = plan.devices.iter().flat_map(|device| {
            device
                .fmmus
                .iter()
                .chain(&device.mailbox_state)
                .map(move |fmmu| (device.station, *fmmu))
        });
        let commands = elements(&bytes, "Slave/InitCmds/InitCmd");
        for (station, (index, fmmu)) in fmmus {
            let data: String = fmmu.to_bytes().iter().map(|byte| format!("{byte:02x}")).collect();
            let said = commands.iter().any(|one| {
                one.child_number::<u16>("Adp").unwrap() == Some(station.0)
                    && one.child_number::<u16>("Ado").unwrap()
                        == Some(0x600 + 16 * u16::from(index))
                    && one.child_text("Data").eq_ignore_ascii_case(&data)
            });
            assert!(said, "{name}: {station:?} {index} {data}");
        }
    }
}

#[test]
fn the_branched_line_of_the_collection_is_understood() {
    let Some((_, bytes)) = files().into_iter().find(|(name, _)| name.contains("junction")) else {
        return;
    };
    let eni = Eni::parse(&bytes).unwrap();
    let plan = &eni.plan;
    assert_eq!(plan.devices.len(), 9);
    assert_eq!(plan.devices[0].station, StationAddress(1001));
    assert_eq!(plan.tree.children(0).count(), 2, "one drive line, one junction");
    assert_eq!(plan.tree.child(0, Port::C), Some(8));
    assert_eq!((plan.outputs_len, plan.inputs_len), (7 * 27, 7 * 25));
    assert_eq!(plan.tasks[0].name, "NC-Task 1 SAF");
    assert_eq!(plan.tasks[0].cycle, Span::ms(2));
    assert_eq!(plan.reference_clock().map(|id| id.no()), Some(2));
    assert!(plan.devices[0].device_emulation && !plan.devices[1].device_emulation);
    let clock = plan.devices[1].settings.clock.unwrap();
    assert_eq!((clock.assign_activate, clock.sync0_cycle), (0x0300, Span::ms(2)));
    let word = plan.variables.iter().find(|one| one.name.ends_with("Statusword")).unwrap();
    assert_eq!((word.direction, word.bit_at, word.bits), (Direction::Inputs, 0, 16));
    assert_eq!(word.data_type, "UINT");
}

/// A plan with something of everything.
fn everything() -> Plan {
    let manager = |index, direction, start, len, bits| ProcessSyncManager {
        index,
        direction,
        start: RegisterAddress(start),
        len,
        control: if direction == Direction::Outputs {
            SmControl::OUTPUTS
        } else {
            SmControl::INPUTS
        },
        is_virtual: false,
        bits,
    };
    let entry = |name: &str, index, bits, data_type: &str| MappedEntry {
        index,
        subindex: 1,
        bits,
        name: name.to_owned(),
        data_type: data_type.to_owned(),
    };
    let planned = |number: u16, profile: DeviceProfile| PlannedDevice {
        name: format!("Box {number} <&>"),
        station: StationAddress(1000 + number),
        identity: Identity {
            vendor_id: 2,
            product_code: 7,
            revision: 0x0012_0000,
            serial_number: 0,
        },
        revision_rule: RevisionRule::HighWordEqualOrGreater,
        profile,
        target: AlState::Op,
        start_up: Vec::new(),
        settings: DeviceSettings::default(),
    };
    let mut drive = planned(
        1,
        DeviceProfile {
            type_name: "DRV".to_owned(),
            mailbox: Some(Mailbox {
                areas: MailboxPair::from_words([0x1000, 128, 0x1080, 128]),
                protocols: Protocols(
                    Protocols::COE | Protocols::FOE | Protocols::EOE | Protocols::SOE,
                ),
                bootstrap: Some(MailboxPair::from_words([0x1000, 256, 0x1200, 256])),
                complete_access: true,
            }),
            process: vec![
                manager(2, Direction::Outputs, 0x1100, 6, 0),
                manager(3, Direction::Inputs, 0x1400, 4, 0),
            ],
            pdos: vec![MappedPdo {
                sync_manager: 3,
                direction: Direction::Inputs,
                index: 0x1A00,
                name: "Axis".to_owned(),
                entries: vec![
                    entry("Status", 0x6041, 16, "UINT"),
                    entry("", 0, 8, ""),
                    entry("Mode", 0x6061, 8, "SINT"),
                ],
            }],
            fmmus: vec![FmmuUsage::Outputs, FmmuUsage::Inputs, FmmuUsage::MailboxState],
            ..DeviceProfile::default()
        },
    );
    drive.settings.clock = Some(ClockSettings {
        assign_activate: 0x0700,
        sync0_cycle: Span::ms(1),
        sync0_shift_ns: -20_000,
        input_reference: Some(false),
        sync1_cycle: Span::us(500),
        reference: true,
    });
    drive.settings.watchdog.process_data = Some(500);
    drive.settings.modules = vec![0x1234, 0, 7];
    drive.settings.net_id = Some(AmsNetId([10, 0, 0, 1, 3, 1]));
    drive.settings.on_wrong_counter = OnWrongCounter::Clear;
    drive.start_up = vec![
        StartUpCommand {
            transition: Transition::PRE_OP_TO_SAFE_OP,
            action: StartUpAction::CoeDownload {
                object: ObjectAddress::new(0x6060, 0),
                complete_access: false,
                data: vec![8],
            },
            comment: "mode of operation".to_owned(),
        },
        StartUpCommand {
            transition: Transition::INIT_TO_PRE_OP,
            action: StartUpAction::SetAddresses {
                port: 0,
                parameters: vec![2, 0, 0, 0, 11, 1, 168, 192],
            },
            comment: "addresses".to_owned(),
        },
        StartUpCommand {
            transition: Transition::PRE_OP_TO_SAFE_OP,
            action: StartUpAction::WriteIdn {
                drive: 1,
                idn: linesman_proto::mailbox::soe::Idn(32),
                elements: 0x40,
                data: vec![11, 0],
            },
            comment: "mode".to_owned(),
        },
        StartUpCommand {
            transition: Transition::INIT_TO_PRE_OP,
            action: StartUpAction::set_net_id(AmsNetId([10, 0, 0, 1, 3, 1])),
            comment: "NetId".to_owned(),
        },
        StartUpCommand {
            transition: Transition::PRE_OP_TO_SAFE_OP,
            action: StartUpAction::WriteFile {
                name: "cam.tbl".to_owned(),
                password: 7,
                data: vec![1, 2, 3],
            },
            comment: "table".to_owned(),
        },
        StartUpCommand {
            transition: Transition::PRE_OP_TO_SAFE_OP,
            action: StartUpAction::SendVendorMessage {
                data: vec![2, 0, 0, 0, 1, 0, 7],
                answer_within: Span::ms(100),
            },
            comment: "vendor".to_owned(),
        },
        StartUpCommand {
            transition: Transition::INIT_TO_PRE_OP,
            action: StartUpAction::RegisterWrite {
                address: RegisterAddress(0x0200),
                data: vec![4, 0],
            },
            comment: "event mask".to_owned(),
        },
    ];
    let bits = |direction, start| DeviceProfile {
        process: vec![manager(0, direction, start, 1, 4)],
        ebus_current_ma: Some(90),
        ..DeviceProfile::default()
    };
    let mut devices = vec![drive];
    devices.extend((2..5).map(|number| planned(number, bits(Direction::Inputs, 0x1000))));
    devices.extend((5..8).map(|number| planned(number, bits(Direction::Outputs, 0x0F00))));
    for device in &mut devices[4..] {
        device.settings.task = Some("slow".to_owned());
        device.settings.sync_unit = Some("lamps".to_owned());
        device.settings.frame_repeat = true;
        device.settings.alias = Some(StationAlias(0x2000 + device.station.0));
        device.settings.addressing = AddressingChoice::Alias;
    }
    let mut seen = vec![SeenController::open_at(&[Port::A, Port::B]); 6];
    seen.push(SeenController::open_at(&[Port::A]));
    let fast = TaskOptions::new("fast", Span::ms(1));
    let slow =
        TaskOptions { repeats: 1, io_at: IoAt::TaskEnd, ..TaskOptions::new("slow", Span::ms(10)) };
    let options = PlanOptions {
        tasks: vec![fast, slow],
        grouping: Grouping::ByKind,
        pack_bits: true,
        clock_datagrams: true,
        mailbox_states: true,
        ..PlanOptions::default()
    };
    Plan::build(&devices, derive(&seen).unwrap(), &options).unwrap()
}

#[test]
fn a_plan_with_something_of_everything_comes_back() {
    let mut plan = everything();
    assert_eq!(plan.inputs_len, 4 + 2, "three times four bits");
    // An ENI does not say which channels a drive has.
    plan.devices.iter_mut().for_each(|device| device.channels.clear());
    let text = write("Prüfstand", &plan);
    let back = Eni::parse(text.as_bytes()).unwrap();
    assert_eq!(back.name, "Prüfstand");
    for (one, other) in back.plan.devices.iter().zip(&plan.devices) {
        assert_eq!(one, other);
    }
    assert_eq!(back.plan.tasks, plan.tasks);
    assert_eq!(back.plan, plan);
    let LogicalAddress(lamps) = match plan.tasks[1].frames[0].datagrams[0].address {
        DatagramAddress::Logical(address) => address,
        DatagramAddress::Physical(..) => panic!("the lamps are logical"),
    };
    assert_eq!(lamps, 0x0200_0000);
}

#[test]
fn contradictions_are_told_with_their_place() {
    let text = write("test", &everything());
    let broken = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        Eni::parse(text.replacen(from, to, 1).as_bytes()).unwrap_err().to_string()
    };
    let table = [
        (
            "<Cnt>3</Cnt>",
            "<Cnt>4</Cnt>",
            "Cnt 4, but the FMMUs and the number of SubDevices give 3",
        ),
        ("<PhysAddr>1002</PhysAddr>", "<PhysAddr>1001</PhysAddr>", "PhysAddr says 1001"),
        ("<AutoIncAddr>65535<", "<AutoIncAddr>0<", "position 0, which"),
        ("<BitLength>32</BitLength>", "<BitLength>64</BitLength>", "BitLength 64, but its FMMUs"),
        (
            "<DataLength>10</DataLength>",
            "<DataLength>2000</DataLength>",
            "a datagram carries at most",
        ),
        ("<Cmd>12</Cmd>", "<Cmd>77</Cmd>", "expected a command, 0 to 14"),
        ("<CycleTime>1000</CycleTime>", "<CycleTime>0</CycleTime>", "it has no CycleTime"),
        ("<Transition>PS</Transition>", "<Transition>XY</Transition>", "letters I, P, S, O, B"),
        ("<Data>08</Data>", "<Data>0</Data>", "two for each byte"),
        ("<Port>B</Port>", "<Port>E</Port>", "expected A, B, C or D"),
        ("<Data>e903</Data>", "<Data>0000</Data>", "PhysAddr says 1001"),
    ];
    for (from, to, expected) in table {
        let error = broken(from, to);
        assert!(error.contains(expected), "{to}: {error}");
        assert!(error.starts_with("line "), "{to}: {error}");
        assert!(error.contains("Slave") || error.contains("Cyclic"), "{to}: {error}");
    }
}

#[test]
fn what_is_no_eni_is_refused_in_clear_words() {
    let error = |text: &str| Eni::parse(text.as_bytes()).unwrap_err();
    assert_eq!(
        error("<EncryptedEtherCATConfig>AAAA</EncryptedEtherCATConfig>"),
        EniError::Encrypted
    );
    assert!(error("<EtherCATInfo/>").to_string().contains("line 1, EtherCATInfo"));
    assert_eq!(error("<EtherCATConfig><Config/></EtherCATConfig>"), EniError::Empty);
    assert!(error("<EtherCATConfig><Config>").to_string().contains("the file ends within it"));
    assert!(Eni::parse(b"\xFF\xFE").is_err());
    assert!(Eni::parse(b"").is_err());
    assert!(Eni::is_one(b"<?xml version=\"1.0\"?><EtherCATConfig/>") && !Eni::is_one(b"name = 1"));
}

#[test]
fn fmmus_follow_from_the_process_image_where_no_command_sets_them() {
    let text = r#"<EtherCATConfig><Config><Slave><Info><Name>A</Name><PhysAddr>1001</PhysAddr></Info>
        <ProcessData><Send><BitStart>88</BitStart><BitLength>16</BitLength></Send>
        <Sm2><Type>Outputs</Type><DefaultSize>2</DefaultSize><StartAddress>#x1100</StartAddress>
        <ControlByte>#x64</ControlByte><Enable>1</Enable></Sm2></ProcessData></Slave>
        <Cyclic><CycleTime>1000</CycleTime><Frame><Cmd><Cmd>11</Cmd><Addr>65536</Addr>
        <DataLength>3</DataLength><Cnt>1</Cnt><OutputOffs>0</OutputOffs></Cmd></Frame></Cyclic>
        <Unknown><Deep/></Unknown></Config></EtherCATConfig>"#;
    // A header of ten bytes stands before the data in this image: bit 88 is their second byte.
    let plan = Eni::parse(text.as_bytes()).unwrap().plan;
    let (_, fmmu) = plan.devices[0].fmmus[0];
    assert_eq!((fmmu.logical_start, fmmu.length), (LogicalAddress(65537), 2));
    assert_eq!(fmmu.physical_start, RegisterAddress(0x1100));
    let beyond = text.replace("<BitStart>88", "<BitStart>880");
    let error = Eni::parse(beyond.as_bytes()).unwrap_err().to_string();
    assert!(error.contains("bit 880") && error.contains("line 2"), "{error}");
}

#[test]
fn what_is_left_out_of_a_file_is_said() {
    let file = r#"<EtherCATConfig><Config><Slave>
<Info><Name>Bridge</Name><PhysAddr>1001</PhysAddr><AutoIncAddr>0</AutoIncAddr><Physics>YY</Physics></Info>
<Mailbox><Send><Start>4096</Start><Length>128</Length></Send><Recv><Start>4224</Start><Length>128</Length></Recv>
 <Protocol>CoE</Protocol><Protocol>EoE</Protocol>
 <EoE><InitCmds><InitCmd><Transition>IP</Transition><IP>10.0.0.2</IP></InitCmd>
  <InitCmd><Transition>IP</Transition><Disabled>1</Disabled></InitCmd></InitCmds></EoE>
 <SoE><InitCmds><InitCmd><Transition>PS</Transition></InitCmd><InitCmd><Transition>PS</Transition></InitCmd></InitCmds></SoE>
 <AoE><NetId>10.0.0.1.3.1</NetId><InitCmds><InitCmd><Transition>IP</Transition><Data>0102</Data></InitCmd></InitCmds></AoE>
 <FoE><InitCmds><InitCmd><Transition>PS</Transition><Comment>no name</Comment><Data>01</Data></InitCmd></InitCmds></FoE>
</Mailbox>
<HotConnect><GroupName>Tool 1</GroupName><GroupMemberCnt>1</GroupMemberCnt></HotConnect>
</Slave></Config></EtherCATConfig>"#;
    let notes = Eni::parse(file.as_bytes()).unwrap().notes;
    let told = |words: &str| notes.iter().filter(|note| note.contains(words)).count();
    assert_eq!(told("Bridge: 1 start-up command by EoE not carried out"), 1, "{notes:?}");
    assert_eq!(told("Bridge: 2 start-up commands by SoE not carried out"), 1, "{notes:?}");
    assert_eq!(told("Bridge: 1 start-up command by AoE not carried out"), 1, "{notes:?}");
    assert_eq!(told("Bridge: 1 start-up command by FoE (no name) not carried out"), 1, "{notes:?}");
    let wrong = Eni::parse(file.replace("10.0.0.1.3.1", "10.0.0.1").as_bytes()).unwrap_err();
    assert!(wrong.to_string().contains("NetId"), "{wrong}");
    assert_eq!(told("hot connect group \"Tool 1\""), 1, "{notes:?}");
}

// S0 L2481-2483.
// proves: SW-12 partial: of a network configuration
#[test]
fn an_address_that_ends_in_0_is_refused() {
    let text = write("test", &everything());
    let data = "020000000B01A8C0";
    assert!(text.to_uppercase().contains(data), "{text}");
    let broken =
        text.replace("020000000b01a8c0", "020000000001a8c0").replace(data, "020000000001A8C0");
    let error = Eni::parse(broken.as_bytes()).unwrap_err().to_string();
    assert!(error.contains("192.168.1.0 ends in .0") && error.contains("EoE"), "{error}");
}
