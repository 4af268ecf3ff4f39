//! Report of a segment on real interfaces, and of the host that carries it.

use serde::{Deserialize, Serialize};

use super::lateness::LatenessReport;

/// Name and version of the format.
pub const SCHEMA: &str = "linesman.sim/1";

/// A segment on real interfaces: what went over them, and whether the host kept up.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Status {
    /// `linesman.sim/1`.
    pub schema: String,
    /// Why a request was refused; `null` when it was done.
    pub error: Option<String>,
    /// What the segment is called.
    pub name: String,
    /// Its interfaces: one, or two at the ends of a ring.
    pub interfaces: Vec<String>,
    /// Controllers there are.
    pub devices: u64,
    /// How long it has run, in ns.
    pub time_ns: u64,
    /// What went over the interfaces.
    pub frames: Frames,
    /// Whether the host kept up. Where it did not, a MainDevice sees late or lost frames that are
    /// no fault of the segment.
    pub host: Host,
}

/// Frames of a run.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Frames {
    /// Came in.
    pub received: u64,
    /// Went back.
    pub answered: u64,
    /// Came back damaged: a card would drop them, so they were not sent.
    pub damaged: u64,
    /// On their way, or vanished in the segment.
    pub outstanding: u64,
    /// Were not taken by the kernel, because its queue was full or the interface down.
    pub refused: u64,
}

/// The host's share.
#[derive(Clone, Copy, PartialEq, Default, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Host {
    /// Whether the system gave the segment a real-time priority.
    pub real_time: bool,
    /// Time spent working, or kept from working by other programs, in ns.
    pub busy_ns: u64,
    /// The same as a share of the run, 0 to 1.
    pub busy_share: f64,
    /// Time spent looking at the clock because an answer was due at once, in ns.
    pub spinning_ns: u64,
    /// From the kernel's stamp of a frame until the segment saw it.
    pub pickup: LatenessReport,
    /// From when the model says that an answer is back at the card until it was sent.
    pub answer: LatenessReport,
    /// Frames that were lost because they waited too long for the segment.
    pub dropped: u64,
    /// Frames that the segment saw too late to put them at their own time; they crossed it later.
    pub shifted: u64,
    /// How often an interface was found switched off.
    pub downs: u64,
}
