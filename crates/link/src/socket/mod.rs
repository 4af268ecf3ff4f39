//! Raw Ethernet sockets of Linux: one that exchanges EtherCAT frames, one that only listens; and [`TapInterface`], an interface
//! whose frames this program has.
//!
//! Reference: packet(7). Both work in batches, on buffers that are laid out once: [`Batch`] holds
//! what was received, each frame with its time and direction. Which frames are copies of sent ones
//! the kernel tells (`PACKET_OUTGOING`); it is never guessed from their bytes.

mod batch;
mod filter;
mod listener;
mod packet;
mod raw;
mod receiver;
mod tap;
mod wait;
mod wake;

pub use batch::{Batch, ReceivedFrame, StampSource};
pub use listener::{ListenFilter, Listener};
pub use raw::{RawSocket, Reception, Sent, SocketOptions};
pub use receiver::SocketCounters;
pub use tap::{TapError, TapInterface};
pub use wait::{Ready, Waitable, wait_among, wait_any, wait_for};
pub use wake::{WakeHandle, Waker};
