//! Routes between the plant's LAN and SubDevices (S0 L2927-2979): this computer is the router.

use super::Subnet;

/// Who is to be reached from where.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct EthernetRoute {
    /// This computer in the LAN.
    pub lan: Subnet,
    /// A computer in the LAN; `None`: any.
    pub lan_host: Option<Subnet>,
    /// This computer towards the SubDevices.
    pub own: Subnet,
    /// A SubDevice, or a computer behind one; `None`: any.
    pub device: Option<Subnet>,
}

/// What one of those involved has to do.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct RouteStep {
    /// Who, for people.
    pub who: String,
    /// The commands, with rights of an administrator, one a line.
    pub commands: Vec<String>,
    /// What else there is to know; may be empty.
    pub remark: String,
}

impl EthernetRoute {
    /// Why it cannot be; `None` when it can.
    #[must_use]
    pub fn doubt(&self) -> Option<String> {
        if self.lan.overlaps(self.own) {
            return Some(format!(
                "the LAN, {}, and the network of the SubDevices, {}, overlap",
                self.lan.network(),
                self.own.network()
            ));
        }
        let strange = |what: &str, one: Option<Subnet>, net: Subnet| {
            let one = one.filter(|one| !net.contains(one.address))?;
            Some(format!("{what}, {one}, is not in the subnet {}", net.network()))
        };
        strange("the computer in the LAN", self.lan_host, self.lan)
            .or_else(|| strange("the SubDevice", self.device, self.own))
    }

    /// What is to be done, by whom. Nothing of it is done here.
    #[must_use]
    pub fn steps(&self) -> Vec<RouteStep> {
        let (devices, lan) = (self.own.network(), self.lan.network());
        let named = |what: &str, one: Option<Subnet>| match one {
            Some(one) => format!("{what} {one}"),
            None => format!("each {what}"),
        };
        let router = RouteStep {
            who: format!("this computer, {} and {}", self.lan, self.own),
            commands: vec!["sysctl -w net.ipv4.ip_forward=1".to_owned()],
            remark: "To keep it: `net.ipv4.ip_forward = 1` in /etc/sysctl.d/. A firewall has to let forwarded packets through."
                .to_owned(),
        };
        let host = RouteStep {
            who: named("computer in the LAN", self.lan_host),
            commands: vec![format!("ip route add {devices} via {}", self.lan.ip())],
            remark: format!(
                "To show routes: `ip route show`; to take it back: `ip route delete {devices}`. On Windows, as administrator: `route add \
                 {} mask {} {} -p`.",
                devices.ip(),
                std::net::Ipv4Addr::from((u32::MAX << (32 - devices.bits)).to_be_bytes()),
                self.lan.ip()
            ),
        };
        let device = RouteStep {
            who: named("SubDevice or computer behind one", self.device),
            commands: vec![format!("ip route add {lan} via {}", self.own.ip())],
            remark: format!(
                "Only where it has an operating system with commands; a SubDevice takes the gateway by EoE: `eoe = {{ …, gateway = \
                 \"{}\" }}` of a start-up command.",
                self.own.ip()
            ),
        };
        vec![router, host, device]
    }
}
