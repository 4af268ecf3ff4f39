//! The file that a line is planned with: a project (TOML), or a network configuration of another tool
//! (ENI).

mod index;
pub mod library;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use linesman_config::eni::{Eni, EniError};
use linesman_config::plan::{CycleError, Plan};
use linesman_config::profile::ClockMode;
use linesman_config::project::{Project, ProjectDevice, ProjectError, ResolveError};

use linesman_proto::time::Span;

use self::library::Library;
use crate::named_files::read_at_most;

/// Longest file that is read, in bytes; the largest configurations have some 20 MB.
const MAX_LEN: u64 = 256 * 1024 * 1024;

/// What a file says.
#[derive(Clone, Debug)]
pub struct PlanFile {
    /// What the network is called.
    pub name: String,
    /// What follows.
    pub plan: Plan,
    /// The project, if it is one.
    pub project: Option<Project>,
    /// What was odd, for people.
    pub notes: Vec<String>,
}

/// Why there is no plan.
#[derive(Debug, thiserror::Error)]
pub enum PlanFileError {
    /// The file cannot be read.
    #[error("{path}: reading a project or network configuration: {source}. Do: check the path")]
    Read {
        /// Which.
        path: String,
        /// Why.
        source: std::io::Error,
    },
    /// It is too long for what it should be.
    #[error(
        "{path}: {len} bytes, expected a project (TOML) or a network configuration (ENI). Do: check the path"
    )]
    TooLong {
        /// Which.
        path: String,
        /// Bytes.
        len: u64,
    },
    /// It is no text.
    #[error(
        "{path}: at byte {at}: no text in UTF-8, expected a project in TOML. Do: check that this is the right \
         file"
    )]
    NoText {
        /// Which.
        path: String,
        /// Where.
        at: usize,
    },
    /// It is a network configuration that cannot be used.
    #[error("{path}: {}", advised(.source, "export it again from the tool that wrote it, or correct it there"))]
    Eni {
        /// Which.
        path: String,
        /// Why.
        source: EniError,
    },
    /// It is no project.
    #[error("{path}: {}", advised(.source, "correct it there; `linesman schema project` lists all keys"))]
    Project {
        /// Which.
        path: String,
        /// Why.
        source: Box<ProjectError>,
    },
    /// The project cannot be planned.
    #[error("{path}: {}", advised(.source, "correct the project there"))]
    Resolve {
        /// Which.
        path: String,
        /// Why.
        source: Box<ResolveError>,
    },
    /// It does not take the cycle time that was wanted.
    #[error("{path}: a cycle of {cycle} cannot be had: {source}")]
    Cycle {
        /// Which.
        path: String,
        /// The wanted one.
        cycle: Span,
        /// Why.
        source: CycleError,
    },
    /// Descriptions cannot be read.
    #[error(
        "{path}: esi = \"{folder}\": {reason}. Do: name a folder of XML files, or one of them, relative to the project"
    )]
    Descriptions {
        /// Of which project.
        path: String,
        /// Which folder.
        folder: String,
        /// Why.
        reason: String,
    },
}

/// The words of an error, with advice where it has none of its own.
fn advised(error: &dyn std::error::Error, advice: &str) -> String {
    let words = error.to_string();
    let words = words.trim_end();
    if words.contains(". Do: ") { words.to_owned() } else { format!("{words}. Do: {advice}") }
}

impl PlanFile {
    /// Reads a file and makes its plan.
    ///
    /// # Errors
    /// [`PlanFileError`] says where and why.
    pub fn open(path: &Path) -> Result<Self, PlanFileError> {
        Self::open_with(path, None)
    }

    /// The same with another cycle time than it says, or one where it says none.
    ///
    /// # Errors
    /// [`PlanFileError`]; also when the plan does not take that cycle time.
    pub fn open_with(path: &Path, cycle: Option<Span>) -> Result<Self, PlanFileError> {
        let shown = path.display().to_string();
        let read = |source| PlanFileError::Read { path: shown.clone(), source };
        let len = std::fs::metadata(path).map_err(read)?.len();
        if len > MAX_LEN {
            return Err(PlanFileError::TooLong { path: shown, len });
        }
        let bytes = read_at_most(path, MAX_LEN).map_err(read)?;
        let is_xml = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("xml"));
        if is_xml || Eni::is_one(&bytes) {
            let eni = Eni::parse_with(&bytes, cycle);
            let Eni { name, mut plan, notes, .. } =
                eni.map_err(|source| PlanFileError::Eni { path: shown.clone(), source })?;
            if let Some(cycle) = cycle {
                let refused = |source| PlanFileError::Cycle { path: shown, cycle, source };
                plan.set_cycle(cycle).map_err(refused)?;
            }
            return Ok(Self { name, plan, project: None, notes });
        }
        let text = String::from_utf8(bytes).map_err(|error| {
            let at = error.utf8_error().valid_up_to();
            PlanFileError::NoText { path: shown.clone(), at }
        })?;
        let mut project = Project::parse(&text).map_err(|source| PlanFileError::Project {
            path: shown.clone(),
            source: Box::new(source),
        })?;
        if let Some(cycle) = cycle {
            let refused = |source| PlanFileError::Cycle { path: shown.clone(), cycle, source };
            project.set_cycle(cycle).map_err(refused)?;
        }
        let mut library = library_of(&project, path, &shown)?;
        let (mut rules, mut changed) = (BTreeMap::new(), Vec::new());
        let plan = project
            .plan(&mut |device| {
                let found = library.find(device)?;
                let rule = found.as_ref().and_then(|found| found.revision_rule);
                rules.extend(rule.map(|rule| (device.name.clone(), rule)));
                let modes = found.as_ref().map_or(&[][..], |found| &found.profile.clock_modes);
                changed.extend(clock_changed(&project, device, modes));
                Ok(found)
            })
            .map_err(|source| PlanFileError::Resolve { path: shown, source: Box::new(source) })?;
        // Whoever compares with the project compares as the makers want it.
        for device in &mut project.devices {
            device.revision_rule = device.revision_rule.or(rules.get(&device.name).copied());
        }
        let mut notes = library.take_notes();
        notes.extend(changed);
        Ok(Self { name: project.name.clone(), plan, project: Some(project), notes })
    }
}

/// What a person should know who has set a clock otherwise than its maker did.
fn clock_changed(project: &Project, device: &ProjectDevice, modes: &[ClockMode]) -> Option<String> {
    let choice = device.clock.as_ref()?;
    let changes = choice.changes(modes, project.cycle_of(device));
    let mode = choice.mode.as_deref().filter(|_| !changes.is_empty())?;
    Some(format!(
        "{}: its clock is set otherwise than its maker describes mode `{mode}`: {}; leave these keys of `clock` out \
         unless that is meant",
        device.name,
        changes.join(", ")
    ))
}

/// The descriptions that a project names, relative to where it is.
fn library_of(project: &Project, path: &Path, shown: &str) -> Result<Library, PlanFileError> {
    let beside = path.parent().unwrap_or(Path::new(""));
    let mut library = Library::default();
    for folder in &project.esi {
        let place: PathBuf = beside.join(folder);
        library.add(&place).map_err(|source| PlanFileError::Descriptions {
            path: shown.to_owned(),
            folder: folder.clone(),
            reason: format!("{}: {source}", place.display()),
        })?;
    }
    Ok(library)
}
