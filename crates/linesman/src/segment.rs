//! A line that is opened: scanned, planned, run.

use std::path::Path;
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::thread;

use linesman_config::eni::Eni;
use linesman_config::inventory::Inventory;
use linesman_config::plan::IoAt;
use linesman_config::project::Project;
use linesman_diagnosis::{Event, InputKind, Setup};
use linesman_link::clock::HostClock;
use linesman_link::error::LinkError;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use linesman_runtime::listen::is_driven;
use linesman_runtime::named_files::NamedFiles;
use linesman_runtime::plan_file::PlanFile;
use linesman_runtime::run::report::RunReport;
use linesman_runtime::run::scan::PATIENCE;
use linesman_runtime::run::{
    self as running, Application, MakePlan, NOTES, Note, PlanChoices, PlanSource, RealTime,
    RunControls, SessionOptions,
};
use linesman_runtime::selector::Selector;
use linesman_runtime::stop::Stop;
use linesman_runtime::transport::{Cards, Pace, SegmentTransport, Transport};
use linesman_runtime::wiring::Wiring;
use linesman_sim::segment::Segment as VirtualSegment;
use linesman_sim::segment_file::{FaultEntry, SegmentFile};
use linesman_sim::truth::FaultId;

use crate::{Error, Io, Next, Plan, Scan};

/// Opens a line: `eth0`, `eth0+eth1` (a ring) or `sim:line.toml` (a virtual segment, in virtual time
/// that goes as fast as the work is done). Nothing is sent yet.
///
/// # Errors
/// When there is no such card or file, the right is missing, or another MainDevice drives the line.
pub fn open(place: &str) -> Result<Segment, Error> {
    let line = match place.parse()? {
        Selector::Cards(names) => {
            if is_driven(&names)?.is_some() {
                return Err(Error::Driven { card: names.join("+") });
            }
            Where::Cards(Cards::open(&names, HostClock::start())?)
        }
        Selector::Segment(path) => virtual_line(&path)?,
        Selector::Listen(_) | Selector::File(_) => {
            return Err(Error::NotDrivable { given: place.to_owned() });
        }
    };
    Ok(Segment { line, place: place.to_owned(), stop: Stop::default() })
}

fn virtual_line(path: &Path) -> Result<Where, Error> {
    let refuse = |why: String| Error::File { path: path.to_owned(), why };
    let text = std::fs::read_to_string(path).map_err(|error| refuse(error.to_string()))?;
    let file = SegmentFile::parse_with(&text, &NamedFiles::of(path))
        .map_err(|error| refuse(error.to_string()))?;
    built(&file, &refuse)
}

fn built(file: &SegmentFile, refuse: &dyn Fn(String) -> Error) -> Result<Where, Error> {
    let project = file.project().map_err(|error| refuse(error.to_string()))?;
    let segment = VirtualSegment::build(file).map_err(|error| refuse(error.to_string()))?;
    let ring = file.ring.is_some();
    let wiring = Wiring::of(&segment, &project);
    let line = SegmentTransport::new(segment, wiring, ring, Pace::Free)
        .map_err(|source| Error::System { doing: "making a virtual line", source })?;
    Ok(Where::Virtual(Box::new(line)))
}

enum Where {
    Cards(Cards),
    Virtual(Box<SegmentTransport>),
}

impl Where {
    fn line(&mut self) -> &mut dyn Transport<Error = LinkError> {
        match self {
            Self::Cards(cards) => cards,
            Self::Virtual(line) => &mut **line,
        }
    }
}

/// A line.
pub struct Segment {
    line: Where,
    place: String,
    stop: Stop,
}

/// How often, and how.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct RunOptions {
    time: Span,
    misses: u32,
    real_time: RealTime,
    leave: AlState,
    io_at: Option<IoAt>,
    clocks: bool,
    hold: bool,
}

impl RunOptions {
    /// A cycle of so many microseconds.
    #[must_use]
    pub fn us(micros: u64) -> Self {
        let time = Span::us(micros.max(1));
        let (real_time, leave) = (RealTime::default(), AlState::Init);
        Self { time, misses: 2, real_time, leave, io_at: None, clocks: false, hold: false }
    }

    /// How many cycles in a row the application may be late before its outputs are withheld.
    #[must_use]
    pub const fn allow_misses(mut self, misses: u32) -> Self {
        self.misses = misses;
        self
    }

