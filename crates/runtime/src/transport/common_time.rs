//! Common time of several virtual lines: of those that want to go on only the one that is behind all others does.
//!
//! Each line has a thread of its own. What one tells another, such as the time of a network that leads others, comes at the
//! same virtual moment in every run, since never two of them work at once.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use linesman_proto::time::Instant;

/// Place of a line among those that share a time; given up when it is dropped.
#[derive(Debug)]
pub struct TimeShare {
    shared: Arc<SharedTimes>,
    place: usize,
    has_begun: bool,
}

#[derive(Debug)]
struct SharedTimes {
    /// Time at which each line works next, or works now; [`Instant::MAX`]: it has ended.
    times: Mutex<Vec<Instant>>,
    changed: Condvar,
}

impl SharedTimes {
    fn lock(&self) -> MutexGuard<'_, Vec<Instant>> {
        // A line that panicked has ended: its times are whole.
        self.times.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl TimeShare {
    /// Shares of so many lines, all of which begin at time zero.
    #[must_use]
    pub fn of(lines: usize) -> Vec<Self> {
        let times = Mutex::new(vec![Instant::ZERO; lines]);
        let shared = Arc::new(SharedTimes { times, changed: Condvar::new() });
        (0..lines)
            .map(|place| Self { shared: Arc::clone(&shared), place, has_begun: false })
            .collect()
    }

    /// Waits for the turn of this line at time zero, when it begins; at once from then on.
    pub fn begin(&mut self) {
        if !std::mem::replace(&mut self.has_begun, true) {
            self.wait(Instant::ZERO);
        }
    }

    /// Waits until no other line has work before `until`; of equal times the line that comes first is first.
    pub fn wait(&self, until: Instant) {
        let mut times = self.shared.lock();
        if let Some(own) = times.get_mut(self.place) {
            *own = until;
        }
        self.shared.changed.notify_all();
        let is_behind = |times: &mut Vec<Instant>| {
            times.iter().zip(0..).any(|(at, place)| (*at, place) < (until, self.place))
        };
        drop(self.shared.changed.wait_while(times, is_behind));
    }
}

impl Drop for TimeShare {
    fn drop(&mut self) {
        if let Some(own) = self.shared.lock().get_mut(self.place) {
            *own = Instant::MAX;
        }
        self.shared.changed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_begin_in_their_order() {
        let order = Mutex::new(Vec::new());
        std::thread::scope(|scope| {
            // The last one is there first.
            for mut share in TimeShare::of(3).into_iter().rev() {
                let order = &order;
                scope.spawn(move || {
                    share.begin();
                    order.lock().unwrap().push(share.place);
                    share.wait(Instant::from_nanos(100));
                    share.begin();
                });
                std::thread::yield_now();
            }
        });
        assert_eq!(order.into_inner().unwrap(), [0, 1, 2]);
    }

    #[test]
    fn lines_take_their_turns_by_time_and_an_ended_one_is_not_waited_for() {
        let order = Mutex::new(Vec::new());
        std::thread::scope(|scope| {
            for (share, step, last) in TimeShare::of(2)
                .into_iter()
                .zip([(300, 900), (200, 1_200)])
                .map(|(s, (a, b))| (s, a, b))
            {
                let order = &order;
                scope.spawn(move || {
                    for at in (1..=last / step).map(|number| number * step) {
                        share.wait(Instant::from_nanos(at));
                        order.lock().unwrap().push((at, share.place));
                    }
                });
            }
        });
        let order = order.into_inner().unwrap();
        let expected = [
            (200, 1),
            (300, 0),
            (400, 1),
            (600, 0),
            (600, 1),
            (800, 1),
            (900, 0),
            (1_000, 1),
            (1_200, 1),
        ];
        assert_eq!(order, expected);
    }
}
