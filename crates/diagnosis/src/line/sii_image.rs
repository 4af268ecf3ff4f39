//! The parts of a SubDevice's SII that were seen being read.

use linesman_proto::sii::word;
use linesman_proto::sii::{Image, WordAddress};

/// Most words kept: categories with names lie near the front.
const MOST_WORDS: usize = 2048;

/// Words seen so far; others read 0 and are not known.
#[derive(Clone, Default, Debug)]
pub struct SiiImage {
    bytes: Vec<u8>,
    known: Vec<bool>,
}

impl SiiImage {
    /// Takes `bytes` read from word `at` on. Says whether any word is new.
    pub fn record(&mut self, at: u32, bytes: &[u8]) -> bool {
        let mut news = false;
        for (offset, pair) in bytes.chunks_exact(2).enumerate() {
            let word = at as usize + offset;
            if word >= MOST_WORDS {
                break;
            }
            if self.known.len() <= word {
                self.known.resize(word + 1, false);
                self.bytes.resize(2 * (word + 1), 0);
            }
            news |= !self.known[word];
            self.known[word] = true;
            self.bytes[2 * word..2 * word + 2].copy_from_slice(pair);
        }
        news
    }

    /// A word, if it was read.
    #[must_use]
    pub fn word(&self, at: WordAddress) -> Option<u16> {
        let index = at.value() as usize;
        let known = *self.known.get(index)?;
        let bytes = [self.bytes[2 * index], self.bytes[2 * index + 1]];
        known.then_some(u16::from_le_bytes(bytes))
    }

    /// Two words, the low one first, if both were read.
    #[must_use]
    pub fn long(&self, at: WordAddress) -> Option<u32> {
        let low = self.word(at)?;
        let high = self.word(WordAddress(at.value() + 1))?;
        Some(u32::from(high) << 16 | u32::from(low))
    }

    /// The order designation, else the name, once the categories that hold them were read.
    #[must_use]
    pub fn type_name(&self) -> Option<String> {
        const STRINGS: u16 = 10;
        const GENERAL: u16 = 30;
        let mut at = word::FIRST_CATEGORY.value();
        let (mut strings, mut general) = (false, false);
        while !(strings && general) {
            let kind = self.word(WordAddress(at))?;
            let len = u32::from(self.word(WordAddress(at + 1))?);
            let end = at + 2 + len;
            let is_whole = || (at + 2..end).all(|word| self.word(WordAddress(word)).is_some());
            match kind {
                STRINGS => strings = is_whole(),
                GENERAL => general = is_whole(),
                u16::MAX => return None,
                _ => {}
            }
            at = end;
            if at as usize >= MOST_WORDS {
                return None;
            }
        }
        let image = Image::parse(self.bytes.get(..2 * at as usize)?).ok()?;
        let text = image.order().filter(|text| !text.is_empty()).or(image.name())?;
        Some(text.trim().to_owned()).filter(|text| !text.is_empty())
    }
}
