//! Changes of the world, and the faults that make them.

use std::fmt::Debug;

use linesman_proto::address::Path;
use linesman_proto::register::WatchdogTime;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::route::Direction;

use super::foreign_sender::ForeignSender;
use super::software::SoftwareChange;
use super::timing::TimingChange;
use crate::device::Refusal;

/// One direction of a link: a line that symbols travel along.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct DirectedLink {
    /// Index of the link.
    pub link: usize,
    /// Whether it carries away from card A.
    pub downstream: bool,
}

impl DirectedLink {
    /// Both directions of a link, downstream first.
    #[must_use]
    pub const fn both(link: usize) -> [Self; 2] {
        [Self { link, downstream: true }, Self { link, downstream: false }]
    }

    /// Which way it carries.
    #[must_use]
    pub const fn route_direction(self) -> Direction {
        if self.downstream { Direction::Downstream } else { Direction::Upstream }
    }
}

/// A change of the world. Nodes and links are indices.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Change {
    /// A symbol is destroyed on a line. What that means depends on what is on it.
    Hit {
        /// Where.
        direction: DirectedLink,
        /// What it does to the byte it falls into: never 0.
        flip: u8,
    },
    /// The next frame on a line is hit, somewhere inside.
    FrameHit {
        /// Where.
        direction: DirectedLink,
        /// How far into the frame, in 1/65536 of its bytes.
        part: u16,
        /// What it does to the byte it falls into: never 0.
        flip: u8,
    },
    /// A link's contact opens: nothing passes in either direction.
    Open {
        /// Which.
        link: usize,
    },
    /// It closes again.
    Close {
        /// Which.
        link: usize,
    },
    /// One direction of a link breaks: a pair of wires or a fibre. Its receiver has no signal.
    Break {
        /// Which.
        direction: DirectedLink,
    },
    /// It is whole again.
    Mend {
        /// Which.
        direction: DirectedLink,
    },
    /// A line swallows every frame from now on, while both ends keep their link.
    Swallow {
        /// Which.
        direction: DirectedLink,
    },
    /// It carries frames again.
    Carry {
        /// Which.
        direction: DirectedLink,
    },
    /// A link shows up so long before it carries frames, or no longer does.
    Early {
        /// Which.
        link: usize,
        /// How long, each time it comes up.
        blind: Option<Span>,
    },
    /// A foreign sender puts a frame onto a link direction, as if through a switch at its begin.
    ForeignSender {
        /// Which.
        direction: DirectedLink,
        /// What it sends.
        what: ForeignSender,
    },
    /// A card keeps the next frame back before it sends it.
    Delay {
        /// Which.
        card: Path,
        /// How long.
        by: Span,
    },
    /// A card's host drops the next frame that has come back.
    Drop {
        /// Which.
        card: Path,
    },
    /// A controller loses its supply.
    Off {
        /// Which.
        node: usize,
    },
    /// It has its supply again.
    On {
        /// Which.
        node: usize,
    },
    /// A controller spoils the next frame that passes it, behind its receiver and before it codes.
    Glitch {
        /// Which.
        node: usize,
        /// How far into the frame, in 1/65536 of its bytes.
        part: u16,
        /// What it does to the byte: never 0.
        flip: u8,
    },
    /// A device refuses a change of state from now on, or no longer.
    Refuse {
        /// Which.
        node: usize,
        /// The state that it does not go to, and the code it gives.
        refusal: Option<Refusal>,
    },
    /// A card sends nothing: what it is given vanishes.
    Silence {
        /// Which.
        path: Path,
        /// Until when.
        until: Instant,
    },
    /// The process data watchdog of a controller is set to another time than the MainDevice set, or
    /// back.
    Watchdog {
        /// Which.
        node: usize,
        /// The time, as it is written to 0x0420; `None` for the former one.
        time: Option<WatchdogTime>,
    },
    /// A controller is given the station address of another one, or its own again when its fault
    /// ends.
    Readdress {
        /// Which.
        node: usize,
        /// Whose address it gets.
        like: usize,
    },
    /// Something happens to the software of a device.
    Software {
        /// Which.
        node: usize,
        /// What.
        change: SoftwareChange,
    },
    /// Something happens to the clock or the deadlines of a device.
    Timing {
        /// Which.
        node: usize,
        /// What.
        change: TimingChange,
    },
    /// A card sends its frames later from now on.
    Late {
        /// Which.
        path: Path,
        /// By how much; nothing for "in time again".
        by: Span,
    },
}

/// Who changes the world: a fault, as a list of changes that is made as far as it is needed.
pub trait Source: Debug + Send {
    /// The next change, not earlier than the one before; `None` when there are no more.
    fn next_change(&mut self) -> Option<(Instant, Change)>;
}
