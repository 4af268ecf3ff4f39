//! Files that users write: read as a whole, with messages that say which file and where.

use std::collections::BTreeSet;
use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use linesman_config::eni::Eni;
use linesman_config::plan::PlannedExchange;
use linesman_config::project::Project;
use linesman_link::input::Input;
use linesman_link::whole_file;
use linesman_proto::time::Span;
pub(crate) use linesman_runtime::named_files::NamedFiles;
use linesman_runtime::named_files::{MAX_DESCRIPTION, read_at_most};
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::SegmentFile;

use crate::failure::Failure;

/// Longest text file that is read, in bytes; nobody writes more by hand.
const MAX_TEXT: u64 = 16 * 1024 * 1024;
/// Longest ENI file that is read, in bytes; the largest have some 20 MB.
const MAX_ENI: u64 = 256 * 1024 * 1024;

/// The text of a file.
pub(crate) fn text(path: &Path, what: &str) -> Result<String, Failure> {
    let name = path.display();
    let refuse = |error| unread(path, what, &error);
    let len = fs::metadata(path).map_err(refuse)?.len();
    if len > MAX_TEXT {
        let reason = format!("{name}: {len} bytes, expected {what}, a text of at most {MAX_TEXT}");
        return Err(Failure::new(reason, "check the path"));
    }
    decoded(path, read_at_most(path, MAX_TEXT).map_err(refuse)?, what)
}

/// The bytes of an input that is a text in some encoding.
pub(crate) fn bytes_of(input: Input, what: &str) -> Result<Vec<u8>, Failure> {
    let path = input.name().to_owned();
    let mut bytes = Vec::new();
    let read = input.into_stream().take(MAX_TEXT + 1).read_to_end(&mut bytes);
    read.map_err(|error| unread(&path, what, &error))?;
    if bytes.len() as u64 > MAX_TEXT {
        let name = path.display();
        let reason = format!("{name}: expected {what}, a text of at most {MAX_TEXT} bytes");
        return Err(Failure::new(reason, "check that this is the right file"));
    }
    Ok(bytes)
}

fn decoded(path: &Path, bytes: Vec<u8>, what: &str) -> Result<String, Failure> {
    String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        let reason = format!("{}: at byte {at}: no text in UTF-8, expected {what}", path.display());
        Failure::new(reason, "check that this is the right file; save it as UTF-8")
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

/// What a line is held against: a project (TOML), or a network configuration of another tool (ENI, XML).
#[derive(Clone)]
pub(crate) struct Planned {
    /// The SubDevices and their wiring.
    pub(crate) project: Project,
    /// Their process data, where the file says them.
    pub(crate) exchange: PlannedExchange,
}

impl Planned {
    /// Reads a file; its content says which kind it is.
    pub(crate) fn open(path: &Path) -> Result<Self, Failure> {
        if !is_xml(path)? {
            let project = project(path)?;
            return Ok(Self { project, exchange: PlannedExchange::default() });
        }
        let eni = eni(path)?;
        if !eni.is_wired {
            let reason = format!(
                "{}: the ENI does not say how its {} SubDevices are wired (no PreviousPort)",
                path.display(),
                eni.plan.devices.len()
            );
            let advice = format!(
                "export it again with the topology, or make a project of it, correct its wiring there and name that: \
                 `linesman plan {} --save machine.toml`",
                path.display()
            );
            return Err(Failure::new(reason, advice));
        }
        Ok(Self { project: eni.project(), exchange: eni.plan.exchange() })
    }
}

/// A network configuration of another tool.
pub(crate) fn eni(path: &Path) -> Result<Eni, Failure> {
    let bytes = bytes(path, "a network configuration (ENI)", MAX_ENI)?;
    // Who compares needs no cycle time, which a file need not have.
    let eni = Eni::parse_with(&bytes, Some(Span::ms(1)));
    let advice = "export the ENI again from the tool that wrote it, or correct it there";
    eni.map_err(|error| in_file_of(path, &error, advice))
}

/// Whether a file is XML, in any of its encodings: it begins with `<`, which no TOML does.
pub(crate) fn is_xml(path: &Path) -> Result<bool, Failure> {
    let refuse = |error| unread(path, "a project or an ENI file", &error);
    let mut head = Vec::new();
    let file = fs::File::open(path).map_err(refuse)?;
    file.take(256).read_to_end(&mut head).map_err(refuse)?;
    let text = String::from_utf8_lossy(&head);
    let first =
        text.chars().find(|one| !one.is_whitespace() && !"\0\u{FEFF}\u{FFFD}".contains(*one));
    Ok(first == Some('<'))
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

/// Refuses captures that are read as one recording where one of them is no file, as each is read twice, or is named twice.
pub(crate) fn refuse_what_is_no_file(paths: &[PathBuf]) -> Result<(), Failure> {
    let mut seen = BTreeSet::new();
    for path in paths {
        let shown = path.display();
        let Ok(real) = path.canonicalize() else {
            return Err(Failure::new(format!("{shown}: there is no such file"), "check the path"));
        };
        if !real.is_file() {
            let reason = format!(
                "{shown}: this is no file, and a recording in several parts is read from files"
            );
            return Err(Failure::new(reason, "name the files of one recording"));
        }
        if !seen.insert(real) {
            return Err(Failure::new(
                format!("{shown}: the file is named twice"),
                "name each file once",
            ));
        }
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
    whole_file::create(path, bytes).map_err(|error| unwritten(path, what, &error))
}

/// Writes a file in place of the one that is there.
pub(crate) fn replace(path: &Path, what: &str, text: &str) -> Result<(), Failure> {
    whole_file::replace(path, text.as_bytes()).map_err(|error| unwritten(path, what, &error))
}

fn unwritten(path: &Path, what: &str, error: &std::io::Error) -> Failure {
    let reason = format!("{}: writing {what}: {error}", path.display());
    Failure::new(reason, "check the rights of the directory and its free space")
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
