//! Text of other tools as lines and cells: encodings, tables, numbers as people and programs write them.

use std::borrow::Cow;

use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1252};

use linesman_proto::port::Port;

/// A line of the text, without what terminals and mail add to it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Line<'t> {
    /// Its number, from 1.
    pub(super) no: usize,
    /// What it says; blanks at its begin are kept.
    pub(super) text: Cow<'t, str>,
}

impl Line<'_> {
    /// Without blanks around it.
    pub(super) fn trimmed(&self) -> &str {
        self.text.trim()
    }

    /// Whether it says nothing at all.
    pub(super) fn is_blank(&self) -> bool {
        let text = self.trimmed();
        text.is_empty()
            || text.starts_with("```")
            || text.chars().all(|one| "-=*_#~|+".contains(one))
    }
}

/// The text of a file: UTF-8, UTF-16 with or without a mark, else the Windows code page for Western Europe.
#[must_use]
pub fn decode(bytes: &[u8]) -> Cow<'_, str> {
    if let Some((encoding, mark)) = Encoding::for_bom(bytes) {
        return encoding.decode_without_bom_handling(&bytes[mark..]).0;
    }
    if let Some(encoding) = utf_16(bytes) {
        return encoding.decode_without_bom_handling(bytes).0;
    }
    match std::str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        // A text that was cut in the midst of a letter is still UTF-8.
        Err(error) if error.error_len().is_none() => UTF_8.decode_without_bom_handling(bytes).0,
        Err(_) => WINDOWS_1252.decode_without_bom_handling(bytes).0,
    }
}

/// UTF-16 without a mark: every second byte of a text in Latin letters is 0.
fn utf_16(bytes: &[u8]) -> Option<&'static Encoding> {
    let head = &bytes[..bytes.len().min(512)];
    let zeros = |odd: usize| head.iter().skip(odd).step_by(2).filter(|byte| **byte == 0).count();
    let half = head.len() / 2;
    if half < 4 {
        return None;
    }
    match (zeros(0) * 4 >= half * 3, zeros(1) * 4 >= half * 3) {
        (true, false) => Some(UTF_16BE),
        (false, true) => Some(UTF_16LE),
        (true, true) | (false, false) => None,
    }
}

/// The lines of a text.
pub(super) fn lines(text: &str) -> Vec<Line<'_>> {
    let split = text.split('\n').enumerate();
    split.map(|(at, line)| Line { no: at + 1, text: cleaned(line) }).collect()
}

/// Without carriage returns, colours of terminals, signs of quoted mail, and odd blanks.
fn cleaned(line: &str) -> Cow<'_, str> {
    let line = line.trim_end_matches(['\r', '\0']);
    let line = line.strip_prefix("> ").unwrap_or(line);
    let is_odd =
        |one: char| matches!(one, '\u{1b}' | '\u{a0}' | '\u{feff}' | '\r' | '\0' | '\u{2028}');
    if !line.contains(is_odd) {
        return Cow::Borrowed(line);
    }
    let mut clean = String::with_capacity(line.len());
    let mut letters = line.chars();
    while let Some(letter) = letters.next() {
        match letter {
            '\u{1b}' => {
                // A colour: ESC [ numbers m.
                for inside in letters.by_ref() {
                    if inside.is_ascii_alphabetic() {
                        break;
                    }
                }
            }
            '\u{a0}' | '\u{2028}' => clean.push(' '),
            '\u{feff}' | '\r' | '\0' => {}
            letter => clean.push(letter),
        }
    }
    Cow::Owned(clean)
}

/// The cells of a row: parted by tabs, semicolons, commas with quotes, bars, or two blanks.
pub(super) fn cells(text: &str) -> Vec<String> {
    let text = text.trim_end();
    let bare = text.trim().trim_matches('|');
    let cells = if text.contains('\t') {
        split(text, '\t')
    } else if text.trim_start().starts_with('|') {
        split(bare, '|')
    } else if text.matches(';').count() >= 2 {
        split(text, ';')
    } else if text.matches(',').count() >= 3 && !text.contains("  ") && !is_spaced_row(text) {
        split(text, ',')
    } else {
        split_blanks(text.trim())
    };
    cells.into_iter().map(|cell| cell.trim().trim_matches('"').trim().to_owned()).collect()
}

