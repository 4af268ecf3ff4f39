//! Working counters with what was expected.

use linesman_proto::command::Command;
use serde::Deserialize;

use super::value::{Address, Count};

/// A datagram of process data with its working counter.
#[derive(Clone, PartialEq, Default, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ObservedWorkingCounter {
    /// Its sync unit, domain or task; the place in the file unless said.
    #[serde(default)]
    pub name: Option<String>,
    /// The command.
    #[serde(default)]
    pub command: LogicalCommand,
    /// Logical address, such as `"0x01000000"`.
    #[serde(default)]
    pub address: Option<Address>,
    /// Its length in bytes.
    #[serde(default)]
    pub length: Option<u16>,
    /// The working counter it should come back with.
    #[serde(default)]
    pub expected: Option<u16>,
    /// The working counter it came back with.
    #[serde(default)]
    pub received: Option<u16>,
    /// How often it came back so.
    #[serde(default)]
    pub count: Option<Count>,
    /// The SubDevices in it, by name or number, where nobody says what each does.
    #[serde(default)]
    pub devices: Vec<String>,
    /// Those of them that give inputs.
    #[serde(default)]
    pub inputs: Vec<String>,
    /// Those of them that take outputs.
    #[serde(default)]
    pub outputs: Vec<String>,
}

/// A command to logical addresses.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum LogicalCommand {
    /// Reads.
    #[serde(rename = "LRD", alias = "lrd")]
    Lrd,
    /// Writes.
    #[serde(rename = "LWR", alias = "lwr")]
    Lwr,
    /// Reads and writes.
    #[default]
    #[serde(rename = "LRW", alias = "lrw")]
    Lrw,
}

impl LogicalCommand {
    /// The command of the protocol.
    #[must_use]
    pub const fn command(self) -> Command {
        match self {
            Self::Lrd => Command::Lrd,
            Self::Lwr => Command::Lwr,
            Self::Lrw => Command::Lrw,
        }
    }
}

impl ObservedWorkingCounter {
    /// What it is known by in several readings.
    pub(super) fn key(&self, index: usize) -> String {
        match (&self.name, self.address) {
            (Some(name), _) => name.clone(),
            (None, Some(Address(address))) => format!("0x{address:08X}"),
            (None, None) => (index + 1).to_string(),
        }
    }
}
