//! Frames of foreign senders: another MainDevice, or computers that know nothing of EtherCAT.
//!
//! They come in through a switch at the begin of a line, wait there while a frame of the card is on
//! it, and then go the way of all frames: controllers execute a second MainDevice's datagrams, and
//! destroy what is not EtherCAT or let it pass (DL control bit 0, S1 3.2). What comes back goes to
//! the card, too, as a switch sends broadcasts to all its ports.

use linesman_proto::address::{Path, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::ethernet::{MIN_LEN, MacAddress};
use linesman_proto::frame::FrameBuilder;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::register as r;
use linesman_proto::time::Instant;

use super::change::DirectedLink;
use super::walk::{FrameInTransit, Outcome};
use super::world::World;
use crate::event_queue::EventQueue;
use crate::frame::{Damage, WireFrame};
use crate::truth::{Effect, FaultId};

/// What a foreign sender sends.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ForeignSender {
    /// Another MainDevice looks who is there, and reads their states: `nth` of its frames.
    Scan {
        /// Which of its frames, from 0.
        nth: u32,
    },
    /// Another MainDevice orders all SubDevices into a state.
    State {
        /// The value of AL control.
        control: u8,
        /// Which of its frames, from 0.
        nth: u32,
    },
    /// Another MainDevice clears the error counters, as tools do.
    ClearCounters {
        /// Which of its frames, from 0.
        nth: u32,
    },
    /// A computer asks for a neighbour's address (ARP).
    Arp,
    /// A computer sends data (UDP over IPv4).
    Ipv4,
    /// A switch tells who it is (LLDP).
    Lldp,
}

impl ForeignSender {
    /// The sender's address: a locally administered one would already have the bit that the first
    /// controller sets.
    const MAC: MacAddress = MacAddress([0x00, 0x1B, 0x21, 0x5E, 0xA0, 0x02]);

    /// The frame, without its check sequence.
    fn bytes(self) -> Vec<u8> {
        let station = |ado: RegisterAddress| DatagramAddress::Physical(0, ado);
        let brd = |ado: RegisterAddress, len: usize, nth: u32| {
            ethercat(Command::Brd, station(ado), &vec![0; len], nth)
        };
        match self {
            Self::Scan { nth } => match nth % 4 {
                0 => brd(r::ESC_TYPE.address, 1, nth),
                1 => brd(r::DL_STATUS.address, 2, nth),
                2 => brd(r::AL_STATUS.address, 2, nth),
                _ => brd(r::AL_STATUS_CODE.address, 2, nth),
            },
            Self::State { control, nth } => {
                ethercat(Command::Bwr, station(r::AL_CONTROL.address), &[control, 0], nth)
            }
            Self::ClearCounters { nth } => {
                ethercat(Command::Bwr, station(r::RX_ERROR_COUNTER.address), &[0; 8], nth)
            }
            Self::Arp => foreign(0x0806, &ARP),
            Self::Ipv4 => foreign(0x0800, &IPV4),
            Self::Lldp => foreign(0x88CC, &LLDP),
        }
    }
}

fn ethercat(command: Command, address: DatagramAddress, data: &[u8], nth: u32) -> Vec<u8> {
    let mut bytes = vec![0; MIN_LEN];
    let mut builder = FrameBuilder::new(&mut bytes, ForeignSender::MAC);
    // A handful of bytes always fits.
    if let Ok(slot) = builder.push(command, nth as u8, address, data.len()) {
        slot.copy_from_slice(data);
    }
    let len = builder.finish();
    bytes.truncate(len);
    bytes
}

/// Who has 192.0.2.1? Tell 192.0.2.7.
const ARP: [u8; 28] = [
    0, 1, 8, 0, 6, 4, 0, 1, 0x00, 0x1B, 0x21, 0x5E, 0xA0, 0x02, 192, 0, 2, 7, 0, 0, 0, 0, 0, 0,
    192, 0, 2, 1,
];
/// A datagram of 18 bytes from 192.0.2.7 to the broadcast address, UDP port 137.
const IPV4: [u8; 46] = [
    0x45, 0, 0, 46, 0, 1, 0, 0, 64, 17, 0xB8, 0xBF, 192, 0, 2, 7, 255, 255, 255, 255, 0, 137, 0,
    137, 0, 26, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17,
];
/// Chassis, port, time to live, end.
const LLDP: [u8; 23] = [
    2, 7, 4, 0x00, 0x1B, 0x21, 0x5E, 0xA0, 0x02, 4, 6, 7, b'p', b'o', b'r', b't', b'1', 6, 2, 0,
    120, 0, 0,
];

