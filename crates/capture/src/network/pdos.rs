//! PDOs of SubDevices, from CoE objects, from the SII, or from a device description, and the bits that their entries
//! have in the process image.

use linesman_config::profile::{DeviceProfile, MappedPdo};
use linesman_diagnosis::model::Device;
use serde::{Deserialize, Serialize};

use crate::dialogue::PdoObjects;

/// An entry of a PDO in the process image, or the part of it that the datagram has. Padding is left out.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ImageEntryReport {
    /// The first byte within the datagram.
    pub byte: u16,
    /// The first bit of that byte.
    pub bit: u8,
    /// Length in bits.
    pub bits: u32,
    /// Index of the mapping object of its PDO.
    pub pdo: u16,
    /// Name of the PDO.
    pub pdo_name: Option<String>,
    /// Index of its object.
    pub index: u16,
    /// Subindex of its object.
    pub subindex: u8,
    /// Its name.
    pub name: Option<String>,
    /// Its type, as in `INT`.
    pub data_type: Option<String>,
}

/// Source of what is known of PDOs.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum PdoSource {
    /// Objects 0x1C10 and up with their mappings, as they were last read or written.
    Coe,
    /// The default of the SII, as it was read.
    Sii,
    /// The default of a device description.
    Esi,
}

/// A stretch of physical memory that a datagram has.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct MappedStretch {
    /// The first bit of it, counted from address 0.
    pub(super) from: u32,
    /// Length in bits.
    pub(super) bits: u32,
    /// The bit of the datagram where it begins, counted from its first byte.
    pub(super) at: u32,
}

/// The PDOs of a SubDevice, as each source tells them.
pub(super) struct DevicePdos<'a> {
    objects: PdoObjects,
    sii: Vec<MappedPdo>,
    described: &'a [MappedPdo],
}

impl<'a> DevicePdos<'a> {
    /// Of the SubDevice, with what its device description says.
    pub(super) fn of(device: &Device, objects: PdoObjects, described: &'a [MappedPdo]) -> Self {
        let image = device.sii.image();
        let sii = image.map_or_else(Vec::new, |image| DeviceProfile::from_sii(&image).pdos);
        Self { objects, sii, described }
    }

    /// The PDOs of a SyncManager that is `len` bytes long, and what tells them. Those of another length are not what the
    /// SubDevice exchanges.
    fn assigned(&self, sync_manager: u8, len: u16) -> Option<(PdoSource, Vec<MappedPdo>)> {
        let default = |all: &[MappedPdo]| -> Vec<MappedPdo> {
            all.iter().filter(|pdo| pdo.sync_manager == sync_manager).cloned().collect()
        };
        // An assignment that was seen is what holds: a default of the same length may be another one.
        let all = match self.objects.assigned(sync_manager) {
            Some(assigned) => vec![(PdoSource::Coe, assigned)],
            None => vec![
                (PdoSource::Sii, default(&self.sii)),
                (PdoSource::Esi, default(self.described)),
            ],
        };
        let fits = |pdos: &[MappedPdo]| {
            let bits: u32 = pdos.iter().map(MappedPdo::bits).sum();
            bits > 0 && bits.div_ceil(8) == u32::from(len)
        };
        let (source, mut pdos) = all.into_iter().find(|(_, pdos)| fits(pdos))?;
        pdos.iter_mut().for_each(|pdo| self.name(pdo));
        Some((source, pdos))
    }

    /// Fills in names and types that another source tells of the same objects.
    fn name(&self, pdo: &mut MappedPdo) {
        let others = || self.sii.iter().chain(self.described);
        if pdo.name.is_empty() {
            let found = others().find(|other| other.index == pdo.index && !other.name.is_empty());
            pdo.name = found.map(|other| other.name.clone()).unwrap_or_default();
        }
        for entry in &mut pdo.entries {
            let same = others().flat_map(|other| &other.entries).filter(|other| {
                (other.index, other.subindex, other.bits)
                    == (entry.index, entry.subindex, entry.bits)
            });
            for other in same.filter(|_| entry.index != 0) {
                if entry.name.is_empty() {
                    entry.name.clone_from(&other.name);
                }
                if entry.data_type.is_empty() {
                    entry.data_type.clone_from(&other.data_type);
                }
            }
        }
    }

    /// The entries in a stretch of memory, in order, and what tells them: FMMUs may span several SyncManagers.
    pub(super) fn entries(
        &self,
        device: &Device,
        stretch: MappedStretch,
    ) -> (Option<PdoSource>, Vec<ImageEntryReport>) {
        let (mut source, mut all) = (None, Vec::new());
        for (number, config) in &device.set_up.sync_managers {
            let start = 8 * u32::from(config.start.0);
            let is_touched = start < stretch.from + stretch.bits
                && stretch.from < start + 8 * u32::from(config.length);
            let pdos = self.assigned(*number, config.length).filter(|_| is_touched);
            if let Some((by, pdos)) = pdos {
                source = source.or(Some(by));
                entries_of(&pdos, start, stretch, &mut all);
            }
        }
        all.sort_by_key(|entry| (entry.byte, entry.bit));
        (source, all)
    }
}

/// Adds the entries of PDOs that lie in a stretch of memory; the first begins at bit `start`.
fn entries_of(
    pdos: &[MappedPdo],
    start: u32,
    stretch: MappedStretch,
    all: &mut Vec<ImageEntryReport>,
) {
    let text = |text: &str| Some(text.to_owned()).filter(|text| !text.is_empty());
    let (mut next, end) = (start, stretch.from + stretch.bits);
    for pdo in pdos {
        for entry in &pdo.entries {
            let (from, to) = (next, next + u32::from(entry.bits));
            next = to;
            let (first, last) = (from.max(stretch.from), to.min(end));
            if first >= last || entry.index == 0 {
                continue;
            }
            let at = stretch.at + (first - stretch.from);
            all.push(ImageEntryReport {
                byte: u16::try_from(at / 8).unwrap_or(u16::MAX),
                bit: (at % 8) as u8,
                bits: last - first,
                pdo: pdo.index,
                pdo_name: text(&pdo.name),
                index: entry.index,
                subindex: entry.subindex,
                name: text(&entry.name),
                data_type: text(&entry.data_type),
            });
        }
    }
}
