//! Known SubDevices of a line before one of them is served.

use linesman_config::inventory::{FoundDevice, Inventory, label};
use linesman_proto::address::DeviceId;
use linesman_proto::sii::{Direction, Identity};

use super::DeviceReport;

/// A SubDevice.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct KnownDevice {
    /// Who it is within this run.
    pub(crate) id: DeviceId,
    /// Its station address.
    pub(crate) station: u16,
    /// Its alias; 0 for none.
    pub(crate) alias: u16,
    /// What people call it.
    pub(crate) name: Option<String>,
    /// Its order designation; may be empty.
    pub(crate) type_name: String,
    /// Who it says it is.
    pub(crate) identity: Option<Identity>,
    /// Whether it may have a mailbox.
    pub(crate) mailbox: bool,
    /// Whether OP needs somebody who sends it outputs in every cycle; a running MainDevice does.
    pub(crate) needs_cycle: bool,
    /// Whether it may have a mailbox in BOOT.
    pub(crate) boot: bool,
}

impl KnownDevice {
    /// `Term 4 (EL3104)`, or `SubDevice 4 (EL3104)` where it has no name.
    pub(crate) fn label(&self) -> String {
        label(self.id, self.name.as_deref().unwrap_or_default(), &self.type_name)
    }

    /// For a report.
    pub(crate) fn report(&self) -> DeviceReport {
        DeviceReport {
            no: self.id.no(),
            station: self.station,
            name: self.name.clone(),
            r#type: self.type_name.clone(),
        }
    }
}

/// All SubDevices that a scan found, with their names by index where there are any.
pub(super) fn all(inventory: &Inventory, names: &[String]) -> Vec<KnownDevice> {
    let known = |found: &FoundDevice| KnownDevice {
        id: found.id,
        station: found.station.0,
        alias: found.alias.0,
        name: names.get(found.id.index()).cloned(),
        type_name: found.profile.type_name.clone(),
        identity: found.identity,
        mailbox: found.profile.mailbox.is_some(),
        needs_cycle: found.profile.process_len(Direction::Outputs) > 0,
        boot: found.profile.mailbox.is_some_and(|mailbox| mailbox.bootstrap.is_some()),
    };
    inventory.devices.iter().map(known).collect()
}
