//! Requests to a running segment and its answers: lines of JSON.

use linesman_config::fault::FaultName;
use linesman_sim::segment_file::FaultEntry;
use serde::{Deserialize, Serialize};

use crate::serve::report::Status;

/// Name and version of the answer about faults.
pub const FAULTS_SCHEMA: &str = "linesman.faults/1";
/// Name and version of the answer about signals.
pub const SIGNALS_SCHEMA: &str = "linesman.signals/1";

/// What can be asked.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "do", rename_all = "kebab-case")]
pub enum Request {
    /// Put a fault on the line now. The answer is about faults.
    Inject {
        /// Its kind, place, parameters and schedule; it begins with the request.
        fault: Box<FaultEntry>,
        /// How long it lasts, in ms; until it is healed unless said.
        for_ms: Option<f64>,
    },
    /// End a fault, or all of them. The answer is about faults.
    Heal {
        /// Its number; all unless said.
        no: Option<u32>,
    },
    /// Pull the cable of a device, or those of a hot connect group, with all that hangs behind. The
    /// answer is about faults: each cable is a `link-open` until it is plugged in again.
    Unplug {
        /// A device, or a group of the segment file: `K1`, `group:robot`.
        name: String,
    },
    /// Plug it in again. The answer is about faults.
    Plug {
        /// A device, or a group of the segment file.
        name: String,
        /// A free port, such as `K1.C`; where it was unless said.
        on: Option<String>,
    },
    /// Tell which faults there are and were.
    List,
    /// Tell what went over the interfaces, and whether the host kept up.
    Status,
    /// Tell the inputs and outputs of all devices.
    Signals,
    /// Hold an input at a value, whatever it is wired to. The answer is about signals.
    Set {
        /// Device and channel, from 1: `I1.3`.
        input: String,
        /// 0 or 1 for a digital input, digits of the nominal range for an analogue one.
        value: i32,
    },
    /// Give an input back to what it is wired to, or all of them. The answer is about signals.
    Release {
        /// Device and channel; all unless said.
        input: Option<String>,
    },
    /// Tell what really happened, one line each (`linesman.truth/1`); nothing more can be asked on
    /// this connection.
    Events {
        /// Go on with what happens from now on.
        #[serde(default)]
        follow: bool,
    },
}

/// What is answered; which one follows from the request.
#[derive(Clone, PartialEq, Debug, Serialize)]
#[serde(untagged)]
pub enum Answer {
    /// About faults.
    Faults(Faults),
    /// About the run.
    Status(Box<Status>),
    /// About inputs and outputs.
    Signals(SignalTable),
    /// Events follow.
    Events,
}

/// All faults so far.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Faults {
    /// `linesman.faults/1`.
    pub schema: String,
    /// Why the request was refused; `null` when it was done.
    pub error: Option<String>,
    /// The faults of the run, oldest first.
    pub faults: Vec<FaultState>,
}

/// A fault and what came of it.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FaultState {
    /// Its number, from 1, in the order of injection.
    pub no: u32,
    /// What it is.
    pub name: FaultName,
    /// Where: links as `K1.C-B3.A`, directions as `K1.C>B3.A`, devices by name.
    pub places: Vec<String>,
    /// When it began, in ns since the start of the segment; `null` when it has not yet.
    pub began_ns: Option<u64>,
    /// When it ended; `null` while it lasts.
    pub ended_ns: Option<u64>,
    /// Frames it spoiled.
    pub frames_spoiled: u64,
    /// Frames it made vanish.
    pub frames_lost: u64,
}

/// The inputs and outputs of all devices.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SignalTable {
    /// `linesman.signals/1`.
    pub schema: String,
    /// Why the request was refused; `null` when it was done.
    pub error: Option<String>,
    /// By device, outputs before inputs, by channel.
    pub signals: Vec<SignalState>,
}

/// An input or output.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SignalState {
    /// Device and channel, from 1: `I1.3`. Inputs and outputs are counted on their own.
    pub name: String,
    /// Which of them.
    pub direction: SignalDirection,
    /// 0 or 1 for a digital one, digits of the nominal range (0x7FFF is its end) for an analogue
    /// one; `null` for an open input, which the device makes up.
    pub value: Option<i32>,
    /// The output that an input is wired to.
    pub wired_to: Option<String>,
    /// Whether an input is held at its value from outside.
    pub held: bool,
}

/// Seen from the device.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum SignalDirection {
    /// The MainDevice reads it.
    Input,
    /// The MainDevice writes it.
    Output,
}

impl Faults {
    /// Why something was refused, when the segment was not even asked.
    pub(super) fn refusal(error: String) -> Self {
        Self { schema: FAULTS_SCHEMA.to_owned(), error: Some(error), faults: Vec::new() }
    }
}
