//! `linesman plan --ethernet`: SubDevices that speak EoE, the throughput to expect, what of addresses and sizes is doubtful, and
//! the routes into another subnet.

use linesman_config::plan::ethernet::{EthernetRoute, RateLimit, Subnet, SwitchSizes};
use linesman_config::plan::{Doubt, Plan};
use linesman_maindevice::virtual_switch::SwitchLimits;
use serde::Serialize;

use crate::failure::Failure;
use crate::output::{Output, Table, wrapped};
use crate::text::quantity::{count, grouped, time};

/// What can be asked of Ethernet over EtherCAT.
#[derive(clap::Args, Debug)]
pub(super) struct EthernetPlanArguments {
    /// Ethernet over EtherCAT: who speaks it, how fast it is, what of addresses and of the virtual switch is doubtful
    #[arg(long)]
    pub(super) ethernet: bool,
    /// SubDevices that the virtual switch has ports for
    #[arg(long, value_name = "COUNT", default_value_t = SwitchLimits::default().ports, requires = "ethernet")]
    eoe_ports: usize,
    /// Hardware addresses that the virtual switch knows at once
    #[arg(long, value_name = "COUNT", default_value_t = SwitchLimits::default().macs, requires = "ethernet")]
    eoe_macs: usize,
    /// End points that are reached at once, behind switch terminals too; one for each SubDevice unless said
    #[arg(long, value_name = "COUNT", requires = "ethernet")]
    end_points: Option<usize>,
    /// This computer towards the SubDevices (192.168.1.100/24)
    #[arg(long, value_name = "ADDRESS/BITS", requires = "ethernet")]
    eoe_address: Option<Subnet>,
    /// This computer in the plant's LAN (172.16.4.205/16): the routes between both are printed; nothing is changed
    #[arg(long, value_name = "ADDRESS/BITS", requires = "eoe_address")]
    lan_address: Option<Subnet>,
    /// A computer in the LAN that is to reach the SubDevices (172.16.8.31/16)
    #[arg(long, value_name = "ADDRESS/BITS", requires = "lan_address")]
    lan_host: Option<Subnet>,
}

/// Ethernet over EtherCAT of a plan.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct EthernetPlanReport {
    /// SubDevices that have a port of the virtual switch, by number.
    ports: Vec<EthernetPlanPort>,
    /// What is to be done so that computers of the LAN reach them; empty unless asked for. Nothing of it was done.
    routes: Vec<EthernetPlanRoute>,
}

/// A SubDevice that has a port.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct EthernetPlanPort {
    no: u32,
    name: String,
    /// How it comes to its IP address: `none`, `fixed` or `dhcp`.
    mode: &'static str,
    /// The address that it is given, with its subnet; `null`: none.
    address: Option<String>,
    /// The throughput to expect to it, and from it.
    to: Option<EthernetPlanRate>,
    from: Option<EthernetPlanRate>,
}

/// A throughput to expect.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct EthernetPlanRate {
    /// Size of its mailbox.
    mailbox_bytes: usize,
    /// Fragments of a frame of 1,514 bytes.
    fragments: usize,
    /// Time that one message takes.
    message_ns: u64,
    /// What limits it: `cycle`, `bandwidth`, or `subdevice`, which is taken to need 600 µs for a message.
    limit: &'static str,
    /// Data in TCP segments, while nothing goes the other way.
    bytes_per_second: u64,
    /// The same with an acknowledgement of every second segment; `null` to a SubDevice.
    tcp_bytes_per_second: Option<u64>,
}

/// What one of those involved has to do.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct EthernetPlanRoute {
    who: String,
    commands: Vec<String>,
    remark: String,
}

impl EthernetPlanArguments {
    /// What is doubtful.
    pub(super) fn doubts(&self, plan: &Plan) -> Vec<Doubt> {
        let Self { eoe_ports: ports, eoe_macs: macs, end_points, .. } = *self;
        let mut doubts = plan.switch_doubts(&SwitchSizes { ports, macs, end_points });
        doubts.extend(plan.host_doubts(self.eoe_address, self.lan_address));
        doubts
    }

