//! Times in the report.

use linesman_diagnosis::report::Number;
use serde::{Deserialize, Serialize};

use super::durations::{BarReport, DurationsReport};

/// Times of a capture as a whole.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct TimingReport {
    /// From each frame going out to its return; `null` where only one of them was recorded.
    pub response: Option<DurationsReport>,
    /// The same as a histogram.
    pub response_bars: Vec<BarReport>,
    /// Frames that came back later than the others of their length.
    pub late: Number,
    /// Requests that did not come back.
    pub lost: Number,
    /// Share of the time in which frames were on the wire at 100 Mbit/s, in percent; `null` for a single frame.
    pub load_percent: Option<f64>,
    /// Stretches of time without any frame that are longer than three cycles, latest first.
    pub gaps: Vec<FrameGapReport>,
    /// By how much time stamps ran backwards at most.
    pub clock_back_ns: Number,
}

/// A stretch of time without any frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FrameGapReport {
    /// The last frame before.
    pub from_ns: Number,
    /// The first frame after.
    pub to_ns: Number,
}
