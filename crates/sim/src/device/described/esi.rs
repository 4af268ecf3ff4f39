//! Construction of a device type from the device description of its maker.

use linesman_config::esi::dictionary::Shape;
use linesman_config::esi::image::image;
use linesman_config::esi::{Esi, EsiDevice, EsiObject, EsiObjectEntry, EsiPdo};
use linesman_proto::mailbox::coe::information::ObjectCode;
use linesman_proto::mailbox::coe::{DataType, ObjectIndex};

use super::modules::{self, Fitted};
use super::pdo::{DescribedEntry, DescribedPdo, complete};
use super::{DescribedError, DescribedType, hardware};
use crate::device::dictionary::{Entry, Object};
use crate::device::library::object::RECORD;

/// Why there are no two of these in a housing.
const MOST_CONTROLLERS: usize = 16;

/// The type that a description makes, with these modules in its slots.
pub(super) fn described(
    esi: &Esi,
    device: &EsiDevice,
    slots: Option<&[String]>,
) -> Result<DescribedType, DescribedError> {
    let mut described = one(esi, device, slots)?;
    for (product, revision) in device.sub_devices.iter().take(MOST_CONTROLLERS) {
        let found = esi
            .usable()
            .find(|other| other.product_code == *product && other.revision == *revision);
        let Some(found) = found else {
            let missing = format!("0x{product:08X} revision 0x{revision:08X}");
            return Err(DescribedError::SubDevice(missing));
        };
        described.further.push(one(esi, found, None)?);
    }
    Ok(described)
}

fn one(
    esi: &Esi,
    device: &EsiDevice,
    slots: Option<&[String]>,
) -> Result<DescribedType, DescribedError> {
    if !device.has_controller() {
        return Err(DescribedError::NoController);
    }
    if let Some(file) = device.dictionary_file.as_ref().filter(|_| device.objects.is_empty()) {
        return Err(DescribedError::DictionaryFile(file.clone()));
    }
    let fitted = modules::fit(esi, device, slots)?;
    let mut pdos = assigned(device);
    pdos.extend(fitted.pdos.iter().cloned());
    let whole = device.eeprom.as_ref().and_then(|eeprom| eeprom.image.as_ref());
    if let Some(bytes) = whole {
        return DescribedType::from_sii(bytes).map(|made| with_objects(made, device, &fitted));
    }
    let image = image(device, esi.vendor_id, &pdos)?;
    let hardware = hardware::with(&image, &device.controller)?;
    let made = DescribedType {
        name: device.type_name.clone(),
        title: device.name().to_owned(),
        group: device.group.clone(),
        pdos: complete(&image, pdos.iter().filter(|pdo| !pdo.is_virtual).map(pdo).collect()),
        objects: Vec::new(),
        programmed: None,
        further: Vec::new(),
        hardware,
        image,
    };
    Ok(with_objects(made, device, &fitted))
}

/// The PDOs of a device, assigned as after power-on: as its default mapping and its first operation
/// mode say, where they say something, else as each PDO says of itself. What is assigned by a list
/// stands in the order of the list, before what is not.
fn assigned(device: &EsiDevice) -> Vec<EsiPdo> {
    let mapping = device.alternatives.iter().find(|mapping| mapping.is_default);
    let mode = device.op_mode(None);
    let lists = |number: u8| {
        mapping.is_some_and(|mapping| mapping.assignments.iter().any(|one| one.0 == number))
            || mode.is_some_and(|mode| {
                mode.sync_managers.iter().any(|one| one.number == number && !one.pdos.is_empty())
            })
    };
    let mut pdos = Vec::with_capacity(device.pdos.len());
    for assigned in device.assigned(mapping, mode).iter().filter(|one| lists(one.sync_manager)) {
        let mine = assigned.pdos.iter();
        let mine = mine.map(|(pdo, _)| EsiPdo {
            sync_manager: Some(assigned.sync_manager),
            ..EsiPdo::clone(pdo)
        });
        pdos.extend(mine);
    }
    for pdo in &device.pdos {
        if !pdos.iter().any(|known| known.index == pdo.index) {
            let sync_manager = pdo.sync_manager.filter(|number| !lists(*number));
            pdos.push(EsiPdo { sync_manager, ..pdo.clone() });
        }
    }
    pdos
}

fn with_objects(mut made: DescribedType, device: &EsiDevice, fitted: &Fitted) -> DescribedType {
    made.objects = device.objects.iter().chain(&fitted.objects).map(object).collect();
    made.objects.extend(fitted.lists.iter().cloned());
    made
}

fn pdo(pdo: &EsiPdo) -> DescribedPdo {
    let entries = pdo.entries.iter().map(|entry| DescribedEntry {
        index: entry.index,
        subindex: entry.subindex,
        name: entry.name.clone(),
        data_type: entry.data_type().unwrap_or_default(),
        bits: entry.bits,
    });
    DescribedPdo {
        index: pdo.index,
        direction: pdo.direction,
        sync_manager: pdo.sync_manager,
        name: pdo.name.clone(),
        fixed: pdo.fixed,
        excludes: pdo.excludes.clone(),
        oversampled: pdo.oversampling.is_some(),
        entries: entries.collect(),
    }
}

fn object(object: &EsiObject) -> Object {
    let entries: Vec<Entry> = object.entries.iter().map(entry).collect();
    let element = entries.get(1).or(entries.first()).map_or(RECORD, |entry| entry.data_type);
    let (code, data_type) = match object.shape {
        Shape::Variable => (ObjectCode::Variable, element),
        Shape::Array => (ObjectCode::Array, element),
        Shape::Record => (ObjectCode::Record, RECORD),
    };
    Object { index: ObjectIndex(object.index), name: object.name.clone(), code, data_type, entries }
}

fn entry(entry: &EsiObjectEntry) -> Entry {
    let mut value = entry.default.clone();
    let len = usize::from(entry.bits).div_ceil(8);
    // A text may be shorter than it could be, a number may not.
    if entry.data_type != DataType::STRING || value.is_empty() {
        value.resize(len, 0);
    }
    Entry {
        subindex: entry.subindex,
        name: entry.name.clone(),
        data_type: entry.data_type,
        bits: entry.bits,
        access: entry.access,
        value,
        maximum: entry.maximum,
    }
}
