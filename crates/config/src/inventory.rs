//! What is there: the result of a scan.

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
    /// The name people know it by: "3 (EL1008)".
    #[must_use]
    pub fn label(&self) -> String {
        label(self.id, &self.profile.type_name)
    }
}

/// Number and name, or type, of a SubDevice in one word. A name that says so itself, as a saved scan gives them, is
/// not put into brackets once more.
#[must_use]
pub fn label(id: DeviceId, name: &str) -> String {
    let no = id.no();
    let says_so = name.strip_prefix(&format!("{no} (")).is_some_and(|rest| rest.ends_with(')'));
    match name {
        "" => no.to_string(),
        name if says_so => name.to_owned(),
        name => format!("{no} ({name})"),
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
        self.devices.get(id.index()).map_or_else(|| id.no().to_string(), FoundDevice::label)
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
