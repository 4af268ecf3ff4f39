//! Reception of frames: the slot that a frame belongs to, and what it is to that slot.

use linesman_proto::address::Path;
use linesman_proto::ethernet::{ETHERTYPE_ETHERCAT, MAX_LEN, MacAddress, SOURCE_MARK};
use linesman_proto::time::Instant;

use super::prebuilt::{FIRST_HEAD_END, FIRST_INDEX, Shaped};
use super::{Exchange, Purpose, Slot, SlotState, merge};

/// Offset of the source address in a frame.
const SOURCE_AT: usize = 6;
/// Offset of the byte whose upper half is the type in the EtherCAT header.
const TYPE_AT: usize = 15;
/// That type: datagrams.
const DATAGRAMS: u8 = 1;

/// What a received frame was.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Received {
    /// With it, all copies of this slot are back.
    Complete(u8),
    /// One of two copies.
    FirstCopy,
    /// A frame that was given up.
    Late,
    /// A frame that had come back already.
    Duplicate,
    /// One more copy of a cyclic frame that is sent more than once, after the first.
    Spare(u8),
    /// From our address, but nothing that is out: an unknown number, or other datagrams.
    Stray,
    /// A frame of ours without its end.
    Truncated,
    /// Our own frame, as it was sent: not from the line.
    Echo,
    /// From another address, or no EtherCAT.
    Foreign,
}

/// A cyclic frame that seems to have come back.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Awaited {
    /// Its slot.
    pub(crate) slot: u8,
    /// Which of the prebuilt ones is waited for there; [`Slot::NONE`]: none.
    pub(crate) frame: u32,
    /// Its number.
    pub(crate) number: u32,
    /// Its outputs were withheld.
    pub(crate) withheld: bool,
}

/// Source address and EtherType of a frame as one number.
pub(super) type Origin = u64;

/// The same of a frame that comes back from the line.
pub(super) const fn marked(origin: Origin) -> Origin {
    origin | SOURCE_MARK as Origin
}

/// A card is silent once so many of its copies in a row were given up.
const SILENT: u8 = 3;

pub(super) fn origin(source: MacAddress) -> Origin {
    let [a, b, c, d, e, f] = source.0;
    let [g, h] = ETHERTYPE_ETHERCAT.to_be_bytes();
    u64::from_le_bytes([a & !SOURCE_MARK, b, c, d, e, f, g, h])
}

impl Exchange {
    /// What a frame is, if it looks like what comes back nearly always, without a ring: a cyclic frame
    /// that is waited for, marked by the line. It is that when its datagrams are, too
    /// ([`Prebuilt::is_like`](super::prebuilt::Prebuilt::is_like)); then [`Exchange::answered`] takes
    /// it. For anything else `None`: [`Exchange::receive`] tells what it is.
    #[inline]
    pub(crate) fn awaited(&self, frame: &[u8]) -> Option<Awaited> {
        let head: &[u8; FIRST_HEAD_END] = frame.first_chunk()?;
        let at = head[FIRST_INDEX];
        let origin = head[SOURCE_AT..].first_chunk().map(|word| u64::from_le_bytes(*word));
        if origin != Some(self.marked) || head[TYPE_AT] >> 4 != DATAGRAMS || frame.len() > MAX_LEN {
            return None;
        }
        let slot = self.slot(at);
        let Slot { awaited, number, withheld, .. } = *slot;
        Some(Awaited { slot: at, frame: awaited, number, withheld })
    }

    /// The frame that a slot has waited for is back.
    #[inline]
    pub(crate) fn answered(&mut self, at: u8) {
        let slot = &mut self.slots[usize::from(at)];
        slot.awaited = Slot::NONE;
        slot.copies.arrived[0] = true;
        slot.state = SlotState::Answered;
        self.waits_no_longer();
    }

