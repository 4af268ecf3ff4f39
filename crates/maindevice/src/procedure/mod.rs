//! What reads "do this, then that": look, scan, SII access, set-up, change of state.

pub mod address;
pub mod clock;
pub mod counters;
pub mod look;
pub mod scan;
pub mod set_up;
pub mod sii;
pub mod sii_write;
pub mod state;
pub(crate) mod sync_signal;

pub use clock::ClockError;
pub use look::{Look, LookError, LookedDevice};
pub use scan::ScanError;
pub use sii::SiiAccessError;
pub use state::StepError;
