//! Failure of a service.

use linesman_proto::address::DeviceId;
use linesman_proto::state::AlState;

use crate::exchange::ExchangeError;
use crate::mailbox::{MailboxFailure, Why};
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
    #[error("SubDevice {}: {error}. Do: look at the line with `linesman diagnose`", id.no())]
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

#[allow(clippy::wildcard_enum_match_arm, reason = "only a refusal has a code with advice")]
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

/// Whose code a refusal carries.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum RefusalKind {
    /// An SDO abort code.
    SdoAbort,
    /// The code of an FoE error message.
    FoeError,
    /// The result of an EoE request.
    EoeResult,
    /// The error code of a drive, of SoE.
    SoeError,
    /// A return code of ADS, of AoE.
    AdsError,
    /// The code of a mailbox error reply.
    MailboxError,
    /// An AL status code.
    AlStatus,
}

impl RefusalKind {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::SdoAbort,
        Self::FoeError,
        Self::EoeResult,
        Self::SoeError,
        Self::AdsError,
        Self::MailboxError,
        Self::AlStatus,
    ];

    /// The word for programs.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::SdoAbort => "sdo-abort",
            Self::FoeError => "foe-error",
            Self::EoeResult => "eoe-result",
            Self::SoeError => "soe-error",
            Self::AdsError => "ads-error",
            Self::MailboxError => "mailbox-error",
            Self::AlStatus => "al-status",
        }
    }
}

impl ServiceFailure {
    /// The SubDevice's own code, if it has said no itself.
    #[must_use]
    #[allow(clippy::wildcard_enum_match_arm, reason = "all others are no answers of the SubDevice")]
    pub fn refusal(&self) -> Option<(RefusalKind, u32)> {
        match self {
            Self::Mailbox(failure) => match &failure.why {
                Why::Aborted { code } => Some((RefusalKind::SdoAbort, code.value())),
                Why::File { code, .. } => Some((RefusalKind::FoeError, code.0)),
                Why::Ethernet { result } => Some((RefusalKind::EoeResult, result.0.into())),
                Why::Drive { code } => Some((RefusalKind::SoeError, code.0.into())),
                Why::Ads { code } => Some((RefusalKind::AdsError, code.0)),
                Why::Mailbox { code } => Some((RefusalKind::MailboxError, code.code().into())),
                _ => None,
            },
            Self::State { error: StepError::Refused { code, .. }, .. } => {
                Some((RefusalKind::AlStatus, code.0.into()))
            }
            _ => None,
        }
    }

    /// Whether the SubDevice itself has said no.
    #[must_use]
    pub fn is_refusal(&self) -> bool {
        self.refusal().is_some()
    }
}
