//! Baseline of the score, the method of a course: clear the error counters while all is well, watch, then look who is
//! missing, which port in the order of checks counts first, which link was lost, and who is not in OP.

use std::collections::BTreeMap;

use linesman_proto::address::DeviceId;
use linesman_proto::port::Port;
use linesman_proto::register::ErrorCounter;
use linesman_proto::state::AlState;
use linesman_proto::topology::{End, Route, Tree};

use crate::lab::Lab;
use crate::verdict::{Site, Truth, TruthPlace};

/// Method of a course, as followed with a tool that shows counters, states and links.
#[derive(Clone, Debug, Default)]
pub struct CourseMethod {
    /// Counters when they were cleared; whoever was never cleared stands at zero.
    cleared: BTreeMap<(DeviceId, ErrorCounter), u8>,
}

impl CourseMethod {
    /// Clears the counters: what they show now is old.
    pub fn clear(&mut self, lab: &Lab) {
        for id in lab.segment().devices() {
            for counter in Port::ALL.into_iter().flat_map(of_port) {
                if let Some(value) = value(lab, id, counter) {
                    self.cleared.insert((id, counter), value);
                }
            }
        }
    }

    /// The place that the method comes to; `None` where nothing shows.
    ///
    /// In this order: the link before the first SubDevice that is missing; the hop into the first port, in the order
    /// in which frames are checked, that counts bad frames or symbols; the first link that was lost; the first
    /// SubDevice that is not in OP.
    #[must_use]
    pub fn place(&self, lab: &Lab) -> Option<Site> {
        let tree = lab.tree();
        let reached = lab.reached();
        let node = |id: &DeviceId| id.index() < tree.len();
        let all: Vec<DeviceId> = lab.segment().devices().filter(node).collect();
        let missing = all.iter().find(|id| !reached.contains(id)).map(|id| {
            let above = Site::above(tree, *id);
            above.unwrap_or(Site::Device(*id))
        });
        let route = Route::intact(tree);
        let ports: Vec<(DeviceId, Port)> =
            route.checks().map(|check| (DeviceId(check.node as u32), check.port)).collect();
        let first = |counters: fn(Port) -> [ErrorCounter; 2]| {
            let mut counting = ports.iter().filter(|(id, port)| {
                reached.contains(id)
                    && counters(*port).into_iter().any(|one| self.rose(lab, *id, one))
            });
            counting.next().map(|(id, port)| link(tree, *id, *port))
        };
        let bad =
            || first(|port| [ErrorCounter::InvalidFrame(port), ErrorCounter::PhysicalLayer(port)]);
        let lost = || first(|port| [ErrorCounter::LostLink(port); 2]);
        let behind = || {
            let is_behind = |id: &DeviceId| {
                let controller = lab.segment().controller(*id);
                controller.is_some_and(|one| one.al_status().state().state() != Some(AlState::Op))
            };
            all.iter().copied().find(is_behind).map(Site::Device)
        };
        missing.or_else(bad).or_else(lost).or_else(behind)
    }

    /// True if a counter has counted since it was cleared; one that a restart has set back counts from zero.
    fn rose(&self, lab: &Lab, id: DeviceId, counter: ErrorCounter) -> bool {
        let before = self.cleared.get(&(id, counter)).copied().unwrap_or(0);
        value(lab, id, counter).is_some_and(|now| now > before || (now < before && now > 0))
    }
}

fn of_port(port: Port) -> [ErrorCounter; 3] {
    [
        ErrorCounter::InvalidFrame(port),
        ErrorCounter::PhysicalLayer(port),
        ErrorCounter::LostLink(port),
    ]
}

fn value(lab: &Lab, id: DeviceId, counter: ErrorCounter) -> Option<u8> {
    lab.segment().controller(id)?.error_counters().value(counter)
}

fn link(tree: &Tree, id: DeviceId, port: Port) -> Site {
    let far = tree.opposite(End::Controller(id.index(), port));
    let far = far.map(|end| end.map(|node| DeviceId(node as u32)));
    far.map_or(Site::Device(id), |far| Site::link(tree, End::Controller(id, port), far))
}

/// Whether a link is where the fault is: the link itself, or one of the device or card at fault.
#[must_use]
pub fn is_right(site: Site, truth: &Truth, tree: &Tree) -> bool {
    let touches = |id: DeviceId| match site {
        Site::Link { a, b, .. } => {
            let ends = [Some(a), b].into_iter().flatten();
            ends.filter_map(|end| end.node()).any(|node| node == id)
        }
        Site::Device(device) => device == id,
        Site::Host | Site::Network => false,
    };
    truth.places.iter().any(|place| match *place {
        TruthPlace::Hop(from, to) => Site::link(tree, from, to).covers(site),
        TruthPlace::Link(one, other) => Site::link(tree, one, other).covers(site),
        TruthPlace::Device(id) => touches(id),
        TruthPlace::Host(path) => {
            matches!(site, Site::Link { a: End::MainDevice(card), .. } if card == path)
        }
    })
}
