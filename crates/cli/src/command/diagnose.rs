//! `linesman diagnose`: what is wrong with a line, where, why, and what to do.

mod bundle;
pub(crate) mod capture;
mod cards;
mod file;
pub(crate) mod follow;
mod listen;
mod observations;
mod probe_recording;
mod questions;
mod recordings;
pub(crate) mod ring;
mod segment;
pub(crate) mod several;
pub(crate) mod tap;
mod target;

use std::path::{Path, PathBuf};

use linesman_capture::CaptureReport;
use linesman_diagnosis::ask::AskSetup;
use linesman_diagnosis::report::second_look::{EarlierLook, RepairStep};
use linesman_diagnosis::report::{Diagnosis, Understood, Verdict};
use linesman_diagnosis::{Engine, Setup};
use linesman_proto::address::Network;
use linesman_proto::time::{Instant, Span};
use linesman_runtime::selector::Selector;

use self::follow::Follower;
use self::probe_recording::ProbeArguments;
use self::tap::TapArguments;
use self::target::Target;
use crate::amount::{count, lasting};
use crate::drawing;
use crate::exit::Status;
use crate::failure::Failure;
use crate::files::{self, Planned};
use crate::output::{Output, Paint};
use crate::page;
use crate::text;
use crate::text::finding::Writer;
use crate::text::names::Names;
use crate::version;

use super::bundle::recording::{BundleArguments, BundleRecording};
use super::line_access;

/// The clock of an observation file.
pub(super) const NO_CLOCK: &str = "none";
/// The clock of several readings, or of a log.
pub(crate) const READINGS: &str = "readings";

/// What can be asked.
#[derive(clap::Args, Debug)]
#[command(
    after_help = "What a file is, its bytes say, not its name: a capture (pcap, pcapng), or a text with \
                  what was read; either may be packed by gzip, xz or zstd. `-` is standard input, \
                  and a pipe is judged as it comes: `ssh HOST tcpdump -i eth0 -U -w - ether proto \
                  0x88a4 | linesman diagnose -`.\n\nFiles of one ring, told by their numbered names, are one recording. Other files are told in a line each. Exit \
                  status of several: 1 if anything is wrong in one of them, else 2 if one could not \
                  be judged, else 3 if one is inconclusive, else 0."
)]
pub(crate) struct Arguments {
    /// Where the frames are: eth0, eth0+eth1, listen:eth0, sim:plant.toml; or files with what was
    /// seen: trace.pcapng, observations.toml, a text with what other tools print, - (standard input)
    #[arg(value_name = "WHERE|FILE", required = true)]
    pub(crate) places: Vec<String>,
    /// What was planned (TOML or ENI): names, wiring and identities to hold the line against; from an ENI the expected
    /// working counters, too
    #[arg(long, value_name = "PROJECT.toml|ENI.xml")]
    project: Option<PathBuf>,
    /// Judge the files of a ring (trace_00001_….pcapng, trace_00002_….pcapng) each for itself, not as one recording
    #[arg(long)]
    separate: bool,
    /// Judge files that were recorded at the same time as one recording, by the times of their frames: those of the two
    /// cards of a ring, or of the two ways of a tap
    #[arg(long, conflicts_with = "separate")]
    together: bool,
    /// Tell findings as they open and close; with --json one linesman.event/1 per line
    #[arg(long)]
    follow: bool,
    /// After something was exchanged on account of an earlier diagnosis (PREVIOUS.json, written with --json): say what became
    /// of its finding, and weigh causes by it. STEP is exchanged-cable, exchanged-card, exchanged-device, or
    /// exchanged-device:NUMBER for one end of a link
    #[arg(long, num_args = 2, value_names = ["STEP", "PREVIOUS.json"])]
    after: Option<Vec<String>>,
    /// How long to look (5, 500ms, 10m); Ctrl-C ends it too
    #[arg(long, visible_alias = "for", value_name = "SECONDS", value_parser = lasting())]
    seconds: Option<Span>,
    /// Write what is seen to a capture file, for Wireshark or to be judged again
    #[arg(long, value_name = "FILE.pcapng")]
    record: Option<PathBuf>,
    #[command(flatten)]
    bundles: BundleArguments,
    /// Also what writes: on a card station addresses and the reading of each SII; where frames vanish though
    /// every port shows a link, ports are closed for a second at most, one after the other. States and
    /// counters are left alone in any case
    #[arg(long)]
    active: bool,
    /// Beside another MainDevice of this computer (listen:eth0): also send small frames that read DL status, AL status and
    /// error counters, one SubDevice at a time, between its frames; ends at the first sign that it is disturbed
    #[arg(long)]
    ask: bool,
    /// Most questions in a second
    #[arg(long, requires = "ask", value_name = "N", default_value_t = questions::PER_S, value_parser = count(1, 200))]
    ask_per_s: u64,
    /// After trouble of the MainDevice that no question was near: go on asking once it runs steadily again
    #[arg(long, requires = "ask")]
    keep_asking: bool,
    /// Ask beside a kind of MainDevice that is refused, or not recognised
    #[arg(long, requires = "ask")]
    force: bool,
    /// On a virtual segment: the state that its SubDevices are driven to
    #[arg(long, value_enum, value_name = "STATE", ignore_case = true)]
    to: Option<Target>,
    #[command(flatten)]
    tap: TapArguments,
    #[command(flatten)]
    probe: ProbeArguments,
    /// Write the diagnosis as a page of its own: drawing, time line, evidence, what to do
    #[arg(long, value_name = "FILE.html")]
    html: Option<PathBuf>,
    /// Write a drawing of the line with what is wrong marked in it
    #[arg(long, value_name = "FILE.svg")]
    svg: Option<PathBuf>,
    #[command(flatten)]
    origin: page::Origin,
    /// List the SubDevices with vendor, product and revision, as far as the input says them
    #[arg(long)]
    devices: bool,
    /// JSON, schema linesman.diagnosis/1
    #[arg(long)]
    pub(crate) json: bool,
}

