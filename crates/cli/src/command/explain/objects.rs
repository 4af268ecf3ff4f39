//! Pages about objects of CoE, their entries and values read from them.

use linesman_proto::mailbox::coe::standard_object::{
    FoundObject, StandardObject, all, area_of, drive_state, lookup, slot_of,
};
use linesman_proto::mailbox::coe::{ObjectAddress, ObjectIndex, sync_parameters};
use linesman_proto::register::describe::decode_fields;

use super::page::{Kind, Page};
use super::registers::{field, readings};

/// All that an object of this index can be; the range it is in, where nothing else is known.
pub(super) fn pages(index: ObjectIndex, subindex: Option<u8>) -> Vec<Page> {
    let found = lookup(index);
    let mut pages: Vec<Page> = found.iter().map(|found| page(found, index, subindex)).collect();
    if pages.is_empty() {
        pages.push(area(index, subindex));
    }
    pages
}

/// Tells if an index has a name of its own.
pub(super) fn is_named(index: ObjectIndex) -> bool {
    !lookup(index).is_empty()
}

/// The object with this name.
pub(super) fn by_name(name: &str) -> impl Iterator<Item = Page> {
    let wanted: String = letters(name).collect();
    let named = all().filter(move |object| letters(object.name).eq(wanted.chars()));
    named.map(|object| page(&FoundObject { object, number: 0, axis: 0 }, object.first, None))
}

/// The index of the object with this name.
pub(super) fn index_by_name(name: &str) -> Option<ObjectIndex> {
    all().find(|object| letters(object.name).eq(letters(name))).map(|object| object.first)
}

fn letters(name: &str) -> impl Iterator<Item = char> {
    name.chars().filter(char::is_ascii_alphanumeric).map(|letter| letter.to_ascii_lowercase())
}

fn page(found: &FoundObject, index: ObjectIndex, subindex: Option<u8>) -> Page {
    let object = found.object;
    let entry = subindex.and_then(|subindex| object.entry(subindex));
    let mut title = match (subindex, entry) {
        (Some(subindex), Some(entry)) => format!(
            "CoE object {}: {}, {}",
            ObjectAddress { index, subindex },
            object.name,
            entry.name
        ),
        (Some(subindex), None) => {
            format!("CoE object {}: {}", ObjectAddress { index, subindex }, object.name)
        }
        (None, _) => format!("CoE object {index}: {}", object.name),
    };
    if found.axis > 0 {
        title.push_str(&format!(" of axis {}", found.axis + 1));
    }
    let mut page = Page::new(Kind::Object, title);
    if let Some(entry) = entry {
        page = page.fact("entry", entry.meaning);
    }
    page = page.text(object.meaning);
    if object.first != object.last {
        let text =
            format!("no. {} of those from {} to {}", found.number + 1, object.first, object.last);
        page = page.fact("which", text);
    }
    let entries = object.entries.iter().map(|entry| {
        let subindex = match entry.first == entry.last {
            true => format!("{:02X}", entry.first),
            false => format!("{:02X} to {:02X}", entry.first, entry.last),
        };
        format!("{subindex}: {}. {}", entry.name, entry.meaning)
    });
    page.fact("do", object.next_step)
        .fact("type", object.data_type)
        .list("entries", entries)
        .list("bits", object.bits.iter().map(field))
        .fact("read it", format!("`linesman sdo WHERE DEVICE read {index}`"))
        .fact("see", object.reference)
}

/// A page about the range that an index is in.
pub(super) fn area(index: ObjectIndex, subindex: Option<u8>) -> Page {
    let area = area_of(index);
    let address = subindex.map_or_else(
        || index.to_string(),
        |subindex| ObjectAddress { index, subindex }.to_string(),
    );
    let slot = slot_of(index).map(|slot| format!("{} (the first is 1)", slot + 1));
    Page::new(Kind::Object, format!("CoE object {address}: {}", area.name))
        .text(area.meaning)
        .fact("range", format!("{} to {}", area.first, area.last))
        .fact("slot", slot.unwrap_or_default())
        .fact("ask it", format!("`linesman sdo WHERE DEVICE info {index}` asks the device itself"))
}

/// A page about what an object read.
pub(super) fn value(index: ObjectIndex, subindex: Option<u8>, value: u64) -> Option<Page> {
    let found = lookup(index).into_iter().next()?;
    let object: &StandardObject = found.object;
    let address = ObjectAddress { index, subindex: subindex.unwrap_or(0) };
    if let Some(words) = sync_parameters::in_words(address, value).filter(|_| subindex.is_some()) {
        let entry = object
            .entries
            .iter()
            .find(|entry| (entry.first..=entry.last).contains(&address.subindex));
        let name = entry.map_or("", |entry| entry.name);
        let title = format!("{}, {name} ({address}) = 0x{value:04X}", object.name);
        return Some(Page::new(Kind::Value, title).text(format!("It says: {words}.")));
    }
    let len = object.bytes().filter(|len| *len <= 8 && !object.bits.is_empty())?;
    let digits = 2 * len;
    let title = format!("{} ({index}) = 0x{value:0digits$X}", object.name);
    let mut page = Page::new(Kind::Value, title);
    if object.first == ObjectIndex::STATUSWORD {
        page = page.text(format!("State of the drive: {}.", drive_state(value as u16)));
    }
    let read = decode_fields(object.bits, 0, &value.to_le_bytes()[..len]);
    Some(
        page.list("bits", readings(&read))
            .fact("object", object.meaning)
            .fact("see", object.reference),
    )
}

/// A page about an entry of a PDO mapping: index, subindex and length in one number.
pub(super) fn mapping(value: u32) -> Page {
    let [low, subindex, ..] = value.to_le_bytes();
    let index = ObjectIndex((value >> 16) as u16);
    let address = ObjectAddress { index, subindex };
    let name = lookup(index).first().map_or(area_of(index).name, |found| found.object.name);
    Page::new(Kind::Object, format!("Mapped entry 0x{value:08X}: {address}, {low} bits"))
        .text(
            "An entry of a PDO mapping (objects 0x1600 and 0x1A00 and up): index, subindex, length in \
             bits.",
        )
        .fact("object", format!("{address}: {name}"))
        .fact("see", "ETG.1000.6, object dictionary")
}
