//! Questions to SubDevices of a line that another MainDevice drives: what `diagnose listen:… --ask` sends, and when.
//!
//! A question is a small frame that reads registers of one SubDevice: DL status, AL status with its code, error counters. It
//! leaves in the gap between two frames of the other MainDevice ([`gap`]), in a form that this one's socket does not take
//! ([`carrier`]). Before the first one its ways are watched for a while, and after each one it is watched whether it fares
//! worse ([`disturbance`]): the first sign of that ends the questions. [`schedule`] gives the order of the questions. [`Asker`] drives
//! them all: frames and time come in as arguments, frames to be sent and news come out.

pub mod asker;
pub mod carrier;
pub mod disturbance;
pub mod gap;
pub mod likelihood;
pub mod outcome;
pub mod report;
pub mod schedule;

pub use asker::{AskSetup, Asker};
pub use carrier::{AskRefusal, Carrier};
pub use disturbance::Disturbance;
pub use outcome::{EndReason, News};
pub use report::{AskingReport, AskingState};

#[cfg(test)]
pub(crate) mod tests;
