//! SDO transfer: an object's data to a SubDevice (download) or from it (upload).
//!
//! Up to four bytes go *expedited* within the first message; more go *normal*, announced by their
//! size, with as many bytes as fit into the mailbox; the rest follows in *segments*, each answered
//! with the same toggle bit. Reference: ETG.1000.6, SDO. What is written here follows the CoE
//! header.

pub mod abort;
pub mod command;
pub mod payload;
pub mod request;
pub mod response;

pub use abort::Abort;
pub use command::SDO_LEN;
pub use payload::{Expedited, Initial, Segment};
pub use request::Request;
pub use response::Response;
