//! Repairs: the part that the cause and place of a verdict blame, and the parts whose exchange mends a fault.
//!
//! The part follows from cause and place; the sentences of a report are not read. Two causes at one place may need
//! different repairs, and one repair may mend several causes: another cable mends a worn one and not a transmitter, and
//! whoever sees to the supply mends a dip as well as a failure. Whether it helps is tried in `score::repair_trial`.

use linesman_config::fault::FaultName::{self, *};
use linesman_proto::address::DeviceId;
use linesman_proto::topology::{End, Tree};
use linesman_sim::fault::FaultCarrier;

use super::claim::Claim;
use super::site::{Site, Way};
use super::{Truth, TruthPlace};

/// A part of a plant that can be exchanged or set right.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum RepairedPart {
    /// The cable or contact of a link, with its plugs; by the end nearer the MainDevice.
    Cable(End<DeviceId>),
    /// The source of noise that disturbs a link; by the end nearer the MainDevice.
    NoiseSource(End<DeviceId>),
    /// A SubDevice, its ports included.
    Device(DeviceId),
    /// The supply of a SubDevice.
    Supply(DeviceId),
    /// Settings of a SubDevice, in the project or in itself.
    Settings(DeviceId),
    /// The wiring at the place of a SubDevice: the device that stands there, and its ports.
    Wiring(DeviceId),
    /// The network card of the computer.
    Card,
    /// The computer: its load, its settings, its driver.
    Computer,
    /// The other sender on the line.
    OtherSender,
}

/// Parts whose exchange mends a fault.
#[must_use]
pub fn mending(truth: &Truth, tree: &Tree) -> Vec<RepairedPart> {
    let sites = truth.places.iter().map(|place| match *place {
        TruthPlace::Hop(from, to) => Site::hop(tree, from, to),
        TruthPlace::Link(one, other) => Site::link(tree, one, other),
        TruthPlace::Device(id) => Site::Device(id),
        TruthPlace::Host(_) => Site::Host,
    });
    let mut parts: Vec<RepairedPart> = sites.filter_map(|site| part(truth.name, site)).collect();
    // Who was put in between, or stands in a row of equals, is taken out at any of their places.
    parts.extend(truth.equals.iter().map(|id| RepairedPart::Wiring(*id)));
    if matches!(truth.name, BrownOut | EbusOverload) {
        parts.extend(truth.dark.iter().map(|id| RepairedPart::Supply(*id)));
    }
    parts
}

/// The part that a claim blames; `None` where it blames none.
#[must_use]
pub fn blamed(claim: Claim) -> Option<RepairedPart> {
    part(claim.cause, claim.site)
}

/// The part that a cause at a place is about.
fn part(cause: FaultName, site: Site) -> Option<RepairedPart> {
    let device = match site {
        Site::Device(id) => Some(id),
        // A device that is missing or wired otherwise is seen at the link before it.
        Site::Link { b: Some(End::Controller(id, _)), .. } => Some(id),
        Site::Link { .. } | Site::Host | Site::Network => None,
    };
    let near = match site {
        Site::Link { a, .. } => Some(a),
        Site::Host => Some(End::MainDevice(linesman_proto::address::Path::A)),
        Site::Device(_) | Site::Network => None,
    };
    match FaultCarrier::of(cause) {
        FaultCarrier::Cable => near.map(RepairedPart::Cable),
        FaultCarrier::NoiseSource => near.map(RepairedPart::NoiseSource),
        FaultCarrier::Sender | FaultCarrier::Receiver => {
            let Some(end) = sending_or_receiving(cause, site) else {
                return device.map(RepairedPart::Device);
            };
            Some(match end {
                End::MainDevice(_) => RepairedPart::Card,
                End::Controller(id, _) => RepairedPart::Device(id),
            })
        }
        FaultCarrier::Device => device.map(RepairedPart::Device),
        FaultCarrier::Supply => device.map(RepairedPart::Supply),
        FaultCarrier::Settings => {
            device.map_or(Some(RepairedPart::Computer), |id| Some(RepairedPart::Settings(id)))
        }
        FaultCarrier::Wiring if cause == MainDeviceWrongPort => {
            Some(RepairedPart::Wiring(DeviceId(0)))
        }
        FaultCarrier::Wiring => device.map(RepairedPart::Wiring),
        FaultCarrier::Card => Some(RepairedPart::Card),
        FaultCarrier::Computer => Some(RepairedPart::Computer),
        FaultCarrier::OtherSender => Some(RepairedPart::OtherSender),
    }
}

/// The end of a hop at which the damaged part of this cause sits.
fn sending_or_receiving(cause: FaultName, site: Site) -> Option<End<DeviceId>> {
    let Site::Link { a, b, way } = site else { return None };
    let sends_near = way? == Way::AToB;
    if sends_near == (cause == TransmitterDamaged) { Some(a) } else { b }
}

/// True if the exchange of the part that a claim blames mends a fault.
#[must_use]
pub fn mends(claim: Claim, truth: &Truth, tree: &Tree) -> bool {
    blamed(claim).is_some_and(|part| mending(truth, tree).contains(&part))
}

#[cfg(test)]
mod tests {
    use linesman_proto::address::Path;
    use linesman_proto::port::Port;
    use linesman_proto::topology::Wired;

    use super::*;

    #[test]
    fn the_part_at_fault_mends_and_its_neighbour_does_not() {
        let on = |node, port| Wired { on: End::Controller(node, port), entry: Port::A };
        let first = Wired { on: End::MainDevice(Path::A), entry: Port::A };
        let tree = Tree::from_wiring(&[first, on(0, Port::B)], None).unwrap();
        let (out, into) =
            (End::Controller(DeviceId(0), Port::B), End::Controller(DeviceId(1), Port::A));
        let hop = Site::hop(&tree, out, into);
        let claim = |cause, site| Claim { cause, site };
        let sender = Truth::new(TransmitterDamaged, vec![TruthPlace::Hop(out, into)]);
        assert!(mends(claim(TransmitterDamaged, hop), &sender, &tree));
        assert!(mends(claim(DeviceInternal, Site::Device(DeviceId(0))), &sender, &tree));
        assert!(!mends(claim(ReceiverDamaged, hop), &sender, &tree));
        assert!(!mends(claim(CableDegraded, hop), &sender, &tree));
        let card = Truth::new(NicDamaged, vec![TruthPlace::Host(Path::A)]);
        let way_out =
            Site::hop(&tree, End::MainDevice(Path::A), End::Controller(DeviceId(0), Port::A));
        assert!(mends(claim(TransmitterDamaged, way_out), &card, &tree), "the card sends there");
        assert!(!mends(claim(EmcNoise, way_out), &card, &tree));
    }
}
