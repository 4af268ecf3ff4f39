//! Schedule of a fault as a file writes it.

use serde::{Deserialize, Serialize};

/// How often a fault comes and how long it stays each time. Without any of it, it comes once.
///
/// All times are in ms and count from the fault's own begin (`from_ms`, or the moment it is
/// injected). At most one of `at_ms`, `every_ms` and `random` can be said.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Schedule {
    /// It comes at these times, in ms after its begin: one or a list that rises.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_ms: Option<Times>,
    /// It comes again and again, so many ms from one begin to the next.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub every_ms: Option<f64>,
    /// It comes by chance, by the segment's seed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub random: Option<RandomTimes>,
    /// How long it stays each time, in ms.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub for_ms: Option<f64>,
    /// How often it comes at most; without end unless said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub times: Option<u32>,
    /// Each time it comes, it comes several times in quick succession.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub burst: Option<BurstTimes>,
}

/// One time or several.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged)]
pub enum Times {
    /// One.
    One(f64),
    /// A list.
    Many(Vec<f64>),
}

impl Times {
    /// All of them.
    #[must_use]
    pub fn as_slice(&self) -> &[f64] {
        match self {
            Self::One(time) => std::slice::from_ref(time),
            Self::Many(times) => times,
        }
    }
}

/// It comes by chance.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct RandomTimes {
    /// Mean time from its end to its next begin, in ms.
    pub mean_ms: f64,
    /// How long it stays in the mean, by chance, in ms; the schedule's own `for_ms`, always the same,
    /// unless said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub for_ms: Option<f64>,
}

/// It comes several times in quick succession.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct BurstTimes {
    /// How many times.
    pub count: u32,
    /// From one begin to the next, in ms.
    pub every_ms: f64,
}
