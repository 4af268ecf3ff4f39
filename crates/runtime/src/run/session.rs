//! Run of a line: a session, what the host gives it, and who is told.

mod ending;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;

use linesman_diagnosis::{Diagnosis, Engine, FrameSeen, HostObservation, Setup};
use linesman_link::error::LinkError;
use linesman_maindevice::{Event, MainDevice, Options};
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};
use linesman_session::frame::FrameSummary;
use linesman_session::{Application, PlanRun, PlanSource, SessionHooks};

use super::bring_up::BringUpReport;
use super::diagnosis_input::{InlineDiagnosis, RunDiagnosis};
use super::diagnosis_thread::{DiagnosisObserver, DiagnosisOutput, judge};
use super::note::{Note, RunError};
use super::real_time::{GrantedRealTime, RealTime};
use super::report::{Counts, RunReport, SCHEMA, of_plan};
use super::tap::tap;
use crate::drive::Driver;
use crate::part::PartFailure;
use crate::serve::lateness::Lateness;
use crate::service::ServiceSocket;
use crate::stop::Stop;
use crate::transport::Transport;

/// That the diagnosis does not keep up is told no more often than this.
const MISSED_EVERY: Span = Span::s(10);

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

/// Room for what the diagnosis would like to have read.
const PROBES: usize = 64;

/// Room for notes that are on their way to whoever listens.
pub const NOTES: usize = 65_536;

/// The [`SessionHooks`] of a run on a machine: a [`PlanRun`], and what is beside it: notes for whoever listens, services
/// asked for through a socket, the times of the host.
pub struct RunSession<A> {
    run: PlanRun<A, RunDiagnosis>,
    notes: SyncSender<Note>,
    /// Notes for which there was no room.
    untold: Arc<AtomicU64>,
    lateness: Lateness,
    socket: Option<ServiceSocket>,
    /// Left-out frames that were told, and nothing of more before that time.
    missed_told: (u64, Instant),
    begun_at: Instant,
    granted: GrantedRealTime,
    on: String,
}

