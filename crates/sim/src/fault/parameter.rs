//! Parameters of a kind of fault: keys, ranges, defaults, units.

use std::collections::BTreeMap;

use super::Kind;
use super::error::FaultError;
use crate::segment_file::Value;

/// A parameter.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Parameter {
    /// Its key in the file. Units are part of it: `_ms`, `_per_s`.
    pub key: &'static str,
    /// What it means.
    pub meaning: &'static str,
    /// What it can be.
    pub shape: Shape,
}

/// What a parameter can be.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Shape {
    /// A number from `low` to `high`.
    Number {
        /// The least.
        low: f64,
        /// The most.
        high: f64,
        /// What it is when nothing is said; `None` for nothing.
        default: Option<f64>,
    },
    /// A whole number from `low` to `high`.
    Whole {
        /// The least.
        low: u32,
        /// The most.
        high: u32,
        /// What it is when nothing is said; `None` for nothing.
        default: Option<u32>,
    },
    /// One of some words.
    Word {
        /// All of them; the first is the default.
        words: &'static [&'static str],
    },
    /// Any text; nothing when nothing is said.
    Text,
}

impl Shape {
    fn allowed(self) -> String {
        match self {
            Self::Number { low, high, .. } => format!("a number from {low} to {high}"),
            Self::Whole { low, high, .. } => format!("a whole number from {low} to {high}"),
            Self::Word { words } => format!("one of {}", words.join(", ")),
            Self::Text => "a text".to_owned(),
        }
    }

    fn takes(self, value: &Value) -> bool {
        match (self, value) {
            (Self::Number { low, high, .. }, Value::Integer(_) | Value::Number(_)) => {
                value.as_number().is_some_and(|number| (low..=high).contains(&number))
            }
            (Self::Whole { low, high, .. }, Value::Integer(number)) => {
                (i64::from(low)..=i64::from(high)).contains(number)
            }
            (Self::Word { words }, Value::Text(text)) => words.contains(&text.as_str()),
            (Self::Text, Value::Text(_)) => true,
            (Self::Number { .. } | Self::Whole { .. } | Self::Word { .. } | Self::Text, _) => false,
        }
    }

    fn default_value(self) -> Option<Value> {
        match self {
            Self::Number { default, .. } => default.map(Value::Number),
            Self::Whole { default, .. } => default.map(|number| Value::Integer(number.into())),
            Self::Word { words } => words.first().map(|word| Value::Text((*word).to_owned())),
            Self::Text => None,
        }
    }
}

/// Parameters as given, or as they are when nothing is said.
#[derive(Clone, Default, Debug)]
pub(super) struct Values(BTreeMap<&'static str, Value>);

impl Values {
    pub(super) fn number(&self, key: &str) -> Option<f64> {
        self.0.get(key).and_then(Value::as_number)
    }

    pub(super) fn whole(&self, key: &str) -> Option<u32> {
        match self.0.get(key) {
            Some(Value::Integer(number)) => u32::try_from(*number).ok(),
            Some(Value::Number(_) | Value::Text(_) | Value::Flag(_)) | None => None,
        }
    }

    pub(super) fn text(&self, key: &str) -> Option<&str> {
        match self.0.get(key) {
            Some(Value::Text(text)) => Some(text),
            Some(Value::Integer(_) | Value::Number(_) | Value::Flag(_)) | None => None,
        }
    }
}

/// Checks what was given against what the kind takes.
pub(super) fn read(
    label: &str,
    kind: &Kind,
    given: &BTreeMap<String, Value>,
) -> Result<Values, FaultError> {
    let mut values = Values::default();
    for parameter in kind.parameters {
        if let Some(default) = parameter.shape.default_value() {
            values.0.insert(parameter.key, default);
        }
    }
    for (key, value) in given {
        let Some(parameter) = kind.parameters.iter().find(|parameter| parameter.key == key) else {
            return Err(FaultError::unknown_key(label, kind, key));
        };
        if !parameter.shape.takes(value) {
            return Err(FaultError::Value {
                entry: label.to_owned(),
                key: key.clone(),
                given: value.to_string(),
                allowed: parameter.shape.allowed(),
            });
        }
        values.0.insert(parameter.key, value.clone());
    }
    Ok(values)
}
