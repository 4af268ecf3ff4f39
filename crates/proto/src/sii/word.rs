//! Word addresses of the fixed part of an image, and the type that carries them.
//!
//! Reference: ETG.1000.6 §5.4 table 16 (as cited by public stacks); ETG.2010. The EEPROM interface
//! (register 0x0504) counts in 16-bit words, a file in bytes: [`WordAddress::byte`] converts.

use std::fmt;

/// A place in the image in words of 16 bits, as register 0x0504 wants it.
///
/// Range 0..=0x003F_FFFF: the size word can announce at most 64 Mbit.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct WordAddress(pub u32);

impl WordAddress {
    /// The bare number, for the wire.
    #[must_use]
    pub const fn value(self) -> u32 {
        self.0
    }

    /// Offset of the word's low byte in an image held as bytes.
    #[must_use]
    pub const fn byte(self) -> usize {
        self.0 as usize * 2
    }

    /// The word that holds the byte at this offset.
    #[must_use]
    pub(crate) const fn of_byte(offset: usize) -> Self {
        Self((offset / 2) as u32)
    }
}

impl fmt::Display for WordAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:04X}", self.0)
    }
}

impl fmt::Debug for WordAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "WordAddress({self})")
    }
}

/// PDI control (low byte, to register 0x0140) and ESC configuration (high byte, to 0x0141).
pub const PDI_CONTROL: WordAddress = WordAddress(0x00);
/// PDI configuration, to registers 0x0150 and 0x0151.
pub const PDI_CONFIGURATION: WordAddress = WordAddress(0x01);
/// Length of the SYNC pulse in units of 10 ns, to register 0x0982.
pub const SYNC_IMPULSE: WordAddress = WordAddress(0x02);
/// Extended PDI configuration, to register 0x0152.
pub const PDI_CONFIGURATION_2: WordAddress = WordAddress(0x03);
/// Configured station alias, to register 0x0012 at the first load after power-on.
pub const STATION_ALIAS: WordAddress = WordAddress(0x04);
/// Two words of further ESC configuration (to 0x0142 and 0x0144 where they exist), else reserved.
pub const ESC_CONFIGURATION_2: WordAddress = WordAddress(0x05);
/// Checksum over words 0..=6, in the low byte.
pub const CHECKSUM: WordAddress = WordAddress(0x07);
/// Vendor identity, 32 bits. Object 0x1018:01 has the same.
pub const VENDOR_ID: WordAddress = WordAddress(0x08);
/// Product code, 32 bits. Object 0x1018:02 has the same.
pub const PRODUCT_CODE: WordAddress = WordAddress(0x0A);
/// Revision number, 32 bits: variant in the low word, revision in the high word.
pub const REVISION: WordAddress = WordAddress(0x0C);
/// Serial number, 32 bits; 0 means none.
pub const SERIAL_NUMBER: WordAddress = WordAddress(0x0E);
/// Four words of delays that old tools wrote; reserved today.
pub const LEGACY_DELAYS: WordAddress = WordAddress(0x10);
/// Bootstrap mailbox, four words: receive offset and size, send offset and size.
pub const BOOTSTRAP_MAILBOX: WordAddress = WordAddress(0x14);
/// Standard mailbox, four words: receive offset and size, send offset and size.
pub const STANDARD_MAILBOX: WordAddress = WordAddress(0x18);
/// Mailbox protocols, see [`Protocols`](super::Protocols).
pub const MAILBOX_PROTOCOLS: WordAddress = WordAddress(0x1C);
/// 33 words that the specification reserves; some vendors keep notes there.
pub const VENDOR_WORDS: WordAddress = WordAddress(0x1D);
/// Size of the EEPROM: Kbit less one.
pub const SIZE: WordAddress = WordAddress(0x3E);
/// Version of the layout, 1 today.
pub const VERSION: WordAddress = WordAddress(0x3F);
/// Header of the first category.
pub const FIRST_CATEGORY: WordAddress = WordAddress(0x40);
