//! Frames out, frames back: slots, packing, matching, time-outs.
//!
//! The engine keeps a slot for each frame that is out. The index bytes of a frame's datagrams carry
//! its number: the first the low byte, the others the next one. A reply is matched by source
//! address, number and shape; so a late reply (the slot was given up) and a duplicate (it was
//! answered) are told from a lost frame and from frames of others. [`request`] is what procedures
//! ask for. Two copies of a ring are merged datagram by datagram.

mod merge;
mod queue;
pub mod request;
mod slot;

use std::collections::VecDeque;

use linesman_proto::address::Path;
use linesman_proto::ethernet::{self, MAX_LEN, MacAddress};
use linesman_proto::frame::{FrameBuilder, FrameView, MAX_DATAGRAM_DATA};
use linesman_proto::time::{Instant, Span};

pub use request::{Access, ExchangeError, Reply, Request, Target};

pub(crate) use queue::{Queued, Ticket};
pub(crate) use slot::{Purpose, Slot, SlotState};

/// Most datagrams of procedures in one frame.
pub const MAX_ACYCLIC_DATAGRAMS: usize = 15;

/// As many frames as the low byte of a frame's number can tell apart.
const SLOTS: usize = 256;

/// A frame to be sent.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Transmit {
    /// When its first bit shall leave: now, or a little later.
    pub at: Instant,
    /// By which card.
    pub path: Path,
    /// Its length in the buffer, in bytes without check sequence.
    pub len: usize,
}

/// What a received frame was.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Received {
    /// With it, all copies of this slot are back.
    Complete(usize),
    /// One of two copies.
    FirstCopy,
    /// A frame that was given up.
    Late,
    /// A frame that had come back already.
    Duplicate,
    /// Our own frame, as it was sent: not from the line.
    Echo,
    /// Nothing that we have sent.
    Foreign,
}

/// The slots.
#[derive(Debug)]
pub(crate) struct Exchange {
    sources: [MacAddress; 2],
    paths: [bool; 2],
    slots: Vec<Slot>,
    /// Slots that are waiting, oldest first.
    waiting: Vec<usize>,
    outgoing: VecDeque<(usize, Path)>,
    queue: VecDeque<Queued>,
    acyclic_out: usize,
    number: u32,
    patience: Span,
    /// Whether what one card sends arrives at the other: `None` before the first frame, or with one card.
    ring_intact: Option<bool>,
}

impl Exchange {
    pub(crate) fn new(sources: [MacAddress; 2], ring: bool, patience: Span) -> Self {
        Self {
            sources,
            paths: [true, ring],
            slots: (0..SLOTS).map(|_| Slot::new()).collect(),
            waiting: Vec::with_capacity(SLOTS),
            outgoing: VecDeque::with_capacity(2 * SLOTS),
            queue: VecDeque::new(),
            acyclic_out: 0,
            number: 0,
            patience,
            ring_intact: None,
        }
    }

    /// A request joins the queue. What no frame can carry is refused.
    pub(crate) fn submit(&mut self, queued: Queued) -> Result<(), Queued> {
        if queued.request.data.len() > MAX_DATAGRAM_DATA {
            return Err(queued);
        }
        self.queue.push_back(queued);
        Ok(())
    }

    /// Whether datagrams of procedures wait to be packed.
    pub(crate) fn has_queued(&self) -> bool {
        !self.queue.is_empty()
    }

    /// How many frames of procedures are out.
    pub(crate) fn acyclic_out(&self) -> usize {
        self.acyclic_out
    }

    /// Whether frames wait to be fetched by [`Exchange::poll_transmit`].
    pub(crate) fn has_outgoing(&self) -> bool {
        !self.outgoing.is_empty()
    }

