//! Directory of addresses: station addresses, logical addresses, and a count of changes to the ways
//! that frames take.

use std::collections::BTreeSet;

use linesman_proto::address::LogicalAddress;

use super::node::Node;
use crate::controller::FastPathInfo;

/// Names of all controllers, kept as they change.
#[derive(Clone, Default, Debug)]
pub(super) struct AddressDirectory {
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

impl AddressDirectory {
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

    /// The fast-path information of a node has changed.
    pub(super) fn change(&mut self, index: usize, node: &mut Node, fast_path_info: FastPathInfo) {
        let before = std::mem::replace(&mut node.entry.fast_path_info, fast_path_info);
        let index = index as u32;
        let way = |fast_path_info: &FastPathInfo| {
            (fast_path_info.open, fast_path_info.acts_on_all_frames, fast_path_info.marks_source)
        };
        if way(&before) != way(&fast_path_info) {
            self.ways += 1;
        }
        if (before.station, before.alias) != (fast_path_info.station, fast_path_info.alias) {
            self.names += 1;
            for address in [Some(before.station), before.alias].into_iter().flatten() {
                self.stations.remove(&(address, index));
            }
            let new = [Some(fast_path_info.station), fast_path_info.alias].into_iter().flatten();
            self.stations.extend(new.map(|address| (address, index)));
        }
        // A node is entered here before it is ever asked for: station 0 is a name as any other.
        self.names += u64::from(self.stations.insert((fast_path_info.station, index)));
        if before.interrupts != fast_path_info.interrupts {
            match self.interrupting.binary_search(&index) {
                Ok(at) => {
                    self.interrupting.remove(at);
                }
                Err(at) => self.interrupting.insert(at, index),
            }
        }
        if before.fmmus != fast_path_info.fmmus {
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
