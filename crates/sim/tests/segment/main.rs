//! The segment from outside: frames in, frames out, counters, and the truth beside them.

mod faults;
mod rig;
mod walk;
