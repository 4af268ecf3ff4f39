//! Link types: the header that the bytes of a captured frame begin with.
//!
//! Reference: the registry at <https://www.tcpdump.org/linktypes.html>.

use std::fmt;

/// The kind of header in front of each frame of an interface.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum LinkType {
    /// Ethernet (1): destination, source, EtherType.
    Ethernet,
    /// Linux "cooked" (113): what `tcpdump -i any` writes. The destination address is lost.
    LinuxCooked,
    /// Linux "cooked" version 2 (276): as 113, with the number of the interface.
    LinuxCooked2,
    /// Anything else: no EtherCAT is looked for in it.
    Other(u16),
}

impl LinkType {
    /// The link type with this number of the registry.
    #[must_use]
    pub const fn from_number(number: u16) -> Self {
        match number {
            1 => Self::Ethernet,
            113 => Self::LinuxCooked,
            276 => Self::LinuxCooked2,
            other => Self::Other(other),
        }
    }

    /// Its number in the registry.
    #[must_use]
    pub const fn number(self) -> u16 {
        match self {
            Self::Ethernet => 1,
            Self::LinuxCooked => 113,
            Self::LinuxCooked2 => 276,
            Self::Other(number) => number,
        }
    }
}

impl fmt::Display for LinkType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ethernet => f.write_str("Ethernet"),
            Self::LinuxCooked => f.write_str("Linux cooked (113)"),
            Self::LinuxCooked2 => f.write_str("Linux cooked v2 (276)"),
            Self::Other(number) => {
                let name = match number {
                    0 => "BSD loopback",
                    101 => "raw IP",
                    105 => "Wi-Fi",
                    127 => "Wi-Fi with radiotap",
                    189 | 220 => "USB",
                    227 => "CAN",
                    _ => return write!(f, "link type {number}"),
                };
                write!(f, "{name} ({number})")
            }
        }
    }
}
