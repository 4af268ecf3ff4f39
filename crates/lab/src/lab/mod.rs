//! The lab: a segment, a MainDevice and a diagnosis in one process, in virtual time.
//!
//! Time jumps from one thing that is due to the next. MainDevice and diagnosis are the
//! [session](linesman_session) that runs on real cards, too; the line is the segment, with a tap if there
//! is one.

mod capture_loss;
mod capture_probe;
mod diagnosis;
mod driver;
mod error;
mod ethernet;
mod events;
mod line;
mod object;
mod other_session;
mod pause;
mod plan;
mod register;
mod truth;

use std::collections::VecDeque;

use linesman_config::inventory::Inventory;
use linesman_config::plan::Plan;
use linesman_config::plan::layout::DEFAULT_TASK;
use linesman_config::project::{Project, ProjectDevice, ProjectTask};
use linesman_diagnosis::observe::{FrameSeen, HostObservation};
use linesman_diagnosis::report::{Diagnosis, FindingState, Severity};
use linesman_diagnosis::{Engine, Event as FindingEvent, InputKind, Setup};
use linesman_maindevice::watch::{LogEntry, Watch};
use linesman_maindevice::{Event, MainDevice, Options};
use linesman_proto::address::{DeviceId, Network};
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::Tree;
use linesman_session::{Idle, PlanRun, Session};
use linesman_sim::seed::Stream;
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::SegmentFile;
use linesman_sim::truth::TruthLog;

pub use error::LabError;

use self::capture_loss::CaptureLoss;
use self::diagnosis::LabDiagnosis;
use self::line::LabLine;
use self::other_session::OtherSession;
use self::pause::Socket;
use crate::habit::Habit;
use crate::options::{Begin, LabOptions};

/// How many things may happen at one instant. Beyond that an engine does not move on.
const AT_ONE_INSTANT: u32 = 100_000;
/// The largest frame, without check sequence.
const FRAME: usize = 1_514;

