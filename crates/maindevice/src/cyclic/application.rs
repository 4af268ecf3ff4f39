//! Supervision of the application: outputs that it has not given anew are not sent as fresh ones.
//!
//! A SubDevice's watchdog guards the way from the MainDevice; it cannot know that the program behind
//! the MainDevice hangs while its frames go on. So when the application is late too often, datagrams
//! with outputs stop carrying them (LRW becomes LRD, LWR becomes NOP), inputs go on, and the
//! watchdogs expire as they should.

use crate::event::Event;
use crate::statistics::Statistics;

/// One task's application.
#[derive(Clone, Copy, Debug)]
pub(super) struct Application {
    /// Cycles in a row without new outputs that are allowed; `None`: it is not watched.
    allowed: Option<u32>,
    /// It has given outputs at least once: until then zeros are sent, so that SubDevices reach OP.
    begun: bool,
    /// It has given outputs of this task since the last cycle.
    fresh: bool,
    /// How often it had given those of all tasks when the last cycle began.
    seen: u64,
    missed: u32,
    withheld: bool,
    /// It has begun, and missed none the last time.
    in_time: bool,
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

impl Judged {
    /// Counts it, and tells when outputs begin or end to be withheld.
    #[cold]
    pub(super) fn tell(
        self,
        task: usize,
        statistics: &mut Statistics,
        events: &mut impl FnMut(Event),
    ) {
        statistics.deadlines_missed += u64::from(self.missed);
        statistics.cycles_withheld += u64::from(self.withheld);
        if self.changed {
            events(match self.withheld {
                true => Event::OutputsWithheld { task },
                false => Event::OutputsResumed { task },
            });
        }
    }
}

impl Application {
    pub(super) const fn new(allowed: Option<u32>) -> Self {
        Self {
            allowed,
            begun: false,
            fresh: false,
            seen: 0,
            missed: 0,
            withheld: false,
            in_time: false,
        }
    }

    /// True while its outputs are withheld because it is late.
    pub(super) const fn is_withheld(&self) -> bool {
        self.withheld
    }

    /// It gives the outputs of this task.
    #[inline]
    pub(super) const fn give(&mut self) {
        self.fresh = true;
    }

    /// A cycle begins; the outputs of all tasks were given `given` times so far. `None`: the
    /// application is in time, as before, or is not watched.
    #[inline]
    pub(super) fn begin_cycle(&mut self, given: u64) -> Option<Judged> {
        if self.seen != given && self.in_time {
            self.seen = given;
            self.fresh = false;
            return None;
        }
        self.look(given)
    }

    #[inline(never)]
    fn look(&mut self, given: u64) -> Option<Judged> {
        let fresh = std::mem::replace(&mut self.fresh, false) | (self.seen != given);
        self.seen = given;
        self.begun |= fresh;
        let judged = if fresh && self.missed == 0 { None } else { self.judge(fresh) };
        self.in_time = self.begun && self.missed == 0;
        judged
    }

    fn judge(&mut self, fresh: bool) -> Option<Judged> {
        let allowed = self.allowed.filter(|_| self.begun)?;
        self.missed = if fresh { 0 } else { self.missed.saturating_add(1) };
        let before = std::mem::replace(&mut self.withheld, self.missed > allowed);
        let changed = before != self.withheld;
        Some(Judged { missed: !fresh, withheld: self.withheld, changed })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn allowed_misses_are_tolerated_and_one_more_is_not() {
        let mut application = Application::new(Some(2));
        assert_eq!(application.begin_cycle(0), None, "it has not begun");
        application.give();
        let mut withheld = || application.begin_cycle(0).is_some_and(|judged| judged.withheld);
        let withheld: Vec<bool> = (0..5).map(|_| withheld()).collect();
        assert_eq!(withheld, [false, false, false, true, true]);
        let back = application.begin_cycle(1);
        assert_eq!(back, Some(Judged { missed: false, withheld: false, changed: true }));
    }

    #[test]
    fn application_without_limit_may_be_late() {
        let mut application = Application::new(None);
        application.give();
        assert!((0..100).all(|_| application.begin_cycle(0).is_none()));
    }
}
