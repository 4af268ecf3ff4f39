//! What a person or a program sees of a network: states, counters, frames, mailboxes, as it is now.
//!
//! Of a line that a MainDevice drives, [`Board`] knows what has happened so far and [`Snapshot`] what the
//! thread that drives the line knows beside: the two make a [`report::OnlineReport`], and the cycle only
//! pays for the snapshot. A line that nobody drives is looked at again and again by a [`Looker`], with
//! nothing but reads.
//!
//! Reference: the online list and the function blocks of the vendor tool (`facts` 2 and 3.1).

mod board;
mod build;
mod looking;
pub mod report;
mod snapshot;

pub use board::Board;
pub use looking::Looker;
pub use snapshot::{Rates, Snapshot};
