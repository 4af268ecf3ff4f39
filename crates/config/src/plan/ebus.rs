//! The budget of the E-bus: what each feeder supplies, and what is left of it behind each terminal
//! (HW-04, HW-05).
//!
//! A group is a feeder (a SubDevice with a negative current: coupler or power feed) and all that hang
//! behind it on the E-bus up to the next feeder.

use linesman_proto::address::DeviceId;
use linesman_proto::sii::PortKind;

use super::{DevicePlan, Plan};

/// A feeder and those it feeds.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct EbusGroup {
    /// Who feeds.
    pub feeder: DeviceId,
    /// What it supplies, in mA.
    pub supply_ma: i32,
    /// Whom, in processing order.
    pub members: Vec<EbusMember>,
}

/// A SubDevice that is fed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct EbusMember {
    /// Who.
    pub device: DeviceId,
    /// What it takes, in mA.
    pub current_ma: i32,
    /// What is left behind it, in mA.
    pub remaining_ma: i32,
}

impl EbusGroup {
    /// The first for whom too little is left: a power feed belongs before it.
    #[must_use]
    pub fn first_negative(&self) -> Option<DeviceId> {
        self.members.iter().find(|member| member.remaining_ma < 0).map(|member| member.device)
    }
}

impl Plan {
    /// The groups, in the order of their feeders.
    #[must_use]
    pub fn ebus_groups(&self) -> Vec<EbusGroup> {
        let mut groups: Vec<EbusGroup> = Vec::new();
        // Which group a SubDevice belongs to.
        let mut group_of: Vec<Option<usize>> = vec![None; self.devices.len()];
        for device in &self.devices {
            let node = device.id.index();
            let current = i32::from(device.ebus_current_ma.unwrap_or(0));
            if current < 0 {
                group_of[node] = Some(groups.len());
                let (feeder, members) = (device.id, Vec::new());
                groups.push(EbusGroup { feeder, supply_ma: -current, members });
                continue;
            }
            let above = self.tree.parent(node).filter(|_| self.is_entered_by_ebus(device));
            let group = above.and_then(|parent| group_of.get(parent).copied().flatten());
            let Some(group) = group else { continue };
            group_of[node] = Some(group);
            let EbusGroup { supply_ma, members, .. } = &mut groups[group];
            let before = members.last().map_or(*supply_ma, |last| last.remaining_ma);
            let remaining_ma = before - current;
            members.push(EbusMember { device: device.id, current_ma: current, remaining_ma });
        }
        groups
    }

    /// Whether frames come to it by a contact. Where nothing is said of its ports, one that takes current
    /// from the E-bus is on it.
    fn is_entered_by_ebus(&self, device: &DevicePlan) -> bool {
        let entry = self.tree.entry(device.id.index());
        match &device.ports {
            Some(ports) => ports[entry] == PortKind::EBus,
            None => device.ebus_current_ma.is_some_and(|current| current > 0),
        }
    }
}
