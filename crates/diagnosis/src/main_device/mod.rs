//! The MainDevice that drives the line: recognised by its habits, with its cycle and the registers it reads.
//!
//! [`Habits`] gathers from the requests what distinguishes one MainDevice from another; [`kind`] weighs the
//! marks; [`next_step`] names the calls or menus of each kind by which registers are read that it does not poll.

mod habits;
pub mod kind;
pub mod next_step;
mod poll;

pub use habits::Habits;
pub use kind::{Certainty, MainDeviceKind, Mark, Recognised};
pub use poll::{Access, Poll};

#[cfg(test)]
mod tests;
