//! `linesman capture timeline`: what happened, in order of time.

use std::path::PathBuf;

use linesman_capture::timing::timeline::{TimelineReport, timeline};

use super::source::FileTimes;
use super::survey::survey;
use crate::command::diagnose::tap::TapArguments;
use crate::command::line_access;
use crate::drawing::time_axis;
use crate::exit::Status;
use crate::failure::Failure;
use crate::files;
use crate::output::{Output, Paint, Table};
use crate::text::names::Names;
use crate::text::quantity::time;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// The capture; several are the files of a ring of files, or with --together files of the same time
    #[arg(value_name = "FILE", required = true)]
    places: Vec<String>,
    #[command(flatten)]
    times: FileTimes,
    #[command(flatten)]
    tap: TapArguments,
    /// Only trouble: errors, working counters that are too low, refused transfers, gaps, findings
    #[arg(long)]
    trouble: bool,
    /// Write a drawing: states of each SubDevice, and what happened, over time
    #[arg(long, value_name = "FILE.svg")]
    svg: Option<PathBuf>,
    /// JSON, schema linesman.capture-timeline/1
    #[arg(long)]
    pub(crate) json: bool,
}

/// Tells what happened. That judges nothing: the exit status is 0 once EtherCAT frames were found.
pub(super) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    if let Some(path) = &arguments.svg {
        files::refuse_to_overwrite(path)?;
    }
    let stop = line_access::stop()?;
    let Arguments { places, times, tap, .. } = arguments;
    let surveyed = survey(places, *times, tap, None, &stop, output)?;
    let mut told = timeline(&surveyed.report, &surveyed.engine.diagnosis());
    if arguments.trouble {
        told.events.retain(|event| event.trouble);
    }
    match arguments.json {
        true => output.json(&told),
        false => output.text(&text(&told, &surveyed.names, output.paint())),
    }
    if let Some(path) = &arguments.svg {
        let drawing = time_axis::file(&told, &surveyed.report, &surveyed.names);
        files::write_new(path, "the drawing", &drawing)?;
    }
    Ok(Status::Good)
}

fn text(told: &TimelineReport, names: &Names, paint: Paint) -> String {
    if told.events.is_empty() {
        return "nothing of note happened\n".to_owned();
    }
    let mut table = Table::new(&["time", "lasts", "frame", "kind", "where", "what"], paint);
    for event in &told.events {
        let lasts = event.to_ns.map(|to| to.0.saturating_sub(event.at_ns.0));
        table.row([
            time(event.at_ns.0),
            lasts.map_or_else(String::new, time),
            event.frame.map_or_else(String::new, |frame| frame.0.to_string()),
            event.kind.name().to_owned(),
            names.place_of(event.place.as_ref(), event.no),
            if event.trouble { paint.bad(&event.text) } else { event.text.clone() },
        ]);
    }
    table.render()
}
