//! Report of the questions and of the lost frames of the MainDevice beside them.

use serde::{Deserialize, Serialize};

use super::disturbance::FrameOutcomes;
use crate::report::Number;

/// Questions beside another MainDevice: `diagnose listen:… --ask`.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct AskingReport {
    /// How it stands at the end.
    pub state: AskingState,
    /// The form of the questions: `udp`, `plain`; `null` where none was sent.
    pub carrier: Option<CarrierName>,
    /// Most questions in a second.
    pub per_s: u32,
    /// Questions that were sent.
    pub questions: Number,
    /// Those that came back.
    pub answered: Number,
    /// SubDevices that were asked by turns.
    pub devices: Number,
    /// When the last one was sent; `null` where none was.
    pub last_ns: Option<Number>,
    /// Why no question is sent (any more); `null` while questions are sent.
    pub reason: Option<String>,
    /// What to do about that.
    pub next_step: Option<String>,
    /// Frames of the MainDevice that left near a question.
    pub near: FaredReport,
    /// Its other frames, those before the first question included.
    pub others: FaredReport,
}

/// How it stands with the questions.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum AskingState {
    /// The ways of the MainDevice are learnt, and nothing was sent yet, or nothing since it was in trouble.
    Learning,
    /// Questions are sent.
    Asking,
    /// The MainDevice showed signs of being disturbed: no question is sent any more.
    Stopped,
    /// No question can be sent on this line.
    Impossible,
    /// Questions are not sent beside this MainDevice.
    Refused,
}

/// The form of questions.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum CarrierName {
    /// In UDP.
    Udp,
    /// EtherType 0x88A4.
    Plain,
}

/// Frames, and how many of them fared badly.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FaredReport {
    /// Frames.
    pub frames: Number,
    /// Those that were lost.
    pub lost: Number,
    /// Those that came back late.
    pub late: Number,
}

impl From<FrameOutcomes> for FaredReport {
    fn from(fared: FrameOutcomes) -> Self {
        let FrameOutcomes { frames, lost, late } = fared;
        Self { frames: Number(frames), lost: Number(lost), late: Number(late) }
    }
}
