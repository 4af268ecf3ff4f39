//! Numbers as people write them, and what they may be: `0x1D`, `001B`, `1Bh`, `16#1B`, `27`.

/// A number, read in one base.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Number {
    /// Its value.
    pub(super) value: u64,
    /// Number of digits as written.
    pub(super) digits: usize,
    /// It was read in decimal.
    pub(super) decimal: bool,
}

impl Number {
    /// The value, if it has 16 bits.
    pub(super) fn word(self) -> Option<u16> {
        u16::try_from(self.value).ok()
    }

    /// The value, if it has 32 bits.
    pub(super) fn long(self) -> Option<u32> {
        u32::try_from(self.value).ok()
    }

    /// Tells if it has more digits than a 16-bit number.
    pub(super) const fn is_long(self) -> bool {
        !self.decimal && self.digits > 4 || self.value > 0xFFFF
    }
}

/// Digits of a number in decimal that are a number of Python or of an integer variable, as abort codes
/// come: 100728832 is 0x06010000.
const DECIMAL_DIGITS: usize = 9;

/// The ways to read a number, the more likely first; none for what is no number.
///
/// A prefix, a suffix or a letter makes it hexadecimal, and so does a leading 0: people leave the
/// prefix away from codes. Other digits may be either: short ones rather decimal, those with the
/// length of an index or of an abort code rather not.
pub(super) fn readings(word: &str) -> Vec<Number> {
    if let Some(digits) = marked(word) {
        return read(digits, 16).into_iter().collect();
    }
    let is_plain = !word.is_empty() && word.bytes().all(|digit| digit.is_ascii_digit());
    let hexadecimal = read(word, 16);
    if !is_plain {
        // `dead` and `fade` are words; codes without a prefix have a digit.
        let has_digit = word.bytes().any(|digit| digit.is_ascii_digit());
        return hexadecimal.into_iter().filter(|_| has_digit).collect();
    }
    let decimal = read(word, 10);
    let both: Vec<Option<Number>> = match word.len() {
        1 => vec![decimal],
        _ if word.starts_with('0') => vec![hexadecimal],
        // Five digits are a word in decimal rather than a code without its leading zeros.
        0..=3 | 5 => vec![decimal, hexadecimal],
        4..DECIMAL_DIGITS => vec![hexadecimal, decimal],
        _ => vec![decimal],
    };
    both.into_iter().flatten().collect()
}

/// The digits of what is marked as hexadecimal: `0x1D`, `1Dh`, `16#1D`, `#x1D`, `$1D`.
fn marked(word: &str) -> Option<&str> {
    let lower = word.get(..2).map(str::to_ascii_lowercase);
    if lower.as_deref() == Some("0x") || lower.as_deref() == Some("#x") {
        return word.get(2..);
    }
    let suffixed = || {
        let digits = word.strip_suffix(['h', 'H'])?;
        digits.starts_with(|first: char| first.is_ascii_digit()).then_some(digits)
    };
    word.strip_prefix("16#").or_else(|| word.strip_prefix('$')).or_else(suffixed)
}

fn read(digits: &str, base: u32) -> Option<Number> {
    let digits: String = digits.chars().filter(|digit| *digit != '_').collect();
    // A sign is none of the digits, though the standard library takes one.
    if digits.is_empty() || !digits.chars().all(|digit| digit.is_digit(base)) {
        return None;
    }
    let value = u64::from_str_radix(&digits, base).ok()?;
    Some(Number { value, digits: digits.len(), decimal: base == 10 })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(word: &str) -> Vec<u64> {
        readings(word).into_iter().map(|number| number.value).collect()
    }

    #[test]
    fn numbers_are_read_in_the_more_likely_base_first() {
        for (word, expected) in [
            ("0x1B", vec![0x1B]),
            ("0X001b", vec![0x1B]),
            ("1Bh", vec![0x1B]),
            ("16#1B", vec![0x1B]),
            ("#x1B", vec![0x1B]),
            ("$1B", vec![0x1B]),
            ("1B", vec![0x1B]),
            ("001B", vec![0x1B]),
            ("0130", vec![0x130]),
            ("06010000", vec![0x0601_0000]),
            ("0x0601_0000", vec![0x0601_0000]),
            ("27", vec![27, 0x27]),
            ("8", vec![8]),
            ("1018", vec![0x1018, 1018]),
            ("34321", vec![34321, 0x34321]),
            ("6090030", vec![0x0609_0030, 6_090_030]),
            ("100728832", vec![0x0601_0000]),
            ("0", vec![0]),
        ] {
            assert_eq!(values(word), expected, "{word}");
        }
    }

    #[test]
    fn what_is_no_number_is_none() {
        for word in
            ["", "dead", "0x", "-1", "+1", "1.5", "0xG", "x", "99999999999999999999999", "1_", "ä1"]
        {
            let found = values(word);
            assert!(found.is_empty() || word == "1_", "{word}: {found:?}");
        }
    }
}
