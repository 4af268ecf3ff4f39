//! EtherCAT frames: looking into one ([`view`]), making one ([`builder`]), and what it costs on the
//! wire ([`size`]).

pub mod builder;
pub mod size;
pub mod view;

pub use builder::FrameBuilder;
pub use view::{CutHeader, Datagram, DatagramError, Datagrams, FrameError, FrameView};

/// Length of the EtherCAT header behind the Ethernet header, in bytes.
pub const ETHERCAT_HEADER_LEN: usize = 2;
/// Length of a datagram's header, in bytes.
pub const DATAGRAM_HEADER_LEN: usize = 10;
/// Length of a datagram's working counter, in bytes.
pub const WKC_LEN: usize = 2;
/// What a datagram needs beside its data, in bytes.
pub const DATAGRAM_OVERHEAD: usize = DATAGRAM_HEADER_LEN + WKC_LEN;
/// Most data one datagram of an untagged frame can carry, in bytes.
pub const MAX_DATAGRAM_DATA: usize = 1486;
/// Most datagrams a frame can carry: 1,498 bytes of empty ones.
pub const MAX_DATAGRAMS: usize = 124;

/// What the type field of the EtherCAT header says is behind it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum FrameType {
    /// Datagrams (1): the only type that controllers process.
    Datagrams,
    /// Network variables (4).
    NetworkVariables,
    /// A mailbox for the gateway (5).
    Mailbox,
    /// Another value, 0..=15.
    Other(u8),
}

impl FrameType {
    /// The type with this value of the four-bit field.
    #[must_use]
    pub const fn from_bits(bits: u8) -> Self {
        match bits {
            1 => Self::Datagrams,
            4 => Self::NetworkVariables,
            5 => Self::Mailbox,
            other => Self::Other(other),
        }
    }

    /// The value of the four-bit field.
    #[must_use]
    pub const fn bits(self) -> u8 {
        match self {
            Self::Datagrams => 1,
            Self::NetworkVariables => 4,
            Self::Mailbox => 5,
            Self::Other(other) => other & 0x0F,
        }
    }
}
