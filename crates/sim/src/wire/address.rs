//! Station addresses that somebody else than the MainDevice gave to a controller.

use linesman_proto::address::StationAddress;
use linesman_proto::time::Instant;

use super::node::NodeAction;
use super::world::World;
use crate::truth::{Effect, FaultId, Place};

impl World {
    /// A controller is given the station address of another one, as that has it now.
    pub(super) fn readdress(&mut self, at: Instant, fault: FaultId, node: usize, like: usize) {
        let StationAddress(address) = self.nodes[like].controller.station_address();
        self.nodes[node].address_by = Some(fault);
        self.nodes[node].act_at(at, NodeAction::Address(Some(StationAddress(address))));
        for one in [like, node] {
            let place = Place::Device(self.id(one));
            self.truth.effect(at, Some(fault), place, Effect::SharedAddress { address });
        }
    }

    /// A fault is over: who was given another address has its own again, unless the MainDevice has
    /// given a new one since.
    pub(super) fn release_addresses(&mut self, at: Instant, fault: FaultId) {
        for node in self.nodes.iter_mut().filter(|node| node.address_by == Some(fault)) {
            node.address_by = None;
            node.act_at(at, NodeAction::Address(None));
        }
    }
}
