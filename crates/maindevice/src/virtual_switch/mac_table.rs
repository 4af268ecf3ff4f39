//! Table of hardware addresses: behind which port each was seen last.

use std::collections::BTreeMap;

use linesman_proto::ethernet::MacAddress;
use linesman_proto::time::{Instant, Span};

/// Addresses that were learned, at most so many, each for so long.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct MacTable {
    most: usize,
    ageing: Span,
    entries: BTreeMap<[u8; 6], (usize, Instant)>,
}

impl MacTable {
    /// A table of at most `most` addresses; one that sends nothing is forgotten after `ageing`.
    #[must_use]
    pub const fn new(most: usize, ageing: Span) -> Self {
        Self { most, ageing, entries: BTreeMap::new() }
    }

    /// An address has sent something by a port. False when there is no room for it: all others were heard of within
    /// the time of ageing.
    pub fn learn(&mut self, now: Instant, address: MacAddress, port: usize) -> bool {
        if !self.entries.contains_key(&address.0) && self.entries.len() >= self.most {
            let ageing = self.ageing;
            self.entries.retain(|_, (_, seen)| now < *seen + ageing);
            if self.entries.len() >= self.most {
                return false;
            }
        }
        self.entries.insert(address.0, (port, now));
        true
    }

    /// The port behind which an address is; `None`: nobody knows.
    #[must_use]
    pub fn port_of(&self, now: Instant, address: MacAddress) -> Option<usize> {
        let (port, seen) = self.entries.get(&address.0)?;
        (now < *seen + self.ageing).then_some(*port)
    }

    /// Addresses that were learned and are not too old.
    #[must_use]
    pub fn len(&self, now: Instant) -> usize {
        self.entries.values().filter(|(_, seen)| now < *seen + self.ageing).count()
    }
}
