//! Values of objects as people write them: `300`, `0x12C`, `-1`, `true`, `2.5`, `"save"`, `01 02 03`.
//!
//! Reference: ETG.1020, base data types. Bytes go over the line lowest first.

use linesman_proto::mailbox::coe::DataType;
use serde_json::Value;

/// A data type by its name in ESI files, or as programmers call it.
pub(crate) fn data_type(name: &str) -> Result<DataType, String> {
    let upper = name.to_ascii_uppercase();
    let name_of = match upper.as_str() {
        "BIT" => "BOOL",
        "U8" => "USINT",
        "U16" => "UINT",
        "U32" => "UDINT",
        "U64" => "ULINT",
        "I8" => "SINT",
        "I16" => "INT",
        "I32" => "DINT",
        "I64" => "LINT",
        "F32" | "FLOAT" => "REAL",
        "F64" | "DOUBLE" => "LREAL",
        "TEXT" => "STRING",
        "HEX" | "BYTES" => "OCTET_STRING",
        other => other,
    };
    DataType::from_name(name_of).ok_or_else(|| {
        format!(
            "`{name}`: no such data type; there are BOOL, USINT to ULINT (or u8 to u64), SINT to LINT \
             (i8 to i64), REAL, LREAL, STRING, OCTET_STRING (or hex), BITARR8 …"
        )
    })
}

/// How the values of a type are written.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Form {
    Bool,
    Unsigned(usize),
    Signed(usize),
    Real,
    LongReal,
    Text,
    WideText,
    Bytes,
}

fn form(data_type: DataType) -> Form {
    let name = data_type.name().unwrap_or_default();
    let bytes = data_type.bits().map(|bits| usize::from(bits).div_ceil(8));
    match (name, bytes) {
        ("BOOL", _) => Form::Bool,
        ("REAL", _) => Form::Real,
        ("LREAL", _) => Form::LongReal,
        ("STRING", _) => Form::Text,
        ("UNICODE_STRING", _) => Form::WideText,
        ("SINT" | "INT" | "DINT" | "LINT" | "INT24" | "INT40" | "INT48" | "INT56", Some(bytes)) => {
            Form::Signed(bytes)
        }
        (_, Some(bytes)) if bytes <= 8 => Form::Unsigned(bytes),
        _ => Form::Bytes,
    }
}

/// The bytes of a value of this type.
pub(crate) fn parse(text: &str, data_type: DataType) -> Result<Vec<u8>, String> {
    let wrong = |expected: &str| format!("`{text}`: expected {expected}, a value of {data_type}");
    match form(data_type) {
        Form::Bool => match text.to_ascii_lowercase().as_str() {
            "true" | "on" | "1" => Ok(vec![1]),
            "false" | "off" | "0" => Ok(vec![0]),
            _ => Err(wrong("true or false")),
        },
        Form::Unsigned(bytes) => {
            let number = whole(text).ok_or_else(|| wrong("a whole number"))?;
            let bits = data_type.bits().unwrap_or(64).min(64);
            let most = i128::from(u64::MAX >> (64 - u32::from(bits.max(1))));
            if !(0..=most).contains(&number) {
                return Err(wrong(&format!("0 to {most}")));
            }
            Ok(number.to_le_bytes()[..bytes].to_vec())
        }
        Form::Signed(bytes) => {
            let number = whole(text).ok_or_else(|| wrong("a whole number"))?;
            let most = i128::MAX >> (128 - 8 * bytes as u32);
            if !(-most - 1..=most).contains(&number) {
                return Err(wrong(&format!("{} to {most}", -most - 1)));
            }
            Ok(number.to_le_bytes()[..bytes].to_vec())
        }
        Form::Real => {
            let number: f32 = text.parse().map_err(|_| wrong("a number"))?;
            Ok(number.to_le_bytes().to_vec())
        }
        Form::LongReal => {
            let number: f64 = text.parse().map_err(|_| wrong("a number"))?;
            Ok(number.to_le_bytes().to_vec())
        }
        Form::Text => Ok(text.as_bytes().to_vec()),
        Form::WideText => Ok(text.encode_utf16().flat_map(u16::to_le_bytes).collect()),
        Form::Bytes => bytes(text).ok_or_else(|| wrong("bytes in hex, such as 01 02 FF")),
    }
}

