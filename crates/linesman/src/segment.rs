//! A line that is opened: scanned, planned, run.

use std::path::Path;
use std::rc::Rc;
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::thread;

use linesman_config::eni::Eni;
use linesman_config::project::Project;
use linesman_diagnosis::{Event, InputKind, Setup};
use linesman_link::clock::HostClock;
use linesman_link::error::LinkError;
use linesman_runtime::listen::is_driven;
use linesman_runtime::named_files::NamedFiles;
use linesman_runtime::plan_file::PlanFile;
use linesman_runtime::run::report::RunReport;
use linesman_runtime::run::scan::PATIENCE;
use linesman_runtime::run::{
    self as running, MakePlan, NOTES, Note, PlanChoices, PlanSource, RunControls, SessionOptions,
    StartedRun,
};
use linesman_runtime::selector::Selector;
use linesman_runtime::stop::Stop;
use linesman_runtime::transport::{Cards, Pace, SegmentTransport, Transport};
use linesman_runtime::wiring::Wiring;
use linesman_sim::segment::Segment as VirtualSegment;
use linesman_sim::segment_file::{FaultEntry, SegmentFile};
use linesman_sim::truth::FaultId;

use crate::application::{Borrowed, Handoff, ServedApplication};
use crate::handle::PlanId;
use crate::services::{ServiceOrder, ServiceOrders};
use crate::stepped_run::Caller;
use crate::{
    Application, Error, Io, Next, Plan, RunOptions, Scan, ServedLine, Services, Simulation,
    SteppedRun,
};

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
            OpenLine::Cards(Cards::open(&names, HostClock::start())?)
        }
        Selector::Segment(path) => OpenLine::Virtual(read(&path)?),
        Selector::Listen(_) | Selector::File(_) => {
            return Err(Error::NotDrivable { given: place.to_owned() });
        }
    };
    Ok(Segment::new(line, place.to_owned()))
}

fn read(path: &Path) -> Result<Simulation, Error> {
    let refuse = |why: String| Error::File { path: path.to_owned(), why };
    let text = std::fs::read_to_string(path).map_err(|error| refuse(error.to_string()))?;
    let file = SegmentFile::parse_with(&text, &NamedFiles::of(path))
        .map_err(|error| refuse(error.to_string()))?;
    build(&file, &refuse)
}

pub(crate) fn build(
    file: &SegmentFile,
    refuse: &dyn Fn(String) -> Error,
) -> Result<Simulation, Error> {
    let project = file.project().map_err(|error| refuse(error.to_string()))?;
    let segment = VirtualSegment::build(file).map_err(|error| refuse(error.to_string()))?;
    let ring = file.ring.is_some();
    let wiring = Wiring::of(&segment, &project);
    let line = SegmentTransport::new(segment, wiring, ring, Pace::Free)
        .map_err(|source| Error::System { doing: "making a virtual line", source })?;
    Ok(Simulation::new(line))
}

/// Cards, or a virtual segment.
enum OpenLine {
    Cards(Cards),
    Virtual(Simulation),
}

impl OpenLine {
    fn transport(&mut self) -> &mut dyn Transport<Error = LinkError> {
        match self {
            Self::Cards(cards) => cards,
            Self::Virtual(segment) => segment,
        }
    }
}

/// A run of an application on any line.
type Started<'a, A> =
    StartedRun<'a, &'a mut dyn Transport<Error = LinkError>, ServedApplication<'a, A>>;

/// A line.
pub struct Segment {
    line: OpenLine,
    place: String,
    stop: Stop,
    services: Services,
    orders: Receiver<ServiceOrder>,
}

impl Segment {
    fn new(line: OpenLine, place: String) -> Self {
        let (services, orders) = Services::new();
        Self { line, place, stop: Stop::default(), services, orders }
    }

    /// Opens a virtual segment that a program has made, in virtual time that goes as fast as the work is done.
    ///
    /// # Errors
    /// When it cannot be built: an unknown type, a port that is used twice.
    pub fn simulated(file: &SegmentFile) -> Result<Self, Error> {
        let line = OpenLine::Virtual(build(file, &Error::Segment)?);
        Ok(Self::new(line, format!("sim:{}", file.name)))
    }

    /// Handle that breaks and heals a virtual segment, also while it runs.
    ///
    /// # Errors
    /// On a card.
    pub fn simulation(&self) -> Result<Simulation, Error> {
        match &self.line {
            OpenLine::Virtual(segment) => Ok(segment.clone()),
            OpenLine::Cards(_) => Err(Error::NotSimulated { given: self.place.clone() }),
        }
    }

    /// Breaks a virtual segment. The times of the fault count from now on.
    ///
    /// # Errors
    /// On a card, or where the segment has no such place.
    pub fn inject(&mut self, fault: &FaultEntry) -> Result<FaultId, Error> {
        self.simulation()?.inject(fault)
    }

    /// Ends a fault of a virtual segment.
    ///
    /// # Errors
    /// On a card.
    pub fn heal(&mut self, fault: FaultId) -> Result<(), Error> {
        self.simulation()?.heal(fault);
        Ok(())
    }

    /// Handle that asks single SubDevices while the line runs, from the application or from another thread.
    #[must_use]
    pub fn services(&self) -> Services {
        self.services.clone()
    }