    /// Packs queued datagrams into one frame and sends it.
    pub(crate) fn send_acyclic(&mut self, now: Instant) {
        if self.queue.is_empty() {
            return;
        }
        let deadline = now + self.patience;
        let mut queue = std::mem::take(&mut self.queue);
        let sent = self.send(now, deadline, Purpose::Acyclic, |builder, slot, index| {
            queue::pack(builder, &mut queue, slot.requests, MAX_ACYCLIC_DATAGRAMS, index);
        });
        self.queue = queue;
        if sent.is_some() {
            self.acyclic_out += 1;
        }
    }

    /// Fills a frame and sends it by all cards. `None` when all slots are taken, or nothing was put
    /// into it.
    pub(crate) fn send(
        &mut self,
        now: Instant,
        deadline: Instant,
        purpose: Purpose,
        fill: impl FnOnce(&mut FrameBuilder<'_>, &mut FillSlot<'_>, &dyn Fn(usize) -> u8),
    ) -> Option<usize> {
        let at = self.free_slot()?;
        let number = self.number;
        self.number = self.number.wrapping_add(1);
        let slot = &mut self.slots[at];
        let mut sent = std::mem::take(&mut slot.sent);
        sent.resize(MAX_LEN, 0);
        slot.requests.clear();
        let mut builder = FrameBuilder::new(&mut sent, self.sources[0]);
        let index = move |datagram: usize| number.to_le_bytes()[usize::from(datagram > 0)];
        fill(&mut builder, &mut FillSlot { requests: &mut slot.requests }, &index);
        let empty = builder.is_empty();
        let len = builder.finish();
        sent.truncate(len);
        slot.sent = sent;
        if empty {
            return None;
        }
        slot.cards.clear();
        slot.cards.extend(slot.requests.iter().map(|queued| queued.request.card));
        slot.state = SlotState::Waiting;
        slot.purpose = purpose;
        slot.sent_at = now;
        slot.deadline = deadline;
        slot.outstanding = self.paths;
        slot.arrived = [false; 2];
        slot.reply.clear();
        self.waiting.push(at);
        for path in Path::ALL {
            if self.paths[path.index()] {
                self.outgoing.push_back((at, path));
            }
        }
        Some(at)
    }

    fn free_slot(&mut self) -> Option<usize> {
        for _ in 0..SLOTS {
            let at = usize::from(self.number.to_le_bytes()[0]);
            if self.slots[at].state != SlotState::Waiting {
                return Some(at);
            }
            self.number = self.number.wrapping_add(1);
        }
        None
    }

    /// The next copy of a frame to be sent, as bytes in `buffer`, which must hold the longest frame.
    pub(crate) fn poll_transmit(
        &mut self,
        now: Instant,
        buffer: &mut [u8],
    ) -> Option<(Transmit, Purpose)> {
        while let Some((at, path)) = self.outgoing.pop_front() {
            let slot = &self.slots[at];
            let len = slot.sent.len();
            let Some(out) = buffer.get_mut(..len) else { continue };
            out.copy_from_slice(&slot.sent);
            if path == Path::B {
                out[6..12].copy_from_slice(&self.sources[1].0);
            }
            slot::mask(out, &slot.cards, path);
            return Some((Transmit { at: now, path, len }, slot.purpose));
        }
        None
    }

    /// Takes a frame that arrived at card `path`.
    pub(crate) fn receive(&mut self, path: Path, frame: &[u8]) -> Received {
        let Some(sender) = self.sender(frame) else { return Received::Foreign };
        let first = FrameView::parse(frame).ok().and_then(|view| view.datagrams().next());
        let Some(Ok(first)) = first else { return Received::Foreign };
        let at = usize::from(first.index());
        let slot = &mut self.slots[at];
        if slot.state == SlotState::Free || frame.len() > MAX_LEN || !slot.matches(frame, sender) {
            return Received::Foreign;
        }
        let unmarked = ethernet::source(frame).is_some_and(|source| !source.is_marked());
        if unmarked && sender == path && frame.starts_with(&slot.sent) && sender == Path::A {
            return Received::Echo;
        }
        match slot.state {
            SlotState::Free => return Received::Foreign,
            SlotState::GivenUp => return Received::Late,
            SlotState::Answered => return Received::Duplicate,
            SlotState::Waiting => {}
        }
        let copy = sender.index();
        if slot.arrived[copy] || !slot.outstanding[copy] {
            return Received::Duplicate;
        }
        slot.arrived[copy] = true;
        if self.paths[Path::B.index()] {
            self.ring_intact = Some(path != sender);
        }
        if slot.reply.is_empty() {
            slot.reply.extend_from_slice(frame);
        } else {
            merge::merge(&mut slot.reply, frame);
        }
        if slot.is_complete() {
            self.retire(at, SlotState::Answered);
            Received::Complete(at)
        } else {
            Received::FirstCopy
        }
    }

