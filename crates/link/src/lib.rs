//! Network cards, clocks and capture files: the only crate that touches them.
//!
//! Read first: [`capture`] for files, [`unix_time`] for their times.

#![deny(unsafe_code)]

pub mod capture;
pub mod direction;
pub mod unix_time;
