//! Modules and slots of a modular device: elements `Slots` and `Module` (ETG.2000, ETG.5001).

use linesman_proto::sii::Direction;

use super::dictionary::{EsiObject, objects};
use super::error::EsiError;
use super::mailbox::{InitCommand, init_command};
use super::pdo::{EsiPdo, pdo};
use super::xml::Element;

/// Where modules can sit.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct EsiSlots {
    /// Added to PDO indices from one slot to the next.
    pub pdo_increment: u16,
    /// Added to object indices from one slot to the next.
    pub index_increment: u16,
    /// The slots, in order; one with several instances is there so many times.
    pub slots: Vec<EsiSlot>,
}

/// A place for a module.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct EsiSlot {
    /// Its name.
    pub name: String,
    /// It cannot stay empty.
    pub required: bool,
    /// Modules that fit.
    pub idents: Vec<u32>,
    /// The module that sits there unless said.
    pub default: Option<u32>,
}

/// A module.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct EsiModule {
    /// Where it stands in the file.
    pub line: u32,
    /// Its type.
    pub type_name: String,
    /// What 0xF030 and 0xF050 say of it.
    pub ident: u32,
    /// Its name.
    pub name: String,
    /// Its process data, for slot 1.
    pub pdos: Vec<EsiPdo>,
    /// What a MainDevice is to write for it.
    pub commands: Vec<InitCommand>,
    /// Its objects, for slot 1.
    pub objects: Vec<EsiObject>,
    /// What was odd about it.
    pub notes: Vec<EsiError>,
}

impl EsiModule {
    /// Its process data in a slot, counted from 0: indices are further by the increments of the device.
    #[must_use]
    pub fn pdos_in(&self, slots: &EsiSlots, place: u16) -> Vec<EsiPdo> {
        let pdo_shift = slots.pdo_increment.wrapping_mul(place);
        let index_shift = slots.index_increment.wrapping_mul(place);
        let mut pdos = self.pdos.clone();
        for pdo in &mut pdos {
            if pdo.depends_on_slot {
                pdo.index = pdo.index.wrapping_add(pdo_shift);
                for excluded in &mut pdo.excludes {
                    *excluded = excluded.wrapping_add(pdo_shift);
                }
            }
            for entry in pdo.entries.iter_mut().filter(|entry| entry.depends_on_slot) {
                entry.index = entry.index.wrapping_add(index_shift);
            }
        }
        pdos
    }

    /// Whether a word of a user means it: its type, its name, or its ident in hexadecimal.
    #[must_use]
    pub fn is_called(&self, word: &str) -> bool {
        let ident = word.strip_prefix("0x").and_then(|hex| u32::from_str_radix(hex, 16).ok());
        match ident {
            Some(ident) => self.ident == ident,
            None => self.type_name.eq_ignore_ascii_case(word) || self.name == word,
        }
    }
}

/// Most slots of a device; object 0xF030 has as many entries.
const MOST_SLOTS: usize = 255;

/// The slots of an element `Slots`.
pub(super) fn slots(element: &Element) -> Result<EsiSlots, EsiError> {
    let mut all = EsiSlots {
        pdo_increment: element.attribute_number("SlotPdoIncrement")?.unwrap_or(0),
        index_increment: element.attribute_number("SlotIndexIncrement")?.unwrap_or(0),
        slots: Vec::new(),
    };
    for slot in element.children("Slot") {
        let least: u16 = slot.attribute_number("MinInstances")?.unwrap_or(0);
        let most: u16 = slot.attribute_number("MaxInstances")?.unwrap_or(1);
        let mut idents = Vec::new();
        let mut default = None;
        for ident in slot.children("ModuleIdent") {
            let number = ident.number().map_err(|error| error.within("Slot"))?;
            idents.push(number);
            if ident.flag("Default")? {
                default = Some(number);
            }
        }
        let name = slot.in_language("Name", super::ENGLISH);
        for instance in 0..most {
            if all.slots.len() >= MOST_SLOTS {
                return Err(slot.error(format!("more than {MOST_SLOTS} slots")));
            }
            all.slots.push(EsiSlot {
                name: name.to_owned(),
                required: instance < least,
                idents: idents.clone(),
                default,
            });
        }
    }
    Ok(all)
}

/// The module of an element `Module`.
pub(super) fn module(element: &Element) -> Result<EsiModule, EsiError> {
    let kind = element.child("Type").ok_or_else(|| element.error("it has no Type"))?;
    let type_name = kind.text().to_owned();
    let within = |error: EsiError| error.within(&format!("Module {type_name}"));
    let mut notes = Vec::new();
    let mut pdos = Vec::new();
    for child in &element.children {
        match child.name.as_str() {
            "RxPdo" => pdos.push(pdo(child, Direction::Outputs).map_err(within)?),
            "TxPdo" => pdos.push(pdo(child, Direction::Inputs).map_err(within)?),
            _ => {}
        }
    }
    let mut commands = Vec::new();
    for command in element.at("Mailbox/CoE").into_iter().flat_map(|coe| coe.children("InitCmd")) {
        commands.push(init_command(command).map_err(within)?);
    }
    let dictionary = element.at("Profile/Dictionary");
    let found = dictionary.map_or_else(Vec::new, |one| objects(one, &mut notes));
    Ok(EsiModule {
        line: element.line,
        ident: kind.attribute_number("ModuleIdent").map_err(within)?.unwrap_or(0),
        name: element.in_language("Name", super::ENGLISH).to_owned(),
        pdos,
        commands,
        objects: found,
        notes,
        type_name,
    })
}
