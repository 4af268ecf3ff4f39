//! Why a service was not done.

use linesman_proto::address::DeviceId;
use linesman_proto::state::AlState;

use crate::exchange::ExchangeError;
use crate::mailbox::MailboxFailure;
use crate::procedure::{SiiAccessError, StepError};

/// A service that was not done.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum ServiceFailure {
    /// The mailbox.
    #[error(transparent)]
    Mailbox(#[from] MailboxFailure),
    /// A state.
    #[error("SubDevice {}, on its way to {to}: {error}. Do: {}", id.no(), advice(error))]
    State {
        /// Whose.
        id: DeviceId,
        /// Where it should have gone.
        to: AlState,
        /// What failed.
        error: StepError,
    },
    /// OP needs process data.
    #[error(
        "SubDevice {}: OP needs somebody who sends it outputs in every cycle, and nobody drives this \
         line. Do: bring the line up with `linesman run`; PREOP and SAFEOP can be asked for here",
        id.no()
    )]
    NeedsCycle {
        /// Whose.
        id: DeviceId,
    },
    /// It has no mailbox for BOOT.
    #[error(
        "SubDevice {}: its SII names no mailbox for BOOT. Do: choose a SubDevice that can be updated",
        id.no()
    )]
    NoBootstrap {
        /// Whose.
        id: DeviceId,
    },
    /// The EEPROM.
    #[error("SubDevice {}: {error}. Do: scan the line and look at its state first", id.no())]
    Sii {
        /// Whose.
        id: DeviceId,
        /// What failed.
        error: SiiAccessError,
    },
    /// A register.
    #[error("SubDevice {}: {error}. Do: check the address with `linesman explain`", id.no())]
    Register {
        /// Whose.
        id: DeviceId,
        /// What failed.
        error: ExchangeError,
    },
    /// No plan has this SubDevice.
    #[error("SubDevice {}: no such one is attended to. Do: scan the line first", id.no())]
    Unknown {
        /// Who was meant.
        id: DeviceId,
    },
}

fn advice(error: &StepError) -> String {
    match error {
        StepError::Refused { code, .. } => code
            .explain()
            .actions
            .first()
            .map_or("", |first| first)
            .trim_end_matches('.')
            .to_owned(),
        _ => "look at the line with `linesman diagnose`".to_owned(),
    }
}

impl ServiceFailure {
    /// Whether the SubDevice itself has said no.
    #[must_use]
    pub const fn is_refusal(&self) -> bool {
        match self {
            Self::Mailbox(failure) => failure.why.is_refusal(),
            Self::State { error, .. } => matches!(error, StepError::Refused { .. }),
            Self::NeedsCycle { .. }
            | Self::NoBootstrap { .. }
            | Self::Sii { .. }
            | Self::Register { .. }
            | Self::Unknown { .. } => false,
        }
    }
}
