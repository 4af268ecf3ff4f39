//! The objects of a type, made from its tables.
//!
//! Read first: ETG.1000.6, object dictionary; ETG.5001 for the ranges 0x6000 (inputs), 0x7000
//! (outputs), 0x8000 (settings).

use linesman_proto::mailbox::coe::information::{Access, ObjectCode};
use linesman_proto::mailbox::coe::{DataType, ObjectIndex};
use linesman_proto::sii::SyncManagerKind;

use super::image::sync_manager_kind;
use super::spec::{
    COE_WITH_PDO_CONFIGURATION, EntrySpec, Function, PdoSpec, ProcessorSpec, Rights, SettingsSpec,
    Spec, VariableSpec,
};
use super::synchronisation::{Clocked, synchronisation};
use crate::device::application::bridge;
use crate::device::dictionary::{Dictionary, Entry, Object, READ_ONLY, READ_WRITE, special};
use crate::device::history;
use crate::device::mailbox::soe::parameter::{NOTES, NOTES_LEN};

/// Device type of modular devices (ETG.5001).
const MODULAR_DEVICE: u64 = 0x0000_1389;
/// Device type of servo drives (CiA 402).
const SERVO_DRIVE: u64 = 0x0002_0192;
/// How many messages the diagnosis history keeps.
const HISTORY_ROOM: u8 = 16;
/// Data type of a PDO mapping.
pub(in crate::device) const PDO_MAPPING: DataType = DataType(0x0021);
/// Data type of the identity.
pub(in crate::device) const IDENTITY: DataType = DataType(0x0023);
/// Data type of a record that is none of the others.
pub(in crate::device) const RECORD: DataType = DataType(0x002A);
/// Readable always, writable in PREOP.
pub(in crate::device) const SET_UP: Access = Access(READ_ONLY.0 | Access::WRITE_PRE_OP);
/// A setting that is kept for a replacement.
const SETTING: Access = Access(READ_WRITE.0 | Access::BACKUP | Access::SETTING);

/// Who it is, beyond its type.
#[derive(Clone, Copy, Debug)]
pub(super) struct Individual {
    pub(super) revision: u32,
    pub(super) serial: u32,
}

/// All objects of a device with a processor.
pub(super) fn dictionary(
    spec: &Spec,
    processor: &ProcessorSpec,
    individual: Individual,
) -> Dictionary {
    let mut objects = about(spec, processor, individual);
    objects.extend(processor.variables.iter().map(variable));
    if let Function::Bridge { values } = processor.function {
        objects.push(crossing(bridge::OUTPUTS, "IO Outputs", Access::RX_PDO, values));
        objects.push(crossing(bridge::INPUTS, "IO Inputs", Access::TX_PDO, values));
    }
    if let Function::Sercos = processor.function {
        objects.push(notes());
    }
    for pdo in spec.pdos {
        for channel in 0..pdo.channels {
            objects.push(mapping(spec, pdo, channel));
            values(pdo, channel, &mut objects);
        }
    }
    objects.push(sync_manager_types(spec));
    let outputs = spec.pdos.iter().any(PdoSpec::is_output);
    for sync_manager in [2, 3] {
        objects.push(assignment(spec, sync_manager));
        objects.push(synchronisation(sync_manager, clocked(spec), outputs));
    }
    for settings in processor.settings {
        objects.extend((0..settings.channels).map(|channel| setting(settings, channel)));
    }
    objects.extend([error_settings(), history::object(HISTORY_ROOM), timestamp(), restore()]);
    if processor.function.is_drive() {
        return Dictionary::new(objects, spec.coe.complete_access());
    }
    let profile = vec![
        Entry::number(1, "Index distance", DataType::UINT, 16, READ_ONLY, 0x10),
        Entry::number(2, "Maximum number of modules", DataType::UINT, 16, READ_ONLY, 1),
    ];
    objects.push(record(0xF000, "Modular device profile", RECORD, profile));
    let code_word = Entry::number(0, "Code word", DataType::UDINT, 32, READ_WRITE, 0);
    objects.push(Object::variable(ObjectIndex(0xF008), code_word));
    Dictionary::new(objects, spec.coe.complete_access())
}

/// Values that cross a bridge.
fn crossing(index: u16, name: &str, direction: u16, values: u8) -> Object {
    let access = Access(READ_ONLY.0 | direction);
    let entry = |subindex| {
        Entry::number(subindex, &subindex_name(subindex), DataType::UDINT, 32, access, 0)
    };
    let entries = (1..=values).map(entry).collect();
    Object::list(ObjectIndex(index), name, ObjectCode::Array, DataType::UDINT, entries)
}

/// Notes in a drive that speaks SoE, which keeps them.
fn notes() -> Object {
    let text = Entry::text("Commissioning notes", "none");
    let entry = Entry { bits: 8 * NOTES_LEN, access: SETTING, ..text };
    Object::variable(ObjectIndex(NOTES.0), entry)
}

