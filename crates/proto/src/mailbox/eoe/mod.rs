//! Ethernet over EtherCAT: frames in fragments, and the settings of an Ethernet port.
//!
//! Read first: ETG.1000.6, EoE; facts 6.6.

mod address;
mod assembly;
mod message;

pub use address::{ADDRESS_LEN, IpParameters};
pub use assembly::{Assembly, Refused};
pub use message::{
    EOE_HEADER_LEN, EoeError, EoeResult, Fragment, FragmentPlace, Message, Setting, fragments,
};
