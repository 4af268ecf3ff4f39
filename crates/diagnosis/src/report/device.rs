//! SubDevices in the report: identities and states.

use serde::{Deserialize, Serialize};

use crate::model::{Device, NetworkModel, Seen};

/// A SubDevice. What the input does not say is `null`.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct DeviceReport {
    /// Its number, from 1.
    pub no: u32,
    /// Its name in the project.
    pub name: Option<String>,
    /// Its type: from the project, from its SII, or from CoE 0x1008.
    #[serde(rename = "type")]
    pub type_name: Option<String>,
    /// Its station address.
    pub station: Option<u16>,
    /// Its station alias.
    pub alias: Option<u16>,
    /// Vendor: SII word 0x08, or CoE 0x1018:01.
    pub vendor_id: Option<u32>,
    /// Product code: SII word 0x0A, or CoE 0x1018:02.
    pub product_code: Option<u32>,
    /// Revision: SII word 0x0C, or CoE 0x1018:03.
    pub revision: Option<u32>,
    /// Serial number: SII word 0x0E, or CoE 0x1018:04.
    pub serial: Option<u32>,
    /// Its EtherCAT chip: registers 0x0000 and 0x0001.
    pub chip: Option<String>,
    /// The last state that was read: `INIT`, `BOOT`, `PREOP`, `SAFEOP`, `OP`.
    pub state: Option<String>,
    /// The AL status code, while it reports an error.
    pub al_status_code: Option<u16>,
    /// Whether it answered when it was last asked; `null` when nobody asked it.
    pub answers: Option<bool>,
}

impl DeviceReport {
    /// Whether anything of its identity was seen.
    #[must_use]
    pub const fn has_identity(&self) -> bool {
        self.vendor_id.is_some()
            || self.product_code.is_some()
            || self.revision.is_some()
            || self.serial.is_some()
    }

    /// A SubDevice as the model knows it.
    #[must_use]
    pub fn of(device: &Device) -> Self {
        let value = |seen: Option<Seen<u32>>| seen.map(|seen| seen.value);
        let identity = &device.identity;
        let code = device.al.code.filter(|_| device.al.has_error());
        Self {
            no: device.id.no(),
            name: device.name.clone(),
            type_name: device.type_name.clone(),
            station: device.station.map(|station| station.value()),
            alias: device.alias.map(|alias| alias.0),
            vendor_id: value(identity.vendor_id),
            product_code: value(identity.product_code),
            revision: value(identity.revision),
            serial: value(identity.serial),
            chip: device.chip.map(|chip| chip.value.name().to_owned()),
            state: device.al.state().map(|state| state.name().to_owned()),
            al_status_code: code.map(|code| code.value.value()),
            answers: match (device.silent, device.answered) {
                (Some(_), _) => Some(false),
                (None, Some(_)) => Some(true),
                (None, None) => None,
            },
        }
    }
}

/// All SubDevices of a line.
pub(crate) fn reports(model: Option<&NetworkModel>) -> Vec<DeviceReport> {
    model.map_or_else(Vec::new, |model| model.devices.iter().map(DeviceReport::of).collect())
}