    /// Who speaks it, how fast that is, and the routes.
    ///
    /// # Errors
    /// Addresses between which there can be no route.
    pub(super) fn report(&self, plan: &Plan) -> Result<EthernetPlanReport, Failure> {
        let rates = plan.ethernet_rates();
        let ports = plan.ethernet_devices().map(|device| {
            let rate = |from_device| {
                let mut all = rates.iter();
                all.find(|rate| rate.device == device.id && rate.from_device == from_device).map(
                    |rate| EthernetPlanRate {
                        mailbox_bytes: rate.mailbox,
                        fragments: rate.fragments,
                        message_ns: rate.period.as_nanos(),
                        limit: match rate.limit {
                            RateLimit::Cycle => "cycle",
                            RateLimit::Bandwidth => "bandwidth",
                            RateLimit::SubDevice => "subdevice",
                        },
                        bytes_per_second: rate.bytes_per_second,
                        tcp_bytes_per_second: rate.tcp_bytes_per_second(),
                    },
                )
            };
            let address = device.ethernet_subnet();
            let ip = device.ethernet_addresses().and_then(|addresses| addresses.ip);
            EthernetPlanPort {
                no: device.id.no(),
                name: device.name.clone(),
                mode: match (address, ip) {
                    (Some(_), _) => "fixed",
                    (None, Some(_)) => "dhcp",
                    (None, None) => "none",
                },
                address: address.map(|address| address.to_string()),
                to: rate(false),
                from: rate(true),
            }
        });
        let ports: Vec<_> = ports.collect();
        Ok(EthernetPlanReport { ports, routes: self.routes(plan)? })
    }

    fn routes(&self, plan: &Plan) -> Result<Vec<EthernetPlanRoute>, Failure> {
        let (Some(own), Some(lan)) = (self.eoe_address, self.lan_address) else {
            return Ok(Vec::new());
        };
        let mut addresses = plan.ethernet_devices().filter_map(|device| device.ethernet_subnet());
        let device = addresses.find(|address| own.contains(address.address));
        let route = EthernetRoute { lan, lan_host: self.lan_host, own, device };
        if let Some(why) = route.doubt() {
            let advice = "name addresses in two subnets without common addresses: `--eoe-address 192.168.1.100/24 \
                          --lan-address 172.16.4.205/16`";
            return Err(Failure::new(format!("no route: {why}"), advice));
        }
        let steps = route.steps().into_iter();
        let step = steps.map(|step| EthernetPlanRoute {
            who: step.who,
            commands: step.commands,
            remark: step.remark,
        });
        Ok(step.collect())
    }
}

/// The same as text.
pub(super) fn text(report: &EthernetPlanReport, output: &Output) -> String {
    let devices = count(report.ports.len() as u64, "SubDevice");
    let mut text =
        format!("\nEthernet over EtherCAT: {devices} with a port of the virtual switch\n");
    if !report.ports.is_empty() {
        let mut table = Table::new(
            &[
                "no",
                "name",
                "address",
                "direction",
                "mailbox",
                "fragments",
                "a message",
                "limit",
                "bytes/s",
                "with TCP",
            ],
            output.paint(),
        );
        for port in &report.ports {
            let address = port.address.clone().unwrap_or_else(|| port.mode.to_owned());
            for (direction, rate) in [("to it", &port.to), ("from it", &port.from)] {
                let Some(rate) = rate else { continue };
                table.row(vec![
                    port.no.to_string(),
                    port.name.clone(),
                    address.clone(),
                    direction.to_owned(),
                    rate.mailbox_bytes.to_string(),
                    rate.fragments.to_string(),
                    time(rate.message_ns),
                    rate.limit.to_owned(),
                    grouped(rate.bytes_per_second),
                    rate.tcp_bytes_per_second.map_or_else(|| "-".to_owned(), grouped),
                ]);
            }
        }
        text.push_str(&table.render());
        text.push_str(
            "Data in frames of 1,514 bytes while nothing goes the other way; with TCP: every second one is acknowledged.\n",
        );
    }
    if !report.routes.is_empty() {
        text.push_str(
            "\nRoutes; nothing was changed, the commands need the rights of an administrator:\n",
        );
    }
    for route in &report.routes {
        text.push_str(&format!("{}:\n", route.who));
        for command in &route.commands {
            text.push_str(&format!("  {command}\n"));
        }
        text.push_str(&wrapped("  ", &route.remark, output.width()));
    }
    text
}