    /// Takes a frame that arrived at card `path`.
    pub(crate) fn receive(&mut self, now: Instant, path: Path, frame: &[u8]) -> Received {
        let Some(head) = frame.first_chunk() else { return self.receive_stub(frame) };
        let Some(sender) = self.sender(head) else { return Received::Foreign };
        let at = head[FIRST_INDEX];
        let slot = &mut self.slots[usize::from(at)];
        if slot.state == SlotState::Free || frame.len() > MAX_LEN {
            return Received::Stray;
        }
        let shaped = match slot.purpose {
            Purpose::Cyclic { frame: prebuilt } => match self.cyclic.get(prebuilt as usize) {
                Some(prebuilt) => prebuilt.matches(frame, slot.number, slot.withheld),
                None => Shaped::Otherwise,
            },
            Purpose::Acyclic => slot.matches(frame, sender),
        };
        match shaped {
            Shaped::AsSent => {}
            Shaped::Otherwise => return Received::Stray,
            Shaped::CutOff => {
                slot.truncated = true;
                return Received::Truncated;
            }
        }
        if head[SOURCE_AT] & SOURCE_MARK == 0 && sender == path && self.is_echo(at, frame) {
            return Received::Echo;
        }
        self.silent[sender.index()] = 0;
        let slot = &mut self.slots[usize::from(at)];
        if slot.state != SlotState::Waiting {
            return slot.answered_again(at, now, sender);
        }
        if self.ring {
            return self.receive_copy(at, path, sender, frame);
        }
        slot.copies.arrived[0] = true;
        if slot.purpose == Purpose::Acyclic {
            slot.reply.extend_from_slice(frame);
        }
        self.retire(at, SlotState::Answered);
        Received::Complete(at)
    }

    /// A frame that ends before its first index byte.
    fn receive_stub(&self, frame: &[u8]) -> Received {
        let mut head = [0; FIRST_INDEX + 1];
        head[..frame.len()].copy_from_slice(frame);
        match self.sender(&head) {
            Some(_) => Received::Truncated,
            None => Received::Foreign,
        }
    }

    /// One of the two copies of a ring.
    fn receive_copy(&mut self, at: u8, path: Path, sender: Path, frame: &[u8]) -> Received {
        let slot = &mut self.slots[usize::from(at)];
        let copy = sender.index();
        if slot.copies.arrived[copy] || !slot.copies.outstanding[copy] {
            return Received::Duplicate;
        }
        slot.copies.arrived[copy] = true;
        self.ring_intact = Some(path != sender);
        let purpose = slot.purpose;
        let Slot { sent, reply, counted, .. } = slot;
        let prebuilt = match purpose {
            Purpose::Cyclic { frame } => self.cyclic.get(frame as usize),
            Purpose::Acyclic => None,
        };
        if reply.is_empty() {
            *counted = [0; 2];
        }
        counted[path.index()] += prebuilt.map_or(0, |prebuilt| prebuilt.counted(frame));
        if reply.is_empty() {
            reply.extend_from_slice(frame);
        } else {
            merge::merge(reply, sender.other(), frame, |card, data| match prebuilt {
                Some(prebuilt) => prebuilt.sent_by(card, data),
                None => sent.get(data),
            });
        }
        // In a ring that is open at a card nothing of that card comes back: services need not wait for it.
        let is_all = purpose == Purpose::Acyclic
            && path == sender
            && self.silent[sender.other().index()] >= SILENT;
        if is_all || slot.is_complete() {
            self.retire(at, SlotState::Answered);
            self.count_by_card(at);
            Received::Complete(at)
        } else {
            Received::FirstCopy
        }
    }

    /// Whether a frame is just as we have sent it.
    fn is_echo(&self, at: u8, frame: &[u8]) -> bool {
        let slot = self.slot(at);
        match slot.purpose {
            Purpose::Acyclic => frame.starts_with(&slot.sent),
            Purpose::Cyclic { frame: index } => {
                (self.cyclic.get(index as usize)).is_some_and(|prebuilt| prebuilt.is_echo(frame))
            }
        }
    }

    /// Which of our cards has sent a frame, when it is one of datagrams.
    #[inline]
    fn sender(&self, head: &[u8; FIRST_INDEX + 1]) -> Option<Path> {
        let word = head[SOURCE_AT..].first_chunk()?;
        let origin = u64::from_le_bytes(*word);
        // Controllers set one bit of the source address; those of our cards have it clear.
        let origin = origin & !u64::from(SOURCE_MARK);
        if head[TYPE_AT] >> 4 != DATAGRAMS {
            return None;
        }
        if origin == self.origins[0] {
            return Some(Path::A);
        }
        (self.ring && origin == self.origins[1]).then_some(Path::B)
    }
}
