//! The library as a MainDevice finds it.

use linesman_config::profile::DeviceProfile;
use linesman_proto::port::{Port, PortMap};
use linesman_proto::sii::{Checksum, Direction, Image, SyncManagerKind};

use super::spec::NOBODY;
use super::{LibraryType, build, build_revision, find, types};
use crate::device::Signals;
use crate::device::tests::Device;
use crate::hardware::PortKind;

#[test]
fn every_type_is_found_once_and_bears_a_sound_image() {
    let mut names: Vec<&str> = types().map(LibraryType::name).collect();
    for name in &names {
        let mut signals = Signals::default();
        let built = build(&name.to_lowercase(), 4_711, &mut signals).unwrap();
        assert_eq!(built.len(), find(name).unwrap().ports().count());
        let mut channels = 0;
        for one in &built {
            let image = Image::parse(&one.sii).unwrap();
            assert_eq!(image.oddities, [], "{name}");
            let vendor = if find(name).unwrap().group() == "Generic" { NOBODY } else { 2 };
            assert_eq!(image.identity.vendor_id, vendor, "{name}");
            assert_eq!(image.identity.serial_number, 4_711, "{name}");
            assert_eq!(image.checksum, Checksum::Valid, "{name}");
            assert_eq!(image.build().unwrap(), one.sii, "{name}");
            assert!(!one.sii.is_empty());
            channels += one.outputs.len() + one.inputs.len();
        }
        assert_eq!(channels, signals.len(), "{name}: every channel is a signal");
        assert_eq!(DeviceProfile::from_sii(&Image::parse(&built[0].sii).unwrap()).type_name, *name);
    }
    let count = names.len();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), count);
}

#[test]
fn an_unknown_type_is_told_with_what_there_is_instead() {
    let error = build("EL1009", 0, &mut Signals::default()).unwrap_err().to_string();
    assert!(error.contains("EL1009") && error.contains("EL1008"), "{error}");
    assert!(!error.contains("EK1100"), "{error}");
    let error = build("", 0, &mut Signals::default()).unwrap_err().to_string();
    assert!(error.contains("EK1100"), "{error}");
}

#[test]
fn profiles_of_digital_terminals() {
    // type, direction, start, bytes, control
    let table = [
        ("EL1004", Direction::Inputs, 0x1000, 1, 0x00),
        ("EL1008", Direction::Inputs, 0x1000, 1, 0x00),
        ("EL2004", Direction::Outputs, 0x0F00, 1, 0x44),
        ("EL2008", Direction::Outputs, 0x0F00, 1, 0x44),
        ("EK1101", Direction::Inputs, 0x1000, 2, 0x00),
    ];
    for (name, direction, start, len, control) in table {
        let built = build(name, 1, &mut Signals::default()).unwrap();
        let profile = DeviceProfile::from_sii(&Image::parse(&built[0].sii).unwrap());
        assert!(profile.mailbox.is_none() && profile.device_emulation, "{name}");
        let [manager] = profile.process[..] else { panic!("{name}: {profile:?}") };
        assert_eq!((manager.index, manager.direction), (0, direction), "{name}");
        assert_eq!((manager.start.0, manager.len, manager.control.0), (start, len, control));
    }
}

