//! Inventory: the result of a scan.

use linesman_proto::address::{DeviceId, Position, StationAddress, StationAlias};
use linesman_proto::register::{AlStatus, DlStatus, ErrorCounters, EscInformation};
use linesman_proto::sii::Identity;
use linesman_proto::state::{AlState, AlStatusCode};
use linesman_proto::topology::{Reconstruction, Tree};

use crate::compare::There;
use crate::identity::RevisionRule;
use crate::plan::{DeviceSettings, PlannedDevice};
use crate::profile::DeviceProfile;

/// A SubDevice as it was found.
#[derive(Clone, Debug)]
pub struct FoundDevice {
    /// Who it is within this run.
    pub id: DeviceId,
    /// Its place in the order of processing at the time of the scan.
    pub position: Position,
    /// Station address it has; 0 if none.
    pub station: StationAddress,
    /// Station alias; 0 if none.
    pub alias: StationAlias,
    /// Who it says it is; `None` when its SII could not be read.
    pub identity: Option<Identity>,
    /// What its SII says it needs.
    pub profile: DeviceProfile,
    /// Its controller.
    pub information: EscInformation,
    /// Its state.
    pub al_status: AlStatus,
    /// The reason, when it reports an error.
    pub al_code: AlStatusCode,
    /// Its ports.
    pub dl_status: DlStatus,
    /// Its error counters as they stood: history, not yet evidence.
    pub counters: ErrorCounters,
    /// What was odd about its SII, in words.
    pub sii_trouble: Option<String>,
}

impl FoundDevice {
    /// The name people know it by: "SubDevice 3 (EL1008)".
    #[must_use]
    pub fn label(&self) -> String {
        label(self.id, "", &self.profile.type_name)
    }
}

/// What people call a SubDevice, everywhere: its name, with its type in parentheses, `Term 4 (EL3104)`; one without a
/// name by its number, `SubDevice 4 (EL3104)`, and `SubDevice 4` where nothing is known of it. A name that says the
/// type itself stays as it is.
#[must_use]
pub fn label(id: DeviceId, name: &str, type_name: &str) -> String {
    let no = id.no();
    let numbered = format!("SubDevice {no}");
    // Scans of earlier versions called SubDevices "4 (EL3104)".
    let old = name.strip_prefix(&format!("{no} (")).and_then(|rest| rest.strip_suffix(')'));
    let is_name = old.is_none() && name != no.to_string() && name != type_name;
    let base = if is_name && !name.is_empty() { name } else { numbered.as_str() };
    match old.unwrap_or(type_name) {
        "" => base.to_owned(),
        kind if base.contains(kind) => base.to_owned(),
        kind => format!("{base} ({kind})"),
    }
}

/// All SubDevices of a network and how they are wired.
#[derive(Clone, Debug)]
pub struct Inventory {
    /// In processing order; the index is the [`DeviceId`].
    pub devices: Vec<FoundDevice>,
    /// How they are wired, with what is doubtful about it. Node *n* is device *n*.
    pub wiring: Reconstruction,
}

impl Inventory {
    /// The wiring.
    #[must_use]
    pub fn tree(&self) -> &Tree {
        &self.wiring.tree
    }

    /// The name people know a SubDevice by, or its number.
    #[must_use]
    pub fn label(&self, id: DeviceId) -> String {
        self.devices.get(id.index()).map_or_else(|| label(id, "", ""), FoundDevice::label)
    }

    /// What was found, for a comparison with what was planned.
    #[must_use]
    pub fn there(&self) -> Vec<There> {
        let there = |found: &FoundDevice| There {
            identity: found.identity,
            alias: Some(found.alias.value()),
        };
        self.devices.iter().map(there).collect()
    }

    /// A plan's devices made of what is there: everything as found, driven to `target`.
    #[must_use]
    pub fn planned(&self, target: AlState) -> Vec<PlannedDevice> {
        let planned = |found: &FoundDevice| PlannedDevice {
            name: found.label(),
            station: found.station,
            identity: found.identity.unwrap_or_default(),
            revision_rule: RevisionRule::Equal,
            profile: found.profile.clone(),
            target,
            start_up: Vec::new(),
            settings: DeviceSettings::default(),
        };
        self.devices.iter().map(planned).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_subdevice_is_called_by_name_and_type_or_by_its_number() {
        for (name, type_name, expected) in [
            ("Term 4", "EL3104", "Term 4 (EL3104)"),
            ("Term 4 (EL3104)", "EL3104", "Term 4 (EL3104)"),
            ("B3", "", "B3"),
            ("", "EL3104", "SubDevice 4 (EL3104)"),
            ("EL3104", "EL3104", "SubDevice 4 (EL3104)"),
            ("", "", "SubDevice 4"),
            ("4", "EL3104", "SubDevice 4 (EL3104)"),
            ("SubDevice 4", "EL3104", "SubDevice 4 (EL3104)"),
            ("4 (EL3104)", "", "SubDevice 4 (EL3104)"),
            ("4 (EL3104)", "EL3104", "SubDevice 4 (EL3104)"),
            ("5 (left)", "EL3104", "5 (left) (EL3104)"),
        ] {
            assert_eq!(label(DeviceId(3), name, type_name), expected, "{name}, {type_name}");
        }
    }
}
