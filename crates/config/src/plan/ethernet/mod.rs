//! Ethernet over EtherCAT of a plan: who has a port of the virtual switch, addresses and sizes that cannot work, the
//! throughput to expect, routes into other subnets.

mod address;
mod full_pause;
mod rate;
mod route;
mod subnet;

use linesman_proto::address::DeviceId;
use linesman_proto::mailbox::eoe::IpParameters;
use linesman_proto::sii::Protocols;

use super::{DevicePlan, Doubt, Plan, Severity};
use crate::start_up::StartUpAction;

pub use full_pause::FullPause;
pub use rate::{ACYCLIC_FRAMES, EthernetRate, MAILBOX_STATUSES, RateLimit};
pub use route::{EthernetRoute, RouteStep};
pub use subnet::Subnet;

/// Sizes of a virtual switch, and what it has to bear (EOE-04).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SwitchSizes {
    /// Ports for SubDevices.
    pub ports: usize,
    /// Hardware addresses that it knows at once.
    pub macs: usize,
    /// End points that are reached through it at once, those that come and go counted in; `None`: one for each SubDevice,
    /// and this computer.
    pub end_points: Option<usize>,
}

impl DevicePlan {
    /// True for a SubDevice that speaks EoE, and whose frames are passed on (EOE-03).
    #[must_use]
    pub fn has_ethernet_port(&self) -> bool {
        let speaks = self.mailbox.is_some_and(|mailbox| mailbox.protocols.has(Protocols::EOE));
        speaks && self.settings.keeping.forward_ethernet
    }

    /// The addresses that its start-up commands set by EoE; `None` when they set none.
    #[must_use]
    pub fn ethernet_addresses(&self) -> Option<IpParameters> {
        let mut all: Option<IpParameters> = None;
        for command in &self.start_up {
            if let StartUpAction::SetAddresses { parameters, .. } = &command.action
                && let Some(newer) = IpParameters::parse(parameters)
            {
                all = Some(all.unwrap_or_default().merged(newer));
            }
        }
        all
    }

    /// Its IP address with its subnet, where start-up commands set a fixed one.
    #[must_use]
    pub fn ethernet_subnet(&self) -> Option<Subnet> {
        let addresses = self.ethernet_addresses()?;
        let ip = addresses.ip.filter(|ip| *ip != [0; 4])?;
        Some(Subnet::of_mask(ip, addresses.mask))
    }
}

impl Plan {
    /// The SubDevices that have a port of the virtual switch, by their numbers.
    pub fn ethernet_devices(&self) -> impl Iterator<Item = &DevicePlan> {
        self.devices.iter().filter(|device| device.has_ethernet_port())
    }

    /// What of a virtual switch is too small for the plan.
    #[must_use]
    pub fn switch_doubts(&self, sizes: &SwitchSizes) -> Vec<Doubt> {
        let devices = self.ethernet_devices().count();
        let mut doubts = Vec::new();
        if devices > sizes.ports {
            doubts.push(Doubt {
                severity: Severity::Error,
                name: "eoe-ports",
                device: None,
                text: format!(
                    "the virtual switch has {} ports for {devices} SubDevices that speak EoE: the last ones are not reached",
                    sizes.ports
                ),
                advice: format!("give it {devices} ports (`--eoe-ports {devices}`), or switch EoE off where nobody needs it (`eoe = false`)"),
            });
        }
        let end_points = sizes.end_points.unwrap_or(devices + 1);
        if devices > 0 && end_points > sizes.macs {
            doubts.push(Doubt {
                severity: Severity::Warning,
                name: "eoe-macs",
                device: None,
                text: format!(
                    "the virtual switch knows {} hardware addresses for {end_points} end points: frames to the others go to all",
                    sizes.macs
                ),
                advice: format!("let it know as many as there are (`--eoe-macs {end_points}`)"),
            });
        }
        doubts
    }

    fn ethernet_name(&self, id: DeviceId) -> &str {
        self.device(id).map_or("", |device| device.name.as_str())
    }
}

#[cfg(test)]
mod tests;