/// How devices react to errors. Subindex 1 is kept and has no function; 2 is how many missed events
/// in a row a synchronised device forgives.
fn error_settings() -> Object {
    let word = |subindex, name, data_type, bits, value| {
        Entry::number(subindex, name, data_type, bits, READ_WRITE, value)
    };
    let entries = vec![
        word(1, "Local error reaction", DataType::UDINT, 32, 1),
        word(2, "Sync error counter limit", DataType::UINT, 16, 4),
    ];
    record(0x10F1, "Error settings", DataType(0x0281), entries)
}

fn timestamp() -> Object {
    let entry = Entry::number(0, "Timestamp object", DataType::ULINT, 64, READ_ONLY, 0);
    Object::variable(ObjectIndex(0x10F8), entry)
}

fn restore() -> Object {
    let entry =
        Entry::number(1, "Restore all default parameters", DataType::UDINT, 32, READ_WRITE, 1);
    let index = special::RESTORE_SETTINGS;
    Object::list(
        index,
        "Restore default parameters",
        ObjectCode::Array,
        DataType::UDINT,
        vec![entry],
    )
}

/// An object of several entries of different types.
pub(in crate::device) fn record(
    index: u16,
    name: &str,
    data_type: DataType,
    entries: Vec<Entry>,
) -> Object {
    Object::list(ObjectIndex(index), name, ObjectCode::Record, data_type, entries)
}

fn about(spec: &Spec, processor: &ProcessorSpec, individual: Individual) -> Vec<Object> {
    let number = |subindex, name: &str, value: u32| {
        Entry::number(subindex, name, DataType::UDINT, 32, READ_ONLY, u64::from(value))
    };
    let profile = if processor.function.is_drive() { SERVO_DRIVE } else { MODULAR_DEVICE };
    let device_type = Entry::number(0, "Device type", DataType::UDINT, 32, READ_ONLY, profile);
    let error_register = Entry::number(0, "Error register", DataType::USINT, 8, READ_ONLY, 0);
    let identity = vec![
        number(1, "Vendor ID", spec.vendor),
        number(2, "Product code", spec.product),
        number(3, "Revision", individual.revision),
        number(4, "Serial number", individual.serial),
    ];
    vec![
        Object::variable(ObjectIndex::DEVICE_TYPE, device_type),
        Object::variable(ObjectIndex::ERROR_REGISTER, error_register),
        Object::variable(ObjectIndex::DEVICE_NAME, Entry::text("Device name", spec.name)),
        Object::variable(
            ObjectIndex::HARDWARE_VERSION,
            Entry::text("Hardware version", processor.hardware_version),
        ),
        Object::variable(
            ObjectIndex::SOFTWARE_VERSION,
            Entry::text("Software version", processor.software_version),
        ),
        record(ObjectIndex::IDENTITY.0, "Identity", IDENTITY, identity),
    ]
}

/// The name of a channel's PDO or settings.
pub(super) fn channel_name(name: &str, channel: u8, channels: u8) -> String {
    if channels > 1 { format!("{name} {}", channel + 1) } else { name.to_owned() }
}

/// The name of a subindex that has no other.
pub(in crate::device) fn subindex_name(subindex: u8) -> String {
    format!("SubIndex {subindex:03}")
}

/// Entries that a PDO has room for where its mapping can be changed.
const MAPPING_ROOM: usize = 8;
/// The same of a PDO that is empty after power-on: all that it maps the MainDevice has to say.
const EMPTY_MAPPING_ROOM: usize = 250;

fn mapping(spec: &Spec, pdo: &PdoSpec, channel: u8) -> Object {
    let changeable = spec.coe == COE_WITH_PDO_CONFIGURATION;
    let access = if changeable { SET_UP } else { READ_ONLY };
    let free = match (changeable, pdo.entries.is_empty()) {
        (true, true) => EMPTY_MAPPING_ROOM,
        (true, false) => MAPPING_ROOM,
        (false, _) => 0,
    };
    let room = free.max(pdo.entries.len());
    let entries = (1..=u8::MAX).take(room).map(|subindex| {
        let value = pdo.entries.get(usize::from(subindex) - 1).map_or(0, |entry| {
            let index = u64::from(entry.index_of(channel));
            index << 16 | u64::from(entry.subindex) << 8 | u64::from(entry.bits)
        });
        Entry::number(subindex, &subindex_name(subindex), DataType::UDINT, 32, access, value)
    });
    let entries = entries.collect();
    let kind = if pdo.is_output() { "RxPDO-Map" } else { "TxPDO-Map" };
    let name = format!("{} {kind}", channel_name(pdo.name, channel, pdo.channels));
    let mut object = record(pdo.index_of(channel), &name, PDO_MAPPING, entries);
    if let Some(count) = object.entries.first_mut() {
        count.value = vec![pdo.entries.len() as u8];
        count.access = access;
    }
    object
}