/// Whether a row begins with a number and a blank: then its commas are inside of a cell.
fn is_spaced_row(text: &str) -> bool {
    let mut words = text.split_whitespace();
    words.next().is_some_and(|word| word.parse::<u32>().is_ok())
}

fn split(text: &str, by: char) -> Vec<String> {
    let mut cells = vec![String::new()];
    let mut is_quoted = false;
    for letter in text.chars() {
        match letter {
            '"' => is_quoted = !is_quoted,
            letter if letter == by && !is_quoted => cells.push(String::new()),
            letter => {
                if let Some(cell) = cells.last_mut() {
                    cell.push(letter);
                }
            }
        }
    }
    cells
}

fn split_blanks(text: &str) -> Vec<String> {
    text.split("  ").map(str::trim).filter(|cell| !cell.is_empty()).map(str::to_owned).collect()
}

/// A whole number of a counter: decimal, also in groups of three, or hexadecimal after `0x`. Marks before it and
/// a second value in brackets behind it are left aside.
pub(super) fn count(text: &str) -> Option<u64> {
    let text = text.trim().trim_start_matches(['✓', '✔', '*', '+']).trim();
    let text = text.split(['(', '[']).next()?.trim();
    if let Some(digits) = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        return u64::from_str_radix(digits, 16).ok().filter(|_| is_digits(digits, 16));
    }
    if is_digits(text, 10) {
        return text.parse().ok();
    }
    let groups: Vec<&str> = text.split(['.', ',', ' ', '\'', '_']).collect();
    let (first, rest) = groups.split_first()?;
    let is_grouped = !rest.is_empty()
        && (1..=3).contains(&first.len())
        && rest.iter().all(|group| group.len() == 3)
        && groups.iter().all(|group| is_digits(group, 10));
    if is_grouped { groups.concat().parse().ok() } else { None }
}

fn is_digits(text: &str, radix: u32) -> bool {
    !text.is_empty() && text.chars().all(|one| one.is_digit(radix))
}

/// A number with a fraction, after a point or a comma.
pub(super) fn decimal(text: &str) -> Option<f64> {
    let text = text.trim();
    let number: f64 = text.parse().or_else(|_| text.replace(',', ".").parse()).ok()?;
    number.is_finite().then_some(number)
}

/// A hexadecimal number, with or without `0x`.
pub(super) fn hex(text: &str) -> Option<u64> {
    let text = text.trim();
    let digits = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")).unwrap_or(text);
    u64::from_str_radix(digits, 16).ok().filter(|_| is_digits(digits, 16))
}

/// The value behind `key:` on a line; `None` when the line is another one.
pub(super) fn value_of<'l>(line: &'l str, key: &str) -> Option<&'l str> {
    let rest = line.trim().strip_prefix(key)?.trim_start();
    Some(rest.strip_prefix(':')?.trim())
}

/// The number at the begin of a text, and what follows it.
pub(super) fn leading_number(text: &str) -> Option<(u64, &str)> {
    let end = text.find(|one: char| !one.is_ascii_digit()).unwrap_or(text.len());
    Some((text[..end].parse().ok()?, &text[end..]))
}

/// What stands between two marks, the first of each.
pub(super) fn between<'l>(text: &'l str, from: &str, to: &str) -> Option<&'l str> {
    let (_, rest) = text.split_once(from)?;
    Some(rest.split_once(to)?.0)
}

