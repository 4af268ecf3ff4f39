//! Addresses and other numbers that must not be mixed up: one type per kind of number.
//!
//! There is no conversion between kinds; `Display` prints each as engineers write it.

use std::fmt;

/// Declares a newtype over an unsigned integer with its accessor and its way of being written.
macro_rules! number {
    ($(#[$doc:meta])* $name:ident($inner:ty), $format:literal) => {
        $(#[$doc])*
        #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
        pub struct $name(pub $inner);

        impl $name {
            /// The bare number, for the wire.
            #[must_use]
            pub const fn value(self) -> $inner {
                self.0
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, $format, self.0)
            }
        }

        impl fmt::Debug for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, concat!(stringify!($name), "(", $format, ")"), self.0)
            }
        }
    };
}

number! {
    /// Place of a controller in the order in which a frame is processed, counted from 0.
    ///
    /// It holds for one state of the wiring only: when a loop closes, positions move.
    /// Range 0..=65534; the wire form is [`Position::auto_increment`].
    Position(u16), "{}"
}

impl Position {
    /// The auto-increment address (ADP) that reaches this position: `0 - position`, since every
    /// controller on the way adds one and the one that sees 0 is meant.
    #[must_use]
    pub const fn auto_increment(self) -> u16 {
        0u16.wrapping_sub(self.0)
    }

    /// The position that an auto-increment address means when the MainDevice sends it.
    #[must_use]
    pub const fn from_auto_increment(adp: u16) -> Self {
        Self(0u16.wrapping_sub(adp))
    }
}

number! {
    /// Configured station address, register 0x0010. 0 means "none given yet".
    StationAddress(u16), "0x{:04X}"
}

number! {
    /// Configured station alias, register 0x0012, loaded from SII word 4. 0 means "none".
    StationAlias(u16), "0x{:04X}"
}

number! {
    /// Offset in a controller's memory (ADO): registers below 0x1000, process RAM from 0x1000 up.
    RegisterAddress(u16), "0x{:04X}"
}

number! {
    /// Address in the logical space of 4 GiB that FMMUs map into controllers.
    LogicalAddress(u32), "0x{:08X}"
}

number! {
    /// Working counter of a datagram: starts at 0, each controller adds what
    /// [`Command::increment`](crate::command::Command::increment) says.
    WorkingCounter(u16), "{}"
}

number! {
    /// A network of this process, counted from 0. Two networks share nothing.
    Network(u8), "{}"
}

number! {
    /// Stable identity of a controller over rescans, cuts and repairs: the key of all maps.
    ///
    /// It is given once, in project order, else in the order of the first full scan, and never
    /// changes within a run. People see [`DeviceId::no`].
    DeviceId(u32), "#{}"
}

impl DeviceId {
    /// The number that people see: controllers counted from 1. 0 is the MainDevice itself.
    #[must_use]
    pub const fn no(self) -> u32 {
        self.0 + 1
    }

    /// The identity behind a number that a person wrote; `None` for 0, which is the MainDevice.
    #[must_use]
    pub const fn from_no(no: u32) -> Option<Self> {
        match no.checked_sub(1) {
            Some(index) => Some(Self(index)),
            None => None,
        }
    }

    /// The identity as an index into tables that are kept in order of identity.
    #[must_use]
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

/// Which of the MainDevice's two cards a frame leaves by or arrives at: `A` is the main one, `B`
/// the one that closes a ring.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default)]
pub enum Path {
    /// The main card.
    #[default]
    A,
    /// The card at the far end of a ring.
    B,
}

impl Path {
    /// Both, main card first.
    pub const ALL: [Self; 2] = [Self::A, Self::B];

    /// 0 or 1, for tables of two.
    #[must_use]
    pub const fn index(self) -> usize {
        match self {
            Self::A => 0,
            Self::B => 1,
        }
    }

    /// The other card.
    #[must_use]
    pub const fn other(self) -> Self {
        match self {
            Self::A => Self::B,
            Self::B => Self::A,
        }
    }
}

impl fmt::Display for Path {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::A => "A",
            Self::B => "B",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // proves: FRM-03 partial
    #[test]
    fn auto_increment_addresses_count_down_from_zero() {
        assert_eq!(Position(0).auto_increment(), 0);
        assert_eq!(Position(1).auto_increment(), 0xFFFF);
        // The twentieth SubDevice, as an ARMW of the sources addresses it.
        assert_eq!(Position(19).auto_increment(), 0xFFED);
        assert_eq!(Position::from_auto_increment(0xFFED), Position(19));
    }

    #[test]
    fn people_count_from_one() {
        assert_eq!(DeviceId(0).no(), 1);
        assert_eq!(DeviceId::from_no(1), Some(DeviceId(0)));
        assert_eq!(DeviceId::from_no(0), None);
    }
}
