//! `linesman diagnose`: what is wrong with a line, where, why, and what to do.

mod capture;
mod cards;
pub(crate) mod follow;
mod listen;
mod observations;
mod segment;

use std::path::PathBuf;

use linesman_config::project::Project;
use linesman_diagnosis::report::{Diagnosis, Verdict};
use linesman_diagnosis::{Engine, Setup};
use linesman_link::unix_time::UnixTime;
use linesman_proto::address::Network;
use linesman_proto::state::AlState;
use linesman_proto::time::Instant;
use linesman_runtime::record::Recorder;
use linesman_runtime::selector::Selector;

use self::follow::Follower;
use crate::drawing;
use crate::exit::Status;
use crate::failure::Failure;
use crate::files;
use crate::output::{Output, Paint};
use crate::page;
use crate::text;
use crate::text::finding::Writer;
use crate::text::names::Names;
use crate::version;

use super::sim;

/// The clock of an observation file.
pub(super) const NO_CLOCK: &str = "none";

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Where the frames are, or a file with what was read: eth0, eth0+eth1, listen:eth0,
    /// sim:plant.toml, trace.pcapng, observations.toml
    #[arg(value_name = "WHERE|OBSERVATIONS.toml")]
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
    /// Write what is seen to a capture file, for Wireshark or to be judged again
    #[arg(long, value_name = "FILE.pcapng")]
    record: Option<PathBuf>,
    /// Also what writes: on a card station addresses and the reading of each SII; where frames vanish though
    /// every port shows a link, ports are closed for a second at most, one after the other. States and
    /// counters are left alone in any case
    #[arg(long)]
    active: bool,
    /// On a virtual segment: the state that its SubDevices are driven to
    #[arg(long, value_enum, value_name = "STATE", ignore_case = true)]
    to: Option<Target>,
    /// Write the diagnosis as a page of its own: drawing, time line, evidence, what to do
    #[arg(long, value_name = "FILE.html")]
    html: Option<PathBuf>,
    /// Write a drawing of the line with what is wrong marked in it
    #[arg(long, value_name = "FILE.svg")]
    svg: Option<PathBuf>,
    /// JSON, schema linesman.diagnosis/1
    #[arg(long)]
    pub(crate) json: bool,
}

/// A state to drive to.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, clap::ValueEnum)]
enum Target {
    /// No communication but registers
    Init,
    /// Mailboxes
    Preop,
    /// Mailboxes and inputs
    Safeop,
    /// Everything
    #[default]
    Op,
}

impl From<Target> for AlState {
    fn from(target: Target) -> Self {
        match target {
            Target::Init => Self::Init,
            Target::Preop => Self::PreOp,
            Target::Safeop => Self::SafeOp,
            Target::Op => Self::Op,
        }
    }
}

/// Judges what the selector names.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let selector = arguments.place.parse()?;
    refuse_misplaced(arguments, &selector)?;
    for path in [&arguments.html, &arguments.svg].into_iter().flatten() {
        files::refuse_to_overwrite(path)?;
    }
    let project = arguments.project.as_deref().map(files::project).transpose()?;
    match &selector {
        Selector::Capture(path) => {
            let session = Session::new(arguments, &selector, project);
            capture::run(path, session, output)
        }
        Selector::Listen(names) => {
            listen::run(names, Session::new(arguments, &selector, project), output)
        }
        Selector::Cards(names) => {
            let session = Session::new(arguments, &selector, project);
            cards::run(names, arguments.active, session, output)
        }
        Selector::Segment(path) => {
            let session = Session::new(arguments, &selector, None);
            let target = arguments.to.unwrap_or_default().into();
            segment::run(path, target, arguments.active, session, output)
        }
        Selector::Observations(path) => {
            observations::run(path, Session::new(arguments, &selector, project), output)
        }
    }
}

/// Refuses options that say nothing about such a selector: whoever wrote them expects something.
fn refuse_misplaced(arguments: &Arguments, selector: &Selector) -> Result<(), Failure> {
    let is_file = matches!(selector, Selector::Capture(_) | Selector::Observations(_));
    let is_segment = matches!(selector, Selector::Segment(_));
    let is_driven = matches!(selector, Selector::Cards(_));
    let Arguments { project, seconds, record, active, to, .. } = arguments;
    let rows = [
        ("--record", record.is_some() && is_file, "there is nothing to record"),
        ("--seconds", seconds.is_some() && is_file, "the file is judged to its end"),
        ("--project", project.is_some() && is_segment, "the file says itself what was planned"),
        ("--active", *active && !is_driven && !is_segment, "nothing there can be written to"),
        ("--to", to.is_some() && !is_segment, "only a virtual segment is driven to a state"),
    ];
    match rows.into_iter().find(|(_, is_misplaced, _)| *is_misplaced) {
        None => Ok(()),
        Some((option, _, why)) => {
            let reason = format!("`{selector}`: {why}");
            Err(Failure::new(reason, format!("leave out `{option}`")))
        }
    }
}

