//! What is behind a controller: processors with their software, and signals between devices.
//!
//! [`firmware`] is the seam: a [`Firmware`] sees its controller through
//! [`Pdi`](crate::controller::Pdi) and other devices through [`Signals`]. [`emulated`] is the
//! device without a processor, [`processor`] the one with; [`application_layer`] is how both answer
//! requests for a state, [`mailbox`] and [`dictionary`] what can be asked of a processor,
//! [`application`] what it does. [`library`] has the types that can be put into a segment.

pub mod application;
pub mod application_layer;
pub mod dictionary;
pub mod emulated;
pub mod firmware;
pub mod library;
pub mod mailbox;
pub mod processor;
pub mod signal;

pub use application_layer::Refusal;
pub use emulated::{DigitalArea, Emulated, WordArea};
pub use firmware::{Firmware, NoFirmware, SampleAgain};
pub use signal::{SignalId, Signals};

#[cfg(test)]
mod tests;
