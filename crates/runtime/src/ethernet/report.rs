//! Counts of a virtual switch, as JSON and for people.

use serde::{Deserialize, Serialize};

/// What has gone through the virtual switch of a run.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct EthernetReport {
    /// The network interface of this computer; `null`: the SubDevices have the switch for themselves.
    pub interface: Option<String>,
    /// Why nothing goes through the interface any more; `null`: it works.
    #[serde(default)]
    pub failure: Option<String>,
    /// Hardware addresses that are known now.
    pub addresses: u32,
    /// Frames that came in by the interface.
    pub from_host: u64,
    /// Frames that went out by the interface.
    pub to_host: u64,
    /// Frames for the interface, and from it, that were dropped: the buffer was full, it was down, there were too many
    /// to all, or they were none.
    pub host_dropped: u64,
    /// Messages of SubDevices that found no room on their way to the switch.
    pub missed: u64,
    /// The SubDevices that speak EoE and have a port.
    pub ports: Vec<EthernetPortReport>,
    /// SubDevices that speak EoE and found no free port, by name.
    #[serde(default)]
    pub without_port: Vec<String>,
}

impl EthernetReport {
    /// True if nobody uses the switch: no SubDevice speaks EoE, and there is no interface.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.interface.is_none() && self.ports.is_empty() && self.without_port.is_empty()
    }
}

/// A port of the switch: one SubDevice.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct EthernetPortReport {
    /// Number of the SubDevice, from 1.
    pub no: u32,
    /// Its name.
    pub name: String,
    /// Frames that were sent to it.
    pub frames_to: u64,
    /// Fragments of them.
    pub fragments_to: u64,
    /// Frames that came from it.
    pub frames_from: u64,
    /// Fragments of them.
    pub fragments_from: u64,
    /// Frames from it of which a fragment did not come, came twice, or out of order.
    pub lost: u64,
    /// How often a mailbox message was sent or fetched again because an EtherCAT frame was lost.
    pub resent: u64,
    /// Frames to it that its mailbox did not take: it is not open yet, or was full for too long.
    pub refused: u64,
    /// Frames to it that found the buffer of its port full.
    pub dropped: u64,
    /// Frames from it to all beyond the limit, and frames that no Ethernet frame looks like.
    pub withheld: u64,
    /// The most frames that waited for it at once.
    pub most_waiting: u64,
}