#[test]
fn profiles_of_devices_with_a_processor() {
    // type, bytes of outputs, bytes of inputs, protocols of the mailbox
    let table = [
        ("EL2014", 1, 3, 0x0C),
        ("EL3004", 0, 16, 0x0C),
        ("EL3102", 0, 8, 0x0C),
        ("EL3104", 0, 16, 0x0C),
        ("EL3154", 0, 16, 0x0C),
        ("EL3162", 0, 8, 0x0C),
        ("EL4004", 8, 0, 0x0C),
        ("EL4102", 4, 0, 0x0C),
        ("EL4112", 4, 0, 0x0C),
        ("EL6601", 0, 0, 0x0E),
        ("EL6614", 0, 0, 0x0E),
        ("EL6688", 0, 22, 0x0E),
        ("EL6692", 0, 2, 0x2F),
        ("EL6695", 0, 2, 0x2F),
        ("EL7041", 8, 8, 0x0C),
        ("EP4174", 8, 0, 0x0C),
        ("EK1914", 8, 8, 0x0C),
        ("AX5103", 6, 6, 0x18),
        ("CiA402", 12, 14, 0x0C),
        ("Analog", 8, 16, 0x0C),
    ];
    for (name, outputs, inputs, protocols) in table {
        let built = build(name, 1, &mut Signals::default()).unwrap();
        let image = Image::parse(&built[0].sii).unwrap();
        let profile = DeviceProfile::from_sii(&image);
        assert_eq!(profile.process_len(Direction::Outputs), outputs, "{name}");
        assert_eq!(profile.process_len(Direction::Inputs), inputs, "{name}");
        let mailbox = profile.mailbox.unwrap();
        let size = match name {
            "EL6601" | "EL6614" | "EL6688" | "EL6695" => 1_024,
            "EK1914" | "EL6692" | "CiA402" => 256,
            _ => 128,
        };
        let start = if name == "AX5103" { 0x1800 } else { 0x1000 };
        assert_eq!(mailbox.areas.receive.offset.0, start, "{name}");
        assert_eq!((mailbox.areas.receive.size, mailbox.areas.send.size), (size, size), "{name}");
        let old = ["EL3004", "EL3102", "EL3162", "EK1914", "AX5103"].contains(&name);
        assert_eq!(mailbox.complete_access, !old, "{name}");
        assert_eq!(mailbox.protocols.0, protocols, "{name}");
        assert!(!profile.device_emulation, "{name}");
        for manager in &profile.process {
            let record = image.sync_managers()[usize::from(manager.index)];
            assert_eq!(record.length, manager.len, "{name}: default length");
        }
        let kinds: Vec<_> = image.sync_managers().iter().map(|record| record.kind).collect();
        let expected = [
            SyncManagerKind::MailboxOut,
            SyncManagerKind::MailboxIn,
            SyncManagerKind::Outputs,
            SyncManagerKind::Inputs,
        ];
        assert_eq!(kinds, expected, "{name}");
    }
}

#[test]
fn every_type_comes_up_and_exchanges_process_data() {
    for known in types() {
        let mut signals = Signals::default();
        for built in build(known.name(), 7, &mut signals).unwrap() {
            let mut device = Device::new(built, signals.clone());
            device.bring_up();
            device.exchange_some();
        }
    }
}

#[test]
fn another_revision_shows_in_identity_and_dictionary() {
    let mut signals = Signals::default();
    let built = build_revision("EL3104", Some(0x0015_0000), 7, &mut signals).unwrap().remove(0);
    assert_eq!(Image::parse(&built.sii).unwrap().identity.revision, 0x0015_0000);
    let mut device = Device::new(built, signals);
    device.enter_preop();
    assert_eq!(device.upload(0x1018, 3), Ok(vec![0, 0, 0x15, 0]));
}

// proves: ESC-11, JCT-01, JCT-10
#[test]
fn couplers_and_junctions_have_the_ports_of_their_data_sheets() {
    use Port::{A, B, C, D};
    let table: [(&str, &[&[Port]]); 14] = [
        ("EL1008", &[&[A, B]]),
        ("EL3104", &[&[A, B]]),
        ("EK1100", &[&[A, B, C]]),
        ("EK1101", &[&[A, B, C]]),
        ("EK1110", &[&[A, B]]),
        ("EK1121-0010", &[&[A, C, D]]),
        ("EK1521", &[&[A, C, D]]),
        ("EK1561", &[&[A, C, D]]),
        ("EK1122", &[&[A, B, C, D]]),
        ("EP1122-0001", &[&[A, B, C, D]]),
        ("CU2508", &[&[A, B]]),
        ("CU1123", &[&[A, B, C]]),
        ("CU1124", &[&[A, B, C, D]]),
        ("CU1128", &[&[A, B, C, D], &[A, B, C, D], &[A, B, C, D]]),
    ];
    for (name, expected) in table {
        let found = find(name).unwrap();
        let present = |ports: &PortMap<PortKind>| -> Vec<Port> {
            ports
                .iter()
                .filter(|(_, kind)| **kind != PortKind::Absent)
                .map(|(port, _)| port)
                .collect()
        };
        let ports: Vec<Vec<Port>> = found.ports().map(|ports| present(&ports)).collect();
        assert_eq!(ports, expected, "{name}");
    }
}

