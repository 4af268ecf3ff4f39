//! Event queue: the one order of everything in the segment that is still to come.
//!
//! Events come by time, those of the same instant in the order in which they were pushed. There are
//! several queues and not one, because they are not worked off up to the same instant: link events
//! and faults are made up to the horizon of the segment, ahead of every frame
//! ([`World`](crate::wire)); what happens to a controller waits until somebody touches that
//! controller; frames arrive when the MainDevice asks for them.

use std::collections::VecDeque;

use linesman_proto::time::Instant;

/// Events by time, those of the same instant in the order in which they were pushed.
#[derive(Clone, Debug)]
pub(crate) struct EventQueue<T>(VecDeque<(Instant, T)>);

impl<T> Default for EventQueue<T> {
    fn default() -> Self {
        Self(VecDeque::new())
    }
}

impl<T> EventQueue<T> {
    /// Puts an event behind all that are not later.
    pub(crate) fn push(&mut self, at: Instant, event: T) {
        // Nearly always the last to be pushed is the last to come: look from the end.
        let behind = self.0.iter().rev().take_while(|(other, _)| *other > at).count();
        self.0.insert(self.0.len() - behind, (at, event));
    }

    #[inline]
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// When the next event comes.
    #[inline]
    pub(crate) fn next_at(&self) -> Option<Instant> {
        self.0.front().map(|(at, _)| *at)
    }

    /// Takes the next event out, if it is not after `until`.
    #[inline]
    pub(crate) fn pop_until(&mut self, until: Instant) -> Option<(Instant, T)> {
        self.0.pop_front_if(|(at, _)| *at <= until)
    }

    /// All events, in order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (Instant, &T)> {
        self.0.iter().map(|(at, event)| (*at, event))
    }

    /// Keeps the events of which `keeps` says so.
    pub(crate) fn retain(&mut self, mut keeps: impl FnMut(&T) -> bool) {
        self.0.retain(|(_, event)| keeps(event));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_come_by_time_then_in_the_order_of_pushing() {
        let at = Instant::from_nanos;
        let mut queue = EventQueue::default();
        for (time, event) in [(5, 'a'), (9, 'b'), (5, 'c'), (1, 'd')] {
            queue.push(at(time), event);
        }
        assert_eq!(queue.next_at(), Some(at(1)));
        assert_eq!(queue.iter().take_while(|(time, _)| *time <= at(5)).count(), 3);
        let came: String =
            std::iter::from_fn(|| queue.pop_until(at(8)).map(|(_, event)| event)).collect();
        assert_eq!(came, "dac");
        assert_eq!(queue.next_at(), Some(at(9)));
        queue.retain(|event| *event != 'b');
        assert!(queue.is_empty());
    }
}
