//! Recorder of bundles beside a diagnosis: keeps its inputs, and has a bundle written for each error or warning.

use std::collections::VecDeque;
use std::io;
use std::path::PathBuf;

use linesman_config::project::Project;
use linesman_diagnosis::finding::Severity;
use linesman_diagnosis::report::Number;
use linesman_diagnosis::{Diagnosis, Engine, Event, EventKind, FrameSeen, HostObservation, Probe};
use linesman_link::unix_time::UnixTime;
use linesman_proto::address::Network;
use linesman_proto::time::{Instant, Span};
use linesman_session::DiagnosisInput;

use super::history::{CHUNK_LASTS, FrameHistory, KeptNote};
use super::manifest::{BundleExchange, BundleFinding, Manifest, SCHEMA, Trigger, findings};
use super::writer::{BundleReceiver, BundleRework, BundleWriter, FolderLimits, Job};
use crate::run::diagnosis_thread::DiagnosisObserver;

/// Findings so long after the first begin another bundle.
const LONGEST: Span = Span::s(60);

/// Choices for bundles.
#[derive(Clone, Debug)]
pub struct BundleSettings {
    /// The folder that they are written to; made where it is not there.
    pub folder: PathBuf,
    /// Time before a finding.
    pub before: Span,
    /// Time after it.
    pub after: Span,
    /// Bytes of memory for frames.
    pub memory: usize,
    /// Most bundles of a run that stay.
    pub files: usize,
    /// Most bytes that they take together.
    pub bytes: u64,
    /// Name and version of the program.
    pub tool: String,
    /// The date of the run's time 0.
    pub start: UnixTime,
    /// The names of the cards.
    pub cards: Vec<String>,
    /// The report for people.
    pub report: fn(&Diagnosis, &Engine) -> String,
    /// What is done to each bundle before it bears its name, such as taking out what tells whose machine it is.
    pub rework: Option<BundleRework>,
}

/// A bundle to come.
struct PendingBundle {
    /// When it is written.
    until: Instant,
    /// When the first of its findings was certain.
    first: Instant,
    triggers: Vec<Trigger>,
}

/// Keeps what a diagnosis is shown.
pub struct BundleRecorder {
    settings: BundleSettings,
    history: FrameHistory,
    writer: BundleWriter,
    pending: Option<PendingBundle>,
}

impl BundleRecorder {
    /// Begins with the first frame of a run.
    ///
    /// # Errors
    /// When the folder cannot be made, or the system has no more threads.
    pub fn start(settings: BundleSettings) -> io::Result<(Self, BundleReceiver)> {
        let limits = FolderLimits { files: settings.files, bytes: settings.bytes };
        let (writer, news) = BundleWriter::start(&settings.folder, limits, settings.rework)?;
        let history = FrameHistory::new(settings.memory, settings.before);
        Ok((Self { settings, history, writer, pending: None }, news))
    }

    /// A frame that the diagnosis is shown.
    pub fn frame(&mut self, frame: &FrameSeen<'_>) {
        self.history.frame(frame);
    }

    /// An observation that it is shown.
    pub fn host(&mut self, observation: &HostObservation) {
        self.history.note(KeptNote::Host(*observation));
    }

    /// Frames passed that it was not shown.
    pub fn missed(&mut self, count: u64, at: Instant) {
        if count > 0 {
            self.history.note(KeptNote::NotShown(count, at));
        }
    }

    /// Something happened to a finding.
    pub fn event(&mut self, event: &Event) {
        let finding = &event.finding;
        if finding.severity <= Severity::Info {
            return;
        }
        self.history.mark(event.at.min(Instant::from_nanos(finding.opened_ns.0)), event.at);
        if event.kind != EventKind::Confirmed {
            return;
        }
        let trigger = Trigger {
            id: finding.id.clone(),
            finding: BundleFinding::of(finding),
            at_ns: Number(event.at.as_nanos()),
        };
        let after = self.settings.after;
        let pending = self.pending.get_or_insert_with(|| PendingBundle {
            until: event.at + after,
            first: event.at,
            triggers: Vec::new(),
        });
        pending.until = (event.at + after).min(pending.first + LONGEST.max(after));
        pending.triggers.push(trigger);
        // Until it is written, what lies before its first finding stays.
        self.history.reach_back(self.settings.before + LONGEST.max(after) + after);
    }

    /// Everything up to `now` was shown: a bundle whose time has come is written.
    pub fn turn(&mut self, now: Instant, engine: &Engine) {
        if self.pending.as_ref().is_some_and(|pending| pending.until <= now) {
            self.write(now, engine, false);
        }
    }

