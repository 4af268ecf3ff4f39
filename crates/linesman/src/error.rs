//! Errors of a line that cannot be opened, planned or run.

use std::path::PathBuf;

use linesman_link::error::LinkError;
use linesman_runtime::run::RunError;
use linesman_runtime::selector::SelectorError;
use linesman_session::image::VariableError;

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
        /// What was named.
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
        /// What is open.
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
        /// What is wrong with it.
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
    /// The line cannot be run.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The system has no more sockets.
    #[error("{doing}: {source}. Do: end other programs")]
    System {
        /// What was tried.
        doing: &'static str,
        /// Why not.
        source: std::io::Error,
    },
}