impl Arguments {
    /// The questions that are wanted.
    fn questions(&self) -> Option<AskSetup> {
        let per_s = u32::try_from(self.ask_per_s).unwrap_or(u32::MAX);
        let (is_forced, keeps_on) = (self.force, self.keep_asking);
        self.ask.then_some(AskSetup { per_s, is_forced, keeps_on })
    }
}

/// Judges what the selector names.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    if arguments.together || !arguments.separate && ring::is_ring(&arguments.places) {
        return ring::run(arguments, output);
    }
    let [place] = arguments.places.as_slice() else {
        if arguments.after.is_some() {
            return Err(Failure::new(
                "--after: several files were given, and one of them is looked at again",
                "give the one file or line that was recorded after the exchange",
            ));
        }
        return several::run(arguments, output);
    };
    let selector = Selector::resolve(place)?;
    refuse_misplaced(arguments, &selector)?;
    for path in [&arguments.html, &arguments.svg].into_iter().flatten() {
        files::refuse_to_overwrite(path)?;
    }
    if !matches!(selector, Selector::File(_)) {
        arguments.tap.refuse(place, "this is none")?;
    }
    let project = arguments.project.as_deref().map(Planned::open).transpose()?;
    let earlier = arguments.after.as_deref().map(earlier_look).transpose()?;
    match &selector {
        Selector::File(path) => {
            let stop = line_access::stop()?;
            let mut session = DiagnosisRun::new(arguments, &selector, project, earlier);
            let judged = file::judge(path, &stop, &mut session, output)?;
            Ok(session.answer(&judged.engine, &judged.names, judged.at, output))
        }
        Selector::Listen(names) => {
            let session = DiagnosisRun::new(arguments, &selector, project, earlier);
            listen::run(names, arguments.questions(), session, output)
        }
        Selector::Cards(names) => {
            let session = DiagnosisRun::new(arguments, &selector, project, earlier);
            cards::run(names, arguments.active, session, output)
        }
        Selector::Segment(path) => {
            let session = DiagnosisRun::new(arguments, &selector, None, earlier);
            let target = arguments.to.unwrap_or_default().into();
            segment::run(path, target, arguments, session, output)
        }
    }
}

