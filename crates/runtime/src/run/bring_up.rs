//! Report of bringing a line up, step by step: for the network, and for each SubDevice.

use linesman_config::plan::Plan;
use linesman_maindevice::{BringUpTimes, Phase};
use linesman_proto::time::Span;
use serde::{Deserialize, Serialize};

/// What bringing up took so far.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct BringUpReport {
    /// Until all SubDevices had reached their targets for the first time, in ns; `null`: they have not.
    pub took_ns: Option<u64>,
    /// What was done for all at once, in order.
    pub network: Vec<PhaseReport>,
    /// What each SubDevice took, since it was last brought up from INIT. They are brought up side by
    /// side, so that the sum of all is longer than the whole.
    pub devices: Vec<DeviceBringUp>,
}

/// A step.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct PhaseReport {
    /// Its name: `identify and address`, `set up for SAFEOP`, `change to OP`.
    pub phase: String,
    /// How long it took, in ns.
    pub took_ns: u64,
}

/// The steps of a SubDevice.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct DeviceBringUp {
    /// Its number, from 1.
    pub no: u32,
    /// Its name.
    pub name: String,
    /// Its steps in the order in which they ended. One that was refused and tried again stands there
    /// twice.
    pub phases: Vec<PhaseReport>,
}

impl DeviceBringUp {
    /// All its steps together, in ns.
    #[must_use]
    pub fn total_ns(&self) -> u64 {
        self.phases.iter().map(|phase| phase.took_ns).sum()
    }
}

fn phase((phase, took): &(Phase, Span)) -> PhaseReport {
    PhaseReport { phase: phase.to_string(), took_ns: took.as_nanos() }
}

impl BringUpReport {
    pub(super) fn of(plan: &Plan, times: &BringUpTimes) -> Self {
        let devices =
            plan.devices.iter().zip(&times.devices).map(|(device, times)| DeviceBringUp {
                no: device.id.no(),
                name: device.name.clone(),
                phases: times.phases.iter().map(phase).collect(),
            });
        Self {
            took_ns: times.took().map(Span::as_nanos),
            network: times.network.iter().map(phase).collect(),
            devices: devices.collect(),
        }
    }

    /// For each step that SubDevices took: its name, who took longest for it, and how long in ns. In the
    /// order in which the first SubDevice did them.
    #[must_use]
    pub fn slowest(&self) -> Vec<(&str, &DeviceBringUp, u64)> {
        let mut slowest: Vec<(&str, &DeviceBringUp, u64)> = Vec::new();
        for device in &self.devices {
            for phase in &device.phases {
                let known = slowest.iter_mut().find(|(name, ..)| *name == phase.phase);
                match known {
                    Some(known) if known.2 < phase.took_ns => {
                        (known.1, known.2) = (device, phase.took_ns);
                    }
                    Some(_) => {}
                    None => slowest.push((&phase.phase, device, phase.took_ns)),
                }
            }
        }
        slowest
    }
}
