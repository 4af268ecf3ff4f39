//! Passage of one frame: the ports of a capture probe that it came to, in the order of time.

use linesman_proto::address::Network;
use linesman_proto::esl::EslRecord;
use linesman_proto::ethernet::MacAddress;
use linesman_proto::time::Instant;

use super::PortOrder;
use super::request::{ProbeReach, as_sent};
use crate::observe::{Direction, FrameSeen};

/// Share of bytes that a damaged copy has in common with its frame, in percent.
pub(super) const ALIKE: usize = 60;
/// Headers of Ethernet and EtherCAT, and that of the first datagram, in bytes.
const HEADERS: usize = 26;
/// A port belongs to the way of a sender if this many in a hundred of its frames come by.
const OFTEN_PERCENT: u64 = 60;

/// State of a damaged frame at a port.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum DamageMark {
    /// The check sequence is wrong, and no controller has found that yet.
    Fresh,
    /// A controller has found it bad before: it carries an odd nibble more, which the probe tells as an alignment
    /// error.
    Marked,
}

/// A frame at a port.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Sight {
    /// The port of the probe.
    pub port: u8,
    /// When.
    pub time: Instant,
    /// The number of the copy in the recording.
    pub number: u64,
    /// Its damage; `None` if it was whole.
    pub damage: Option<DamageMark>,
}

/// A copy of a frame, with its bytes.
#[derive(Clone, Debug)]
pub(super) struct Copied {
    pub(super) port: u8,
    pub(super) record: EslRecord,
    time: Instant,
    number: u64,
    fcs: Option<bool>,
    truncated: bool,
    direction: Direction,
    bytes: Vec<u8>,
}

impl Copied {
    pub(super) fn of(frame: &FrameSeen<'_>, port: u8, record: EslRecord) -> Self {
        let FrameSeen { time, number, fcs, truncated, direction, .. } = *frame;
        Self { port, record, time, number, fcs, truncated, direction, bytes: frame.bytes.to_vec() }
    }

    pub(super) fn seen(&self, network: Network) -> FrameSeen<'_> {
        FrameSeen {
            network,
            path: None,
            direction: self.direction,
            time: self.time,
            number: self.number,
            fcs: self.fcs,
            truncated: self.truncated,
            probe: None,
            bytes: &self.bytes,
        }
    }
}

/// A frame on its way past the ports of a probe.
#[derive(Clone, Debug)]
pub struct Passage {
    /// Counted from 1, in the order in which frames were seen first.
    pub(super) number: u64,
    key: u64,
    pub(super) source: Option<MacAddress>,
    sights: Vec<Sight>,
    first: Option<Copied>,
    last: Option<Copied>,
    /// True if the recording ended while it may still have been on its way.
    pub is_cut_off: bool,
}

impl Passage {
    pub(super) const fn new(number: u64, key: u64, source: Option<MacAddress>) -> Self {
        let sights = Vec::new();
        Self { number, key, source, sights, first: None, last: None, is_cut_off: false }
    }

    /// The ports that it came to, in the order of the recording.
    #[must_use]
    pub fn sights(&self) -> &[Sight] {
        &self.sights
    }

    /// When it was seen first.
    #[must_use]
    pub fn began(&self) -> Instant {
        self.sights.iter().map(|sight| sight.time).min().unwrap_or_default()
    }

    /// Sight of it at a port; `None` if it did not come there.
    #[must_use]
    pub fn at(&self, port: u8) -> Option<&Sight> {
        self.sights.iter().find(|sight| sight.port == port)
    }

    pub(super) fn was_at(&self, port: u8) -> bool {
        self.at(port).is_some()
    }

    /// True if an undamaged copy with this key at this port is one of it.
    pub(super) fn takes(&self, key: u64, port: u8) -> bool {
        self.key == key && !self.was_at(port)
    }

