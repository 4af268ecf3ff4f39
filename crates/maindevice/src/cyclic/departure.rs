//! Frames of a task that leave together, and how a task fares with what comes back.

use std::ops::Range;
use std::sync::Mutex;

use linesman_proto::time::{Instant, Span};

use super::application::Application;
use crate::event::Event;
use crate::executor::lock;
use crate::supervisor::Line;

/// So many cyclic frames lost in a row are more than an accident.
pub(super) const LOST_IS_NEWS: u64 = 3;

/// Frames of a task that leave together.
#[derive(Debug)]
pub(super) struct Departure {
    pub(super) task: usize,
    pub(super) next_at: Instant,
    pub(super) cycle: Span,
    /// The cycle of the task begins with it.
    pub(super) begins: bool,
    /// Their places in the order of departures.
    pub(super) frames: Range<usize>,
}

#[derive(Debug)]
pub(super) struct TaskState {
    /// Frames lost in a row.
    pub(super) lost: u64,
    /// Frames that are on their way.
    pub(super) out: u32,
    /// The last of them has come back, or was given up.
    pub(super) exchanged: bool,
    pub(super) application: Application,
}

impl Departure {
    /// It is due at `now`: the next time is a cycle later. Cycles that were slept through are left
    /// out, not caught up: the grid stays. Gives how many.
    #[inline]
    pub(super) fn advance(&mut self, now: Instant) -> u64 {
        self.next_at += self.cycle;
        if self.next_at <= now { self.catch_up(now) } else { 0 }
    }

    #[cold]
    fn catch_up(&mut self, now: Instant) -> u64 {
        let behind = now.since(self.next_at).as_nanos() / self.cycle.as_nanos() + 1;
        self.next_at += self.cycle * behind;
        behind
    }
}

impl TaskState {
    /// Its frames come back again.
    #[cold]
    pub(super) fn found(
        &mut self,
        task: usize,
        line: &Mutex<Line>,
        events: &mut impl FnMut(Event),
    ) {
        let lost = std::mem::take(&mut self.lost);
        if lost >= LOST_IS_NEWS {
            events(Event::CyclicFramesBack { task, lost });
            lock(line).alert();
        }
    }

    /// One of its frames is on its way no longer; whether more leave in the same cycle.
    #[inline]
    pub(super) fn came(&mut self, out: &mut bool, more: bool) {
        if std::mem::replace(out, false) {
            self.out = self.out.wrapping_sub(1);
            self.exchanged |= self.out == 0 && !more;
        }
    }
}
