//! Registers of a controller: one table, and typed views of what is in them.
//!
//! [`table`] names every register with address, rights, bits, meaning and reference; its constants
//! are the only place where a register address stands ([`AL_STATUS`]`.address`). [`describe()`] and
//! [`decode`] read the table for people. The views ([`DlStatus`], [`AlControl`],
//! [`SyncManagerConfig`], …) are for programs: MainDevice, virtual segment and diagnosis use the
//! same ones. [`Difference`] and [`Total`] say what two readings of a saturating counter tell.

pub mod al;
mod bits;
pub mod counter;
pub mod describe;
pub mod dl_control;
pub mod dl_status;
pub mod entry;
pub mod error_counters;
pub mod event;
pub mod fmmu;
pub mod information;
pub mod phy_control;
pub mod sii_control;
pub mod sync_manager;
pub mod table;
pub mod time_difference;
pub mod watchdog;

pub use al::{AlControl, AlStatus};
pub use counter::{Difference, Total};
pub use describe::{
    Description, Piece, Reading, address_by_name, by_name, decode, decode_fields, describe, pieces,
    summary,
};
pub use dl_control::{DlControl, LoopMode};
pub use dl_status::{DlStatus, PortState};
pub use entry::{Access, Field, Form, Register, Repeat, Unit};
pub use error_counters::{ClearGroup, ErrorCounter, ErrorCounters, RxErrors};
pub use event::{AlEvents, EcatEvents};
pub use fmmu::{FmmuConfig, FmmuOverlap};
pub use information::{ControllerType, EscInformation, Features, PortDescriptor, PortType};
pub use phy_control::{PhyCommand, PhyControl};
pub use sii_control::{SiiCommand, SiiControl};
pub use sync_manager::{
    SmActivate, SmControl, SmDirection, SmMode, SmPdiControl, SmStatus, SyncManagerConfig,
};
pub use table::*;
pub use time_difference::SystemTimeDifference;
pub use watchdog::{WatchdogDivider, WatchdogTime};
