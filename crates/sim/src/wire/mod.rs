//! Cables: links with two directions, their noise, and the walk of a frame along them.
//!
//! `World` is the segment as physics knows it: controllers, cards, links and what
//! has been done to them. It is a function of time up to its horizon: changes are applied ahead of
//! every frame, and keep their instants, so that a walk meets the world of each instant.
//! `walk` carries one frame through it, port by port. `fast_path` does the same for frames that meet
//! nothing but controllers at rest, without going everywhere.
//!
//! Read first: "The physical model" in `ARCHITECTURE.md`; S1 chapters 3, 6 and 14.1.

mod address;
mod address_cache;
mod address_directory;
mod apply;
pub(crate) mod capture_probe;
pub mod change;
mod fast_path;
pub mod foreign_sender;
pub mod link;
mod link_event;
mod node;
mod nodes;
pub mod outage_history;
mod output_pause;
mod phy_link;
pub(crate) mod plug_noise;
mod route;
pub mod software;
mod timer_queue;
pub mod timing;
pub(crate) mod walk;
pub(crate) mod world;

pub use change::{Change, DirectedLink, Source};
pub use foreign_sender::ForeignSender;
pub use link::{CABLE_NS_PER_M, Link, Medium};
pub use outage_history::OutageHistory;
pub use software::SoftwareChange;
pub use timing::TimingChange;

#[cfg(test)]
mod tests;
