//! The lab: a segment, a MainDevice and a diagnosis in one process, in virtual time.
//!
//! Time jumps from one thing that is due to the next. Every frame, on its way out and back, passes
//! the diagnosis, and a tap if there is one; what the card counts becomes host observations, as it
//! does with a real card.

use std::collections::VecDeque;

use std::collections::BTreeMap;

use linesman_config::inventory::Inventory;
use linesman_config::plan::{Plan, PlanOptions};
use linesman_config::project::{Project, ProjectError};
use linesman_diagnosis::observe::{Direction, FrameSeen, HostEvent, HostObservation};
use linesman_diagnosis::report::{Diagnosis, FindingState, Severity};
use linesman_diagnosis::{Engine, Event as FindingEvent, Setup};
use linesman_maindevice::{Event, MainDevice, Options, ProbeRequest, Target};
use linesman_proto::address::{DeviceId, Network, Path};
use linesman_proto::port::Port;
use linesman_proto::register::ErrorCounter;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::{End, Tree};
use linesman_sim::fault::FaultError;
use linesman_sim::segment::{BuildError, HostPort, Segment};
use linesman_sim::segment_file::{FaultEntry, SegmentFile, SegmentFileError};
use linesman_sim::truth::{FaultId, TruthLog, Unexplained};

use crate::options::{Begin, LabOptions};
use crate::verdict::Truth;
use crate::verdict::judge::truth_of;

/// How often the card's counters are looked at.
const HOST_INTERVAL: Span = Span::ms(100);
/// How many things may happen at one instant. Beyond that an engine does not move on.
const AT_ONE_INSTANT: u32 = 100_000;
/// The largest frame, without check sequence.
const FRAME: usize = 1_514;

