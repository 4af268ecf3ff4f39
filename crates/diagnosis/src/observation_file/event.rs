//! Events between readings: emergencies, and parts that were exchanged to find a fault.

use serde::Deserialize;

use super::value::{Address, Date, Word};

/// An emergency of a SubDevice.
#[derive(Clone, PartialEq, Default, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ObservedEmergency {
    /// Whose: name or number.
    pub device: String,
    /// Its code, such as `"0x8611"`.
    pub code: Option<Word>,
    /// Error register.
    #[serde(default)]
    pub register: Option<u8>,
    /// The bytes of the manufacturer, five at most.
    #[serde(default)]
    pub data: Vec<u8>,
    /// When, by the clock on the wall.
    #[serde(default)]
    pub at: Option<Date>,
    /// When, in seconds since any beginning.
    #[serde(default)]
    pub at_s: Option<f64>,
}

/// A request to a SubDevice's object dictionary that it refused.
#[derive(Clone, PartialEq, Default, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ObservedAbort {
    /// Whose: name or number.
    pub device: String,
    /// Index of the object, such as `"0x1C12"`.
    pub index: Option<Word>,
    /// Its subindex.
    #[serde(default)]
    pub subindex: u8,
    /// Abort code, such as `"0x06010002"`.
    pub code: Option<Address>,
    /// When, by the clock on the wall.
    #[serde(default)]
    pub at: Option<Date>,
    /// When, in seconds since any beginning.
    #[serde(default)]
    pub at_s: Option<f64>,
}

/// A part that was exchanged to find a fault, between two readings or before the last.
#[derive(Clone, PartialEq, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ObservedExchange {
    /// What was exchanged.
    pub what: ExchangedPart,
    /// Where it was: a link such as `K1.C-K2.A` or one end of it, or a SubDevice; nothing for the card.
    #[serde(default)]
    pub at: Option<String>,
    /// Whether the errors moved with it, or went with it when it was replaced. `false`: they stayed.
    pub moved: bool,
    /// Where it came to; left out when it was replaced by a new one.
    #[serde(default)]
    pub to: Option<String>,
}

/// A part that can be exchanged.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum ExchangedPart {
    /// A cable with its plugs.
    Cable,
    /// A SubDevice.
    Device,
    /// The MainDevice's network card.
    Card,
}
