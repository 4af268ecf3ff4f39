//! Who answers to what: station addresses, logical addresses, and a count of changes to the ways
//! that frames take.

use std::collections::BTreeSet;

use linesman_proto::address::LogicalAddress;

use super::node::Node;
use crate::controller::Manner;

/// Names of all controllers, kept as they change.
#[derive(Clone, Default, Debug)]
pub(super) struct Directory {
    /// Station address or alias, and node.
    stations: BTreeSet<(u16, u32)>,
    /// First logical byte of an FMMU, the first behind, and its node.
    mapped: BTreeSet<(u64, u64, u32)>,
    /// The longest stretch that any FMMU ever mapped.
    longest: u64,
    /// Nodes that add to the event field of datagrams.
    interrupting: Vec<u32>,
    ways: u64,
    names: u64,
}

impl Directory {
    /// Changes with everything that leads frames another way.
    #[inline]
    pub(super) fn ways(&self) -> u64 {
        self.ways
    }

    /// Changes with every name: addresses, aliases, FMMUs.
    #[inline]
    pub(super) fn names(&self) -> u64 {
        self.names
    }

    /// Nodes that add to the event field of datagrams.
    #[inline]
    pub(super) fn interrupting(&self) -> &[u32] {
        &self.interrupting
    }

    /// Nodes with this station address or alias.
    #[inline]
    pub(super) fn stations(&self, address: u16) -> impl Iterator<Item = u32> + '_ {
        self.stations.range((address, 0)..=(address, u32::MAX)).map(|(_, node)| *node)
    }

    /// Nodes with an FMMU that maps any of `len` bytes from `start`; each as often as it has some.
    pub(super) fn mapping(
        &self,
        start: LogicalAddress,
        len: usize,
    ) -> impl Iterator<Item = u32> + '_ {
        let start = u64::from(start.0);
        let first = (start.saturating_sub(self.longest), 0, 0);
        let around = self.mapped.range(first..(start + len as u64, 0, 0));
        around.filter(move |(_, behind, _)| *behind > start).map(|(_, _, node)| *node)
    }

    /// A node has another manner than before.
    pub(super) fn change(&mut self, index: usize, node: &mut Node, manner: Manner) {
        let before = std::mem::replace(&mut node.entry.manner, manner);
        let index = index as u32;
        let way = |manner: &Manner| (manner.open, manner.meddles, manner.marks_source);
        if way(&before) != way(&manner) {
            self.ways += 1;
        }
        if (before.station, before.alias) != (manner.station, manner.alias) {
            self.names += 1;
            for address in [Some(before.station), before.alias].into_iter().flatten() {
                self.stations.remove(&(address, index));
            }
            let new = [Some(manner.station), manner.alias].into_iter().flatten();
            self.stations.extend(new.map(|address| (address, index)));
        }
        // A node is entered here before it is ever asked for: station 0 is a name as any other.
        self.names += u64::from(self.stations.insert((manner.station, index)));
        if before.interrupts != manner.interrupts {
            match self.interrupting.binary_search(&index) {
                Ok(at) => {
                    self.interrupting.remove(at);
                }
                Err(at) => self.interrupting.insert(at, index),
            }
        }
        if before.fmmus != manner.fmmus {
            self.names += 1;
            for (start, behind) in node.entry.mapped.drain(..) {
                self.mapped.remove(&(start, behind, index));
            }
            node.entry.mapped.extend(node.controller.mapped());
            for (start, behind) in &node.entry.mapped {
                self.longest = self.longest.max(behind - start);
                self.mapped.insert((*start, *behind, index));
            }
        }
    }
}
