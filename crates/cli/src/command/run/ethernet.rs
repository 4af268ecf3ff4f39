//! Options of the virtual switch of a run: Ethernet over EtherCAT.

use std::net::Ipv4Addr;

use linesman_config::plan::ethernet::Subnet;
use linesman_link::socket::{TapError, TapInterface, WakeHandle};
use linesman_maindevice::virtual_switch::SwitchLimits;
use linesman_runtime::ethernet::{EthernetReport, VirtualEthernet};

use crate::failure::Failure;
use crate::text::quantity::count;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(super) struct EthernetArguments {
    /// Make a network interface of this name (eoe0) whose cable leads to the SubDevices that speak EoE; it is removed at
    /// the end. A virtual segment then goes no faster than the clock
    #[arg(long, value_name = "NAME")]
    eoe: Option<String>,
    /// Switch that interface on with this address and subnet (192.168.1.100/24)
    #[arg(long, value_name = "ADDRESS/BITS", requires = "eoe", value_parser = subnet)]
    eoe_address: Option<Subnet>,
    /// SubDevices that the virtual switch has ports for
    #[arg(long, value_name = "COUNT", default_value_t = SwitchLimits::default().ports as u32, value_parser = clap::value_parser!(u32).range(1..=65_535))]
    eoe_ports: u32,
    /// Hardware addresses that the virtual switch knows at once
    #[arg(long, value_name = "COUNT", default_value_t = SwitchLimits::default().macs as u32, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    eoe_macs: u32,
    /// Frames that wait at each of its ports before more are dropped
    #[arg(long, value_name = "COUNT", default_value_t = SwitchLimits::default().frames as u32, value_parser = clap::value_parser!(u32).range(1..=65_536))]
    eoe_frames: u32,
}

/// An address of a subnet that has room for others.
fn subnet(text: &str) -> Result<Subnet, String> {
    let subnet: Subnet = text.parse()?;
    let has_room = subnet.bits <= 30;
    has_room.then_some(subnet).ok_or_else(|| format!("{subnet}: expected a subnet of 1 to 30 bits"))
}

impl EthernetArguments {
    /// Whether an interface is wanted.
    pub(super) const fn wants_interface(&self) -> bool {
        self.eoe.is_some()
    }

    /// Makes the interface, if one is wanted, and the switch.
    pub(super) fn open(&self, wake_handle: WakeHandle) -> Result<VirtualEthernet, Failure> {
        let limits = SwitchLimits {
            ports: self.eoe_ports as usize,
            macs: self.eoe_macs as usize,
            frames: self.eoe_frames as usize,
            ..SwitchLimits::default()
        };
        let tap = self.tap().map_err(|error| Failure::from_error(&error))?;
        VirtualEthernet::open(tap, limits, wake_handle).map_err(|error| {
            let reason = format!("starting the virtual switch: {error}");
            Failure::new(reason, "end other programs on this computer, and start again")
        })
    }

    fn tap(&self) -> Result<Option<TapInterface>, TapError> {
        let Some(name) = &self.eoe else { return Ok(None) };
        let tap = TapInterface::open(name)?;
        if let Some(Subnet { address, bits }) = self.eoe_address {
            tap.set_address(Ipv4Addr::from(address), bits)?;
            tap.bring_up()?;
        }
        Ok(Some(tap))
    }
}

/// Which interface it is, for people; `None` where there is none.
pub(super) fn opened(ethernet: &VirtualEthernet) -> Option<String> {
    let report = ethernet.watch().report();
    let name = report.interface?;
    Some(format!("Ethernet over EtherCAT by interface {name}."))
}

/// What went through the switch, for people.
pub(in crate::command) fn summary(report: &EthernetReport) -> String {
    let sum = |number: fn(&linesman_runtime::ethernet::EthernetPortReport) -> u64| -> u64 {
        report.ports.iter().map(number).sum()
    };
    let (to, from) = (sum(|port| port.frames_to), sum(|port| port.frames_from));
    let (sent, came) = (sum(|port| port.fragments_to), sum(|port| port.fragments_from));
    let mut text = format!(
        "Ethernet over EtherCAT: {} to {} ({}), {} back ({})",
        count(to, "frame"),
        count(report.ports.len() as u64, "SubDevice"),
        count(sent, "fragment"),
        count(from, "frame"),
        count(came, "fragment"),
    );
    let dropped = sum(|port| port.dropped + port.refused + port.withheld);
    for (number, what) in [
        (sum(|port| port.lost), "lost"),
        (sum(|port| port.resent), "messages repeated"),
        (dropped + report.host_dropped + report.missed, "dropped"),
    ] {
        if number > 0 {
            text.push_str(&format!(", {number} {what}"));
        }
    }
    text.push_str(".\n");
    if !report.without_port.is_empty() {
        let names = report.without_port.join(", ");
        text.push_str(&format!(
            "The virtual switch has no port left for {names}. Do: `--eoe-ports {}`.\n",
            report.ports.len() + report.without_port.len()
        ));
    }
    text
}
