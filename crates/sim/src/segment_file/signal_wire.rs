//! Electrical wires between devices: table `[[wire]]`.

use serde::{Deserialize, Serialize};

/// A wire from an output of a device to an input of another, or one for each of them.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SignalWire {
    /// The device that drives it.
    pub from: String,
    /// Which of its outputs, from 1; all of them unless said, the first to the first input and so on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(range(min = 1)))]
    pub output: Option<u32>,
    /// The device that takes it.
    pub to: String,
    /// Which of its inputs, from 1; the first unless said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(range(min = 1)))]
    pub input: Option<u32>,
}
