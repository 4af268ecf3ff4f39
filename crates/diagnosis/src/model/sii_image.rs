//! The parts of a SubDevice's SII that were seen being read.

use std::ops::Range;

use linesman_proto::port::PortMap;
use linesman_proto::sii::word;
use linesman_proto::sii::{CategoryKind, General, Image, PortKind, WordAddress};

/// Most words kept: categories with names lie near the front.
const MOST_WORDS: usize = 2048;

/// Category General: numbers of the strings that hold the order designation and the name, by byte.
/// Reference: ETG.2010 table 7.
const ORDER: usize = 2;
const NAME: usize = 3;

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

    /// Stretches of words that were read: the address of the first word, and the words.
    #[must_use]
    pub fn stretches(&self) -> Vec<(u32, Vec<u16>)> {
        let mut all: Vec<(u32, Vec<u16>)> = Vec::new();
        for at in (0..self.known.len() as u32).filter(|at| self.known[*at as usize]) {
            let Some(word) = self.word(WordAddress(at)) else { continue };
            match all.last_mut() {
                Some((first, words)) if *first + words.len() as u32 == at => words.push(word),
                Some(_) | None => all.push((at, vec![word])),
            }
        }
        all
    }

    /// Two words, the low one first, if both were read.
    #[must_use]
    pub fn long(&self, at: WordAddress) -> Option<u32> {
        let low = self.word(at)?;
        let high = self.word(WordAddress(at.value() + 1))?;
        Some(u32::from(high) << 16 | u32::from(low))
    }

    /// The order designation, the type of the device, once it was read with all that leads to it: a
    /// MainDevice often reads one string only.
    #[must_use]
    pub fn order(&self) -> Option<String> {
        self.string(self.byte(self.find(CategoryKind::General)?.start + ORDER)?)
    }

    /// The name of the device, often longer than its type, once it was read.
    #[must_use]
    pub fn name(&self) -> Option<String> {
        self.string(self.byte(self.find(CategoryKind::General)?.start + NAME)?)
    }

    /// The order designation, else the name.
    #[must_use]
    pub fn type_name(&self) -> Option<String> {
        self.order().or_else(|| self.name())
    }

    /// A string by its number, counted from 1; `None` for one that is empty or was not read.
    fn string(&self, number: u8) -> Option<String> {
        let content = self.find(CategoryKind::Strings)?;
        let count = self.byte(content.start)?;
        if number == 0 || number > count {
            return None;
        }
        let mut at = content.start + 1;
        for _ in 1..number {
            at += 1 + usize::from(self.byte(at)?);
        }
        let text = at + 1..at + 1 + usize::from(self.byte(at)?);
        let bytes: Option<Vec<u8>> = text.map(|at| self.byte(at)).collect();
        let text = String::from_utf8_lossy(&bytes?).trim_matches(['\0', ' ']).to_owned();
        Some(text).filter(|text| !text.is_empty())
    }

    /// A byte, if it was read.
    fn byte(&self, at: usize) -> Option<u8> {
        let is_known = *self.known.get(at / 2)?;
        is_known.then(|| self.bytes[at])
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
        let content = self.find(wanted)?;
        content.clone().all(|at| self.byte(at).is_some()).then_some(content)
    }

    /// Where the content of a category lies, in bytes, if the heads of those before it were read.
    fn find(&self, wanted: CategoryKind) -> Option<Range<usize>> {
        self.categories().find_map(|(kind, content)| (kind == wanted).then_some(content))
    }

    /// Categories and where their contents lie, in bytes, up to the first one whose head was not read.
    fn categories(&self) -> impl Iterator<Item = (CategoryKind, Range<usize>)> {
        let mut at = word::FIRST_CATEGORY.value();
        std::iter::from_fn(move || {
            if at as usize >= MOST_WORDS {
                return None;
            }
            let kind = CategoryKind::from_code(self.word(WordAddress(at))?);
            if kind == CategoryKind::End {
                return None;
            }
            let content = at + 2..at + 2 + u32::from(self.word(WordAddress(at + 1))?);
            at = content.end;
            Some((kind, 2 * content.start as usize..2 * content.end as usize))
        })
    }

    /// The image as far as it was read: words that are not known read 0, and a category that was not read to its end is
    /// not in it. `None` where nothing of it can be used.
    #[must_use]
    pub fn image(&self) -> Option<Image> {
        let mut bytes = self.bytes.get(..2 * word::FIRST_CATEGORY.value() as usize)?.to_vec();
        let read = |content: &Range<usize>| content.clone().all(|at| self.byte(at).is_some());
        for (_, content) in self.categories().filter(|(_, content)| read(content)) {
            let head = content.start - 4;
            bytes.extend_from_slice(&self.bytes[head..content.end]);
        }
        bytes.extend(CategoryKind::End.code().to_le_bytes());
        Image::parse(&bytes).ok()
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

    /// An image with the strings `EL2004` and `4 outputs`, then category General that names both.
    fn named_image() -> Vec<u8> {
        let mut bytes = vec![0; 2 * word::FIRST_CATEGORY.value() as usize];
        let strings = b"\x02\x06EL2004\x094 outputs";
        bytes.extend([10, 0, (strings.len() / 2) as u8, 0]);
        bytes.extend(strings);
        bytes.extend([30, 0, 16, 0, 0, 0, 1, 2]);
        bytes.extend([0; 28]);
        bytes.extend([0xFF, 0xFF, 0, 0]);
        bytes
    }

    #[test]
    fn type_is_told_by_the_one_string_that_was_read() {
        let bytes = named_image();
        let (mut sii, first) = (SiiImage::default(), word::FIRST_CATEGORY.value());
        // The heads of both categories and the string numbers of General.
        let strings = first + 2;
        let general = strings + 9;
        let take = |sii: &mut SiiImage, from: u32, words: u32| {
            sii.record(from, &bytes[2 * from as usize..2 * (from + words) as usize])
        };
        assert!(take(&mut sii, first, 2) && take(&mut sii, general, 4));
        assert_eq!(sii.type_name(), None, "no string was read");
        // Number of strings, the length of the first, and the second.
        assert!(take(&mut sii, strings, 1) && take(&mut sii, strings + 4, 5));
        assert_eq!(sii.type_name().as_deref(), Some("4 outputs"), "the type is not read yet");
        assert_eq!(sii.order(), None);
        assert!(take(&mut sii, strings + 1, 3));
        assert_eq!(sii.type_name().as_deref(), Some("EL2004"));
        assert_eq!(sii.name().as_deref(), Some("4 outputs"));
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
