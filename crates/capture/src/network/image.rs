//! Process image: logical addresses that are sent again and again, and who owns which of their bits.

use std::collections::BTreeMap;

use linesman_config::profile::MappedPdo;
use linesman_diagnosis::model::{Device, NetworkModel};
use linesman_proto::address::DeviceId;
use linesman_proto::register::FmmuConfig;
use serde::{Deserialize, Serialize};

use super::devices::direction;
use super::pdos::{DevicePdos, ImageEntryReport, MappedStretch, PdoSource};
use crate::dialogue::Dialogue;

/// A logical datagram.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ProcessImageReport {
    /// Its command.
    pub command: String,
    /// The first logical address.
    pub start: u32,
    /// Length in bytes.
    pub len: u16,
    /// Who owns what of it, in order of addresses; empty where no FMMU was seen being set up.
    pub parts: Vec<ImagePartReport>,
    /// Bytes that no FMMU which was seen has a part of.
    pub unowned_bytes: u16,
}

/// A part of a logical datagram.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ImagePartReport {
    /// Number of the SubDevice.
    pub no: u32,
    /// Number of its FMMU.
    pub fmmu: u8,
    /// `in`, `out`, `both`.
    pub direction: String,
    /// The first byte within the datagram.
    pub byte: u16,
    /// The first bit of that byte.
    pub bit: u8,
    /// Length in bits; those beyond the datagram do not count.
    pub bits: u32,
    /// The physical address that it is mapped to.
    pub physical: u16,
    /// Number of the SyncManager there, where its set-up was seen.
    pub sync_manager: Option<u8>,
    /// Source of `entries`; `null` where they are not known.
    pub entries_by: Option<PdoSource>,
    /// Entries of the PDOs that lie in it, in order.
    pub entries: Vec<ImageEntryReport>,
}

/// All logical datagrams, each once. `described` are the PDOs of device descriptions.
pub(crate) fn reports(
    model: &NetworkModel,
    dialogue: &Dialogue,
    described: &BTreeMap<DeviceId, Vec<MappedPdo>>,
) -> Vec<ProcessImageReport> {
    let mut objects = dialogue.pdo_objects(model);
    let mut pdos = |device: &Device| {
        let described = described.get(&device.id).map_or(&[][..], Vec::as_slice);
        DevicePdos::of(device, objects.remove(&device.id).unwrap_or_default(), described)
    };
    let mapped = model.devices.iter().filter(|device| !device.fmmus.is_empty());
    let pdos: BTreeMap<DeviceId, DevicePdos<'_>> =
        mapped.map(|device| (device.id, pdos(device))).collect();
    let mut all: Vec<ProcessImageReport> = Vec::new();
    for cyclic in &model.cyclic {
        let effect = cyclic.command.effect();
        let mut parts = Vec::new();
        for device in &model.devices {
            for (number, fmmu) in &device.fmmus {
                let is_for = effect.reads && fmmu.reads || effect.writes && fmmu.writes;
                let Some(overlap) = fmmu.overlap(cyclic.start, cyclic.len) else { continue };
                if !fmmu.active || !is_for {
                    continue;
                }
                let physical = fmmu.physical_start.0.wrapping_add(overlap.fmmu_offset);
                let (bit, bits) = bits(fmmu, overlap.fmmu_offset, overlap.length);
                let inner = 8 * u32::from(overlap.fmmu_offset) + u32::from(bit);
                let stretch = MappedStretch {
                    from: physical_bit(fmmu, inner),
                    bits,
                    at: 8 * u32::from(overlap.datagram_offset) + u32::from(bit),
                };
                let known = pdos.get(&device.id).map(|pdos| pdos.entries(device, stretch));
                let (entries_by, entries) = known.unwrap_or_default();
                parts.push(ImagePartReport {
                    no: device.id.no(),
                    fmmu: *number,
                    direction: direction(fmmu.reads, fmmu.writes).to_owned(),
                    byte: overlap.datagram_offset,
                    bit,
                    bits,
                    physical,
                    sync_manager: sync_manager(device, physical),
                    entries_by,
                    entries,
                });
            }
        }
        parts.sort_by_key(|part| (part.byte, part.bit, part.no, part.fmmu));
        let is_owned = |byte: u16| {
            parts.iter().any(|part| {
                let bytes = (u32::from(part.bit) + part.bits).div_ceil(8) as u16;
                (part.byte..part.byte.saturating_add(bytes)).contains(&byte)
            })
        };
        let unowned_bytes = (0..cyclic.len).filter(|byte| !is_owned(*byte)).count() as u16;
        all.push(ProcessImageReport {
            command: cyclic.command.name().to_owned(),
            start: cyclic.start.0,
            len: cyclic.len,
            unowned_bytes,
            parts,
        });
    }
    all
}

/// The first bit and the number of bits of `length` bytes of an FMMU from its byte `offset` on.
fn bits(fmmu: &FmmuConfig, offset: u16, length: u16) -> (u8, u32) {
    let is_first = offset == 0;
    let is_last = u32::from(offset) + u32::from(length) >= u32::from(fmmu.length);
    let bit = if is_first { fmmu.logical_start_bit } else { 0 };
    let behind = if is_last { 7 - u32::from(fmmu.logical_stop_bit.min(7)) } else { 0 };
    (bit, (8 * u32::from(length)).saturating_sub(u32::from(bit) + behind))
}

/// The physical bit, counted from address 0, that belongs to a bit of an FMMU, counted from its first logical byte.
fn physical_bit(fmmu: &FmmuConfig, inner: u32) -> u32 {
    let behind = inner.saturating_sub(u32::from(fmmu.logical_start_bit));
    8 * u32::from(fmmu.physical_start.0) + u32::from(fmmu.physical_start_bit) + behind
}

/// Number of the SyncManager that holds a physical address.
fn sync_manager(device: &Device, physical: u16) -> Option<u8> {
    let holds = |start: u16, length: u16| {
        physical >= start && u32::from(physical) < u32::from(start) + u32::from(length)
    };
    let mut all = device.set_up.sync_managers.iter();
    all.find(|(_, config)| holds(config.start.0, config.length)).map(|(number, _)| *number)
}
