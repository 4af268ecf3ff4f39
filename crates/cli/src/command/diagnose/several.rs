//! Several files, told in a line each.

use linesman_diagnosis::report::{Diagnosis, Verdict};
use linesman_runtime::selector::Selector;
use linesman_runtime::stop::Stop;
use serde::Serialize;

use super::{Arguments, DiagnosisRun, file, line_access, status};
use crate::exit::Status;
use crate::failure::{ErrorReport, Failure};
use crate::files::Planned;
use crate::output::{Output, Paint, Table};
use crate::text::finding::{severity_word, tally};
use crate::text::names::Names;
use crate::text::quantity::count;
use crate::version;

/// The answer as JSON.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Diagnoses {
    /// `linesman.diagnoses/1`.
    schema: String,
    /// Name and version of the program.
    tool: String,
    /// The files, in the order in which they were given.
    files: Vec<FileReport>,
}

/// One file. Either `diagnosis` or `error` is there.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct FileReport {
    /// Its name, as it was given.
    file: String,
    /// What was found in it.
    diagnosis: Option<Diagnosis>,
    /// Why it could not be judged.
    error: Option<ErrorReport>,
}

/// A file that was looked at.
struct JudgedFile {
    name: String,
    result: Result<(Diagnosis, Names), Failure>,
}

/// Judges each file for itself.
pub(super) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let selectors = selectors(arguments)?;
    let project = arguments.project.as_deref().map(Planned::open).transpose()?;
    let stop = line_access::stop()?;
    let mut all = Vec::new();
    for (selector, name) in selectors.iter().zip(&arguments.places) {
        let result = judge(selector, arguments, project.clone(), &stop, output);
        all.push(JudgedFile { name: name.clone(), result });
    }
    let worst = all.iter().map(JudgedFile::status).max_by_key(|status| weight(*status));
    if arguments.json {
        let (schema, tool) = ("linesman.diagnoses/1".to_owned(), version::tool());
        let files = all.into_iter().map(JudgedFile::report).collect();
        output.json(&Diagnoses { schema, tool, files });
    } else {
        output.text(&text(&all, output));
    }
    Ok(worst.unwrap_or(Status::NotJudged))
}

/// What each word means: only files can be judged one after the other.
fn selectors(arguments: &Arguments) -> Result<Vec<Selector>, Failure> {
    let misplaced = [
        ("--html", arguments.html.is_some()),
        ("--svg", arguments.svg.is_some()),
        ("--devices", arguments.devices),
        ("--record", arguments.record.is_some()),
        ("--seconds", arguments.seconds.is_some()),
        ("--follow", arguments.follow),
        ("--active", arguments.active),
        ("--to", arguments.to.is_some()),
        ("--ask", arguments.ask),
    ];
    if let Some((option, _)) = misplaced.into_iter().find(|(_, is_given)| *is_given) {
        let files = count(arguments.places.len() as u64, "file");
        let reason = format!("{files} and `{option}`, which is for one");
        return Err(Failure::new(reason, format!("leave out `{option}`, or name one file")));
    }
    let mut all = Vec::new();
    for place in &arguments.places {
        match Selector::resolve(place) {
            Ok(selector @ Selector::File(_)) => all.push(selector),
            Ok(selector) => {
                let reason = format!("`{selector}`: this is no file; of several places all are");
                return Err(Failure::new(reason, format!("`linesman diagnose {selector}`")));
            }
            Err(error) => return Err(error.into()),
        }
    }
    Ok(all)
}

fn judge(
    selector: &Selector,
    arguments: &Arguments,
    project: Option<Planned>,
    stop: &Stop,
    output: &mut Output,
) -> Result<(Diagnosis, Names), Failure> {
    let Selector::File(path) = selector else { return Err(not_looked_at(selector)) };
    if stop.is_set() || output.is_closed() {
        return Err(not_looked_at(selector));
    }
    let mut session = DiagnosisRun::new(arguments, selector, project, None);
    let judged = file::judge(path, stop, &mut session, output)?;
    Ok((session.diagnosis(&judged.engine), judged.names))
}

fn not_looked_at(selector: &Selector) -> Failure {
    Failure::new(format!("{selector}: the command was ended before"), "judge it again")
}

impl JudgedFile {
    fn status(&self) -> Status {
        self.result.as_ref().map_or(Status::NotJudged, |(diagnosis, _)| status(diagnosis))
    }

    fn report(self) -> FileReport {
        let (diagnosis, error) = match self.result {
            Ok((diagnosis, _)) => (Some(diagnosis), None),
            Err(failure) => (None, Some(failure.report())),
        };
        FileReport { file: self.name, diagnosis, error }
    }
}

/// What is wrong in one file must not be hidden by another that cannot be read.
const fn weight(status: Status) -> u8 {
    match status {
        Status::Good => 0,
        Status::Inconclusive => 1,
        Status::NotJudged => 2,
        Status::Findings => 3,
    }
}

fn text(all: &[JudgedFile], output: &Output) -> String {
    let paint = output.paint();
    let mut table = Table::new(&["verdict", "file", "findings", "the worst of them"], paint);
    for looked in all {
        let (verdict, findings, worst) = match &looked.result {
            Ok((diagnosis, names)) => {
                (verdict(diagnosis, paint), tally(&diagnosis.findings), worst(diagnosis, names))
            }
            Err(failure) => {
                let reason = failure.reason.trim_start_matches(&format!("{}: ", looked.name));
                (paint.warning("NOT JUDGED"), String::new(), reason.to_owned())
            }
        };
        table.row([verdict, looked.name.clone(), findings, worst]);
    }
    let mut text = table.render();
    let first = all.iter().find(|looked| looked.status() == Status::Findings);
    if let Some(first) = first {
        let hint = format!("\n`linesman diagnose {}` tells all of the first.\n", first.name);
        text.push_str(&paint.faint(&hint));
    }
    text
}

fn verdict(diagnosis: &Diagnosis, paint: Paint) -> String {
    match diagnosis.verdict {
        Verdict::Healthy => paint.good("HEALTHY"),
        Verdict::Faulty => paint.bad("FAULTY"),
        Verdict::Inconclusive => paint.warning("INCONCLUSIVE"),
    }
}

/// The first finding: they stand in the order of their weight.
fn worst(diagnosis: &Diagnosis, names: &Names) -> String {
    let cut_off = if diagnosis.complete { "" } else { " (not read to its end)" };
    let Some(finding) = diagnosis.findings.first() else { return cut_off.trim().to_owned() };
    let (severity, place) = (severity_word(finding.severity), names.place(&finding.place));
    format!("{severity} {} {}: {place}, {}{cut_off}", finding.code, finding.name, finding.cause)
}
