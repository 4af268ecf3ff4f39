//! The object dictionary: element `Profile/Dictionary` (ETG.2000).
//!
//! A description names data types and lets objects refer to them; here they are resolved, so that
//! every object has its entries with lengths, rights and values after power-on.

use std::collections::BTreeMap;

use linesman_proto::mailbox::coe::DataType;
use linesman_proto::mailbox::coe::information::Access;

use super::error::EsiError;
use super::value;
use super::xml::Element;

/// Longest chain of types that are called by other names; it may be a circle.
const ALIASES: usize = 16;
/// Highest subindex.
const LAST_SUBINDEX: u16 = 255;

/// An object.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct EsiObject {
    /// Its index.
    pub index: u16,
    /// The index counts from that of the slot that a module sits in.
    pub depends_on_slot: bool,
    /// Its name.
    pub name: String,
    /// What it is.
    pub shape: Shape,
    /// Its entries in order of their subindices; a variable has subindex 0 alone.
    pub entries: Vec<EsiObjectEntry>,
}

/// What an object is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Shape {
    /// One value.
    Variable,
    /// Values of one type.
    Array,
    /// Values of different types.
    Record,
}

/// A value of an object.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct EsiObjectEntry {
    /// Its subindex.
    pub subindex: u8,
    /// Its name.
    pub name: String,
    /// Its type.
    pub data_type: DataType,
    /// Its length in bits.
    pub bits: u16,
    /// Who may do what in which state.
    pub access: Access,
    /// Its value after power-on, lowest byte first; empty where nothing is said.
    pub default: Vec<u8>,
    /// The greatest value that is taken.
    pub maximum: Option<u32>,
}

/// All objects of an element `Dictionary`. Objects that cannot be understood are left out, with the
/// reason in `notes`: one of a thousand is no cause to refuse a device.
pub(super) fn objects(dictionary: &Element, notes: &mut Vec<EsiError>) -> Vec<EsiObject> {
    let types = Types::of(dictionary);
    let mut objects = Vec::new();
    for element in dictionary.child("Objects").into_iter().flat_map(|all| all.children("Object")) {
        match object(element, &types) {
            Ok(object) => objects.push(object),
            Err(error) => notes.push(error.within("Dictionary")),
        }
    }
    objects
}

/// Data types by their names.
struct Types<'a>(BTreeMap<&'a str, &'a Element>);

/// A type that is one value.
struct Plain {
    data_type: DataType,
    bits: u16,
}

impl<'a> Types<'a> {
    fn of(dictionary: &'a Element) -> Self {
        let types =
            dictionary.child("DataTypes").into_iter().flat_map(|all| all.children("DataType"));
        Self(types.map(|one| (one.child_text("Name"), one)).collect())
    }

    /// The type that stands behind other names.
    fn resolved(&self, name: &str) -> Option<&'a Element> {
        let mut found = *self.0.get(name)?;
        for _ in 0..ALIASES {
            let is_alias = found.child("SubItem").is_none() && found.child("ArrayInfo").is_none();
            let next = self.0.get(found.child_text("BaseType")).filter(|_| is_alias);
            match next {
                Some(next) => found = next,
                None => return Some(found),
            }
        }
        None
    }

    /// A type that is one value of `bits` bits.
    fn plain(&self, name: &str, bits: u16) -> Plain {
        let known = |name: &str| DataType::from_name(stem(name)).filter(|_| !name.is_empty());
        let resolved = self.resolved(name);
        let behind = resolved.and_then(|one| {
            known(one.child_text("Name")).or_else(|| known(one.child_text("BaseType")))
        });
        let data_type = known(name).or(behind).unwrap_or(DataType::OCTET_STRING);
        Plain { data_type, bits }
    }

    /// How many elements a type has, and of which type and from which number on, if it is an array.
    fn array(&self, name: &str) -> Result<Option<(u16, u16, &'a str)>, EsiError> {
        let Some(element) = self.resolved(name) else { return Ok(None) };
        let Some(array) = element.child("ArrayInfo") else { return Ok(None) };
        let count: u16 = array.child_number("Elements")?.unwrap_or(0);
        let first: u16 = array.child_number("LBound")?.unwrap_or(0);
        Ok(Some((count, first, element.child_text("BaseType"))))
    }
}

