//! The lab: a segment, a MainDevice and a diagnosis in one process, in virtual time.
//!
//! Time jumps from one thing that is due to the next. Every frame, on its way out and back, passes
//! the diagnosis, and a tap if there is one; what the card counts becomes host observations, as it
//! does with a real card.

mod capture_loss;
mod driver;
mod engines;
mod error;
mod object;
mod pause;
mod register;
mod truth;

use std::collections::VecDeque;

use linesman_config::inventory::Inventory;
use linesman_config::plan::Plan;
use linesman_config::plan::layout::DEFAULT_TASK;
use linesman_config::project::{Project, ProjectDevice, ProjectTask};
use linesman_diagnosis::observe::{Direction, FrameSeen, HostObservation};
use linesman_diagnosis::report::{Diagnosis, FindingState, Severity};
use linesman_diagnosis::{Engine, Event as FindingEvent, InputKind, Setup};
use linesman_maindevice::watch::{LogEntry, Watch};
use linesman_maindevice::{Event, MainDevice, Options};
use linesman_proto::address::{DeviceId, Network};
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::Tree;
use linesman_sim::seed::Stream;
use linesman_sim::segment::{HostPort, Segment};
use linesman_sim::segment_file::SegmentFile;
use linesman_sim::truth::TruthLog;

pub use error::LabError;

use self::capture_loss::CaptureLoss;
use self::pause::Socket;
use crate::habit::Habit;
use crate::options::{Begin, LabOptions};
use crate::soem::Soem;

/// How often the card's counters are looked at.
const HOST_INTERVAL: Span = Span::ms(100);
/// How many things may happen at one instant. Beyond that an engine does not move on.
const AT_ONE_INSTANT: u32 = 100_000;
/// The largest frame, without check sequence.
const FRAME: usize = 1_514;

/// Frames that compensate the drift of clocks before SubDevices go beyond PREOP: fewer than on a real
/// line, where the bring-up may take its time.
const DRIFT_FRAMES: u32 = 2_000;

