//! Devices behind controllers: processors with their software, and signals between devices.
//!
//! [`firmware`] is the seam: a [`Firmware`] sees its controller through
//! [`Pdi`](crate::controller::Pdi) and other devices through [`Signals`]. [`emulated`] is the
//! device without a processor, [`processor`] the one with; [`application_layer`] is how both answer
//! requests for a state, [`mailbox`] and [`dictionary`] what can be asked of a processor,
//! [`application`] what it does. [`library`] has the types that are built in, [`described`] makes types
//! from data; [`kind`] is either.

pub mod application;
pub mod application_layer;
pub mod described;
pub mod dictionary;
pub mod emulated;
mod emulated_sii;
pub mod ethernet;
pub mod files;
pub mod firmware;
pub mod history;
pub mod kind;
pub mod library;
pub mod mailbox;
pub mod processor;
pub mod signal;
pub mod software_fault;

pub use application_layer::Refusal;
pub use described::DescribedType;
pub use emulated::{DigitalArea, Emulated, WordArea};
pub use emulated_sii::{EMULATION_TIME, EmulatedSii};
pub use firmware::{Firmware, NoFirmware, SampleAgain};
pub use kind::DeviceKind;
pub use signal::{SignalId, Signals};
pub use software_fault::{Mismatch, SoftwareFault, SoftwareFaults};

#[cfg(test)]
mod tests;
