//! History of a contact or supply: whole or broken over time, and by which fault.

use linesman_proto::time::Instant;

use crate::truth::FaultId;

/// How many changes are kept. Questions concern the last milliseconds; between two frames even a
/// flapping contact changes a few times only.
const KEPT: usize = 64;

/// The history of a contact or a supply: whole unless at least one fault holds it broken.
#[derive(Clone, Default, Debug)]
pub struct OutageHistory {
    /// Who broke it, from an instant on; `None` for whole. In the order of time.
    changes: Vec<(Instant, Option<FaultId>)>,
    /// Who holds it broken at present.
    holders: Vec<FaultId>,
}

impl OutageHistory {
    /// A fault breaks it. Not before any earlier call.
    pub fn break_at(&mut self, at: Instant, fault: FaultId) {
        self.holders.push(fault);
        self.note(at);
    }

    /// A fault lets go of it; nothing happens if it did not hold it.
    pub fn mend_at(&mut self, at: Instant, fault: FaultId) {
        if let Some(index) = self.holders.iter().rposition(|holder| *holder == fault) {
            self.holders.remove(index);
            self.note(at);
        }
    }

    fn note(&mut self, at: Instant) {
        let cause = self.holders.last().copied();
        if self.changes.last().and_then(|(_, before)| *before) == cause {
            return;
        }
        if self.changes.len() >= KEPT {
            self.changes.drain(..KEPT / 2);
        }
        self.changes.push((at, cause));
    }

    /// Whether it is whole after all changes so far.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.holders.is_empty()
    }

    /// Whether a fault holds it broken after all changes so far.
    #[must_use]
    pub fn is_held_by(&self, fault: FaultId) -> bool {
        self.holders.contains(&fault)
    }

    /// Who holds it broken at an instant.
    #[must_use]
    pub fn cause_at(&self, at: Instant) -> Option<FaultId> {
        let before = self.changes.iter().rev().find(|(since, _)| *since <= at);
        before.and_then(|(_, cause)| *cause)
    }

    /// The first instant from `from` on and before `to` at which it is broken, and by whom.
    #[inline]
    #[must_use]
    pub fn first_break(&self, from: Instant, to: Instant) -> Option<(Instant, FaultId)> {
        // Most things never break.
        if self.changes.is_empty() {
            return None;
        }
        if let Some(cause) = self.cause_at(from) {
            return Some((from, cause));
        }
        let inside = |at: Instant| from < at && at < to;
        self.changes.iter().find_map(|(at, cause)| cause.filter(|_| inside(*at)).map(|c| (*at, c)))
    }

    /// Who broke it last, up to an instant: the one to blame while it recovers.
    #[must_use]
    pub fn last_cause(&self, at: Instant) -> Option<FaultId> {
        self.changes.iter().rev().filter(|(since, _)| *since <= at).find_map(|(_, cause)| *cause)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(nanos: u64) -> Instant {
        Instant::from_nanos(nanos)
    }

    const ONE: FaultId = FaultId(1);
    const TWO: FaultId = FaultId(2);

    #[test]
    fn it_is_broken_while_anyone_holds_it() {
        let mut history = OutageHistory::default();
        history.break_at(at(10), ONE);
        history.break_at(at(20), TWO);
        history.mend_at(at(30), TWO);
        history.mend_at(at(35), TWO);
        assert!(!history.is_whole() && history.is_held_by(ONE) && !history.is_held_by(TWO));
        history.mend_at(at(40), ONE);
        assert!(history.is_whole());
        let causes = [5, 10, 19, 20, 29, 30, 39, 40].map(|nanos| history.cause_at(at(nanos)));
        let (one, two) = (Some(ONE), Some(TWO));
        assert_eq!(causes, [None, one, one, two, two, one, one, None]);
        assert_eq!(history.last_cause(at(50)), one);
        assert_eq!(history.last_cause(at(5)), None);
    }

    #[test]
    fn the_first_break_in_a_span_is_found() {
        let mut history = OutageHistory::default();
        assert_eq!(history.first_break(at(0), at(100)), None);
        history.break_at(at(10), ONE);
        history.mend_at(at(20), ONE);
        history.break_at(at(30), TWO);
        assert_eq!(history.first_break(at(0), at(10)), None, "the end does not belong to it");
        assert_eq!(history.first_break(at(0), at(11)), Some((at(10), ONE)));
        assert_eq!(history.first_break(at(15), at(100)), Some((at(15), ONE)));
        assert_eq!(history.first_break(at(20), at(100)), Some((at(30), TWO)));
    }

    #[test]
    fn old_changes_are_forgotten() {
        let mut history = OutageHistory::default();
        for round in 0..1_000 {
            history.break_at(at(round * 10), ONE);
            history.mend_at(at(round * 10 + 5), ONE);
        }
        assert!(history.changes.len() <= KEPT);
        assert_eq!(history.cause_at(at(9_992)), Some(ONE));
        assert_eq!(history.cause_at(at(9_996)), None);
    }
}
