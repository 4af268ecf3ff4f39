//! Mailbox messages: the header, CoE, abort codes.

pub mod abort_code;
