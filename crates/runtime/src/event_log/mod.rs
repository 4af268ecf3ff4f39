//! The event log: what happened on a network, kept across runs.
//!
//! One SQLite file holds the runs and their entries ([`store`]); a thread of its own writes
//! ([`writer`]), so that neither a slow nor a full disk ever makes a cycle late; [`filter`] says
//! which entries somebody wants to see.

pub mod filter;
pub mod store;
pub mod writer;

pub use filter::Filter;
pub use store::{EventLog, EventLogError, LoggedFinding, Run, StoredEntry};
pub use writer::{EventLogWriter, WriterReport};
