//! The EtherCAT controller with the device behind it.
//!
//! [`Controller`] is what the wire talks to. Inside, one file per concern: `processing_unit`
//! executes datagrams, `access` finds the memory behind an address, `fmmu` and `sync_manager` map
//! and guard it, `register_write` does what written registers ask for, [`pdi`] is the view from the
//! other side.
//!
//! Read first: S1 chapters 3 (frame processing), 7 (FMMU), 8 (SyncManager), 11 (SII), 14 (error
//! counters), 17.3 (write protection); S2 for each register.

mod access;
mod clock;
mod core;
mod esc;
mod event;
mod fast_path;
mod fmmu;
mod implemented;
pub mod inspect;
mod kind;
mod led;
mod loops;
mod memory;
mod pdi;
mod pdi_register;
mod phy;
mod plain_read;
mod port;
mod port_event;
mod preset;
mod processing_unit;
mod register_write;
mod rx_code;
mod shadow;
mod sii;
mod sii_emulation;
mod sync_manager;
mod watchdog;

pub use clock::{Edge, LatchInput, LocalClock, SyncSignal};
pub use esc::{Controller, Forwarding};
pub(crate) use fast_path::FastPathInfo;
pub use kind::{ControllerKind, ControllerKinds};
pub use pdi::Pdi;
pub use phy::{PHY_ACCESS_TIME, PhyAction};
pub(crate) use plain_read::{Answer, PlainRead};
pub use port_event::{CountKind, PortEvent};
pub(crate) use processing_unit::Header;
pub use sii::{LOAD_TIME, PROGRAMMING_TIME, READ_TIME, STARTUP_DELAY, WRITE_TIME};
pub use sii_emulation::SiiRequest;
pub use watchdog::{WatchdogExpiry, WatchdogKind};

#[cfg(test)]
pub(crate) mod tests;
