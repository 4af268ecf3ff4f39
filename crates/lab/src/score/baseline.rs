//! Baseline of the score, as a course teaches it: read all error counters, and look at the first
//! port with one above zero.

use linesman_proto::address::DeviceId;
use linesman_proto::port::Port;
use linesman_proto::register::ErrorCounter;
use linesman_proto::topology::{End, Tree};

use crate::lab::Lab;
use crate::verdict::{Site, Truth, TruthPlace};

/// The link at the first port with an error counter above zero, in the order of the SubDevices that
/// can be read.
#[must_use]
pub fn first_counter(lab: &Lab) -> Option<Site> {
    let reached = lab.reached();
    for id in lab.segment().devices().filter(|id| reached.contains(id)) {
        let Some(controller) = lab.segment().controller(id) else { continue };
        let counters = controller.error_counters();
        for port in Port::ALL {
            let above = [
                ErrorCounter::InvalidFrame(port),
                ErrorCounter::PhysicalLayer(port),
                ErrorCounter::LostLink(port),
            ];
            if above.into_iter().any(|counter| counters.value(counter).is_some_and(|at| at > 0)) {
                return link(lab.tree(), id, port);
            }
        }
    }
    None
}

fn link(tree: &Tree, id: DeviceId, port: Port) -> Option<Site> {
    if id.index() >= tree.len() {
        return Some(Site::Device(id));
    }
    let far = tree.opposite(End::Controller(id.index(), port));
    let far = far.map(|end| end.map(|node| DeviceId(node as u32)));
    Some(far.map_or(Site::Device(id), |far| Site::link(tree, End::Controller(id, port), far)))
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
