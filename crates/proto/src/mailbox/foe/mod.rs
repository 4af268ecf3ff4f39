//! FoE, file access over EtherCAT: how firmware and parameter files are read and written.
//!
//! Reference: ETG.1000.6, FoE. [`Message`] is what follows the mailbox header: opcode (u8), a
//! reserved byte, four bytes whose meaning is that of the opcode, and the rest. Packets count from
//! 1; one that is shorter than the mailbox allows is the last, be it empty.

pub mod error_code;
pub mod message;

pub use error_code::FoeErrorCode;
pub use message::{FOE_HEADER_LEN, FoeError, Message, chunk_len};
