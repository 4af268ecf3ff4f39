//! `linesman diagnose`: what is wrong with a line, where, why, and what to do.

mod capture;
pub(crate) mod follow;
mod listen;

use std::path::PathBuf;

use linesman_config::project::Project;
use linesman_diagnosis::report::{Diagnosis, Verdict};
use linesman_diagnosis::{Engine, Setup};
use linesman_proto::address::Network;
use linesman_proto::time::Instant;
use linesman_runtime::selector::Selector;

use self::follow::Follower;
use crate::exit::Status;
use crate::failure::Failure;
use crate::files;
use crate::output::Output;
use crate::text;
use crate::text::finding::Writer;
use crate::text::names::Names;
use crate::version;

use super::sim;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Where the frames are: see below
    #[arg(value_name = "WHERE")]
    place: String,
    /// What was planned (TOML): names, wiring and identities to hold the line against
    #[arg(long, value_name = "FILE")]
    project: Option<PathBuf>,
    /// Tell findings as they open and close; with --json one linesman.event/1 per line
    #[arg(long)]
    follow: bool,
    /// How long to look; Ctrl-C ends it too
    #[arg(long, value_name = "N")]
    seconds: Option<f64>,
    /// JSON, schema linesman.diagnosis/1
    #[arg(long)]
    pub(crate) json: bool,
}

/// Judges what the selector names.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let selector = arguments.place.parse()?;
    let project = arguments.project.as_deref().map(files::project).transpose()?;
    match &selector {
        Selector::Capture(path) => {
            let session = Session::new(arguments, &selector, project);
            capture::run(path, session, output)
        }
        Selector::Listen(names) => {
            listen::run(names, Session::new(arguments, &selector, project), output)
        }
        Selector::Observations(_) | Selector::Segment(_) | Selector::Cards(_) => Err(Failure::new(
            format!("`{}`: only captures and listening can be judged so far", arguments.place),
            "record one with `tcpdump -i eth0 -w trace.pcap`, and name the file",
        )),
    }
}

/// A diagnosis that is being made.
pub(crate) struct Session {
    setup: Setup,
    follower: Option<Follower>,
    seconds: Option<f64>,
    json: bool,
}

impl Session {
    fn new(arguments: &Arguments, selector: &Selector, project: Option<Project>) -> Self {
        let setup = Setup { project, source: selector.to_string(), ..Setup::default() };
        let follower = arguments.follow.then(|| Follower::new(arguments.json));
        Self { setup, follower, seconds: arguments.seconds, json: arguments.json }
    }

    /// When a look that began at 0 ends: when the user said, else after `seconds`.
    fn until(&self, seconds: f64) -> Result<Instant, Failure> {
        sim::until(Some(self.seconds.unwrap_or(seconds)))
    }

    /// Tells what happened to findings, where that was asked for.
    fn follow(&self, engine: &mut Engine, output: &mut Output) {
        if let Some(follower) = &self.follower {
            follower.tell(engine, output);
        }
    }

    /// Ends the input and gives the answer. `complete` is whether all of it could be read.
    fn conclude(
        &self,
        mut engine: Engine,
        at: Instant,
        complete: bool,
        output: &mut Output,
    ) -> Status {
        engine.finish(at, complete);
        self.follow(&mut engine, output);
        let mut diagnosis = engine.diagnosis();
        diagnosis.tool = version::tool();
        match (&self.follower, self.json) {
            (Some(follower), true) => follower.end(at, &diagnosis, output),
            (None, true) => output.json(&diagnosis),
            (_, false) => print(&diagnosis, &names(&engine), output),
        }
        status(&diagnosis)
    }
}

/// The diagnosis as text.
fn print(diagnosis: &Diagnosis, names: &Names, output: &mut Output) {
    let writer = Writer { names, paint: output.paint(), width: output.width() };
    output.text(&text::diagnosis::write(diagnosis, &writer));
}

/// What the SubDevices are called: by the project, else by their types.
fn names(engine: &Engine) -> Names {
    let devices = engine.line(Network(0)).map(|line| line.devices.as_slice()).unwrap_or_default();
    Names::new(devices.iter().map(|device| device.best_name().unwrap_or_default().to_owned()))
}

fn status(diagnosis: &Diagnosis) -> Status {
    match diagnosis.verdict {
        Verdict::Healthy => Status::Good,
        Verdict::Faulty => Status::Findings,
        Verdict::Inconclusive => Status::Inconclusive,
    }
}
