//! Hot connect: groups of SubDevices that join and leave while the network runs (HC-01, HC-02), and the
//! numbers that tell equal SubDevices apart (HC-04 to HC-07).

use std::fmt;

use linesman_proto::address::{DeviceId, RegisterAddress};
use linesman_proto::sii::Identity;
use linesman_proto::topology::End;

use super::{DevicePlan, Plan};
use crate::identity::mismatch;

/// A group of SubDevices that may be absent, and may be plugged in at another place than planned.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct HotConnectGroup {
    /// Name for people, unique in the network.
    pub name: String,
    /// The first SubDevice, which is identified, then those behind it, in processing order.
    pub members: Vec<DeviceId>,
    /// It may be absent when the network starts, and leave later; else its absence is an error.
    pub optional: bool,
    /// Ports at which it may be plugged in; empty: any free port.
    pub places: Vec<End>,
}

impl HotConnectGroup {
    /// The SubDevice by which the group is entered and identified.
    #[must_use]
    pub fn first(&self) -> DeviceId {
        self.members.first().copied().unwrap_or(DeviceId(u32::MAX))
    }
}

/// Where a SubDevice tells the number by which it is told apart from its equals.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum IdentificationSource {
    /// Its selector, asked for by bit 5 of AL control, read from 0x0134.
    AlStatus,
    /// Its selector, in a word of its memory.
    Memory(RegisterAddress),
    /// The station alias, loaded from its EEPROM into 0x0012.
    Alias,
    /// The serial number in its EEPROM.
    Serial,
}

impl fmt::Display for IdentificationSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::AlStatus => f.write_str("selector, read by AL control"),
            Self::Memory(address) => write!(f, "selector, read at {address}"),
            Self::Alias => f.write_str("station alias"),
            Self::Serial => f.write_str("serial number"),
        }
    }
}

/// The number that a SubDevice must tell.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct IdentificationCheck {
    /// Where it is read.
    pub source: IdentificationSource,
    /// The number; 1 to 65535, for a serial number up to 32 bits.
    pub value: u32,
    /// A SubDevice with another number is not driven; else the difference is told only (HC-14).
    pub compulsory: bool,
}

impl Plan {
    /// The group that a SubDevice belongs to, if any.
    #[must_use]
    pub fn group_of(&self, id: DeviceId) -> Option<&HotConnectGroup> {
        self.groups.iter().find(|group| group.members.contains(&id))
    }

    /// True if a SubDevice may be absent without an error.
    #[must_use]
    pub fn is_optional(&self, id: DeviceId) -> bool {
        self.group_of(id).is_some_and(|group| group.optional)
    }

    /// The planned SubDevice of this type that is to tell this number at this source; `None` where
    /// none is planned.
    #[must_use]
    pub fn device_with(
        &self,
        found: &Identity,
        source: IdentificationSource,
        number: u32,
    ) -> Option<&DevicePlan> {
        let fits = |device: &&DevicePlan| {
            let is_meant =
                |check: IdentificationCheck| check.source == source && check.value == number;
            let planned = Identity { serial_number: 0, ..device.identity };
            device.settings.identification.is_some_and(is_meant)
                && mismatch(&planned, found, device.revision_rule).is_none()
        };
        self.devices.iter().find(fits)
    }
}