/// An object with one value.
pub(super) fn variable(spec: &VariableSpec) -> Object {
    let access = match spec.rights {
        Rights::Read => READ_ONLY,
        Rights::Input => Access(READ_ONLY.0 | Access::TX_PDO),
        Rights::Output => Access(READ_WRITE.0 | Access::RX_PDO),
        Rights::Setting => SETTING,
    };
    let (bits, value) = (u16::from(spec.bits), u64::from(spec.default));
    let entry = Entry::number(0, spec.name, spec.data_type, bits, access, value);
    Object::variable(ObjectIndex(spec.index), entry)
}

/// The objects that a PDO maps, added to those that others have mapped already.
fn values(pdo: &PdoSpec, channel: u8, objects: &mut Vec<Object>) {
    let direction = if pdo.is_output() { Access::RX_PDO } else { Access::TX_PDO };
    for entry in pdo.entries.iter().filter(|entry| entry.index != 0) {
        let index = ObjectIndex(entry.index_of(channel));
        let value = value(entry, Access(READ_ONLY.0 | direction));
        match objects.iter_mut().find(|object| object.index == index) {
            Some(object) => insert(object, value),
            None if entry.subindex == 0 => objects.push(Object::variable(index, value)),
            None => {
                let name = channel_name(pdo.name, channel, pdo.channels);
                objects.push(record(index.0, &name, RECORD, vec![value]));
            }
        }
    }
}

fn value(entry: &EntrySpec, access: Access) -> Entry {
    let bits = u16::from(entry.bits);
    Entry::number(entry.subindex, entry.name, entry.data_type, bits, access, 0)
}

/// Puts an entry where it belongs; one that is there already stays.
pub(in crate::device) fn insert(object: &mut Object, entry: Entry) {
    let place = object.entries.binary_search_by_key(&entry.subindex, |entry| entry.subindex);
    let Err(at) = place else { return };
    object.entries.insert(at, entry);
    let last = object.entries.last().map_or(0, |entry| entry.subindex);
    if let Some(count) = object.entries.first_mut() {
        count.value = vec![last];
    }
}

fn sync_manager_types(spec: &Spec) -> Object {
    let kinds = (1..).zip(spec.sync_managers).map(|(subindex, manager)| {
        let kind: SyncManagerKind = sync_manager_kind(manager.kind);
        let name = subindex_name(subindex);
        Entry::number(subindex, &name, DataType::USINT, 8, READ_ONLY, u64::from(kind.code()))
    });
    let kinds = kinds.collect();
    let index = ObjectIndex::SYNC_MANAGER_TYPES;
    Object::list(index, "Sync manager type", ObjectCode::Array, DataType::USINT, kinds)
}

/// The PDOs of a SyncManager: room for all that there are, those of the defaults assigned.
fn assignment(spec: &Spec, sync_manager: u8) -> Object {
    let outputs = sync_manager == 2;
    let all = spec.pdos.iter().filter(|pdo| pdo.is_output() == outputs);
    let room: usize = all.clone().map(|pdo| usize::from(pdo.channels)).sum();
    let assigned: Vec<u16> = all
        .filter(|pdo| pdo.sync_manager == Some(sync_manager))
        .flat_map(|pdo| (0..pdo.channels).map(|channel| pdo.index_of(channel)))
        .collect();
    let pdos = (1..=u8::MAX).take(room).map(|subindex| {
        let pdo = assigned.get(usize::from(subindex) - 1).copied().unwrap_or(0);
        let name = subindex_name(subindex);
        Entry::number(subindex, &name, DataType::UINT, 16, SET_UP, u64::from(pdo))
    });
    let name = if outputs { "RxPDO assign" } else { "TxPDO assign" };
    let index = ObjectIndex(0x1C10 + u16::from(sync_manager));
    let mut object = Object::list(index, name, ObjectCode::Array, DataType::UINT, pdos.collect());
    if let Some(count) = object.entries.first_mut() {
        count.value = vec![assigned.len() as u8];
        count.access = SET_UP;
    }
    object
}

/// Which SYNC signals its operation modes switch on.
fn clocked(spec: &Spec) -> Clocked {
    Clocked::of(spec.op_modes.iter().map(|mode| mode.assign_activate))
}

pub(super) fn setting(settings: &SettingsSpec, channel: u8) -> Object {
    let entries = settings.entries.iter().map(|entry| Entry {
        maximum: entry.maximum,
        ..Entry::number(
            entry.subindex,
            entry.name,
            entry.data_type,
            u16::from(entry.bits),
            SETTING,
            u64::from(entry.default),
        )
    });
    let name = channel_name(settings.name, channel, settings.channels);
    record(settings.index + 0x10 * u16::from(channel), &name, RECORD, entries.collect())
}
