//! Delay of transmitted frames: a busy host, a queue.
//!
//! A host keeps back a single frame now and then, before it comes to the card; or the card keeps back all of
//! them by so much for a while. Either way those behind it wait with it, and it goes on its way when it leaves. A card
//! that is in time sends one frame after the other, too: what is handed to it while one is still leaving
//! waits for its end.

use std::collections::VecDeque;

use linesman_proto::address::Path;
use linesman_proto::ethernet::MIN_LEN;
use linesman_proto::frame::size::BYTE_NS;
use linesman_proto::time::{Instant, Span};

use super::Segment;
use super::card::Card;
use crate::frame::{FCS_LEN, PREAMBLE_LEN};
use crate::truth::{Effect, FaultId, Place};

/// The gap between two frames on the line, in bytes (IEEE 802.3).
const GAP: usize = 12;

/// How late a card is.
#[derive(Clone, Default, Debug)]
pub(super) struct TxDelay {
    /// From when on all frames by how much, in the order of time, and whose doing it is.
    all: Vec<(Instant, Span, FaultId)>,
    /// Single frames: the next from an instant on, by how much, and whose doing it is.
    single: VecDeque<(Instant, Span, FaultId)>,
    /// When the last frame that was sent, or kept back, has left.
    busy_until: Instant,
    /// Until then the computer keeps back a frame, which has not come to the card, and those behind it.
    held_until: Instant,
}

impl TxDelay {
    /// A frame leaves at `leaves`, and takes so long: the next one follows after the gap.
    #[inline]
    pub(super) fn sends(&mut self, leaves: Instant, duration: Span) {
        let free = leaves + duration + Span::ns(GAP as u64 * BYTE_NS);
        self.busy_until = self.busy_until.max(free);
    }
}

/// A frame that waits in a card until it leaves.
#[derive(Clone, Debug)]
pub(super) struct DelayedFrame {
    path: Path,
    /// Whether who listens was shown it: it has come to the card.
    was_captured: bool,
    bytes: Vec<u8>,
}

impl Card {
    /// From `at` on frames leave later.
    pub(crate) fn make_late(&mut self, at: Instant, by: Span, fault: FaultId) {
        self.tx_delay.all.push((at, by, fault));
    }

    /// The next frame from `at` on leaves later.
    pub(crate) fn delay_next(&mut self, at: Instant, by: Span, fault: FaultId) {
        self.tx_delay.single.push_back((at, by, fault));
    }

    /// A fault is over: frames leave in time again.
    pub(crate) fn be_in_time(&mut self, at: Instant, fault: FaultId) {
        if self.tx_delay.all.last().is_some_and(|(_, _, by)| *by == fault) {
            self.tx_delay.all.push((at, Span::ZERO, fault));
        }
    }

    /// A fault is healed: what still waits for a frame goes with it.
    pub(super) fn delay_no_more(&mut self, fault: FaultId) {
        self.tx_delay.single.retain(|(.., by)| *by != fault);
    }

    /// Whether a frame that is sent at `now` may have to wait.
    #[inline]
    fn is_late(&self, now: Instant) -> bool {
        let TxDelay { all, single, busy_until, .. } = &self.tx_delay;
        !all.is_empty() || !single.is_empty() || *busy_until > now
    }

    /// Whether a frame that is sent at `now` waits in the computer for another one that is kept back there.
    fn is_held_by_host(&self, now: Instant) -> bool {
        self.tx_delay.held_until > now
    }

    /// When a frame leaves that is sent at `now`, if not at once, and who keeps it back, unless it
    /// only waits for the one before it. None overtakes another.
    fn keeps_back(&mut self, now: Instant, bytes: usize) -> Option<(Instant, Option<FaultId>)> {
        let tx_delay = &mut self.tx_delay;
        let passed = tx_delay.all.partition_point(|(from, ..)| *from <= now);
        tx_delay.all.drain(..passed.saturating_sub(1));
        let all = tx_delay.all.first().copied();
        let single = tx_delay.single.pop_front_if(|(from, ..)| *from <= now);
        let late =
            all.into_iter().chain(single).filter(|(from, by, _)| *from <= now && *by > Span::ZERO);
        let most = late.max_by_key(|(_, by, _)| *by);
        if let Some((_, by, _)) = single {
            tx_delay.held_until = tx_delay.held_until.max(now + by);
        }
        let leaves = most.map_or(now, |(_, by, _)| now + by).max(tx_delay.busy_until);
        if leaves <= now {
            return None;
        }
        let len = PREAMBLE_LEN + bytes.max(MIN_LEN) + FCS_LEN;
        tx_delay.sends(leaves, Span::ns(len as u64 * BYTE_NS));
        Some((leaves, most.map(|(.., fault)| fault)))
    }
}

impl Segment {
    /// Keeps a frame back if its card is late; true if so.
    #[inline]
    pub(super) fn keep_back(&mut self, now: Instant, path: Path, frame: &[u8]) -> bool {
        let late = !self.world.running.is_empty() || self.world.cards[path.index()].is_late(now);
        late && self.keep_back_late(now, path, frame)
    }

    fn keep_back_late(&mut self, now: Instant, path: Path, frame: &[u8]) -> bool {
        // What happens up to now is known before.
        self.world.look_ahead(now, Span::ZERO);
        let Some((leaves, fault)) = self.world.cards[path.index()].keeps_back(now, frame.len())
        else {
            return false;
        };
        if fault.is_some() {
            let effect = Effect::FrameHeldBack { by: leaves.since(now) };
            self.world.truth.effect(now, fault, Place::Host(path), effect);
        }
        let is_in_card = !self.world.cards[path.index()].is_held_by_host(now);
        let was_captured = is_in_card && self.capture(now, path, frame);
        let mut bytes = self.spare.pop().unwrap_or_default();
        bytes.clear();
        bytes.extend_from_slice(frame);
        self.waiting.push(leaves, DelayedFrame { path, was_captured, bytes });
        true
    }

    /// Sends what was kept back until now.
    #[inline]
    pub(super) fn send_kept_back(&mut self, now: Instant) {
        while let Some((leaves, kept)) = self.waiting.pop_until(now) {
            self.send(leaves, kept.path, &kept.bytes, kept.was_captured);
            self.recycle(kept.bytes);
        }
    }
}
