//! Values of IDNs as people write them, by the attribute of the IDN: `1000`, `-1`, `50.5`, `0xC000`, `S-0-0051`, a text, lists.
//!
//! Reference: IEC 61800-7-204, attribute. The decimal places are applied, the conversion factor is not.

use linesman_proto::mailbox::soe::{DisplayFormat, Idn, SoeAttribute, ValueLength, VariableData};
use serde_json::Value;

use crate::command::sdo::value::{bytes, hex, number_value, printable, whole};
use crate::text::quantity::count;

/// A value for people and for programs; what is wrong with it, if its length is not what the attribute says.
pub(super) fn show(data: &[u8], attribute: Option<SoeAttribute>) -> (String, Value) {
    let Some(attribute) = attribute else { return (hex(data), Value::Null) };
    let wrong = |why: String| (format!("{} ({why})", hex(data)), Value::Null);
    match attribute.length() {
        ValueLength::Reserved => wrong("the attribute has a reserved length".to_owned()),
        ValueLength::Fixed(len) if data.len() != usize::from(len) => {
            wrong(format!("the attribute says {len} bytes"))
        }
        ValueLength::Fixed(_) => element(data, attribute),
        ValueLength::List(len) => match VariableData::parse(data) {
            None => wrong("it ends before the length that it says".to_owned()),
            Some(list) if attribute.format() == DisplayFormat::Text => text(list.bytes),
            Some(list) if !list.bytes.len().is_multiple_of(len.into()) => {
                wrong(format!("the attribute says a {}", attribute.length()))
            }
            Some(list) => {
                let elements = list.bytes.chunks(len.into());
                let shown = elements.map(|one| element(one, attribute));
                let (texts, values): (Vec<_>, Vec<_>) = shown.unzip();
                (texts.join(", "), Value::Array(values))
            }
        },
    }
}

/// A text: name, unit, or a value.
pub(super) fn text(data: &[u8]) -> (String, Value) {
    let shown =
        printable(data).unwrap_or_else(|| String::from_utf8_lossy(data).escape_debug().collect());
    (shown.clone(), Value::String(shown))
}

/// One number, or what else the format says.
fn element(data: &[u8], attribute: SoeAttribute) -> (String, Value) {
    let width = 2 * data.len();
    let unsigned = data.iter().rev().fold(0_u64, |number, byte| number << 8 | u64::from(*byte));
    let unused = 64_u32.saturating_sub(8 * data.len() as u32);
    let number = |number: i128| scaled(number, attribute.decimals());
    match attribute.format() {
        DisplayFormat::Binary => {
            let bits = 8 * data.len();
            let text = format!("0b{unsigned:0bits$b} (0x{unsigned:0width$X})");
            (text, number_value(unsigned.into()))
        }
        DisplayFormat::Hexadecimal => {
            (format!("0x{unsigned:0width$X}"), number_value(unsigned.into()))
        }
        DisplayFormat::Unsigned => number(unsigned.into()),
        DisplayFormat::Signed if unused < 64 => {
            number(((unsigned << unused).cast_signed() >> unused).into())
        }
        DisplayFormat::Idn if data.len() == 2 => {
            let idn = Idn(unsigned as u16).to_string();
            (idn.clone(), Value::String(idn))
        }
        DisplayFormat::Float if data.len() == 4 => {
            let number = f32::from_bits(unsigned as u32);
            let value = number.to_string().parse().ok().and_then(serde_json::Number::from_f64);
            (number.to_string(), value.map_or(Value::Null, Value::Number))
        }
        DisplayFormat::Float if data.len() == 8 => {
            let number = f64::from_bits(unsigned);
            let value = serde_json::Number::from_f64(number);
            (number.to_string(), value.map_or(Value::Null, Value::Number))
        }
        DisplayFormat::Text => text(data),
        DisplayFormat::Signed
        | DisplayFormat::Idn
        | DisplayFormat::Float
        | DisplayFormat::Reserved => (hex(data), Value::Null),
    }
}

/// A number with its decimal places.
fn scaled(number: i128, decimals: u8) -> (String, Value) {
    if decimals == 0 {
        return (number.to_string(), number_value(number));
    }
    let unit = 10_i128.pow(decimals.into());
    let (sign, size) = (if number < 0 { "-" } else { "" }, number.abs());
    let (whole, rest) = (size / unit, size % unit);
    let text = format!("{sign}{whole}.{rest:0width$}", width = usize::from(decimals));
    let value = text.parse().ok().and_then(serde_json::Number::from_f64);
    (text, value.map_or(Value::Null, Value::Number))
}

