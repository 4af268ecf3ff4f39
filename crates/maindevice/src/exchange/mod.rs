//! Frames out, frames back: slots, packing, matching, time-outs.
//!
//! The engine keeps a slot for each frame that is out. The index bytes of a frame's datagrams carry
//! its number: the first the low byte, the others the next one. A reply is matched by source
//! address, number and shape; so a late reply (the slot was given up) and a duplicate (it was
//! answered) are told from a lost frame, from strays and from frames of others. [`request`] is what
//! procedures ask for. Cyclic frames are [`prebuilt`]. Two copies of a ring are merged datagram by
//! datagram.

mod merge;
mod outgoing;
pub(crate) mod prebuilt;
mod queue;
mod receive;
pub mod request;
mod slot;

use std::collections::VecDeque;

use linesman_config::plan::FramePlan;
use linesman_proto::address::{Path, WorkingCounter};
use linesman_proto::ethernet::{MAX_LEN, MIN_LEN, MacAddress};
use linesman_proto::frame::{FrameBuilder, MAX_DATAGRAM_DATA};
use linesman_proto::time::{Instant, Span};

pub use request::{Access, DatagramData, Departure, ExchangeError, Reply, Request, Target};

use outgoing::Outgoing;
use prebuilt::Prebuilt;
pub(crate) use prebuilt::SecondCopy;
pub(crate) use queue::{Queued, Ticket};
pub(crate) use receive::Received;
use receive::{Origin, marked, origin};
use slot::Copies;
pub(crate) use slot::{Purpose, Slot, SlotState};

/// Most datagrams of procedures in one frame.
pub const MAX_ACYCLIC_DATAGRAMS: usize = 15;

/// As many frames as the low byte of a frame's number can tell apart.
const SLOTS: usize = 256;

/// An answer that comes once more so long after its deadline is none: its index was made up.
const OLD: Span = Span::ms(50);
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

/// How a cyclic frame is sent.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Order {
    /// Which of the prebuilt ones it is.
    pub(crate) frame: u32,
    /// When it is given up.
    pub(crate) deadline: Instant,
    /// Its outputs are not to be taken for fresh.
    pub(crate) withheld: bool,
}

/// The slots.
#[derive(Debug)]
pub(crate) struct Exchange {
    sources: [MacAddress; 2],
    origins: [Origin; 2],
    /// That of the frames which card A sent, as they come back.
    marked: Origin,
    /// Two cards send each frame.
    ring: bool,
    /// As many as an index byte can name.
    slots: Box<[Slot; SLOTS]>,
    /// The frames of the running plan, for what comes back otherwise than nearly always, and for copies.
    cyclic: Vec<Prebuilt>,
    /// How many slots are waiting.
    waiting: usize,
    /// When the first of them is given up, or a little before.
    earliest: Instant,
    outgoing: Outgoing,
    queue: VecDeque<Queued>,
    /// Time at which the first of the queue was first held back because other frames are out.
    held_back: Option<Instant>,
    acyclic_out: usize,
    number: u32,
    patience: Span,
    /// Whether what one card sends arrives at the other: `None` before the first frame, or with one card.
    ring_intact: Option<bool>,
    /// Copies of each card that have been given up since one of it came back.
    silent: [u8; 2],
    /// How many counted in what each card received of the last broadcast read of a ring's cycle.
    responding_by_card: Option<[WorkingCounter; 2]>,
}

