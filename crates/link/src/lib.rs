//! Network cards, clocks and capture files: the only crate that touches them.
//!
//! Read first: [`capture`] for files, [`clock`] for time, [`interface`] for the cards there are,
//! [`socket`] for frames on them, [`host`] for what the host itself does wrong, [`computer`] for why it
//! may, [`real_time`] for what
//! a cycle asks of it, [`shared_image`] for process data that other programs see.

#![deny(unsafe_code)]

pub mod capture;
pub mod clock;
pub mod computer;
pub mod direction;
pub mod error;
pub mod host;
pub mod interface;
pub mod real_time;
pub mod shared_image;
pub mod socket;
pub mod unix_time;
