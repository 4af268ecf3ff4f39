//! The objects of the MainDevice itself: what is planned, found and counted, at address 0.
//!
//! Reference: ETG.1510. Of these nothing can be written (`commands` has those that can). SubDevice n of the plan, from 0, has the objects 0x8000 + n
//! (configuration), 0x9000 + n (what was found; only while it is there) and 0xA000 + n (state and counters). Only what
//! this program knows has an entry; entries in between that it does not know are left out.

use linesman_config::plan::configuration_object;
use linesman_proto::mailbox::coe::information::ObjectCode;
use linesman_proto::mailbox::coe::{DataType, ObjectIndex};
use linesman_proto::state::AlState;
use linesman_sim::device::dictionary::{Dictionary, Entry, Object, READ_ONLY};

use super::commands::ObjectCommands;
use crate::online::report::{Count, OnlineDevice, OnlineIdentity, OnlinePort, OnlineReport};

/// SubDevices that have objects: there are 0x1000 indices of each kind.
const MOST: usize = 0x1000;
/// Addresses in one list.
const PER_LIST: usize = 255;
/// Lists of addresses of each kind.
const LISTS: usize = 16;
/// Bytes of the type of a SubDevice.
const TYPE_LEN: usize = 16;
/// Bytes of its name.
const NAME_LEN: usize = 32;
/// Device type of modular devices: their profile, ETG.5001.
const MODULAR: u64 = 5001;
/// Types of SyncManagers, as object 0x1C00 has them.
const MAILBOX_OUT: u64 = 1;
const MAILBOX_IN: u64 = 2;

/// The dictionary of a network as it is now, and of what clients have written.
pub(super) fn dictionary(report: &OnlineReport, commands: &ObjectCommands) -> Dictionary {
    let mut objects = fixed();
    objects.extend(commands.objects());
    let devices = report.devices.get(..MOST).unwrap_or(&report.devices);
    for (device, number) in devices.iter().zip(0..) {
        objects
            .extend(configuration_object(number.into()).map(|index| configuration(index, device)));
        if let (Some(found), Some(true)) = (&device.found, device.present) {
            objects.push(information(0x9000 + number, device, found));
        }
        objects.push(diagnosis(0xA000 + number, device));
    }
    objects.push(record(
        0xF000,
        "Modular device profile",
        vec![uint(1, "Index distance", 1), uint(2, "Maximum number of modules", MOST as u64)],
    ));
    let planned: Vec<u16> = devices.iter().map(|device| device.station).collect();
    let found = devices.iter().filter(|device| device.present == Some(true));
    let found: Vec<u16> = found.map(|device| device.station).collect();
    objects.extend(lists(0xF020, "Configured address list", &planned));
    objects.extend(lists(0xF040, "Detected address list", &found));
    objects.push(network(report));
    Dictionary::new(objects, true)
}

/// What does not depend on the network.
fn fixed() -> Vec<Object> {
    let device_type = udint(0, "Device type", MODULAR);
    vec![
        Object::variable(ObjectIndex::DEVICE_TYPE, device_type),
        Object::variable(ObjectIndex::DEVICE_NAME, Entry::text("Device name", "Linesman")),
        Object::variable(
            ObjectIndex::SOFTWARE_VERSION,
            Entry::text("Software version", env!("CARGO_PKG_VERSION")),
        ),
        // Nobody has given this program numbers.
        record(
            ObjectIndex::IDENTITY.0,
            "Identity",
            vec![
                udint(1, "Vendor ID", 0),
                udint(2, "Product code", 0),
                udint(3, "Revision number", 0),
                udint(4, "Serial number", 0),
            ],
        ),
        // It has a mailbox each way and no process data of its own.
        Object::list(
            ObjectIndex(0x1C00),
            "Sync manager type",
            ObjectCode::Array,
            DataType::USINT,
            vec![usint(1, "Mailbox out", MAILBOX_OUT), usint(2, "Mailbox in", MAILBOX_IN)],
        ),
    ]
}

