//! Counts of the MainDevice: its frames and its card.

use serde::Deserialize;

use super::value::Count;

/// What the MainDevice counted. Left out: not known.
#[derive(Clone, PartialEq, Default, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ObservedMainDevice {
    /// Whether the card has a link.
    #[serde(default)]
    pub link: Option<bool>,
    /// Frames sent.
    #[serde(default)]
    pub sent: Option<Count>,
    /// Frames that did not come back, or came back damaged.
    #[serde(default)]
    pub lost: Option<Count>,
    /// How many frames a second are being lost now.
    #[serde(default)]
    pub lost_per_s: Option<f64>,
    /// Frames that came back after they were given up.
    #[serde(default)]
    pub late: Option<Count>,
    /// Cycles of the application that began late.
    #[serde(default)]
    pub late_cycles: Option<Count>,
    /// Datagrams that were not back in time (IgH: `TIMED OUT`).
    #[serde(default)]
    pub timed_out: Option<Count>,
    /// Datagrams that came back and that nobody waited for any more (IgH: `UNMATCHED`).
    #[serde(default)]
    pub unmatched: Option<Count>,
    /// Datagrams that were not sent, because the one before was still out (IgH: `SKIPPED`).
    #[serde(default)]
    pub skipped: Option<Count>,
    /// Frames that came back with a content that cannot be (IgH: `CORRUPTED`).
    #[serde(default)]
    pub corrupted: Option<Count>,
    /// Damaged frames that the card dropped.
    #[serde(default)]
    pub crc: Option<Count>,
    /// Frames that card or socket dropped for want of room.
    #[serde(default)]
    pub drops: Option<Count>,
    /// Frames that could not be sent.
    #[serde(default)]
    pub send_errors: Option<Count>,
    /// The cycle of the process data in microseconds.
    #[serde(default)]
    pub cycle_us: Option<f64>,
    /// How many SubDevices answer a broadcast read.
    #[serde(default)]
    pub answering: Option<u16>,
    /// Whether frames of the second card of a ring are needed (IgH: `Redundant link in use!`): then it is open.
    #[serde(default)]
    pub ring_open: Option<bool>,
    /// AL status of all SubDevices put together with OR, as a broadcast read of 0x0130 gives it.
    #[serde(default)]
    pub states: Option<u8>,
}
