//! Mailbox messages: the header all protocols share, error replies, CoE, EoE, FoE, SoE, abort codes; the frames of
//! the mailbox gateway.
//!
//! Messages are views on borrowed bytes: `parse` looks into a buffer, `write` fills one, neither
//! allocates. Read first: ETG.1000.4 for the header, ETG.1000.6 for CoE and FoE.

pub mod abort_code;
pub mod coe;
pub mod eoe;
pub mod error_reply;
pub mod foe;
pub mod gateway;
pub mod header;
pub mod soe;

pub use error_reply::{ErrorReply, ErrorReplyCode};
pub use header::{BufferTooSmall, Counter, HEADER_LEN, Header, MailboxError, MailboxType, Message};
