//! Input of the diagnosis: frames as they were seen, observations of the host, and the pairing of requests with returns.

pub mod capture_probe;
pub(crate) mod companion;
mod exchange;
pub mod fingerprint;
mod latest;
pub mod pairing;
pub mod question;
pub mod seen;
pub mod sender;
mod sequence;

pub use exchange::{Exchange, FrameCopy};
pub use fingerprint::Fingerprint;
pub use latest::LatestFrame;
pub use pairing::{Pairing, PairingOutcome};
pub use question::Questions;
pub use seen::{Direction, FrameSeen, HostEvent, HostObservation};
pub use sender::Sender;
