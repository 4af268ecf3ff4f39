//! What comes in: frames as they were seen, and what the host noticed.

pub mod seen;

pub use seen::{Direction, FrameSeen, HostEvent, HostObservation};
