//! The dictionary of a described device.
//!
//! Read first: ETG.1000.6, object dictionary; ETG.5001 for modular devices. What the data describe
//! stands as they describe it. The rest follows from identity and process data: who it is (0x1008,
//! 0x1018), the mapping of each PDO (0x16xx, 0x1Axx), SyncManagers and what is assigned to them
//! (0x1C00, 0x1C1x), their synchronisation (0x1C3x), and the objects that PDOs map.

use linesman_proto::mailbox::coe::information::{Access, ObjectCode};
use linesman_proto::mailbox::coe::{DataType, ObjectIndex};
use linesman_proto::sii::{CoeDetails, Direction, Identity};

use super::DescribedType;
use super::firmware::buffers;
use super::pdo::{DescribedEntry, DescribedPdo};
use crate::device::dictionary::{Dictionary, Entry, Object, READ_ONLY};
use crate::device::library::drive::profile_objects;
use crate::device::library::object::{
    IDENTITY, PDO_MAPPING, RECORD, SET_UP, insert, record, subindex_name,
};
use crate::device::library::synchronisation::{Clocked, synchronisation};
use crate::device::processor::ProcessBuffer;

/// Device type of a drive (CiA 402).
const DRIVE: u64 = 0x0002_0192;
/// Device type of modular devices (ETG.5001).
const MODULAR_DEVICE: u64 = 0x0000_1389;
/// The controlword of a drive.
pub(super) const CONTROLWORD: u16 = 0x6040;
/// Its statusword.
pub(super) const STATUSWORD: u16 = 0x6041;
/// Limits and windows of a drive: where all are 0, as in many descriptions, its axis cannot move.
const LIMITS: [u16; 8] = [0x6065, 0x6066, 0x607F, 0x6081, 0x6083, 0x6084, 0x6085, 0x60C5];
/// How many entries a PDO has room for at least whose entries can be changed.
const ROOM: usize = 32;
/// Most PDOs that one SyncManager can be assigned, as their count is one byte.
const MOST_PDOS: usize = 255;

/// All objects.
pub(super) fn dictionary(described: &DescribedType, identity: Identity) -> Dictionary {
    let coe = described.image.general().map_or(CoeDetails::default(), |general| general.coe);
    let mut objects = described.objects.clone();
    objects.retain(|object| !names_no_mode(object));
    let mut add = |object: Object| {
        if !objects.iter().any(|known| known.index == object.index) {
            objects.push(object);
        }
    };
    for object in about(described) {
        add(object);
    }
    let clocked = Clocked::of(described.image.op_modes().map(|mode| mode.assign_activate));
    let outputs = described.pdos.iter().any(|pdo| pdo.direction == Direction::Outputs);
    for buffer in buffers(described) {
        if matches!(buffer.sync_manager, 2 | 3) {
            add(synchronisation(buffer.sync_manager, clocked, outputs));
        }
    }
    let mut made = vec![identity_object(identity), sync_manager_types(described)];
    for pdo in &described.pdos {
        made.push(mapping(pdo, coe));
    }
    for buffer in buffers(described) {
        made.push(assignment(&described.pdos, buffer, coe));
    }
    objects.retain(|known| !made.iter().any(|object| object.index == known.index));
    objects.extend(made);
    for pdo in &described.pdos {
        values(pdo, &mut objects);
    }
    if described.is_drive() {
        complete_drive(&mut objects);
    }
    Dictionary::new(objects, coe.complete_access())
}

/// Whether these are synchronisation parameters without any mode: some makers leave all of them 0.
fn names_no_mode(object: &Object) -> bool {
    const MODES: u8 = 4;
    matches!(object.index.0, 0x1C32 | 0x1C33)
        && object.entry(MODES).is_none_or(|modes| modes.as_number() == 0)
}

/// What the profile of a drive has and its description lacks.
fn complete_drive(objects: &mut Vec<Object>) {
    for object in profile_objects() {
        match objects.iter_mut().find(|known| known.index == object.index) {
            None => objects.push(object),
            Some(known) if LIMITS.contains(&known.index.0) => {
                let value = object.entry(0).map(|entry| entry.value.clone());
                if let (Some(entry), Some(value)) = (known.entries.first_mut(), value)
                    && entry.as_number() == 0
                    && entry.value.len() == value.len()
                {
                    entry.value = value;
                }
            }
            Some(_) => {}
        }
    }
}

fn about(described: &DescribedType) -> Vec<Object> {
    let number = |name: &str, bits, data_type, value| {
        Entry::number(0, name, data_type, bits, READ_ONLY, value)
    };
    let kind = number("Device type", 32, DataType::UDINT, device_type(&described.pdos));
    let errors = number("Error register", 8, DataType::USINT, 0);
    let text = |index, name: &str, value: &str| Object::variable(index, Entry::text(name, value));
    vec![
        Object::variable(ObjectIndex::DEVICE_TYPE, kind),
        Object::variable(ObjectIndex::ERROR_REGISTER, errors),
        text(ObjectIndex::DEVICE_NAME, "Device name", &described.name),
        text(ObjectIndex::HARDWARE_VERSION, "Hardware version", "1"),
        text(ObjectIndex::SOFTWARE_VERSION, "Software version", "1"),
    ]
}

/// The profile that the objects of the process data belong to.
fn device_type(pdos: &[DescribedPdo]) -> u64 {
    let maps = |wanted: &dyn Fn(&DescribedEntry) -> bool| {
        pdos.iter().flat_map(|pdo| &pdo.entries).any(wanted)
    };
    if maps(&|entry| entry.index == STATUSWORD) {
        DRIVE
    } else if maps(&|entry| (0x6000..0x8000).contains(&entry.index) && entry.subindex > 0) {
        MODULAR_DEVICE
    } else {
        0
    }
}

