//! Project, inventory and plan: what was wanted, what is there, what follows.
//!
//! Three nouns: a [`project`] is what the user wrote, an [`inventory`] is what was found, a [`plan`]
//! is what follows: addresses, FMMUs, frames, expected working counters. Diagnosis compares them.
//! [`esi`] reads device descriptions of makers. [`fault`] holds the names that segment, diagnosis and score share.

pub mod attachment;
pub mod compare;
pub mod ebus;
pub mod eni;
pub mod esi;
pub mod fault;
pub mod identity;
pub mod inventory;
pub mod plan;
pub mod profile;
pub mod project;
pub mod start_up;
mod xml_writer;