/// The bytes of a number for an entry of so many bytes, when nothing else is known of it.
pub(crate) fn parse_sized(text: &str, size: usize) -> Result<Vec<u8>, String> {
    let number = whole(text).filter(|_| (1..=8).contains(&size)).ok_or_else(|| {
        format!("`{text}`: the SubDevice does not tell the data type of this entry, {size} bytes")
    })?;
    let bits = 8 * size as u32;
    let (least, most) = (-(1_i128 << (bits - 1)), (1_i128 << bits) - 1);
    if !(least..=most).contains(&number) {
        return Err(format!("`{text}`: does not fit into the {size} bytes of this entry"));
    }
    Ok(number.to_le_bytes()[..size].to_vec())
}

/// Number of 32 bits without a sign, for an option.
pub(crate) fn number(text: &str) -> Result<u32, String> {
    let number = whole(text).and_then(|number| u32::try_from(number).ok());
    number.ok_or_else(|| format!("`{text}`: expected a number up to 0xFFFFFFFF"))
}

/// `300`, `-1`, `0x12C`, `0b101`.
pub(crate) fn whole(text: &str) -> Option<i128> {
    let (negative, digits) = match text.strip_prefix('-') {
        Some(digits) => (true, digits),
        None => (false, text),
    };
    let number = match digits.get(..2).map(str::to_ascii_lowercase).as_deref() {
        Some("0x") => i128::from_str_radix(&digits[2..], 16),
        Some("0b") => i128::from_str_radix(&digits[2..], 2),
        _ if digits.starts_with('+') => return None,
        _ => digits.parse(),
    };
    number.ok().map(|number| if negative { -number } else { number })
}

/// `01 02 FF`, `0102FF`, `0x0102FF`: in the order of the line.
pub(crate) fn bytes(text: &str) -> Option<Vec<u8>> {
    let digits: String =
        text.trim_start_matches("0x").chars().filter(|letter| !" :,-".contains(*letter)).collect();
    // A prefix alone is a number that was left out.
    if (digits.is_empty() && !text.is_empty())
        || !digits.len().is_multiple_of(2)
        || !digits.bytes().all(|digit| digit.is_ascii_hexdigit())
    {
        return None;
    }
    (0..digits.len())
        .step_by(2)
        .map(|at| u8::from_str_radix(&digits[at..at + 2], 16).ok())
        .collect()
}

/// `01 02 FF`.
pub(crate) fn hex(data: &[u8]) -> String {
    data.iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>().join(" ")
}

/// A value for people and for programs. Of a type that does not fit its length, the bytes.
pub(crate) fn show(data: &[u8], data_type: Option<DataType>) -> (String, Value) {
    let shown = match data_type.map(form) {
        None => untyped(data),
        Some(Form::Bool) if data.len() == 1 => {
            let set = data[0] & 1 != 0;
            Some((set.to_string(), Value::Bool(set)))
        }
        Some(Form::Unsigned(bytes)) if data.len() == bytes => {
            let number = unsigned(data);
            let width = 2 * bytes;
            Some((format!("{number} (0x{number:0width$X})"), number_value(number.into())))
        }
        Some(Form::Signed(bytes)) if data.len() == bytes => {
            let shift = 64 - 8 * bytes as u32;
            let number = (unsigned(data) << shift) as i64 >> shift;
            Some((number.to_string(), number_value(number.into())))
        }
        Some(Form::Real) => data.try_into().ok().map(|four| {
            let number = f32::from_le_bytes(four);
            // As people write it: 0.1 and not 0.10000000149.
            let value =
                number.to_string().parse::<f64>().ok().and_then(serde_json::Number::from_f64);
            (number.to_string(), value.map_or(Value::Null, Value::Number))
        }),
        Some(Form::LongReal) => data.try_into().ok().map(|eight| {
            let number = f64::from_le_bytes(eight);
            let value = serde_json::Number::from_f64(number);
            (number.to_string(), value.map_or(Value::Null, Value::Number))
        }),
        Some(Form::Text) => {
            printable(data).map(|text| (format!("\"{text}\""), Value::String(text)))
        }
        Some(Form::WideText) => {
            let letters = data.as_chunks::<2>().0.iter().map(|two| u16::from_le_bytes(*two));
            let text = String::from_utf16_lossy(&letters.collect::<Vec<_>>());
            let text = text.trim_end_matches('\0').to_owned();
            Some((format!("\"{text}\""), Value::String(text)))
        }
        Some(Form::Bool | Form::Unsigned(_) | Form::Signed(_) | Form::Bytes) => None,
    };
    shown.unwrap_or_else(|| (hex(data), Value::Null))
}

