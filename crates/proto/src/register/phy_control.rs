//! PHY management control and status (0x0510): commands to the registers of the Ethernet PHYs and
//! how they went.
//!
//! Reference: S2 2.12.1. The order of accesses: wait until not busy, set the PHY address and the PHY
//! register (0x0512, 0x0513), put what is to be written into 0x0514, write the command, wait until
//! not busy, look at the errors, read the data.

use super::bits::bits;

/// The control/status register of the PHY management interface.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub struct PhyControl(pub u16);

impl PhyControl {
    /// What to write to start a command. A write command brings its write enable along, since both
    /// must be in the same frame.
    #[must_use]
    pub const fn start(command: PhyCommand) -> Self {
        let enable = match command {
            PhyCommand::Write => 1,
            PhyCommand::None | PhyCommand::Read | PhyCommand::Reserved(_) => 0,
        };
        Self(enable).with_command(command)
    }

    bits! {
        u16;
        /// Whether a write command in this same frame is allowed.
        0 write_enable with_write_enable;
        /// Whether the SubDevice's processor may take the interface.
        1 pdi_control_possible with_pdi_control_possible;
        /// Whether the controller itself watches links over PHY registers.
        2 link_detection with_link_detection;
        /// Whether there is no such PHY or register.
        13 read_error with_read_error;
        /// Whether the command was invalid, or a write came without write enable.
        14 command_error with_command_error;
        /// Whether a command is running. Writes have no effect meanwhile.
        15 busy with_busy;
    }

    /// The address of the PHY of port 0; those of the other ports follow.
    #[must_use]
    pub const fn address_offset(self) -> u8 {
        (self.0 >> 3 & 0x1F) as u8
    }

    /// This value with another address of the PHY of port 0, 0 to 31.
    #[must_use]
    pub const fn with_address_offset(self, offset: u8) -> Self {
        Self(self.0 & !0x00F8 | (offset as u16 & 0x1F) << 3)
    }

    /// The command to start, or the one that is running.
    #[must_use]
    pub const fn command(self) -> PhyCommand {
        PhyCommand::from_bits((self.0 >> 8) as u8)
    }

    /// This value with another command.
    #[must_use]
    pub const fn with_command(self, command: PhyCommand) -> Self {
        Self(self.0 & !0x0700 | (command.bits() as u16) << 8)
    }
}

/// A command to a PHY, three bits.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum PhyCommand {
    /// Nothing; writing it clears the error bits.
    None,
    /// Read one register.
    Read,
    /// Write one register.
    Write,
    /// A value without a meaning in clause 22 of IEEE 802.3.
    Reserved(u8),
}

impl PhyCommand {
    /// The command in the low three bits.
    #[must_use]
    pub const fn from_bits(bits: u8) -> Self {
        match bits & 0b111 {
            0 => Self::None,
            1 => Self::Read,
            2 => Self::Write,
            reserved => Self::Reserved(reserved),
        }
    }

    /// The three bits.
    #[must_use]
    pub const fn bits(self) -> u8 {
        match self {
            Self::None => 0,
            Self::Read => 1,
            Self::Write => 2,
            Self::Reserved(bits) => bits & 0b111,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_lie_where_the_table_says() {
        let table = crate::register::PHY_CONTROL_STATUS;
        let field = |name: &str| table.field(name).unwrap().low;
        assert_eq!(1 << field("busy"), PhyControl(0).with_busy(true).0);
        assert_eq!(1 << field("read error"), PhyControl(0).with_read_error(true).0);
        assert_eq!(1 << field("command error"), PhyControl(0).with_command_error(true).0);
        assert_eq!(1 << field("PHY address offset"), PhyControl(0).with_address_offset(1).0);
        assert_eq!(1 << field("command"), PhyControl(0).with_command(PhyCommand::Read).0);
        assert_eq!(PhyControl::start(PhyCommand::Write).0, 0x0201);
        for bits in 0..8 {
            assert_eq!(PhyCommand::from_bits(bits).bits(), bits);
        }
        assert_eq!(PhyControl(0x00F8).address_offset(), 0x1F);
    }
}
