//! A fault that runs: begin, changes, end, as often as its schedule says.

use linesman_proto::time::Instant;

use super::FaultTemplate;
use super::schedule::{Window, Windows};
use crate::truth::FaultId;
use crate::wire::{Change, Source};

/// A fault with its schedule.
#[derive(Debug)]
pub(crate) struct Running {
    pub(crate) id: FaultId,
    /// What the windows behind the first are made from.
    template: Option<FaultTemplate>,
    windows: Windows,
    present: Window,
    /// How many windows there were before the present one.
    nth: u32,
    source: Box<dyn Source>,
    begun: bool,
    /// When it is healed.
    healed_at: Option<Instant>,
    next: Option<(Instant, Change)>,
}

/// What a fault does next.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) enum Step {
    Begin(Instant),
    Change(Instant, Change),
    /// It ends, for this time or for good. Healed before its time, what still waits for a frame goes
    /// with it.
    End {
        at: Instant,
        healed: bool,
        for_good: bool,
    },
}

impl Running {
    /// A fault whose first window's changes come from `source`.
    pub(crate) fn new(
        id: FaultId,
        template: Option<FaultTemplate>,
        mut windows: Windows,
        mut source: Box<dyn Source>,
    ) -> Self {
        let first = windows.first();
        let present = windows.next().unwrap_or(first);
        let next = source.next_change();
        Self { id, template, windows, present, nth: 0, source, begun: false, healed_at: None, next }
    }

    /// Heals it at an instant, unless it ends before.
    pub(crate) fn heal_at(&mut self, at: Instant) {
        self.healed_at = Some(self.healed_at.map_or(at, |before| before.min(at)));
    }

    fn end(&self) -> Instant {
        let end = self.present.to.unwrap_or(Instant::MAX);
        self.healed_at.map_or(end, |healed| healed.min(end))
    }

    /// When it does something next; `None` when it lasts without doing anything.
    pub(crate) fn next_at(&self) -> Option<Instant> {
        let end = self.end();
        if !self.begun {
            return Some(self.present.from.min(end));
        }
        match self.next {
            Some((at, _)) => Some(at.min(end)),
            None => (end != Instant::MAX).then_some(end),
        }
    }

    /// When it sends a frame of its own next, as far as is known.
    pub(crate) fn next_foreign_frame(&self) -> Option<Instant> {
        match self.next {
            Some((at, Change::ForeignSender { .. })) if at < self.end() => Some(at),
            Some(_) | None => None,
        }
    }

    /// Does it. What would come at the end of a window or later does not come.
    pub(crate) fn step(&mut self) -> Step {
        let end = self.end();
        if !self.begun && self.present.from < end {
            self.begun = true;
            return Step::Begin(self.present.from);
        }
        if let Some((at, _)) = self.next
            && at < end
            && let Some((at, change)) = self.next.take()
        {
            self.next = self.source.next_change();
            return Step::Change(at, change);
        }
        let healed = self.healed_at.is_some_and(|healed| healed <= end);
        let for_good = healed || !self.come_again();
        Step::End { at: end, healed, for_good }
    }

    /// Gets ready for the next window; false when there is none.
    fn come_again(&mut self) -> bool {
        let Some(window) = self.windows.next() else { return false };
        self.nth += 1;
        let source =
            self.template.as_ref().and_then(|template| template.source(self.nth, window).ok());
        let Some(source) = source else { return false };
        (self.present, self.source, self.begun) = (window, source, false);
        self.next = self.source.next_change();
        true
    }
}