/// The earlier diagnosis, and what was done since.
fn earlier_look(after: &[String]) -> Result<EarlierLook, Failure> {
    let [step, path] = after else {
        return Err(Failure::new(
            "--after: expected a step and a file",
            "see `linesman diagnose --help`",
        ));
    };
    let step: RepairStep = step
        .parse()
        .map_err(|error| Failure::new(format!("--after {error}"), "name what was exchanged"))?;
    let path = Path::new(path);
    let text = files::text(path, "an earlier diagnosis")?;
    let advice = "give a file that `linesman diagnose WHERE --json` has written";
    let previous: Diagnosis =
        serde_json::from_str(&text).map_err(|error| files::in_file_of(path, &error, advice))?;
    EarlierLook::of(&previous, step).map_err(|why| {
        Failure::new(format!("{}: {why}", path.display()), "name the part that was exchanged")
    })
}

/// Refuses options that say nothing about such a selector: whoever wrote them expects something.
fn refuse_misplaced(arguments: &Arguments, selector: &Selector) -> Result<(), Failure> {
    let is_file = matches!(selector, Selector::File(_));
    let is_segment = matches!(selector, Selector::Segment(_));
    let is_driven = matches!(selector, Selector::Cards(_));
    let is_listened = matches!(selector, Selector::Listen(_));
    let Arguments { project, seconds, record, active, to, ask, probe, .. } = arguments;
    let rows = [
        ("--record", record.is_some() && is_file, "there is nothing to record"),
        ("--bundles", arguments.bundles.bundles.is_some() && is_file, "it is recorded already"),
        ("--seconds", seconds.is_some() && is_file, "the file is judged to its end"),
        ("--project", project.is_some() && is_segment, "the file says itself what was planned"),
        ("--active", *active && !is_driven && !is_segment, "nothing there can be written to"),
        (
            "--probe-at",
            probe.is_wanted() && !is_segment,
            "a probe is looped into virtual segments only",
        ),
        ("--to", to.is_some() && !is_segment, "only a virtual segment is driven to a state"),
        ("--ask", *ask && is_driven, "what is to be known is read there anyway"),
        ("--ask", *ask && !is_listened, "nobody can be asked there"),
    ];
    match rows.into_iter().find(|(_, is_misplaced, _)| *is_misplaced) {
        None => Ok(()),
        Some((option, _, why)) => {
            let reason = format!("`{selector}`: {why}");
            Err(Failure::new(reason, format!("leave out `{option}`")))
        }
    }
}

/// A file that has been judged.
struct Judged {
    engine: Engine,
    names: Names,
    /// The end of its time.
    at: Instant,
}

/// A diagnosis that is being made.
pub(crate) struct DiagnosisRun {
    setup: Setup,
    follower: Option<Follower>,
    lasts: Option<Span>,
    record: Option<PathBuf>,
    bundles: BundleArguments,
    recording: Option<BundleRecording>,
    /// That it has failed was said.
    recording_failed: bool,
    html: Option<PathBuf>,
    /// Network and dialogue of a capture, for the page.
    surveyed: Option<CaptureReport>,
    svg: Option<PathBuf>,
    origin: page::Origin,
    tap: TapArguments,
    devices: bool,
    json: bool,
    /// Of a pasted text: what was understood.
    understood: Option<Understood>,
    /// Finding of an earlier diagnosis, and the repair since.
    earlier: Option<EarlierLook>,
    /// Of a bundle: that the same was found as when it was written.
    agreement: Option<String>,
}

impl DiagnosisRun {
    fn new(
        arguments: &Arguments,
        selector: &Selector,
        planned: Option<Planned>,
        earlier: Option<EarlierLook>,
    ) -> Self {
        let (project, exchange) =
            planned.map(|Planned { project, exchange }| (project, exchange)).unzip();
        let exchange = exchange.unwrap_or_default();
        let exchanges = earlier.as_ref().and_then(EarlierLook::exchange).into_iter().collect();
        let source = selector.to_string();
        let setup = Setup { project, exchange, source, exchanges, ..Setup::default() };
        let follower = arguments.follow.then(|| Follower::new(arguments.json));
        Self {
            setup,
            follower,
            lasts: arguments.seconds,
            record: arguments.record.clone(),
            bundles: arguments.bundles.clone(),
            recording: None,
            recording_failed: false,
            html: arguments.html.clone(),
            surveyed: None,
            svg: arguments.svg.clone(),
            origin: arguments.origin.clone(),
            tap: arguments.tap.clone(),
            devices: arguments.devices,
            json: arguments.json,
            understood: None,
            earlier,
            agreement: None,
        }
    }

