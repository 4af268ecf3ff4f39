//! Cables of a plan, and which of them may break without the loss of a SubDevice (RED-08, RED-09).

use linesman_proto::address::DeviceId;
use linesman_proto::sii::PortKind;
use linesman_proto::topology::{End, Link};

use super::Plan;

/// A cable between two SubDevices, or between a SubDevice and a card of the MainDevice.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct PlannedCable {
    /// Its ends.
    pub link: Link,
    /// True if all SubDevices are still reached when it breaks: it lies on the way round a ring.
    pub may_break: bool,
    /// SubDevices that are lost when it breaks, in processing order; none where it may break.
    pub lost: Vec<DeviceId>,
}

impl Plan {
    /// The cables in the order of the wiring. Contacts of the E-bus are none; where nobody says what the
    /// ports are, a link counts as a cable.
    #[must_use]
    pub fn cables(&self) -> Vec<PlannedCable> {
        let is_contact = |end: End| match end {
            End::MainDevice(_) => false,
            End::Controller(node, port) => {
                let ports = self.devices.get(node).and_then(|device| device.ports);
                ports.is_some_and(|ports| ports[port] == PortKind::EBus)
            }
        };
        let links = self.tree.links().iter().enumerate();
        let cables =
            links.filter(|(_, link)| !is_contact(link.upstream) && !is_contact(link.downstream));
        cables
            .map(|(at, link)| {
                let may_break = self.tree.is_on_ring(at);
                let below = link.downstream.node().filter(|_| !may_break);
                let mut lost: Vec<DeviceId> = below
                    .map(|node| self.tree.subtree(node))
                    .unwrap_or_default()
                    .iter()
                    .map(|node| DeviceId(*node as u32))
                    .collect();
                lost.sort_unstable();
                PlannedCable { link: *link, may_break, lost }
            })
            .collect()
    }
}