fn untyped(data: &[u8]) -> Option<(String, Value)> {
    if matches!(data.len(), 1 | 2 | 4 | 8) {
        let (number, width) = (unsigned(data), 2 * data.len());
        return Some((format!("{number} (0x{number:0width$X})"), number_value(number.into())));
    }
    printable(data).map(|text| (format!("\"{text}\""), Value::String(text)))
}

/// Printable text, but for zeros at its end.
pub(crate) fn printable(data: &[u8]) -> Option<String> {
    let len = data.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
    let text = std::str::from_utf8(&data[..len]).ok()?;
    (!text.chars().any(char::is_control)).then(|| text.to_owned())
}

fn unsigned(data: &[u8]) -> u64 {
    data.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte))
}

/// Above 2^53 programs that read JSON lose digits: then it is a text.
pub(crate) fn number_value(number: i128) -> Value {
    const SAFE: i128 = 1 << 53;
    match i64::try_from(number) {
        Ok(small) if (-SAFE..=SAFE).contains(&number) => Value::from(small),
        _ => Value::String(number.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(text: &str, name: &str) -> Result<Vec<u8>, String> {
        parse(text, data_type(name).unwrap())
    }

    #[test]
    fn values_become_bytes_and_back() {
        let rows: [(&str, &str, &[u8], &str); 14] = [
            ("300", "UINT", &[0x2C, 1], "300 (0x012C)"),
            ("0x12C", "u16", &[0x2C, 1], "300 (0x012C)"),
            ("-1", "INT", &[0xFF, 0xFF], "-1"),
            ("-8388608", "INT24", &[0, 0, 0x80], "-8388608"),
            ("true", "BOOL", &[1], "true"),
            ("0", "BIT", &[0], "false"),
            ("2.5", "REAL", &[0, 0, 0x20, 0x40], "2.5"),
            ("-0.1", "LREAL", &(-0.1_f64).to_le_bytes(), "-0.1"),
            ("save", "STRING", b"save", "\"save\""),
            ("ä", "UNICODE_STRING", &[0xE4, 0], "\"ä\""),
            ("01 02 fF", "hex", &[1, 2, 0xFF], "01 02 FF"),
            ("0x0102", "OCTET_STRING", &[1, 2], "01 02"),
            ("3", "BIT2", &[3], "3 (0x03)"),
            (
                "18446744073709551615",
                "u64",
                &[0xFF; 8],
                "18446744073709551615 (0xFFFFFFFFFFFFFFFF)",
            ),
        ];
        for (text, name, bytes, shown) in rows {
            assert_eq!(written(text, name).as_deref(), Ok(bytes), "{text} {name}");
            assert_eq!(show(bytes, Some(data_type(name).unwrap())).0, shown, "{text} {name}");
        }
    }

    #[test]
    fn what_does_not_fit_is_refused_with_its_range() {
        for (text, name, words) in [
            ("256", "u8", "0 to 255"),
            ("-1", "UINT", "0 to 65535"),
            ("32768", "INT", "-32768 to 32767"),
            ("4", "BIT2", "0 to 3"),
            ("maybe", "BOOL", "true or false"),
            ("x", "REAL", "a number"),
            ("123", "hex", "bytes in hex"),
            ("", "u8", "whole number"),
        ] {
            let error = written(text, name).unwrap_err();
            assert!(error.contains(words), "{error}");
        }
        assert!(data_type("WORDS").is_err());
        assert_eq!(parse_sized("-2", 2), Ok(vec![0xFE, 0xFF]));
        assert!(parse_sized("65536", 2).is_err() && parse_sized("1", 9).is_err());
    }

    #[test]
    fn without_a_type_numbers_and_texts_are_guessed() {
        assert_eq!(show(&[2, 0, 0, 0], None).0, "2 (0x00000002)");
        assert_eq!(show(b"EL3204\0", None).0, "\"EL3204\"");
        assert_eq!(show(&[1, 2, 3], None).0, "01 02 03");
        assert_eq!(show(&[1, 2, 3], Some(DataType::UINT)), ("01 02 03".to_owned(), Value::Null));
        assert_eq!(show(&[0xFF; 8], None).1, Value::String("18446744073709551615".to_owned()));
    }
}
