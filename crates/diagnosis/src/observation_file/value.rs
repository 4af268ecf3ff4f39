//! Numbers and times as people copy them from a tool.

use std::fmt;
use std::marker::PhantomData;

use jiff::Timestamp;
use jiff::civil::DateTime;
use jiff::tz::Offset;
use serde::{Deserialize, Deserializer, de};

/// A value of 16 bits: a TOML number, or text such as `"0x0412"` or `"1042"`.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Word(pub u16);

/// A counter of any size: a TOML number, or text such as `"0x12"` or `"154 656"`.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct Count(pub u64);

/// An address of 32 bits: a TOML number, or text such as `"0x01000000"`.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Address(pub u32);

/// A number with what is expected of it.
trait CheckedNumber: Sized {
    const EXPECTED: &'static str;
    fn of(value: u64) -> Option<Self>;
}

impl CheckedNumber for Word {
    const EXPECTED: &'static str = "a number from 0 to 65535, or text such as \"0x0412\"";
    fn of(value: u64) -> Option<Self> {
        u16::try_from(value).ok().map(Self)
    }
}

impl CheckedNumber for Count {
    const EXPECTED: &'static str = "a count from 0 up, or text such as \"0x12\"";
    fn of(value: u64) -> Option<Self> {
        Some(Self(value))
    }
}

impl CheckedNumber for Address {
    const EXPECTED: &'static str = "an address of 32 bits, or text such as \"0x01000000\"";
    fn of(value: u64) -> Option<Self> {
        u32::try_from(value).ok().map(Self)
    }
}

/// A number as text: decimal with or without spaces between groups, or hexadecimal after `0x`.
pub(crate) fn number(text: &str) -> Option<u64> {
    let trimmed = text.trim();
    match trimmed.strip_prefix("0x").or_else(|| trimmed.strip_prefix("0X")) {
        Some(digits) => u64::from_str_radix(digits, 16).ok().filter(|_| !digits.starts_with('+')),
        None => {
            let digits: String = trimmed.chars().filter(|one| !matches!(one, ' ' | '_')).collect();
            digits.parse().ok().filter(|_| !digits.starts_with('+'))
        }
    }
}

struct ValueVisitor<T>(PhantomData<T>);

impl<T: CheckedNumber> de::Visitor<'_> for ValueVisitor<T> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(T::EXPECTED)
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<T, E> {
        let fits = u64::try_from(value).ok().and_then(T::of);
        fits.ok_or_else(|| E::invalid_value(de::Unexpected::Signed(value), &self))
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<T, E> {
        T::of(value).ok_or_else(|| E::invalid_value(de::Unexpected::Unsigned(value), &self))
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<T, E> {
        let fits = number(text).and_then(T::of);
        fits.ok_or_else(|| E::invalid_value(de::Unexpected::Str(text), &self))
    }
}

macro_rules! read_as_number {
    ($($name:ident $description:literal $most:literal $pattern:literal;)*) => {
        $(
            impl<'de> Deserialize<'de> for $name {
                fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                    deserializer.deserialize_any(ValueVisitor(PhantomData))
                }
            }

            #[cfg(feature = "schema")]
            impl schemars::JsonSchema for $name {
                fn schema_name() -> std::borrow::Cow<'static, str> {
                    stringify!($name).into()
                }

                fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
                    schemars::json_schema!({
                        "description": $description,
                        "anyOf": [
                            { "type": "integer", "minimum": 0, "maximum": $most },
                            { "type": "string", "pattern": $pattern },
                        ],
                    })
                }
            }
        )*
    };
}

read_as_number! {
    Word "16 bits: a number, or text such as `0x0412`." 65_535_u64
        "^(0[xX][0-9a-fA-F]{1,4}|[0-9]{1,5})$";
    Count "A count of any size: a number, or text such as `0x12`." 9_223_372_036_854_775_807_u64
        "^(0[xX][0-9a-fA-F]{1,16}|[0-9_ ]{1,26})$";
    Address "32 bits: a number, or text such as `0x01000000`." 4_294_967_295_u64
        "^(0[xX][0-9a-fA-F]{1,8}|[0-9]{1,10})$";
}

/// A moment by the clock on the wall: text such as `"2026-11-20T10:00:00"`, or a TOML date with time. With
/// a zone it is taken to UTC; without one all are taken to be of the same zone.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Date(pub DateTime);

impl Date {
    /// Reads `2026-11-20T10:00:00.250+01:00`, with or without fraction and zone, with `T` or a space.
    #[must_use]
    pub fn read(text: &str) -> Option<Self> {
        let text = text.trim();
        if let Ok(stamp) = text.parse::<Timestamp>() {
            return Some(Self(Offset::UTC.to_datetime(stamp)));
        }
        text.parse().ok().map(Self)
    }

    /// How long after another one, in ns; negative when before.
    #[must_use]
    pub fn ns_since(self, other: Self) -> i128 {
        self.0.duration_since(other.0).as_nanos()
    }
}

impl<'de> Deserialize<'de> for Date {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        /// Both forms that a file may have.
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum FileForm {
            Toml(toml::value::Datetime),
            Text(String),
        }
        let text = match FileForm::deserialize(deserializer) {
            Ok(FileForm::Toml(date)) => date.to_string(),
            Ok(FileForm::Text(text)) => text,
            Err(_) => return Err(de::Error::custom(DATE_EXPECTED)),
        };
        let wrong = || de::Error::custom(format!("`{text}` is no date with time: {DATE_EXPECTED}"));
        Self::read(&text).ok_or_else(wrong)
    }
}

const DATE_EXPECTED: &str = "expected a date with time such as \"2026-11-20T10:00:00\"";

#[cfg(feature = "schema")]
impl schemars::JsonSchema for Date {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Date".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({
            "description": "A date with time, such as `2026-11-20T10:00:00`, with or without a zone.",
            "type": "string",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_as_people_write_them() {
        for (text, expected) in [
            ("154656", Some(154_656)),
            ("154 656", Some(154_656)),
            ("1_000", Some(1_000)),
            (" 0x12 ", Some(18)),
            ("0XfF", Some(255)),
            ("-1", None),
            ("+1", None),
            ("1.5", None),
            ("", None),
            ("0x", None),
            ("99999999999999999999", None),
        ] {
            assert_eq!(number(text), expected, "{text}");
        }
    }

    #[test]
    fn dates_with_a_zone_are_taken_to_one() {
        let at = |text| Date::read(text).unwrap();
        let later = at("2026-11-20T10:00:01.250");
        assert_eq!(later.ns_since(at("2026-11-20 10:00:00")), 1_250_000_000);
        assert_eq!(at("2026-11-20T11:00:00+01:00"), at("2026-11-20T10:00:00Z"));
        assert_eq!(Date::read("yesterday"), None);
    }
}
