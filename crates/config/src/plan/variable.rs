//! Variables of the process image: what the bits are called, and of which type they are.

use linesman_proto::address::{DeviceId, RegisterAddress};
use linesman_proto::register::FmmuConfig;
use linesman_proto::sii::Direction;

use super::{Ownership, Plan, PlannedDevice};

/// A variable.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Variable {
    /// Whose.
    pub device: DeviceId,
    /// In the outputs or in the inputs.
    pub direction: Direction,
    /// `PDO.Entry`, such as `Channel 1.Value`; unique within the SubDevice and direction only where its
    /// description is careful.
    pub name: String,
    /// Type by its name in ETG.2000 (`BOOL`, `INT`, `UDINT`, …); empty where nothing is said.
    pub data_type: String,
    /// First bit, counted from the begin of the outputs or inputs of the process image.
    pub bit_at: usize,
    /// Bits.
    pub bits: usize,
}

impl Plan {
    /// Names the bits of the process image after the PDOs of the SubDevices.
    pub(super) fn name_variables(&mut self, devices: &[PlannedDevice]) {
        let mut variables = Vec::new();
        for (device, planned) in self.devices.iter().zip(devices) {
            for manager in &planned.profile.process {
                let (direction, mut bit) = (manager.direction, 0);
                for pdo in &planned.profile.pdos {
                    if (pdo.sync_manager, pdo.direction) != (manager.index, direction) {
                        continue;
                    }
                    for entry in &pdo.entries {
                        let at = bit;
                        bit += u32::from(entry.bits);
                        if entry.index == 0 {
                            continue;
                        }
                        let found = self.image_bit(device.id, direction, manager.start, at);
                        variables.extend(found.map(|bit_at| Variable {
                            device: device.id,
                            direction,
                            name: match pdo.name.as_str() {
                                "" => entry.name.clone(),
                                pdo => format!("{pdo}.{}", entry.name),
                            },
                            data_type: entry.data_type.clone(),
                            bit_at,
                            bits: usize::from(entry.bits),
                        }));
                    }
                }
            }
        }
        variables.sort_by_key(|one| (one.direction == Direction::Inputs, one.bit_at));
        self.variables = variables;
    }

    /// Where in the process image the bit lies that is `bit` bits behind `start` in the memory of a
    /// SubDevice's controller.
    #[must_use]
    pub fn image_bit(
        &self,
        device: DeviceId,
        direction: Direction,
        start: RegisterAddress,
        bit: u32,
    ) -> Option<usize> {
        let wanted = u32::from(start.0) * 8 + bit;
        let (logical, of_fmmu) = self.device(device)?.fmmus.iter().find_map(|(_, fmmu)| {
            let mine = match direction {
                Direction::Outputs => fmmu.writes,
                Direction::Inputs => fmmu.reads,
            };
            let behind = wanted.checked_sub(first_physical_bit(fmmu))?;
            let inside = mine && behind < fmmu.bit_len();
            inside.then(|| (first_logical_bit(fmmu) + u64::from(behind), fmmu))
        })?;
        let owned = self.owned(device, direction, of_fmmu)?;
        let (start, owned) = owned;
        let first_byte = u64::from(start) + owned.range.start as u64;
        let within = logical.checked_sub(first_byte * 8)?;
        Some(owned.image_at * 8 + usize::try_from(within).ok()?)
    }

    /// The ownership that an FMMU makes, and the logical address at which its datagram begins.
    fn owned(
        &self,
        device: DeviceId,
        direction: Direction,
        fmmu: &FmmuConfig,
    ) -> Option<(u32, &Ownership)> {
        use linesman_proto::frame::builder::DatagramAddress;
        self.datagrams().find_map(|(_, _, datagram)| {
            let DatagramAddress::Logical(start) = datagram.address else { return None };
            let at = fmmu.logical_start.0.checked_sub(start.0)? as usize;
            if at >= datagram.len {
                return None;
            }
            let mine = |owned: &&Ownership| {
                owned.device == device && owned.direction == direction && owned.range.contains(&at)
            };
            datagram.ownership.iter().find(mine).map(|owned| (start.0, owned))
        })
    }
}

fn first_physical_bit(fmmu: &FmmuConfig) -> u32 {
    u32::from(fmmu.physical_start.0) * 8 + u32::from(fmmu.physical_start_bit)
}

fn first_logical_bit(fmmu: &FmmuConfig) -> u64 {
    u64::from(fmmu.logical_start.0) * 8 + u64::from(fmmu.logical_start_bit)
}
