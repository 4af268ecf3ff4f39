//! Whether the application keeps up: outputs that it has not given anew are not sent as fresh ones.
//!
//! A SubDevice's watchdog guards the way from the MainDevice; it cannot know that the program behind
//! the MainDevice hangs while its frames go on. So when the application is late too often, datagrams
//! with outputs stop carrying them (LRW becomes LRD, LWR becomes NOP), inputs go on, and the
//! watchdogs expire as they should.

/// One task's application.
#[derive(Clone, Copy, Debug)]
pub(super) struct Application {
    /// Cycles in a row without new outputs that are allowed; `None`: it is not watched.
    allowed: Option<u32>,
    /// It has given outputs at least once: until then zeros are sent, so that SubDevices reach OP.
    begun: bool,
    fresh: bool,
    missed: u32,
    withheld: bool,
}

/// What a cycle found.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Judged {
    /// It was late.
    pub(super) missed: bool,
    /// Outputs are withheld in this cycle.
    pub(super) withheld: bool,
    /// That has just changed.
    pub(super) changed: bool,
}

impl Application {
    pub(super) const fn new(allowed: Option<u32>) -> Self {
        Self { allowed, begun: false, fresh: false, missed: 0, withheld: false }
    }

    /// It gives outputs.
    #[inline]
    pub(super) const fn give(&mut self) {
        self.begun = true;
        self.fresh = true;
    }

    /// A cycle begins.
    #[inline]
    pub(super) fn begin_cycle(&mut self) -> Judged {
        let fresh = std::mem::replace(&mut self.fresh, false);
        let Some(allowed) = self.allowed.filter(|_| self.begun) else {
            return Judged { missed: false, withheld: false, changed: false };
        };
        self.missed = if fresh { 0 } else { self.missed.saturating_add(1) };
        let before = std::mem::replace(&mut self.withheld, self.missed > allowed);
        let changed = before != self.withheld;
        Judged { missed: !fresh, withheld: self.withheld, changed }
    }

    pub(super) const fn is_withheld(&self) -> bool {
        self.withheld
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn so_many_misses_are_allowed_and_no_more() {
        let mut application = Application::new(Some(2));
        let idle = application.begin_cycle();
        assert_eq!(idle, Judged { missed: false, withheld: false, changed: false });
        application.give();
        let withheld: Vec<bool> = (0..5).map(|_| application.begin_cycle().withheld).collect();
        assert_eq!(withheld, [false, false, false, true, true]);
        application.give();
        let back = application.begin_cycle();
        assert_eq!(back, Judged { missed: false, withheld: false, changed: true });
    }

    #[test]
    fn who_is_not_watched_may_be_late() {
        let mut application = Application::new(None);
        application.give();
        assert!((0..100).all(|_| !application.begin_cycle().withheld));
    }
}
