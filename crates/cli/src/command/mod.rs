//! The commands, one file each.

pub(crate) mod aoe;
pub(crate) mod bundle;
pub(crate) mod capture;
pub(crate) mod completion;
pub(crate) mod counters;
pub(crate) mod demo;
pub(crate) mod diagnose;
pub(crate) mod ebus;
pub(crate) mod explain;
pub(crate) mod fault;
pub(crate) mod foe;
pub(crate) mod history;
pub(crate) mod host;
pub(crate) mod id;
pub(crate) mod interfaces;
pub(crate) mod lab;
pub(crate) mod line_access;
pub(crate) mod log;
pub(crate) mod online;
pub(crate) mod plan;
pub(crate) mod probe;
pub(crate) mod reg;
pub(crate) mod ring;
pub(crate) mod run;
pub(crate) mod scan;
pub(crate) mod schema;
pub(crate) mod sdo;
pub(crate) mod service;
pub(crate) mod sii;
pub(crate) mod sim;
pub(crate) mod soe;
pub(crate) mod state;

use crate::cli::Command;
use crate::exit::Status;
use crate::failure::Failure;
use crate::output::Output;

/// Does what was asked.
pub(crate) fn run(command: Command, output: &mut Output) -> Result<Status, Failure> {
    match command {
        Command::Demo(arguments) => demo::run(&arguments, output),
        Command::Lab(arguments) => lab::run(&arguments, output),
        Command::Log(arguments) => log::run(&arguments, output),
        Command::Online(arguments) => online::run(&arguments, output),
        Command::Run(arguments) => run::run(&arguments, output),
        Command::Plan(arguments) => plan::run(&arguments, output),
        Command::Scan(arguments) => scan::run(&arguments, output),
        Command::Diagnose(arguments) => diagnose::run(&arguments, output),
        Command::Capture(arguments) => capture::run(&arguments, output),
        Command::Bundle(arguments) => bundle::run(&arguments, output),
        Command::Host(arguments) => host::run(&arguments, output),
        Command::Interfaces(arguments) => interfaces::run(&arguments, output),
        Command::Explain(arguments) => explain::run(&arguments, output),
        Command::Sim(arguments) => sim::run(&arguments, output),
        Command::Fault(arguments) => fault::run(&arguments, output),
        Command::State(arguments) => state::run(&arguments, output),
        Command::Sdo(arguments) => sdo::run(&arguments, output),
        Command::History(arguments) => history::run(&arguments, output),
        Command::Foe(arguments) => foe::run(&arguments, output),
        Command::Aoe(arguments) => aoe::run(&arguments, output),
        Command::Soe(arguments) => soe::run(&arguments, output),
        Command::Sii(arguments) => sii::run(&arguments, output),
        Command::Counters(arguments) => counters::run(&arguments, output),
        Command::Probe(arguments) => probe::run(&arguments, output),
        Command::Reg(arguments) => reg::run(&arguments, output),
        Command::Id(arguments) => id::run(&arguments, output),
        Command::Ring(arguments) => ring::run(&arguments, output),
        Command::Schema(arguments) => schema::run(&arguments, output),
        Command::Completion(arguments) => completion::run(&arguments, output),
    }
}
