//! Networks of one run: what belongs to each, and the report of all.

use std::path::PathBuf;

use linesman_runtime::run::NetworkPlace;
use linesman_runtime::run::report::RunReport;
use serde::Serialize;

use super::Arguments;
use crate::failure::Failure;
use crate::text::quantity::count;
use crate::version;

/// Report of a run of several networks, as JSON.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(in crate::command) struct RunReports {
    /// `linesman.runs/1`.
    schema: String,
    /// Name and version of the program.
    tool: String,
    /// The networks, in the order of `--on`.
    networks: Vec<RunReport>,
}

impl RunReports {
    pub(super) fn of(networks: Vec<RunReport>) -> Self {
        Self { schema: "linesman.runs/1".to_owned(), tool: version::tool(), networks }
    }
}

/// Options of one network.
pub(super) struct NetworkChoices<'a> {
    pub(super) on: &'a str,
    pub(super) file: Option<&'a PathBuf>,
    pub(super) image: Option<&'a PathBuf>,
    pub(super) control: Option<&'a PathBuf>,
    pub(super) log: Option<&'a PathBuf>,
    /// Its place among several.
    pub(super) place: Option<NetworkPlace>,
}

/// The networks that are to be run, each with what belongs to it.
pub(super) fn networks(arguments: &Arguments) -> Result<Vec<NetworkChoices<'_>>, Failure> {
    let lines = &arguments.on;
    for (what, given) in [
        ("project or ENI file", arguments.files.len()),
        ("--image", arguments.image.len()),
        ("--control", arguments.control.len()),
        ("--log", arguments.log.len()),
    ] {
        if given > 0 && given != lines.len() {
            let (networks, given) = (count(lines.len() as u64, "network"), given as u64);
            return Err(Failure::new(
                format!("{what}: expected none or one for each of {networks} (--on), got {given}"),
                format!("give {what} as often as --on, in the same order, or leave it out"),
            ));
        }
    }
    let virtual_lines = lines.iter().filter(|on| on.starts_with("sim:")).count();
    if lines.len() > 1 {
        if virtual_lines > 0 && virtual_lines < lines.len() {
            let reason = format!(
                "--on {}: cards of this computer and virtual lines have no common time",
                lines.join(" --on ")
            );
            return Err(Failure::new(reason, "name cards only, or `sim:FILE` only"));
        }
        if let Some(twice) = lines.iter().enumerate().find(|(at, on)| lines[..*at].contains(on)) {
            let reason = format!("--on {}: this line is named twice", twice.1);
            return Err(Failure::new(reason, "name each line once"));
        }
        if arguments.bundles.bundles.is_some() {
            let reason = format!(
                "--bundles: expected one network, got {}",
                count(lines.len() as u64, "network")
            );
            let advice = "leave it out, or run each network by a `linesman run` of its own: then they \
                          have no common time";
            return Err(Failure::new(reason, advice));
        }
    }
    let mut places = match lines.len() {
        1 => Vec::new(),
        _ => NetworkPlace::of(lines),
    }
    .into_iter();
    let networks = lines.iter().enumerate().map(|(at, on)| NetworkChoices {
        on,
        file: arguments.files.get(at),
        image: arguments.image.get(at),
        control: arguments.control.get(at),
        log: arguments.log.get(at),
        place: places.next(),
    });
    Ok(networks.collect())
}
