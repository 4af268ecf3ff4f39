//! `linesman log`: what happened on networks, also long after the program that ran them has ended.

use std::path::PathBuf;

use linesman_link::unix_time::UnixTime;
use linesman_maindevice::watch::{EntryKind, Severity};
use linesman_runtime::event_log::{EventLog, Filter, LoggedFinding, Run, StoredEntry};
use serde::Serialize;

use crate::amount::{self, SECOND};
use crate::exit::Status;
use crate::failure::Failure;
use crate::output::{Output, Table};
use crate::version;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// The event log, as `run --log` wrote it
    file: PathBuf,
    /// Not before: a time ("2026-03-01 10:16:50" in the time zone of this host, 2026-03-01T10:16:50Z) or how
    /// long ago (90s, 10m, 2h, 3d)
    #[arg(long, value_name = "TIME")]
    since: Option<String>,
    /// Not after
    #[arg(long, value_name = "TIME")]
    until: Option<String>,
    /// At least this bad
    #[arg(long, value_parser = severity)]
    severity: Option<Severity>,
    /// What about; may be given several times
    #[arg(long, value_parser = kind)]
    kind: Vec<EntryKind>,
    /// SubDevice, by number or name
    #[arg(long, value_name = "NO|NAME")]
    device: Option<String>,
    /// One run, by number; `last` is the newest
    #[arg(long, value_name = "NO|last")]
    run: Option<String>,
    /// Words in the text
    #[arg(long, value_name = "WORDS")]
    text: Option<String>,
    /// The newest so many
    #[arg(long, short = 'n', value_name = "COUNT", value_parser = amount::count(0, u32::MAX.into()))]
    limit: Option<u64>,
    /// The runs, not their entries
    #[arg(long, conflicts_with_all = ["csv", "limit"])]
    runs: bool,
    /// For spreadsheets
    #[arg(long, conflicts_with = "json")]
    csv: bool,
    /// JSON, schema linesman.log/1
    #[arg(long)]
    pub(crate) json: bool,
}

fn severity(word: &str) -> Result<Severity, String> {
    let words = Severity::ALL.map(Severity::name).join(", ");
    Severity::from_name(word).ok_or_else(|| format!("expected one of {words}"))
}

/// A kind of entries by its name.
pub(super) fn kind(word: &str) -> Result<EntryKind, String> {
    let words = EntryKind::ALL.map(EntryKind::name).join(", ");
    EntryKind::from_name(word).ok_or_else(|| format!("expected one of {words}"))
}

/// The answer as JSON.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct LogReport {
    /// `linesman.log/1`.
    schema: String,
    /// Name and version of the program.
    tool: String,
    /// Entries in the file, with those that were not asked for.
    of: u64,
    /// The runs that the entries are of; with `--runs`, all.
    runs: Vec<RunReport>,
    /// The entries, the oldest first; empty with `--runs`.
    entries: Vec<EntryReport>,
}

/// A run.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct RunReport {
    /// Its number in the file.
    run: i64,
    /// When it began, RFC 3339.
    started: String,
    /// When it ended; `null`: it runs, or was killed.
    ended: Option<String>,
    /// The line: `eth0`.
    line: String,
    /// Name of the project.
    project: String,
    /// The program that ran it.
    tool: String,
}

/// An entry.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct EntryReport {
    /// Of which run.
    run: i64,
    /// When, RFC 3339.
    time: String,
    /// `info`, `warning` or `error`.
    severity: String,
    /// What about: `communication`, `abnormal-state`, …
    kind: String,
    /// Number of the SubDevice, from 1; `null`: the network.
    no: Option<u32>,
    /// Its name.
    device: Option<String>,
    /// What happened.
    text: String,
    /// The finding that it is about, and what became of it; `null`: it is about something else.
    finding: Option<LoggedFinding>,
}

impl From<&Run> for RunReport {
    fn from(run: &Run) -> Self {
        Self {
            run: run.id,
            started: run.started.to_string(),
            ended: run.ended.map(|time| time.to_string()),
            line: run.line.clone(),
            project: run.project.clone(),
            tool: run.tool.clone(),
        }
    }
}

impl From<&StoredEntry> for EntryReport {
    fn from(entry: &StoredEntry) -> Self {
        Self {
            run: entry.run,
            time: entry.at.to_string(),
            severity: entry.severity.name().to_owned(),
            kind: entry.kind.name().to_owned(),
            no: entry.device_no,
            device: entry.device_name.clone(),
            text: entry.text.clone(),
            finding: entry.finding.clone(),
        }
    }
}

