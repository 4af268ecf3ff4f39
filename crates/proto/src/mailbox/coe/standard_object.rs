//! The objects that specifications give a number: what they hold, their entries and their bits.
//!
//! Read first: ETG.1000.6, object dictionary; ETG.1020 for the objects of EtherCAT; ETG.5001 for
//! modular devices; CiA 402 (IEC 61800-7-201) for drives. One file of this module per group. A
//! device need not have an object of this list, and its own dictionary is right where both differ.

use super::object::ObjectIndex;
use crate::register::Field;

/// Declares the objects of one group, in order of their indices.
macro_rules! objects {
    ($list:ident; $($index:literal $(..= $last:literal)? $name:literal, $data_type:literal,
        $reference:ident; $meaning:literal $(=> $next_step:literal)? $(; entries $entries:expr)?
        $(; bits $bits:expr)?;)+) => {
        /// The objects of this group, in order of their indices.
        pub(super) const $list: &[StandardObject] = &[$(
            object($index, $name, $data_type, $reference, $meaning)
                $(.to($last))? $(.next_step($next_step))? $(.entries($entries))? $(.bits($bits))?
        ),+];
    };
}

mod communication;
mod drive;
mod drive_motion;
mod modular;
mod synchronisation;

pub use drive::drive_state;

/// An object, or several of one kind with indices in a row.
#[derive(Clone, Copy, Debug)]
pub struct StandardObject {
    /// Its index, or the first of them.
    pub first: ObjectIndex,
    /// The last of them; the same as the first of a single one.
    pub last: ObjectIndex,
    /// Its name.
    pub name: &'static str,
    /// Its data type as ESI files spell it; `RECORD` and `ARRAY` have entries.
    pub data_type: &'static str,
    /// Its content.
    pub meaning: &'static str,
    /// Its use, as an advice; empty where its meaning says enough.
    pub next_step: &'static str,
    /// Its entries, of those that have several.
    pub entries: &'static [Entry],
    /// Meanings of its bits or values, of those that are a number.
    pub bits: &'static [Field],
    /// The document that defines it.
    pub reference: &'static str,
}

/// An entry of an object, or several of one kind in a row.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// Its subindex, or the first of them.
    pub first: u8,
    /// The last of them.
    pub last: u8,
    /// Its name.
    pub name: &'static str,
    /// Its content.
    pub meaning: &'static str,
}

/// One entry.
const fn entry(subindex: u8, name: &'static str, meaning: &'static str) -> Entry {
    Entry { first: subindex, last: subindex, name, meaning }
}

/// Entries of one kind in a row.
const fn entries(first: u8, last: u8, name: &'static str, meaning: &'static str) -> Entry {
    Entry { first, last, name, meaning }
}

/// An object, to be completed by the methods below.
const fn object(
    index: u16,
    name: &'static str,
    data_type: &'static str,
    reference: &'static str,
    meaning: &'static str,
) -> StandardObject {
    let index = ObjectIndex(index);
    StandardObject {
        first: index,
        last: index,
        name,
        data_type,
        meaning,
        next_step: "",
        entries: &[],
        bits: &[],
        reference,
    }
}

impl StandardObject {
    const fn to(mut self, last: u16) -> Self {
        self.last = ObjectIndex(last);
        self
    }

    const fn next_step(mut self, next_step: &'static str) -> Self {
        self.next_step = next_step;
        self
    }

    const fn entries(mut self, entries: &'static [Entry]) -> Self {
        self.entries = entries;
        self
    }

    const fn bits(mut self, bits: &'static [Field]) -> Self {
        self.bits = bits;
        self
    }

    /// The entry with this subindex.
    #[must_use]
    pub fn entry(&self, subindex: u8) -> Option<&'static Entry> {
        self.entries.iter().find(|entry| (entry.first..=entry.last).contains(&subindex))
    }

    /// Number of bytes of its value, if it is a number.
    #[must_use]
    pub fn bytes(&self) -> Option<usize> {
        super::DataType::from_name(self.data_type)
            .and_then(super::DataType::bits)
            .map(|bits| usize::from(bits).div_ceil(8))
    }
}

/// An object by its index.
#[derive(Clone, Copy, Debug)]
pub struct FoundObject {
    /// The object.
    pub object: &'static StandardObject,
    /// Number within the row, counted from 0, where there are several.
    pub number: u16,
    /// Axis of a device with several drives, counted from 0.
    pub axis: u16,
}

/// All objects with a number of their own, in order of their indices.
pub fn all() -> impl Iterator<Item = &'static StandardObject> {
    GROUPS.iter().flat_map(|group| group.iter())
}

const GROUPS: [&[StandardObject]; 5] = [
    communication::COMMUNICATION,
    synchronisation::SYNCHRONISATION,
    drive::DRIVE,
    drive_motion::MOTION,
    modular::MODULAR,
];

/// The objects with this index, the more likely first. Several, since drives and modular devices
/// share the numbers from 0x6000 to 0x9FFF.
#[must_use]
pub fn lookup(index: ObjectIndex) -> Vec<FoundObject> {
    let own = all().filter(move |object| (object.first..=object.last).contains(&index));
    let mut found: Vec<FoundObject> = own
        .map(|object| FoundObject { object, number: index.0 - object.first.0, axis: 0 })
        .collect();
    // The objects of a second drive lie 0x800 behind those of the first, and so on.
    let axis = index.0.wrapping_sub(drive::FIRST.0) / drive::AXIS;
    if (1..drive::AXES).contains(&axis) {
        let first = ObjectIndex(index.0 - axis * drive::AXIS);
        let of_axis = drive::DRIVE.iter().chain(drive_motion::MOTION);
        let of_axis = of_axis.filter(|object| object.first == first && first.0 > drive::LEAST.0);
        found.extend(of_axis.map(|object| FoundObject { object, number: 0, axis }));
    }
    found
}

