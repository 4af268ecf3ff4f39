//! Faults of the run, and what is true of them.

use std::collections::BTreeSet;

use linesman_config::attachment::Attachment;
use linesman_config::fault::FaultName;
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::topology::End;
use linesman_sim::segment::PlugError;
use linesman_sim::segment_file::FaultEntry;
use linesman_sim::truth::{FaultId, Unexplained};

use super::{Lab, LabError};
use crate::verdict::judge::truth_of;
use crate::verdict::{Truth, TruthPlace, sets};

impl Lab {
    /// Puts a fault on the line.
    ///
    /// # Errors
    /// The segment's, when the entry names no place or parameter.
    pub fn inject(&mut self, entry: &FaultEntry) -> Result<FaultId, LabError> {
        let now = self.now();
        Ok(self.line.segment_mut().inject(now, entry)?)
    }

    /// Puts a fault on the line whose hits fall on moments and bytes by the chance with this name.
    ///
    /// # Errors
    /// As of [`Self::inject`].
    pub fn inject_with_hits(
        &mut self,
        entry: &FaultEntry,
        hits: &str,
    ) -> Result<FaultId, LabError> {
        let now = self.now();
        Ok(self.line.segment_mut().inject_with_hits(now, entry, Some(hits))?)
    }

    /// A fault of the run as a verdict is held against it; `None` if there is no such fault.
    #[must_use]
    pub fn truth_of(&self, id: FaultId) -> Option<Truth> {
        let log = self.truth();
        let mut truth = truth_of(log, log.fault(id)?);
        if truth.name == FaultName::TwinsSwapped && !self.has_identities(&truth) {
            truth.unseen = Some(&sets::TWINS);
        }
        if truth.name == FaultName::DeviceMissing
            && let Some(TruthPlace::Device(missing)) = truth.places.first()
        {
            truth.equals = self.equals_in_a_row(*missing);
            truth.leaves_nobody = self.segment().tree().is_empty();
        }
        Some(truth)
    }

    /// The planned devices in a row with one of them that are of its type, and known by nothing else.
    fn equals_in_a_row(&self, one: DeviceId) -> Vec<DeviceId> {
        let Ok(tree) = self.project().tree() else { return Vec::new() };
        let devices = &self.project().devices;
        let alike = |other: usize| {
            let pair = devices.get(one.index()).zip(devices.get(other));
            pair.is_some_and(|(one, other)| {
                one.type_name == other.type_name
                    && one.product_code == other.product_code
                    && one.revision == other.revision
                    && [one, other].iter().all(|it| it.alias.is_none() && it.serial.is_none())
            })
        };
        let row = tree.in_a_row(one.index(), alike);
        row.into_iter().map(|node| DeviceId(node as u32)).collect()
    }

    /// Whether the project knows the devices of a fault by more than their type.
    fn has_identities(&self, truth: &Truth) -> bool {
        truth.places.iter().any(|place| match place {
            TruthPlace::Device(id) => {
                let planned = self.project().devices.get(id.index());
                planned.is_some_and(|planned| planned.alias.is_some() || planned.serial.is_some())
            }
            TruthPlace::Hop(..) | TruthPlace::Link(..) | TruthPlace::Host(_) => false,
        })
    }

    /// Pulls the cable of a SubDevice, or those of a hot connect group.
    ///
    /// # Errors
    /// The segment's, when there is no such SubDevice or group, or it is out already.
    pub fn unplug(&mut self, name: &str) -> Result<Vec<FaultId>, PlugError> {
        let now = self.now();
        self.line.segment_mut().unplug(now, name)
    }

    /// Plugs a SubDevice in again, where it was or elsewhere.
    ///
    /// # Errors
    /// The segment's, when it is in, or does not fit there.
    pub fn plug(&mut self, name: &str, on: Option<&Attachment>) -> Result<(), PlugError> {
        let now = self.now();
        self.line.segment_mut().plug(now, name, on)
    }

    /// Ends a fault.
    pub fn heal(&mut self, fault: FaultId) {
        let now = self.now();
        self.line.segment_mut().heal(now, fault);
    }

    /// Counters that moved without a logged cause since the last audit.
    pub fn audit(&mut self) -> Vec<Unexplained> {
        self.line.segment_mut().audit()
    }

    /// Controllers that a frame of either card can get to: powered, with open ports all the way.
    pub(crate) fn reached(&self) -> BTreeSet<DeviceId> {
        let tree = self.segment().tree();
        let ids: Vec<DeviceId> = self.segment().devices().collect();
        let is_open = |end: End| match end {
            End::MainDevice(path) => self.segment().host(path).carrier,
            End::Controller(node, port) => {
                let controller = ids.get(node).and_then(|id| self.segment().controller(*id));
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