/// Sees every frame as the diagnosis does.
pub type Tap = Box<dyn FnMut(&FrameSeen<'_>) + Send>;

/// Sees what the host observed as the diagnosis does.
pub type HostTap = Box<dyn FnMut(&HostObservation) + Send>;

/// A segment, a MainDevice and a diagnosis.
pub struct Lab {
    options: LabOptions,
    project: Project,
    tree: Tree,
    line: LabLine,
    session: Session<PlanRun<Idle, LabDiagnosis>>,
    /// The MainDevice of others that drives the line in place of ours.
    other: Option<OtherSession>,
    socket: Socket,
    events: Vec<(Instant, Event)>,
    finding_events: VecDeque<FindingEvent>,
    failure: Option<String>,
    inventory: Option<Inventory>,
    plan: Option<Plan>,
    watch: Option<Watch>,
    /// There once a plan is run in which SubDevices speak EoE.
    switch: Option<ethernet::LabSwitch>,
    log: Vec<LogEntry>,
}

impl Lab {
    /// A lab for a segment file.
    ///
    /// # Errors
    /// [`LabError::Segment`] when the file describes no segment.
    pub fn new(file: &SegmentFile, options: LabOptions) -> Result<Self, LabError> {
        Self::with_project(file, file.project()?, options)
    }

    /// A lab for a segment file whose MainDevice runs by this project: that of the file, with choices.
    ///
    /// # Errors
    /// [`LabError::Segment`] when the file describes no segment, [`LabError::Project`] when the project
    /// contradicts itself.
    pub fn with_project(
        file: &SegmentFile,
        mut project: Project,
        options: LabOptions,
    ) -> Result<Self, LabError> {
        let segment = Segment::build(file)?;
        if project.chooses() && project.tasks.is_empty() {
            // SYNC signals come in the cycle of a task.
            project.tasks.push(ProjectTask::new(DEFAULT_TASK, options.cycle));
        }
        if !options.serials {
            project.devices.iter_mut().for_each(|device| device.serial = None);
        }
        let tree = project.tree()?;
        let is_own = options.habit == Habit::Own;
        let setup = Setup {
            exchange: linesman_config::plan::PlannedExchange::default(),
            project: options.project.then(|| project.clone()),
            input: if is_own { InputKind::Driven } else { InputKind::Listened },
            host_counters: options.host_counters,
            probes: options.probes && is_own,
            active: options.active && is_own,
            source: match options.source.as_str() {
                "" => format!("lab:{}", file.name),
                source => source.to_owned(),
            },
            start: None,
            clock: "virtual".to_owned(),
            tap_places: Vec::new(),
            exchanges: options.exchanges.clone(),
        };
        let mut settings = Options::default();
        if options.clocks || project.devices.iter().any(|device| device.clock.is_some()) {
            settings.drift_frames = plan::DRIFT_FRAMES;
        }
        let mut line = LabLine::new(segment, file.ring.is_some(), options.host_counters);
        let main_options = options.habit.main_device(line.line.options(settings));
        let main = MainDevice::new(Network::default(), main_options);
        let mut diagnosis = LabDiagnosis::default();
        let engine = Engine::new(setup);
        if is_own {
            diagnosis.engine = Some(engine);
        } else {
            line.capture.listener = Some(engine);
        }
        line.segment_mut().listen(!is_own);
        let mut lab = Self {
            project,
            tree,
            line,
            session: Session::new(main, PlanRun::new(None, Idle, diagnosis, false)),
            other: None,
            socket: Socket::default(),
            events: Vec::new(),
            finding_events: VecDeque::new(),
            failure: None,
            inventory: None,
            plan: None,
            watch: None,
            switch: None,
            log: Vec::new(),
            options,
        };
        if lab.options.habit == Habit::Soem && lab.options.begin == Begin::Run {
            lab.start_other(file);
        } else if lab.options.begin != Begin::Idle {
            let now = lab.now();
            lab.main_mut().scan(now);
        }
        Ok(lab)
    }

    /// Lets `tap` see every frame from now on.
    pub fn set_tap(&mut self, tap: Tap) {
        self.diagnosis_input().tap = Some(tap);
    }

    /// Lets `recorder` see every frame from now on as a capture tool beside the MainDevice does: what was handed to a
    /// card, when it was, and what came back. What no card took is not in it
    /// ([`Segment::poll_outgoing`](linesman_sim::segment::Segment::poll_outgoing)).
    pub fn set_recorder(&mut self, recorder: Tap) {
        self.line.segment_mut().listen(true);
        self.line.capture.recorder = Some(recorder);
    }

    /// Lets `tap` see every observation of the host from now on.
    pub fn set_host_tap(&mut self, tap: HostTap) {
        self.diagnosis_input().host_tap = Some(tap);
    }

    /// Hides a share of the exchanges in which error counters are read from the diagnosis and the tap, and
    /// from the recorder.
    pub fn hide_counters(&mut self, share: f64, stream: Stream) {
        let capture_loss = (share > 0.0).then(|| CaptureLoss::new(stream, share));
        self.line.capture.loss.clone_from(&capture_loss);
        self.diagnosis_input().loss = capture_loss;
    }

    /// The present.
    #[must_use]
    pub fn now(&self) -> Instant {
        self.line.line.now()
    }

    /// How it was set up.
    #[must_use]
    pub fn options(&self) -> &LabOptions {
        &self.options
    }

    /// The segment.
    #[must_use]
    pub fn segment(&self) -> &Segment {
        self.line.segment()
    }

    /// The MainDevice.
    #[must_use]
    pub fn main(&self) -> &MainDevice {
        self.session.main()
    }

    /// The MainDevice, to give it outputs or commands.
    pub fn main_mut(&mut self) -> &mut MainDevice {
        self.session.main_mut()
    }

    /// What was injected and what it did.
    #[must_use]
    pub fn truth(&self) -> &TruthLog {
        self.segment().truth()
    }

    /// What was planned: the segment file without its faults.
    #[must_use]
    pub fn project(&self) -> &Project {
        &self.project
    }

    /// The wiring as planned; node *n* is device *n*.
    #[must_use]
    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// What the last scan found.
    #[must_use]
    pub fn inventory(&self) -> Option<&Inventory> {
        self.inventory.as_ref()
    }

    /// What the MainDevice runs by, once it has scanned the line.
    #[must_use]
    pub fn plan(&self) -> Option<&Plan> {
        self.plan.as_ref()
    }

    /// Findings that are open: errors and warnings, consequences not counted.
    #[must_use]
    pub fn open_findings(&self) -> usize {
        let diagnosis = self.engine().diagnosis();
        let open = diagnosis.findings.iter();
        let open = open.filter(|f| f.state != FindingState::Closed && f.severity != Severity::Info);
        open.count()
    }

    /// What the MainDevice told, oldest first.
    #[must_use]
    pub fn events(&self) -> &[(Instant, Event)] {
        &self.events
    }

    /// What happened to a finding, oldest first; each is given once.
    pub fn poll_finding_event(&mut self) -> Option<FindingEvent> {
        self.finding_events.pop_front()
    }

    /// The log of the MainDevice since it has a plan, oldest first; empty unless
    /// [`LabOptions::log`] asks for it.
    #[must_use]
    pub fn log(&self) -> &[LogEntry] {
        &self.log
    }

    /// Frames seen by the diagnosis, both directions.
    #[must_use]
    pub fn frames(&self) -> u64 {
        self.session.hooks().diagnosis().frames
    }

    /// Why the line was not brought up, if it was not.
    #[must_use]
    pub fn failure(&self) -> Option<&str> {
        self.failure.as_deref()
    }

    /// The engine that judges, with all that it knows of the line.
    #[must_use]
    pub fn engine(&self) -> &Engine {
        let inline = &self.session.hooks().diagnosis().engine;
        let engine = self.line.capture.listener.as_ref().or(inline.as_ref());
        engine.unwrap_or_else(|| unreachable!("a lab judges inline or listens"))
    }

    fn engine_mut(&mut self) -> &mut Engine {
        let inline = &mut self.session.hooks_mut().diagnosis_mut().engine;
        let engine = self.line.capture.listener.as_mut().or(inline.as_mut());
        engine.unwrap_or_else(|| unreachable!("a lab judges inline or listens"))
    }

    const fn diagnosis_input(&mut self) -> &mut LabDiagnosis {
        self.session.hooks_mut().diagnosis_mut()
    }

    /// The diagnosis as it stands.
    #[must_use]
    pub fn diagnosis(&self) -> Diagnosis {
        self.engine().diagnosis()
    }

    /// Ends the input of the diagnosis, and gives its last word.
    pub fn finish(&mut self) -> Diagnosis {
        let now = self.now();
        let engine = self.engine_mut();
        engine.finish(now, true);
        let last: Vec<FindingEvent> = std::iter::from_fn(|| engine.poll_event()).collect();
        self.finding_events.extend(last);
        self.engine().diagnosis()
    }

    /// Whether every SubDevice is in the target state without error, and the MainDevice drives it.
    #[must_use]
    pub fn is_up(&self) -> bool {
        self.plan.is_some() && self.not_up().next().is_none()
    }

    /// SubDevices that are not in the target state, by what their controllers say, or that no frame
    /// can reach.
    pub fn not_up(&self) -> impl Iterator<Item = DeviceId> {
        let reached = self.reached();
        self.segment().devices().filter(move |id| {
            let is_reached = reached.contains(id);
            !is_reached
                || self.segment().controller(*id).is_none_or(|controller| {
                    let status = controller.al_status();
                    status.error() || status.state().state() != Some(self.target_of(*id))
                })
        })
    }

    /// How far a SubDevice is driven.
    pub(super) fn target_of(&self, id: DeviceId) -> AlState {
        let wanted = self.project.devices.get(id.index()).filter(|device| device.state.is_some());
        wanted.and_then(ProjectDevice::target).unwrap_or(self.options.target)
    }

    /// Lets time pass until `until`.
    ///
    /// # Errors
    /// [`LabError::Stuck`] when an engine keeps asking for the same instant.
    pub fn run_until(&mut self, until: Instant) -> Result<(), LabError> {
        let mut here = 0_u32;
        loop {
            self.send();
            self.hear();
            let (at, what) = self.next_due();
            if at > until {
                self.line.line.set_now(until);
                return Ok(());
            }
            if at > self.now() {
                self.line.line.set_now(at);
                here = 0;
            } else {
                here += 1;
                if here > AT_ONE_INSTANT {
                    return Err(LabError::Stuck { at: self.now(), what });
                }
            }
            self.take_in();
        }
    }

    /// Lets time pass, at most for `within`, until `done`.
    ///
    /// `done` is asked at every `step`. Says whether it came about.
    ///
    /// # Errors
    /// [`LabError::Stuck`].
    pub fn run_while(
        &mut self,
        within: Span,
        step: Span,
        mut done: impl FnMut(&Self) -> bool,
    ) -> Result<bool, LabError> {
        let until = self.now() + within;
        loop {
            if done(self) {
                return Ok(true);
            }
            if self.now() >= until {
                return Ok(false);
            }
            self.run_until((self.now() + step).min(until))?;
        }
    }

    /// Lets time pass until the line is up.
    ///
    /// # Errors
    /// [`LabError::BringUp`] or [`LabError::TooLate`].
    pub fn wait_up(&mut self, within: Span) -> Result<(), LabError> {
        let up = self.run_while(within, Span::ms(1), |lab| lab.is_up() || lab.failure.is_some())?;
        match &self.failure {
            Some(failure) => Err(LabError::BringUp(failure.clone())),
            None if up => Ok(()),
            None => {
                let names: Vec<String> = self.not_up().map(|id| self.state_of(id)).collect();
                let what = format!(
                    "{} in all SubDevices; not there: {}",
                    self.options.target,
                    names.join(", ")
                );
                Err(LabError::TooLate { what, within })
            }
        }
    }

    /// A SubDevice and the state it is in, in words.
    pub(crate) fn state_of(&self, id: DeviceId) -> String {
        let state = self.segment().controller(id).map_or_else(
            || "missing".to_owned(),
            |controller| format!("{}, code {}", controller.al_status(), controller.al_code()),
        );
        format!("{} {} ({state})", id.no(), self.segment().name(id))
    }

    fn next_due(&mut self) -> (Instant, &'static str) {
        let listener = self.line.capture.listener.as_ref();
        let due = [
            (Some(self.line.line.poll_timeout()), "the segment"),
            (listener.and_then(Engine::poll_timeout), "the diagnosis"),
            (self.main_due(), "the session"),
        ];
        let earliest = due.into_iter().filter_map(|(at, what)| at.map(|at| (at, what))).min();
        earliest.unwrap_or((Instant::MAX, "nobody"))
    }

    /// Lets frames come back, and everyone do what is due now.
    fn take_in(&mut self) {
        let now = self.now();
        if self.is_paused() {
            return self.take_in_paused(now);
        }
        self.fetch_waiting(now);
        let Self { line, session, other, .. } = self;
        match other {
            Some(other) => other.take_in(now, line, session.hooks_mut().diagnosis_mut()),
            None => {
                // A lab goes on whatever came of the run.
                let Ok(_) = session.take_in(now, line);
            }
        }
    }

    /// Lets whoever drives the line send.
    fn send(&mut self) {
        if self.is_paused() {
            return;
        }
        let now = self.now();
        let Self { line, session, other, .. } = self;
        match other {
            Some(other) => other.send(now, line, session.hooks_mut().diagnosis_mut()),
            None => {
                let Ok(()) = session.send(now, line);
            }
        }
    }
}
