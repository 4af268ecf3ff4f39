//! The whole image: fixed words, then categories.
//!
//! Reference: ETG.1000.6 §5.4, ETG.2010. [`Image::parse`] is tolerant and notes what was odd;
//! [`Image::build`] makes a complete image with its checksum.

use super::build::{self, BuildError};
use super::category::Category;
use super::configuration::{Checksum, Configuration};
use super::mailbox::{MailboxPair, Protocols};
use super::oddity::{Oddity, SiiError};
use super::parse;

/// A SubDevice's image. The default is an empty one for an EEPROM of 16 Kbit.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub struct Image {
    /// Words 0..=6: what the controller loads at power-on.
    pub configuration: Configuration,
    /// Word 7.
    pub checksum: Checksum,
    /// Words 8..=15.
    pub identity: Identity,
    /// Words 0x10..=0x13: delays that old tools wrote; reserved today, kept.
    pub legacy_delays: [u16; 4],
    /// Words 0x14..=0x17: mailbox for firmware updates in BOOT.
    pub bootstrap_mailbox: MailboxPair,
    /// Words 0x18..=0x1B: mailbox for everything else.
    pub standard_mailbox: MailboxPair,
    /// Word 0x1C.
    pub protocols: Protocols,
    /// Words 0x1D..=0x3D: reserved; some vendors keep notes there.
    pub vendor_words: [u16; 33],
    /// Word 0x3E.
    pub size: Size,
    /// Word 0x3F: version of the layout.
    pub version: u16,
    /// Everything from word 0x40 on, in order, without the end marker.
    pub categories: Vec<Category>,
    /// What [`Image::parse`] found odd. Building does not look at it.
    pub oddities: Vec<Oddity>,
}

impl Image {
    /// Reads an image: a file, or what was read over the wire (it may end with the end marker).
    ///
    /// What is odd is noted in [`Image::oddities`]; bytes behind the end marker are not looked at.
    ///
    /// # Errors
    /// [`SiiError`] when nothing can be judged: shorter than 32 bytes, or blank.
    pub fn parse(bytes: &[u8]) -> Result<Self, SiiError> {
        parse::image(bytes)
    }

    /// Makes the image: fixed words with their checksum, categories, end marker, then 0xFF up to
    /// the size word. It is longer than the size word says when the categories need more.
    ///
    /// Parsing the result gives this image again. An image that was parsed comes out with the same
    /// bytes, but for what carries no meaning: padding within a word (0xFF here), the high byte of
    /// the checksum word, bytes that an [`Oddity`] told of, and everything behind the end marker.
    ///
    /// # Errors
    /// [`BuildError`] when a category does not fit into its length, or a PDO has too many entries.
    pub fn build(&self) -> Result<Vec<u8>, BuildError> {
        build::image(self)
    }
}

impl Default for Image {
    fn default() -> Self {
        Self {
            configuration: Configuration::default(),
            checksum: Checksum::Valid,
            identity: Identity::default(),
            legacy_delays: [0; 4],
            bootstrap_mailbox: MailboxPair::default(),
            standard_mailbox: MailboxPair::default(),
            protocols: Protocols::default(),
            vendor_words: [0; 33],
            size: Size::default(),
            version: 1,
            categories: Vec::new(),
            oddities: Vec::new(),
        }
    }
}

/// Who the SubDevice is: the same as object 0x1018.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default)]
pub struct Identity {
    /// Vendor, as the technology group assigned it.
    pub vendor_id: u32,
    /// Product, as the vendor numbers it.
    pub product_code: u32,
    /// Variant in the low word, revision in the high word.
    pub revision: u32,
    /// Serial number; 0 means none.
    pub serial_number: u32,
}

/// Size of the EEPROM as word 0x3E gives it: Kbit less one.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct Size(pub u16);

impl Size {
    /// The smallest size that holds this many bytes: steps of 128 bytes, at most 8 MiB.
    #[must_use]
    pub const fn for_bytes(bytes: usize) -> Self {
        let kbit = bytes.div_ceil(128);
        let most = u16::MAX as usize + 1;
        Self(if kbit == 0 {
            0
        } else if kbit > most {
            u16::MAX
        } else {
            (kbit - 1) as u16
        })
    }

    /// Size in bytes.
    #[must_use]
    pub const fn bytes(self) -> usize {
        (self.0 as usize + 1) * 128
    }
}

impl Default for Size {
    /// 16 Kbit, the commonest.
    fn default() -> Self {
        Self(0x0F)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_kilobits_less_one() {
        for (word, bytes) in [(0x0000, 128), (0x0001, 256), (0x000F, 2048), (0x001F, 4096)] {
            assert_eq!(Size(word).bytes(), bytes);
            assert_eq!(Size::for_bytes(bytes), Size(word));
            assert_eq!(Size::for_bytes(bytes - 1), Size(word));
        }
        assert_eq!(Size::for_bytes(0), Size(0));
        assert_eq!(Size::for_bytes(usize::MAX), Size(0xFFFF));
        assert_eq!(Size::default().bytes(), 2048);
    }
}