    fn sender(&self, frame: &[u8]) -> Option<Path> {
        let source = ethernet::source(frame)?;
        let is = |path: &Path| {
            let ours = self.sources[path.index()];
            self.paths[path.index()] && (source == ours || source == ours.marked())
        };
        Path::ALL.into_iter().find(is)
    }

    fn retire(&mut self, at: usize, state: SlotState) {
        self.slots[at].state = state;
        self.waiting.retain(|waiting| *waiting != at);
        if self.slots[at].purpose == Purpose::Acyclic {
            self.acyclic_out = self.acyclic_out.saturating_sub(1);
        }
    }

    /// The next slot whose time is up at `now`. With one copy back it is answered by that, else it
    /// is given up; the slot's state tells which.
    pub(crate) fn expire(&mut self, now: Instant) -> Option<usize> {
        let due = |at: &&usize| self.slots[**at].deadline <= now;
        let at = *self.waiting.iter().find(due)?;
        let answered = self.slots[at].arrived.contains(&true);
        self.outgoing.retain(|(outgoing, _)| *outgoing != at);
        self.retire(at, if answered { SlotState::Answered } else { SlotState::GivenUp });
        Some(at)
    }

    /// Gives up all frames of a plan that runs no longer: they must not be taken for those of the next.
    pub(crate) fn abandon_cyclic(&mut self) {
        while let Some(at) = (self.waiting.iter().copied())
            .find(|at| matches!(self.slots[*at].purpose, Purpose::Cyclic { .. }))
        {
            self.outgoing.retain(|(outgoing, _)| *outgoing != at);
            self.retire(at, SlotState::GivenUp);
        }
    }

    /// The requests of an answered or given-up slot, to be completed by the caller.
    pub(crate) fn take_requests(&mut self, at: usize) -> Vec<Queued> {
        std::mem::take(&mut self.slots[at].requests)
    }

    /// A request whose frame was lost: again, if it may be repeated; else it is given back.
    pub(crate) fn again(&mut self, mut queued: Queued) -> Option<Queued> {
        if queued.frames <= u32::from(queued.request.repeats) {
            queued.frames = queued.frames.max(1);
            self.queue.push_back(queued);
            return None;
        }
        Some(queued)
    }

    /// Forgets all datagrams of procedures that have not been sent yet.
    pub(crate) fn forget(&mut self, cancelled: impl Fn(Ticket) -> bool) {
        self.queue.retain(|queued| !cancelled(queued.ticket));
    }

    pub(crate) fn ring_intact(&self) -> Option<bool> {
        self.ring_intact
    }

    pub(crate) fn slot(&self, at: usize) -> &Slot {
        &self.slots[at]
    }

    pub(crate) fn patience(&self) -> Span {
        self.patience
    }

    /// When the first slot's time is up.
    pub(crate) fn poll_timeout(&self) -> Option<Instant> {
        self.waiting.iter().map(|at| self.slots[*at].deadline).min()
    }
}

/// The part of a slot that is filled along with its frame.
pub(crate) struct FillSlot<'a> {
    pub(crate) requests: &'a mut Vec<Queued>,
}

#[cfg(test)]
mod tests;
