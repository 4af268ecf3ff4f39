//! Oddities of an image that leave it readable, and errors that do not.
//!
//! Images of real devices are cut off, lack their end marker, point at texts that are not there. A
//! MainDevice that refused them would refuse working devices, so each oddity is noted with the word
//! where it was seen, and the rest is read on.

use super::category::CategoryKind;
use super::strings::StringIndex;
use super::word::{self, WordAddress};

/// Why nothing can be said about an image.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum SiiError {
    /// It ends before the identity does.
    #[error("SII image of {len} bytes: at least {} are needed for the identity", SiiError::MIN_LEN)]
    TooShort {
        /// Bytes there were.
        len: usize,
    },
    /// Identity and configuration hold nothing but one value: a blank or unreadable EEPROM.
    #[error(
        "SII image is blank: words 0x0000..=0x000F are all 0x{0:02X}{0:02X}; the EEPROM was never \
         programmed, or nothing answers at its address",
        byte
    )]
    Blank {
        /// 0xFF or 0x00.
        byte: u8,
    },
}

impl SiiError {
    /// Fewest bytes of an image that can be judged: up to and including the serial number.
    pub const MIN_LEN: usize = word::LEGACY_DELAYS.byte();
}

/// Something odd, and where.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, thiserror::Error)]
#[error("SII word {at}: {kind}")]
pub struct Oddity {
    /// The word it was seen at.
    pub at: WordAddress,
    /// What was odd.
    pub kind: OddityKind,
}

/// What was odd.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, thiserror::Error)]
pub enum OddityKind {
    /// The image ends within the fixed words; the rest of them is taken as 0.
    #[error("image ends here, before the categories begin at word 0x0040")]
    HeaderCutOff,
    /// The checksum does not fit: the controller starts without its configuration.
    #[error("checksum 0x{found:04X}, computed 0x{computed:02X}")]
    ChecksumWrong {
        /// The word found.
        found: u16,
        /// What it should be.
        computed: u8,
    },
    /// 0x88A4 switches the checksum off, which is meant for development.
    #[error("checksum switched off (0x88A4)")]
    ChecksumSkipped,
    /// The high byte of the checksum word is not 0; building writes 0.
    #[error("high byte of the checksum word 0x{found:04X} is not 0")]
    ChecksumHighByte {
        /// The word found.
        found: u16,
    },
    /// A category announces more than there is; what is there is used.
    #[error("{kind} announces {announced} words, {found} are left")]
    CategoryCutOff {
        /// Its type.
        kind: CategoryKind,
        /// Words announced.
        announced: u16,
        /// Words that are there.
        found: u32,
    },
    /// The image ends without type 0xFFFF.
    #[error("image ends without an end marker")]
    NoEndMarker,
    /// Nothing but empty headers follows: an image filled with zeros in place of an end marker.
    #[error("empty categories (type 0, length 0) in place of an end marker")]
    EmptyHeaders,
    /// The used part is longer than the size word says.
    #[error("used part of {used} bytes is longer than the {size} bytes of the size word")]
    BeyondSize {
        /// Bytes up to the end of the categories.
        used: usize,
        /// Bytes the size word announces.
        size: usize,
    },
    /// Bytes behind the last whole record of a category are not used.
    #[error("{left} bytes behind the last record of {kind}")]
    TrailingBytes {
        /// Type of the category.
        kind: CategoryKind,
        /// Bytes left over.
        left: usize,
    },
    /// General is shorter than its 32 bytes; the rest is taken as 0.
    #[error("General of {len} bytes, expected 32")]
    GeneralShort {
        /// Bytes there were.
        len: usize,
    },
    /// A category that should be there once is there again; only the first is used.
    #[error("a second {kind}; only the first is used")]
    Repeated {
        /// Its type.
        kind: CategoryKind,
    },
    /// The Strings category ends before its last text does.
    #[error("{announced} texts announced, {found} found")]
    StringsCutOff {
        /// Number announced.
        announced: u8,
        /// Number found.
        found: usize,
    },
    /// A number of a text that does not exist.
    #[error("text {index} is asked for, there are {count}")]
    StringMissing {
        /// The number.
        index: StringIndex,
        /// How many texts there are.
        count: usize,
    },
    /// A PDO announces more entries than its category holds.
    #[error("PDO 0x{index:04X} announces {announced} entries, {found} found")]
    PdoCutOff {
        /// Index of the PDO.
        index: u16,
        /// Number announced.
        announced: u8,
        /// Number found.
        found: usize,
    },
}