/// A range of indices with one purpose.
#[derive(Clone, Copy, Debug)]
pub struct Area {
    /// The first index.
    pub first: ObjectIndex,
    /// The last index.
    pub last: ObjectIndex,
    /// Its name.
    pub name: &'static str,
    /// More about it.
    pub meaning: &'static str,
}

/// The ranges that all indices fall into.
pub const AREAS: &[Area] = &[
    area(
        0x0000,
        0x0FFF,
        "data types",
        "Numbers of data types, no objects that can be read: 0x0006 is UINT, 0x0007 UDINT.",
    ),
    area(
        0x1000,
        0x1FFF,
        "communication objects",
        "Identity, settings of the communication, mapping and assignment of process data.",
    ),
    area(
        0x2000,
        0x5FFF,
        "objects of the manufacturer",
        "The manufacturer gave it its meaning: see the manual of the device, or its own dictionary.",
    ),
    area(
        0x6000,
        0x6FFF,
        "inputs, or objects of a profile",
        "In a modular device its inputs, 16 objects for each slot; in a drive the objects of CiA 402.",
    ),
    area(0x7000, 0x7FFF, "outputs", "In a modular device its outputs, 16 objects for each slot."),
    area(
        0x8000,
        0x8FFF,
        "settings of the modules",
        "In a modular device what can be set, 16 objects for each slot.",
    ),
    area(
        0x9000,
        0x9FFF,
        "information about the modules",
        "In a modular device what the modules tell of themselves, 16 objects for each slot.",
    ),
    area(
        0xA000,
        0xAFFF,
        "diagnosis of the modules",
        "In a modular device what the modules report as wrong, 16 objects for each slot.",
    ),
    area(
        0xB000,
        0xBFFF,
        "services of the modules",
        "In a modular device commands to the modules, 16 objects for each slot.",
    ),
    area(0xC000, 0xEFFF, "reserved", "The specifications leave these indices free."),
    area(
        0xF000,
        0xFFFF,
        "objects of the device as a whole",
        "In a modular device what concerns no single slot.",
    ),
];

const fn area(first: u16, last: u16, name: &'static str, meaning: &'static str) -> Area {
    Area { first: ObjectIndex(first), last: ObjectIndex(last), name, meaning }
}

/// The range that an index falls into.
#[must_use]
pub fn area_of(index: ObjectIndex) -> &'static Area {
    let behind = AREAS.partition_point(|area| area.first <= index);
    &AREAS[behind.saturating_sub(1)]
}

/// The slot of a modular device that an index belongs to, counted from 0; `None` outside of the
/// ranges that have slots.
#[must_use]
pub const fn slot_of(index: ObjectIndex) -> Option<u16> {
    match index.0 {
        0x6000..=0xBFFF => Some((index.0 & 0x0FFF) >> 4),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_are_in_order_and_complete() {
        for group in GROUPS {
            assert!(group.is_sorted_by(|a, b| a.last < b.first), "out of order, or twice");
        }
        for object in all() {
            let index = object.first;
            assert!(object.first <= object.last, "{index}");
            assert!(!object.name.is_empty() && !object.reference.is_empty(), "{index}");
            assert!(object.meaning.ends_with('.'), "{index}: {}", object.meaning);
            let next_step = object.next_step;
            assert!(next_step.is_empty() || next_step.ends_with('.'), "{index}: {next_step}");
            let has_entries = matches!(object.data_type, "RECORD" | "ARRAY");
            assert_eq!(has_entries, !object.entries.is_empty(), "{index}: entries");
            assert_eq!(has_entries, object.bytes().is_none() && !is_text(object), "{index}: type");
            assert!(object.entries.is_sorted_by(|a, b| a.last < b.first), "{index}: subindices");
            for bit in object.bits {
                let bits = object.bytes().unwrap() * 8;
                assert!(bit.low <= bit.high && usize::from(bit.high) < bits, "{index}: {bit:?}");
            }
        }
    }

    fn is_text(object: &StandardObject) -> bool {
        matches!(object.data_type, "STRING" | "OCTET_STRING")
    }

    #[test]
    fn areas_cover_all_indices_once() {
        assert_eq!(AREAS[0].first.0, 0);
        assert_eq!(AREAS.last().unwrap().last.0, 0xFFFF);
        for pair in AREAS.windows(2) {
            assert_eq!(pair[0].last.0 + 1, pair[1].first.0);
        }
        assert_eq!(area_of(ObjectIndex(0x2310)).name, "objects of the manufacturer");
        assert_eq!(slot_of(ObjectIndex(0x6041)), Some(4));
        assert_eq!(slot_of(ObjectIndex(0x1018)), None);
    }

    #[test]
    fn objects_are_found_by_number_and_axis() {
        let names = |index| -> Vec<(&str, u16, u16)> {
            let found = lookup(ObjectIndex(index));
            found.iter().map(|found| (found.object.name, found.number, found.axis)).collect()
        };
        assert_eq!(names(0x6041), [("Statusword", 0, 0)]);
        assert_eq!(names(0x6841), [("Statusword", 0, 1)]);
        assert_eq!(names(0x1A02), [("TxPDO mapping", 2, 0)]);
        assert_eq!(names(0x1C13), [("TxPDO assignment (SyncManager 3)", 0, 0)]);
        assert_eq!(names(0x2000), []);
        assert_eq!(
            lookup(ObjectIndex(0x1C32))[0].object.entry(0x0B).unwrap().name,
            "SM event missed"
        );
    }
}
