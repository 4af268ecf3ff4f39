//! Command line: commands and options.

use clap::{Parser, Subcommand};

use crate::command::{
    aoe, bundle, capture, completion, counters, demo, diagnose, explain, fault, foe, history, host,
    id, interfaces, lab, log, online, plan, probe, reg, ring, run, scan, schema, sdo, sii, sim,
    soe, state,
};
use crate::version::VERSION;

/// The whole command line.
#[derive(Parser, Debug)]
#[command(
    name = "linesman",
    version = VERSION,
    about = "Walks an EtherCAT line and finds the fault.",
    after_help = "WHERE is eth0 (a network card), eth0+eth1 (a ring), listen:eth0 (beside another \
                  MainDevice), sim:plant.toml (a virtual segment) or, for `diagnose`, files: \
                  captures, and texts with what was read; - is standard input.\n\nExit status: 0 healthy, 1 an error \
                  or warning was found, 2 nothing could be judged, 3 inconclusive.",
    disable_help_subcommand = true,
    arg_required_else_help = true
)]
pub(crate) struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub(crate) command: Command,
    /// Colour: when writing to a terminal, always, or never
    #[arg(long, global = true, value_enum, default_value_t, hide_possible_values = false)]
    pub(crate) color: ColorChoice,
}

/// When to write in colour.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug, clap::ValueEnum)]
pub(crate) enum ColorChoice {
    /// On a terminal, unless NO_COLOR is set.
    #[default]
    Auto,
    /// Always.
    Always,
    /// Never.
    Never,
}

/// The commands.
#[derive(Subcommand, Debug)]
pub(crate) enum Command {
    /// See it work: a virtual plant, broken and healed, the truth beside the verdict
    Demo(demo::Arguments),
    /// Which SubDevices there are and how they are wired
    Scan(scan::Arguments),
    /// What is wrong with a line: where, why, and what to do
    Diagnose(diagnose::Arguments),
    /// What a capture shows beyond its verdict: the network, its dialogue, its timing, each frame
    Capture(capture::Arguments),
    /// What a bundle holds, and one without names to give away
    Bundle(bundle::Arguments),
    /// What follows from a project or ENI file: frames, load, E-bus budget, clocks, doubts
    Plan(plan::Arguments),
    /// Network cards: link, driver, suitability, EtherCAT seen
    Interfaces(interfaces::Arguments),
    /// This computer as a suspect: what makes frames late or loses them, and the commands that mend it
    Host(host::Arguments),
    /// What a code, register, object, state, value, word or line of a log means
    Explain(explain::Arguments),
    /// States of SubDevices: look, ask for another, acknowledge an error
    State(state::Arguments),
    /// Objects of a SubDevice: read, write, list, explain
    Sdo(sdo::Arguments),
    /// What a SubDevice has noted of itself: its diagnosis history
    History(history::Arguments),
    /// Files of a SubDevice: fetch, bring, update firmware
    Foe(foe::Arguments),
    /// A SubDevice asked by ADS through its mailbox: name, state, index groups, NetId
    Aoe(aoe::Arguments),
    /// Identification numbers (IDN) of a drive by SoE: list, read, write, procedure commands
    Soe(soe::Arguments),
    /// EEPROM of a SubDevice: read, write, compare, station alias
    Sii(sii::Arguments),
    /// Numbers that tell equal SubDevices apart: read, compared with a project, set
    Id(id::Arguments),
    /// Registers of a SubDevice's controller: read, write
    Reg(reg::Arguments),
    /// Error counters of all SubDevices: read, clear, watch and export them, judge what rises
    Counters(counters::Arguments),
    /// Try out each link with many long frames, while nobody drives the line
    Probe(probe::Arguments),
    /// Set up a ring step by step: scan with it open, second card, end, check
    Ring(ring::Arguments),
    /// Drive a line: bring it up, exchange process data, watch it, stop it cleanly
    Run(run::Arguments),
    /// A line as it is now: states, error counters, frames, mailboxes; once or live
    Online(online::Arguments),
    /// Virtual segments on real interfaces, for any MainDevice
    Sim(sim::Arguments),
    /// Break, heal and watch a segment that runs on real interfaces
    Fault(fault::Arguments),
    /// Stories, swarms and recordings in virtual time
    Lab(lab::Arguments),
    /// What happened on networks: the event log of `run`
    Log(log::Arguments),
    /// JSON schema of a file or output
    Schema(schema::Arguments),
    /// Shell completion: write it to where your shell looks for it
    Completion(completion::Arguments),
}

