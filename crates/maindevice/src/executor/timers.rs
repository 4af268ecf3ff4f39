//! Timers of sleeping tasks. A cancelled timer stays in the heap until it comes up, or until most
//! of the heap is of that kind.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::task::Waker;

use linesman_proto::time::Instant;

use super::waitlist::Waitlist;

/// The sleepers.
#[derive(Default)]
pub(crate) struct Timers {
    sleepers: Waitlist<Waker>,
    /// Times and numbers of sleepers; of those with one time the one that came first is first.
    times: BinaryHeap<Reverse<(Instant, u64)>>,
}

impl Timers {
    /// Somebody sleeps until then; the number is for waking it no more.
    pub(crate) fn insert(&mut self, until: Instant, waker: Waker) -> u64 {
        let number = self.sleepers.insert(waker);
        self.times.push(Reverse((until, number)));
        number
    }

    /// Another is to be woken; false: it sleeps no longer.
    pub(crate) fn renew(&mut self, number: u64, waker: &Waker) -> bool {
        let sleeper = self.sleepers.get_mut(number);
        sleeper.map(|sleeper| sleeper.clone_from(waker)).is_some()
    }

    /// It need not be woken any more; false: it has been.
    pub(crate) fn remove(&mut self, number: u64) -> bool {
        let slept = self.sleepers.remove(number).is_some();
        let Self { sleepers, times } = self;
        if times.len() > 2 * sleepers.len() + 64 {
            times.retain(|Reverse((_, number))| sleepers.contains(*number));
        }
        while times.peek().is_some_and(|Reverse((_, number))| !sleepers.contains(*number)) {
            times.pop();
        }
        slept
    }

    /// When the first is to be woken.
    pub(crate) fn first(&self) -> Option<Instant> {
        self.times.peek().map(|Reverse((at, _))| *at)
    }

    /// The first whose time has come.
    pub(crate) fn pop_due(&mut self, now: Instant) -> Option<Waker> {
        while self.first().is_some_and(|at| at <= now) {
            let Reverse((_, number)) = self.times.pop()?;
            if let Some(waker) = self.sleepers.remove(number) {
                // What comes up next is somebody's.
                self.remove(number);
                return Some(waker);
            }
        }
        None
    }

    #[cfg(test)]
    pub(super) fn len(&self) -> usize {
        self.sleepers.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cancelled_sleeper_is_not_waited_for_and_many_cancelled_are_forgotten() {
        let mut timers = Timers::default();
        let at = |nanos| Instant::from_nanos(nanos);
        let waker = Waker::noop();
        let first = timers.insert(at(1), waker.clone());
        let last = timers.insert(at(1_000_000), waker.clone());
        assert_eq!(timers.first(), Some(at(1)));
        assert!(timers.remove(first) && !timers.remove(first) && !timers.renew(first, waker));
        assert_eq!(timers.first(), Some(at(1_000_000)));
        for nanos in 0..1_000 {
            let number = timers.insert(at(2_000_000 + nanos), waker.clone());
            timers.remove(number);
        }
        assert!(timers.times.len() < 70, "{}", timers.times.len());
        assert!(timers.renew(last, waker) && timers.pop_due(at(5)).is_none());
        assert!(timers.pop_due(at(1_000_000)).is_some());
        assert_eq!((timers.first(), timers.len()), (None, 0));
    }
}
