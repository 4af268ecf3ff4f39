//! `linesman capture filter`: frames that meet a condition, into a capture of their own.

use std::fmt::Write as _;
use std::path::PathBuf;

use linesman_capture::expression::{FIELDS, FieldReference, like, like_datagrams};
use serde::Serialize;

use super::source::{FileTimes, LearnedCapture, Passed, RowSource, ShownFrame};
use super::writer::CaptureSink;
use crate::command::diagnose::tap::TapArguments;
use crate::exit::Status;
use crate::failure::Failure;
use crate::output::{Output, Table};
use crate::text::quantity::grouped;
use crate::version;

/// Texts of so many bytes are written at once.
const CHUNK: usize = 64 * 1024;

/// What can be asked.
#[derive(clap::Args, Debug)]
#[command(
    after_help = "Fields and operators are those of Wireshark: ecat.cmd == \"LRW\" && ecat.cnt < 3, frame.len in \
                  {64..128}, !ecat_mailbox. Ours: subdevice == \"Term 4\" (number, name, type, 0x1003), register \
                  == 0x0130, cyclic, coe, foe, soe, eoe, out, back, wkc.wrong, datagram(…) for one datagram that meets it \
                  all, around(F2, 5ms) for the time around a finding. All fields: --fields."
)]
pub(crate) struct Arguments {
    /// The capture, and the condition; several captures are parts of one recording. `-` is standard input
    #[arg(value_names = ["FILE", "CONDITION"], required_unless_present = "fields")]
    words: Vec<String>,
    /// Write the frames to this capture: pcapng, or pcap where its name ends so; `-` is standard output
    #[arg(long, short, value_name = "OUT")]
    output: Option<PathBuf>,
    /// Print the numbers of the frames
    #[arg(long, conflicts_with = "json")]
    numbers: bool,
    /// Print the condition that frames like this one meet, by its number
    #[arg(long, value_name = "NUMBER", conflicts_with_all = ["output", "numbers"])]
    like_frame: Option<u64>,
    /// Which of its fields counts; its commands and addresses unless said
    #[arg(long, value_name = "FIELD", requires = "like_frame")]
    field: Option<String>,
    /// What was planned (TOML or ENI): names of SubDevices
    #[arg(long, value_name = "PROJECT.toml|ENI.xml")]
    project: Option<PathBuf>,
    #[command(flatten)]
    tap: TapArguments,
    #[command(flatten)]
    times: FileTimes,
    /// List the fields that a condition can name
    #[arg(long, exclusive = true)]
    fields: bool,
    /// JSON, schema linesman.capture-filter/1
    #[arg(long)]
    pub(crate) json: bool,
}

/// The answer as JSON.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct FilterReport {
    /// `linesman.capture-filter/1`.
    schema: String,
    /// Name and version of the program.
    tool: String,
    /// The capture.
    source: String,
    /// The condition.
    condition: String,
    /// Frames in the capture.
    frames: u64,
    /// Frames that meet it.
    matched: u64,
    /// Number of the first of them.
    first: Option<u64>,
    /// Number of the last of them.
    last: Option<u64>,
    /// True if the capture was read to its end.
    complete: bool,
    /// The capture that was written; `null` for none.
    output: Option<String>,
}

/// Does what was asked.
pub(super) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    if arguments.fields {
        output.text(&fields(output));
        return Ok(Status::Good);
    }
    if let Some(number) = arguments.like_frame {
        return like_frame(arguments, number, output);
    }
    let Some((condition, files)) =
        arguments.words.split_last().filter(|(_, files)| !files.is_empty())
    else {
        let reason = "one word, expected a capture and a condition";
        return Err(Failure::new(reason, "`linesman capture filter trace.pcapng 'ecat.cnt == 0'`"));
    };
    filter(arguments, files, condition, output)
}

fn paths(words: &[String]) -> Vec<PathBuf> {
    words.iter().map(PathBuf::from).collect()
}

