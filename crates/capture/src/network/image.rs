//! Process image: logical addresses that are sent again and again, and who owns which of their bits.

use linesman_diagnosis::model::NetworkModel;
use linesman_proto::address::DeviceId;
use linesman_proto::register::FmmuConfig;
use serde::{Deserialize, Serialize};

use super::devices::direction;

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
}

/// All logical datagrams, each once.
pub(crate) fn reports(model: &NetworkModel) -> Vec<ProcessImageReport> {
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
                parts.push(ImagePartReport {
                    no: device.id.no(),
                    fmmu: *number,
                    direction: direction(fmmu.reads, fmmu.writes).to_owned(),
                    byte: overlap.datagram_offset,
                    bit,
                    bits,
                    physical,
                    sync_manager: sync_manager(model, device.id, physical),
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

fn sync_manager(model: &NetworkModel, id: DeviceId, physical: u16) -> Option<u8> {
    let managers = &model.device(id)?.set_up.sync_managers;
    let holds = |start: u16, length: u16| {
        physical >= start && u32::from(physical) < u32::from(start) + u32::from(length)
    };
    let mut all = managers.iter();
    all.find(|(_, config)| holds(config.start.0, config.length)).map(|(number, _)| *number)
}
