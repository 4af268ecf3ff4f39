//! Bytes as programs print them.

use super::text::hex;

/// More are no register that anybody prints.
const MOST: usize = 1024;

/// Bytes in hexadecimal (`00 1f`, `0x00 0x1f`, `001f`, `[00, 1f]`), in decimal (`[0, 31]`), or as Python writes them
/// (`b'\x00\x1f'`). Numbers in brackets that are not all of two digits are decimal.
pub(super) fn read(text: &str) -> Option<Vec<u8>> {
    let text = text.trim();
    let bytes = python(text).or_else(|| {
        let bare = text
            .trim_start_matches("bytearray(")
            .trim_matches(['[', ']', '(', ')', '{', '}', '"', '\'', ' ', ',']);
        listed(bare, text != bare).or_else(|| joined(bare))
    })?;
    (!bytes.is_empty() && bytes.len() <= MOST).then_some(bytes)
}

/// `00 1f` or `0x00, 0x1f`; in brackets also `0, 31`.
fn listed(text: &str, has_brackets: bool) -> Option<Vec<u8>> {
    let words: Vec<&str> =
        text.split([' ', ',', ';', '\t']).filter(|word| !word.is_empty()).collect();
    let is_prefixed = words.iter().all(|word| word.starts_with("0x") || word.starts_with("0X"));
    let is_pairs = words.iter().all(|word| word.len() == 2);
    let byte = |word: &&str| match is_prefixed || is_pairs {
        true => u8::try_from(hex(word)?).ok(),
        false if has_brackets => word.parse().ok(),
        false => None,
    };
    words.iter().map(byte).collect()
}

/// `001f`.
fn joined(text: &str) -> Option<Vec<u8>> {
    let digits = text.strip_prefix("0x").unwrap_or(text);
    let is_whole = digits.len() > 2 && digits.len().is_multiple_of(2) && digits.is_ascii();
    let pairs = || (0..digits.len()).step_by(2).filter_map(|at| digits.get(at..at + 2));
    is_whole.then(|| pairs().map(|pair| u8::from_str_radix(pair, 16).ok()).collect())?
}

/// `b'\x00A'`.
fn python(text: &str) -> Option<Vec<u8>> {
    let at = text.find("b'").or_else(|| text.find("b\""))?;
    let rest = text.get(at + 1..)?;
    let quote = rest.chars().next()?;
    let inside = rest.get(1..)?.trim_end_matches([')', ',', ' ']).strip_suffix(quote)?;
    let mut bytes = Vec::new();
    let mut letters = inside.chars();
    while let Some(letter) = letters.next() {
        let byte = match letter {
            '\\' => match letters.next()? {
                'x' => {
                    let digits: String = letters.by_ref().take(2).collect();
                    u8::from_str_radix(&digits, 16).ok()?
                }
                't' => b'\t',
                'n' => b'\n',
                'r' => b'\r',
                other => u8::try_from(other).ok()?,
            },
            letter => u8::try_from(letter).ok().filter(u8::is_ascii)?,
        };
        bytes.push(byte);
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_read_in_every_form() {
        for text in [
            "00 1f 41",
            "0x00 0x1F 0x41",
            "001f41",
            "0x001f41",
            "[00, 1f, 41]",
            "[0, 31, 65]",
            "[0x0, 0x1f, 0x41]",
            "{0x00, 0x1f, 0x41}",
            "b'\\x00\\x1fA'",
            "bytearray(b'\\x00\\x1fA')",
            "(0, 31, 65)",
        ] {
            assert_eq!(read(text), Some(vec![0x00, 0x1F, 0x41]), "{text}");
        }
        assert_eq!(read("b'\\t\\\\\\''"), Some(vec![9, b'\\', b'\'']));
        for text in ["", "[]", "0 31 65", "none", "0x", "[256]", "b'\\xg0'", "00 1f 4", "1f4"] {
            assert_eq!(read(text), None, "{text}");
        }
    }
}