/// A name such as `STRING(12)` without its length; `ARRAY [0..7] OF BYTE` is a run of bytes.
fn stem(name: &str) -> &str {
    match name.split_once('(') {
        Some(("VISIBLE_STRING", _)) => "STRING",
        Some((stem, _)) => stem,
        None if name.starts_with("ARRAY") => "OCTET_STRING",
        None if name == "BIT" => "BOOL",
        None => name,
    }
}

fn object(element: &Element, types: &Types<'_>) -> Result<EsiObject, EsiError> {
    let index = element.child("Index").ok_or_else(|| element.error("it has no Index"))?;
    let number: u16 = index.number()?;
    let name = element.in_language("Name", super::ENGLISH).to_owned();
    let within = |error: EsiError| error.within(&format!("Object 0x{number:04X}"));
    let type_name = element.child_text("Type");
    let rights = access(element, Access::default()).map_err(within)?;
    let composed = types.resolved(type_name).filter(|one| one.child("SubItem").is_some());
    let (shape, mut entries) = match composed {
        Some(composed) => members(composed, types, rights).map_err(within)?,
        None => {
            let bits: u16 = element.child_number("BitSize").map_err(within)?.unwrap_or(0);
            let plain = types.plain(type_name, bits);
            (Shape::Variable, vec![entry(0, &name, plain, rights)])
        }
    };
    if let Some(info) = element.child("Info") {
        defaults(info, shape, &mut entries).map_err(within)?;
    }
    let depends_on_slot = index.flag("DependOnSlot").map_err(within)?;
    Ok(EsiObject { index: number, depends_on_slot, name, shape, entries })
}

fn entry(subindex: u8, name: &str, plain: Plain, access: Access) -> EsiObjectEntry {
    let Plain { data_type, bits } = plain;
    let name = name.to_owned();
    EsiObjectEntry { subindex, name, data_type, bits, access, default: Vec::new(), maximum: None }
}

/// The entries of a composed type.
fn members(
    composed: &Element,
    types: &Types<'_>,
    rights: Access,
) -> Result<(Shape, Vec<EsiObjectEntry>), EsiError> {
    let mut shape = Shape::Record;
    let mut entries: Vec<EsiObjectEntry> = Vec::new();
    for item in composed.children("SubItem") {
        let type_name = item.child_text("Type");
        let bits: u16 = item.child_number("BitSize")?.unwrap_or(0);
        let access = access(item, rights)?;
        let subindex: Option<u8> = item.child_number("SubIdx")?;
        if let Some((count, first, base)) = types.array(type_name)?
            && subindex.is_none()
        {
            shape = Shape::Array;
            let last = first.saturating_add(count).saturating_sub(1);
            if count > 0 && last > LAST_SUBINDEX {
                let reason = format!("an array up to subindex {last}, expected at most 255");
                return Err(item.error(reason));
            }
            for number in (0..count).map(|at| first + at) {
                let name = format!("SubIndex {number:03}");
                let plain = types.plain(base, bits / count.max(1));
                put(&mut entries, entry(number as u8, &name, plain, access));
            }
            continue;
        }
        let next = entries.last().map_or(0, |entry| entry.subindex.saturating_add(1));
        let subindex = subindex.unwrap_or(next);
        let name = item.in_language("Name", super::ENGLISH);
        put(&mut entries, entry(subindex, name, types.plain(type_name, bits), access));
    }
    if entries.first().is_none_or(|first| first.subindex != 0) {
        let plain = Plain { data_type: DataType::USINT, bits: 8 };
        put(&mut entries, entry(0, "SubIndex 000", plain, READ));
    }
    Ok((shape, entries))
}

/// Puts an entry where it belongs; of two with one subindex the first counts.
fn put(entries: &mut Vec<EsiObjectEntry>, entry: EsiObjectEntry) {
    if let Err(at) = entries.binary_search_by_key(&entry.subindex, |entry| entry.subindex) {
        entries.insert(at, entry);
    }
}

/// Values after power-on. They stand in the order of the entries; where some are left out, names
/// tell.
fn defaults(info: &Element, shape: Shape, entries: &mut [EsiObjectEntry]) -> Result<(), EsiError> {
    if shape == Shape::Variable {
        return match entries.first_mut() {
            Some(entry) => set_default(info, entry),
            None => Ok(()),
        };
    }
    let items: Vec<&Element> = info.children("SubItem").collect();
    let in_order = items.len() == entries.len();
    for (place, item) in items.iter().enumerate() {
        let name = item.child_text("Name");
        let found = match in_order {
            true => entries.get_mut(place),
            false => entries.iter_mut().find(|entry| entry.name == name),
        };
        if let (Some(entry), Some(info)) = (found, item.child("Info")) {
            set_default(info, entry)?;
            if entry.name.is_empty() || (shape == Shape::Array && !name.is_empty()) {
                name.clone_into(&mut entry.name);
            }
        }
    }
    let last = entries.last().map_or(0, |entry| entry.subindex);
    if let Some(count) = entries.first_mut()
        && count.default.is_empty()
    {
        count.default = vec![last];
    }
    Ok(())
}