fn configuration(index: u16, device: &OnlineDevice) -> Object {
    let planned = device.planned.unwrap_or_default();
    let (out, into) =
        device.mailbox.as_ref().map_or((0, 0), |mailbox| (mailbox.out_size, mailbox.in_size));
    let mut entries = vec![
        uint(1, "Fixed station address", device.station.into()),
        text(2, "Type", &device.r#type, TYPE_LEN),
        text(3, "Name", &device.name, NAME_LEN),
        // It stands in object 0x1000 of the SubDevice, which nobody has read; without it what follows would lie
        // elsewhere in an upload of the whole.
        udint(4, "Device type", 0),
    ];
    entries.extend(identity(&planned));
    entries.extend([
        uint(33, "Mailbox out size", out.into()),
        uint(34, "Mailbox in size", into.into()),
        usint(35, "Link status", u64::from(device.state.word >> 8)),
        usint(36, "Link preset", link_preset(&device.ports)),
    ]);
    record(index, "SubDevice configuration", entries)
}

fn identity(of: &OnlineIdentity) -> [Entry; 4] {
    [
        udint(5, "Vendor ID", of.vendor_id.into()),
        udint(6, "Product code", of.product_code.into()),
        udint(7, "Revision number", of.revision.into()),
        udint(8, "Serial number", of.serial.into()),
    ]
}

/// Which of the ports 1 to 3 are planned to lead to a SubDevice: bits 0 to 2, and as much of a link: bits 4 to 6.
fn link_preset(ports: &[OnlinePort]) -> u64 {
    let planned = ports.iter().skip(1).zip(0_u32..3).filter(|(port, _)| port.to.is_some());
    planned.fold(0, |preset, (_, bit)| preset | 0x11 << bit)
}

fn information(index: u16, device: &OnlineDevice, found: &OnlineIdentity) -> Object {
    let mut entries = vec![uint(1, "Fixed station address", device.station.into())];
    entries.extend(identity(found));
    entries.push(uint(32, "DL status", device.dl_status.unwrap_or(0).into()));
    record(index, "SubDevice information", entries)
}

fn diagnosis(index: u16, device: &OnlineDevice) -> Object {
    let error = if device.al_error { u64::from(AL_ERROR) } else { 0 };
    let status = device.al_state.as_deref().map_or(0, |state| al_state(state) | error);
    let control = device.target.as_deref().map_or(0, al_state);
    let mut entries = vec![
        uint(1, "AL status", status),
        uint(2, "AL control", control),
        uint(3, "AL status code", device.al_code.into()),
        usint(4, "Link connection status", link_status(&device.ports)),
        // The loop control of the ports is not read back; clients that upload the whole count on its byte.
        usint(5, "Link control", 0),
    ];
    for (port, subindex) in device.ports.iter().take(4).zip(6..) {
        let station = port.to.as_ref().map_or(0, |to| to.station);
        let name = format!("Fixed address connected to port {}", subindex - 6);
        entries.push(uint(subindex, &name, station.into()));
    }
    for (port, subindex) in device.ports.iter().take(4).zip(10..) {
        let name = format!("Frame error counter port {}", subindex - 10);
        entries.push(udint(subindex, &name, total(port.invalid_frames)));
    }
    entries.extend([
        udint(15, "Not present counter", device.presence_changes.saturating_sub(1)),
        udint(16, "Abnormal state change counter", device.abnormal_changes),
    ]);
    record(index, "SubDevice diagnosis", entries)
}

/// The error bit of AL status.
const AL_ERROR: u8 = 0x10;

/// A state by its name; 0 for one that has none.
fn al_state(name: &str) -> u64 {
    let all = [AlState::Init, AlState::PreOp, AlState::Boot, AlState::SafeOp, AlState::Op];
    let found = all.into_iter().find(|state| state.to_string() == name);
    found.map_or(0, |state| state.bits().into())
}

/// Ports that communicate (bits 0 to 3), and that have a link (bits 4 to 7).
fn link_status(ports: &[OnlinePort]) -> u64 {
    let bit = |set: Option<bool>, bit: u32| u64::from(set == Some(true)) << bit;
    let ports = ports.iter().take(4).zip(0..);
    ports
        .fold(0, |status, (port, at)| status | bit(port.communication, at) | bit(port.link, at + 4))
}

fn total(count: Option<Count>) -> u64 {
    count.map_or(0, |count| count.total)
}

fn network(report: &OnlineReport) -> Object {
    let rate = |rate: Option<f64>| rate.map_or(0, |rate| rate.round() as u64);
    record(
        0xF120,
        "Diagnosis data",
        vec![
            udint(1, "Cyclic lost frames", report.cyclic.lost),
            udint(2, "Acyclic lost frames", report.queued.lost),
            udint(3, "Cyclic frames per second", rate(report.cyclic.per_second)),
            udint(4, "Acyclic frames per second", rate(report.queued.per_second)),
            uint(16, "MainDevice state", report.state.word.into()),
        ],
    )
}

/// Addresses, 255 in each object; the first is there also when there are none.
fn lists(index: u16, name: &str, stations: &[u16]) -> Vec<Object> {
    let count = stations.len().div_ceil(PER_LIST).clamp(1, LISTS);
    let list = |at: usize| {
        let stations = stations.iter().skip(at * PER_LIST).take(PER_LIST);
        let entries = stations.zip(1..=u8::MAX).map(|(station, subindex)| {
            uint(subindex, &format!("Address {subindex}"), (*station).into())
        });
        let index = ObjectIndex(index + at as u16);
        Object::list(index, name, ObjectCode::Array, DataType::UINT, entries.collect())
    };
    (0..count).map(list).collect()
}

/// The type number of a record that no table describes: that of records of entries in general.
const RECORD: DataType = DataType(0x0021);

pub(super) fn record(index: u16, name: &str, entries: Vec<Entry>) -> Object {
    Object::list(ObjectIndex(index), name, ObjectCode::Record, RECORD, entries)
}

fn usint(subindex: u8, name: &str, value: u64) -> Entry {
    Entry::number(subindex, name, DataType::USINT, 8, READ_ONLY, value.min(u8::MAX.into()))
}

fn uint(subindex: u8, name: &str, value: u64) -> Entry {
    Entry::number(subindex, name, DataType::UINT, 16, READ_ONLY, value.min(u16::MAX.into()))
}

/// Counts stop at the greatest value.
fn udint(subindex: u8, name: &str, value: u64) -> Entry {
    Entry::number(subindex, name, DataType::UDINT, 32, READ_ONLY, value.min(u32::MAX.into()))
}

/// A text of this many bytes, filled up with zeros; a longer one is cut between two letters.
fn text(subindex: u8, name: &str, value: &str, len: usize) -> Entry {
    let end = value.floor_char_boundary(len);
    let mut bytes = value.as_bytes().get(..end).unwrap_or_default().to_vec();
    bytes.resize(len, 0);
    Entry { subindex, bits: (len * 8) as u16, value: bytes, ..Entry::text(name, "") }
}

#[cfg(test)]
mod tests {
    use linesman_proto::mailbox::coe::ObjectAddress;
    use linesman_proto::mailbox::coe::information::ListKind;

    use super::*;
    use crate::online::report::{FrameCounts, Neighbour, OnlineMailbox, Word};

    fn device(no: u32, present: bool) -> OnlineDevice {
        let port = |name: &str, to: Option<u32>| OnlinePort {
            port: name.to_owned(),
            link: Some(present),
            communication: Some(present && name != "D"),
            to: to.map(|no| Neighbour { no, station: 0x1000 + no as u16, ..Neighbour::default() }),
            invalid_frames: Some(Count { register: 3, total: 300 }),
            ..OnlinePort::default()
        };
        let identity = OnlineIdentity { vendor_id: 2, product_code: 7, revision: 9, serial: no };
        OnlineDevice {
            no,
            name: "a name of more than thirty-two letters".to_owned(),
            r#type: "EL3104".to_owned(),
            station: 0x1000 + no as u16,
            present: Some(present),
            state: Word { word: 0x4418, text: String::new() },
            al_state: present.then(|| "OP".to_owned()),
            al_error: present,
            al_code: 0x1B,
            target: Some("OP".to_owned()),
            planned: Some(identity),
            found: present.then_some(identity),
            dl_status: present.then_some(0x5A37),
            ports: vec![port("A", None), port("B", Some(no + 1)), port("C", None), port("D", None)],
            abnormal_changes: 4,
            presence_changes: 3,
            mailbox: Some(OnlineMailbox {
                out_size: 128,
                in_size: 256,
                ..OnlineMailbox::default()
            }),
            ..OnlineDevice::default()
        }
    }

    fn report(devices: Vec<OnlineDevice>) -> OnlineReport {
        let counts = |lost, rate| FrameCounts { sent: 9, lost, per_second: Some(rate) };
        OnlineReport {
            state: Word { word: 0x0123, text: String::new() },
            devices,
            cyclic: counts(5, 999.6),
            queued: counts(u64::MAX, 12.2),
            ..OnlineReport::default()
        }
    }

    fn dictionary(report: &OnlineReport) -> Dictionary {
        super::dictionary(report, &ObjectCommands::default())
    }

    fn number(dictionary: &Dictionary, index: u16, subindex: u8) -> u64 {
        let data = dictionary.upload(ObjectAddress::new(index, subindex), AlState::Op);
        data.unwrap().iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte))
    }

    #[test]
    fn subdevices_have_configuration_identity_and_diagnosis() {
        let dictionary = dictionary(&report(vec![device(1, true), device(2, false)]));
        let number = |index, subindex| number(&dictionary, index, subindex);
        assert_eq!((number(0x8001, 1), number(0x8001, 8)), (0x1002, 2));
        assert_eq!((number(0x8000, 33), number(0x8000, 34)), (128, 256));
        assert_eq!((number(0x8000, 35), number(0x8000, 36)), (0x44, 0x11));
        assert_eq!((number(0x9000, 5), number(0x9000, 32)), (2, 0x5A37));
        assert_eq!((number(0xA000, 1), number(0xA000, 2), number(0xA000, 3)), (0x18, 8, 0x1B));
        assert_eq!((number(0xA000, 4), number(0xA000, 7), number(0xA000, 10)), (0xF7, 0x1002, 300));
        assert_eq!((number(0xA000, 15), number(0xA000, 16)), (2, 4));
        // One that is not there has no object of what was found, and no state.
        assert!(dictionary.object(ObjectIndex(0x9001)).is_none());
        assert_eq!(number(0xA001, 1), 0);
        assert_eq!((number(0xF020, 0), number(0xF020, 2)), (2, 0x1002));
        assert_eq!((number(0xF040, 0), number(0xF040, 1)), (1, 0x1001));
        assert_eq!((number(0xF120, 1), number(0xF120, 2)), (5, 0xFFFF_FFFF));
        assert_eq!((number(0xF120, 3), number(0xF120, 16)), (1_000, 0x0123));
        assert_eq!([0, 1, 2].map(|at| number(0x1C00, at)), [2, 1, 2]);
    }

    // The structures ST_EcSlaveConfigData and ST_EcSlaveScannedData of PLC libraries: 80 and 22 bytes, the first with
    // three bytes of padding (facts 2.1).
    #[test]
    fn whole_objects_lie_as_plc_libraries_expect_them() {
        let dictionary = dictionary(&report(vec![device(1, true)]));
        let whole = |index| dictionary.upload_all(ObjectAddress::new(index, 0), AlState::Op);
        let configuration = whole(0x8000).unwrap();
        assert!((77..=80).contains(&configuration.len()), "{}", configuration.len());
        assert_eq!(configuration[..4], [36, 0, 0x01, 0x10]);
        assert_eq!(&configuration[4..12], b"EL3104\0\0");
        assert_eq!(&configuration[20..52], b"a name of more than thirty-two l");
        assert_eq!(configuration[56..60], [2, 0, 0, 0]);
        assert_eq!(configuration[72..77], [128, 0, 0, 1, 0x44]);
        let information = whole(0x9000).unwrap();
        assert_eq!(information.len(), 22);
        assert_eq!(information[20..], [0x37, 0x5A]);
    }

    #[test]
    fn long_lines_have_several_lists_and_nothing_overflows() {
        let devices: Vec<_> = (1..=600).map(|no| device(no, true)).collect();
        let long = dictionary(&report(devices));
        for (index, count) in [(0xF020, 255), (0xF021, 255), (0xF022, 90)] {
            assert_eq!(number(&long, index, 0), count);
        }
        assert_eq!(number(&long, 0xF022, 90), 0x1000 + 600);
        assert!(long.object(ObjectIndex(0xF023)).is_none());
        // Of what has no index of its own there is no object.
        let most = dictionary(&report(vec![OnlineDevice::default(); MOST + 10]));
        assert!(most.list(ListKind::All).all(|index| index.0 < 0x9000 || index.0 >= 0xA000));
        assert_eq!(number(&most, 0xF02F, 0), 255);
        let none = dictionary(&report(Vec::new()));
        assert_eq!(number(&none, 0xF020, 0), 0);
    }
}
