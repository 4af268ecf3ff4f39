//! Process data objects: elements `RxPdo` and `TxPdo` (ETG.2000).

use linesman_proto::sii::Direction;

use super::error::EsiError;
use super::xml::Element;

/// A process data object.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct EsiPdo {
    /// Which way it flows.
    pub direction: Direction,
    /// Index of its mapping object.
    pub index: u16,
    /// The index counts from that of the slot that a module sits in.
    pub depends_on_slot: bool,
    /// Its name.
    pub name: String,
    /// The SyncManager it is assigned to by default.
    pub sync_manager: Option<u8>,
    /// Its entries cannot be changed.
    pub fixed: bool,
    /// It must stay assigned.
    pub mandatory: bool,
    /// There is no object for it: it is a way to see registers.
    pub is_virtual: bool,
    /// PDOs that cannot be assigned with it.
    pub excludes: Vec<u16>,
    /// It can be there several times in each cycle, once for each sample.
    pub oversampling: Option<EsiOversampling>,
    /// What it consists of. With oversampling, that of one sample.
    pub entries: Vec<EsiEntry>,
}

/// How often a PDO with oversampling can be there in each cycle.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct EsiOversampling {
    /// How often unless an operation mode says otherwise (attribute `OSFac`).
    pub factor: u16,
    /// How often at least (`OSMin`).
    pub least: u16,
    /// How often at most (`OSMax`).
    pub most: u16,
    /// Added to indices from one sample to the next (`OSIndexInc`).
    pub index_increment: u16,
}

/// A piece of a PDO.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct EsiEntry {
    /// Index of its object; 0 for padding.
    pub index: u16,
    /// The index counts from that of the slot that a module sits in.
    pub depends_on_slot: bool,
    /// Its subindex.
    pub subindex: u8,
    /// Its bits.
    pub bits: u16,
    /// Its name.
    pub name: String,
    /// Its type, as it is called.
    pub data_type: String,
}

impl EsiPdo {
    /// Its length.
    #[must_use]
    pub fn bits(&self) -> u32 {
        self.entries.iter().map(|entry| u32::from(entry.bits)).sum()
    }
}

/// The PDO of an element.
pub(super) fn pdo(element: &Element, direction: Direction) -> Result<EsiPdo, EsiError> {
    let name = element.in_language("Name", super::ENGLISH).to_owned();
    let within = |error: EsiError| error.within(&format!("{} {name}", element.name));
    let index = element.child("Index").ok_or_else(|| element.error("it has no Index"))?;
    let mut excludes = Vec::new();
    for exclude in element.children("Exclude") {
        excludes.push(exclude.number().map_err(within)?);
    }
    let mut entries = Vec::new();
    for child in element.children("Entry") {
        entries.push(entry(child).map_err(within)?);
    }
    Ok(EsiPdo {
        direction,
        index: index.number().map_err(within)?,
        depends_on_slot: index.flag("DependOnSlot").map_err(within)?,
        sync_manager: element.attribute_number("Sm")?,
        fixed: element.flag("Fixed")?,
        mandatory: element.flag("Mandatory")?,
        is_virtual: element.flag("Virtual")?,
        oversampling: oversampling(element)?,
        excludes,
        entries,
        name,
    })
}

fn oversampling(element: &Element) -> Result<Option<EsiOversampling>, EsiError> {
    let Some(factor) = element.attribute_number("OSFac")? else { return Ok(None) };
    let least = element.attribute_number("OSMin")?.unwrap_or(1);
    let most = element.attribute_number("OSMax")?.unwrap_or(factor);
    if !(least..=most).contains(&factor) {
        let reason = format!("OSFac is {factor}, expected OSMin to OSMax, {least} to {most}");
        return Err(element.error(reason));
    }
    let index_increment = element.attribute_number("OSIndexInc")?.unwrap_or(0);
    Ok(Some(EsiOversampling { factor, least, most, index_increment }))
}

fn entry(element: &Element) -> Result<EsiEntry, EsiError> {
    let index = element.child("Index").ok_or_else(|| element.error("it has no Index"))?;
    let bits = element.child_number("BitLen")?.ok_or_else(|| element.error("it has no BitLen"))?;
    Ok(EsiEntry {
        index: index.number()?,
        depends_on_slot: index.flag("DependOnSlot")?,
        subindex: element.child_number("SubIndex")?.unwrap_or(0),
        bits,
        name: element.in_language("Name", super::ENGLISH).to_owned(),
        data_type: element.child_text("DataType").to_owned(),
    })
}