fn foreign(ethertype: u16, payload: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0xFF; 6];
    bytes.extend_from_slice(&ForeignSender::MAC.0);
    bytes.extend_from_slice(&ethertype.to_be_bytes());
    bytes.extend_from_slice(payload);
    bytes.resize(bytes.len().max(MIN_LEN), 0);
    bytes
}

/// Frames of foreign senders: those that are to be sent, and those that came back.
#[derive(Clone, Default, Debug)]
pub(crate) struct ForeignSenders {
    waiting: EventQueue<(FaultId, DirectedLink, ForeignSender)>,
    /// Until when the last one is on its line.
    until: Option<(DirectedLink, Instant)>,
    back: Vec<(Instant, Path, WireFrame)>,
}

impl ForeignSenders {
    pub(super) fn push(
        &mut self,
        at: Instant,
        fault: FaultId,
        direction: DirectedLink,
        what: ForeignSender,
    ) {
        self.waiting.push(at, (fault, direction, what));
    }

    #[inline]
    pub(super) fn next_at(&self) -> Option<Instant> {
        self.waiting.next_at()
    }

    pub(super) fn disarm(&mut self, fault: FaultId) {
        self.waiting.retain(|(by, ..)| *by != fault);
    }
}

impl World {
    /// Foreign senders send what is due by `now`. Frames that are on the way together are carried in the
    /// order in which they were sent.
    pub(super) fn send_foreign_frames(&mut self, now: Instant) {
        while let Some((at, (fault, direction, what))) = self.foreign_senders.waiting.pop_until(now)
        {
            self.note_entries();
            self.frames += 1;
            let number = self.frames;
            let frame = WireFrame { bytes: what.bytes(), damage: Damage::default(), number };
            let at = self.free_at(direction, at);
            self.foreign_senders.until = Some((direction, at + frame.duration()));
            let effect = Effect::StrangerSent { frame: number };
            self.truth.effect(at, Some(fault), self.direction_place(direction), effect);
            let mut in_transit = FrameInTransit::of(frame, fault);
            if let Outcome::Arrived(path, at) = self.walk_from(direction, at, &mut in_transit) {
                self.foreign_senders.back.push((at, path, in_transit.frame));
            }
        }
    }

    /// When a line is free of the frame that its card has sent last.
    fn free_at(&self, direction: DirectedLink, at: Instant) -> Instant {
        let cards = self.leaving.iter().zip(&self.cards);
        let busy = cards.filter(|(leaving, _)| **leaving == Some(direction));
        busy.map(|(_, card)| card.sent_until).fold(at, Instant::max)
    }

    /// When a frame that a card sends at `at` gets onto its line, past a foreign one.
    #[inline]
    pub(crate) fn behind_foreign_frames(&self, card: Path, at: Instant) -> Instant {
        match self.foreign_senders.until {
            Some((direction, until)) if self.leaving[card.index()] == Some(direction) => {
                at.max(until)
            }
            Some(_) | None => at,
        }
    }

    /// Whether frames of foreign senders came to a card.
    #[inline]
    pub(crate) fn foreign_frames_came_back(&self) -> bool {
        !self.foreign_senders.back.is_empty()
    }

    /// Frames of foreign senders that came back to a card.
    pub(crate) fn take_foreign_frames(
        &mut self,
    ) -> impl Iterator<Item = (Instant, Path, WireFrame)> {
        self.foreign_senders.back.drain(..)
    }

    /// When a foreign sender sends next, as far as is known.
    #[inline]
    pub(crate) fn next_foreign_frame(&self) -> Option<Instant> {
        if self.running.is_empty() && self.foreign_senders.waiting.is_empty() {
            return None;
        }
        let running = self.running.iter().filter_map(crate::fault::Running::next_foreign_frame);
        running.chain(self.foreign_senders.next_at()).min()
    }
}

#[cfg(test)]
mod tests {
    use linesman_proto::frame::FrameView;

    use super::*;

    #[test]
    fn foreign_frames_have_the_declared_ether_types() {
        let all = [
            ForeignSender::Scan { nth: 0 },
            ForeignSender::Scan { nth: 3 },
            ForeignSender::State { control: 1, nth: 7 },
            ForeignSender::ClearCounters { nth: 1 },
        ];
        for what in all {
            let bytes = what.bytes();
            let view = FrameView::parse(&bytes).unwrap();
            assert_eq!(view.source(), ForeignSender::MAC);
            assert_eq!(view.datagrams().filter_map(Result::ok).count(), 1, "{what:?}");
        }
        for what in [ForeignSender::Arp, ForeignSender::Ipv4, ForeignSender::Lldp] {
            let bytes = what.bytes();
            assert!(FrameView::parse(&bytes).is_err(), "{what:?}");
            assert!(bytes.len() >= MIN_LEN && bytes[6] & 2 == 0);
        }
    }
}
