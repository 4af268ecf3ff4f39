//! DL control (0x0100): forwarding rule, loop mode of each port, alias.
//!
//! Reference: S2 2.4.1; what the loop modes do is in S1 chapter 3.

use std::fmt;

use crate::port::Port;

/// The DL control register.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct DlControl(pub u32);

impl DlControl {
    /// The value after a reset: foreign frames destroyed, all loops auto, FIFO size 7.
    pub const RESET: Self = Self(0x0007_0001);

    const DESTROY_FOREIGN_FRAMES: u32 = 1 << 0;
    const TEMPORARY: u32 = 1 << 1;
    const LOW_JITTER: u32 = 1 << 19;
    const SHORT_LINK_DOWN: u32 = 1 << 22;
    const ALIAS: u32 = 1 << 24;
    const FIFO_SHIFT: u32 = 16;

    /// From the four bytes of the register.
    #[must_use]
    pub const fn from_bytes(bytes: [u8; 4]) -> Self {
        Self(u32::from_le_bytes(bytes))
    }

    /// The four bytes of the register.
    #[must_use]
    pub const fn to_bytes(self) -> [u8; 4] {
        self.0.to_le_bytes()
    }

    /// The register value.
    #[must_use]
    pub const fn value(self) -> u32 {
        self.0
    }

    /// Whether frames that are not EtherCAT are destroyed, and processed frames marked by bit 1 of
    /// the first byte of their source address.
    #[must_use]
    pub const fn destroys_foreign_frames(self) -> bool {
        self.0 & Self::DESTROY_FOREIGN_FRAMES != 0
    }

    /// Whether the loop modes hold for about one second only.
    #[must_use]
    pub const fn temporary(self) -> bool {
        self.0 & Self::TEMPORARY != 0
    }

    /// The loop mode of a port.
    #[must_use]
    pub const fn loop_mode(self, port: Port) -> LoopMode {
        LoopMode::from_bits((self.0 >> Self::loop_shift(port)) as u8)
    }

    /// Size of the receive FIFO, 0..=7. 7 is the default; less shortens the delay through the
    /// controller and tolerates less difference of clocks.
    #[must_use]
    pub const fn fifo_size(self) -> u8 {
        (self.0 >> Self::FIFO_SHIFT) as u8 & 7
    }

    /// Whether E-bus ports run with little jitter.
    #[must_use]
    pub const fn low_jitter(self) -> bool {
        self.0 & Self::LOW_JITTER != 0
    }

    /// Whether an E-bus port signals a lost link to its neighbour for about 80 µs instead of 660
    /// ms.
    #[must_use]
    pub const fn short_link_down(self) -> bool {
        self.0 & Self::SHORT_LINK_DOWN != 0
    }

    /// Whether the alias in 0x0012 counts as a station address.
    #[must_use]
    pub const fn alias_enabled(self) -> bool {
        self.0 & Self::ALIAS != 0
    }

    /// This value with foreign frames destroyed or let through.
    #[must_use]
    pub const fn with_foreign_frames_destroyed(self, on: bool) -> Self {
        self.set(Self::DESTROY_FOREIGN_FRAMES, on)
    }

    /// This value with loop modes that hold for about one second only, or for good.
    #[must_use]
    pub const fn with_temporary(self, on: bool) -> Self {
        self.set(Self::TEMPORARY, on)
    }

    /// This value with another loop mode of a port.
    #[must_use]
    pub const fn with_loop_mode(self, port: Port, mode: LoopMode) -> Self {
        let shift = Self::loop_shift(port);
        Self(self.0 & !(0b11 << shift) | (mode.bits() as u32) << shift)
    }

    /// This value with another FIFO size; only the low three bits of `size` count.
    #[must_use]
    pub const fn with_fifo_size(self, size: u8) -> Self {
        Self(self.0 & !(0b111 << Self::FIFO_SHIFT) | ((size & 7) as u32) << Self::FIFO_SHIFT)
    }

