//! What comes in: frames as they were seen, and what the host noticed; and which frames belong
//! together.

pub(crate) mod companion;
mod exchange;
pub mod fingerprint;
pub mod pairing;
pub mod question;
pub mod seen;
pub mod sender;
mod sequence;

pub use exchange::{Exchange, FrameCopy};
pub use fingerprint::Fingerprint;
pub use pairing::{Outcome, Pairing};
pub use question::Questions;
pub use seen::{Direction, FrameSeen, HostEvent, HostObservation};
pub use sender::Sender;
