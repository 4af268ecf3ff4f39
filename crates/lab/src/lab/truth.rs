//! Faults of the run, and what is true of them.

use std::collections::BTreeSet;

use linesman_config::attachment::Attachment;
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::port::Port;
use linesman_proto::register::ErrorCounter;
use linesman_proto::topology::End;
use linesman_sim::segment::PlugError;
use linesman_sim::segment_file::FaultEntry;
use linesman_sim::truth::{FaultId, Unexplained};

use super::{Lab, LabError};
use crate::verdict::Truth;
use crate::verdict::judge::truth_of;

impl Lab {
    /// Puts a fault on the line.
    ///
    /// # Errors
    /// The segment's, when the entry names no place or parameter.
    pub fn inject(&mut self, entry: &FaultEntry) -> Result<FaultId, LabError> {
        let id = self.segment.inject(self.now, entry)?;
        let blind = self.blind_ports();
        self.blind.insert(id, blind);
        Ok(id)
    }

    /// A fault of the run as a verdict is held against it; `None` if there is no such fault.
    #[must_use]
    pub fn truth_of(&self, id: FaultId) -> Option<Truth> {
        let log = self.truth();
        let blind = self.blind.get(&id).cloned().unwrap_or_default();
        let remakes = |id: &DeviceId| {
            let controller = self.segment.controller(*id);
            controller.is_some_and(|known| known.hardware().counting.remakes_symbol_errors)
        };
        let remaking = self.segment.devices().filter(remakes).collect();
        Some(Truth { blind, remaking, ..truth_of(log, log.fault(id)?) })
    }

    /// Ports whose symbol counter stands at its end.
    fn blind_ports(&self) -> Vec<End<DeviceId>> {
        let mut blind = Vec::new();
        for id in self.segment.devices() {
            let Some(controller) = self.segment.controller(id) else { continue };
            let counters = controller.error_counters();
            for port in Port::ALL {
                if counters.value(ErrorCounter::PhysicalLayer(port)) == Some(u8::MAX) {
                    blind.push(End::Controller(id, port));
                }
            }
        }
        blind
    }

    /// Pulls the cable of a SubDevice, or those of a hot connect group.
    ///
    /// # Errors
    /// The segment's, when there is no such SubDevice or group, or it is out already.
    pub fn unplug(&mut self, name: &str) -> Result<Vec<FaultId>, PlugError> {
        let faults = self.segment.unplug(self.now, name)?;
        let blind = self.blind_ports();
        self.blind.extend(faults.iter().map(|fault| (*fault, blind.clone())));
        Ok(faults)
    }

    /// Plugs a SubDevice in again, where it was or elsewhere.
    ///
    /// # Errors
    /// The segment's, when it is in, or does not fit there.
    pub fn plug(&mut self, name: &str, on: Option<&Attachment>) -> Result<(), PlugError> {
        self.segment.plug(self.now, name, on)
    }

    /// Ends a fault.
    pub fn heal(&mut self, fault: FaultId) {
        self.segment.heal(self.now, fault);
    }

    /// Counters that moved without a logged cause since the last audit.
    pub fn audit(&mut self) -> Vec<Unexplained> {
        self.segment.audit()
    }

    /// Controllers that a frame of either card can get to: powered, with open ports all the way.
    pub(crate) fn reached(&self) -> BTreeSet<DeviceId> {
        let tree = self.segment.tree();
        let ids: Vec<DeviceId> = self.segment.devices().collect();
        let is_open = |end: End| match end {
            End::MainDevice(path) => self.segment.host(path).carrier,
            End::Controller(node, port) => {
                let controller = ids.get(node).and_then(|id| self.segment.controller(*id));
                controller.is_some_and(|known| known.is_powered() && known.is_open(port))
            }
        };
        let mut reached = BTreeSet::new();
        let mut front: Vec<End> = Path::ALL.into_iter().map(End::MainDevice).collect();
        while let Some(end) = front.pop() {
            let Some(far) = tree.opposite(end).filter(|far| is_open(end) && is_open(*far)) else {
                continue;
            };
            if let (Some(node), End::Controller(..)) = (far.node(), far)
                && reached.insert(ids[node])
            {
                front.extend(tree.open_ports(node).map(|port| End::Controller(node, port)));
            }
        }
        reached
    }
}
