//! Online view of a network: states, counters, frames, mailboxes, as it is now.
//!
//! Of a line that a MainDevice drives, [`OnlineState`] knows what has happened so far and [`Snapshot`] what the
//! thread that drives the line knows beside: the two make a [`report::OnlineReport`], and the cycle only
//! pays for the snapshot. A line that nobody drives is looked at again and again by a [`ReadOnlyPoller`], with
//! nothing but reads.
//!
//! Reference: the online list and the function blocks of the vendor tool (`facts` 2 and 3.1).

mod build;
mod read_only_poll;
pub mod report;
mod snapshot;
mod state;

pub use read_only_poll::ReadOnlyPoller;
pub use snapshot::{Rates, Snapshot};
pub use state::OnlineState;