/// A diagnosis that is being made.
pub(crate) struct Session {
    setup: Setup,
    follower: Option<Follower>,
    seconds: Option<f64>,
    record: Option<PathBuf>,
    html: Option<PathBuf>,
    svg: Option<PathBuf>,
    json: bool,
}

impl Session {
    fn new(arguments: &Arguments, selector: &Selector, project: Option<Project>) -> Self {
        let setup = Setup { project, source: selector.to_string(), ..Setup::default() };
        let follower = arguments.follow.then(|| Follower::new(arguments.json));
        Self {
            setup,
            follower,
            seconds: arguments.seconds,
            record: arguments.record.clone(),
            html: arguments.html.clone(),
            svg: arguments.svg.clone(),
            json: arguments.json,
        }
    }

    /// Begins the recording, where that was asked for. `start` is the date of the run's time 0.
    fn recorder(&self, start: UnixTime, names: &[String]) -> Result<Option<Recorder>, Failure> {
        let Some(path) = &self.record else { return Ok(None) };
        files::refuse_to_overwrite(path)?;
        let recorder = Recorder::create(path, &version::tool(), start, names);
        recorder.map(Some).map_err(|error| files::in_file(path, &error))
    }

    /// Ends the recording.
    fn end_recording(&self, recorder: Option<Recorder>, output: &Output) {
        let (Some(recorder), Some(path)) = (recorder, &self.record) else { return };
        if let Err(error) = recorder.finish() {
            output.warn(&files::in_file(path, &error).reason);
        }
    }

    /// When a look that began at 0 ends: when the user said, else after `seconds`.
    fn until(&self, seconds: f64) -> Result<Instant, Failure> {
        sim::until(Some(self.seconds.unwrap_or(seconds)))
    }

    /// Tells what happened to findings, where that was asked for.
    fn follow(&mut self, engine: &mut Engine, output: &mut Output) {
        let Some(follower) = &mut self.follower else { return };
        while let Some(event) = engine.poll_event() {
            follower.tell(event, &names(engine), output);
        }
    }

    /// Tells all that was held back.
    fn flush(&mut self, names: &Names, output: &mut Output) {
        if let Some(follower) = &mut self.follower {
            follower.flush(names, output);
        }
    }

    /// Ends the input and gives the answer. `complete` is whether all of it could be read.
    fn conclude(
        &mut self,
        mut engine: Engine,
        at: Instant,
        complete: bool,
        output: &mut Output,
    ) -> Status {
        engine.finish(at, complete);
        self.follow(&mut engine, output);
        let names = names(&engine);
        self.flush(&names, output);
        self.answer(&engine, &names, at, output)
    }

    /// Gives the answer.
    fn answer(&self, engine: &Engine, names: &Names, at: Instant, output: &mut Output) -> Status {
        let mut diagnosis = engine.diagnosis();
        diagnosis.tool = version::tool();
        match (&self.follower, self.json) {
            (Some(follower), true) => follower.end(at, &diagnosis, output),
            (None, true) => output.json(&diagnosis),
            (_, false) => print(&diagnosis, names, output),
        }
        // What was found holds, even if no file can be written of it.
        if let Err(failure) = self.write_files(&diagnosis, engine, names, at) {
            output.warn(&failure.reason);
        }
        status(&diagnosis)
    }

    /// The page and the drawing, where they were asked for.
    fn write_files(
        &self,
        diagnosis: &Diagnosis,
        engine: &Engine,
        names: &Names,
        at: Instant,
    ) -> Result<(), Failure> {
        let line = engine.line(Network(0));
        if let Some(path) = &self.html {
            let timed = diagnosis.clock != NO_CLOCK;
            let writer = Writer { names, paint: Paint::PLAIN, width: usize::MAX, timed };
            let page = page::page(diagnosis, line, &writer, at);
            files::write_new(path, "the report", &page)?;
        }
        if let Some(path) = &self.svg {
            let scene = line.and_then(|line| page::scene::of_diagnosis(line, diagnosis, names));
            let Some(scene) = scene else {
                let reason = format!("{}: how the line is wired was not seen", path.display());
                return Err(Failure::new(reason, "name the project, `--project machine.toml`"));
            };
            files::write_new(path, "the drawing", &drawing::file(&scene))?;
        }
        Ok(())
    }
}

/// The diagnosis as text.
pub(super) fn print(diagnosis: &Diagnosis, names: &Names, output: &mut Output) {
    // An observation file says what was read, not when.
    let timed = diagnosis.clock != NO_CLOCK;
    let writer = Writer { names, paint: output.paint(), width: output.width(), timed };
    output.text(&text::diagnosis::write(diagnosis, &writer));
}

/// What the SubDevices are called: by the project, else by their types.
fn names(engine: &Engine) -> Names {
    let devices = engine.line(Network(0)).map(|line| line.devices.as_slice()).unwrap_or_default();
    Names::new(devices.iter().map(|device| device.best_name().unwrap_or_default().to_owned()))
}

pub(super) fn status(diagnosis: &Diagnosis) -> Status {
    match diagnosis.verdict {
        Verdict::Healthy => Status::Good,
        Verdict::Faulty => Status::Findings,
        Verdict::Inconclusive => Status::Inconclusive,
    }
}