/// The type in a name such as `Term 5 (EL2008)`, where it looks like one.
pub(super) fn type_in(name: &str) -> Option<&str> {
    let inside = name.trim().strip_suffix(')')?.rsplit_once('(')?.1.trim();
    let has = |is: fn(char) -> bool| inside.chars().any(is);
    let is_type = has(|one| one.is_ascii_digit()) && has(|one| one.is_ascii_alphabetic());
    is_type.then_some(inside)
}

/// So many of something: `1 SubDevice`, `2 SubDevices`.
pub(super) fn so_many(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// A port by its number or letter.
pub(super) fn port(text: &str) -> Option<Port> {
    match text.trim() {
        "0" | "A" | "a" => Some(Port::A),
        "1" | "B" | "b" => Some(Port::B),
        "2" | "C" | "c" => Some(Port::C),
        "3" | "D" | "d" => Some(Port::D),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encodings_of_windows_are_read() {
        let text = "Größe\tOP\r\n";
        assert_eq!(decode(text.as_bytes()), text);
        let wide: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
        assert_eq!(decode(&wide), text, "without a mark");
        let marked: Vec<u8> = [0xFF, 0xFE].into_iter().chain(wide).collect();
        assert_eq!(decode(&marked), text);
        let big: Vec<u8> = text.encode_utf16().flat_map(u16::to_be_bytes).collect();
        assert_eq!(decode(&big), text);
        assert_eq!(decode(b"Gr\xF6\xDFe\tOP\r\n"), text, "Windows code page");
        assert_eq!(decode("ab\u{e4}".as_bytes().split_last().unwrap().1), "ab\u{fffd}");
        assert_eq!(decode(&[0, 0, 0, 0, 0, 0, 0, 0, 0, 0]), "\0\0\0\0\0\0\0\0\0\0");
    }

    #[test]
    fn colours_and_quotes_are_taken_off() {
        let read = lines("> \u{1b}[32m[ 1.5]\u{1b}[0m EtherCAT\u{a0}0: x\r\n\n");
        assert_eq!(read[0].text, "[ 1.5] EtherCAT 0: x");
        assert_eq!((read.len(), read[1].is_blank()), (3, true));
    }

    #[test]
    fn rows_are_split_by_what_parts_them() {
        let expected = ["1", "1001", "Term 1 (EK1100)", "OP", "0, 15 (3)"];
        for row in [
            "1\t1001\tTerm 1 (EK1100)\tOP\t0, 15 (3)",
            "1;1001;Term 1 (EK1100);OP;0, 15 (3)",
            "1;\"1001\";\"Term 1 (EK1100)\";OP;\"0, 15 (3)\"",
            "\"1\",\"1001\",\"Term 1 (EK1100)\",\"OP\",\"0, 15 (3)\"",
            "| 1 | 1001 | Term 1 (EK1100) | OP | 0, 15 (3) |",
            "1    1001   Term 1 (EK1100)   OP   0, 15 (3)",
        ] {
            assert_eq!(cells(row), expected, "{row}");
        }
    }

    #[test]
    fn counts_are_read_in_all_their_forms() {
        for (text, expected) in [
            ("125166", Some(125_166)),
            ("125.166", Some(125_166)),
            ("1,234,567", Some(1_234_567)),
            ("0x0012 (18)", Some(18)),
            ("0xA05", Some(0xA05)),
            ("✓ 0x0000", Some(0)),
            ("15 (18)", Some(15)),
            ("+ 1908", Some(1908)),
            ("--", None),
            ("", None),
            ("1.5", None),
            ("-3", None),
        ] {
            assert_eq!(count(text), expected, "{text}");
        }
        assert_eq!(
            (decimal("0,5"), decimal("-1.25"), decimal("nan")),
            (Some(0.5), Some(-1.25), None)
        );
        assert_eq!(
            (hex("001a"), hex("0x1B"), hex("  1d"), hex("g")),
            (Some(26), Some(27), Some(29), None)
        );
        assert_eq!(type_in("Term 5 (EL2008)"), Some("EL2008"));
        assert_eq!(type_in("Drive (left)"), None);
    }
}
