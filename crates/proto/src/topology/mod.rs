//! Way of a frame through the line: tree, check order, delays.
//!
//! [`wiring`] names ends and links and says what happens inside one controller; [`tree`] is the
//! line as a tree, built from a description; [`mod@derive`] finds that tree from what a scan or a
//! capture saw; [`route`] is a frame's way over it, hop by hop; [`delay`] turns receive times into
//! propagation delays. Read [`wiring`] first.

pub mod delay;
pub mod derive;
pub mod route;
pub mod tree;
pub mod wiring;

pub use delay::{Delay, DelayError, Delays};
pub use derive::{Reconstruction, SeenController, TopologyError, derive};
pub use route::{Hop, Route};
pub use tree::{Tree, Wired, WiringError};
pub use wiring::{End, Link};

#[cfg(test)]
mod tests;
