//! Misbehaviour of a device's clock, beside being too fast or too slow.

use serde::{Deserialize, Serialize};

use super::SegmentFileError;
use crate::controller::LocalClock;
use linesman_proto::time::Span;

/// The quartz of a device: what is not said is by chance.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SegmentClock {
    /// How its speed changes while it warms up, in ppm per second, -10 to 10; by chance within 0.02
    /// unless said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(range(min = -10.0, max = 10.0)))]
    pub ramp_ppm_per_s: Option<f64>,
    /// How long that lasts after power-on, in seconds, 0 to 10,000; by chance from 60 to 300 unless
    /// said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(range(min = 0.0, max = 10000.0)))]
    pub ramp_s: Option<f64>,
    /// How far a time that it takes can be off either way, in ns, 0 to 1,000; by chance up to 6
    /// unless said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(range(max = 1000)))]
    pub jitter_ns: Option<u16>,
    /// What it shows when the run begins, in ns; by chance up to 1,000 s unless said. At each power-on
    /// of the run it begins at 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start_ns: Option<u64>,
}

impl SegmentClock {
    /// Whether its numbers can be.
    pub(super) fn check(&self, device: &str) -> Result<(), SegmentFileError> {
        let out_of_range = |key, given: String, allowed| {
            Err(SegmentFileError::Range { device: device.to_owned(), key, given, allowed })
        };
        if let Some(ramp) = self.ramp_ppm_per_s.filter(|ramp| !(-10.0..=10.0).contains(ramp)) {
            return out_of_range("clock.ramp_ppm_per_s", ramp.to_string(), "-10 to 10");
        }
        if let Some(ramp) = self.ramp_s.filter(|ramp| !(0.0..=10_000.0).contains(ramp)) {
            return out_of_range("clock.ramp_s", ramp.to_string(), "0 to 10000");
        }
        if let Some(jitter) = self.jitter_ns.filter(|jitter| *jitter > 1_000) {
            return out_of_range("clock.jitter_ns", jitter.to_string(), "0 to 1000");
        }
        Ok(())
    }

    /// What is said takes the place of what chance made.
    pub(crate) fn apply(&self, clock: &mut LocalClock) {
        if let Some(ramp) = self.ramp_ppm_per_s {
            clock.ramp_ppb_per_s = (ramp * 1_000.0).round() as i64;
        }
        if let Some(seconds) = self.ramp_s {
            clock.ramp = Span::ns((seconds * 1e9) as u64);
        }
        clock.jitter_ns = self.jitter_ns.unwrap_or(clock.jitter_ns);
        clock.start = self.start_ns.unwrap_or(clock.start);
    }
}