/// The bytes of a value that is to be written; else what was expected.
pub(super) fn parse(text: &str, attribute: SoeAttribute) -> Result<Vec<u8>, String> {
    match attribute.length() {
        ValueLength::Reserved => Err(format!(
            "`{text}`: the attribute of this IDN has a reserved length; give the bytes with --raw"
        )),
        ValueLength::Fixed(len) => parse_element(text, len, attribute),
        ValueLength::List(len) => {
            let list = match attribute.format() {
                DisplayFormat::Text => text.as_bytes().to_vec(),
                DisplayFormat::Reserved => {
                    bytes(text).ok_or_else(|| format!("`{text}`: expected bytes: 01 02 FF"))?
                }
                DisplayFormat::Binary
                | DisplayFormat::Unsigned
                | DisplayFormat::Signed
                | DisplayFormat::Hexadecimal
                | DisplayFormat::Idn
                | DisplayFormat::Float => {
                    let elements = text.split([',', ' ']).filter(|one| !one.is_empty());
                    let elements = elements.map(|one| parse_element(one, len, attribute));
                    elements.collect::<Result<Vec<_>, _>>()?.concat()
                }
            };
            let most = u16::try_from(list.len()).unwrap_or(u16::MAX);
            let data = VariableData { most, bytes: &list }.to_bytes();
            data.ok_or_else(|| format!("{} bytes: a list has 65,535 at most", list.len()))
        }
    }
}

fn parse_element(text: &str, len: u8, attribute: SoeAttribute) -> Result<Vec<u8>, String> {
    let size = usize::from(len);
    let bits = 8 * u32::from(len);
    let wrong = |expected: &str| Err(format!("`{text}`: expected {expected}"));
    let (least, most) = match attribute.format() {
        DisplayFormat::Signed => (-(1_i128 << (bits - 1)), (1_i128 << (bits - 1)) - 1),
        DisplayFormat::Binary
        | DisplayFormat::Unsigned
        | DisplayFormat::Hexadecimal
        | DisplayFormat::Idn => (0, (1_i128 << bits) - 1),
        DisplayFormat::Float => {
            return match (text.parse::<f64>(), len) {
                (Ok(number), 4) => Ok((number as f32).to_le_bytes().to_vec()),
                (Ok(number), 8) => Ok(number.to_le_bytes().to_vec()),
                (Ok(_) | Err(_), _) => wrong("a number with 4 or 8 bytes"),
            };
        }
        DisplayFormat::Text | DisplayFormat::Reserved => {
            let is_text = attribute.format() == DisplayFormat::Text;
            let data = if is_text { Some(text.as_bytes().to_vec()) } else { bytes(text) };
            return match data.filter(|data| data.len() == size) {
                Some(data) => Ok(data),
                None => wrong(&format!("{len} bytes")),
            };
        }
    };
    if attribute.format() == DisplayFormat::Idn
        && let Some(idn) = Idn::from_text(text)
    {
        return match len {
            2 => Ok(idn.0.to_le_bytes().to_vec()),
            _ => wrong("a whole number"),
        };
    }
    let decimals = attribute.decimals();
    let number = match unscaled(text, decimals) {
        Some(number) => number,
        None if decimals == 0 => return wrong("a whole number"),
        None => {
            let places = count(decimals.into(), "decimal place");
            return wrong(&format!("a number with {places} at most"));
        }
    };
    if !(least..=most).contains(&number) {
        let (least, most) = (scaled(least, decimals).0, scaled(most, decimals).0);
        return wrong(&format!("{least} to {most}"));
    }
    Ok(number.to_le_bytes()[..size].to_vec())
}

