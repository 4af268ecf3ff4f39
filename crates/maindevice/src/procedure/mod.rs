//! Procedures, which read "do this, then that": read-only scan, scan, SII access, set-up, change of
//! state.

pub mod address;
pub mod clock;
pub mod counters;
pub(crate) mod identification;
pub mod read_only_scan;
pub mod scan;
pub mod set_up;
pub mod sii;
pub mod sii_write;
pub mod state;
pub(crate) mod sync_signal;

pub use clock::ClockError;
pub use read_only_scan::{DeviceReading, ReadOnlyScan, ReadOnlyScanError};
pub use scan::ScanError;
pub use sii::SiiAccessError;
pub use state::StepError;
