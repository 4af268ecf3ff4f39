//! `linesman scan`: which SubDevices there are and how they are wired.

mod against;
pub(crate) mod report;
mod table;

use std::path::{Path, PathBuf};

use linesman_config::inventory::Inventory;
use linesman_config::project::Project;
use linesman_link::clock::HostClock;
use linesman_proto::time::Span;
use linesman_runtime::run as running;
use linesman_runtime::run::scan::PATIENCE;
use linesman_runtime::selector::Selector;
use linesman_runtime::transport::{Cards, Pace};

use super::line_access;
use crate::drawing;
use crate::exit::Status;
use crate::failure::Failure;
use crate::files::{self, Planned};
use crate::output::Output;
use crate::page;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Where the line is: eth0, eth0+eth1 (a ring) or sim:plant.toml
    #[arg(value_name = "WHERE")]
    pub(crate) place: String,
    /// Identities, controllers and error counters too
    #[arg(long, short)]
    verbose: bool,
    /// Write what was found as a project, to hold the line against later
    #[arg(long, value_name = "machine.toml")]
    save: Option<PathBuf>,
    /// Hold what was found against this project (TOML) or ENI (XML): exit status 1 when it differs
    #[arg(long, value_name = "machine.toml|ENI.xml", conflicts_with = "save")]
    against: Option<PathBuf>,
    /// Write a drawing of the line
    #[arg(long, value_name = "FILE.svg")]
    svg: Option<PathBuf>,
    /// JSON, schema linesman.scan/1
    #[arg(long)]
    pub(crate) json: bool,
}

/// A scan, with when it began.
struct Scan {
    inventory: Inventory,
    start: Option<String>,
}

/// Scans what the selector names.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let selector: Selector = arguments.place.parse()?;
    for path in [&arguments.save, &arguments.svg].into_iter().flatten() {
        files::refuse_to_overwrite(path)?;
    }
    let planned = match &arguments.against {
        Some(path) => {
            let project = Planned::open(path)?.project;
            let tree = project.tree().map_err(|error| files::in_file(path, &error))?;
            Some((project, tree))
        }
        None => None,
    };
    let scan = match &selector {
        Selector::Cards(names) => on_cards(names)?,
        Selector::Segment(path) => on_segment(path)?,
        Selector::Listen(_) | Selector::File(_) => {
            return Err(line_access::not_drivable(&arguments.place, &selector));
        }
    };
    let Scan { inventory, start } = &scan;
    let against = planned.map(|(project, tree)| against::against(&project, &tree, inventory));
    let is_as_planned = against.as_ref().is_none_or(against::Against::is_as_planned);
    if arguments.json {
        output.json(&report::report(inventory, start.clone(), against));
    } else {
        output.text(&table::text(inventory, arguments.verbose, output));
        if let Some(against) = &against {
            output.text(&against.text(output));
        }
    }
    if let Some(path) = &arguments.save {
        save(path, inventory)?;
        if !arguments.json {
            output.line(&format!("\nSaved as {}.", path.display()));
        }
    }
    if let Some(path) = &arguments.svg {
        let drawing = drawing::file(&page::scene::of_scan(inventory));
        files::write_new(path, "the drawing", &drawing)?;
    }
    Ok(if is_as_planned { Status::Good } else { Status::Findings })
}

/// Scans the line on these cards: listens first, looks, then addresses and reads.
fn on_cards(names: &[String]) -> Result<Scan, Failure> {
    line_access::refuse(names)?;
    let stop = line_access::stop()?;
    let clock = HostClock::start();
    let line = Cards::open(names, clock)?;
    let inventory = running::scan(line, PATIENCE, &stop)
        .map_err(|error| line_access::nobody(&error).at(&names.join("+")))?;
    Ok(Scan { inventory, start: clock.started_at().rfc3339() })
}

/// Scans the segment of a file, in virtual time.
fn on_segment(path: &Path) -> Result<Scan, Failure> {
    let line = line_access::virtual_line(path, Pace::Free)?;
    // Virtual seconds cost little.
    let patience = PATIENCE + Span::s(line.segment().tree().len() as u64);
    let inventory = running::scan(line, patience, &line_access::stop()?)
        .map_err(|error| line_access::nobody(&error))?;
    Ok(Scan { inventory, start: None })
}

fn save(path: &Path, inventory: &Inventory) -> Result<(), Failure> {
    let name = path.file_stem().map(|stem| stem.to_string_lossy()).unwrap_or_default();
    files::write_new(path, "the project", &Project::from_inventory(&name, inventory).to_toml())
}
