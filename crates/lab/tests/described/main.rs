//! Devices made from files: our own MainDevice brings each to OP.
//!
//! The files of real devices are not part of the project: the tests look for them where
//! `LINESMAN_DATA` points, and say so when they are not there.

#![expect(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    reason = "tests of real files have to get at them, and must not be silent when they cannot"
)]

mod clock;
mod data;
mod descriptions;
mod features;
mod images;
mod up;
