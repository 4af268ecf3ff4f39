//! Bytes as people paste them: hex with or without spaces, of C, Python, Rust.

/// Pasted bytes.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Bytes {
    /// The bytes, in the order of the line.
    pub(super) data: Vec<u8>,
    /// The text ends in `…`: there was more.
    pub(super) cut: bool,
    /// They were written byte by byte, so that they cannot be one number.
    pub(super) apart: bool,
}

/// More bytes are no message: a mailbox holds 1486 at most.
const MOST: usize = 2048;

/// The bytes of a text; `None` for what is no run of bytes.
pub(super) fn parse(text: &str) -> Option<Bytes> {
    let text = text.trim();
    let open = text.trim_end_matches(['…', '.']);
    let cut = open.len() < text.len() && (text.ends_with('…') || text.ends_with(".."));
    let text = if cut { open.trim() } else { text };
    let (data, apart) = python(text)
        .or_else(|| decimal(text))
        .map(|data| (data, true))
        .or_else(|| hexadecimal(text))?;
    (!data.is_empty() && data.len() <= MOST).then_some(Bytes { data, cut, apart })
}

/// `00 E0 21 1C`, `00E0211C`, `0x00, 0xE0`, `{0x00, 0xE0}`, `00-E0`, `00:E0`, `0000: 00 e0`.
fn hexadecimal(text: &str) -> Option<(Vec<u8>, bool)> {
    let inner = text.trim_matches(['{', '}', '[', ']', '(', ')']);
    // The text column of a dump.
    let inner = inner.split('|').next().unwrap_or_default();
    let prefixed = |word: &str| word.starts_with("0x") || word.starts_with("0X");
    let marked: Vec<&str> = inner
        .split([' ', ',', ';', ':', '-', '\t', '\n'])
        .filter(|word| !word.is_empty())
        .collect();
    let mut words: Vec<&str> =
        marked.iter().map(|&word| if prefixed(word) { &word[2..] } else { word }).collect();
    // The offset in front of a dump.
    if words.len() > 2 && words[0].len() == 8 && words[1..].iter().all(|word| word.len() == 2) {
        words.remove(0);
    }
    let apart = words.len() > 1;
    // `0x0` of a list is a byte, too; letters alone are none.
    let may_be_short = apart && marked.iter().all(|word| prefixed(word));
    let is_byte = |word: &&str| may_be_short && word.len() == 1 || word.len().is_multiple_of(2);
    if words.is_empty() || !words.iter().all(is_byte) {
        return None;
    }
    let mut data = Vec::new();
    for word in &words {
        let digits = word.as_bytes();
        if !digits.iter().all(u8::is_ascii_hexdigit) {
            return None;
        }
        for pair in digits.chunks(2) {
            data.push(u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok()?);
        }
    }
    Some((data, apart && words.iter().all(|word| word.len() <= 2)))
}

/// `[0, 224, 33, 28]`, as lists of numbers are printed.
fn decimal(text: &str) -> Option<Vec<u8>> {
    let inner = text.strip_prefix('[')?.strip_suffix(']')?;
    let data: Option<Vec<u8>> = inner.split(',').map(|word| word.trim().parse().ok()).collect();
    // Pairs of digits throughout are rather hexadecimal.
    data.filter(|_| inner.split(',').any(|word| word.trim().len() != 2))
}

/// `b'\x00\xe0!\x1c'`, as Python prints bytes.
fn python(text: &str) -> Option<Vec<u8>> {
    let body = text.strip_prefix('b')?;
    let quote = body.chars().next().filter(|quote| matches!(quote, '\'' | '"'))?;
    let body = body.strip_prefix(quote)?;
    let body = body.strip_suffix(quote).unwrap_or(body);
    let mut data = Vec::new();
    let mut letters = body.chars();
    while let Some(letter) = letters.next() {
        if letter != '\\' {
            data.push(u8::try_from(letter).ok()?);
            continue;
        }
        data.push(match letters.next()? {
            'x' => {
                let digits: String = letters.by_ref().take(2).collect();
                u8::from_str_radix(&digits, 16).ok()?
            }
            't' => b'\t',
            'n' => b'\n',
            'r' => b'\r',
            quoted @ ('\\' | '\'' | '"') => quoted as u8,
            _ => return None,
        });
    }
    Some(data)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_read_in_all_forms() {
        let expected = [0x00, 0xE0, 0x21, 0x1C];
        for text in [
            "00E0211C",
            "0x00E0211C",
            "00 e0 21 1c",
            "0x00 0xE0 0x21 0x1C",
            "{0x00, 0xe0, 0x21, 0x1c}",
            "[0x0, 0xe0, 0x21, 0x1c]",
            "00-E0-21-1C",
            "00:E0:21:1C",
            "[0, 224, 33, 28]",
            r"b'\x00\xe0!\x1c'",
            r#"b"\x00\xe0!\x1c""#,
            "00E0 211C",
            "00000000  00 e0 21 1c  |..!.|",
        ] {
            assert_eq!(parse(text).map(|bytes| bytes.data), Some(expected.to_vec()), "{text}");
        }
        let cut = parse("00E0211C…").unwrap();
        assert_eq!((cut.data.len(), cut.cut, cut.apart), (4, true, false));
        assert!(parse("00 E0 ...").unwrap().cut);
    }

    #[test]
    fn what_is_no_run_of_bytes_is_none() {
        for text in [
            "",
            "…",
            "0x",
            "00E",
            "hello",
            "a b c",
            "[1, 2, 300]",
            "b'",
            r"b'\q'",
            "{}",
            "- -",
            "[]",
        ] {
            assert_eq!(parse(text).filter(|bytes| !bytes.data.is_empty()), None, "{text}");
        }
        assert_eq!(parse(&"00".repeat(MOST + 1)), None);
    }
}
