//! Threads, selectors and recorders: what joins the cores to a real interface.
//!
//! [`selector`] says what a word like `eth0+eth1` means, wherever it is written.

pub mod selector;
