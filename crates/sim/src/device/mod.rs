//! What is behind a controller: processors with their software, and signals between devices.
//!
//! [`firmware`] is the seam: a [`Firmware`] sees its controller through
//! [`Pdi`](crate::controller::Pdi) and other devices through [`Signals`]. [`emulated`] is the
//! device without a processor.

pub mod emulated;
pub mod firmware;
pub mod signal;

pub use emulated::{DigitalArea, Emulated};
pub use firmware::{Firmware, NoFirmware};
pub use signal::{SignalId, Signals};
