//! What is behind a controller: processors with their software, and signals between devices.
//!
//! [`firmware`] is the seam: a [`Firmware`] sees its controller through
//! [`Pdi`](crate::controller::Pdi) and other devices through [`Signals`]. [`emulated`] is the
//! device without a processor, [`application_layer`] how requests for a state are answered,
//! [`library`] the types that can be put into a segment.

pub mod application_layer;
pub mod emulated;
pub mod firmware;
pub mod library;
pub mod signal;

pub use application_layer::Refusal;
pub use emulated::{DigitalArea, Emulated, WordArea};
pub use firmware::{Firmware, NoFirmware};
pub use signal::{SignalId, Signals};