impl<A: Application> RunSession<A> {
    fn note(&self, note: Note) {
        // Whoever listened may have gone, or be busy: the machine runs on.
        if let Err(TrySendError::Full(_)) = self.notes.try_send(note) {
            self.untold.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Passes on what happened in the run.
    fn tell(&mut self) {
        while let Some(event) = self.run.poll_event() {
            self.note(event.into());
        }
        if let RunDiagnosis::Inline(inline) = self.run.diagnosis_mut()
            && let Some(failure) = inline.poll_failure()
        {
            self.note(Note::Failed(failure));
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

    /// How the run goes.
    fn report(&self, now: Instant, main: &MainDevice) -> RunReport {
        let (devices, frames) = match self.run.plan() {
            Some(plan) => of_plan(plan, main, now),
            None => (Vec::new(), Vec::new()),
        };
        let left_out = self.run.diagnosis().left_out();
        RunReport {
            schema: SCHEMA.to_owned(),
            error: None,
            on: self.on.clone(),
            time_ns: now.since(self.begun_at).as_nanos(),
            reached_ns: self.run.reached_at().map(|at| at.since(self.begun_at).as_nanos()),
            bring_up: None,
            settled: main.is_settled(),
            outputs_withheld: self.run.is_withheld(),
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
}

impl<A: Application> SessionHooks for RunSession<A> {
    #[inline]
    fn frame(&mut self, frame: &FrameSeen<'_>) {
        self.run.frame(frame);
    }

    #[inline]
    fn room(&mut self, now: Instant) -> Option<&mut [u8]> {
        self.run.room(now)
    }

    #[inline]
    fn keep(&mut self, passed: &FrameSummary, len: usize) {
        self.run.keep(passed, len);
    }

    fn host(&mut self, observation: &HostObservation) {
        self.run.host(observation);
    }

    fn event(&mut self, now: Instant, event: Event, main: &mut MainDevice) {
        if let Event::Served { ticket, result, .. } = &event {
            if let Some(socket) = &mut self.socket {
                socket.served(*ticket, result);
            }
            return;
        }
        self.run.event(now, event, main);
    }

    fn turn(&mut self, now: Instant, main: &mut MainDevice) -> bool {
        self.attend(now, main);
        let goes_on = self.run.turn(now, main);
        self.tell();
        let left_out = self.run.diagnosis().left_out();
        if left_out > self.missed_told.0 {
            self.tell_missed(now, left_out);
        }
        goes_on
    }

    fn poll_timeout(&self) -> Option<Instant> {
        self.run.poll_timeout()
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
pub fn run<L: Transport<Error = LinkError>, A: Application>(
    line: L,
    wanted: PlanSource,
    application: A,
    options: &SessionOptions,
    beside: RunControls<'_>,
) -> Result<RunOutcome, RunError> {
    let observer = |setup| Box::new(Engine::new(setup)) as Box<dyn DiagnosisObserver>;
    run_observed(line, wanted, application, options, beside, observer)
}

/// The same with a diagnosis of one's own, made of [`SessionOptions::diagnose`].
///
/// # Errors
/// As [`run`].
pub fn run_observed<L: Transport<Error = LinkError>, A: Application>(
    line: L,
    wanted: PlanSource,
    application: A,
    options: &SessionOptions,
    beside: RunControls<'_>,
    observer: impl FnOnce(Setup) -> Box<dyn DiagnosisObserver>,
) -> Result<RunOutcome, RunError> {
    let RunControls { stop, notes, socket } = beside;
    let untold = Arc::<AtomicU64>::default();
    let observer = options.diagnose.clone().map(observer);
    let (diagnosis, judging) = match observer {
        None => (RunDiagnosis::Nowhere, None),
        // In virtual time the diagnosis costs the line nothing.
        Some(observer) if options.real_time.is_none() => {
            (RunDiagnosis::Inline(InlineDiagnosis::new(observer)), None)
        }
        Some(observer) => {
            let (tap, listener) = tap(false);
            let (ask, probes) = sync_channel(PROBES);
            let (notes, untold) = (notes.clone(), Arc::clone(&untold));
            let told = DiagnosisOutput { notes, untold, probes: ask };
            let thread = judge(observer, listener, told).map_err(RunError::Thread)?;
            (RunDiagnosis::Queued { tap, probes }, Some(thread))
        }
    };
    // Threads started from here on would be real-time ones.
    let granted = options.real_time.map(RealTime::ask).unwrap_or_default();
    let allowed_misses = options.allowed_misses.filter(|_| !application.is_idle());
    let hold_at = options.hold.then_some(AlState::PreOp);
    let settings = Options { allowed_misses, hold_at, ..line.options() };
    let begun_at = line.now();
    let hooks = RunSession {
        run: PlanRun::new(Some(wanted), application, diagnosis, options.hold),
        notes,
        untold,
        lateness: Lateness::default(),
        socket,
        missed_told: (0, Instant::ZERO),
        begun_at,
        granted,
        on: options.on.clone(),
    };
    let mut driver = Driver::new(line, settings, hooks);
    let until = options.lasts.map_or(Instant::MAX, |lasts| begun_at + lasts);
    let ran = driver.drive(until, stop);
    let now = driver.now();
    let session = driver.session_mut();
    let mut report = session.hooks().report(now, session.main());
    let times = session.hooks().run.plan().zip(session.main().bring_up_times());
    report.bring_up = times.map(|(plan, times)| BringUpReport::of(plan, &times));
    let failure = session.hooks_mut().run.take_failure().map(RunError::from);
    let error = match (failure, ran) {
        (Some(failure), _) => Some(failure),
        // Where the interface has failed, nothing can be left in order.
        (None, Err(error @ RunError::Link(_))) => Some(error),
        (None, Err(error)) => driver.leave(options.leave).err().or(Some(error)),
        (None, Ok(())) => driver.leave(options.leave).err(),
    };
    if let Some(error) = &error {
        report.error = Some(error.to_string());
    }
    let ended_at = driver.now();
    let RunSession { run, notes, .. } = driver.into_hooks();
    let planned = run.plan().is_some();
    // Ends the tap, and with it the thread that judges.
    let (diagnosis, failed) = conclude(run.into_diagnosis(), judging, ended_at, &notes);
    report.diagnosis = diagnosis;
    report.failed.extend(failed.iter().map(PartFailure::to_string));
    match error {
        Some(error) if !planned => Err(error),
        error => Ok(RunOutcome { report, error, failed }),
    }
}

/// The last word of a diagnosis, or why there is none.
fn conclude(
    diagnosis: RunDiagnosis,
    judging: Option<JoinHandle<Result<Diagnosis, PartFailure>>>,
    at: Instant,
    notes: &SyncSender<Note>,
) -> (Option<Diagnosis>, Option<PartFailure>) {
    let ended = match diagnosis {
        RunDiagnosis::Nowhere => return (None, None),
        RunDiagnosis::Inline(inline) => inline.finish(at).map(|(diagnosis, events)| {
            for event in events {
                // Whoever listened may have gone.
                let _ = notes.try_send(Note::Finding(Box::new(event)));
            }
            diagnosis
        }),
        queued @ RunDiagnosis::Queued { .. } => {
            drop(queued);
            let Some(thread) = judging else { return (None, None) };
            thread.join().unwrap_or_else(|panic| {
                Err(PartFailure::of_panic("the diagnosis", "nothing was judged", &*panic))
            })
        }
    };
    match ended {
        Ok(diagnosis) => (Some(diagnosis), None),
        Err(failure) => (None, Some(failure)),
    }
}
