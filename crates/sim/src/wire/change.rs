//! What can be done to the world, and who does it.

use std::fmt::Debug;

use linesman_proto::address::Path;
use linesman_proto::register::WatchdogTime;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::route::Direction;

use super::software::SoftwareChange;
use super::stranger::Stranger;
use super::timing::TimingChange;
use crate::device::Refusal;

/// One direction of a link: a line that symbols travel along.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct Line {
    /// Index of the link.
    pub link: usize,
    /// Whether it carries away from card A.
    pub downstream: bool,
}

impl Line {
    /// Both directions of a link, downstream first.
    #[must_use]
    pub const fn both(link: usize) -> [Self; 2] {
        [Self { link, downstream: true }, Self { link, downstream: false }]
    }

    /// Which way it carries.
    #[must_use]
    pub const fn direction(self) -> Direction {
        if self.downstream { Direction::Downstream } else { Direction::Upstream }
    }
}

/// A change of the world. Nodes and links are indices.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Change {
    /// A symbol is destroyed on a line. What that means depends on what is on it.
    Hit {
        /// Where.
        line: Line,
        /// What it does to the byte it falls into: never 0.
        flip: u8,
    },
    /// The next frame on a line is hit, somewhere inside.
    FrameHit {
        /// Where.
        line: Line,
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
        line: Line,
    },
    /// It is whole again.
    Mend {
        /// Which.
        line: Line,
    },
    /// A line swallows every frame from now on, while both ends keep their link.
    Swallow {
        /// Which.
        line: Line,
    },
    /// It carries frames again.
    Carry {
        /// Which.
        line: Line,
    },
    /// A link shows up so long before it carries frames, or no longer does.
    Early {
        /// Which.
        link: usize,
        /// How long, each time it comes up.
        blind: Option<Span>,
    },
    /// A stranger sends a frame along a line, as if through a switch at its begin.
    Stranger {
        /// Which.
        line: Line,
        /// What it sends.
        what: Stranger,
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
