//! Files that users write: read as a whole, with messages that say which file and where.

use std::fs;
use std::path::Path;

use linesman_config::project::Project;
pub(crate) use linesman_runtime::named_files::NamedFiles;
use linesman_runtime::named_files::{MAX_DESCRIPTION, read_at_most};
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::SegmentFile;

use crate::failure::Failure;

/// Longest text file that is read, in bytes; nobody writes more by hand.
const MAX_TEXT: u64 = 16 * 1024 * 1024;

/// The text of a file.
pub(crate) fn text(path: &Path, what: &str) -> Result<String, Failure> {
    let name = path.display();
    let refuse = |error| unread(path, what, &error);
    let len = fs::metadata(path).map_err(refuse)?.len();
    if len > MAX_TEXT {
        let reason = format!("{name}: {len} bytes, expected {what}, a text of at most {MAX_TEXT}");
        return Err(Failure::new(reason, "check the path"));
    }
    let bytes = read_at_most(path, MAX_TEXT).map_err(refuse)?;
    String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        let reason = format!("{name}: at byte {at}: no text in UTF-8, expected {what} in TOML");
        let advice = "check that this is the right file; save it as UTF-8; for a capture say \
                      `capture:FILE`";
        Failure::new(reason, advice)
    })
}

/// Why a file was not read.
fn unread(path: &Path, what: &str, error: &std::io::Error) -> Failure {
    let name = path.display();
    if error.kind() == std::io::ErrorKind::NotFound {
        return Failure::new(
            format!("{name}: there is no such file, expected {what}"),
            "check the path",
        );
    }
    let advice = "check that it is a file which you may read (`ls -l`)";
    Failure::new(format!("{name}: reading {what}: {error}"), advice)
}

/// What a segment file describes.
pub(crate) struct Plant {
    /// What was planned: the file without its faults.
    pub(crate) project: Project,
    /// What is there.
    pub(crate) segment: Segment,
}

impl Plant {
    /// Reads and builds the segment of a file.
    pub(crate) fn open(path: &Path) -> Result<Self, Failure> {
        let file = segment_file(path)?;
        let project = file.project().map_err(|error| in_file(path, &error))?;
        let segment = Segment::build(&file).map_err(|error| in_file(path, &error))?;
        Ok(Self { project, segment })
    }
}

/// A segment file.
pub(crate) fn segment_file(path: &Path) -> Result<SegmentFile, Failure> {
    let text = text(path, "a segment file")?;
    SegmentFile::parse_with(&text, &NamedFiles::of(path)).map_err(|error| in_file(path, &error))
}

/// The bytes of a file that is not for people, of at most `most` bytes.
pub(crate) fn bytes(path: &Path, what: &str, most: u64) -> Result<Vec<u8>, Failure> {
    let refuse = |error| unread(path, what, &error);
    let len = fs::metadata(path).map_err(refuse)?.len();
    if len > most {
        let reason = format!("{}: {len} bytes, expected {what} of at most {most}", path.display());
        return Err(Failure::new(reason, "check the path"));
    }
    read_at_most(path, most).map_err(refuse)
}

/// A device description.
pub(crate) fn description(path: &Path) -> Result<Vec<u8>, Failure> {
    bytes(path, "a device description", MAX_DESCRIPTION)
}

/// A project file.
pub(crate) fn project(path: &Path) -> Result<Project, Failure> {
    let text = text(path, "a project")?;
    Project::parse(&text).map_err(|error| in_file(path, &error))
}

/// Refuses a path where something is already, or in a folder that is not there.
pub(crate) fn refuse_to_overwrite(path: &Path) -> Result<(), Failure> {
    if path.exists() {
        let reason = format!("{}: the file is there already", path.display());
        return Err(Failure::new(reason, "name another one, or move this one away"));
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
        let reason = format!("{}: there is no folder {}", path.display(), folder.display());
        return Err(Failure::new(reason, "name a file in a folder that is there, or make it"));
    }
    Ok(())
}

/// Writes a text file that is not there yet.
pub(crate) fn write_new(path: &Path, what: &str, text: &str) -> Result<(), Failure> {
    write_new_bytes(path, what, text.as_bytes())
}

/// Writes a file that is not there yet.
pub(crate) fn write_new_bytes(path: &Path, what: &str, bytes: &[u8]) -> Result<(), Failure> {
    refuse_to_overwrite(path)?;
    fs::write(path, bytes).map_err(|error| {
        let reason = format!("{}: writing {what}: {error}", path.display());
        Failure::new(reason, "check the rights of the directory and its free space")
    })
}

/// An error inside a file.
pub(crate) fn in_file(path: &Path, error: &dyn std::error::Error) -> Failure {
    in_file_of(path, error, "correct the file there")
}

/// An error inside a file of a kind, with advice where the error has none.
pub(crate) fn in_file_of(path: &Path, error: &dyn std::error::Error, advice: &str) -> Failure {
    let mut failure = Failure::from_error(error);
    failure.reason = format!("{}: {}", path.display(), failure.reason.trim_end());
    if failure.next_step.is_empty() {
        advice.clone_into(&mut failure.next_step);
    }
    failure
}
