//! Values as device descriptions write them.
//!
//! Reference: ETG.2000, HexDecValue: `#x1A00`, or decimal.

/// A number: decimal, `#x1A00`, or `0x1A00`, as some tools write it.
pub(crate) fn number<T: TryFrom<i64>>(text: &str) -> Result<T, String> {
    let text = text.trim();
    let (minus, digits) = match text.strip_prefix('-') {
        Some(rest) => (true, rest),
        None => (false, text.strip_prefix('+').unwrap_or(text)),
    };
    let hex = ["#x", "#X", "0x", "0X"].iter().find_map(|prefix| digits.strip_prefix(prefix));
    let value = match hex {
        Some(hex) => i64::from_str_radix(hex, 16),
        None => digits.parse(),
    };
    // A sign has gone already; what is left to fail is a second one, and what is no digit.
    let value = value.ok().filter(|value| *value >= 0);
    let value = value.map(|value| if minus { -value } else { value });
    value
        .and_then(|value| T::try_from(value).ok())
        .ok_or_else(|| format!("\"{text}\", expected a number in range, decimal or #x…"))
}

/// Yes or no.
pub(crate) fn flag(text: &str) -> Result<bool, String> {
    match text.trim() {
        "1" | "true" | "True" | "TRUE" => Ok(true),
        "0" | "false" | "False" | "FALSE" | "" => Ok(false),
        other => Err(format!("\"{other}\", expected 0, 1, false or true")),
    }
}

/// Bytes, two digits each; white space between them does not count.
pub(crate) fn bytes(text: &str) -> Result<Vec<u8>, String> {
    let digits: Vec<u32> = text
        .chars()
        .filter(|letter| !letter.is_whitespace())
        .map(|letter| letter.to_digit(16))
        .collect::<Option<_>>()
        .ok_or_else(|| format!("\"{}\", expected hexadecimal digits", shortened(text)))?;
    if !digits.len().is_multiple_of(2) {
        return Err(format!("{} hexadecimal digits, expected two for each byte", digits.len()));
    }
    Ok(digits.chunks(2).map(|pair| (pair[0] << 4 | pair[1]) as u8).collect())
}

/// The beginning of a text, for messages.
pub(crate) fn shortened(text: &str) -> String {
    const LETTERS: usize = 40;
    let mut short: String = text.trim().chars().take(LETTERS).collect();
    if text.trim().chars().count() > LETTERS {
        short.push('…');
    }
    short
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_decimal_or_hexadecimal() {
        for (text, value) in
            [("070", 70), ("#x1a00", 0x1A00), ("0X10", 16), (" -2000 ", -2000), ("+5", 5)]
        {
            assert_eq!(number::<i32>(text), Ok(value), "{text}");
        }
        assert_eq!(number::<u32>("#xE0000001"), Ok(0xE000_0001));
        for text in ["", "-", "--5", "#x", "1.5", "12h", "-1", "256"] {
            assert!(number::<u8>(text).is_err(), "{text}");
        }
    }

    #[test]
    fn bytes_are_pairs_of_digits() {
        assert_eq!(bytes("000D\t\n0a"), Ok(vec![0, 13, 10]));
        assert!(bytes("000").is_err());
        assert!(bytes("0x00").is_err());
    }
}