    /// Finds out what is there. SubDevices get station addresses, and keep their states.
    ///
    /// # Errors
    /// When nobody answers.
    pub fn scan(&mut self) -> Result<Scan, Error> {
        let inventory = running::scan(self.line.transport(), PATIENCE, &self.stop)?;
        Ok(Scan { inventory })
    }

    /// Scans the line and serves its SubDevices, without a run: objects, files, EEPROM, registers, states.
    ///
    /// # Errors
    /// When nobody answers.
    pub fn serve(&mut self) -> Result<ServedLine<'_>, Error> {
        let services = self.services.clone();
        ServedLine::open(self.line.transport(), services, &self.orders, &self.stop)
    }

    /// The plan of a project (TOML), if what it says is there; or of an ENI file. A run of it with the diagnosis is held
    /// against the project: names, identities, wiring.
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
            return Ok(Plan::of_project(file.plan, file.project.unwrap_or(project)));
        }
        let PlanSource::Found(make) = PlanChoices::default().project(project.clone()) else {
            return Err(refuse("it makes no plan".to_owned()));
        };
        let inventory = running::scan(self.line.transport(), PATIENCE, &self.stop)?;
        let make: MakePlan = make;
        Ok(Plan::of_project(make(&inventory).map_err(refuse)?, project))
    }

    /// Brings the line up and calls `application` once a cycle, until it stops, or somebody calls
    /// [`stop`](Self::stopper); then stops the line. Cycles begin before all SubDevices are up:
    /// [`Io::is_settled`](crate::Io::is_settled) tells.
    ///
    /// # Errors
    /// When the line cannot be run, its interface fails, or a handle of another plan is used.
    pub fn run(
        &mut self,
        plan: Plan,
        options: RunOptions,
        mut application: impl FnMut(&mut Io<'_>) -> Next,
    ) -> Result<RunReport, Error> {
        self.run_application(plan, options, &mut application)
    }

    /// The same for an application that is more than a closure.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn run_application(
        &mut self,
        plan: Plan,
        options: RunOptions,
        application: &mut impl Application,
    ) -> Result<RunReport, Error> {
        // Nobody listens to notes here; they go nowhere.
        let (notes, _) = mpsc::sync_channel(1);
        let (mut started, id, handoff) =
            self.start_session(plan, options, Borrowed(application), notes)?;
        started.drive();
        handoff.report(started.end()?, id)
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
        options: RunOptions,
        mut application: impl FnMut(&mut Io<'_>) -> Next,
        mut tell: impl FnMut(&Event) + Send,
    ) -> Result<RunReport, Error> {
        let (notes, heard): (SyncSender<Note>, Receiver<Note>) = mpsc::sync_channel(NOTES);
        thread::scope(|scope| {
            scope.spawn(move || {
                for note in heard {
                    if let Note::Finding(event) = note {
                        tell(&event);
                    }
                }
            });
            let options = options.diagnosed();
            let (mut started, id, handoff) =
                self.start_session(plan, options, Borrowed(&mut application), notes)?;
            started.drive();
            handoff.report(started.end()?, id)
        })
    }

    /// Brings the line up for a caller that takes the cycles itself, one by one, in a loop of its own.
    ///
    /// # Errors
    /// When clocks are asked for and the plan has none, or the system has no more threads. What goes wrong later
    /// is said by [`SteppedRun::stop`].
    pub fn start(&mut self, plan: Plan, options: RunOptions) -> Result<SteppedRun<'_>, Error> {
        let (notes, heard) = mpsc::sync_channel(if options.diagnosed { NOTES } else { 1 });
        // Notes that nobody wants go nowhere.
        let heard = options.diagnosed.then_some(heard);
        let (started, id, handoff) = self.start_session(plan, options, Caller, notes)?;
        Ok(SteppedRun::new(started, heard, id, handoff))
    }

    fn start_session<A: Application>(
        &mut self,
        plan: Plan,
        options: RunOptions,
        application: A,
        notes: SyncSender<Note>,
    ) -> Result<(Started<'_, A>, PlanId, Rc<Handoff>), Error> {
        let (id, handoff) = (plan.id(), Rc::<Handoff>::default());
        let project = plan.project().cloned();
        let plan = plan.for_run(&options)?;
        let setup = || Setup {
            input: InputKind::Driven,
            project,
            exchange: plan.exchange(),
            source: self.place.clone(),
            host_counters: true,
            probes: true,
            ..Setup::default()
        };
        let session = SessionOptions {
            on: self.place.clone(),
            leave: options.leave,
            lasts: None,
            real_time: matches!(self.line, OpenLine::Cards(_)).then_some(options.real_time),
            allowed_misses: Some(options.misses),
            hold: options.hold,
            diagnose: options.diagnosed.then(setup),
            group: None,
        };
        let served = ServedApplication {
            application,
            orders: ServiceOrders::new(&self.orders, id),
            plan: id,
            handoff: Rc::clone(&handoff),
        };
        let wanted = PlanSource::Plan(Box::new(plan));
        let beside = RunControls::new(&self.stop, notes);
        let started = running::start(self.line.transport(), wanted, served, &session, beside)?;
        Ok((started, id, handoff))
    }

    /// Something to stop a run with, from another thread or a signal handler.
    #[must_use]
    pub fn stopper(&self) -> Stop {
        self.stop.clone()
    }
}