    /// When a look that began at 0 ends: when the user said, else after `lasts`.
    fn until(&self, lasts: Span) -> Instant {
        Instant::ZERO + self.lasts.unwrap_or(lasts)
    }

    /// Tells what happened to findings, where that was asked for.
    fn follow(&mut self, engine: &mut Engine, output: &mut Output) {
        if self.follower.is_none() && self.recording.is_none() {
            return;
        }
        while let Some(event) = engine.poll_event() {
            if let Some(recording) = &mut self.recording {
                recording.event(&event);
            }
            if let Some(follower) = &mut self.follower {
                follower.tell(event, &names(engine), output);
            }
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
        self.end(&mut engine, at, complete, output);
        self.answer(&engine, &names(&engine), at, output)
    }

    /// Ends the input.
    fn end(&mut self, engine: &mut Engine, at: Instant, complete: bool, output: &mut Output) {
        engine.finish(at, complete);
        self.tell_rest(engine, output);
        self.end_bundles(at, engine, output);
    }

    /// Tells what is left to tell of an input that has ended.
    fn tell_rest(&mut self, engine: &mut Engine, output: &mut Output) {
        self.follow(engine, output);
        self.flush(&names(engine), output);
    }

    /// The whole answer.
    fn diagnosis(&self, engine: &Engine) -> Diagnosis {
        let mut diagnosis = engine.diagnosis();
        diagnosis.tool = version::tool();
        diagnosis.understood.clone_from(&self.understood);
        // When a pipe began is known once its first frame has come.
        diagnosis.start = diagnosis.start.or_else(|| self.setup.start.clone());
        diagnosis
    }

    /// Gives the answer.
    fn answer(&self, engine: &Engine, names: &Names, at: Instant, output: &mut Output) -> Status {
        let mut diagnosis = self.diagnosis(engine);
        diagnosis.second_look =
            self.earlier.as_ref().map(|earlier| earlier.compare(&diagnosis, at.as_nanos()));
        match (&self.follower, self.json) {
            (Some(follower), true) => follower.end(at, &diagnosis, output),
            (None, true) => output.json(&diagnosis),
            (_, false) => {
                print(&diagnosis, names, output);
                if self.devices || text::devices::is_wanted(&diagnosis) {
                    let table = text::devices::write(&diagnosis, output.paint());
                    output.text(&format!("\n{table}"));
                }
                if let Some(agreement) = &self.agreement {
                    output.line(agreement);
                }
            }
        }
        // What was found holds, even if no file can be written of it.
        if let Err(failure) = self.write_files(&diagnosis, engine, names, at) {
            output.fail(&failure);
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
        let line = engine.model(Network(0));
        if let Some(path) = &self.html {
            let timed = diagnosis.clock != NO_CLOCK;
            let writer = Writer {
                names,
                paint: Paint::PLAIN,
                width: usize::MAX,
                timed,
                place: &diagnosis.source,
            };
            let page =
                page::page(diagnosis, line, self.surveyed.as_ref(), &writer, at, &self.origin);
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
    let writer = Writer {
        names,
        paint: output.paint(),
        width: output.width(),
        timed,
        place: &diagnosis.source,
    };
    output.text(&text::diagnosis::write(diagnosis, &writer));
}

/// What the SubDevices are called: by the project, else by their types.
pub(crate) fn names(engine: &Engine) -> Names {
    let devices = engine.model(Network(0)).map(|line| line.devices.as_slice()).unwrap_or_default();
    let known = |text: &Option<String>| text.clone().unwrap_or_default();
    Names::new(devices.iter().map(|device| (known(&device.name), known(&device.type_name))))
}

pub(super) fn status(diagnosis: &Diagnosis) -> Status {
    match diagnosis.verdict {
        Verdict::Healthy => Status::Good,
        Verdict::Faulty => Status::Findings,
        Verdict::Inconclusive => Status::Inconclusive,
    }
}