/// The number without its decimal places: 505 of `50.5` with one.
fn unscaled(text: &str, decimals: u8) -> Option<i128> {
    // Hexadecimal and binary numbers are those of the line.
    let has_prefix = ["0x", "0X", "0b", "0B"].iter().any(|prefix| text.starts_with(prefix));
    if decimals == 0 || has_prefix {
        return whole(text);
    }
    let (sign, digits) = match text.strip_prefix('-') {
        Some(digits) => (-1, digits),
        None => (1, text),
    };
    let (before, after) = digits.split_once('.').unwrap_or((digits, ""));
    let are_digits = |text: &str| text.bytes().all(|digit| digit.is_ascii_digit());
    if before.is_empty()
        || before.len() > 20
        || after.len() > usize::from(decimals)
        || !are_digits(before)
        || !are_digits(after)
    {
        return None;
    }
    let digits = format!("{before}{after:0<width$}", width = usize::from(decimals));
    digits.parse::<i128>().ok().map(|number| sign * number)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ValueLength::{Fixed, List};

    fn attribute(length: ValueLength, format: DisplayFormat, decimals: u8) -> SoeAttribute {
        SoeAttribute::new(length, format, decimals)
    }

    #[test]
    fn values_become_bytes_and_back() {
        let rows: [(&str, SoeAttribute, &[u8], &str); 13] = [
            ("1000", attribute(Fixed(4), DisplayFormat::Unsigned, 0), &[0xE8, 3, 0, 0], "1000"),
            ("-1", attribute(Fixed(2), DisplayFormat::Signed, 0), &[0xFF, 0xFF], "-1"),
            ("50.5", attribute(Fixed(2), DisplayFormat::Unsigned, 1), &[0xF9, 1], "50.5"),
            ("50", attribute(Fixed(2), DisplayFormat::Unsigned, 1), &[0xF4, 1], "50.0"),
            (
                "-0.02",
                attribute(Fixed(4), DisplayFormat::Signed, 3),
                &[0xEC, 0xFF, 0xFF, 0xFF],
                "-0.020",
            ),
            ("0xC000", attribute(Fixed(2), DisplayFormat::Hexadecimal, 0), &[0, 0xC0], "0xC000"),
            (
                "0b101",
                attribute(Fixed(2), DisplayFormat::Binary, 0),
                &[5, 0],
                "0b0000000000000101 (0x0005)",
            ),
            ("S-0-0051", attribute(Fixed(2), DisplayFormat::Idn, 0), &[51, 0], "S-0-0051"),
            ("2.5", attribute(Fixed(4), DisplayFormat::Float, 0), &[0, 0, 0x20, 0x40], "2.5"),
            (
                "S-0-0135, S-0-0051",
                attribute(List(2), DisplayFormat::Idn, 0),
                &[4, 0, 4, 0, 135, 0, 51, 0],
                "S-0-0135, S-0-0051",
            ),
            ("lift", attribute(List(1), DisplayFormat::Text, 0), b"\x04\0\x04\0lift", "lift"),
            (
                "1 -2",
                attribute(List(2), DisplayFormat::Signed, 0),
                &[4, 0, 4, 0, 1, 0, 0xFE, 0xFF],
                "1, -2",
            ),
            ("", attribute(List(2), DisplayFormat::Signed, 0), &[0; 4], ""),
        ];
        for (text, attribute, data, shown) in rows {
            assert_eq!(parse(text, attribute).as_deref(), Ok(data), "{text}");
            assert_eq!(show(data, Some(attribute)).0, shown, "{text}");
        }
    }

    #[test]
    fn what_does_not_fit_is_refused_with_its_range() {
        for (text, attribute, words) in [
            ("65536", attribute(Fixed(2), DisplayFormat::Unsigned, 0), "0 to 65535"),
            ("-32769", attribute(Fixed(2), DisplayFormat::Signed, 0), "-32768 to 32767"),
            ("6553.6", attribute(Fixed(2), DisplayFormat::Unsigned, 1), "0.0 to 6553.5"),
            ("1.25", attribute(Fixed(2), DisplayFormat::Unsigned, 1), "1 decimal place at most"),
            ("1.5", attribute(Fixed(2), DisplayFormat::Unsigned, 0), "a whole number"),
            ("x", attribute(Fixed(4), DisplayFormat::Float, 0), "a number"),
            ("1", attribute(ValueLength::Reserved, DisplayFormat::Unsigned, 0), "--raw"),
            ("S-0-0001, x", attribute(List(2), DisplayFormat::Idn, 0), "`x`: expected a whole"),
        ] {
            let error = parse(text, attribute).unwrap_err();
            assert!(error.contains(words), "{error}");
        }
    }

    #[test]
    fn value_of_a_length_that_does_not_fit_is_shown_as_bytes_with_the_reason() {
        for (data, attribute, words) in [
            (&[1, 2, 3][..], attribute(Fixed(4), DisplayFormat::Signed, 0), "says 4 bytes"),
            (&[1], attribute(ValueLength::Reserved, DisplayFormat::Signed, 0), "reserved length"),
            (&[200, 0, 0, 0, 1], attribute(List(2), DisplayFormat::Idn, 0), "ends before"),
            (&[3, 0, 3, 0, 1, 2, 3], attribute(List(2), DisplayFormat::Idn, 0), "2 bytes each"),
        ] {
            let (text, value) = show(data, Some(attribute));
            assert!(text.contains(words), "{text}");
            assert_eq!(value, Value::Null);
        }
    }
}
