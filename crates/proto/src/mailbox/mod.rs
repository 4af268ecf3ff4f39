//! Mailbox messages: the header, CoE, abort codes.
