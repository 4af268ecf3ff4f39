//! Tests of the controller through frames: what a MainDevice sees of it.

mod application;
mod clock;
mod commands;
mod damage;
mod fmmu;
mod frames;
mod latch_unit;
mod memory;
mod phy;
mod ports;
mod properties;
pub(crate) mod recorded;
pub(crate) mod rig;
mod side;
mod sii;
mod sync_manager;
mod sync_unit;
mod time_loop;
mod watchdog;
