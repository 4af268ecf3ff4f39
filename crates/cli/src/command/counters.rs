//! `linesman counters`: the error counters of all SubDevices in one table; cleared, watched for a while,
//! exported and judged in one command.

pub(crate) mod samples;

use std::path::PathBuf;

use linesman_diagnosis::Diagnosis;
use linesman_proto::address::DeviceId;
use linesman_proto::port::Port;
use linesman_proto::register::ErrorCounter;
use linesman_proto::time::Span;
use serde::Serialize;

use super::diagnose;
use super::service::{DeviceReport, ServiceLine, end};
use crate::amount::{MILLISECOND, SECOND, duration};
use crate::exit::Status;
use crate::failure::Failure;
use crate::files;
use crate::output::{Output, Table, wrapped};
use crate::text::names::Names;
use crate::version;
use samples::{PortReport, Samples};

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Where the line is: eth0, eth0+eth1 (a ring), sim:plant.toml, or the socket of `run --control`
    #[arg(value_name = "WHERE")]
    pub(crate) line: String,
    /// Clear all counters first: what they held from power-on is no fault
    #[arg(long)]
    clear: bool,
    /// Watch for so long (60, 10m), and judge what rises
    #[arg(
        long = "for",
        alias = "seconds",
        value_name = "SECONDS",
        value_parser = duration(SECOND, MILLISECOND, Span::s(86_400))
    )]
    lasts: Option<Span>,
    /// Time between two readings while watching (500, 1s)
    #[arg(
        long,
        visible_alias = "every",
        value_name = "MS",
        default_value = "500",
        requires = "lasts",
        value_parser = duration(MILLISECOND, Span::ms(10), Span::s(3_600))
    )]
    every_ms: Span,
    /// Write each reading of each counter into this file, for a spreadsheet
    #[arg(long, value_name = "FILE.csv")]
    csv: Option<PathBuf>,
    /// JSON, schema linesman.counters/1
    #[arg(long)]
    pub(crate) json: bool,
}

/// The answer as JSON.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Report {
    /// `linesman.counters/1`.
    schema: String,
    /// Name and version of the program.
    tool: String,
    /// Whether the counters were cleared at the beginning.
    cleared: bool,
    /// For how long they were watched, in s.
    seconds: f64,
    /// How often each SubDevice was read.
    readings: u64,
    /// The SubDevices with their counters.
    devices: Vec<DeviceCounters>,
    /// What follows from what rose; `null` without `--for`, and of a line that another process drives.
    diagnosis: Option<Diagnosis>,
}

/// Counters of a SubDevice.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct DeviceCounters {
    /// Whose.
    device: DeviceReport,
    /// Port by port.
    ports: Vec<PortReport>,
    /// Frames that its processing unit found wrong, 0x030C; `null` when it did not answer.
    processing_unit: Option<u8>,
}

/// What stands in the table.
const LEGEND: &str = "for each port: bad frames/bad symbols, fwd marked bad before, lnk lost links, (+7) so many rose meanwhile; `.` is 0, `--` did not answer.";
/// What it may mean.
const HISTORY: &str = "What stood before may be history: `--clear --for 60` tells what rises now.";

/// Reads them.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    if let Some(path) = &arguments.csv {
        files::refuse_to_overwrite(path)?;
    }
    let mut session = ServiceLine::open(&arguments.line)?;
    let mut samples = Samples::default();
    if arguments.clear {
        let cleared = samples.clear(&mut session);
        if cleared.is_err() {
            return end(cleared, arguments.json, output);
        }
    }
    samples.read(&mut session, Span::ZERO)?;
    let watched = match arguments.lasts {
        Some(lasts) => watch(&mut session, &mut samples, lasts, arguments.every_ms)?,
        None => Span::ZERO,
    };
    if let Some(path) = &arguments.csv {
        files::write_new(path, "the readings", &samples.csv(&session))?;
    }
    let diagnosis = arguments.lasts.and_then(|_| session.diagnosis());
    let status = diagnosis.as_ref().map_or(Status::Good, diagnose::status);
    if arguments.json {
        output.json(&report(&session, &samples, watched, diagnosis));
        return Ok(status);
    }
    output.text(&table(&session, &samples, output));
    if let Some(diagnosis) = &diagnosis {
        output.line(&format!("\n{}", wrapped("", LEGEND, output.width())));
        diagnose::print(diagnosis, &names(&session), output);
    } else if arguments.lasts.is_none() {
        let legend = format!("{LEGEND} {HISTORY}");
        output.text(&format!("\n{}", wrapped("", &legend, output.width())));
    }
    Ok(status)
}

/// Reads again and again; for how long it did.
fn watch(
    session: &mut ServiceLine,
    samples: &mut Samples,
    all: Span,
    every: Span,
) -> Result<Span, Failure> {
    let mut at = Span::ZERO;
    while at < all {
        let step = every.min(all.saturating_sub(at));
        let goes_on = session.wait(step)?;
        // Ctrl-C ends the watch, and what was seen until then is judged.
        if !goes_on {
            break;
        }
        at += step;
        samples.read(session, at)?;
    }
    Ok(at)
}

/// What people call the SubDevices.
pub(super) fn names(session: &ServiceLine) -> Names {
    let name = |known: &super::service::KnownDevice| {
        (known.name.clone().unwrap_or_default(), known.type_name.clone())
    };
    Names::new(session.devices().iter().map(name))
}

/// Counters of one SubDevice.
pub(super) fn of_device(session: &ServiceLine, samples: &Samples, id: DeviceId) -> DeviceCounters {
    let latest = samples.latest(id);
    DeviceCounters {
        device: session.report(id),
        ports: Port::ALL.into_iter().map(|port| PortReport::of(samples, id, port)).collect(),
        processing_unit: latest.and_then(|counters| counters.value(ErrorCounter::ProcessingUnit)),
    }
}

fn report(
    session: &ServiceLine,
    samples: &Samples,
    watched: Span,
    diagnosis: Option<Diagnosis>,
) -> Report {
    let devices = session.devices();
    let of = |known: &super::service::KnownDevice| of_device(session, samples, known.id);
    Report {
        schema: "linesman.counters/1".to_owned(),
        tool: version::tool(),
        cleared: samples.cleared,
        seconds: watched.as_nanos() as f64 / 1e9,
        readings: (samples.all.len() / devices.len().max(1)) as u64,
        devices: devices.iter().map(of).collect(),
        diagnosis,
    }
}

/// One row for each SubDevice, one column for each port.
fn table(session: &ServiceLine, samples: &Samples, output: &Output) -> String {
    let paint = output.paint();
    let mut table = Table::new(&["no", "name", "A", "B", "C", "D", "processing"], paint);
    for known in session.devices() {
        let counters = of_device(session, samples, known.id);
        let name = known.name.as_deref().unwrap_or(&known.type_name);
        let mut row = vec![known.id.no().to_string(), name.to_owned()];
        row.extend(
            counters
                .ports
                .iter()
                .map(|port| if port.rose() { paint.bad(&port.cell()) } else { port.cell() }),
        );
        row.push(match counters.processing_unit {
            None => "--".to_owned(),
            Some(0) => ".".to_owned(),
            Some(count) => count.to_string(),
        });
        table.row(row);
    }
    table.render()
}
