//! One message: its parameters, and its text with the parameters in it.

use linesman_link::unix_time::UnixTime;
use linesman_proto::mailbox::coe::diagnosis::{DiagnosisMessage, Parameter};

use crate::command::sdo::value::{hex, show};

/// From 1970 to 2000, where distributed clocks begin, in ns.
const EPOCH_2000: i128 = 946_684_800_000_000_000;

/// A time of the distributed clocks, RFC 3339.
pub(crate) fn system_time(ns: u64) -> Option<String> {
    UnixTime::from_nanos(EPOCH_2000 + i128::from(ns)).rfc3339()
}

/// What goes into a text.
#[derive(Clone, PartialEq, Debug)]
pub(crate) enum Value {
    Number(i128, usize),
    Text(String),
}

/// The parameters of a message.
pub(crate) fn values(message: &DiagnosisMessage<'_>, texts: &[(u16, String)]) -> Vec<Value> {
    message.parameters().map(|parameter| value(&parameter, texts)).collect()
}

fn value(parameter: &Parameter<'_>, texts: &[(u16, String)]) -> Value {
    match parameter {
        Parameter::Value(data_type, bytes) => {
            let (text, json) = show(bytes, Some(*data_type));
            let digits = json.as_i64().map(i128::from);
            let number = digits.or_else(|| json.as_str().and_then(|text| text.parse().ok()));
            match (number, json.as_bool()) {
                (Some(number), _) => Value::Number(number, bytes.len()),
                (None, Some(set)) => Value::Number(i128::from(set), 1),
                (None, None) => Value::Text(text.trim_matches('"').to_owned()),
            }
        }
        Parameter::Bytes(bytes) => Value::Text(hex(bytes)),
        Parameter::Text(bytes) => {
            Value::Text(String::from_utf8_lossy(bytes).trim_end_matches('\0').to_owned())
        }
        Parameter::WideText(bytes) => {
            let letters = bytes.as_chunks::<2>().0.iter().map(|two| u16::from_le_bytes(*two));
            let text = String::from_utf16_lossy(&letters.collect::<Vec<_>>());
            Value::Text(text.trim_end_matches('\0').to_owned())
        }
        Parameter::TextNumber(number) => Value::Text(
            texts
                .iter()
                .find(|(id, _)| id == number)
                .map_or_else(|| format!("text 0x{number:04X}"), |(_, text)| text.clone()),
        ),
    }
}

impl Value {
    /// For people.
    pub(crate) fn text(&self) -> String {
        match self {
            Self::Number(number, _) => number.to_string(),
            Self::Text(text) => text.clone(),
        }
    }
}

/// A text with `%d`, `%u`, `%x`, `%s`, `%f` and the like filled in, in order. What is missing stays
/// as it is written; what is left over is put behind.
pub(super) fn fill(pattern: &str, values: &[Value]) -> String {
    let mut values = values.iter();
    let mut text = String::new();
    let mut rest = pattern;
    while let Some(at) = rest.find('%') {
        text.push_str(&rest[..at]);
        let behind = &rest[at + 1..];
        let modifiers = behind
            .find(|c: char| !(c.is_ascii_digit() || "-+ #.lhz".contains(c)))
            .unwrap_or(behind.len());
        let kind = behind[modifiers..].chars().next();
        let len = modifiers + kind.map_or(0, char::len_utf8);
        match kind {
            Some('%') => text.push('%'),
            Some(
                kind @ ('d' | 'i' | 'u' | 'x' | 'X' | 's' | 'c' | 'f' | 'g' | 'e' | 'p' | 'b'),
            ) => match values.next() {
                Some(value) => text.push_str(&formatted(value, kind, &behind[..modifiers])),
                None => text.push_str(&rest[at..at + 1 + len]),
            },
            _ => text.push_str(&rest[at..at + 1 + len]),
        }
        rest = &behind[len..];
    }
    text.push_str(rest);
    let left: Vec<String> = values.map(Value::text).collect();
    if !left.is_empty() {
        text.push_str(&format!(" ({})", left.join(", ")));
    }
    text
}

fn formatted(value: &Value, kind: char, modifiers: &str) -> String {
    let Value::Number(number, bytes) = value else { return value.text() };
    // A negative number has as many digits as its type.
    let bits = (8 * *bytes as u32).min(64);
    let unsigned = if bits == 0 { 0 } else { (*number as u128 & ((1 << bits) - 1)) as u64 };
    let digits: String = modifiers.chars().filter(char::is_ascii_digit).collect();
    let width = digits.parse::<usize>().unwrap_or(0).min(32);
    match (kind, digits.starts_with('0')) {
        ('x', true) => format!("{unsigned:0width$x}"),
        ('X', true) => format!("{unsigned:0width$X}"),
        ('x' | 'p', _) => format!("{unsigned:x}"),
        ('X', _) => format!("{unsigned:X}"),
        ('b', _) => format!("{unsigned:b}"),
        ('u', _) => unsigned.to_string(),
        _ => number.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_go_into_the_text_in_order() {
        let number = |number, bytes| Value::Number(number, bytes);
        let text = |text: &str| Value::Text(text.to_owned());
        for (pattern, values, expected) in [
            (
                "Axis %d: following error %d",
                vec![number(2, 1), number(-7, 2)],
                "Axis 2: following error -7",
            ),
            (
                "Register 0x%04X = 0x%x",
                vec![number(0x30, 2), number(-1, 2)],
                "Register 0x0030 = 0xffff",
            ),
            ("%s at 100 %%", vec![text("load")], "load at 100 %"),
            ("no value", vec![number(5, 1)], "no value (5)"),
            ("%d of %d", vec![number(1, 1)], "1 of %d"),
            ("%u %lu", vec![number(-1, 1), number(3, 4)], "255 3"),
            ("%", vec![], "%"),
            ("100 %ä", vec![], "100 %ä"),
        ] {
            assert_eq!(fill(pattern, &values), expected, "{pattern}");
        }
    }
}