    /// Distributed clocks: every SubDevice that has one and says in its EEPROM how it is to be used gets
    /// SYNC0 in the beat of this cycle, and the cycle follows the reference clock. A plan of a project that
    /// chooses clocks keeps its choices.
    #[must_use]
    pub const fn dc(mut self) -> Self {
        self.clocks = true;
        self
    }

    /// Frames leave when the cycle begins, with the outputs of the cycle before, and the application runs
    /// after them, on inputs that have just come back: steady, for motion. It is so unless a project says
    /// otherwise.
    #[must_use]
    pub const fn exchange_at_begin(mut self) -> Self {
        self.io_at = Some(IoAt::TaskBegin);
        self
    }

    /// The application runs when the cycle begins, and frames leave as soon as it has returned: outputs are
    /// as fresh as they can be, and jitter with the application. What need not go before them runs in
    /// [`Application::after_outputs`].
    #[must_use]
    pub const fn exchange_at_end(mut self) -> Self {
        self.io_at = Some(IoAt::TaskEnd);
        self
    }

    /// SubDevices stay in PREOP until the application has given outputs for the first time: one that is not
    /// ready calls [`Io::outputs_are_old`](crate::Io::outputs_are_old).
    #[must_use]
    pub const fn wait_for_outputs(mut self) -> Self {
        self.hold = true;
        self
    }

    /// Keeps the cycle on this CPU, counted from 0.
    #[must_use]
    pub const fn on_cpu(mut self, cpu: usize) -> Self {
        self.real_time.cpu = Some(cpu);
        self
    }

    /// Real-time priority, 1 to 99; `None` for none. It is 80 unless said, and where the right is
    /// missing the line runs without: the report says so.
    #[must_use]
    pub const fn priority(mut self, priority: Option<u8>) -> Self {
        self.real_time.priority = priority;
        self
    }

    /// The state in which SubDevices are left at the end, INIT unless said.
    #[must_use]
    pub const fn leave_in(mut self, state: AlState) -> Self {
        self.leave = state;
        self
    }
}

impl Segment {
    /// Opens a virtual segment that a program has made, in virtual time that goes as fast as the work is done.
    ///
    /// # Errors
    /// When it cannot be built: an unknown type, a port that is used twice.
    pub fn simulated(file: &SegmentFile) -> Result<Self, Error> {
        let line = built(file, &Error::Segment)?;
        Ok(Self { line, place: format!("sim:{}", file.name), stop: Stop::default() })
    }

    /// Breaks a virtual segment. The times of the fault count from now on.
    ///
    /// # Errors
    /// On a card, or where the segment has no such place.
    pub fn inject(&mut self, fault: &FaultEntry) -> Result<FaultId, Error> {
        let (line, refuse) = (self.simulation()?, |why: String| Error::Segment(why));
        let now = line.now();
        line.segment_mut().inject(now, fault).map_err(|error| refuse(error.to_string()))
    }

    /// Ends a fault of a virtual segment.
    ///
    /// # Errors
    /// On a card.
    pub fn heal(&mut self, fault: FaultId) -> Result<(), Error> {
        let line = self.simulation()?;
        let now = line.now();
        line.segment_mut().heal(now, fault);
        Ok(())
    }

    fn simulation(&mut self) -> Result<&mut SegmentTransport, Error> {
        match &mut self.line {
            Where::Virtual(line) => Ok(line),
            Where::Cards(_) => Err(Error::NotSimulated { given: self.place.clone() }),
        }
    }

    /// Finds out what is there. SubDevices get station addresses, and keep their states.
    ///
    /// # Errors
    /// When nobody answers.
    pub fn scan(&mut self) -> Result<Scan, Error> {
        let inventory = running::scan(self.line.line(), PATIENCE, &self.stop)?;
        Ok(Scan { inventory })
    }