    /// This value with the alias counting as a station address, or not.
    #[must_use]
    pub const fn with_alias_enabled(self, on: bool) -> Self {
        self.set(Self::ALIAS, on)
    }

    const fn set(self, bit: u32, on: bool) -> Self {
        Self(if on { self.0 | bit } else { self.0 & !bit })
    }

    const fn loop_shift(port: Port) -> u32 {
        8 + 2 * port.index() as u32
    }
}

impl Default for DlControl {
    fn default() -> Self {
        Self::RESET
    }
}

/// When the loop of a port is open. Open means that frames leave and return here; closed, that they
/// go on to the next port inside the controller.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub enum LoopMode {
    /// Open while there is a link, closed while there is none.
    #[default]
    Auto,
    /// Closes when the link goes; opens again only when the mode is written anew, or a good frame
    /// arrives at the closed port.
    AutoClose,
    /// Open, link or not: without a link frames die here.
    Open,
    /// Closed, link or not: what is behind it is cut off.
    Closed,
}

impl LoopMode {
    /// The mode in the low two bits.
    #[must_use]
    pub const fn from_bits(bits: u8) -> Self {
        match bits & 0b11 {
            0 => Self::Auto,
            1 => Self::AutoClose,
            2 => Self::Open,
            _ => Self::Closed,
        }
    }

    /// The two bits of the register.
    #[must_use]
    pub const fn bits(self) -> u8 {
        match self {
            Self::Auto => 0,
            Self::AutoClose => 1,
            Self::Open => 2,
            Self::Closed => 3,
        }
    }

    /// The mode's name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::AutoClose => "auto close",
            Self::Open => "always open",
            Self::Closed => "always closed",
        }
    }
}

impl fmt::Display for LoopMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // proves: ESC-15 partial
    #[test]
    fn the_dump_of_the_sources() {
        // 0x0100 = FC01, 0x0102 = 0007: the end of a line, with the unused ports closed by hand.
        let control = DlControl::from_bytes([0x01, 0xFC, 0x07, 0x00]);
        assert!(control.destroys_foreign_frames());
        assert!(!control.temporary() && !control.alias_enabled());
        assert_eq!(control.fifo_size(), 7);
        assert_eq!(control.loop_mode(Port::A), LoopMode::Auto);
        for port in [Port::B, Port::C, Port::D] {
            assert_eq!(control.loop_mode(port), LoopMode::Closed, "port {port}");
        }
    }

    // proves: ESC-06 partial
    #[test]
    fn each_setting_has_its_bits() {
        let reset = DlControl::RESET;
        let table = [
            (reset.with_foreign_frames_destroyed(false), 0x0007_0000),
            (reset.with_temporary(true), 0x0007_0003),
            (reset.with_loop_mode(Port::A, LoopMode::AutoClose), 0x0007_0101),
            (reset.with_loop_mode(Port::B, LoopMode::Open), 0x0007_0801),
            (reset.with_loop_mode(Port::C, LoopMode::Closed), 0x0007_3001),
            (reset.with_loop_mode(Port::D, LoopMode::Closed), 0x0007_C001),
            (reset.with_fifo_size(2), 0x0002_0001),
            (reset.with_alias_enabled(true), 0x0107_0001),
        ];
        for (control, value) in table {
            assert_eq!(control.value(), value, "{value:#010X}");
        }
        assert!(DlControl(1 << 19).low_jitter() && DlControl(1 << 22).short_link_down());
    }

    #[test]
    fn loop_modes_survive_the_register() {
        for bits in 0..4 {
            assert_eq!(LoopMode::from_bits(bits).bits(), bits);
        }
        for port in Port::ALL {
            let closed = DlControl(u32::MAX).with_loop_mode(port, LoopMode::Auto);
            for other in Port::ALL {
                let expected = if other == port { LoopMode::Auto } else { LoopMode::Closed };
                assert_eq!(closed.loop_mode(other), expected);
            }
        }
    }
}