/// Sees every frame as the diagnosis does.
pub type Tap = Box<dyn FnMut(&FrameSeen<'_>) + Send>;

/// Sees what the host observed as the diagnosis does.
pub type HostTap = Box<dyn FnMut(&HostObservation) + Send>;

/// A segment, a MainDevice and a diagnosis.
pub struct Lab {
    now: Instant,
    network: Network,
    options: LabOptions,
    project: Project,
    tree: Tree,
    segment: Segment,
    main: MainDevice,
    /// The MainDevice of others that drives the line in place of ours.
    other: Option<Soem>,
    engine: Engine,
    tap: Option<Tap>,
    recorder: Option<Tap>,
    recorded: u64,
    host_tap: Option<HostTap>,
    capture_loss: Option<CaptureLoss>,
    recorder_veil: Option<CaptureLoss>,
    frames: u64,
    events: Vec<(Instant, Event)>,
    finding_events: VecDeque<FindingEvent>,
    failure: Option<String>,
    inventory: Option<Inventory>,
    plan: Option<Plan>,
    watch: Option<Watch>,
    log: Vec<LogEntry>,
    host_next: Instant,
    host_last: [Option<HostPort>; 2],
    paths: usize,
    socket: Socket,
    arrival: Vec<u8>,
    outgoing: Vec<u8>,
    transmit: Vec<u8>,
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
        let network = Network(0);
        let paths = if file.ring.is_some() { 2 } else { 1 };
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
        };
        let mut settings = Options { ring: paths == 2, ..Options::default() };
        if options.clocks || project.devices.iter().any(|device| device.clock.is_some()) {
            settings.drift_frames = DRIFT_FRAMES;
        }
        let settings = settings.on_line(segment.tree().len(), segment.longest_way());
        let main = MainDevice::new(network, options.habit.main_device(settings));
        let mut lab = Self {
            now: Instant::ZERO,
            network,
            project,
            tree,
            segment,
            main,
            other: None,
            engine: Engine::new(setup),
            tap: None,
            recorder: None,
            recorded: 0,
            host_tap: None,
            capture_loss: None,
            recorder_veil: None,
            frames: 0,
            events: Vec::new(),
            finding_events: VecDeque::new(),
            failure: None,
            inventory: None,
            plan: None,
            watch: None,
            log: Vec::new(),
            host_next: Instant::ZERO,
            host_last: [None; 2],
            paths,
            socket: Socket::default(),
            arrival: Vec::with_capacity(FRAME),
            outgoing: Vec::with_capacity(FRAME),
            transmit: vec![0; FRAME],
            options,
        };
        lab.segment.listen(!is_own);
        if lab.options.habit == Habit::Soem && lab.options.begin == Begin::Run {
            lab.start_other(file);
        } else if lab.options.begin != Begin::Idle {
            lab.main.scan(lab.now);
        }
        Ok(lab)
    }

    /// Lets `tap` see every frame from now on.
    pub fn set_tap(&mut self, tap: Tap) {
        self.tap = Some(tap);
    }

    /// Lets `recorder` see every frame from now on as a capture tool beside the MainDevice does: what was handed to a
    /// card, when it was, and what came back. What no card took is not in it
    /// ([`Segment::poll_outgoing`](linesman_sim::segment::Segment::poll_outgoing)).
    pub fn set_recorder(&mut self, recorder: Tap) {
        self.segment.listen(true);
        self.recorder = Some(recorder);
    }

    /// Lets `tap` see every observation of the host from now on.
    pub fn set_host_tap(&mut self, tap: HostTap) {
        self.host_tap = Some(tap);
    }

    /// Hides a share of the exchanges in which error counters are read from the diagnosis and the tap, and
    /// from the recorder.
    pub fn hide_counters(&mut self, share: f64, stream: Stream) {
        let capture_loss = (share > 0.0).then(|| CaptureLoss::new(stream, share));
        self.recorder_veil.clone_from(&capture_loss);
        self.capture_loss = capture_loss;
    }

    /// The present.
    #[must_use]
    pub fn now(&self) -> Instant {
        self.now
    }

    /// How it was set up.
    #[must_use]
    pub fn options(&self) -> &LabOptions {
        &self.options
    }

    /// The segment.
    #[must_use]
    pub fn segment(&self) -> &Segment {
        &self.segment
    }

    /// The MainDevice.
    #[must_use]
    pub fn main(&self) -> &MainDevice {
        &self.main
    }

    /// The MainDevice, to give it outputs or commands.
    pub fn main_mut(&mut self) -> &mut MainDevice {
        &mut self.main
    }

    /// What was injected and what it did.
    #[must_use]
    pub fn truth(&self) -> &TruthLog {
        self.segment.truth()
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
        let diagnosis = self.engine.diagnosis();
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
        self.frames
    }

    /// Why the line was not brought up, if it was not.
    #[must_use]
    pub fn failure(&self) -> Option<&str> {
        self.failure.as_deref()
    }

    /// The engine that judges, with all that it knows of the line.
    #[must_use]
    pub const fn engine(&self) -> &Engine {
        &self.engine
    }

    /// The diagnosis as it stands.
    #[must_use]
    pub fn diagnosis(&self) -> Diagnosis {
        self.engine.diagnosis()
    }

    /// Ends the input of the diagnosis, and gives its last word.
    pub fn finish(&mut self) -> Diagnosis {
        self.engine.finish(self.now, true);
        self.finding_events.extend(std::iter::from_fn(|| self.engine.poll_event()));
        self.engine.diagnosis()
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
        self.segment.devices().filter(move |id| {
            let is_reached = reached.contains(id);
            !is_reached
                || self.segment.controller(*id).is_none_or(|controller| {
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
            self.drain()?;
            let (at, what) = self.next_due();
            if at > until {
                self.now = self.now.max(until);
                return Ok(());
            }
            if at > self.now {
                self.now = at;
                here = 0;
            } else {
                here += 1;
                if here > AT_ONE_INSTANT {
                    return Err(LabError::Stuck { at: self.now, what });
                }
            }
            self.serve();
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
        let until = self.now + within;
        loop {
            if done(self) {
                return Ok(true);
            }
            if self.now >= until {
                return Ok(false);
            }
            self.run_until((self.now + step).min(until))?;
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
        let state = self.segment.controller(id).map_or_else(
            || "missing".to_owned(),
            |controller| format!("{}, code {}", controller.al_status(), controller.al_code()),
        );
        format!("{} {} ({state})", id.no(), self.segment.name(id))
    }

    fn next_due(&mut self) -> (Instant, &'static str) {
        let due = [
            (self.segment.poll_timeout(), "the segment"),
            (self.main_due(), "the MainDevice"),
            (self.engine.poll_timeout(), "the diagnosis"),
            (Some(self.host_next), "the card"),
        ];
        let earliest = due.into_iter().filter_map(|(at, what)| at.map(|at| (at, what))).min();
        earliest.unwrap_or((Instant::MAX, "nobody"))
    }

    /// Lets everyone do what is due now.
    fn serve(&mut self) {
        self.segment.advance(self.now);
        self.record_outgoing();
        self.receive();
        self.serve_main();
        self.engine.handle_timeout(self.now);
        let has_news = self.segment.takes_card_news();
        if has_news || self.now >= self.host_next {
            self.host_next = self.now + HOST_INTERVAL;
            self.look_at_cards();
        }
    }

    fn receive(&mut self) {
        let mut arrival = std::mem::take(&mut self.arrival);
        while let Some(came) = self.segment.poll_arrival(&mut arrival) {
            // What is not intact the card drops and counts; nobody behind it sees it.
            if came.intact {
                self.show(Direction::Received, came.path, came.at, &arrival);
                self.record(Direction::Received, came.path, came.at, &arrival);
                self.give_main(came.at.max(self.now), came.path, &arrival);
            }
        }
        self.arrival = arrival;
    }
}
