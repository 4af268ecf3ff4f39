//! Way of frames past the ports of a capture probe, and the spots on it at which faults act.

use linesman_config::fault::FaultName;
use linesman_proto::address::DeviceId;
use linesman_proto::topology::{End, Hop, Route, Tree};

use crate::verdict::site::{Site, Way};
use crate::verdict::{Truth, TruthPlace};

/// A spot on the way of a frame.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) enum Spot {
    /// Inside the sender of a hop, before its output; by its node, `None` for the computer.
    Device(Option<usize>),
    /// On a hop: a stage of it.
    Hop(usize, HopStage),
}

/// A stage of a hop.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) enum HopStage {
    Output,
    Cable,
    Input,
    /// The hop as a whole, as findings name it.
    Whole,
}

impl Spot {
    /// The place as findings name it.
    pub(super) const fn place(self) -> Self {
        match self {
            Self::Device(_) => self,
            Self::Hop(hop, _) => Self::Hop(hop, HopStage::Whole),
        }
    }
}

/// The way of the frames of card A, with the ports of the probe.
pub(super) struct ProbedWay {
    hops: Vec<Hop>,
    /// Hop and whether the port sits at its end, in the order of the way.
    ports: Vec<(usize, bool)>,
}

impl ProbedWay {
    pub(super) fn of(tree: &Tree, probes: &[End]) -> Self {
        let hops = Route::intact(tree).hops().to_vec();
        let at = |hop: &Hop, end: &End| hop.from == *end || hop.to == *end;
        let port = |(index, hop): (usize, &Hop)| {
            let plug = probes.iter().find(|end| at(hop, end))?;
            Some((index, hop.to == *plug))
        };
        let ports = hops.iter().enumerate().filter_map(port).collect();
        Self { hops, ports }
    }

    /// Place at which a fault acts.
    pub(super) fn spots(&self, truth: &Truth) -> Vec<Spot> {
        let stage = if truth.name == FaultName::TransmitterDamaged {
            HopStage::Output
        } else if truth.name == FaultName::ReceiverDamaged {
            HopStage::Input
        } else {
            HopStage::Cable
        };
        let index = |end: End<DeviceId>| end.map(DeviceId::index);
        let hop = |from: End<DeviceId>, to: End<DeviceId>| {
            let (from, to) = (index(from), index(to));
            let found = self.hops.iter().position(|hop| hop.from == from && hop.to == to);
            found.map(|hop| Spot::Hop(hop, stage))
        };
        let spots = truth.places.iter().flat_map(|place| match *place {
            TruthPlace::Hop(from, to) => vec![hop(from, to)],
            TruthPlace::Link(a, b) => vec![hop(a, b), hop(b, a)],
            TruthPlace::Device(id) => vec![Some(Spot::Device(Some(id.index())))],
            TruthPlace::Host(_) => vec![
                Some(Spot::Device(None)),
                Some(Spot::Hop(0, HopStage::Output)),
                Some(Spot::Hop(self.hops.len() - 1, HopStage::Input)),
            ],
        });
        spots.flatten().collect()
    }

    /// The places that the ports of a probe leave over for what becomes visible from a spot on; `None` where none of
    /// them sees it. Which end of its link a port is plugged into is not known from frames.
    pub(super) fn ideal(&self, spot: Spot) -> Option<Vec<Spot>> {
        let mut found: Option<Vec<Spot>> = None;
        for order in self.orders(spot) {
            let place = |port: &(usize, bool)| 10 * port.0 + if port.1 { 6 } else { 3 };
            let before = self.ports.iter().rev().find(|port| place(port) < order);
            let Some(behind) = self.ports.iter().find(|port| place(port) > order) else { continue };
            let first = before.map_or(0, |port| port.0);
            let mut places = Vec::new();
            for hop in first..=behind.0 {
                if hop > first || before.is_none() {
                    places.push(Spot::Device(self.hops[hop].from.node()));
                }
                places.push(Spot::Hop(hop, HopStage::Whole));
            }
            found.get_or_insert_default().extend(places);
        }
        found
    }

    /// Positions of a spot on the way, from 0: a device at each hop that leaves it.
    fn orders(&self, spot: Spot) -> Vec<usize> {
        match spot {
            Spot::Hop(hop, HopStage::Output) => vec![10 * hop + 2],
            Spot::Hop(hop, HopStage::Cable | HopStage::Whole) => vec![10 * hop + 4],
            Spot::Hop(hop, HopStage::Input) => vec![10 * hop + 8],
            Spot::Device(node) => {
                let hops = self.hops.iter().enumerate();
                hops.filter(|(_, hop)| hop.from.node() == node).map(|(at, _)| 10 * at).collect()
            }
        }
    }

    /// Spots on the way that the site of a claim names.
    pub(super) fn places(&self, site: Site) -> Vec<Spot> {
        let index = |end: End<DeviceId>| end.map(DeviceId::index);
        match site {
            Site::Device(id) => vec![Spot::Device(Some(id.index()))],
            Site::Host => vec![Spot::Device(None)],
            Site::Network => {
                (0..self.hops.len()).map(|hop| Spot::Hop(hop, HopStage::Whole)).collect()
            }
            Site::Link { a, b, way } => {
                let (a, b) = (index(a), b.map(index));
                let is_meant = |hop: &Hop| {
                    let down = hop.from == a && b.is_none_or(|b| hop.to == b);
                    let up = hop.to == a && b.is_none_or(|b| hop.from == b);
                    match way {
                        Some(Way::AToB) => down,
                        Some(Way::BToA) => up,
                        None => down || up,
                    }
                };
                let hops = self.hops.iter().enumerate().filter(|(_, hop)| is_meant(hop));
                hops.map(|(hop, _)| Spot::Hop(hop, HopStage::Whole)).collect()
            }
        }
    }
}