/// Shows a log.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let log = EventLog::open(&arguments.file)?;
    let runs = log.runs()?;
    let filter = filter(arguments, &runs)?;
    let mut entries = if arguments.runs { Vec::new() } else { log.entries(&filter)? };
    // Answers call a SubDevice by name and type; the log has the name.
    let bare = filter
        .device_name
        .as_deref()
        .and_then(|called| called.rsplit_once(" ("))
        .map(|(name, _)| name);
    if let Some(name) = bare.filter(|_| entries.is_empty()) {
        entries = log.entries(&Filter { device_name: Some(name.to_owned()), ..filter.clone() })?;
    }
    let of = log.count()?;
    let shown = |run: &&Run| arguments.runs || entries.iter().any(|entry| entry.run == run.id);
    if arguments.json {
        output.json(&LogReport {
            schema: "linesman.log/1".to_owned(),
            tool: version::tool(),
            of,
            runs: runs.iter().filter(shown).map(RunReport::from).collect(),
            entries: entries.iter().map(EntryReport::from).collect(),
        });
    } else if arguments.csv {
        output.raw("run,time,severity,kind,no,device,text\n");
        for entry in &entries {
            let fields = [
                entry.run.to_string(),
                entry.at.to_string(),
                entry.severity.name().to_owned(),
                entry.kind.name().to_owned(),
                entry.device_no.map(|no| no.to_string()).unwrap_or_default(),
                entry.device_name.clone().unwrap_or_default(),
                entry.text.clone(),
            ];
            output.raw(&format!("{}\n", fields.map(|field| csv(&field)).join(",")));
        }
    } else if arguments.runs {
        show_runs(&runs, output);
    } else {
        show_entries(&entries, of, output);
    }
    Ok(Status::Good)
}

fn show_runs(runs: &[Run], output: &mut Output) {
    let mut table = Table::new(&["run", "began", "ended", "line", "project", "by"], output.paint());
    for run in runs {
        table.row([
            run.id.to_string(),
            run.started.local(),
            run.ended.map_or_else(|| "-".to_owned(), UnixTime::local),
            run.line.clone(),
            run.project.clone(),
            run.tool.clone(),
        ]);
    }
    output.text(&table.render());
}

fn show_entries(entries: &[StoredEntry], of: u64, output: &mut Output) {
    let paint = output.paint();
    for entry in entries {
        let word = match entry.severity {
            Severity::Error => paint.bad("error  "),
            Severity::Warning => paint.warning("warning"),
            Severity::Info => "info   ".to_owned(),
        };
        output.line(&format!("{}  {word}  {}", entry.at.local(), entry.text));
    }
    output.line(&format!("{} of {of} entries", entries.len()));
}

/// A field of a CSV file (RFC 4180). What a spreadsheet would take for a formula is made text.
fn csv(field: &str) -> String {
    let field = match field.starts_with(['=', '+', '-', '@']) {
        true => format!("'{field}"),
        false => field.to_owned(),
    };
    match field.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", field.replace('"', "\"\"")),
        false => field,
    }
}

fn filter(arguments: &Arguments, runs: &[Run]) -> Result<Filter, Failure> {
    let run = match arguments.run.as_deref() {
        None => None,
        Some("last") => Some(runs.last().map_or(0, |run| run.id)),
        Some(word) => {
            let known = word.parse().ok().filter(|no| runs.iter().any(|run| run.id == *no));
            let unknown = || {
                Failure::new(
                    format!(
                        "{}: there is no run `{word}`; it has {} runs",
                        arguments.file.display(),
                        runs.len()
                    ),
                    format!("`linesman log {} --runs` lists them", arguments.file.display()),
                )
            };
            Some(known.ok_or_else(unknown)?)
        }
    };
    let (device_no, device_name) = match arguments.device.as_deref() {
        None => (None, None),
        Some(word) => {
            let word = word.trim_matches(['\'', '"']);
            match word.strip_prefix("SubDevice ").unwrap_or(word).parse() {
                Ok(no) => (Some(no), None),
                Err(_) => (None, Some(word.to_owned())),
            }
        }
    };
    Ok(Filter {
        since: arguments.since.as_deref().map(time).transpose()?,
        until: arguments.until.as_deref().map(time).transpose()?,
        severity: arguments.severity,
        kinds: arguments.kind.clone(),
        device_no,
        device_name,
        run,
        text: arguments.text.clone(),
        limit: arguments.limit.map(|limit| u32::try_from(limit).unwrap_or(u32::MAX)),
    })
}

/// A point in time, or how long ago.
fn time(word: &str) -> Result<UnixTime, Failure> {
    UnixTime::parse_local(word).or_else(|| ago(word)).ok_or_else(|| {
        Failure::new(
            format!("`{word}` is no time"),
            "write a time as 2026-03-01 10:16:50 or 2026-03-01T10:16:50Z, or how long ago as 90s, 10m, \
             2h or 3d",
        )
    })
}

fn ago(word: &str) -> Option<UnixTime> {
    // A plain number would be no time, and no length of time either.
    let span = amount::span(word, SECOND).filter(|_| word.ends_with(char::is_alphabetic))?;
    let now = linesman_link::clock::HostClock::start().started_at();
    Some(UnixTime::from_nanos(now.as_nanos() - i128::from(span.as_nanos())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_of_a_spreadsheet_are_text() {
        assert_eq!(csv("plain"), "plain");
        assert_eq!(csv("a, \"b\""), "\"a, \"\"b\"\"\"");
        assert_eq!(csv("=1+1"), "'=1+1");
    }

    #[test]
    fn times_are_read_or_refused() {
        let at = time("2026-03-01T10:16:50.182Z").unwrap();
        assert_eq!(time(&at.local()), Ok(at), "as it is shown");
        assert_eq!(time("2026-03-01 00:00:00"), time("2026-03-01"));
        assert!(time("10m").unwrap() < time("5m").unwrap());
        assert!(time("yesterday").is_err());
        assert!(time("").is_err());
    }
}
