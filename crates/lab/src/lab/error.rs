//! Errors that end a lab.

use linesman_config::project::ProjectError;
use linesman_proto::time::{Instant, Span};
use linesman_sim::fault::FaultError;
use linesman_sim::segment::BuildError;
use linesman_sim::segment_file::SegmentFileError;

/// A lab that cannot go on, or was never built.
#[derive(Debug, thiserror::Error)]
pub enum LabError {
    /// The segment file describes no segment.
    #[error(transparent)]
    Segment(#[from] BuildError),
    /// The segment file does not fit together.
    #[error(transparent)]
    File(#[from] SegmentFileError),
    /// The project behind it does not fit together.
    #[error(transparent)]
    Project(#[from] ProjectError),
    /// A fault cannot be injected.
    #[error(transparent)]
    Fault(#[from] FaultError),
    /// The MainDevice could not bring the line up.
    #[error("the line could not be brought up: {0}")]
    BringUp(String),
    /// Virtual time stands still.
    #[error(
        "virtual time stands still at {at}: {what} asks to be called again and again; this is a \
         fault of the program, please report it with the seed"
    )]
    Stuck {
        /// Where.
        at: Instant,
        /// Who was due.
        what: &'static str,
    },
    /// Something that was waited for did not happen.
    #[error("{what} did not happen within {within}")]
    TooLate {
        /// What was waited for.
        what: String,
        /// How long.
        within: Span,
    },
}
