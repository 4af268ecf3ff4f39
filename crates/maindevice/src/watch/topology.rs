//! Topology list for programs: who hangs at which port of whom, who is there, and how many of the hot connect groups are.
//!
//! The form is that of the vendor's `ST_TopologyDataEx`, 64 bytes each (S0 L2609-2616; S1 L1225-1257).

use linesman_config::plan::Plan;
use linesman_proto::address::{DeviceId, Position};
use linesman_proto::port::{Port, PortMap};
use linesman_proto::topology::End;

use super::group_status::{GroupRefusal, GroupStatus};
use super::{NetworkStatus, WatchedDevice};

/// A SubDevice of the topology list.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct TopologyEntry {
    /// Who it is.
    pub id: DeviceId,
    /// Its station address.
    pub station: u16,
    /// Its place as auto-increment addresses count it: 0, 65535, 65534.
    pub auto_increment: u16,
    /// Whom the plan has at each port: station address and place; `None`: nobody, or the MainDevice.
    pub neighbours: PortMap<Option<(u16, u16)>>,
    /// [`TopologyEntry::CLOCK`] to [`TopologyEntry::MISPLACED_AT_B`] and those of C and D.
    pub status: u32,
    /// How many SubDevices of hot connect groups are planned in the network, and how many are there.
    pub group_counts: (u16, u16),
}

impl TopologyEntry {
    /// Its clock is in use.
    pub const CLOCK: u32 = 1;
    /// Its clock counts 64 bits.
    pub const CLOCK_64_BIT: u32 = 1 << 1;
    /// It is there.
    pub const PRESENT: u32 = 1 << 2;
    /// It is the first of a hot connect group.
    pub const GROUP_START: u32 = 1 << 3;
    /// It is in a hot connect group.
    pub const IN_GROUP: u32 = 1 << 4;
    /// At its port B a hot connect group is plugged in that may not be there; C and D are the next bits.
    pub const MISPLACED_AT_B: u32 = 1 << 5;

    /// Bytes of an entry.
    pub const LEN: usize = 64;

    /// The entry in the vendor's form, little endian.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; Self::LEN] {
        let at = |port: Port| self.neighbours[port].unwrap_or_default();
        let words = [self.station, self.auto_increment]
            .into_iter()
            .chain(Port::ALL.map(|port| at(port).0))
            .chain(Port::ALL.map(|port| at(port).1));
        let mut bytes = [0; Self::LEN];
        for (place, word) in bytes.chunks_exact_mut(2).zip(words) {
            place.copy_from_slice(&word.to_le_bytes());
        }
        let (planned, present) = self.group_counts;
        bytes[36..40].copy_from_slice(&self.status.to_le_bytes());
        bytes[40..42].copy_from_slice(&planned.to_le_bytes());
        bytes[42..44].copy_from_slice(&present.to_le_bytes());
        bytes
    }
}

impl NetworkStatus {
    /// The topology list: those that are always there in processing order, then the groups (HC-15, PLC-10). `plan` is
    /// that of this status.
    #[must_use]
    pub fn topology(&self, plan: &Plan) -> Vec<TopologyEntry> {
        let (planned, present) = self.hot_connect_counts();
        let group_counts = (planned as u16, present as u16);
        let entry = |id: DeviceId| {
            let device = plan.device(id)?;
            let group = plan.group_of(id);
            let bit = |set: bool, bits: u32| if set { bits } else { 0 };
            let is_present = self.device(id).and_then(|device| device.is_present());
            Some(TopologyEntry {
                id,
                station: device.station.0,
                auto_increment: auto_increment(id),
                neighbours: PortMap::from_fn(|port| neighbour(plan, id, port)),
                status: bit(device.settings.clock.is_some(), TopologyEntry::CLOCK)
                    | bit(is_present == Some(true), TopologyEntry::PRESENT)
                    | bit(
                        group.is_some_and(|group| group.first() == id),
                        TopologyEntry::GROUP_START,
                    )
                    | bit(group.is_some(), TopologyEntry::IN_GROUP)
                    | bit(
                        self.device(id).is_some_and(WatchedDevice::has_wide_clock),
                        TopologyEntry::CLOCK_64_BIT,
                    )
                    | self.misplaced_at(id),
                group_counts,
            })
        };
        self.topology_order().into_iter().filter_map(entry).collect()
    }
}

impl NetworkStatus {
    /// The ports of a SubDevice at which groups are that may not be there, as bits of the vendor's form.
    fn misplaced_at(&self, id: DeviceId) -> u32 {
        let refusals = self.groups().iter().filter_map(GroupStatus::refusal);
        refusals.fold(0, |bits, refusal| match refusal {
            GroupRefusal::Place(Some((at, port))) if at == id && port != Port::A => {
                bits | TopologyEntry::MISPLACED_AT_B << (port.index() - 1)
            }
            GroupRefusal::Place(_) | GroupRefusal::Number { .. } | GroupRefusal::Shared { .. } => {
                bits
            }
        })
    }
}

fn auto_increment(id: DeviceId) -> u16 {
    Position(id.index() as u16).auto_increment()
}

/// Whom the plan has at a port.
fn neighbour(plan: &Plan, id: DeviceId, port: Port) -> Option<(u16, u16)> {
    if id.index() >= plan.tree.len() || !plan.tree.is_open(id.index(), port) {
        return None;
    }
    let End::Controller(node, _) = plan.tree.opposite(End::Controller(id.index(), port))? else {
        return None;
    };
    let device = plan.devices.get(node)?;
    Some((device.station.0, auto_increment(device.id)))
}
