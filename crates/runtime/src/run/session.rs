//! Run of a line: a session, what the host gives it, and who is told.

mod ending;
mod started;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{SyncSender, TrySendError};

use linesman_diagnosis::{FrameSeen, HostObservation, Setup};
use linesman_link::error::LinkError;
use linesman_maindevice::{Event, MainDevice};
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};
use linesman_session::frame::FrameSummary;
use linesman_session::{Application, PlanRun, PlanSource, SessionHooks};

use super::diagnosis_input::RunDiagnosis;
use super::diagnosis_thread::DiagnosisObserver;
use super::group::NetworkPlace;
use super::note::{Note, RunError};
use super::real_time::{GrantedRealTime, RealTime};
use super::report::{Counts, RunReport, SCHEMA, not_taken, of_plan};
use crate::ads::AdsServer;
use crate::ethernet::VirtualEthernet;
use crate::gateway::MailboxGateway;
use crate::part::PartFailure;
use crate::serve::lateness::Lateness;
use crate::service::ServiceSocket;
use crate::stop::Stop;
use crate::transport::Transport;

pub use started::{StartedRun, start, start_observed};

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
    /// Networks of this process that keep one time, this one among them; `None`: it is alone.
    pub group: Option<NetworkPlace>,
}

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
    gateway: Option<MailboxGateway>,
    ads: Option<AdsServer>,
    ethernet: Option<VirtualEthernet>,
    /// Left-out frames that were told, and nothing of more before that time.
    missed_told: (u64, Instant),
    begun_at: Instant,
    granted: GrantedRealTime,
    on: String,
    group: Option<NetworkPlace>,
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
            gateway: self.gateway.as_ref().map(MailboxGateway::report),
            ads: self.ads.as_ref().map(AdsServer::report),
            ethernet: self.ethernet.as_ref().and_then(VirtualEthernet::report),
            group: self.group.as_ref().map(|place| place.report(main)),
            not_taken: self
                .run
                .plan()
                .zip(main.network_status())
                .map_or_else(Vec::new, |(plan, status)| not_taken(plan, status)),
            failed: Vec::new(),
            diagnosis: None,
        }
    }

    /// Takes what is asked for through the socket, the mailbox gateway and the ADS server, and frames for SubDevices.
    fn attend(&mut self, now: Instant, main: &mut MainDevice) {
        if let Some(gateway) = &mut self.gateway {
            gateway.turn(now, main);
        }
        if let Some(ethernet) = &mut self.ethernet {
            ethernet.turn(now, main);
        }
        if let Some(mut ads) = self.ads.take() {
            ads.turn(now, main, |main| self.report(now, main));
            self.ads = Some(ads);
        }
        if let Some(mut socket) = self.socket.take() {
            socket.turn(now, main, |main| self.report(now, main));
            self.socket = Some(socket);
        }
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

    fn event(&mut self, now: Instant, mut event: Event, main: &mut MainDevice) {
        if let (Some(ethernet), Event::Mailbox { id, kind, data }) =
            (&mut self.ethernet, &mut event)
            && ethernet.message(*id, *kind, data)
        {
            return;
        }
        if let Event::Served { ticket, result, .. } = &event {
            if let Some(socket) = &mut self.socket {
                socket.served(*ticket, result);
            }
            if let Some(ads) = &mut self.ads {
                ads.served(*ticket, result);
            }
            if let Some(gateway) = &mut self.gateway {
                gateway.served(*ticket, result);
            }
            if let Some(ethernet) = &mut self.ethernet {
                ethernet.served(*ticket, result);
            }
            self.run.application_mut().served(*ticket, result);
            return;
        }
        if let (Some(socket), Event::FileProgress { id, progress }) = (&mut self.socket, &event) {
            socket.file_moved(*id, progress.clone());
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

    fn is_paused(&self) -> bool {
        self.run.is_paused()
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
    /// Mailbox messages of other programs.
    pub gateway: Option<MailboxGateway>,
    /// Requests of other programs by ADS.
    pub ads: Option<AdsServer>,
    /// Ethernet frames between SubDevices and this computer.
    pub ethernet: Option<VirtualEthernet>,
}

impl<'a> RunControls<'a> {
    /// Controls of a run of which no other program asks anything.
    #[must_use]
    pub const fn new(stop: &'a Stop, notes: SyncSender<Note>) -> Self {
        Self { stop, notes, socket: None, gateway: None, ads: None, ethernet: None }
    }
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
    let mut started = start(line, wanted, application, options, beside)?;
    started.drive();
    started.end()
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
    let mut started = start_observed(line, wanted, application, options, beside, observer)?;
    started.drive();
    started.end()
}