    /// The plan of a project (TOML), if what it says is there; or of an ENI file.
    ///
    /// # Errors
    /// When the file is wrong, or another SubDevice is there than it says.
    pub fn load(&mut self, path: impl AsRef<Path>) -> Result<Plan, Error> {
        let path = path.as_ref();
        let refuse = |why: String| Error::File { path: path.to_owned(), why };
        let bytes = std::fs::read(path).map_err(|error| refuse(error.to_string()))?;
        if Eni::is_one(&bytes) {
            return Plan::load(path);
        }
        let text = String::from_utf8(bytes).map_err(|_| refuse("no text in UTF-8".to_owned()))?;
        let project = Project::parse(&text).map_err(|error| refuse(error.to_string()))?;
        // One that chooses more than who is where is planned from what it says.
        if project.chooses() {
            let file = PlanFile::open(path).map_err(|error| refuse(error.to_string()))?;
            return Ok(file.plan.into());
        }
        let PlanSource::Found(make) = PlanChoices::default().project(project) else {
            return Err(refuse("it makes no plan".to_owned()));
        };
        let inventory: Inventory = running::scan(self.line.line(), PATIENCE, &self.stop)?;
        let make: MakePlan = make;
        Ok(make(&inventory).map_err(refuse)?.into())
    }

    /// Brings the line up and calls `application` once a cycle, until it stops, or somebody calls
    /// [`stop`](Self::stopper); then stops the line. Cycles begin before all SubDevices are up:
    /// [`Io::is_settled`](crate::Io::is_settled) tells.
    ///
    /// # Errors
    /// When the line cannot be run, or its interface fails.
    pub fn run(
        &mut self,
        plan: Plan,
        cycle: RunOptions,
        application: impl FnMut(&mut Io<'_>) -> Next,
    ) -> Result<RunReport, Error> {
        self.run_application(plan, cycle, application)
    }

    /// The same for an application that is more than a closure.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn run_application(
        &mut self,
        plan: Plan,
        cycle: RunOptions,
        application: impl Application,
    ) -> Result<RunReport, Error> {
        // Nobody listens to notes here; they go nowhere.
        let (notes, _) = mpsc::sync_channel(1);
        self.run_session(plan, cycle, application, None, notes)
    }

    /// The same with the diagnosis beside it, on a thread of its own: `tell` is called for each finding that opens, is
    /// confirmed, or closes, and [`RunReport::diagnosis`] has the whole answer at the end. The cycle never waits for
    /// either.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn run_diagnosed(
        &mut self,
        plan: Plan,
        cycle: RunOptions,
        application: impl FnMut(&mut Io<'_>) -> Next,
        mut tell: impl FnMut(&Event) + Send,
    ) -> Result<RunReport, Error> {
        let setup = Setup {
            input: InputKind::Driven,
            exchange: plan.plan.exchange(),
            source: self.place.clone(),
            host_counters: true,
            probes: true,
            ..Setup::default()
        };
        let (notes, heard): (SyncSender<Note>, Receiver<Note>) = mpsc::sync_channel(NOTES);
        thread::scope(|scope| {
            scope.spawn(move || {
                for note in heard {
                    if let Note::Finding(event) = note {
                        tell(&event);
                    }
                }
            });
            self.run_session(plan, cycle, application, Some(setup), notes)
        })
    }

    fn run_session(
        &mut self,
        plan: Plan,
        cycle: RunOptions,
        application: impl Application,
        diagnose: Option<Setup>,
        notes: SyncSender<Note>,
    ) -> Result<RunReport, Error> {
        let mut plan = if cycle.clocks { plan.clocked(cycle.time)? } else { plan.plan };
        // The first task is the application's; an imported one keeps the times of its others.
        if let Some(task) = plan.tasks.first_mut() {
            task.cycle = cycle.time;
            task.io_at = cycle.io_at.unwrap_or(task.io_at);
        }
        let options = SessionOptions {
            on: self.place.clone(),
            leave: cycle.leave,
            lasts: None,
            real_time: matches!(self.line, Where::Cards(_)).then_some(cycle.real_time),
            allowed_misses: Some(cycle.misses),
            hold: cycle.hold,
            diagnose,
        };
        let wanted = PlanSource::Plan(Box::new(plan));
        let line = self.line.line();
        let beside = RunControls { stop: &self.stop, notes, socket: None };
        let ended = running::run(line, wanted, application, &options, beside)?;
        match ended.error {
            Some(error) => Err(error.into()),
            None => Ok(ended.report),
        }
    }

    /// Something to stop a run with, from another thread or a signal handler.
    #[must_use]
    pub fn stopper(&self) -> Stop {
        self.stop.clone()
    }
}
