//! Modules in the slots of a modular device.
//!
//! Read first: ETG.5001. What a module brings is described for the first slot; in the next one its
//! indices are further by the increments of the device. Object 0xF030 is what the MainDevice expects
//! in each slot, 0xF050 what is there.

use linesman_config::esi::{Esi, EsiDevice, EsiModule, EsiObject, EsiPdo, EsiSlots};
use linesman_proto::mailbox::coe::information::{Access, ObjectCode};
use linesman_proto::mailbox::coe::{DataType, ObjectIndex};

use super::DescribedError;
use crate::device::dictionary::{Entry, Object, READ_ONLY};
use crate::device::library::object::{SET_UP, subindex_name};

/// What modules add to a device.
#[derive(Clone, Default, Debug)]
pub(super) struct Fitted {
    pub(super) pdos: Vec<EsiPdo>,
    pub(super) objects: Vec<EsiObject>,
    /// Objects 0xF030 and 0xF050.
    pub(super) lists: Vec<Object>,
}

/// Puts modules into slots: those that are named, else those of the description.
pub(super) fn fit(
    esi: &Esi,
    device: &EsiDevice,
    wanted: Option<&[String]>,
) -> Result<Fitted, DescribedError> {
    let Some(slots) = &device.slots else {
        return match wanted {
            Some(wanted) if !wanted.is_empty() => {
                Err(DescribedError::Slot { slot: 1, reason: "the device has no slots".to_owned() })
            }
            Some(_) | None => Ok(Fitted::default()),
        };
    };
    let mut fitted = Fitted::default();
    let mut idents = Vec::new();
    let given = wanted.map_or(0, <[String]>::len);
    if given > slots.slots.len() {
        let reason = format!("the device has {} slots", slots.slots.len());
        return Err(DescribedError::Slot { slot: slots.slots.len() + 1, reason });
    }
    for place in 0..slots.slots.len() {
        let module = match wanted {
            Some(names) => match names.get(place).map_or("", String::as_str) {
                "" => None,
                name => Some(named(esi, slots, place, name)?),
            },
            None => slots.slots[place].default.and_then(|ident| esi.module(ident)),
        };
        let Some(module) = module else {
            if slots.slots[place].required && wanted.is_some() {
                let reason = format!("it cannot stay empty; {}", fitting(esi, slots, place));
                return Err(DescribedError::Slot { slot: place + 1, reason });
            }
            idents.push(0);
            continue;
        };
        idents.push(module.ident);
        add(module, slots, place as u16, &mut fitted);
    }
    fitted.lists = vec![
        idents_object(0xF030, "Configured module ident list", &vec![0; idents.len()], SET_UP),
        idents_object(0xF050, "Detected module ident list", &idents, READ_ONLY),
    ];
    Ok(fitted)
}

/// The module of this type, name or ident, if it fits into the slot.
fn named<'a>(
    esi: &'a Esi,
    slots: &EsiSlots,
    place: usize,
    name: &str,
) -> Result<&'a EsiModule, DescribedError> {
    let fits = |module: &&EsiModule| slots.slots[place].idents.contains(&module.ident);
    let found = esi.modules.iter().flatten().filter(fits).find(|module| module.is_called(name));
    found.ok_or_else(|| DescribedError::Slot {
        slot: place + 1,
        reason: format!("no module \"{name}\" fits there; {}", fitting(esi, slots, place)),
    })
}

/// The modules that fit into a slot, in words.
fn fitting(esi: &Esi, slots: &EsiSlots, place: usize) -> String {
    let names = slots.slots[place].idents.iter().map(|ident| match esi.module(*ident) {
        Some(module) => format!("\"{}\" (0x{ident:X})", module.type_name),
        None => format!("0x{ident:X}, which is in another file"),
    });
    format!("what fits: {}", names.collect::<Vec<_>>().join(", "))
}

fn add(module: &EsiModule, slots: &EsiSlots, place: u16, fitted: &mut Fitted) {
    let index_shift = slots.index_increment.wrapping_mul(place);
    fitted.pdos.extend(module.pdos_in(slots, place));
    for object in &module.objects {
        let mut object = object.clone();
        if object.depends_on_slot {
            object.index = object.index.wrapping_add(index_shift);
        }
        fitted.objects.push(object);
    }
}

fn idents_object(index: u16, name: &str, idents: &[u32], access: Access) -> Object {
    let entries = (1u8..=255).zip(idents).map(|(subindex, ident)| {
        let name = subindex_name(subindex);
        Entry::number(subindex, &name, DataType::UDINT, 32, access, u64::from(*ident))
    });
    let entries = entries.collect();
    let mut object =
        Object::list(ObjectIndex(index), name, ObjectCode::Array, DataType::UDINT, entries);
    if let Some(count) = object.entries.first_mut() {
        count.access = access;
    }
    object
}
