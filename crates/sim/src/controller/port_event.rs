//! Queue of port events that the wire reports to a controller, each applied at its time.
//!
//! The wire decides who sees what (S1 14.1 and its counting profile); the controller
//! decides what becomes of it: loops close, counters count or do not.

use linesman_proto::port::Port;
use linesman_proto::time::Instant;

use crate::event_queue::EventQueue;

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

/// What the queue of a controller holds: what was posted, and what the controller reminds itself of.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum QueuedEvent {
    /// The wire said so.
    Posted(PortEvent),
    /// A good frame ended at this port: a loop in mode auto close opens again.
    GoodFrame(Port),
}

impl QueuedEvent {
    /// Whether it can open or close a loop.
    const fn can_move_loop(self) -> bool {
        match self {
            Self::Posted(PortEvent::Count { .. }) => false,
            Self::Posted(PortEvent::Link { .. }) | Self::GoodFrame(_) => true,
        }
    }
}

impl EventQueue<QueuedEvent> {
    /// When the next event comes that can open or close a loop.
    pub(super) fn next_way_at(&self) -> Option<Instant> {
        self.iter().find(|(_, event)| event.can_move_loop()).map(|(at, _)| at)
    }
}
