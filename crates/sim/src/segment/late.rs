//! Frames that a card sends later than it was told to: a busy host, a queue.

use std::collections::VecDeque;

use linesman_proto::address::Path;
use linesman_proto::frame::size::BYTE_NS;
use linesman_proto::time::{Instant, Span};

use super::Segment;
use super::card::Card;
use crate::truth::{Effect, FaultId, Place};

/// Preamble, check sequence and gap between frames, in bytes.
const AROUND_FRAME: u64 = 24;

/// How late a card is.
#[derive(Clone, Default, Debug)]
pub(super) struct Lateness {
    /// From when on by how much, in the order of time, and whose doing it is.
    known: Vec<(Instant, Span, FaultId)>,
    /// When the last frame that was kept back has left.
    busy_until: Instant,
}

/// Frames that wait in the cards, by the time at which they leave.
#[derive(Clone, Default, Debug)]
pub(super) struct Waiting(VecDeque<(Instant, Path, Vec<u8>)>);

impl Card {
    /// From `at` on frames leave later.
    pub(crate) fn make_late(&mut self, at: Instant, by: Span, fault: FaultId) {
        self.lateness.known.push((at, by, fault));
    }

    /// A fault is over: frames leave in time again.
    pub(crate) fn be_in_time(&mut self, at: Instant, fault: FaultId) {
        if self.lateness.known.last().is_some_and(|(_, _, by)| *by == fault) {
            self.lateness.known.push((at, Span::ZERO, fault));
        }
    }

    /// Whether its frames have ever left late.
    fn is_late(&self) -> bool {
        !self.lateness.known.is_empty()
    }

    /// When a frame leaves that is sent at `now`, if not at once, and who keeps it back. None
    /// overtakes another.
    fn keeps_back(&mut self, now: Instant, bytes: usize) -> Option<(Instant, FaultId)> {
        let lateness = &mut self.lateness;
        let passed = lateness.known.partition_point(|(from, _, _)| *from <= now);
        lateness.known.drain(..passed.saturating_sub(1));
        let (_, by, fault) = *lateness.known.first().filter(|(from, _, _)| *from <= now)?;
        let leaves = (now + by).max(lateness.busy_until);
        if leaves <= now {
            return None;
        }
        lateness.busy_until = leaves + Span::ns((bytes as u64 + AROUND_FRAME) * BYTE_NS);
        Some((leaves, fault))
    }
}

impl Segment {
    /// Keeps a frame back if its card is late; true if so.
    pub(super) fn keep_back(&mut self, now: Instant, path: Path, frame: &[u8]) -> bool {
        if self.world.running.is_empty() && !self.world.cards[path.index()].is_late() {
            return false;
        }
        // What happens up to now is known before.
        self.world.look_ahead(now, Span::ZERO);
        let Some((leaves, fault)) = self.world.cards[path.index()].keeps_back(now, frame.len())
        else {
            return false;
        };
        let effect = Effect::FrameHeldBack { by: leaves.since(now) };
        self.world.truth.effect(now, Some(fault), Place::Host(path), effect);
        let waiting = &mut self.waiting.0;
        let before = waiting.iter().take_while(|(other, _, _)| *other <= leaves).count();
        waiting.insert(before, (leaves, path, frame.to_vec()));
        true
    }

    /// Sends what was kept back until now.
    pub(super) fn send_kept_back(&mut self, now: Instant) {
        while self.waiting.0.front().is_some_and(|(leaves, _, _)| *leaves <= now) {
            if let Some((leaves, path, frame)) = self.waiting.0.pop_front() {
                self.send(leaves, path, &frame);
            }
        }
    }

    /// When the next frame that was kept back leaves.
    pub(super) fn next_leaves(&self) -> Option<Instant> {
        self.waiting.0.front().map(|(leaves, _, _)| *leaves)
    }
}