fn identity_object(identity: Identity) -> Object {
    let number = |subindex, name: &str, value: u32| {
        Entry::number(subindex, name, DataType::UDINT, 32, READ_ONLY, u64::from(value))
    };
    let entries = vec![
        number(1, "Vendor ID", identity.vendor_id),
        number(2, "Product code", identity.product_code),
        number(3, "Revision", identity.revision),
        number(4, "Serial number", identity.serial_number),
    ];
    record(ObjectIndex::IDENTITY.0, "Identity", IDENTITY, entries)
}

fn sync_manager_types(described: &DescribedType) -> Object {
    let kinds = (1u8..).zip(described.image.sync_managers()).map(|(subindex, record)| {
        let (name, kind) = (subindex_name(subindex), u64::from(record.kind.code()));
        Entry::number(subindex, &name, DataType::USINT, 8, READ_ONLY, kind)
    });
    let kinds = kinds.collect();
    let index = ObjectIndex::SYNC_MANAGER_TYPES;
    Object::list(index, "Sync manager type", ObjectCode::Array, DataType::USINT, kinds)
}

/// The mapping of a PDO. Its entries can be changed where neither the PDO is fixed nor the device
/// says that it cannot do that (SII, CoE details, bit 3).
fn mapping(pdo: &DescribedPdo, coe: CoeDetails) -> Object {
    let changeable = !pdo.fixed && coe.pdo_configuration();
    let access = if changeable { SET_UP } else { READ_ONLY };
    let room = if changeable { pdo.entries.len().max(ROOM) } else { pdo.entries.len() };
    let entries = (1u8..=255).take(room).map(|subindex| {
        let value = pdo.entries.get(usize::from(subindex) - 1).map_or(0, mapped);
        Entry::number(subindex, &subindex_name(subindex), DataType::UDINT, 32, access, value)
    });
    let name = match pdo.direction {
        Direction::Outputs => format!("{} RxPDO-Map", pdo.name),
        Direction::Inputs => format!("{} TxPDO-Map", pdo.name),
    };
    let mut object = record(pdo.index, name.trim(), PDO_MAPPING, entries.collect());
    if let Some(count) = object.entries.first_mut() {
        count.access = access;
        count.value = vec![pdo.entries.len().min(255) as u8];
    }
    object
}

/// Index, subindex and bits in one number.
fn mapped(entry: &DescribedEntry) -> u64 {
    let bits = u64::from(entry.bits.min(255));
    u64::from(entry.index) << 16 | u64::from(entry.subindex) << 8 | bits
}

/// The PDOs of a SyncManager: room for all that there are in its direction, those of the data
/// assigned. Whether they can be changed the device says (SII, CoE details, bit 2).
fn assignment(pdos: &[DescribedPdo], buffer: ProcessBuffer, coe: CoeDetails) -> Object {
    let all = || pdos.iter().filter(|pdo| pdo.direction == buffer.direction);
    let room = all().count().min(MOST_PDOS);
    let assigned: Vec<u16> = all()
        .filter(|pdo| pdo.sync_manager == Some(buffer.sync_manager))
        .map(|pdo| pdo.index)
        .take(MOST_PDOS)
        .collect();
    let access = if coe.pdo_assign() { SET_UP } else { READ_ONLY };
    let entries = (1u8..=255).take(room).map(|subindex| {
        let pdo = assigned.get(usize::from(subindex) - 1).copied().unwrap_or(0);
        let name = subindex_name(subindex);
        Entry::number(subindex, &name, DataType::UINT, 16, access, u64::from(pdo))
    });
    let name = match buffer.direction {
        Direction::Outputs => "RxPDO assign",
        Direction::Inputs => "TxPDO assign",
    };
    let (index, entries) = (buffer.assignment(), entries.collect());
    let mut object = Object::list(index, name, ObjectCode::Array, DataType::UINT, entries);
    if let Some(count) = object.entries.first_mut() {
        count.value = vec![assigned.len() as u8];
        count.access = access;
    }
    object
}

/// The objects that a PDO maps, added to those that are there.
fn values(pdo: &DescribedPdo, objects: &mut Vec<Object>) {
    let direction = match pdo.direction {
        Direction::Outputs => Access::RX_PDO,
        Direction::Inputs => Access::TX_PDO,
    };
    for entry in pdo.entries.iter().filter(|entry| !entry.is_padding()) {
        let index = ObjectIndex(entry.index);
        let access = Access(READ_ONLY.0 | direction);
        let data_type = data_type(entry);
        let value = Entry::number(entry.subindex, &entry.name, data_type, entry.bits, access, 0);
        match objects.iter_mut().find(|object| object.index == index) {
            Some(object) => {
                let mut entries = object.entries.iter_mut();
                match entries.find(|known| known.subindex == entry.subindex) {
                    // What a PDO maps can be mapped, whatever the dictionary says of it.
                    Some(known) => known.access.0 |= direction,
                    None => insert(object, value),
                }
            }
            None if entry.subindex == 0 => objects.push(Object::variable(index, value)),
            None => objects.push(record(entry.index, &pdo.name, RECORD, vec![value])),
        }
    }
}

/// Its type; one by its length where nothing is said.
fn data_type(entry: &DescribedEntry) -> DataType {
    if entry.data_type != DataType(0) {
        return entry.data_type;
    }
    match entry.bits {
        1 => DataType::BOOL,
        8 => DataType::USINT,
        16 => DataType::UINT,
        32 => DataType::UDINT,
        64 => DataType::ULINT,
        _ => DataType::OCTET_STRING,
    }
}
