//! Session of a run: finds the line, makes the plan, starts, calls the application, stops.

mod ending;
mod started;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError};

use linesman_config::inventory::Inventory;
use linesman_config::plan::{DevicePlan, IoAt, Plan};
use linesman_diagnosis::{Asked, FrameSeen, HostObservation, Probe, Setup};
use linesman_maindevice::{Event, MainDevice, ProbeRequest, Target};
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};

use super::diagnosis_thread::DiagnosisObserver;
use super::io::{Application, Io, Next};
use super::note::{Note, RunError};
use super::real_time::{GrantedRealTime, RealTime};
use super::report::{Counts, RunReport, SCHEMA, of_plan};
use super::scan;
use super::tap::{FrameSummary, Tap};
use crate::drive::DriverHooks;
use crate::part::PartFailure;
use crate::serve::lateness::Lateness;
use crate::service::ServiceSocket;
use crate::stop::Stop;
use crate::transport::Transport;

pub use started::{StartedRun, start, start_observed};

/// That the diagnosis does not keep up is told no more often than this.
const MISSED_EVERY: Span = Span::s(10);

/// What is to be run.
pub enum PlanSource {
    /// A plan that is made already.
    Plan(Box<Plan>),
    /// One that is made of what a scan finds; or why it cannot be made.
    Found(MakePlan),
}

/// Makes a plan of what was found.
pub type MakePlan = Box<dyn FnOnce(&Inventory) -> Result<Plan, String> + Send>;

/// How it is to be run.
#[derive(Clone, Debug)]
pub struct SessionOptions {
    /// What the report calls the line.
    pub on: String,
    /// The state in which SubDevices are left at the end.
    pub leave: AlState,
    /// How long it runs; `None`: until somebody stops it.
    pub lasts: Option<Span>,
    /// What is asked of the host; `None` in virtual time.
    pub real_time: Option<RealTime>,
    /// Cycles in a row in which the application may be late before outputs are withheld; `None`: as
    /// many as it likes.
    pub allowed_misses: Option<u32>,
    /// SubDevices stay in PREOP until the application gives outputs for the first time (SW-16).
    pub hold: bool,
    /// How the line is judged while it runs; `None`: it is not.
    pub diagnose: Option<Setup>,
}

/// Room for notes that are on their way to whoever listens.
pub const NOTES: usize = 65_536;

/// A session of a MainDevice. It is the [`DriverHooks`] of a [`Driver`](crate::drive::Driver).
pub struct RunSession<A> {
    wanted: Option<PlanSource>,
    application: A,
    io_at: IoAt,
    notes: SyncSender<Note>,
    tap: Option<Tap>,
    /// What the diagnosis would like to have read.
    probes: Option<Receiver<Probe>>,
    plan: Option<Arc<Plan>>,
    begun: bool,
    reached_at: Option<Instant>,
    failure: Option<RunError>,
    lateness: Lateness,
    /// The application has enough, or the line is being stopped.
    ended: bool,
    leaving: bool,
    withheld: bool,
    /// SubDevices wait in PREOP for the first outputs.
    held: bool,
    scan_until: Instant,
    socket: Option<ServiceSocket>,
    /// Notes for which there was no room.
    untold: Arc<AtomicU64>,
    /// Left-out frames that were told, and nothing of more before that time.
    missed_told: (u64, Instant),
    begun_at: Instant,
    granted: GrantedRealTime,
    on: String,
    /// The caller takes the turn of the application behind it; and it is the caller's turn.
    pauses: bool,
    paused: bool,
    /// The caller gave no outputs in its turn.
    old: bool,
}

impl<A: Application> RunSession<A> {
    fn start(&mut self, now: Instant, plan: Plan, main: &mut MainDevice) {
        if let Err(why) = self.application.begin(&plan) {
            self.failure = Some(RunError::Plan(why));
            return;
        }
        self.io_at = plan.tasks.first().map(|task| task.io_at).unwrap_or_default();
        let plan = Arc::new(plan);
        self.note(Note::Planned(Arc::clone(&plan)));
        main.start(now, (*plan).clone());
        self.plan = Some(plan);
    }