#[test]
fn a_junction_of_eight_ports_is_three_controllers() {
    let junction = find("CU1128").unwrap();
    assert_eq!(junction.ports().count(), 3);
    let copper: usize = junction
        .ports()
        .map(|ports| {
            ports.iter().filter(|(_, kind)| **kind == crate::hardware::PortKind::Mii).count()
        })
        .sum();
    assert_eq!(copper, 8);
    for link in junction.inner_links() {
        let ports: Vec<_> = junction.ports().collect();
        for (controller, port) in [link.from, link.to] {
            assert_eq!(ports[controller][port], crate::hardware::PortKind::Ebus);
        }
    }
}

/// Real images, when they are there: categories, SyncManagers and PDOs are to be the same.
#[test]
fn images_are_built_like_those_of_real_devices() {
    let Some(folder) = real_images() else { return };
    for (name, file) in [("EK1100", "ec-EK1100.bin"), ("EL2004", "ec-EL2004.bin")] {
        let bytes = read(&folder, file);
        let real = Image::parse(&bytes).unwrap();
        let built = build(name, 0, &mut Signals::default()).unwrap().remove(0);
        let ours = Image::parse(&built.sii).unwrap();
        assert_eq!(ours.identity.product_code, real.identity.product_code, "{name}");
        assert_eq!(ours.configuration, real.configuration, "{name}");
        assert_eq!(ours.order(), real.order(), "{name}");
        assert_eq!(ours.group(), real.group(), "{name}");
        assert_eq!(ours.ebus_current_ma(), real.ebus_current_ma(), "{name}");
        assert_eq!(ours.general().map(|g| g.ports), real.general().map(|g| g.ports), "{name}");
        let managers = |image: &Image| {
            let records = image.sync_managers().iter();
            records.map(|r| (r.start, r.control, r.enable, r.kind)).collect::<Vec<_>>()
        };
        assert_eq!(managers(&ours), managers(&real), "{name}");
        let outputs = |image: &Image| {
            let pdos = image.pdos(Direction::Outputs);
            pdos.map(|pdo| {
                let entries = pdo.entries.iter();
                let entries = entries.map(|e| (e.index, e.subindex, e.data_type_code, e.bits));
                (pdo.index, pdo.sync_manager, pdo.flags, entries.collect::<Vec<_>>())
            })
            .collect::<Vec<_>>()
        };
        assert_eq!(outputs(&ours), outputs(&real), "{name}");
        assert_eq!(
            DeviceProfile::from_sii(&ours).process.len(),
            DeviceProfile::from_sii(&real).process.len()
        );
    }
}

/// The folder with real images; says so when it is not there.
#[allow(clippy::disallowed_methods, clippy::disallowed_macros)]
fn real_images() -> Option<std::path::PathBuf> {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    let data = std::env::var("LINESMAN_DATA").unwrap_or(format!("{root}/../shared/data"));
    let folder = std::path::Path::new(&data).join("sii");
    if folder.join("ec-EK1100.bin").exists() {
        return Some(folder);
    }
    eprintln!("SKIPPED: no SII images in {}; set LINESMAN_DATA", folder.display());
    None
}

#[allow(clippy::disallowed_methods)]
fn read(folder: &std::path::Path, file: &str) -> Vec<u8> {
    std::fs::read(folder.join(file)).unwrap()
}
