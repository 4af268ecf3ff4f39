//! Ports of a capture probe: what came to each, how many SubDevices lie before it, and their order.

use linesman_proto::command::Addressing;
use linesman_proto::esl::{EslRecord, PORTS};
use linesman_proto::frame::FrameView;
use linesman_proto::time::Instant;

use super::tap::CHANNELS;
use crate::observe::FrameSeen;

/// Most different numbers of SubDevices that are told apart at a port.
const MOST_NUMBERS: usize = 8;
/// Beyond so many votes the order of two ports is not asked any more.
const VOTES: u32 = 10_000;

/// A port of a probe.
#[derive(Clone, Debug)]
pub struct ProbePort {
    /// Its number, from 0.
    pub number: u8,
    /// Frames that came to it.
    pub frames: u64,
    /// Those of them that were damaged.
    pub damaged: u64,
    /// Those of them that a controller had found bad before.
    pub marked: u64,
    /// How often broadcasts had passed so many SubDevices when they came.
    passed: Vec<(u16, u64)>,
}

impl ProbePort {
    /// SubDevices that a frame has passed when it comes here, as the address of broadcasts tells; `None` while none
    /// was seen.
    #[must_use]
    pub fn before(&self) -> Option<u16> {
        self.passed.iter().max_by_key(|(_, times)| *times).map(|(passed, _)| *passed)
    }
}

/// The ports of a probe, in the order in which frames pass them.
#[derive(Clone, Default, Debug)]
pub struct PortOrder {
    ports: Vec<ProbePort>,
    /// By two ports: how often the same frame came to the one before the other.
    votes: [[u32; PORTS as usize]; PORTS as usize],
    /// By channel: SubDevices before it, as the user says of a tap that adds no records.
    told: [Option<u16>; CHANNELS as usize],
}

impl PortOrder {
    /// The ports.
    #[must_use]
    pub fn ports(&self) -> &[ProbePort] {
        &self.ports
    }

    /// A port by its number.
    #[must_use]
    pub fn port(&self, number: u8) -> Option<&ProbePort> {
        self.ports.iter().find(|port| port.number == number)
    }

    /// Number of ports that have seen anything.
    #[must_use]
    pub fn len(&self) -> usize {
        self.ports.len()
    }

    /// True if none has.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.ports.is_empty()
    }

    /// The place of a port in the order.
    #[must_use]
    pub fn rank(&self, number: u8) -> usize {
        let found = self.ports.iter().position(|port| port.number == number);
        found.unwrap_or(self.ports.len())
    }

    /// True if frames come to a port on their way back: behind the other port of its channel.
    #[must_use]
    pub fn is_back(&self, number: u8) -> bool {
        let other = number ^ 1;
        self.port(other).is_some() && self.rank(other) < self.rank(number)
    }

    /// True if a copy at a port is of a frame that comes back, false if it goes out; `None` while no frame was seen at
    /// both ports of the channel, as in a ring.
    #[must_use]
    pub fn comes_back(&self, number: u8) -> Option<bool> {
        if self.is_tap() {
            return Some(number % 2 == 1);
        }
        let votes =
            |one: u8, other: u8| self.votes.get(usize::from(one))?.get(usize::from(other)).copied();
        let other = number ^ 1;
        let is_known = votes(number, other)? + votes(other, number)? > 0;
        is_known.then(|| self.is_back(number))
    }

    /// SubDevices before a port: as the user says of the way out of a tap, else as broadcasts tell.
    #[must_use]
    pub fn before(&self, number: u8) -> Option<u16> {
        let told = self.told.get(usize::from(number / 2)).copied().flatten();
        told.filter(|_| !self.is_back(number)).or_else(|| self.port(number)?.before())
    }

    /// True for a tap of which the user says where it sits: its cards add no records, and drop damaged frames.
    #[must_use]
    pub fn is_tap(&self) -> bool {
        self.told.iter().any(Option::is_some)
    }

    /// Tells how many SubDevices lie before each channel, channel 0 first.
    pub(super) fn tell_places(&mut self, before: &[u16]) {
        for (told, before) in self.told.iter_mut().zip(before) {
            *told = Some(*before);
        }
    }

    /// Number that the user says, without what was seen.
    pub(super) fn without_ports(&self) -> Self {
        Self { told: self.told, ..Self::default() }
    }

    /// Counts a frame at a port.
    pub(super) fn note(&mut self, number: u8, frame: &FrameSeen<'_>, record: EslRecord) {
        let known = self.ports.iter().position(|port| port.number == number);
        let index = known.unwrap_or_else(|| {
            let passed = Vec::new();
            self.ports.push(ProbePort { number, frames: 0, damaged: 0, marked: 0, passed });
            self.ports.len() - 1
        });
        let port = &mut self.ports[index];
        port.frames += 1;
        if record.is_damaged() || frame.fcs == Some(false) {
            port.damaged += 1;
            port.marked += u64::from(record.alignment_error);
            return;
        }
        let Ok(view) = FrameView::parse(frame.bytes) else { return };
        let broadcasts = view.datagrams().map_while(Result::ok).filter_map(|datagram| {
            let addressing = datagram.command()?.addressing();
            (addressing == Addressing::Broadcast).then_some((datagram.logical().0 & 0xFFFF) as u16)
        });
        for passed in broadcasts {
            let known = port.passed.iter().position(|(known, _)| *known == passed);
            match known {
                Some(index) => port.passed[index].1 += 1,
                None if port.passed.len() < MOST_NUMBERS => port.passed.push((passed, 1)),
                None => {}
            }
        }
    }

    /// The same frame came to two ports at these times.
    pub(super) fn vote(&mut self, one: u8, at: Instant, other: u8, other_at: Instant) {
        let (first, second) = if at <= other_at { (one, other) } else { (other, one) };
        let votes = &mut self.votes[usize::from(first)][usize::from(second)];
        if *votes < VOTES {
            *votes += 1;
            if *votes < 64 {
                self.sort();
            }
        }
    }

    fn sort(&mut self) {
        let votes = &self.votes;
        let numbers: Vec<u8> = self.ports.iter().map(|port| port.number).collect();
        let is_before = |one: u8, other: u8| {
            let (one, other) = (usize::from(one), usize::from(other));
            votes[one][other] > votes[other][one]
        };
        let behind = |port: &ProbePort| {
            let before = numbers.iter().filter(|other| is_before(**other, port.number)).count();
            (before, port.number)
        };
        self.ports.sort_by_key(behind);
    }
}
