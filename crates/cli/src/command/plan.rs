//! `linesman plan`: what follows from a project or network configuration, before anything is switched
//! on: frame table, load, E-bus budget, clock shifts, doubts.

mod ethernet;
pub(crate) mod report;
mod segment;
mod table;
mod timing;

use std::path::{Path, PathBuf};

use linesman_config::eni;
use linesman_config::plan::Severity;
use linesman_proto::time::Span;
use linesman_runtime::plan_file::{PlanFile, PlanFileError};

use crate::amount::cycle;
use crate::drawing::CyclePlot;
use crate::exit::Status;
use crate::failure::Failure;
use crate::files;
use crate::output::Output;

/// What can be asked.
#[derive(clap::Args, Debug)]
#[command(
    after_help = "Exit status: 0 nothing is doubtful, 1 there is a warning or an error, 2 no plan can be \
                  made of the file; with \
                  `--timing` also 1 a SubDevice is not in time, 3 one could not be judged."
)]
pub(crate) struct Arguments {
    /// A project (TOML) or a network configuration of another tool (ENI, XML)
    #[arg(value_name = "PROJECT.toml|ENI.xml")]
    file: PathBuf,
    /// Cycle time (500, 1ms), instead of that of the file, or where that has none
    #[arg(long, visible_alias = "cycle", value_name = "US", value_parser = cycle())]
    cycle_us: Option<Span>,
    /// Every SubDevice too: addresses, process data, what it adds to working counters
    #[arg(long, short)]
    verbose: bool,
    /// Write the plan as a network configuration (ENI) for the MainDevices of others
    #[arg(long, value_name = "F.xml")]
    export: Option<PathBuf>,
    /// Write a project made of an ENI: names, identities, addresses and wiring; says what the ENI does not hold
    #[arg(long, value_name = "machine.toml")]
    save: Option<PathBuf>,
    /// Write a virtual segment made of the plan, to run on it; its descriptions go beside it
    #[arg(long, value_name = "SEGMENT.toml")]
    segment: Option<PathBuf>,
    #[command(flatten)]
    timing: timing::TimingArguments,
    #[command(flatten)]
    ethernet: ethernet::EthernetPlanArguments,
    /// JSON, schema linesman.plan/1
    #[arg(long)]
    pub(crate) json: bool,
}

/// Makes the plan and shows it.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    for path in [&arguments.export, &arguments.segment, &arguments.save, &arguments.timing.svg]
        .into_iter()
        .flatten()
    {
        files::refuse_to_overwrite(path)?;
    }
    if arguments.save.is_some() && !files::is_xml(&arguments.file)? {
        let reason = format!("{}: it is a project already", arguments.file.display());
        return Err(Failure::new(reason, "leave out `--save`, or name an ENI (XML)"));
    }
    let file = PlanFile::open_with(&arguments.file, arguments.cycle_us)?;
    let mut doubts = file.plan.doubts();
    let ethernet = match arguments.ethernet.ethernet {
        true => Some(arguments.ethernet.report(&file.plan)?),
        false => None,
    };
    if ethernet.is_some() {
        doubts.extend(arguments.ethernet.doubts(&file.plan));
        doubts.sort_by_key(|doubt| std::cmp::Reverse(doubt.severity));
    }
    let options = arguments.timing.options(&file.plan)?;
    let timing = arguments.timing.timing.then(|| file.plan.timing(&options));
    let plot = timing.as_ref().map(|timing| CyclePlot::new(&file.plan, timing, &options));
    if arguments.json {
        output.json(&report::report(&file, &doubts, timing.as_ref(), ethernet));
    } else {
        output.text(&table::text(&file, &doubts, arguments.verbose, output));
        if let Some(ethernet) = &ethernet {
            output.text(&ethernet::text(ethernet, output));
        }
    }
    if let (Some(timing), Some(plot)) = (&timing, &plot) {
        if !arguments.json {
            output.text(&timing::text(&file.plan, timing, plot, output));
        }
        if let Some(path) = &arguments.timing.svg {
            files::write_new(path, "the drawing", &plot.file())?;
        }
    }
    if let Some(path) = &arguments.export {
        let text = eni::write(&file.name, &file.plan);
        files::write_new(path, "the network configuration", &text)?;
        say(&format!("\nExported to {}.", path.display()), arguments.json, output);
    }
    if let Some(path) = &arguments.segment {
        segment::write(path, &file)?;
        let advice = format!("\nSegment in {}: try `linesman scan sim:{0}`.", path.display());
        say(&advice, arguments.json, output);
    }
    if let Some(path) = &arguments.save {
        save(path, &arguments.file, arguments.json, output)?;
    }
    let bad = doubts.iter().any(|doubt| doubt.severity >= Severity::Warning);
    let proven = timing.as_ref().map_or(Status::Good, timing::status);
    Ok(if bad { Status::Findings } else { proven })
}

/// Writes the project that an ENI makes.
fn save(path: &Path, file: &Path, json: bool, output: &mut Output) -> Result<(), Failure> {
    let eni = files::eni(file)?;
    files::write_new(path, "the project", &eni.project().to_toml())?;
    say(&format!("\nSaved as {}. The ENI does not hold:", path.display()), json, output);
    for lack in eni.lacks() {
        say(&format!("- {lack}"), json, output);
    }
    let rest = "Process data, start-up commands and clocks stay in the ENI: `linesman run` takes it as it is.";
    say(rest, json, output);
    Ok(())
}

fn say(text: &str, json: bool, output: &mut Output) {
    if !json {
        output.line(text);
    }
}

impl From<PlanFileError> for Failure {
    fn from(error: PlanFileError) -> Self {
        Self::from_error(&error)
    }
}