/// A lab that cannot go on, or was never built.
#[derive(Debug, thiserror::Error)]
pub enum LabError {
    /// The segment file describes no segment.
    #[error(transparent)]
    Segment(#[from] BuildError),
    /// The segment file does not fit together.
    #[error(transparent)]
    File(#[from] SegmentFileError),
    /// The project behind it does not fit together.
    #[error(transparent)]
    Project(#[from] ProjectError),
    /// A fault cannot be injected.
    #[error(transparent)]
    Fault(#[from] FaultError),
    /// The MainDevice could not bring the line up.
    #[error("the line could not be brought up: {0}")]
    BringUp(String),
    /// Virtual time stands still.
    #[error(
        "virtual time stands still at {at}: {what} asks to be called again and again; this is a \
         fault of the program, please report it with the seed"
    )]
    Stuck {
        /// Where.
        at: Instant,
        /// Who was due.
        what: &'static str,
    },
    /// Something that was waited for did not happen.
    #[error("{what} did not happen within {within}")]
    TooLate {
        /// What was waited for.
        what: String,
        /// How long.
        within: Span,
    },
}

/// Sees every frame as the diagnosis does.
pub type Tap = Box<dyn FnMut(&FrameSeen<'_>) + Send>;

/// A segment, a MainDevice and a diagnosis.
pub struct Lab {
    now: Instant,
    network: Network,
    options: LabOptions,
    project: Project,
    tree: Tree,
    segment: Segment,
    main: MainDevice,
    engine: Engine,
    tap: Option<Tap>,
    frames: u64,
    events: Vec<(Instant, Event)>,
    finding_events: VecDeque<FindingEvent>,
    failure: Option<String>,
    blind: BTreeMap<FaultId, Vec<End<DeviceId>>>,
    inventory: Option<Inventory>,
    plan: Option<Plan>,
    host_next: Instant,
    host_last: [HostPort; 2],
    paths: usize,
    arrival: Vec<u8>,
    transmit: Vec<u8>,
}

/// How many events are kept; the oldest go first.
const KEPT_EVENTS: usize = 10_000;

impl Lab {
    /// A lab for a segment file.
    ///
    /// # Errors
    /// [`LabError::Segment`] when the file describes no segment.
    pub fn new(file: &SegmentFile, options: LabOptions) -> Result<Self, LabError> {
        let segment = Segment::build(file)?;
        let project = file.project()?;
        let tree = project.tree()?;
        let network = Network(0);
        let paths = if file.ring.is_some() { 2 } else { 1 };
        let setup = Setup {
            project: options.project.then(|| project.clone()),
            host_counters: options.host_counters,
            probes: options.probes,
            source: match options.source.as_str() {
                "" => format!("lab:{}", file.name),
                source => source.to_owned(),
            },
            start: None,
            clock: "virtual".to_owned(),
        };
        let main = MainDevice::new(network, Options { ring: paths == 2, ..Options::default() });
        let mut lab = Self {
            now: Instant::ZERO,
            network,
            project,
            tree,
            segment,
            main,
            engine: Engine::new(setup),
            tap: None,
            frames: 0,
            events: Vec::new(),
            finding_events: VecDeque::new(),
            failure: None,
            blind: BTreeMap::new(),
            inventory: None,
            plan: None,
            host_next: Instant::ZERO,
            host_last: [HostPort::default(); 2],
            paths,
            arrival: Vec::with_capacity(FRAME),
            transmit: vec![0; FRAME],
            options,
        };
        if lab.options.begin != Begin::Idle {
            lab.main.scan(lab.now);
        }
        Ok(lab)
    }

    /// Lets `tap` see every frame from now on.
    pub fn set_tap(&mut self, tap: Tap) {
        self.tap = Some(tap);
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

    /// The project's identity of a SubDevice of the plan. A plan numbers what was found in the order
    /// of processing, which for a device with several controllers is not that of the project.
    #[must_use]
    pub fn of_plan(&self, id: DeviceId) -> DeviceId {
        let node = self.tree.order().get(id.index());
        node.map_or(id, |node| DeviceId(*node as u32))
    }

    /// The plan's identity of a SubDevice of the project; the other way round than
    /// [`Lab::of_plan`].
    fn in_plan(&self, id: DeviceId) -> DeviceId {
        let at = self.tree.order().iter().position(|node| *node == id.index());
        at.map_or(id, |at| DeviceId(at as u32))
    }

    /// Counters that moved without a logged cause since the last audit.
    pub fn audit(&mut self) -> Vec<Unexplained> {
        self.segment.audit()
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

    /// Puts a fault on the line.
    ///
    /// # Errors
    /// The segment's, when the entry names no place or parameter.
    pub fn inject(&mut self, entry: &FaultEntry) -> Result<FaultId, LabError> {
        let id = self.segment.inject(self.now, entry)?;
        let blind = self.blind_ports();
        self.blind.insert(id, blind);
        Ok(id)
    }

    /// A fault of the run as a verdict is held against it; `None` if there is no such fault.
    #[must_use]
    pub fn truth_of(&self, id: FaultId) -> Option<Truth> {
        let log = self.truth();
        let blind = self.blind.get(&id).cloned().unwrap_or_default();
        Some(Truth { blind, ..truth_of(log, log.fault(id)?) })
    }

    /// Ports whose symbol counter stands at its end.
    fn blind_ports(&self) -> Vec<End<DeviceId>> {
        let mut blind = Vec::new();
        for id in self.segment.devices() {
            let Some(controller) = self.segment.controller(id) else { continue };
            let counters = controller.error_counters();
            for port in Port::ALL {
                if counters.value(ErrorCounter::PhysicalLayer(port)) == Some(u8::MAX) {
                    blind.push(End::Controller(id, port));
                }
            }
        }
        blind
    }

    /// Ends a fault.
    pub fn heal(&mut self, fault: FaultId) {
        self.segment.heal(self.now, fault);
    }

    /// Whether every SubDevice is in the target state without error, and the MainDevice drives it.
    #[must_use]
    pub fn is_up(&self) -> bool {
        self.plan.is_some() && self.not_up().next().is_none()
    }

    /// SubDevices that are not in the target state, by what their controllers say.
    pub fn not_up(&self) -> impl Iterator<Item = DeviceId> {
        self.segment.devices().filter(|id| {
            self.segment.controller(*id).is_none_or(|controller| {
                let status = controller.al_status();
                let there = status.state().state() == Some(self.options.target);
                !controller.is_powered() || status.error() || !there
            })
        })
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

    fn next_due(&self) -> (Instant, &'static str) {
        let due = [
            (self.segment.poll_timeout(), "the segment"),
            (self.main.poll_timeout(), "the MainDevice"),
            (self.engine.poll_timeout(), "the diagnosis"),
            (Some(self.host_next), "the card"),
        ];
        let earliest = due.into_iter().filter_map(|(at, what)| at.map(|at| (at, what))).min();
        earliest.unwrap_or((Instant::MAX, "nobody"))
    }

    /// Lets everyone do what is due now.
    fn serve(&mut self) {
        self.segment.advance(self.now);
        self.receive();
        self.main.handle_timeout(self.now);
        self.engine.handle_timeout(self.now);
        if self.now >= self.host_next {
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
                self.main.handle_frame(came.at.max(self.now), came.path, &arrival);
            }
        }
        self.arrival = arrival;
    }

    /// Takes out all that the engines have to give: frames, events, probes.
    fn drain(&mut self) -> Result<(), LabError> {
        let mut transmit = std::mem::take(&mut self.transmit);
        let mut count = 0_u32;
        while let Some(sent) = self.main.poll_transmit(self.now, &mut transmit) {
            let at = sent.at.max(self.now);
            let frame = &transmit[..sent.len];
            self.show(Direction::Sent, sent.path, at, frame);
            self.segment.handle_frame(at, sent.path, frame);
            count += 1;
            if count > AT_ONE_INSTANT {
                return Err(LabError::Stuck { at: self.now, what: "sending" });
            }
        }
        self.transmit = transmit;
        while let Some(event) = self.main.poll_event() {
            self.handle_event(event);
        }
        while let Some(probe) = self.engine.poll_probe() {
            let device =
                self.plan.as_ref().and_then(|plan| plan.device(self.in_plan(probe.device)));
            // Who is not of the plan has no address that could be asked.
            let Some(device) = device else { continue };
            let request = ProbeRequest {
                target: Target::Station(device.station),
                register: probe.register,
                len: probe.len,
                write: None,
            };
            self.main.probe(self.now, request);
        }
        while let Some(event) = self.engine.poll_event() {
            if self.finding_events.len() >= KEPT_EVENTS {
                self.finding_events.pop_front();
            }
            self.finding_events.push_back(event);
        }
        Ok(())
    }

    fn show(&mut self, direction: Direction, path: Path, time: Instant, bytes: &[u8]) {
        self.frames += 1;
        let seen = FrameSeen {
            network: self.network,
            path: Some(path),
            direction,
            time,
            number: self.frames,
            fcs: None,
            truncated: false,
            bytes,
        };
        self.engine.handle_frame(&seen);
        if let Some(tap) = &mut self.tap {
            tap(&seen);
        }
    }

    fn handle_event(&mut self, event: Event) {
        if let Event::Scanned(inventory) = &event {
            self.inventory = Some((**inventory).clone());
            if self.options.begin == Begin::Run {
                self.start(inventory);
            }
        } else if let Event::ScanFailed(error) = &event {
            self.failure = Some(error.to_string());
        }
        if self.events.len() >= KEPT_EVENTS {
            self.events.drain(..KEPT_EVENTS / 2);
        }
        self.events.push((self.now, event));
    }

    fn start(&mut self, inventory: &Inventory) {
        match self.make_plan(inventory) {
            Ok(plan) => {
                self.main.start(self.now, plan.clone());
                self.plan = Some(plan);
            }
            Err(error) => self.failure = Some(error),
        }
    }

    /// The plan for what was found, with the names of the project where they fit.
    fn make_plan(&self, inventory: &Inventory) -> Result<Plan, String> {
        let mut planned = inventory.planned(self.options.target);
        if planned.len() == self.project.devices.len() {
            for (device, id) in planned.iter_mut().zip(0..) {
                let wanted = &self.project.devices[self.of_plan(DeviceId(id)).index()];
                device.name.clone_from(&wanted.name);
            }
        }
        let options = PlanOptions { cycle: self.options.cycle, ..PlanOptions::default() };
        Plan::build(&planned, inventory.tree().clone(), &options).map_err(|error| error.to_string())
    }

    /// Turns what the cards counted since the last look into host observations.
    fn look_at_cards(&mut self) {
        for path in Path::ALL.into_iter().take(self.paths) {
            let port = self.segment.host(path);
            let last = std::mem::replace(&mut self.host_last[path.index()], port);
            let mut note = |what| {
                let observation =
                    HostObservation { network: self.network, path, time: self.now, what };
                self.engine.handle_host(&observation);
            };
            if port.carrier != last.carrier {
                note(HostEvent::Carrier(port.carrier));
            }
            let failures = port.tx_dropped - last.tx_dropped;
            if failures > 0 {
                note(HostEvent::SendFailures(failures));
            }
            if self.options.host_counters {
                let crc = port.rx_crc_errors - last.rx_crc_errors;
                let other = port.rx_length_errors - last.rx_length_errors;
                if crc + other > 0 {
                    note(HostEvent::CardErrors { crc, other });
                }
            }
        }
    }
}
