//! Reader of an EEPROM: the words to read next, so that only its used part crosses the wire.
//!
//! A controller hands out 4 or 8 bytes per command (register 0x0502), and each command has to be
//! written, waited for and fetched; an EK1100 uses 238 bytes of its 2,048. [`Reader`] does no I/O:
//! ask it what it [needs](Reader::needs), read at least one word there, [supply](Reader::supply)
//! it, repeat until nothing is needed, [finish](Reader::finish).
//!
//! ```
//! # use linesman_proto::sii::{Image, Reader, SiiError};
//! # fn demo(eeprom: &[u8]) -> Result<Image, SiiError> {
//! let mut reader = Reader::new();
//! while let Some(words) = reader.needs() {
//!     let at = words.start.byte();
//!     let Some(chunk) = eeprom.get(at..at + 4) else { break };   // one command on the wire
//!     reader.supply(chunk);
//! }
//! reader.finish()
//! # }
//! # let image = Image { version: 1, ..Image::default() };
//! # assert_eq!(demo(&image.build().unwrap()).unwrap(), image);
//! ```

use std::ops::Range;

use super::image::{Image, Size};
use super::oddity::SiiError;
use super::walk::{HEADER_WORDS, Step, Walk};
use super::word::{self, WordAddress};

/// Reads an image word by word, from the front. See the [module](self).
#[derive(Clone, Debug)]
pub struct Reader {
    bytes: Vec<u8>,
    walk: Walk,
    /// Words needed as far as the walk has got.
    wanted: u32,
    limit: u32,
    done: bool,
}

impl Reader {
    /// Most words that are read unless said otherwise: 64 KiB, far beyond what devices use.
    pub const DEFAULT_LIMIT: WordAddress = WordAddress(0x8000);

    /// A reader that has read nothing yet.
    #[must_use]
    pub const fn new() -> Self {
        Self::with_limit(Self::DEFAULT_LIMIT)
    }

    /// A reader that stops before this word whatever the image says. Categories behind it are cut
    /// off, which the image notes as an oddity.
    #[must_use]
    pub const fn with_limit(limit: WordAddress) -> Self {
        Self {
            bytes: Vec::new(),
            walk: Walk::new(),
            wanted: word::FIRST_CATEGORY.value(),
            limit: limit.value(),
            done: false,
        }
    }

    /// The words to read next, in one piece and from its start; `None` when no more is needed.
    #[must_use]
    pub fn needs(&self) -> Option<Range<WordAddress>> {
        let have = self.have();
        let end = self.wanted.min(self.limit);
        (!self.done && have < end).then_some(WordAddress(have)..WordAddress(end))
    }

    /// Takes bytes that begin with the first word needed: a part of what is needed, or more, as the
    /// controller hands them out. A single byte at the end is not used; nor is anything once
    /// nothing is needed.
    pub fn supply(&mut self, bytes: &[u8]) {
        if self.needs().is_none() {
            return;
        }
        self.bytes.extend_from_slice(&bytes[..bytes.len() & !1]);
        self.advance();
    }

    /// Bytes read so far.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The image in what has been read. It may be called before everything is there, for instance
    /// when the EEPROM stopped answering: the image then notes what is cut off.
    ///
    /// # Errors
    /// As [`Image::parse`].
    pub fn finish(self) -> Result<Image, SiiError> {
        Image::parse(&self.bytes)
    }

    fn have(&self) -> u32 {
        u32::try_from(self.bytes.len() / 2).unwrap_or(u32::MAX)
    }

    fn word(&self, at: u32) -> Option<u16> {
        let at = WordAddress(at).byte();
        Some(u16::from_le_bytes([*self.bytes.get(at)?, *self.bytes.get(at + 1)?]))
    }

    /// Walks on over the headers that are there by now.
    fn advance(&mut self) {
        if let Some(size) = self.word(word::SIZE.value()) {
            self.limit = self.limit.min(Self::bound(size));
        }
        while !self.done {
            let at = self.walk.header_at().value();
            let Some(kind) = self.word(at) else {
                self.wanted = at.saturating_add(HEADER_WORDS);
                return;
            };
            // The end marker has no length behind it that must be waited for.
            let Some(len) = self.word(at.saturating_add(1)).or((kind == u16::MAX).then_some(0))
            else {
                self.wanted = at.saturating_add(HEADER_WORDS);
                return;
            };
            match self.walk.step(kind, len) {
                Step::End | Step::EmptyHeaders => self.done = true,
                // The data are wanted together with the header behind them, which the next round
                // looks for.
                Step::Category { .. } => {}
            }
        }
    }

    /// Where to stop by the size word. An image that announces no room for categories (0), or a
    /// word that was never programmed, says nothing about the EEPROM.
    fn bound(size: u16) -> u32 {
        match size {
            0 | u16::MAX => u32::MAX,
            size => u32::try_from(Size(size).bytes() / 2).unwrap_or(u32::MAX),
        }
    }
}

impl Default for Reader {
    fn default() -> Self {
        Self::new()
    }
}