    /// The diagnosis has ended: what is to be written is written.
    pub fn finish(&mut self, at: Instant, engine: &Engine) {
        self.write(at, engine, true);
        self.writer.finish();
    }

    fn write(&mut self, at: Instant, engine: &Engine, has_ended: bool) {
        let Some(pending) = self.pending.take() else { return };
        self.history.reach_back(self.settings.before);
        let mut judged = engine.clone();
        if !has_ended {
            judged.finish(at, true);
        }
        let mut diagnosis = judged.diagnosis();
        diagnosis.tool.clone_from(&self.settings.tool);
        let setup = engine.setup();
        let mut left_out = Vec::new();
        let wanted = pending
            .triggers
            .last()
            .map_or(at, |trigger| Instant::from_nanos(trigger.at_ns.0) + self.settings.after);
        if at < wanted {
            left_out.push(format!(
                "the last {} ms after the finding: the run ended before",
                wanted.since(at).as_nanos() / 1_000_000
            ));
        }
        if !setup.exchanges.is_empty() {
            left_out.push("the exchange that `--after` told of".to_owned());
        }
        let kept = self.history.keep();
        let begins = pending.first - self.settings.before;
        if let Some(from) = kept.recent_from().filter(|from| *from > begins + CHUNK_LASTS) {
            left_out.push(format!(
                "{} ms of the time before the first finding: `--bundle-memory` holds no more",
                from.since(begins).as_nanos() / 1_000_000
            ));
        }
        let start_unix_ns = u64::try_from(self.settings.start.as_nanos()).unwrap_or(0);
        let manifest = Manifest {
            schema: SCHEMA.to_owned(),
            tool: self.settings.tool.clone(),
            source: setup.source.clone(),
            start: setup.start.clone(),
            start_unix_ns: Number(start_unix_ns),
            clock: setup.clock.clone(),
            end_ns: Number(at.as_nanos()),
            has_ended,
            input: setup.input,
            host_counters: setup.host_counters,
            probes: setup.probes,
            active: setup.active,
            findings: findings(&diagnosis),
            stretches: Vec::new(),
            left_out,
            exchange: BundleExchange::of(&setup.exchange),
            anonymised: None,
            triggers: pending.triggers,
        };
        self.writer.write(Job {
            manifest,
            kept,
            project: setup.project.as_ref().map(Project::to_toml),
            report: (self.settings.report)(&diagnosis, &judged),
            diagnosis,
            cards: self.settings.cards.clone(),
            start: self.settings.start,
            found: self.settings.start + pending.first.since(Instant::ZERO),
        });
    }
}

/// An engine with a recorder beside it.
pub struct RecordedEngine {
    engine: Engine,
    recorder: BundleRecorder,
    /// Events that the recorder has seen.
    events: VecDeque<Event>,
}

impl RecordedEngine {
    /// This engine.
    #[must_use]
    pub const fn new(engine: Engine, recorder: BundleRecorder) -> Self {
        Self { engine, recorder, events: VecDeque::new() }
    }

    fn take_events(&mut self) {
        while let Some(event) = self.engine.poll_event() {
            self.recorder.event(&event);
            self.events.push_back(event);
        }
    }
}

impl DiagnosisInput for RecordedEngine {
    fn frame(&mut self, frame: &FrameSeen<'_>) {
        self.engine.handle_frame(frame);
        self.recorder.frame(frame);
        self.take_events();
    }

    fn host(&mut self, observation: &HostObservation) {
        self.engine.handle_host(observation);
        self.recorder.host(observation);
    }

    fn turn(&mut self, now: Instant) {
        self.engine.handle_timeout(now);
        self.take_events();
        self.recorder.turn(now, &self.engine);
    }

    fn poll_timeout(&self) -> Option<Instant> {
        self.engine.poll_timeout()
    }

    fn poll_probe(&mut self) -> Option<Probe> {
        self.engine.poll_probe()
    }

    fn poll_event(&mut self) -> Option<Event> {
        self.take_events();
        self.events.pop_front()
    }
}

impl DiagnosisObserver for RecordedEngine {
    fn missed(&mut self, count: u64, at: Instant) {
        self.engine.handle_missed(Network::default(), count, at);
        self.recorder.missed(count, at);
    }

    fn finish(&mut self, at: Instant) {
        self.engine.finish(at, true);
        self.take_events();
        self.recorder.finish(at, &self.engine);
    }

    fn diagnosis(&self) -> Diagnosis {
        self.engine.diagnosis()
    }
}
