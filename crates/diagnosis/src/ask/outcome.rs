//! News of the questions: that they begin, and why they end.

use super::carrier::{AskRefusal, Carrier};
use super::disturbance::Disturbance;
use super::report::AskingState;
use crate::main_device::MainDeviceKind;

/// News for the user.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum News {
    /// Questions begin.
    Begun(Carrier),
    /// The MainDevice was in trouble of its own; it is watched anew before the next question.
    Again(Disturbance),
    /// No question is sent any more, or none was.
    Ended(EndReason),
}

/// Why questions have come to an end.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum EndReason {
    /// Not beside this MainDevice.
    Refused(AskRefusal),
    /// A sign that it is disturbed.
    Stopped(Disturbance),
    /// Not all controllers answer to a carrier: so many of so many did.
    NoCarrier {
        /// Most that answered a broadcast.
        answered: u16,
        /// Those that are there.
        present: u16,
        /// The MainDevice, whose filter allows no other form.
        kind: MainDeviceKind,
    },
}

impl EndReason {
    pub(super) const fn state(&self) -> AskingState {
        match self {
            Self::Refused(_) => AskingState::Refused,
            Self::Stopped(_) => AskingState::Stopped,
            Self::NoCarrier { .. } => AskingState::Impossible,
        }
    }

    /// Why, in words.
    #[must_use]
    pub fn reason(&self) -> String {
        match self {
            Self::Refused(refusal) => refusal.to_string(),
            Self::Stopped(disturbance) => format!("the MainDevice may be disturbed: {disturbance}"),
            Self::NoCarrier { answered: 0, kind, .. } => format!(
                "no SubDevice answered to EtherCAT in UDP, and {} may take plain frames for its own",
                kind.name()
            ),
            Self::NoCarrier { answered, present, kind } => format!(
                "{answered} of {present} SubDevices answer to EtherCAT in UDP, and {} may take plain frames for its own",
                kind.name()
            ),
        }
    }

    /// What to do about it.
    #[must_use]
    pub const fn next_step(&self) -> &'static str {
        match self {
            Self::Refused(refusal) => refusal.next_step(),
            Self::Stopped(_) => {
                "look at the verdict; once the MainDevice runs steadily, ask again: run the same command anew. \
                 `--keep-asking` goes on by itself after trouble that no question was near"
            }
            Self::NoCarrier { .. } => {
                "listen without `--ask`, and have the program of the MainDevice read the counters: the lines for it stand \
                 beneath the verdict"
            }
        }
    }
}
