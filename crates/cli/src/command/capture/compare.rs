//! `linesman capture compare`: what differs between two captures of a line.

use linesman_capture::comparison::{ChangeReport, ComparisonReport, Tendency, compare};

use super::source::FileTimes;
use super::survey::{Surveyed, survey};
use crate::command::diagnose::tap::TapArguments;
use crate::command::line_access;
use crate::exit::Status;
use crate::failure::Failure;
use crate::output::{Output, Paint, Table};
use crate::text::names::Names;

/// What can be asked.
#[derive(clap::Args, Debug)]
#[command(
    after_help = "Exit status: 0 nothing differs, 1 something does, 2 one of them could not be read."
)]
pub(crate) struct Arguments {
    /// The first capture: before
    #[arg(value_name = "BEFORE")]
    before: String,
    /// The second one: after
    #[arg(value_name = "AFTER")]
    after: String,
    /// JSON, schema linesman.capture-comparison/1
    #[arg(long)]
    pub(crate) json: bool,
}

/// Compares them.
pub(super) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let stop = line_access::stop()?;
    let one = std::slice::from_ref::<String>;
    let by_card = TapArguments::default();
    let times = FileTimes::default();
    let before = survey(one(&arguments.before), times, &by_card, None, &stop, output)?;
    let after = survey(one(&arguments.after), times, &by_card, None, &stop, output)?;
    let diagnosis = |one: &Surveyed| one.engine.diagnosis();
    let found = compare((&before.report, &diagnosis(&before)), (&after.report, &diagnosis(&after)));
    let status = if found.changes.is_empty() { Status::Good } else { Status::Findings };
    match arguments.json {
        true => output.json(&found),
        false => output.text(&text(&found, &before.names, &after.names, output.paint())),
    }
    Ok(status)
}

fn text(found: &ComparisonReport, before: &Names, after: &Names, paint: Paint) -> String {
    if found.changes.is_empty() {
        return "nothing differs of what both captures show\n".to_owned();
    }
    let mut table = Table::new(&["", "what", "where", "before", "after"], paint);
    for change in &found.changes {
        let names = if change.after.is_some() { after } else { before };
        let value = |value: &Option<String>| value.clone().unwrap_or_else(|| "-".to_owned());
        table.row([
            mark(change, paint),
            change.what.clone(),
            place(change, names),
            value(&change.before),
            value(&change.after),
        ]);
    }
    table.render()
}

fn mark(change: &ChangeReport, paint: Paint) -> String {
    match change.tendency {
        Tendency::Better => paint.good("better"),
        Tendency::Worse => paint.bad("worse"),
        Tendency::Other => paint.faint("other"),
    }
}

fn place(change: &ChangeReport, names: &Names) -> String {
    match (&change.place, change.no) {
        (Some(place), _) => names.place(place),
        (None, Some(no)) => names.device(no),
        (None, None) => String::new(),
    }
}
