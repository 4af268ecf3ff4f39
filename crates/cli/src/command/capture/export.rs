//! `linesman capture export`: datagrams as a table for other programs, frames with findings as comments.

mod table;

use std::collections::BTreeMap;
use std::path::PathBuf;

use linesman_capture::record::DatagramRecord;
use linesman_diagnosis::report::FindingReport;
use linesman_proto::time::Instant;

use self::table::DatagramTable;
use super::source::{FileTimes, LearnedCapture, RowSource, ShownFrame};
use super::writer::CaptureSink;
use crate::command::diagnose::tap::TapArguments;
use crate::exit::Status;
use crate::failure::Failure;
use crate::files;
use crate::output::Output;
use crate::text::names::Names;
use crate::text::quantity::count;

/// What can be asked.
#[derive(clap::Args, Debug)]
#[command(group = clap::ArgGroup::new("form").required(true).multiple(true).args(["csv", "parquet", "pcapng"]))]
pub(super) struct Arguments {
    /// The capture; several are parts of one recording, one after the other
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
    /// Write a table with one row for each datagram
    #[arg(long, value_name = "OUT.csv")]
    csv: Option<PathBuf>,
    /// Write the same table as columns, for DuckDB, pandas, Polars and others
    #[arg(long, value_name = "OUT.parquet")]
    parquet: Option<PathBuf>,
    /// Write the frames again, with findings as comments of the frames that show them
    #[arg(long, value_name = "OUT.pcapng")]
    pcapng: Option<PathBuf>,
    /// Frames that meet this condition, see `capture filter`
    #[arg(long = "where", value_name = "CONDITION")]
    condition: Option<String>,
    /// What was planned (TOML or ENI): names of SubDevices, expected working counters
    #[arg(long, value_name = "PROJECT.toml|ENI.xml")]
    project: Option<PathBuf>,
    #[command(flatten)]
    tap: TapArguments,
    #[command(flatten)]
    times: FileTimes,
}

/// Does what was asked.
pub(super) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    for path in [&arguments.csv, &arguments.parquet, &arguments.pcapng].into_iter().flatten() {
        files::refuse_to_overwrite(path)?;
    }
    let source = RowSource::of(
        &arguments.files,
        arguments.times,
        arguments.project.as_ref(),
        &arguments.tap,
    )?;
    let learned = source.learn(output)?;
    let mut comments = Comments::of(&learned);
    let findings = comments.count();
    let mut learned = Some(learned);
    let condition = match &arguments.condition {
        Some(text) => Some(source.condition(text, &mut learned, output)?),
        None => None,
    };
    let devices = learned.as_ref().map(|learned| &learned.devices);
    let csv = arguments.csv.as_deref().map(DatagramTable::csv);
    let parquet = arguments.parquet.as_deref().map(DatagramTable::parquet);
    let mut tables = csv.into_iter().chain(parquet).collect::<Result<Vec<_>, _>>()?;
    let mut sink = arguments.pcapng.as_deref().map(CaptureSink::create).transpose()?;
    source.each(true, output, &mut |shown: &ShownFrame<'_, '_>, _| {
        let row = shown.row;
        // A comment whose frame is not wanted goes to the next one that is.
        comments.pass(row.frame.number, row.frame.time);
        if condition.as_ref().is_some_and(|condition| !condition.matches(row, devices)) {
            return Ok(true);
        }
        for table in &mut tables {
            for index in 0..row.datagrams.len() {
                if let Some(record) = DatagramRecord::of(row, index, devices) {
                    table.write(record)?;
                }
            }
        }
        if let Some(sink) = &mut sink {
            sink.write(shown.item, &comments.take())?;
        }
        Ok(true)
    })?;
    for table in tables {
        let (path, rows) = table.finish()?;
        output.line(&format!("{}: {}", path.display(), count(rows, "row")));
    }
    if let Some((sink, path)) = sink.zip(arguments.pcapng.as_deref()) {
        sink.finish()?;
        let findings = count(findings, "finding");
        output.line(&format!("{}: {findings} as comments of frames", path.display()));
    }
    Ok(Status::Good)
}

/// Findings as comments of frames.
struct Comments {
    /// By the number of the frame that is evidence.
    by_frame: BTreeMap<u64, Vec<String>>,
    /// By time, where no frame is named; oldest first.
    by_time: BTreeMap<Instant, Vec<String>>,
    /// Those that wait for a frame to be written.
    due: Vec<String>,
    findings: u64,
}

impl Comments {
    fn of(learned: &LearnedCapture) -> Self {
        let (by_frame, by_time) = (BTreeMap::new(), BTreeMap::new());
        let mut comments = Self { by_frame, by_time, due: Vec::new(), findings: 0 };
        comments.add(&learned.diagnosis.findings, &learned.names);
        comments
    }

    const fn count(&self) -> u64 {
        self.findings
    }

    fn add(&mut self, findings: &[FindingReport], names: &Names) {
        for finding in findings {
            self.findings += 1;
            let (id, code, name) = (&finding.id, &finding.code, &finding.name);
            let place = names.place(&finding.place);
            let head = format!("{id} {code} {name} at {place}: {}", finding.cause);
            let mut has_frame = false;
            for evidence in &finding.evidence {
                let Some(frame) = evidence.frame else { continue };
                has_frame = true;
                let text = format!("{head}. {}", evidence.text);
                self.by_frame.entry(frame.0).or_default().push(text);
            }
            if !has_frame {
                let opened = Instant::from_nanos(finding.opened_ns.0);
                self.by_time.entry(opened).or_default().push(head);
            }
            self.add(&finding.consequences, names);
        }
    }

    /// Goes on to a frame.
    fn pass(&mut self, number: u64, time: Instant) {
        self.due.extend(self.by_frame.remove(&number).into_iter().flatten());
        while let Some(first) = self.by_time.first_entry().filter(|first| *first.key() <= time) {
            self.due.extend(first.remove());
        }
    }

    /// The comment of the frame that is written now; empty for none.
    fn take(&mut self) -> String {
        self.due.drain(..).collect::<Vec<_>>().join("\n")
    }
}