impl Exchange {
    pub(crate) fn new(sources: [MacAddress; 2], ring: bool, patience: Span) -> Self {
        Self {
            sources,
            origins: sources.map(origin),
            marked: marked(origin(sources[0])),
            cyclic: Vec::new(),
            ring,
            slots: Box::new(std::array::from_fn(|_| Slot::new())),
            earliest: Instant::MAX,
            waiting: 0,
            outgoing: Outgoing::new(),
            queue: VecDeque::new(),
            held_back: None,
            acyclic_out: 0,
            number: 0,
            patience,
            ring_intact: None,
            silent: [0; 2],
            responding_by_card: None,
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
    #[inline]
    pub(crate) fn has_queued(&self) -> bool {
        !self.queue.is_empty()
    }

    /// How many frames of procedures are out.
    #[inline]
    pub(crate) fn acyclic_out(&self) -> usize {
        self.acyclic_out
    }

    /// Whether frames wait to be fetched, or datagrams to be packed.
    #[inline]
    pub(crate) fn has_any(&self) -> bool {
        self.has_outgoing() || self.has_queued()
    }

    /// Whether frames wait to be fetched by [`Exchange::poll_transmit`].
    #[inline]
    pub(crate) fn has_outgoing(&self) -> bool {
        !self.outgoing.is_empty()
    }

    /// Packs queued datagrams into one frame of at most `room` bytes, or of one datagram, and sends it. False if none
    /// goes out.
    pub(crate) fn send_acyclic(&mut self, now: Instant, room: usize) -> bool {
        if self.queue.is_empty() || self.waits_for_quiet_line(now) {
            return false;
        }
        let Some((at, number)) = self.free_slot() else { return false };
        let slot = &mut self.slots[usize::from(at)];
        slot.sent.resize(MAX_LEN, 0);
        slot.requests.clear();
        let room = room.clamp(MIN_LEN, MAX_LEN);
        let mut builder = FrameBuilder::new(&mut slot.sent, self.sources[0]);
        let index = |datagram: usize| number.to_le_bytes()[usize::from(datagram > 0)];
        let packed = &mut slot.requests;
        queue::pack(&mut builder, &mut self.queue, packed, MAX_ACYCLIC_DATAGRAMS, room, index);
        let len = builder.finish();
        slot.sent.truncate(len);
        slot.cards.clear();
        slot.cards.extend(slot.requests.iter().map(|queued| queued.request.card));
        let deadline = now + self.patience;
        slot.begin(Purpose::Acyclic, deadline, &Copies::new(1, self.ring));
        slot.awaited = Slot::NONE;
        self.outgoing.push(at);
        self.acyclic_out += 1;
        self.wait_until(deadline);
        true
    }

    /// True while the first of the queue is held back because other frames are out.
    fn waits_for_quiet_line(&mut self, now: Instant) -> bool {
        let wants_quiet =
            self.queue.front().is_some_and(|one| one.request.departure == Departure::QuietLine);
        if !wants_quiet || self.waiting == 0 {
            self.held_back = None;
            return false;
        }
        let since = *self.held_back.get_or_insert(now);
        let waits = now < since + request::QUIET_WITHIN;
        if !waits {
            self.held_back = None;
        }
        waits
    }

    /// Takes over the frames of a plan, and gives them to those who send them. Those of the last one must
    /// have been abandoned.
    pub(crate) fn prebuild(&mut self, frames: impl Iterator<Item = FramePlan>) -> Vec<Prebuilt> {
        let (source, ring) = (self.sources[0], self.ring);
        self.responding_by_card = None;
        self.cyclic =
            (0..).zip(frames).map(|(at, one)| Prebuilt::new(at, &one, source, ring)).collect();
        self.cyclic.clone()
    }

    /// Whether the slot of the next number still waits for its answer. [`Exchange::skip_taken`] finds
    /// another.
    #[inline]
    pub(crate) fn is_next_taken(&self) -> bool {
        let [at, ..] = self.number.to_le_bytes();
        self.slot(at).state == SlotState::Waiting
    }

    /// Passes over numbers whose slots still wait for their answers; false when all do.
    #[cold]
    pub(crate) fn skip_taken(&mut self) -> bool {
        let found = self.free_slot();
        found.is_some_and(|(_, number)| {
            self.number = number;
            true
        })
    }

    /// A prebuilt frame goes out, at once: gives its number, whose slot must be free.
    /// [`Exchange::poll_transmit`] must have given all it had.
    #[inline]
    pub(crate) fn begin_cyclic(&mut self, order: Order, prebuilt: &Prebuilt) -> u32 {
        let Order { frame, deadline, withheld } = order;
        let number = self.number;
        let [at, ..] = number.to_le_bytes();
        let slot = &mut self.slots[usize::from(at)];
        slot.number = number;
        slot.withheld = withheld;
        slot.begin(Purpose::Cyclic { frame }, deadline, prebuilt.copies());
        slot.awaited = prebuilt.awaited();
        self.number = number.wrapping_add(1);
        self.wait_until(deadline);
        number
    }

    /// The same frame is to be sent by other cards, or again: these copies, outputs and all, wait to be
    /// fetched by [`Exchange::poll_transmit`]. Those of the second card are otherwise where that is given.
    #[cold]
    pub(crate) fn keep_copies(
        &mut self,
        frame: u32,
        number: u32,
        sent: &[u8],
        second_copy: Option<SecondCopy>,
    ) {
        let Some(prebuilt) = self.cyclic.get_mut(frame as usize) else { return };
        prebuilt.keep(sent, second_copy);
        let [at, ..] = number.to_le_bytes();
        self.outgoing.push(at);
    }

    /// One more slot waits.
    #[inline]
    fn wait_until(&mut self, deadline: Instant) {
        self.waiting += 1;
        self.earliest = self.earliest.min(deadline);
    }

    /// A slot that is free, and the number of the frame in it.
    #[inline(never)]
    fn free_slot(&mut self) -> Option<(u8, u32)> {
        for _ in 0..SLOTS {
            let number = self.number;
            self.number = number.wrapping_add(1);
            let [at, ..] = number.to_le_bytes();
            if self.slots[usize::from(at)].state != SlotState::Waiting {
                return Some((at, number));
            }
        }
        None
    }

    /// The next copy of a frame to be sent, as bytes in `buffer`, which must hold the longest frame.
    #[inline]
    pub(crate) fn poll_transmit(
        &mut self,
        now: Instant,
        buffer: &mut [u8],
    ) -> Option<(Transmit, Purpose)> {
        while let Some(at) = self.outgoing.first() {
            let slot = &mut self.slots[usize::from(at)];
            // The copies of a ring leave by turns, that of card A first.
            let path = if self.ring && slot.copies.unsent % 2 == 1 { Path::B } else { Path::A };
            slot.copies.unsent = slot.copies.unsent.saturating_sub(1);
            if slot.copies.unsent == 0 {
                self.outgoing.pop();
            }
            let purpose = slot.purpose;
            let (bytes, second) = match purpose {
                Purpose::Cyclic { frame } => match self.cyclic.get(frame as usize) {
                    Some(prebuilt) => (prebuilt.bytes(), prebuilt.second_copy()),
                    None => continue,
                },
                Purpose::Acyclic => (&*slot.sent, None),
            };
            let len = bytes.len();
            let Some(out) = buffer.get_mut(..len) else { continue };
            out.copy_from_slice(bytes);
            if path == Path::B {
                out[6..12].copy_from_slice(&self.sources[1].0);
                if let Some(second) = second {
                    second.put(out);
                }
            }
            if purpose == Purpose::Acyclic {
                slot::mask(out, &slot.cards, path);
            }
            return Some((Transmit { at: now, path, len }, purpose));
        }
        None
    }

    /// The whole answer of a slot: what came back last, or both copies merged.
    #[inline]
    pub(crate) fn answer<'a>(&'a self, at: u8, last: &'a [u8]) -> &'a [u8] {
        let reply = &self.slot(at).reply;
        if reply.is_empty() { last } else { reply }
    }

    #[inline]
    fn retire(&mut self, at: u8, state: SlotState) {
        let slot = &mut self.slots[usize::from(at)];
        slot.state = state;
        slot.awaited = Slot::NONE;
        if slot.purpose == Purpose::Acyclic {
            self.acyclic_out = self.acyclic_out.saturating_sub(1);
        }
        self.waits_no_longer();
    }

    /// One slot less waits.
    #[inline]
    fn waits_no_longer(&mut self) {
        self.waiting -= 1;
        if self.waiting == 0 {
            self.earliest = Instant::MAX;
        }
    }

    /// Slots that are waiting, oldest first: numbers are given in turn.
    fn waiting(&self) -> impl Iterator<Item = (u8, &Slot)> {
        let [first, ..] = self.number.to_le_bytes();
        let all = (0..=u8::MAX).map(move |offset| first.wrapping_add(offset));
        let slots = all.map(|at| (at, self.slot(at)));
        slots.filter(|(_, slot)| slot.state == SlotState::Waiting)
    }

    /// The next slot whose time is up at `now`. With one copy back it is answered by that, else it
    /// is given up; the slot's state tells which.
    #[inline]
    pub(crate) fn expire(&mut self, now: Instant) -> Option<u8> {
        if now < self.earliest { None } else { self.expire_one(now) }
    }

    fn expire_one(&mut self, now: Instant) -> Option<u8> {
        let Some((at, _)) = self.waiting().find(|(_, slot)| slot.deadline <= now) else {
            let first = self.waiting().map(|(_, slot)| slot.deadline).min();
            self.earliest = first.unwrap_or(Instant::MAX);
            return None;
        };
        let copies = self.slot(at).copies;
        let answered = copies.arrived.contains(&true);
        for card in 0..2 {
            if copies.outstanding[card] && !copies.arrived[card] {
                self.silent[card] = self.silent[card].saturating_add(1);
            }
        }
        self.outgoing.remove(at);
        self.retire(at, if answered { SlotState::Answered } else { SlotState::GivenUp });
        self.count_by_card(at);
        Some(at)
    }

    /// Notes how many counted in what each card has received of a frame of a ring that is out no longer.
    fn count_by_card(&mut self, at: u8) {
        let Self { ring: true, slots, cyclic, responding_by_card, .. } = self else { return };
        let slot = &slots[usize::from(at)];
        let Purpose::Cyclic { frame } = slot.purpose else { return };
        if cyclic.get(frame as usize).is_some_and(Prebuilt::has_presence) {
            let counted = if slot.state == SlotState::Answered { slot.counted } else { [0; 2] };
            *responding_by_card = Some(counted.map(WorkingCounter));
        }
    }

    /// Gives up all frames of a plan that runs no longer: they must not be taken for those of the next.
    pub(crate) fn abandon_cyclic(&mut self) {
        let is_cyclic = |slot: &Slot| matches!(slot.purpose, Purpose::Cyclic { .. });
        loop {
            let next = self.waiting().find(|(_, slot)| is_cyclic(slot)).map(|(at, _)| at);
            let Some(at) = next else { return };
            self.outgoing.remove(at);
            self.retire(at, SlotState::GivenUp);
        }
    }

    /// The requests of an answered or given-up slot, to be completed by the caller.
    pub(crate) fn take_requests(&mut self, at: u8) -> Vec<Queued> {
        std::mem::take(&mut self.slots[usize::from(at)].requests)
    }

    /// Gives back the room for the requests of a slot.
    pub(crate) fn give_back(&mut self, at: u8, mut room: Vec<Queued>) {
        room.clear();
        self.slots[usize::from(at)].requests = room;
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

    /// How many counted in what each card received of the last broadcast read of the cycle; `None` without a ring.
    pub(crate) fn responding_by_card(&self) -> Option<[WorkingCounter; 2]> {
        self.responding_by_card
    }

    pub(crate) fn ring_intact(&self) -> Option<bool> {
        self.ring_intact
    }

    #[inline]
    pub(crate) fn slot(&self, at: u8) -> &Slot {
        &self.slots[usize::from(at)]
    }

    pub(crate) fn patience(&self) -> Span {
        self.patience
    }

    /// When the first slot's time is up, or a little before; [`Instant::MAX`] when nothing is out.
    #[inline]
    pub(crate) fn earliest(&self) -> Instant {
        self.earliest
    }
}

#[cfg(test)]
mod tests;
