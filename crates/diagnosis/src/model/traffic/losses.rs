//! Frames that did not come back, or came back damaged or in one copy alone.

use std::collections::VecDeque;

use linesman_proto::address::Path;
use linesman_proto::time::Instant;

use super::silence::{self, Silence};
use crate::model::{Seen, Tally};

/// Times of lost frames kept.
pub const LOST_KEPT: usize = 64;

/// Lost frames. The learner fills it in as requests are given up, the intake damaged ones.
#[derive(Clone, Default, Debug)]
pub struct LostFrames {
    frames: Tally,
    first: Option<Seen<()>>,
    latest: Option<Seen<()>>,
    times: VecDeque<Instant>,
    copies: [Tally; 2],
    copy_times: [VecDeque<Instant>; 2],
    /// Copies that do not come to each card since the ring is no longer whole.
    copies_gone: [Tally; 2],
    gone_times: [VecDeque<Instant>; 2],
    damaged: Tally,
    silences: VecDeque<Silence>,
    swallowed: VecDeque<Silence>,
}

impl LostFrames {
    // ---- what intake, learner and observation files tell ----

    /// Takes the number of lost frames that somebody else counted.
    pub fn report(&mut self, frames: Tally) {
        self.frames = frames;
    }

    /// A request was lost that went out when `returns_before` frames had come back, the next of them at `ended`. One
    /// that ports which were opened or closed on purpose have swallowed (`by_order`) makes a silence, but is no loss.
    pub(super) fn record(
        &mut self,
        seen: Seen<()>,
        returns_before: u64,
        by_order: bool,
        ended: Option<Instant>,
    ) {
        let row = self.silences.back_mut().filter(|row| row.returns_before == returns_before);
        if !by_order {
            self.frames.add(1, seen.at);
            if row.is_none() {
                note(&mut self.times, seen.at);
            }
            self.first.get_or_insert(seen);
            self.latest = Some(seen);
        }
        if let Some(silence) = row {
            silence.goes_on(seen);
            silence.ended = ended;
            return;
        }
        silence::keep(&mut self.silences, Silence::begin(seen, ended, returns_before));
    }

    /// In a ring, of a request the copy alone came back that nobody had processed; of those that had been processed one
    /// came back at `ended` since.
    pub(super) fn record_swallowed(
        &mut self,
        seen: Seen<()>,
        returns_before: u64,
        ended: Option<Instant>,
    ) {
        if let Some(silence) = self.swallowed.back_mut()
            && silence.ended.is_none_or(|ended| ended >= seen.at)
        {
            silence.goes_on(seen);
            return;
        }
        silence::keep(&mut self.swallowed, Silence::begin(seen, ended, returns_before));
    }

    /// A frame came back: no silence goes on.
    pub(super) fn end_silence(&mut self, at: Instant) {
        if let Some(silence) = self.silences.back_mut() {
            silence.ended.get_or_insert(at);
        }
    }

    /// A frame came back that somebody had processed.
    pub(super) fn end_swallowing(&mut self, at: Instant) {
        if let Some(silence) = self.swallowed.back_mut() {
            silence.ended.get_or_insert(at);
        }
    }

    /// Of a request that was sent at `at` the copy of one card came back, and not the one to this card.
    pub fn record_copy(&mut self, card: Path, at: Instant) {
        self.copies[card.index()].add(1, at);
        note(&mut self.copy_times[card.index()], at);
    }

    /// In a ring that was whole before and is not now, of a request that was sent at `at` the copy to `card` did not come.
    pub(crate) fn record_copy_gone(&mut self, card: Path, at: Instant) {
        self.copies_gone[card.index()].add(1, at);
        note(&mut self.gone_times[card.index()], at);
    }

    /// Both copies of a request came back: what did not come before was lost, and nothing swallows it for good. True if
    /// something was lost so.
    pub(crate) fn end_copies_gone(&mut self) -> bool {
        let mut has_lost = false;
        for card in Path::ALL.map(Path::index) {
            let gone = std::mem::take(&mut self.copies_gone[card]);
            if let Some((first, last)) = gone.first.zip(gone.last) {
                has_lost = true;
                self.copies[card].add(1, first);
                self.copies[card].add(gone.sum - 1, last);
                while let Some(at) = self.gone_times[card].pop_front() {
                    note(&mut self.copy_times[card], at);
                }
            }
        }
        has_lost
    }

    /// A frame came back with a wrong check sequence.
    pub(crate) fn record_damaged(&mut self, at: Instant) {
        self.damaged.add(1, at);
    }

    /// A new spell of errors begins.
    pub(crate) fn begin_spell(&mut self) {
        self.frames.begin_spell();
        self.copies.iter_mut().for_each(Tally::begin_spell);
    }

    // ---- what rules ask ----

    /// Frames whose way out was seen and whose return was not, though others came back later.
    #[must_use]
    pub const fn frames(&self) -> Tally {
        self.frames
    }

    /// The first lost frame.
    #[must_use]
    pub const fn first(&self) -> Option<Seen<()>> {
        self.first
    }

    /// The latest lost frame.
    #[must_use]
    pub const fn latest(&self) -> Option<Seen<()>> {
        self.latest
    }

    /// When the first of each row of them was sent between two returns, in the order in which that was known, at most
    /// [`LOST_KEPT`].
    #[must_use]
    pub const fn times(&self) -> &VecDeque<Instant> {
        &self.times
    }

    /// Of the frames of which the copy of one card came back: how many did not come to `card`.
    #[must_use]
    pub const fn copies(&self, card: Path) -> Tally {
        self.copies[card.index()]
    }

    /// Times of sending of those whose copy did not come to `card`, in the order in which that was known, at most [`LOST_KEPT`].
    #[must_use]
    pub const fn copy_times(&self, card: Path) -> &VecDeque<Instant> {
        &self.copy_times[card.index()]
    }

    /// In a ring that was whole before, how many frames there were of which one copy alone came back, with none after
    /// them of which both did.
    #[must_use]
    pub const fn copies_gone(&self) -> u64 {
        self.copies_gone[0].sum + self.copies_gone[1].sum
    }

    /// Frames that came back with a wrong check sequence.
    #[must_use]
    pub const fn damaged(&self) -> Tally {
        self.damaged
    }

    /// When nothing at all came back, oldest first, at most [`SILENCES_KEPT`](silence::SILENCES_KEPT).
    #[must_use]
    pub const fn silences(&self) -> &VecDeque<Silence> {
        &self.silences
    }

    /// In a ring, when what card B had sent came round untouched, and nothing of what card A had sent came back:
    /// oldest first, at most [`SILENCES_KEPT`](silence::SILENCES_KEPT).
    #[must_use]
    pub const fn swallowed(&self) -> &VecDeque<Silence> {
        &self.swallowed
    }
}

/// Keeps a time, and forgets the oldest where there are too many.
fn note(times: &mut VecDeque<Instant>, at: Instant) {
    if times.len() == LOST_KEPT {
        times.pop_front();
    }
    times.push_back(at);
}
