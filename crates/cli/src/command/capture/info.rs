//! `linesman capture info`: what the network of a capture is.

use std::path::PathBuf;

use linesman_capture::network::report::ProbePortReport;

use super::source::FileTimes;
use super::survey::survey;
use crate::command::diagnose::tap::TapArguments;
use crate::command::line_access;
use crate::exit::Status;
use crate::failure::Failure;
use crate::output::{Output, Table};
use crate::text::capture;

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
    /// Device descriptions of makers (ESI) that name the types of SubDevices: a folder of XML files, or one
    #[arg(long, value_name = "FOLDER|FILE.xml")]
    esi: Option<PathBuf>,
    /// All state changes, transfers and SII words; else the first of each
    #[arg(long)]
    all: bool,
    /// JSON, schema linesman.capture/1
    #[arg(long)]
    pub(crate) json: bool,
}

/// Tells what the network is. That judges nothing: the exit status is 0 once EtherCAT frames were found.
pub(super) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let stop = line_access::stop()?;
    let Arguments { places, times, tap, esi, .. } = arguments;
    let surveyed = survey(places, *times, tap, esi.as_deref(), &stop, output)?;
    if arguments.json {
        output.json(&surveyed.report);
        return Ok(Status::Good);
    }
    let writer = capture::CaptureWriter {
        report: &surveyed.report,
        names: &surveyed.names,
        paint: output.paint(),
        width: output.width(),
        is_whole: arguments.all,
    };
    let tree = surveyed
        .engine
        .model(linesman_proto::address::Network(0))
        .and_then(|model| model.tree.as_ref());
    output.text(&writer.write(tree));
    tell_probe(&surveyed.report.probe_ports, output);
    Ok(Status::Good)
}

/// Tells at which places the capture probe sat that recorded the file.
fn tell_probe(ports: &[ProbePortReport], output: &mut Output) {
    if ports.is_empty() {
        return;
    }
    let headings = ["port", "channel", "frames", "damaged", "marked", "place"];
    let mut table = Table::new(&headings, output.paint());
    for port in ports {
        let numbers =
            [port.frames.0, port.damaged.0, port.marked.0].map(|number| number.to_string());
        let [frames, damaged, marked] = numbers;
        let (number, channel) = (port.port.to_string(), port.channel.to_string());
        table.row([number, channel, frames, damaged, marked, port.place.clone()]);
    }
    output.text(&format!("\nCapture probe\n{}", table.render()));
}
