//! Areas of a controller's memory, and where they come to lie in the logical space.

use std::ops::Range;

use linesman_proto::address::{LogicalAddress, RegisterAddress};
use linesman_proto::register::FmmuConfig;
use linesman_proto::sii::Direction;

use super::super::{Ownership, Plan};
use crate::profile::ProcessSyncManager;

/// Single bits are written reliably only to the digital outputs, register 0x0F00 and the three bytes
/// behind it; elsewhere the other bits of the byte become undefined (facts, 2.10).
const BIT_WRITES: Range<u16> = 0x0F00..0x0F04;

/// A stretch of a controller's memory that one FMMU maps.
struct MappedArea {
    start: RegisterAddress,
    len: u16,
    bits: u32,
}

impl MappedArea {
    /// Whether it may share a byte with others.
    fn packs(&self, direction: Direction) -> bool {
        let writable = direction == Direction::Inputs || BIT_WRITES.contains(&self.start.0);
        self.bits < 8 && writable
    }
}

/// The process data of one direction, SyncManagers that lie side by side joined: a terminal with
/// two one-byte SyncManagers in a row needs one FMMU only, and may have no more.
fn areas(managers: &[ProcessSyncManager], direction: Direction) -> Vec<MappedArea> {
    let mut areas: Vec<MappedArea> = Vec::new();
    let mine = managers.iter().filter(|manager| manager.direction == direction && manager.len > 0);
    for manager in mine {
        match areas.last_mut() {
            // Only unbuffered (one-byte) SyncManagers end where the next begins.
            Some(last) if last.start.0.checked_add(last.len) == Some(manager.start.0) => {
                last.bits = u32::from(last.len) * 8 + manager.used_bits();
                last.len += manager.len;
            }
            Some(_) | None => {
                let (start, len, bits) = (manager.start, manager.len, manager.used_bits());
                areas.push(MappedArea { start, len, bits });
            }
        }
    }
    areas
}

/// Areas of one direction, one behind the other in one datagram. The process image runs along.
pub(super) struct Run {
    start: LogicalAddress,
    direction: Direction,
    pack: bool,
    /// Bits from the start.
    at: u32,
    owned: Vec<Ownership>,
}

impl Run {
    pub(super) fn new(start: LogicalAddress, direction: Direction, pack: bool) -> Self {
        Self { start, direction, pack, at: 0, owned: Vec::new() }
    }

    /// Gives the areas of device `member` their FMMUs and their places.
    pub(super) fn take(&mut self, plan: &mut Plan, member: usize, process: &[ProcessSyncManager]) {
        let direction = self.direction;
        let areas = areas(process, direction);
        // Two bitwise FMMUs of one direction would need a gap between them.
        let pack = self.pack && areas.len() == 1;
        let image_start = match direction {
            Direction::Outputs => plan.outputs_len,
            Direction::Inputs => plan.inputs_len,
        };
        for area in areas {
            let packs = pack && area.packs(direction);
            if !packs || self.at % 8 + area.bits > 8 {
                self.at = self.at.next_multiple_of(8);
            }
            let (byte, bit) = ((self.at / 8) as usize, (self.at % 8) as u8);
            let logical = LogicalAddress(self.start.0 + byte as u32);
            let mut fmmu = match direction {
                Direction::Outputs => FmmuConfig::outputs(logical, area.len, area.start),
                Direction::Inputs => FmmuConfig::inputs(logical, area.len, area.start),
            };
            let mut masks = Ownership::WHOLE;
            if packs {
                let last = bit + area.bits as u8 - 1;
                (fmmu.logical_start_bit, fmmu.logical_stop_bit) = (bit, last);
                masks = [0xFF << bit, 0xFF >> (7 - last)];
            }
            let Some(device) = plan.devices.get_mut(member) else { return };
            device.fmmus.push((device.fmmus.len() as u8, fmmu));
            let (len, image_at) = (usize::from(area.len), image_start + byte);
            let mine = match direction {
                Direction::Outputs => &mut device.outputs,
                Direction::Inputs => &mut device.inputs,
            };
            extend(mine, image_at, len);
            let range = byte..byte + len;
            self.owned.push(Ownership { device: device.id, direction, range, image_at, masks });
            self.at += if packs { area.bits } else { u32::from(area.len) * 8 };
        }
    }

    /// Who owns what of the bytes, and how many they are. The process image grows by as many.
    pub(super) fn finish(self, plan: &mut Plan) -> (Vec<Ownership>, usize) {
        let len = self.at.div_ceil(8) as usize;
        match self.direction {
            Direction::Outputs => plan.outputs_len += len,
            Direction::Inputs => plan.inputs_len += len,
        }
        (self.owned, len)
    }
}

fn extend(range: &mut Range<usize>, at: usize, len: usize) {
    if range.start == range.end {
        range.start = at;
    }
    range.end = at + len;
}