    fn note(&self, note: Note) {
        // Whoever listened may have gone, or be busy: the machine runs on.
        if let Err(TrySendError::Full(_)) = self.notes.try_send(note) {
            self.untold.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Says that the diagnosis does not keep up.
    #[cold]
    fn tell_missed(&mut self, now: Instant, left_out: u64) {
        let (told, until) = self.missed_told;
        if left_out > told && now >= until {
            self.missed_told = (left_out, now + MISSED_EVERY);
            self.note(Note::Missed(now, left_out));
        }
    }

    fn scanned(&mut self, now: Instant, inventory: &Inventory, main: &mut MainDevice) {
        self.note(Note::Scanned(Box::new(inventory.clone())));
        let Some(PlanSource::Found(make)) = self.wanted.take() else { return };
        match make(inventory) {
            Ok(plan) => self.start(now, plan, main),
            Err(why) => self.failure = Some(RunError::Plan(why)),
        }
    }

    /// How the run goes.
    fn report(&self, now: Instant, main: &MainDevice) -> RunReport {
        let (devices, frames) = match &self.plan {
            Some(plan) => of_plan(plan, main, now),
            None => (Vec::new(), Vec::new()),
        };
        let left_out = self.tap.as_ref().map_or(0, Tap::left_out);
        RunReport {
            schema: SCHEMA.to_owned(),
            error: None,
            on: self.on.clone(),
            time_ns: now.since(self.begun_at).as_nanos(),
            reached_ns: self.reached_at.map(|at| at.since(self.begun_at).as_nanos()),
            bring_up: None,
            settled: main.is_settled(),
            outputs_withheld: self.withheld,
            devices,
            frames,
            responding: main.responding().map(|count| count.0),
            counts: Counts {
                untold: self.untold.load(Ordering::Relaxed),
                ..Counts::of(&main.statistics(), left_out)
            },
            lateness: self.lateness.report(),
            host: (&self.granted).into(),
            failed: Vec::new(),
            diagnosis: None,
        }
    }

    /// Takes what is asked for through the socket.
    fn attend(&mut self, now: Instant, main: &mut MainDevice) {
        let Some(mut socket) = self.socket.take() else { return };
        socket.turn(now, main, |main| self.report(now, main));
        self.socket = Some(socket);
    }

    /// Has read what the diagnosis would like to know; it sees the frames.
    fn look_up(&mut self, now: Instant, main: &mut MainDevice) {
        let (Some(plan), Some(probes)) = (&self.plan, &self.probes) else { return };
        while let Ok(probe) = probes.try_recv() {
            match probe.what {
                Asked::Register { address, len } => {
                    let target = Target::Station(probe.station);
                    main.probe(now, ProbeRequest { target, register: address, len, write: None });
                }
                Asked::Written { address, data } => {
                    let (target, write) = (Target::Station(probe.station), Some(data.to_vec()));
                    main.probe(now, ProbeRequest { target, register: address, len: 2, write });
                }
                Asked::Object(object) => {
                    let at = |device: &&DevicePlan| device.station == probe.station;
                    if let Some(device) = plan.devices.iter().find(at) {
                        main.sdo_upload(now, device.id, object, false);
                    }
                }
            }
        }
    }

    /// Calls the application when it is its turn.
    fn call(&mut self, now: Instant, main: &mut MainDevice) {
        if std::mem::take(&mut self.paused) {
            let old = std::mem::take(&mut self.old);
            return self.give_outputs(now, main, old);
        }
        // The first task is that of the application; others exchange beside it.
        let exchanged = main.take_exchanged(0);
        let missed = main.statistics().cycles_missed;
        let due = match self.io_at {
            IoAt::TaskBegin => exchanged,
            IoAt::TaskEnd => {
                if exchanged {
                    let withheld = self.withheld;
                    let mut io = Io { main: &mut *main, now, missed, withheld, old: false };
                    self.application.after_outputs(&mut io);
                }
                main.next_cycle(0).is_some_and(|due| due <= now)
            }
        };
        if !due {
            return;
        }
        let mut io = Io { main: &mut *main, now, missed, withheld: self.withheld, old: false };
        if self.application.cycle(&mut io) == Next::Stop {
            self.ended = true;
        }
        let old = io.old;
        self.paused = self.pauses && !self.ended;
        if !self.paused {
            self.give_outputs(now, main, old);
        }
    }

    /// Outputs count as given anew unless they are old.
    fn give_outputs(&mut self, now: Instant, main: &mut MainDevice, old: bool) {
        if !old && !self.application.is_idle() {
            main.outputs_mut();
            if std::mem::take(&mut self.held) {
                main.release(now);
            }
        }
    }
}

impl<A: Application> DriverHooks for RunSession<A> {
    #[inline]
    fn frame(&mut self, frame: &FrameSeen<'_>) {
        if let Some(tap) = &mut self.tap {
            tap.frame(frame);
        }
    }

    #[inline]
    fn room(&mut self, now: Instant) -> Option<&mut [u8]> {
        self.tap.as_mut().map(|tap| &mut tap.room(now)[..])
    }

    #[inline]
    fn keep(&mut self, sent: &FrameSummary, len: usize) {
        if let Some(tap) = &mut self.tap {
            tap.keep(sent, len);
        }
    }

    fn host(&mut self, observation: &HostObservation) {
        self.note(Note::Host(*observation));
        if let Some(tap) = &mut self.tap {
            tap.host(observation);
        }
    }

    #[allow(clippy::wildcard_enum_match_arm, reason = "all but a few are only passed on")]
    fn event(&mut self, now: Instant, event: Event, main: &mut MainDevice) {
        match &event {
            Event::Scanned(inventory) => return self.scanned(now, inventory, main),
            Event::ScanFailed(error) => self.failure = Some(RunError::Scan(error.to_string())),
            Event::AllReached => {
                self.reached_at.get_or_insert(now);
            }
            Event::OutputsWithheld { .. } => self.withheld = true,
            Event::OutputsResumed { .. } => self.withheld = false,
            Event::Stopped => self.ended = true,
            Event::Served { ticket, result, .. } => {
                if let Some(socket) = &mut self.socket {
                    socket.served(*ticket, result);
                }
                self.application.served(*ticket, result);
                return;
            }
            _ => {}
        }
        self.note(Note::Event(now, Box::new(event)));
    }

    fn turn(&mut self, now: Instant, main: &mut MainDevice) -> bool {
        if let Some(tap) = &mut self.tap {
            tap.turn(now);
            let left_out = tap.left_out();
            if left_out > self.missed_told.0 {
                self.tell_missed(now, left_out);
            }
        }
        if !self.begun {
            self.begun = true;
            self.scan_until = now + scan::PATIENCE;
            match self.wanted.take() {
                Some(PlanSource::Plan(plan)) => self.start(now, *plan, main),
                other => {
                    self.wanted = other;
                    main.scan(now);
                }
            }
        }
        if self.plan.is_none() && now > self.scan_until && self.failure.is_none() {
            let words =
                "the scan was not done after 60 s. Do: look at the line with `linesman scan`";
            self.failure = Some(RunError::Scan(words.to_owned()));
        }
        self.attend(now, main);
        if !self.leaving {
            self.look_up(now, main);
        }
        if self.plan.is_some() && !self.leaving {
            self.call(now, main);
        }
        self.failure.is_none() && !self.ended
    }

    fn is_paused(&self) -> bool {
        self.paused
    }

    fn poll_timeout(&self) -> Option<Instant> {
        None
    }

    #[inline]
    fn late(&mut self, late: Span) {
        self.lateness.note(late);
    }
}

/// A run that has ended.
pub struct RunOutcome {
    /// How it went.
    pub report: RunReport,
    /// What ended it, if it was not the time, a wish, or the application.
    pub error: Option<RunError>,
    /// A part of this program that failed while the line was driven on.
    pub failed: Option<PartFailure>,
}

/// Who has a say in a run, and who is told.
pub struct RunControls<'a> {
    /// The wish to stop.
    pub stop: &'a Stop,
    /// What happens.
    /// What does not fit there is not told, and counted: nobody waits for a slow listener.
    pub notes: SyncSender<Note>,
    /// Services for single SubDevices, asked for through a socket.
    pub socket: Option<ServiceSocket>,
}

/// Runs a line until its time is over, `stop`, or the application has enough; then stops it: outputs
/// to zero, SubDevices back to where they shall be left.
///
/// # Errors
/// When nothing could be run: the line does not answer, or is not what was wanted.
pub fn run<L: Transport, A: Application>(
    line: L,
    wanted: PlanSource,
    application: A,
    options: &SessionOptions,
    beside: RunControls<'_>,
) -> Result<RunOutcome, RunError> {
    let mut started = start(line, wanted, application, options, beside)?;
    started.drive();
    started.end()
}

/// The same with a diagnosis of one's own, made of [`SessionOptions::diagnose`].
///
/// # Errors
/// As [`run`].
pub fn run_observed<L: Transport, A: Application>(
    line: L,
    wanted: PlanSource,
    application: A,
    options: &SessionOptions,
    beside: RunControls<'_>,
    observer: impl FnOnce(Setup) -> Box<dyn DiagnosisObserver>,
) -> Result<RunOutcome, RunError> {
    let mut started = start_observed(line, wanted, application, options, beside, observer)?;
    started.drive();
    started.end()
}
