//! Requests that were given up.

use linesman_proto::time::{Instant, Span};

use super::{Exchange, Pairing, PendingRequest, gap};

/// So many later returns make a request lost that has been out for longer than [`REORDERED`].
const OVERTAKEN: u16 = 16;
/// So many do at any time: far more than short frames can be noted before a long one.
const OVERTAKEN_BY_MANY: u16 = 64;
/// Within this time frames may be noted in another order than they went: the longest one takes 123 µs,
/// and waits for others.
const REORDERED: Span = Span::ms(1);
/// When both copies of so many later requests have come back, the ring is whole.
const STILL_WHOLE: u64 = 4;

impl Pairing {
    /// Everything sent before the request at `found` was overtaken once more.
    pub(super) fn overtake(
        &mut self,
        found: usize,
        now: Instant,
        settle: &mut impl FnMut(&Exchange<'_>),
    ) {
        for pending in self.pending.iter_mut().take(found) {
            pending.overtaken += 1;
        }
        let is_lost = |oldest: &PendingRequest| {
            oldest.overtaken >= OVERTAKEN_BY_MANY
                || (oldest.overtaken >= OVERTAKEN && gap(oldest.time, now) > REORDERED)
        };
        while self.pending.front().is_some_and(is_lost) {
            self.lose(0, false, settle);
        }
    }

    /// Gives up on a request; what came back of its copies counts.
    pub(super) fn lose(
        &mut self,
        index: usize,
        is_cut_off: bool,
        settle: &mut impl FnMut(&Exchange<'_>),
    ) {
        let Some(pending) = self.pending.get(index) else { return };
        let (mut copy_lost, mut copy_gone) = (None, None);
        if pending.out == 1 && !pending.sums.is_empty() && !is_cut_off {
            let card = pending.came_to.other();
            // A ring that was opened loses all copies; one that is whole loses single ones.
            match pending.whole_before.map(|before| self.whole - before) {
                Some(since) if since >= STILL_WHOLE => copy_lost = Some(card),
                Some(_) => {
                    copy_gone = Some(card);
                    self.was_whole = false;
                    self.has_lost_copies = true;
                }
                // It went out while copies of others got lost.
                None if self.has_lost_copies && self.was_whole => copy_lost = Some(card),
                None if self.has_lost_copies => copy_gone = Some(card),
                None => {}
            }
        }
        settle(&Exchange {
            request: Some(pending.copy()),
            reply: None,
            earlier: &pending.sums,
            is_last: true,
            returns_before: pending.returns_before,
            is_cut_off,
            is_part: pending.is_part,
            copy_lost,
            copy_gone,
            sent_by: None,
        });
        self.remove(index);
    }

    pub(super) fn remove(&mut self, index: usize) {
        if let Some(pending) = self.pending.remove(index) {
            self.spare.push(pending.bytes);
            self.spare_sums.push(pending.sums);
        }
    }
}
