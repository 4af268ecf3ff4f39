//! Errors of a line that cannot be opened, planned or run.

use std::path::PathBuf;

use linesman_link::error::LinkError;
use linesman_runtime::run::RunError;
use linesman_runtime::selector::SelectorError;
use linesman_session::image::VariableError;
use linesman_sim::segment_file::SegmentFileError;

use crate::{PlanId, RequestError};

/// Each says who, where, what was expected and what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The word that says where the line is.
    #[error(transparent)]
    Selector(#[from] SelectorError),
    /// Nothing can be driven there.
    #[error("`{given}`: nothing can be driven there. Do: name a card, `eth0`, or `sim:line.toml`")]
    NotDrivable {
        /// The word.
        given: String,
    },
    /// Another MainDevice drives the line.
    #[error(
        "{card}: another MainDevice drives this line. Do: stop it first, or watch it with `linesman \
         diagnose listen:{card}`"
    )]
    Driven {
        /// The card.
        card: String,
    },
    /// A card cannot be broken by a program.
    #[error(
        "`{given}` is no virtual segment: faults are injected there alone. Do: open `sim:line.toml`"
    )]
    NotSimulated {
        /// The line that is open.
        given: String,
    },
    /// A virtual segment cannot be built, or has no place for a fault.
    #[error("virtual segment: {0}")]
    Segment(String),
    /// A file.
    #[error("{}: {why}", .path.display())]
    File {
        /// Which.
        path: PathBuf,
        /// The reason.
        why: String,
    },
    /// The card.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// No plan can be made.
    #[error("{0}")]
    Plan(String),
    /// A variable.
    #[error(transparent)]
    Variable(#[from] VariableError),
    /// A handle belongs to another plan.
    #[error(
        "a handle of {found} was used with {running}. Do: find it by `plan.input(…)`, `plan.output(…)` \
         or `plan.device(…)` of the plan that runs"
    )]
    OtherPlan {
        /// Where the handle was found.
        found: PlanId,
        /// The plan that it was used with.
        running: PlanId,
    },
    /// A service for a SubDevice.
    #[error(transparent)]
    Service(#[from] RequestError),
    /// The run was stopped before.
    #[error("the run was stopped before. Do: start another one")]
    Stopped,
    /// The line cannot be run.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The system has no more sockets.
    #[error("{doing}: {source}. Do: end other programs")]
    System {
        /// The step that failed.
        doing: &'static str,
        /// Why not.
        source: std::io::Error,
    },
}

impl From<SegmentFileError> for Error {
    fn from(error: SegmentFileError) -> Self {
        Self::Segment(error.to_string())
    }
}
