//! `linesman capture`: what a capture shows beyond its verdict, as a whole and frame by frame.

mod compare;
mod export;
pub(crate) mod filter;
mod info;
pub(crate) mod list;
mod record;
mod source;
mod survey;
mod timeline;
mod wireshark_profile;
mod writer;

use crate::exit::Status;
use crate::failure::Failure;
use crate::output::Output;

/// What can be asked.
#[derive(clap::Args, Debug)]
#[command(
    after_help = "A capture is pcap or pcapng, as it is or packed by gzip, xz or zstd; `-` is standard input. What is \
                  wrong on the line, `linesman diagnose FILE` says."
)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    command: CaptureCommand,
}

#[derive(clap::Subcommand, Debug)]
enum CaptureCommand {
    /// What the network is: SubDevices, wiring, set-up, process image, cycles, clocks, states, mailbox dialogue, counters
    Info(info::Arguments),
    /// What happened, in order of time: states, findings, working counters, mailboxes, gaps
    Timeline(timeline::Arguments),
    /// What differs between two captures of a line, such as before and after a repair
    Compare(compare::Arguments),
    /// Datagrams one by one, with the time absolute, as difference, or in the cycle
    List(list::Arguments),
    /// Frames that meet a condition, into a capture of their own
    Filter(filter::Arguments),
    /// A table of datagrams (CSV), or the frames with findings as comments
    Export(export::Arguments),
    /// Record what passes a card in a ring of files, until something is wrong or somebody ends it; it only listens
    Record(record::Arguments),
    /// Colouring rules and filter buttons for Wireshark
    WiresharkProfile(wireshark_profile::Arguments),
}

impl Arguments {
    /// True if the answer is to be JSON, a failure included.
    pub(crate) const fn wants_json(&self) -> bool {
        match &self.command {
            CaptureCommand::Info(arguments) => arguments.json,
            CaptureCommand::Timeline(arguments) => arguments.json,
            CaptureCommand::Compare(arguments) => arguments.json,
            CaptureCommand::List(arguments) => arguments.json,
            CaptureCommand::Filter(arguments) => arguments.json,
            CaptureCommand::Export(_)
            | CaptureCommand::Record(_)
            | CaptureCommand::WiresharkProfile(_) => false,
        }
    }
}

/// Does what was asked.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    match &arguments.command {
        CaptureCommand::Info(arguments) => info::run(arguments, output),
        CaptureCommand::Timeline(arguments) => timeline::run(arguments, output),
        CaptureCommand::Compare(arguments) => compare::run(arguments, output),
        CaptureCommand::List(arguments) => list::run(arguments, output),
        CaptureCommand::Filter(arguments) => filter::run(arguments, output),
        CaptureCommand::Export(arguments) => export::run(arguments, output),
        CaptureCommand::Record(arguments) => record::run(arguments, output),
        CaptureCommand::WiresharkProfile(arguments) => wireshark_profile::run(arguments, output),
    }
}
