//! Several readings in time: what was read again later, or earlier.

use serde::Deserialize;

use super::device::{ObservedPort, Ports, check_counters, check_state};
use super::main_device::ObservedMainDevice;
use super::value::{Count, Date, Word};
use super::working_counter::ObservedWorkingCounter;
use linesman_proto::port::Port;

/// A further reading of the same line. What it does not give was not read then.
#[derive(Clone, PartialEq, Default, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Reading {
    /// When, by the clock on the wall, such as `2026-11-20T10:00:00`.
    #[serde(default)]
    pub at: Option<Date>,
    /// When, in seconds since any beginning.
    #[serde(default)]
    pub at_s: Option<f64>,
    /// What was read of SubDevices.
    #[serde(default, rename = "device")]
    pub devices: Vec<ReadDevice>,
    /// What the MainDevice counted by then.
    #[serde(default)]
    pub maindevice: Option<ObservedMainDevice>,
    /// Working counters.
    #[serde(default, rename = "working_counter")]
    pub working_counters: Vec<ObservedWorkingCounter>,
}

/// What a reading has of a SubDevice.
#[derive(Clone, PartialEq, Default, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ReadDevice {
    /// Its number, instead of its name.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schemars(range(min = 1)))]
    pub no: Option<u32>,
    /// Its name.
    #[serde(default)]
    pub name: Option<String>,
    /// Its state, as an online list writes it.
    #[serde(default)]
    pub state: Option<String>,
    /// AL status code, register 0x0134.
    #[serde(default)]
    pub al_code: Option<Word>,
    /// What was read of its ports.
    #[serde(default)]
    pub ports: Ports<ReadPort>,
    /// Processing unit errors, register 0x030C.
    #[serde(default)]
    pub processing_unit: Option<Count>,
    /// Damaged frames of all ports together.
    #[serde(default)]
    pub crc: Option<Count>,
    /// How often it left its state without being asked, as a tool counts it.
    #[serde(default)]
    pub state_changes: Option<Count>,
    /// How often it was gone, as a tool counts it.
    #[serde(default)]
    pub absences: Option<Count>,
    /// Whether a tool says that its configuration failed (IgH: flag `E`; TwinCAT: `INIT_ERR`).
    #[serde(default)]
    pub configuration_failed: Option<bool>,
    /// Whether a tool says that its clock did not get in step (IgH: `did not sync`).
    #[serde(default)]
    pub clock_failed: Option<bool>,
}

/// What a reading has of a port.
#[derive(Clone, PartialEq, Eq, Default, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ReadPort {
    /// Whether it has a link.
    #[serde(default)]
    pub link: Option<bool>,
    /// Whether its loop is open, so that frames pass; as the link unless said.
    #[serde(default)]
    pub open: Option<bool>,
    /// Whether it has communication; as the link unless said.
    #[serde(default)]
    pub communication: Option<bool>,
    /// RX error register: bad frames in the low byte, bad symbols in the high one.
    #[serde(default)]
    pub rx: Option<Word>,
    /// Bad frames, instead of `rx`.
    #[serde(default)]
    pub frame: Option<Count>,
    /// Bad symbols, instead of `rx`.
    #[serde(default)]
    pub physical: Option<Count>,
    /// Frames that were marked as bad before.
    #[serde(default)]
    pub forwarded: Option<Count>,
    /// Lost links.
    #[serde(default)]
    pub lost_link: Option<Count>,
    /// Whether a tool adds these up, so that 255 is not their end.
    #[serde(default)]
    pub total: bool,
}

impl ReadPort {
    /// As a port of the file itself.
    pub(crate) const fn observed(&self) -> ObservedPort {
        ObservedPort {
            link: self.link,
            open: self.open,
            communication: self.communication,
            rx: self.rx,
            frame: self.frame,
            physical: self.physical,
            forwarded: self.forwarded,
            lost_link: self.lost_link,
            total: self.total,
            before: None,
        }
    }
}

impl ReadDevice {
    /// How the reading names it.
    pub(super) fn label(&self) -> Option<String> {
        self.name.clone().or_else(|| self.no.map(|no| no.to_string()))
    }

    /// What is wrong with its values.
    pub(super) fn check(&self) -> Result<(), String> {
        check_state(self.state.as_deref())?;
        for (port, read) in self.ports.all().iter() {
            if let Some(read) = read {
                check_counters(port, &read.observed().counters())?;
            }
        }
        Ok(())
    }

    /// A port, to be filled in.
    pub fn port_mut(&mut self, port: Port) -> &mut ReadPort {
        self.ports.port_mut(port).get_or_insert_default()
    }
}
