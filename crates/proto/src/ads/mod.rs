//! ADS, the protocol by which programs ask the vendor's controllers: AMS messages, over TCP behind a header of their own
//! and through the mailbox of a SubDevice without it (AoE, ETG.1020, mailbox type 1).
//!
//! Reference: Beckhoff Information System, "TwinCAT ADS/AMS specification" (AMS/TCP header, AMS header, commands, return
//! codes); [`index`] for the services of an EtherCAT MainDevice. Everything is little endian.

mod address;
mod code;
pub mod index;
mod message;
mod request;

pub use address::{AmsAddress, AmsNetId, AmsNetIdError};
pub use code::AdsCode;
pub use message::{AMS_HEADER_LEN, AMS_TCP_HEADER_LEN, AmsError, AmsHeader, MAX_AMS_LEN, PORT};
pub use request::{AdsAnswer, AdsAnswerError, AdsCommand, AdsRequest};
