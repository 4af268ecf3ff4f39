//! Network cards, clocks and capture files: the only crate that touches them.
//!
//! Read first: [`input`] for what a command reads, [`capture`] for recordings in it, [`clock`] for time, [`interface`] for the cards there are,
//! [`socket`] for frames on them, [`host`] for what the host itself does wrong, [`host_check`] for why it
//! may, [`real_time`] for what
//! a cycle asks of it, [`shared_image`] for process data that other programs see, [`signal`] for what is
//! done about a signal, [`whole_file`] for files that are written as a whole.

#![deny(unsafe_code)]

pub mod capture;
pub mod clock;
pub mod direction;
pub mod error;
pub mod host;
pub mod host_check;
pub mod input;
pub mod interface;
pub mod real_time;
pub mod shared_image;
pub mod signal;
pub mod socket;
pub mod unix_time;
pub mod whole_file;