impl Command {
    /// Where the line is, as the user has named it.
    pub(crate) fn place(&self) -> Option<&str> {
        match self {
            Self::Scan(arguments) => Some(&arguments.place),
            Self::Diagnose(arguments) => match arguments.places.as_slice() {
                [place] => Some(place),
                _ => None,
            },
            Self::State(arguments) => Some(&arguments.line),
            Self::Counters(arguments) => Some(&arguments.line),
            Self::Probe(arguments) => Some(&arguments.line),
            Self::Online(arguments) => arguments.place.as_deref(),
            Self::Run(arguments) => match arguments.on.as_slice() {
                [place] => Some(place),
                _ => None,
            },
            Self::Sdo(arguments) => Some(&arguments.place.line),
            Self::History(arguments) => Some(&arguments.place.line),
            Self::Foe(arguments) => Some(&arguments.place.line),
            Self::Aoe(arguments) => Some(&arguments.place.line),
            Self::Soe(arguments) => Some(&arguments.place.line),
            Self::Sii(arguments) => Some(&arguments.place.line),
            Self::Reg(arguments) => Some(&arguments.place.line),
            Self::Id(arguments) => Some(&arguments.line),
            Self::Ring(arguments) => Some(&arguments.place),
            Self::Demo(_)
            | Self::Capture(_)
            | Self::Bundle(_)
            | Self::Plan(_)
            | Self::Interfaces(_)
            | Self::Host(_)
            | Self::Explain(_)
            | Self::Sim(_)
            | Self::Fault(_)
            | Self::Lab(_)
            | Self::Log(_)
            | Self::Schema(_)
            | Self::Completion(_) => None,
        }
    }

    /// Whether the answer is to be JSON, a failure included.
    pub(crate) fn wants_json(&self) -> bool {
        match self {
            Self::Scan(arguments) => arguments.json,
            Self::Plan(arguments) => arguments.json,
            Self::Run(arguments) => arguments.json,
            Self::Online(arguments) => arguments.json,
            Self::Diagnose(arguments) => arguments.json,
            Self::Capture(arguments) => arguments.wants_json(),
            Self::Bundle(arguments) => arguments.wants_json(),
            Self::Fault(arguments) => arguments.json,
            Self::Host(arguments) => arguments.json,
            Self::Interfaces(arguments) => arguments.json,
            Self::Lab(arguments) => arguments.wants_json(),
            Self::Log(arguments) => arguments.json,
            Self::Sim(arguments) => arguments.json,
            Self::State(arguments) => arguments.json,
            Self::Sdo(arguments) => arguments.json,
            Self::History(arguments) => arguments.json,
            Self::Foe(arguments) => arguments.json,
            Self::Aoe(arguments) => arguments.json,
            Self::Soe(arguments) => arguments.json,
            Self::Sii(arguments) => arguments.json,
            Self::Reg(arguments) => arguments.json,
            Self::Counters(arguments) => arguments.json,
            Self::Probe(arguments) => arguments.json,
            Self::Explain(arguments) => arguments.json,
            Self::Id(arguments) => arguments.json,
            Self::Ring(arguments) => arguments.json,
            Self::Demo(_) | Self::Schema(_) | Self::Completion(_) => false,
        }
    }
}
