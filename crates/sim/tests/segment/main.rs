//! The segment from outside: frames in, frames out, counters, and the truth beside them.

#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]

mod basics;
mod capture_probe;
mod check_order;
mod clocks;
mod exchange;
mod faults;
mod identification;
mod junctions;
mod long_line;
mod oracle;
mod plug;
mod recorded;
mod rig;
mod swarm;
mod timing;
mod traps;
mod walk;
