//! `linesman capture list`: datagrams of a capture one by one.

use std::fmt::Write as _;
use std::path::PathBuf;

use linesman_capture::knowledge::DeviceIndex;
use linesman_capture::record::DatagramRecord;
use linesman_link::unix_time::UnixTime;
use linesman_proto::address::RegisterAddress;
use linesman_proto::register::describe;
use serde::Serialize;

use super::source::{FileTimes, LearnedCapture, RowSource, ShownFrame};
use crate::amount;
use crate::command::diagnose::tap::TapArguments;
use crate::exit::Status;
use crate::failure::Failure;
use crate::output::Output;
use crate::text::names::Names;

/// Texts of so many bytes are written at once.
const CHUNK: usize = 32 * 1024;
/// Process RAM begins here: no registers.
const FIRST_RAM: u16 = 0x1000;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// The capture; several are parts of one recording, one after the other. `-` is standard input
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
    /// How times are shown
    #[arg(long, value_enum, value_name = "FORM", default_value_t)]
    time: TimeForm,
    /// Frames that meet this condition, see `capture filter`
    #[arg(long = "where", value_name = "CONDITION")]
    condition: Option<String>,
    /// End after so many frames
    #[arg(long, short = 'n', value_name = "COUNT", value_parser = amount::count(1, u64::MAX))]
    limit: Option<u64>,
    /// Say which SubDevice is meant: the capture is read twice
    #[arg(long)]
    names: bool,
    /// What was planned (TOML or ENI): names of SubDevices
    #[arg(long, value_name = "PROJECT.toml|ENI.xml")]
    project: Option<PathBuf>,
    #[command(flatten)]
    tap: TapArguments,
    #[command(flatten)]
    times: FileTimes,
    /// JSON, one object for each row, schema linesman.capture-row/1
    #[arg(long)]
    pub(crate) json: bool,
}

/// Form of a time.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug, clap::ValueEnum)]
enum TimeForm {
    /// Since the start of the capture
    #[default]
    Start,
    /// The date in the time zone of this computer
    Absolute,
    /// Since the frame that is listed before
    Difference,
    /// Since the cycle of the process data began
    Cycle,
}

/// A row as JSON.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
pub(crate) struct RowReport {
    /// `linesman.capture-row/1`.
    schema: &'static str,
    /// The datagram.
    #[serde(flatten)]
    record: DatagramRecord,
}

/// Does what was asked.
pub(super) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let json = arguments.json;
    let source = RowSource::of(
        &arguments.files,
        arguments.times,
        arguments.project.as_ref(),
        &arguments.tap,
    )?;
    let mut learned: Option<LearnedCapture> = match arguments.names {
        true => Some(source.learn(output)?),
        false => None,
    };
    let condition = match &arguments.condition {
        Some(text) => Some(source.condition(text, &mut learned, output)?),
        None => None,
    };
    let (devices, names) = learned.as_ref().map(|all| (&all.devices, &all.names)).unzip();
    let mut left = arguments.limit.unwrap_or(u64::MAX);
    let mut before: Option<i128> = None;
    let mut text = String::new();
    if !json {
        text.push_str(&heading(output));
    }
    source.each(true, output, &mut |shown: &ShownFrame<'_, '_>, output| {
        let is_wanted =
            condition.as_ref().is_none_or(|condition| condition.matches(shown.row, devices));
        if !is_wanted {
            return Ok(true);
        }
        let time = time(arguments.time, shown, &mut before);
        write(shown, &time, devices, names, json, &mut text);
        left -= 1;
        if text.len() > CHUNK {
            output.raw(&std::mem::take(&mut text));
        }
        Ok(left > 0)
    })?;
    output.raw(&text);
    Ok(Status::Good)
}

fn heading(output: &Output) -> String {
    let line = format!(
        "{:>8}  {:>18}  {:<4}  {:>3}  {:<4}  {:<13}  {:>5}  {:<9}  {}",
        "frame", "time", "way", "idx", "cmd", "address", "bytes", "counter", "meaning"
    );
    format!("{}\n", output.paint().faint(&line))
}

