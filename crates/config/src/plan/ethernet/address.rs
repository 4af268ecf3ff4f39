//! IP addresses of SubDevices that cannot work, or not as they are meant.

use linesman_proto::address::DeviceId;

use super::Subnet;
use crate::plan::{Doubt, Plan, Severity};

/// Addresses that no router passes on (S0 L2981): 169.254.x.y.
const LINK_LOCAL: Subnet = Subnet { address: [169, 254, 0, 0], bits: 16 };

impl Plan {
    /// Doubts about the addresses that SubDevices get by EoE.
    pub(in crate::plan) fn ethernet_addresses(&self, doubts: &mut Vec<Doubt>) {
        let all: Vec<(DeviceId, Subnet)> = (self.devices.iter())
            .filter_map(|device| Some((device.id, device.ethernet_subnet()?)))
            .collect();
        for (at, (id, subnet)) in all.iter().enumerate() {
            doubts.extend(self.address_doubt(*id, *subnet));
            for (other, its) in &all[..at] {
                doubts.extend(self.pair_doubt((*other, *its), (*id, *subnet)));
            }
        }
    }

    /// Doubts about the addresses of this computer beside those of the SubDevices: in the network of the SubDevices, and
    /// in the plant's LAN.
    #[must_use]
    pub fn host_doubts(&self, own: Option<Subnet>, lan: Option<Subnet>) -> Vec<Doubt> {
        let mut doubts = Vec::new();
        let host = |severity, name, text: String, advice: &str| Doubt {
            severity,
            name,
            device: None,
            text,
            advice: advice.to_owned(),
        };
        if let Some(own) = own.filter(|own| LINK_LOCAL.contains(own.address)) {
            let text = format!(
                "this computer has {own} towards the SubDevices: no router passes 169.254.x.y on"
            );
            doubts.push(host(
                Severity::Warning,
                "eoe-link-local",
                text,
                "choose a subnet such as 192.168.1.0/24",
            ));
        }
        for device in &self.devices {
            let Some(subnet) = device.ethernet_subnet() else { continue };
            if let Some(own) = own.filter(|own| !own.contains(subnet.address)) {
                let text = format!(
                    "{} has {subnet}, this computer {own} towards it: they are in different subnets and cannot talk directly",
                    device.name
                );
                let advice = "put both into one subnet: only there end points reach each other without a router";
                doubts.push(Doubt {
                    device: Some(device.id),
                    ..host(Severity::Warning, "eoe-other-subnet", text, advice)
                });
            }
            if let Some(lan) = lan.filter(|lan| lan.overlaps(subnet)) {
                let text = format!(
                    "the subnet of {}, {}, and that of the LAN, {}, overlap: this computer cannot tell where frames go",
                    device.name,
                    subnet.network(),
                    lan.network()
                );
                let advice =
                    "choose subnets without common addresses for the LAN and the SubDevices";
                doubts.push(Doubt {
                    device: Some(device.id),
                    ..host(Severity::Error, "eoe-overlap", text, advice)
                });
            }
        }
        doubts
    }

    fn address_doubt(&self, id: DeviceId, subnet: Subnet) -> Option<Doubt> {
        let name = self.ethernet_name(id);
        let names_all = subnet.bits < 31
            && (subnet.address == subnet.network().address || subnet.address == subnet.broadcast());
        let [first, .., last] = subnet.address;
        let (severity, what, text, advice) = if LINK_LOCAL.contains(subnet.address) {
            (
                Severity::Warning,
                "eoe-link-local",
                format!("{name} gets {subnet}: no router passes 169.254.x.y on"),
                "choose a subnet such as 192.168.1.0/24",
            )
        } else if names_all || last == 0 {
            (
                Severity::Error,
                "eoe-host-address",
                format!(
                    "{name} gets {subnet}, which names a network or all that are in it, and no device"
                ),
                "choose an address within the subnet",
            )
        } else if first == 0 || first == 127 || first >= 224 {
            (
                Severity::Error,
                "eoe-host-address",
                format!("{name} gets {subnet}, which no device can have"),
                "choose an address such as 192.168.1.11",
            )
        } else {
            return None;
        };
        Some(Doubt { severity, name: what, device: Some(id), text, advice: advice.to_owned() })
    }

    fn pair_doubt(&self, one: (DeviceId, Subnet), other: (DeviceId, Subnet)) -> Option<Doubt> {
        let (first, second) = (self.ethernet_name(one.0), self.ethernet_name(other.0));
        let (severity, name, text, advice) = if one.1.address == other.1.address {
            (
                Severity::Error,
                "eoe-same-address",
                format!("{first} and {second} both get {}", one.1.ip()),
                "give each an address of its own",
            )
        } else if one.1.overlaps(other.1) && one.1.network() != other.1.network() {
            (
                Severity::Warning,
                "eoe-overlap",
                format!(
                    "the subnets of {first}, {}, and of {second}, {}, overlap: one looks for the other where it is not",
                    one.1.network(),
                    other.1.network()
                ),
                "give both the same subnet mask, or subnets without common addresses",
            )
        } else {
            return None;
        };
        Some(Doubt { severity, name, device: Some(other.0), text, advice: advice.to_owned() })
    }
}