fn set_default(info: &Element, entry: &mut EsiObjectEntry) -> Result<(), EsiError> {
    let len = usize::from(entry.bits).div_ceil(8);
    if let Some(data) = info.child("DefaultData") {
        entry.default = value::bytes(data.text()).map_err(|reason| data.error(reason))?;
    } else if let Some(text) = info.child("DefaultString") {
        entry.default = text.text().as_bytes().to_vec();
        // Where the type says nothing of its length, the text does.
        if entry.bits == 0 {
            entry.bits = u16::try_from(entry.default.len() * 8).unwrap_or(u16::MAX);
        }
    } else if let Some(number) = info.child("DefaultValue")
        && !number.text().is_empty()
    {
        // A number with a point is a real one; its bytes are not those of a whole number.
        entry.default = match (entry.data_type, number.text().parse::<f64>()) {
            (DataType::REAL, Ok(real)) => (real as f32).to_le_bytes().to_vec(),
            (DataType::LREAL, Ok(real)) => real.to_le_bytes().to_vec(),
            _ => number.number::<i64>()?.to_le_bytes().to_vec(),
        };
    }
    let len = if entry.bits == 0 { 0 } else { len.max(usize::from(entry.bits).div_ceil(8)) };
    entry.default.truncate(len);
    if let Some(maximum) = info.child("MaxValue").filter(|one| !one.text().is_empty())
        && is_unsigned(entry.data_type)
    {
        entry.maximum = maximum.number::<u32>().ok();
    }
    Ok(())
}

fn is_unsigned(data_type: DataType) -> bool {
    matches!(data_type, DataType::USINT | DataType::UINT | DataType::UDINT)
}

/// Readable in each state.
const READ: Access = Access(Access::READ_PRE_OP | Access::READ_SAFE_OP | Access::READ_OP);
/// Writable in each state.
const WRITE: u16 = Access::WRITE_PRE_OP | Access::WRITE_SAFE_OP | Access::WRITE_OP;

/// The rights of an element with `Flags`; those around it where there are none.
fn access(element: &Element, outer: Access) -> Result<Access, EsiError> {
    let Some(flags) = element.child("Flags") else {
        return Ok(if outer == Access::default() { READ } else { outer });
    };
    let mut rights = match flags.child("Access") {
        None => READ.0,
        Some(access) => {
            let (reads, writes) = match access.text().to_ascii_lowercase().as_str() {
                "ro" | "" => (true, false),
                "rw" => (true, true),
                "wo" => (false, true),
                other => {
                    let reason = format!("\"{other}\", expected ro, rw or wo");
                    return Err(access.error(reason));
                }
            };
            let read = restricted(access.attribute("ReadRestrictions"), READ.0, 0);
            let write = restricted(access.attribute("WriteRestrictions"), WRITE, 3);
            (if reads { read } else { 0 }) | (if writes { write } else { 0 })
        }
    };
    for letter in flags.child_text("PdoMapping").to_ascii_uppercase().chars() {
        match letter {
            'R' => rights |= Access::RX_PDO,
            'T' => rights |= Access::TX_PDO,
            _ => {}
        }
    }
    if flags.child_text("Backup") == "1" {
        rights |= Access::BACKUP;
    }
    if flags.child_text("Setting") == "1" {
        rights |= Access::SETTING;
    }
    Ok(Access(rights))
}

/// The states of a restriction such as `PreOP_SafeOP`; `all` without one. The bit of PREOP is `shift`,
/// those of SAFEOP and OP follow.
fn restricted(restriction: Option<&str>, all: u16, shift: u32) -> u16 {
    let Some(text) = restriction.filter(|text| !text.is_empty()) else { return all };
    let mut states = 0;
    for part in text.split('_') {
        match part.to_ascii_lowercase().as_str() {
            "preop" => states |= 1 << shift,
            "safeop" => states |= 2 << shift,
            "op" => states |= 4 << shift,
            _ => return all,
        }
    }
    states
}
