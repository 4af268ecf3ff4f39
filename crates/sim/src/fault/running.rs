//! A fault that runs: begin, changes, end.

use linesman_proto::time::Instant;

use crate::truth::FaultId;
use crate::wire::{Change, Source};

/// A fault with its schedule.
#[derive(Debug)]
pub(crate) struct Running {
    pub(crate) id: FaultId,
    from: Instant,
    to: Option<Instant>,
    source: Box<dyn Source>,
    begun: bool,
    healed: bool,
    next: Option<(Instant, Change)>,
}

/// What a fault does next.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Step {
    Begin(Instant),
    Change(Instant, Change),
    /// It ends; healed before its time, what still waits for a frame goes with it.
    End {
        at: Instant,
        healed: bool,
    },
}

impl Running {
    pub(crate) fn new(
        id: FaultId,
        from: Instant,
        to: Option<Instant>,
        mut source: Box<dyn Source>,
    ) -> Self {
        let next = source.next_change();
        Self { id, from, to, source, begun: false, healed: false, next }
    }

    /// Heals it at an instant, unless it ends before.
    pub(crate) fn heal_at(&mut self, at: Instant) {
        if self.to.is_none_or(|to| at < to) {
            self.to = Some(at);
            self.healed = true;
        }
    }

    /// When it does something next; `None` when it lasts without doing anything.
    pub(crate) fn next_at(&self) -> Option<Instant> {
        let end = self.to.unwrap_or(Instant::MAX);
        if !self.begun {
            return Some(self.from.min(end));
        }
        match self.next {
            Some((at, _)) => Some(at.min(end)),
            None => self.to,
        }
    }

    /// Does it. What would come at its end or later does not come.
    pub(crate) fn step(&mut self) -> Step {
        let end = self.to.unwrap_or(Instant::MAX);
        if !self.begun && self.from < end {
            self.begun = true;
            return Step::Begin(self.from);
        }
        match self.next {
            Some((at, change)) if at < end => {
                self.next = self.source.next_change();
                Step::Change(at, change)
            }
            Some(_) | None => Step::End { at: end, healed: self.healed },
        }
    }
}
