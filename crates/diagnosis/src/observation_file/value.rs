//! Numbers as people copy them from a tool: decimal, or text with `0x`.

use serde::{Deserialize, Deserializer, de};

/// A value of 16 bits: a TOML number, or text such as `"0x0412"` or `"1042"`.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Word(pub u16);

impl<'de> Deserialize<'de> for Word {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Reader)
    }
}

struct Reader;

impl de::Visitor<'_> for Reader {
    type Value = Word;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("a number from 0 to 65535, or text such as \"0x0412\"")
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<Word, E> {
        let word = u16::try_from(value);
        word.map(Word).map_err(|_| E::invalid_value(de::Unexpected::Signed(value), &self))
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<Word, E> {
        let word = u16::try_from(value);
        word.map(Word).map_err(|_| E::invalid_value(de::Unexpected::Unsigned(value), &self))
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<Word, E> {
        let trimmed = text.trim();
        let hex = trimmed.strip_prefix("0x").or_else(|| trimmed.strip_prefix("0X"));
        let word = match hex {
            Some(digits) => u16::from_str_radix(digits, 16),
            None => trimmed.parse(),
        };
        word.map(Word).map_err(|_| E::invalid_value(de::Unexpected::Str(text), &self))
    }
}

impl schemars::JsonSchema for Word {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Word".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({
            "description": "16 bits: a number, or text such as `0x0412`.",
            "anyOf": [
                { "type": "integer", "minimum": 0, "maximum": 65535 },
                { "type": "string", "pattern": "^(0[xX][0-9a-fA-F]{1,4}|[0-9]{1,5})$" },
            ],
        })
    }
}
