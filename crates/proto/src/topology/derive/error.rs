//! Errors that keep a tree from being derived.

use crate::port::Port;

/// What is inconsistent in what was seen. Controllers are named by position, counted from 0.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, thiserror::Error)]
pub enum TopologyError {
    /// The ring is closed, and yet frames of card B are processed: somebody is entered by its OUT port.
    #[error(
        "position {node} and {behind} behind it process the frames of card B, though the ring is closed: it is \
         plugged in the wrong way round. Exchange the cables at its IN and OUT ports"
    )]
    RingReversed {
        /// The first controller that does so.
        node: usize,
        /// How many more do.
        behind: usize,
    },
    /// A controller that answered reports no open port.
    #[error(
        "position {node}: it answered, but DL status (0x0110) shows no open port; read it again"
    )]
    NoOpenPort {
        /// The controller.
        node: usize,
    },
    /// There are more ends of branches than open ports that could lead to them.
    #[error(
        "position {node}: hangs on no controller, since all open ports of positions before it lead \
         to others already; {open} of its own ports are open. Read DL status (0x0110) again"
    )]
    NoPlace {
        /// The first controller of the tree that has no place.
        node: usize,
        /// How many open ports it has.
        open: usize,
    },
    /// Nothing that was processed before a reversed controller fits behind one of its ports.
    #[error(
        "position {node}: a frame comes in at port {entry} and leaves by port {port} before it is \
         processed, but no controllers processed before fit there. Read 0x0110 and 0x0900 again"
    )]
    NothingBefore {
        /// The reversed controller.
        node: usize,
        /// The port where frames come in.
        entry: Port,
        /// The port without controllers behind it.
        port: Port,
    },
    /// More than one open port leads to no controller. One alone is where a ring closes.
    #[error(
        "position {node}: port {port} is open, but no controller behind it was processed, nor \
         behind {others} other open port(s). Read DL status (0x0110) again; is a ring closed in \
         its middle?"
    )]
    NothingBehind {
        /// The controller at the furthest such port: in a ring the one next to card B.
        node: usize,
        /// The port.
        port: Port,
        /// How many more there are.
        others: usize,
    },
}
