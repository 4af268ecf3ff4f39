//! Errors of reading a bundle.

use std::path::PathBuf;

use linesman_link::capture::CaptureError;
use linesman_link::input::InputError;

/// Why a file is no bundle that could be judged.
#[derive(Debug, thiserror::Error)]
pub enum BundleError {
    /// It cannot be opened.
    #[error(transparent)]
    Input(#[from] InputError),
    /// It cannot be read.
    #[error("{}: reading the bundle: {error}. Do: copy it anew", name.display())]
    Read {
        /// The file.
        name: PathBuf,
        /// Error of the system.
        error: std::io::Error,
    },
    /// It is larger than any bundle.
    #[error("{}: more than {most} bytes, which no bundle has. Do: check that this is a bundle", name.display())]
    TooLarge {
        /// The file.
        name: PathBuf,
        /// Most bytes that are read.
        most: u64,
    },
    /// It is no whole zip archive.
    #[error("{}: expected a bundle (a zip archive), received one that is cut off or damaged: {why}. Do: copy it anew, \
             and compare lengths", name.display())]
    Archive {
        /// The file.
        name: PathBuf,
        /// Fault that was found.
        why: String,
    },
    /// It is some other archive.
    #[error("{}: a zip archive without {member}, so no bundle. Do: name a file that `--bundles` has written; \
             captures in an archive are unpacked first", name.display())]
    Missing {
        /// The file.
        name: PathBuf,
        /// Missing member.
        member: &'static str,
    },
    /// A member is damaged.
    #[error("{}: {member} in it is damaged: {why}. Do: copy the bundle anew", name.display())]
    Damaged {
        /// The file.
        name: PathBuf,
        /// Which.
        member: &'static str,
        /// Fault that was found.
        why: String,
    },
    /// A member unpacks to more than such a member has.
    #[error("{}: {member} in it unpacks to more than {most} bytes, which no bundle has. Do: do not trust this file", name.display())]
    MemberTooLarge {
        /// The file.
        name: PathBuf,
        /// Which.
        member: &'static str,
        /// Most bytes that are unpacked.
        most: u64,
    },
    /// It is of another version.
    #[error("{}: expected schema {}, received `{schema}`. Do: judge it with the version of linesman that has written it: {tool}",
            name.display(), super::SCHEMA)]
    Schema {
        /// The file.
        name: PathBuf,
        /// Its schema.
        schema: String,
        /// The program that has written it.
        tool: String,
    },
    /// Its frames cannot be read.
    #[error(transparent)]
    Frames(#[from] CaptureError),
}
