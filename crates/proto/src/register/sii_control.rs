//! SII control and status (0x0502): commands to the EEPROM and how they went.
//!
//! Reference: S2 2.11.3. The order of accesses: take the SII (0x0500), wait until not busy, clear
//! errors, write the word address, write the command, wait until not busy, look at the errors, read
//! the data.

use super::bits::bits;

/// The control/status register of the SII.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub struct SiiControl(pub u16);

impl SiiControl {
    /// What to write to start a command. A write command brings its write enable along, since both
    /// must be in the same datagram.
    #[must_use]
    pub const fn start(command: SiiCommand) -> Self {
        let enable = match command {
            SiiCommand::Write => 1,
            SiiCommand::None | SiiCommand::Read | SiiCommand::Reload | SiiCommand::Reserved(_) => 0,
        };
        Self(enable).with_command(command)
    }

    /// From the two bytes of the register.
    #[must_use]
    pub const fn from_bytes(bytes: [u8; 2]) -> Self {
        Self(u16::from_le_bytes(bytes))
    }

    /// The two bytes of the register.
    #[must_use]
    pub const fn to_bytes(self) -> [u8; 2] {
        self.0.to_le_bytes()
    }

    bits! {
        u16;
        /// Whether a write command in this same frame is allowed.
        0 write_enable with_write_enable;
        /// Whether no EEPROM is connected.
        3 eeprom_missing with_eeprom_missing;
        /// Whether the SubDevice's processor plays the EEPROM.
        5 emulated with_emulated;
        /// Whether a read brings eight bytes; otherwise it brings four.
        6 reads_eight_bytes with_reads_eight_bytes;
        /// Whether the EEPROM takes two address bytes (32 Kbit and more).
        7 two_address_bytes with_two_address_bytes;
        /// Whether the first words of the SII do not match their checksum.
        11 checksum_error with_checksum_error;
        /// Whether the SII was not loaded, yet or at all.
        12 not_loaded with_not_loaded;
        /// Whether the EEPROM did not answer, or the command was invalid: try again after some ms.
        13 acknowledge_error with_acknowledge_error;
        /// Whether a write command came without write enable.
        14 write_enable_error with_write_enable_error;
        /// Whether a command is running. Writes have no effect meanwhile.
        15 busy with_busy;
    }

    /// The command to start, or the one that is running.
    #[must_use]
    pub const fn command(self) -> SiiCommand {
        SiiCommand::from_bits((self.0 >> 8) as u8)
    }

    /// This value with another command.
    #[must_use]
    pub const fn with_command(self, command: SiiCommand) -> Self {
        Self(self.0 & !0x0700 | (command.bits() as u16) << 8)
    }

    /// Whether the last command failed (bits 13 and 14). The checksum error is no failure of a
    /// command: it is about the content.
    #[must_use]
    pub const fn command_failed(self) -> bool {
        self.acknowledge_error() || self.write_enable_error()
    }

    /// How many bytes one read command brings.
    #[must_use]
    pub const fn read_len(self) -> usize {
        if self.reads_eight_bytes() { 8 } else { 4 }
    }
}

/// A command to the SII, three bits.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum SiiCommand {
    /// Nothing; writing it clears the error bits.
    None,
    /// Read two or four words.
    Read,
    /// Write one word.
    Write,
    /// Load the first words into the registers again.
    Reload,
    /// A value without a meaning: 3, 5, 6, 7. Some public code takes 3 for reload; it is not.
    Reserved(u8),
}

impl SiiCommand {
    /// The command in the low three bits.
    #[must_use]
    pub const fn from_bits(bits: u8) -> Self {
        match bits & 0b111 {
            0 => Self::None,
            1 => Self::Read,
            2 => Self::Write,
            4 => Self::Reload,
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
            Self::Reload => 4,
            Self::Reserved(bits) => bits & 0b111,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::register::table::SII_CONTROL_STATUS;

    #[test]
    fn commands_as_they_go_over_the_wire() {
        assert_eq!(SiiControl::start(SiiCommand::Read).to_bytes(), [0x00, 0x01]);
        assert_eq!(SiiControl::start(SiiCommand::Write).to_bytes(), [0x01, 0x02]);
        assert_eq!(SiiControl::start(SiiCommand::Reload).to_bytes(), [0x00, 0x04]);
        assert_eq!(SiiControl::start(SiiCommand::None).to_bytes(), [0x00, 0x00]);
        for bits in 0..8 {
            assert_eq!(SiiCommand::from_bits(bits).bits(), bits);
        }
        assert_eq!(SiiCommand::from_bits(3), SiiCommand::Reserved(3));
    }

    #[test]
    fn what_an_idle_controller_shows() {
        // Eight bytes at once, two address bytes: what ET1100-based terminals answer.
        let status = SiiControl::from_bytes([0xC0, 0x00]);
        assert!(!status.busy() && !status.command_failed());
        assert_eq!(status.read_len(), 8);
        assert_eq!(SiiControl::default().read_len(), 4);
        let blank = status.with_checksum_error(true);
        assert!(!blank.command_failed() && blank.checksum_error());
        assert!(status.with_acknowledge_error(true).command_failed());
    }

    /// The register table and this type number the bits alike.
    #[test]
    fn bits_agree_with_the_register_table() {
        let bit = |name: &str| 1u16 << SII_CONTROL_STATUS.field(name).unwrap().low;
        let none = SiiControl::default();
        assert_eq!(none.with_write_enable(true).0, bit("write enable"));
        assert_eq!(none.with_eeprom_missing(true).0, bit("EEPROM not present"));
        assert_eq!(none.with_emulated(true).0, bit("emulation"));
        assert_eq!(none.with_reads_eight_bytes(true).0, bit("read size"));
        assert_eq!(none.with_two_address_bytes(true).0, bit("address size"));
        assert_eq!(none.with_command(SiiCommand::Read).0, bit("command"));
        assert_eq!(none.with_checksum_error(true).0, bit("checksum error"));
        assert_eq!(none.with_not_loaded(true).0, bit("device information not loaded"));
        assert_eq!(none.with_acknowledge_error(true).0, bit("acknowledge error"));
        assert_eq!(none.with_write_enable_error(true).0, bit("write enable error"));
        assert_eq!(none.with_busy(true).0, bit("busy"));
    }
}