/// The rows of a frame.
fn write(
    shown: &ShownFrame<'_, '_>,
    time: &str,
    devices: Option<&DeviceIndex>,
    names: Option<&Names>,
    json: bool,
    text: &mut String,
) {
    let records = (0..shown.row.datagrams.len())
        .filter_map(|index| DatagramRecord::of(shown.row, index, devices));
    let mut is_empty = true;
    for record in records {
        is_empty = false;
        if json {
            let row = RowReport { schema: "linesman.capture-row/1", record };
            if let Ok(line) = serde_json::to_string(&row) {
                text.push_str(&line);
                text.push('\n');
            }
        } else {
            let _ = writeln!(text, "{}", line(&record, time, names).trim_end());
        }
    }
    if is_empty && !json {
        let (number, len) = (shown.row.frame.number, shown.row.frame.bytes.len());
        let _ = writeln!(text, "{number:>8}  {time:>18}  no EtherCAT datagram, {len} bytes");
    }
}

fn line(record: &DatagramRecord, time: &str, names: Option<&Names>) -> String {
    let (number, time) = match record.datagram {
        1 => (record.frame.to_string(), time),
        _ => (String::new(), ""),
    };
    let counter = match record.wkc_expected {
        Some(expected) if record.wkc_wrong == Some(true) => {
            format!("{} of {expected} !", record.wkc)
        }
        Some(expected) => format!("{} of {expected}", record.wkc),
        None => record.wkc.to_string(),
    };
    format!(
        "{number:>8}  {time:>18}  {:<4}  {:>3}  {:<4}  {:<13}  {:>5}  {counter:<9}  {}",
        record.way.unwrap_or("?"),
        record.index,
        record.command,
        address(record),
        record.data_len,
        meaning(record, names),
    )
}

fn address(record: &DatagramRecord) -> String {
    match (record.logical, record.adp, record.ado) {
        (Some(logical), ..) => format!("{logical:#010x}"),
        (None, Some(adp), Some(ado)) => format!("{adp:04x}:{ado:04x}"),
        (None, ..) => String::new(),
    }
}

/// Register, mailbox message and SubDevice of a datagram.
fn meaning(record: &DatagramRecord, names: Option<&Names>) -> String {
    let mut parts = Vec::new();
    if let (Some(no), Some(names)) = (record.subdevice, names) {
        parts.push(names.device(no));
    }
    let register = record.ado.filter(|ado| *ado < FIRST_RAM && record.command != "NOP");
    if let Some(found) = register.and_then(|ado| describe(RegisterAddress(ado))) {
        parts.push(found.title());
    }
    if let Some(protocol) = record.mailbox {
        let object = record.object.zip(record.subindex);
        parts.push(match object {
            Some((object, subindex)) => format!("{protocol} {object:#06x}:{subindex:02x}"),
            None => protocol.to_owned(),
        });
    }
    if record.fcs_ok == Some(false) {
        parts.push("damaged".to_owned());
    }
    if let Some(port) = record.probe_port {
        parts.push(format!("probe port {port}"));
    }
    parts.join(", ")
}

fn time(form: TimeForm, shown: &ShownFrame<'_, '_>, before: &mut Option<i128>) -> String {
    let frame = &shown.row.frame;
    let now = frame.date_ns.unwrap_or_else(|| frame.time.as_nanos().into());
    let previous = before.replace(now);
    match form {
        TimeForm::Start => seconds(frame.time.as_nanos().into()),
        TimeForm::Absolute => match frame.date_ns {
            Some(date) => UnixTime::from_nanos(date).local_exact(),
            None => "?".to_owned(),
        },
        TimeForm::Difference => seconds(previous.map_or(0, |previous| now - previous)),
        TimeForm::Cycle => match shown.row.facts.in_cycle {
            Some(span) => seconds(span.as_nanos().into()),
            None => "-".to_owned(),
        },
    }
}

/// Seconds to the nanosecond.
fn seconds(nanos: i128) -> String {
    let sign = if nanos < 0 { "-" } else { "" };
    let nanos = nanos.unsigned_abs();
    format!("{sign}{}.{:09}", nanos / 1_000_000_000, nanos % 1_000_000_000)
}
