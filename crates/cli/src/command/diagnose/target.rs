//! State that a virtual segment is driven to.

use linesman_proto::state::AlState;

/// A state to drive to.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, clap::ValueEnum)]
pub(super) enum Target {
    /// No communication but registers
    Init,
    /// Mailboxes
    Preop,
    /// Mailboxes and inputs
    Safeop,
    /// Everything
    #[default]
    Op,
}

impl From<Target> for AlState {
    fn from(target: Target) -> Self {
        match target {
            Target::Init => Self::Init,
            Target::Preop => Self::PreOp,
            Target::Safeop => Self::SafeOp,
            Target::Op => Self::Op,
        }
    }
}