    pub(super) fn see(&mut self, copy: Copied, is_damaged: bool) {
        let mark = match copy.record.alignment_error {
            true => DamageMark::Marked,
            false => DamageMark::Fresh,
        };
        let damage = is_damaged.then_some(mark);
        let Copied { port, time, number, .. } = copy;
        self.sights.push(Sight { port, time, number, damage });
        if self.first.is_none() {
            self.first = Some(copy);
        } else {
            self.last = Some(copy);
        }
    }

    /// Share of bytes in which a copy is like the one that was seen last, in percent: of all of them or of the first
    /// headers, since SubDevices put data into the rest. What a cut has left over counts.
    pub(super) fn likeness(&self, bytes: &[u8]) -> usize {
        let Some(known) = self.last.as_ref().or(self.first.as_ref()) else { return 0 };
        if bytes.len() > known.bytes.len() {
            return 0;
        }
        let share = |most: usize| {
            let pairs = || bytes.iter().zip(&known.bytes).take(most);
            let equal = pairs().filter(|(one, other)| one == other).count();
            (equal * 100).checked_div(pairs().count()).unwrap_or(100)
        };
        share(usize::MAX).max(share(HEADERS))
    }

    /// The request and its return, as a card of the MainDevice would have shown them. `turns` says whether frames of
    /// this sender come back at all: in a ring they go on to the other card.
    pub(super) fn exchange(
        &self,
        order: &PortOrder,
        turns: bool,
        reach: &mut ProbeReach,
        give: &mut impl FnMut(FrameSeen<'_>),
    ) {
        let Some(first) = &self.first else { return };
        if !turns {
            return give(FrameSeen {
                direction: Direction::Unknown,
                ..first.seen(Network::default())
            });
        }
        let direction = |copy: &Copied| match order.is_back(copy.port) {
            true => Direction::Received,
            false => Direction::Sent,
        };
        let is_sent = direction(first) == Direction::Sent;
        let back = self.last.as_ref().or((!is_sent).then_some(first));
        let back = back.filter(|back| direction(back) == Direction::Received);
        let before = order.before(first.port);
        let mut sent = None;
        let mut returned = None;
        // At the MainDevice's own link all is as the MainDevice sees it.
        if is_sent && before != Some(0) {
            sent = as_sent(&first.bytes, before.unwrap_or(0));
            returned = back.map(|back| back.bytes.clone());
            if let (Some(sent), Some(returned)) = (&mut sent, &mut returned) {
                reach.mask(sent, returned);
            }
        }
        if is_sent {
            let bytes = sent.as_deref().unwrap_or(&first.bytes);
            let seen = first.seen(Network::default());
            give(FrameSeen { direction: Direction::Sent, bytes, ..seen });
        }
        if let Some(back) = back {
            let bytes = returned.as_deref().unwrap_or(&back.bytes);
            let seen = back.seen(Network::default());
            give(FrameSeen { direction: Direction::Received, bytes, ..seen });
        }
    }
}

/// Ports that the frames of one sender come by.
#[derive(Clone, Debug)]
pub(super) struct SenderWay {
    pub(super) source: MacAddress,
    passages: u64,
    visits: [u64; linesman_proto::esl::PORTS as usize],
}

impl SenderWay {
    /// Most senders that are told apart.
    const MOST: usize = 8;

    pub(super) fn note(ways: &mut Vec<Self>, source: MacAddress, passage: &Passage) {
        let known = ways.iter().position(|way| way.source == source);
        let index = known.unwrap_or_else(|| {
            if ways.len() < Self::MOST {
                ways.push(Self { source, passages: 0, visits: Default::default() });
            }
            ways.len() - 1
        });
        let way = &mut ways[index];
        way.passages += 1;
        for sight in passage.sights() {
            way.visits[usize::from(sight.port)] += 1;
        }
    }

    /// The ports of the way, in order.
    pub(super) fn ports<'a>(&'a self, order: &'a PortOrder) -> impl Iterator<Item = u8> + 'a {
        let ports = order.ports().iter().map(|port| port.number);
        let is_often = |visits: u64| visits * 100 >= self.passages * OFTEN_PERCENT;
        ports.filter(move |port| is_often(self.visits[usize::from(*port)]))
    }
}