fn filter(
    arguments: &Arguments,
    words: &[String],
    condition: &str,
    output: &mut Output,
) -> Result<Status, Failure> {
    let source =
        RowSource::of(&paths(words), arguments.times, arguments.project.as_ref(), &arguments.tap)?;
    let mut learned: Option<LearnedCapture> = None;
    let expression = source.condition(condition, &mut learned, output)?;
    let devices = learned.as_ref().map(|learned| &learned.devices);
    let mut sink = arguments.output.as_deref().map(CaptureSink::create).transpose()?;
    let (mut matched, mut first, mut last) = (0, None, None);
    let mut numbers = String::new();
    let facts = expression.needs().facts || learned.is_some();
    let passed = source.each(facts, output, &mut |shown: &ShownFrame<'_, '_>, output| {
        if !expression.matches(shown.row, devices) {
            return Ok(true);
        }
        let number = shown.row.frame.number;
        matched += 1;
        first.get_or_insert(number);
        last = Some(number);
        if let Some(sink) = &mut sink {
            sink.write(shown.item, "")?;
        }
        if arguments.numbers {
            let _ = writeln!(numbers, "{number}");
            if numbers.len() > CHUNK {
                output.raw(&std::mem::take(&mut numbers));
            }
        }
        Ok(true)
    })?;
    let is_written_to_output = sink.as_ref().is_some_and(CaptureSink::is_standard_output);
    if let Some(sink) = sink {
        sink.finish()?;
    }
    let Passed { frames, complete } = passed;
    let written = arguments.output.as_ref().map(|path| path.display().to_string());
    if arguments.json && !is_written_to_output {
        output.json(&FilterReport {
            schema: "linesman.capture-filter/1".to_owned(),
            tool: version::tool(),
            source: source.label(),
            condition: condition.to_owned(),
            frames,
            matched,
            first,
            last,
            complete,
            output: written,
        });
        return Ok(Status::Good);
    }
    output.raw(&numbers);
    let mut text = format!("{} of {} frames meet it", grouped(matched), grouped(frames));
    if let Some((first, last)) = first.zip(last) {
        let _ = write!(text, ": the first is {first}, the last {last}");
    }
    if let Some(written) = written.filter(|_| !is_written_to_output) {
        let _ = write!(text, "; written to {written}");
    }
    match arguments.numbers || is_written_to_output {
        true => output.warn(&text),
        false => output.line(&text),
    }
    Ok(Status::Good)
}

/// The condition that frames like one meet.
fn like_frame(arguments: &Arguments, number: u64, output: &mut Output) -> Result<Status, Failure> {
    let source = RowSource::of(
        &paths(&arguments.words),
        arguments.times,
        arguments.project.as_ref(),
        &arguments.tap,
    )?;
    let reference = arguments.field.as_deref().map(field).transpose()?;
    let is_needed = reference.is_some_and(|reference| reference.field.needs_whole());
    let learned = if is_needed { Some(source.learn(output)?) } else { None };
    let devices = learned.as_ref().map(|learned| &learned.devices);
    let mut found: Option<Option<String>> = None;
    let passed = source.each(true, output, &mut |shown: &ShownFrame<'_, '_>, _| {
        if shown.row.frame.number < number {
            return Ok(true);
        }
        if shown.row.frame.number == number {
            found = Some(match reference {
                Some(reference) => like(shown.row, reference, devices),
                None => like_datagrams(shown.row),
            });
        }
        Ok(false)
    })?;
    let place = source.label();
    let what = arguments.field.as_deref().unwrap_or("datagrams");
    match found {
        Some(Some(condition)) => {
            output.line(&condition);
            Ok(Status::Good)
        }
        Some(None) => {
            let reason = format!("{place}: frame {number} has no {what}");
            let list = format!("`linesman capture list {place}` shows what it has");
            Err(Failure::new(reason, list))
        }
        None => {
            let frames = passed.frames;
            let reason =
                format!("{place}: there is no frame {number} among {frames} that were read");
            Err(Failure::new(reason, "name the number of a frame, from 1, as Wireshark counts"))
        }
    }
}

fn field(name: &str) -> Result<FieldReference, Failure> {
    FieldReference::named(name).ok_or_else(|| {
        let reason = format!("--field: `{name}` is no field");
        Failure::new(reason, "`linesman capture filter --fields` lists them")
    })
}

/// The fields as a table.
fn fields(output: &Output) -> String {
    let mut table = Table::new(&["field", "values", "meaning"], output.paint());
    for field in &FIELDS {
        let values = field.kind.expected().split([',', ':']).next().unwrap_or_default();
        table.row([field.name.to_owned(), values.to_owned(), field.meaning.to_owned()]);
    }
    table.render()
}
