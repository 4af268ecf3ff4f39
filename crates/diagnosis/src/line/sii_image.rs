//! The parts of a SubDevice's SII that were seen being read.

use std::ops::Range;

use linesman_proto::port::PortMap;
use linesman_proto::sii::word;
use linesman_proto::sii::{CategoryKind, General, Image, PortKind, WordAddress};

/// Most words kept: categories with names lie near the front.
const MOST_WORDS: usize = 2048;

/// What the SII says of the E-bus.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Power {
    /// Current taken from the E-bus in mA; negative is supplied.
    pub ebus_current_ma: i16,
    /// What its ports are.
    pub ports: PortMap<PortKind>,
}

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
        let (strings, general) =
            (self.category(CategoryKind::Strings)?, self.category(CategoryKind::General)?);
        let image = Image::parse(self.bytes.get(..strings.end.max(general.end))?).ok()?;
        let text = image.order().filter(|text| !text.is_empty()).or(image.name())?;
        Some(text.trim().to_owned()).filter(|text| !text.is_empty())
    }

    /// What its controller hangs on, once category General was read.
    #[must_use]
    pub fn power(&self) -> Option<Power> {
        let content = self.bytes.get(self.category(CategoryKind::General)?)?;
        let general = General::from_bytes(content.first_chunk()?);
        Some(Power { ebus_current_ma: general.ebus_current_ma, ports: general.ports })
    }

    /// Where the content of a category lies, in bytes, if all of it was read.
    fn category(&self, wanted: CategoryKind) -> Option<Range<usize>> {
        let mut at = word::FIRST_CATEGORY.value();
        while (at as usize) < MOST_WORDS {
            let kind = CategoryKind::from_code(self.word(WordAddress(at))?);
            let content = at + 2..at + 2 + u32::from(self.word(WordAddress(at + 1))?);
            if kind == CategoryKind::End {
                return None;
            }
            if kind == wanted {
                let is_whole = content.clone().all(|word| self.word(WordAddress(word)).is_some());
                return is_whole.then(|| 2 * content.start as usize..2 * content.end as usize);
            }
            at = content.end;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An image of an empty head, category General of `len` words, and the end.
    fn image(len: u16) -> Vec<u8> {
        let mut bytes = vec![0; 2 * word::FIRST_CATEGORY.value() as usize];
        bytes.extend([30, 0]);
        bytes.extend(len.to_le_bytes());
        let content = bytes.len();
        bytes.resize(content + 2 * usize::from(len), 0);
        bytes[content + 12..content + 14].copy_from_slice(&(-2000i16).to_le_bytes());
        bytes.extend([0xFF, 0xFF, 0, 0]);
        bytes
    }

    #[test]
    fn power_is_read_from_the_begin_of_general_however_long_it_is() {
        for len in [16, 20] {
            let (mut sii, bytes) = (SiiImage::default(), image(len));
            assert!(sii.record(0, &bytes[..bytes.len() - 8]));
            assert_eq!(sii.power(), None, "not all of it is read");
            sii.record(0, &bytes);
            assert_eq!(sii.power().map(|power| power.ebus_current_ma), Some(-2000), "{len} words");
        }
        let mut short = SiiImage::default();
        short.record(0, &image(8));
        assert_eq!(short.power(), None);
    }
}
