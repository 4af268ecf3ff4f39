//! Senders of requests: one MainDevice, its second card, or somebody else.

use linesman_proto::address::Path;
use linesman_proto::command::Addressing;
use linesman_proto::ethernet::MacAddress;
use linesman_proto::frame::Datagram;
use linesman_proto::register::ErrorCounters;
use linesman_proto::time::Instant;

use super::sequence::IndexSequence;
use super::{Direction, Fingerprint, FrameSeen};
use crate::model::Seen;

/// So many requests of its own make a sender one for sure.
pub const OWN: u64 = 16;

/// Senders kept.
const MOST: usize = 4;

/// Somebody who sends requests.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Sender {
    /// Its address.
    pub mac: MacAddress,
    /// Its first request.
    pub first: Seen<()>,
    /// Requests of its own: the second card of a ring only repeats those of the first.
    pub own: u64,
    /// Whether it sends by a card of this host; by several cards, each its own, it is one MainDevice.
    pub is_host: bool,
    /// The card by which its first request was seen, where that is told.
    pub card: Option<Path>,
    /// Whether only returns of its frames were seen, among requests of others: it sends from another
    /// place of the line.
    pub is_elsewhere: bool,
    /// Frames of its own that write into SubDevices, as far as only their returns were seen.
    pub writes: u64,
    /// Those of them that write more than error counters, which they clear by that.
    pub orders: u64,
    /// Its latest frame.
    pub last: Instant,
    /// How it numbers its frames.
    indexes: IndexSequence,
}

/// What a frame writes into SubDevices.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) enum Written {
    /// Error counters and nothing else: it clears them.
    Counters,
    /// What SubDevices work by.
    Orders,
}

impl Written {
    /// What a datagram writes; nothing when it only reads.
    pub(super) fn by(datagram: &Datagram<'_>) -> Option<Self> {
        let effect = datagram.command()?.effect();
        let is_register = effect.addressing != Addressing::Logical;
        let is_counter = is_register && ErrorCounters::cover(datagram.ado(), datagram.data().len());
        effect.writes.then_some(if is_counter { Self::Counters } else { Self::Orders })
    }
}

/// All who send.
#[derive(Clone, Default, Debug)]
pub(super) struct Senders {
    all: Vec<Sender>,
    has_changed: bool,
}

impl Senders {
    /// In the order in which they were first seen.
    pub(super) fn all(&self) -> &[Sender] {
        &self.all
    }

    /// Whether anything of them has changed since this was asked last.
    pub(super) const fn take_changed(&mut self) -> bool {
        std::mem::replace(&mut self.has_changed, false)
    }

    /// Those that were taken for senders are none.
    pub(super) fn forget(&mut self, is_theirs: impl Fn(MacAddress) -> bool) {
        self.all.retain(|sender| !is_theirs(sender.mac));
        self.has_changed = true;
    }

    /// A return came of a request that was not seen here: somebody sends from another place of the line.
    pub(super) fn note_elsewhere(
        &mut self,
        frame: &FrameSeen<'_>,
        mac: MacAddress,
        writes: Option<Written>,
    ) {
        let is_known = |one: &Sender| one.mac == mac || one.mac.marked() == mac;
        if !self.all.iter().any(is_known) {
            self.note(frame, mac, true);
            if let Some(new) = self.all.iter_mut().find(|one| one.mac == mac) {
                new.is_elsewhere = true;
            }
        }
        if let Some(other) = self.all.iter_mut().find(|one| one.mac == mac && !one.is_host) {
            other.own += 1;
            other.writes += u64::from(writes.is_some());
            other.orders += u64::from(writes == Some(Written::Orders));
            other.last = frame.time;
            self.has_changed = true;
        }
    }

    /// A request of a sender has this index and so many datagrams. Gives how many requests before it were not
    /// recorded, and since when, as far as its numbers tell.
    pub(super) fn number(&mut self, mac: MacAddress, print: &Fingerprint) -> u64 {
        let sender = self.all.iter_mut().find(|sender| sender.mac == mac);
        let datagrams = u8::try_from(print.datagrams.max(1)).unwrap_or(u8::MAX);
        sender.map_or(0, |sender| sender.indexes.take(print.first_index, datagrams))
    }

    /// Somebody sent a request; a repeated one may be that of a second card.
    pub(super) fn note(&mut self, frame: &FrameSeen<'_>, mac: MacAddress, is_repeated: bool) {
        let own = u64::from(!is_repeated);
        if frame.direction == Direction::Sent {
            // Returns that a recording begins with are of requests before its first one.
            self.all.retain(|sender| !sender.is_elsewhere || sender.mac != mac.marked());
        }
        let count = self.all.len();
        match self.all.iter_mut().find(|sender| sender.mac == mac) {
            Some(sender) => {
                sender.own += own;
                sender.last = frame.time;
                self.has_changed |= own > 0 && sender.own == OWN;
            }
            None if count < MOST => {
                let first = Seen::new((), frame.time, Some(frame.number));
                let is_host = frame.direction == Direction::Sent;
                self.all.push(Sender {
                    mac,
                    first,
                    own,
                    is_host,
                    card: frame.path,
                    is_elsewhere: false,
                    writes: 0,
                    orders: 0,
                    last: frame.time,
                    indexes: IndexSequence::default(),
                });
                self.has_changed = true;
            }
            None => {}
        }
    }
}
