//! A run that is under way: driven to its end, or cycle by cycle by its caller.

use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::JoinHandle;

use linesman_diagnosis::{Diagnosis, Engine, Setup};
use linesman_link::error::LinkError;
use linesman_maindevice::Options;
use linesman_proto::state::AlState;
use linesman_proto::time::Instant;
use linesman_session::{Application, Io, PlanRun, PlanSource, SessionHooks};

use super::super::bring_up::BringUpReport;
use super::super::diagnosis_input::{InlineDiagnosis, RunDiagnosis};
use super::super::diagnosis_thread::{DiagnosisObserver, DiagnosisOutput, judge};
use super::super::group::NetworkPlace;
use super::super::note::{Note, RunError};
use super::super::real_time::RealTime;
use super::super::tap::tap;
use super::{RunControls, RunOutcome, RunSession, SessionOptions};
use crate::drive::Driver;
use crate::part::PartFailure;
use crate::serve::lateness::Lateness;
use crate::stop::Stop;
use crate::transport::Transport;

/// Room for what the diagnosis would like to have read.
const PROBES: usize = 64;

/// A run that is under way. Nothing is sent until it is driven; [`StartedRun::end`] stops the line.
pub struct StartedRun<'a, L, A> {
    driver: Driver<L, RunSession<A>>,
    judging: Option<JoinHandle<Result<Diagnosis, PartFailure>>>,
    stop: &'a Stop,
    until: Instant,
    leave: AlState,
    ran: Result<(), RunError>,
}

/// Starts a run. Nothing is sent yet.
///
/// # Errors
/// When the system has no more threads.
pub fn start<'a, L: Transport<Error = LinkError>, A: Application>(
    line: L,
    wanted: PlanSource,
    application: A,
    options: &SessionOptions,
    beside: RunControls<'a>,
) -> Result<StartedRun<'a, L, A>, RunError> {
    let observer = |setup| Box::new(Engine::new(setup)) as Box<dyn DiagnosisObserver>;
    start_observed(line, wanted, application, options, beside, observer)
}

/// The same with a diagnosis of one's own, made of [`SessionOptions::diagnose`].
///
/// # Errors
/// When the system has no more threads.
pub fn start_observed<'a, L: Transport<Error = LinkError>, A: Application>(
    line: L,
    wanted: PlanSource,
    application: A,
    options: &SessionOptions,
    beside: RunControls<'a>,
    observer: impl FnOnce(Setup) -> Box<dyn DiagnosisObserver>,
) -> Result<StartedRun<'a, L, A>, RunError> {
    let RunControls { stop, notes, socket, gateway, ads, ethernet } = beside;
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
    let group = options.group.as_ref().map(NetworkPlace::network);
    let settings = Options { allowed_misses, hold_at, group, ..line.options() };
    let begun_at = line.now();
    let hooks = RunSession {
        run: PlanRun::new(Some(wanted), application, diagnosis, options.hold),
        notes,
        untold,
        lateness: Lateness::default(),
        socket,
        gateway,
        ads,
        ethernet,
        missed_told: (0, Instant::ZERO),
        begun_at,
        granted,
        on: options.on.clone(),
        group: options.group.clone(),
    };
    Ok(StartedRun {
        driver: Driver::new(line, settings, hooks),
        judging,
        stop,
        until: options.lasts.map_or(Instant::MAX, |lasts| begun_at + lasts),
        leave: options.leave,
        ran: Ok(()),
    })
}

impl<L: Transport<Error = LinkError>, A: Application> StartedRun<'_, L, A> {
    /// Drives the line until its time is over, somebody wants it to stop, or the application has enough.
    pub fn drive(&mut self) {
        self.ran = self.driver.drive(self.until, self.stop);
        if let Err(RunError::Link(LinkError::Vanished { .. })) = &self.ran {
            let now = self.driver.now();
            let (hooks, main) = self.driver.session_mut().parts_mut();
            main.handle_interface_gone();
            hooks.run.interface_gone(now, main);
        }
    }

    /// Drives the line until the application has been called, and the turn is the caller's: [`StartedRun::io`].
    /// Outputs of the turn before count as given anew unless they are `old`. False when the run is over.
    pub fn cycle(&mut self, old: bool) -> bool {
        if self.ran.is_err() {
            return false;
        }
        self.driver.session_mut().hooks_mut().run.pause(old);
        self.drive();
        self.driver.session().hooks().is_paused() && self.ran.is_ok()
    }

    /// The process data of the cycle whose turn it is.
    pub fn io(&mut self) -> Io<'_> {
        let now = self.driver.now();
        let (hooks, main) = self.driver.session_mut().parts_mut();
        hooks.run.io(now, main)
    }

    /// Stops the line: outputs to zero, SubDevices to where they shall be left.
    ///
    /// # Errors
    /// When nothing could be run: the line does not answer, or is not what was wanted.
    pub fn end(self) -> Result<RunOutcome, RunError> {
        let Self { mut driver, judging, leave, ran, .. } = self;
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
            (None, Err(error)) => driver.leave(leave).err().or(Some(error)),
            (None, Ok(())) => driver.leave(leave).err(),
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
