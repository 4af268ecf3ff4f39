//! Category 10, Strings: the texts that other categories point at by number.
//!
//! Reference: ETG.2010. Layout: count (u8), then for each its length (u8) and bytes, padded to a
//! whole word. Numbers start at 1; 0 means "no text".

use std::borrow::Cow;
use std::fmt;

/// Number of a text as other categories give it: 1-based, 0 for none.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default)]
pub struct StringIndex(pub u8);

impl StringIndex {
    /// No text.
    pub const NONE: Self = Self(0);

    /// Whether it points at nothing on purpose.
    #[must_use]
    pub const fn is_none(self) -> bool {
        self.0 == 0
    }
}

impl fmt::Display for StringIndex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0)
    }
}

/// One text. Images hold UTF-8 or Latin-1 without saying which; bytes that are no UTF-8 are taken
/// as Latin-1, and go back to the image as they came.
#[derive(Clone, PartialEq, Eq, Hash, Debug, Default)]
pub struct SiiString {
    text: String,
    latin_1: bool,
}

impl SiiString {
    /// Most bytes a text can have, as its length is one byte.
    pub const MAX_LEN: usize = 255;

    /// A text of our own, which is stored as UTF-8.
    ///
    /// # Errors
    /// [`StringsError::TooLong`] when it needs more than 255 bytes.
    pub fn new(text: &str) -> Result<Self, StringsError> {
        let len = text.len();
        if len > Self::MAX_LEN {
            return Err(StringsError::TooLong { len });
        }
        Ok(Self { text: text.to_owned(), latin_1: false })
    }

    /// The text behind at most 255 bytes of an image.
    fn from_bytes(bytes: &[u8]) -> Self {
        match std::str::from_utf8(bytes) {
            Ok(text) => Self { text: text.to_owned(), latin_1: false },
            Err(_) => Self { text: bytes.iter().copied().map(char::from).collect(), latin_1: true },
        }
    }

    /// The text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.text
    }

    /// The bytes as the image has them.
    #[must_use]
    pub fn bytes(&self) -> Cow<'_, [u8]> {
        if self.latin_1 {
            // Each character came from one byte, so each fits into one again.
            Cow::Owned(self.text.chars().map(|letter| letter as u8).collect())
        } else {
            Cow::Borrowed(self.text.as_bytes())
        }
    }
}

/// Why a text cannot be stored.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum StringsError {
    /// The text is longer than its length byte can say.
    #[error("SII string of {len} bytes, at most 255 fit")]
    TooLong {
        /// Length in bytes.
        len: usize,
    },
    /// There are 255 texts already.
    #[error("SII strings: 255 are stored, no number is left for another")]
    TooMany,
}

/// All texts of an image: at most 255.
#[derive(Clone, PartialEq, Eq, Hash, Debug, Default)]
pub struct Strings(Vec<SiiString>);

impl Strings {
    /// Most texts one category can hold, as their count is one byte.
    pub const MAX_COUNT: usize = 255;

    /// No texts yet.
    #[must_use]
    pub const fn new() -> Self {
        Self(Vec::new())
    }

    /// How many there are.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether there are none.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The text with this number; `None` for number 0 and for numbers that do not exist.
    #[must_use]
    pub fn text(&self, index: StringIndex) -> Option<&str> {
        let place = usize::from(index.0).checked_sub(1)?;
        self.0.get(place).map(SiiString::as_str)
    }

    /// The texts in order, number 1 first.
    pub fn iter(&self) -> impl Iterator<Item = &SiiString> {
        self.0.iter()
    }

    /// Adds a text and tells its number.
    ///
    /// # Errors
    /// [`StringsError::TooMany`] when 255 are there.
    pub fn push(&mut self, text: SiiString) -> Result<StringIndex, StringsError> {
        let number = u8::try_from(self.0.len() + 1).map_err(|_| StringsError::TooMany)?;
        self.0.push(text);
        Ok(StringIndex(number))
    }

    /// The number of this text, which is added when it is not there yet. An empty text is number
    /// 0, none.
    ///
    /// # Errors
    /// [`StringsError`] when it is too long or no number is left.
    pub fn intern(&mut self, text: &str) -> Result<StringIndex, StringsError> {
        if text.is_empty() {
            return Ok(StringIndex::NONE);
        }
        let known = self.0.iter().zip(1..=u8::MAX).find(|(known, _)| known.as_str() == text);
        match known {
            Some((_, number)) => Ok(StringIndex(number)),
            None => self.push(SiiString::new(text)?),
        }
    }

    /// The texts in the data of a category, how many it announced, and how many bytes are left
    /// behind the last.
    pub(crate) fn parse(data: &[u8]) -> Parsed {
        let Some((&announced, mut rest)) = data.split_first() else {
            return Parsed { strings: Self::new(), announced: 0, left: 0 };
        };
        let mut strings = Vec::with_capacity(usize::from(announced));
        for _ in 0..announced {
            let Some((&len, behind)) = rest.split_first() else { break };
            let Some((bytes, behind)) = behind.split_at_checked(usize::from(len)) else { break };
            strings.push(SiiString::from_bytes(bytes));
            rest = behind;
        }
        Parsed { strings: Self(strings), announced, left: rest.len() }
    }

    /// Appends count and texts; padding is the image's matter.
    pub(crate) fn build(&self, into: &mut Vec<u8>) {
        into.push(u8::try_from(self.0.len()).unwrap_or(u8::MAX));
        for string in &self.0 {
            let bytes = string.bytes();
            into.push(u8::try_from(bytes.len()).unwrap_or(u8::MAX));
            into.extend_from_slice(&bytes);
        }
    }
}

/// What [`Strings::parse`] found.
pub(crate) struct Parsed {
    pub(crate) strings: Strings,
    pub(crate) announced: u8,
    pub(crate) left: usize,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_start_at_one_and_zero_is_none() {
        let mut strings = Strings::new();
        assert_eq!(strings.intern("EL2004"), Ok(StringIndex(1)));
        assert_eq!(strings.intern("DigOut"), Ok(StringIndex(2)));
        assert_eq!(strings.intern("EL2004"), Ok(StringIndex(1)));
        assert_eq!(strings.intern(""), Ok(StringIndex::NONE));
        assert_eq!(strings.text(StringIndex(1)), Some("EL2004"));
        assert_eq!(strings.text(StringIndex(0)), None);
        assert_eq!(strings.text(StringIndex(3)), None);
    }

    #[test]
    fn latin_1_is_readable_and_goes_back_as_it_came() {
        let parsed = Strings::parse(&[1, 4, b'K', 0xF6, b'p', b'f', 0xFF]);
        assert_eq!(parsed.strings.text(StringIndex(1)), Some("Köpf"));
        assert_eq!(parsed.left, 1);
        let mut bytes = Vec::new();
        parsed.strings.build(&mut bytes);
        assert_eq!(bytes, [1, 4, b'K', 0xF6, b'p', b'f']);
    }

    #[test]
    fn a_text_that_runs_over_the_end_is_left_out() {
        let parsed = Strings::parse(&[3, 2, b'A', b'B', 9, b'C']);
        assert_eq!((parsed.strings.len(), parsed.announced), (1, 3));
        assert_eq!(Strings::parse(&[]).strings, Strings::new());
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        assert_eq!(SiiString::new(&"x".repeat(256)), Err(StringsError::TooLong { len: 256 }));
        let mut strings = Strings::new();
        for number in 1..=255 {
            assert_eq!(strings.intern(&number.to_string()), Ok(StringIndex(number)));
        }
        assert_eq!(strings.intern("one more"), Err(StringsError::TooMany));
    }
}
