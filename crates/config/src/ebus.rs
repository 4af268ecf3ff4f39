//! The budget of the E-bus: what each feeder supplies, and what is left of it behind each terminal
//! (HW-04, HW-05).
//!
//! A group is a feeder (a SubDevice with a negative current: coupler or power feed) and all that hang
//! behind it on the E-bus up to the next feeder. The currents are those of the makers' descriptions, on
//! paper or as the SII of each SubDevice says them.

use linesman_proto::address::DeviceId;
use linesman_proto::port::PortMap;
use linesman_proto::sii::PortKind;
use linesman_proto::topology::Tree;

use crate::inventory::Inventory;
use crate::plan::Plan;

/// What the budget wants to know of a SubDevice.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Draw<'a> {
    /// Who; node *n* of the tree is device *n*.
    pub device: DeviceId,
    /// What it takes in mA; negative is what it supplies. `None`: not said.
    pub current_ma: Option<i16>,
    /// What its ports are; `None`: not said.
    pub ports: Option<&'a PortMap<PortKind>>,
}

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

/// An E-bus that is fed too little.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Overload {
    /// The first for whom too little is left.
    pub first: DeviceId,
    /// Who feeds whom, and how much is missing.
    pub text: String,
    /// What to do.
    pub advice: String,
}

impl EbusGroup {
    /// The first for whom too little is left: a power feed belongs before it.
    #[must_use]
    pub fn first_negative(&self) -> Option<DeviceId> {
        self.members.iter().find(|member| member.remaining_ma < 0).map(|member| member.device)
    }

    /// What is too little, in words, if anything is.
    #[must_use]
    pub fn overload(&self, name: impl Fn(DeviceId) -> String) -> Option<Overload> {
        let first = self.first_negative()?;
        let least = self.members.iter().map(|member| member.remaining_ma).min().unwrap_or(0);
        Some(Overload {
            first,
            text: format!(
                "the E-bus behind {} is overloaded from {} on: {} mA are missing at its end",
                name(self.feeder),
                name(first),
                -least
            ),
            advice: format!("insert a power feed terminal (EL94xx) before {}", name(first)),
        })
    }

    /// What all of them take together, in mA.
    #[must_use]
    pub fn taken_ma(&self) -> i32 {
        self.members.iter().map(|member| member.current_ma).sum()
    }
}

/// The groups, in the order of their feeders. `draws` come in the order of processing, so that whoever
/// feeds comes before those that are fed.
#[must_use]
pub fn groups<'a>(tree: &Tree, draws: impl IntoIterator<Item = Draw<'a>>) -> Vec<EbusGroup> {
    let mut groups: Vec<EbusGroup> = Vec::new();
    // Which group a SubDevice belongs to.
    let mut group_of: Vec<Option<usize>> = vec![None; tree.len()];
    for draw in draws {
        let node = draw.device.index();
        if node >= tree.len() {
            continue;
        }
        let current = i32::from(draw.current_ma.unwrap_or(0));
        if current < 0 {
            group_of[node] = Some(groups.len());
            let (feeder, members) = (draw.device, Vec::new());
            groups.push(EbusGroup { feeder, supply_ma: -current, members });
            continue;
        }
        let above = tree.parent(node).filter(|_| is_entered_by_ebus(tree, &draw));
        let group = above.and_then(|parent| group_of.get(parent).copied().flatten());
        let Some(group) = group else { continue };
        group_of[node] = Some(group);
        let EbusGroup { supply_ma, members, .. } = &mut groups[group];
        let before = members.last().map_or(*supply_ma, |last| last.remaining_ma);
        let remaining_ma = before - current;
        members.push(EbusMember { device: draw.device, current_ma: current, remaining_ma });
    }
    groups
}

/// Whether frames come to it by a contact. Where nothing is said of its ports, one that takes current
/// from the E-bus is on it.
fn is_entered_by_ebus(tree: &Tree, draw: &Draw<'_>) -> bool {
    match draw.ports {
        Some(ports) => ports[tree.entry(draw.device.index())] == PortKind::EBus,
        None => draw.current_ma.is_some_and(|current| current > 0),
    }
}

impl Plan {
    /// The groups, in the order of their feeders.
    #[must_use]
    pub fn ebus_groups(&self) -> Vec<EbusGroup> {
        let draws = self.devices.iter().map(|device| Draw {
            device: device.id,
            current_ma: device.ebus_current_ma,
            ports: device.ports.as_ref(),
        });
        groups(&self.tree, draws)
    }
}

impl Inventory {
    /// The groups, in the order of their feeders, by what the SII of each SubDevice says.
    #[must_use]
    pub fn ebus_groups(&self) -> Vec<EbusGroup> {
        let draws = self.devices.iter().map(|found| Draw {
            device: found.id,
            current_ma: found.profile.ebus_current_ma,
            ports: found.profile.ports.as_ref(),
        });
        groups(self.tree(), draws)
    }
}
