//! A port of a switch terminal whose cable leads out of the segment, to a real network.

use std::collections::{BTreeSet, VecDeque};

use linesman_proto::ethernet::MacAddress;

/// Frames that wait each way; what comes then is lost.
const WAITING: usize = 64;
/// Hardware addresses behind a port that are known; one more makes it forget the others.
const KNOWN: usize = 256;

/// The port.
#[derive(Debug)]
pub(super) struct BridgedPort {
    /// Its number, from 1.
    number: u8,
    /// Hardware addresses that have sent something by it.
    known: BTreeSet<[u8; 6]>,
    from_outside: VecDeque<Vec<u8>>,
    to_outside: VecDeque<Vec<u8>>,
}

impl BridgedPort {
    pub(super) const fn new(number: u8) -> Self {
        Self {
            number,
            known: BTreeSet::new(),
            from_outside: VecDeque::new(),
            to_outside: VecDeque::new(),
        }
    }

    /// Its number, from 1.
    pub(super) const fn number(&self) -> u8 {
        self.number
    }

    /// True if somebody with this address has sent something by it.
    pub(super) fn knows(&self, mac: MacAddress) -> bool {
        self.known.contains(&mac.0)
    }

    /// Takes a frame from outside; it waits for [`BridgedPort::poll_received`].
    pub(super) fn receive(&mut self, frame: Vec<u8>) {
        if self.from_outside.len() >= WAITING {
            return;
        }
        if let Some(source) = frame.get(6..12).and_then(|six| <[u8; 6]>::try_from(six).ok())
            && !self.known.contains(&source)
        {
            if self.known.len() >= KNOWN {
                self.known.clear();
            }
            self.known.insert(source);
        }
        self.from_outside.push_back(frame);
    }

    /// The next frame that came from outside.
    pub(super) fn poll_received(&mut self) -> Option<Vec<u8>> {
        self.from_outside.pop_front()
    }

    /// Sends a frame out.
    pub(super) fn send(&mut self, frame: &[u8]) {
        if self.to_outside.len() < WAITING {
            self.to_outside.push_back(frame.to_vec());
        }
    }

    /// The next frame that leaves.
    pub(super) fn poll_transmit(&mut self) -> Option<Vec<u8>> {
        self.to_outside.pop_front()
    }

    /// True if a frame waits to leave.
    pub(super) fn has_frame(&self) -> bool {
        !self.to_outside.is_empty()
    }

    /// Nothing waits any more.
    pub(super) fn clear(&mut self) {
        self.from_outside.clear();
        self.to_outside.clear();
    }
}
