//! Batch of frames of a task that leave together, and whether they are back.

use std::ops::Range;

use linesman_config::plan::Plan;
use linesman_proto::time::{Instant, Span};

use super::application::Application;

/// So many cyclic frames lost in a row are more than an accident.
pub(super) const LOST_IS_NEWS: u64 = 3;

/// Frames of a task that leave together.
#[derive(Debug)]
pub(super) struct FrameBatch {
    pub(super) next_at: Instant,
    /// When it was due the last time.
    pub(super) began_at: Instant,
    pub(super) cycle: Span,
    /// Their places among all frames.
    pub(super) frames: Range<usize>,
    /// How many of those that left last, or are to leave, are not back.
    out: usize,
    /// The last of them has come back, or was given up.
    pub(super) exchanged: bool,
    /// The cycle of the task begins with it.
    pub(super) begins: bool,
    pub(super) task: usize,
    /// The application of the task, where its cycle begins.
    pub(super) application: Application,
}

/// A frame in the order of batches.
#[derive(Clone, Copy, Debug)]
pub(super) struct BatchFrame {
    pub(super) batch: usize,
    pub(super) task: usize,
    /// Its number within the task, and among those of all tasks.
    pub(super) number: usize,
    pub(super) planned: usize,
}

/// Which frames of a plan leave together when it begins at `now`, and all of them in that order.
pub(super) fn frame_batches(
    plan: &Plan,
    application: Application,
    now: Instant,
) -> (Vec<FrameBatch>, Vec<BatchFrame>) {
    let (mut batches, mut order) = (Vec::<FrameBatch>::new(), Vec::new());
    let mut planned = 0;
    for (task, one) in plan.tasks.iter().enumerate() {
        let first = one.frames.iter().map(|frame| frame.ahead).max().unwrap_or_default();
        let last = one.frames.iter().map(|frame| frame.ahead).min().unwrap_or_default();
        for (number, frame) in one.frames.iter().enumerate() {
            let next_at = now + first.saturating_sub(frame.ahead);
            let same = |one: &FrameBatch| one.task == task && one.next_at == next_at;
            let batch = batches.iter().position(same).unwrap_or_else(|| {
                batches.push(FrameBatch {
                    next_at,
                    began_at: next_at,
                    cycle: one.cycle.max(Span::ns(1)),
                    frames: 0..0,
                    out: 0,
                    exchanged: false,
                    begins: frame.ahead == last,
                    task,
                    application,
                });
                batches.len() - 1
            });
            order.push(BatchFrame { batch, task, number, planned });
            planned += 1;
        }
    }
    order.sort_by_key(|one| one.batch);
    for (at, one) in order.iter().enumerate() {
        let Range { start, end } = &mut batches[one.batch].frames;
        if start == end {
            *start = at;
        }
        *end = at + 1;
    }
    (batches, order)
}

/// When the first of them is due; [`Instant::MAX`]: there is none.
pub(super) fn earliest(batches: &[FrameBatch]) -> Instant {
    batches.iter().map(|one| one.next_at).min().unwrap_or(Instant::MAX)
}

impl FrameBatch {
    /// It is due at `now`: its frames leave, and again a cycle later. Cycles that were slept through are
    /// left out, not caught up: the grid stays. Gives how many.
    #[inline]
    pub(super) fn depart(&mut self, now: Instant) -> u64 {
        self.out = self.frames.end - self.frames.start;
        self.began_at = self.next_at;
        self.next_at += self.cycle;
        if self.next_at <= now { self.catch_up(now) } else { 0 }
    }

    #[cold]
    fn catch_up(&mut self, now: Instant) -> u64 {
        let behind = now.since(self.next_at).as_nanos() / self.cycle.as_nanos() + 1;
        self.next_at += self.cycle * behind;
        self.began_at = self.next_at.before(self.cycle);
        behind
    }

    /// One of its frames is on its way no longer: it is back, was given up, or did not leave. Says
    /// whether it was the last.
    #[inline]
    pub(super) fn came(&mut self) -> bool {
        let Some(out) = self.out.checked_sub(1) else { return false };
        self.out = out;
        out == 0
    }

    pub(super) const fn is_out(&self) -> bool {
        self.out > 0
    }
}
