//! Construction of a segment from controllers that were made elsewhere.

use std::collections::{BTreeMap, BTreeSet};

use linesman_proto::address::DeviceId;
use linesman_proto::time::Instant;
use linesman_proto::topology::Tree;

use super::tx_capture::TxCapture;
use super::{DeviceInfo, FrameTally, Segment};
use crate::controller::Controller;
use crate::device::Signals;
use crate::event_queue::EventQueue;
use crate::seed::Seed;
use crate::wire::world::World;

impl Segment {
    /// A segment of these controllers, which was on before the run began: all links are up, all SII
    /// are loaded. `controllers` are in the order of the tree's nodes and numbered likewise;
    /// `cable_m` has the length of each of its links. Each device's signals stay with its maker.
    #[must_use]
    pub fn of_controllers(
        name: &str,
        tree: Tree,
        controllers: Vec<Controller>,
        cable_m: &[f64],
        signals: Signals,
    ) -> Self {
        let count = controllers.len();
        let names = (1..=count).map(|number| format!("device {number}")).collect();
        let world = World::new(&tree, controllers, cable_m, signals);
        let unwired = DeviceInfo { outputs: Vec::new(), inputs: Vec::new() };
        let mut segment = Self::of_world(name, tree, world, vec![unwired; count], names);
        segment.advance(Instant::ZERO);
        segment
    }

    /// The segment around a world, with nothing planned beside it.
    pub(super) fn of_world(
        name: &str,
        tree: Tree,
        world: World,
        devices: Vec<DeviceInfo>,
        names: Vec<String>,
    ) -> Self {
        let count = devices.len();
        Self {
            supplies: Vec::new(),
            ebus_ma: vec![0; count],
            fed_anew: vec![false; count],
            groups: BTreeMap::new(),
            name: name.to_owned(),
            tree,
            seed: Seed(0),
            devices,
            nodes: (0..count).map(|node| (world.id(node), node)).collect(),
            names,
            world,
            now: Instant::ZERO,
            arrivals: EventQueue::default(),
            unplugged: BTreeMap::new(),
            strange: BTreeSet::new(),
            spare: Vec::new(),
            waiting: EventQueue::default(),
            tx_capture: TxCapture::default(),
            tally: FrameTally::default(),
        }
    }

    /// A controller, to give it a history; `None` for one that is not there.
    pub fn controller_mut(&mut self, device: DeviceId) -> Option<&mut Controller> {
        let node = self.node(device)?;
        Some(&mut self.world.nodes[node].controller)
    }
}
