//! Queue of port events that the wire reports to a controller, each applied at its time.
//!
//! The wire decides who sees what (S1 14.1 and its counting profile); the controller
//! decides what becomes of it: loops close, counters count or do not.

use std::collections::VecDeque;

use linesman_proto::port::Port;
use linesman_proto::time::Instant;

/// Something that happens at a port.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum PortEvent {
    /// The port's receiver reports a link, or its loss: detection times are over by then.
    ///
    /// Loops follow by their modes, and a loss at an open port in mode auto or auto close counts as
    /// lost link by itself: no [`CountKind::LostLink`] is needed beside it, and one posted for the
    /// same port and instant changes nothing.
    Link {
        /// The port.
        port: Port,
        /// Whether there is a link now.
        up: bool,
    },
    /// The port saw an error.
    Count {
        /// The port. For [`CountKind::ProcessingUnitError`] the port the frame came by; it does
        /// not matter.
        port: Port,
        /// What to count.
        kind: CountKind,
    },
}

/// A counter that the wire moves. The controller keeps to its rules: counters stop at 255, those of
/// a port count only while its loop is open (or always, with
/// [`counts_when_closed`](crate::hardware::CountingProfile::counts_when_closed)), those the
/// hardware does not have count nowhere.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum CountKind {
    /// A symbol that cannot be decoded, in or outside of a frame: 0x0301 + 2 p.
    SymbolError,
    /// A frame found bad here first: 0x0300 + 2 p.
    InvalidFrame,
    /// A frame that an earlier controller marked: 0x0308 + p.
    ForwardedError,
    /// A damaged frame entered the processing unit: 0x030C. Frames whose bytes are whole and still
    /// wrong (foreign, circulating, cut datagrams) the unit counts by itself.
    ProcessingUnitError,
    /// A lost link that no [`PortEvent::Link`] tells of, such as bouncing contacts at power-on:
    /// 0x0310 + p. Only while the port is open, in mode auto or auto close.
    LostLink,
}

/// Events by time, those of the same instant in the order in which they were posted.
#[derive(Clone, Default, Debug)]
pub(super) struct Queue(VecDeque<(Instant, QueuedEvent)>);

/// What the queue holds: what was posted, and what the controller reminds itself of.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum QueuedEvent {
    /// The wire said so.
    Posted(PortEvent),
    /// A good frame ended at this port: a loop in mode auto close opens again.
    GoodFrame(Port),
}

impl Queue {
    pub(super) fn push(&mut self, at: Instant, event: QueuedEvent) {
        // Most events come in the order of time: look from the end.
        let behind = self.0.iter().rev().take_while(|(other, _)| *other > at).count();
        self.0.insert(self.0.len() - behind, (at, event));
    }

    pub(super) fn next_at(&self) -> Option<Instant> {
        self.0.front().map(|(at, _)| *at)
    }

    /// When the next event comes that can open or close a loop.
    pub(super) fn next_way_at(&self) -> Option<Instant> {
        let ways = self.0.iter().find(|(_, event)| match event {
            QueuedEvent::Posted(PortEvent::Count { .. }) => false,
            QueuedEvent::Posted(PortEvent::Link { .. }) | QueuedEvent::GoodFrame(_) => true,
        });
        ways.map(|(at, _)| *at)
    }

    /// The next event, if it is not after `now`.
    pub(super) fn pop_until(&mut self, now: Instant) -> Option<(Instant, QueuedEvent)> {
        if self.next_at()? <= now { self.0.pop_front() } else { None }
    }

    /// What is to come until `now`, in order.
    pub(super) fn until(&self, now: Instant) -> impl Iterator<Item = (Instant, QueuedEvent)> {
        self.0.iter().take_while(move |(at, _)| *at <= now).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_come_in_the_order_of_time_then_of_posting() {
        let mut queue = Queue::default();
        for (at, port) in [(5, Port::A), (9, Port::B), (5, Port::C), (1, Port::D)] {
            queue.push(Instant::from_nanos(at), QueuedEvent::GoodFrame(port));
        }
        assert_eq!(queue.next_at(), Some(Instant::from_nanos(1)));
        assert_eq!(queue.until(Instant::from_nanos(5)).count(), 3);
        let order: Vec<QueuedEvent> =
            std::iter::from_fn(|| queue.pop_until(Instant::from_nanos(8)).map(|(_, event)| event))
                .collect();
        assert_eq!(order, [Port::D, Port::A, Port::C].map(QueuedEvent::GoodFrame));
        assert_eq!(queue.next_at(), Some(Instant::from_nanos(9)));
    }
}
