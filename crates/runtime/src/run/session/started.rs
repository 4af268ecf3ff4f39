//! A run that is under way: driven to its end, or cycle by cycle by its caller.

use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::sync::mpsc::sync_channel;
use std::thread::JoinHandle;

use linesman_config::plan::IoAt;
use linesman_diagnosis::{Diagnosis, Engine, Setup};
use linesman_maindevice::Options;
use linesman_proto::state::AlState;
use linesman_proto::time::Instant;

use super::super::bring_up::BringUpReport;
use super::super::diagnosis_thread::{DiagnosisObserver, DiagnosisOutput, judge};
use super::super::io::{Application, Io};
use super::super::note::RunError;
use super::super::real_time::RealTime;
use super::super::tap::tap;
use super::{PlanSource, RunControls, RunOutcome, RunSession, SessionOptions};
use crate::drive::Driver;
use crate::part::PartFailure;
use crate::serve::lateness::Lateness;
use crate::stop::Stop;
use crate::transport::Transport;

/// Room for what the diagnosis would like to have read.
const PROBES: usize = 64;

/// A run that is under way. Nothing is sent until it is driven; [`StartedRun::end`] stops the line.
pub struct StartedRun<'a, L, A> {
    driver: Driver<L>,
    session: RunSession<A>,
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
pub fn start<'a, L: Transport, A: Application>(
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
pub fn start_observed<'a, L: Transport, A: Application>(
    line: L,
    wanted: PlanSource,
    application: A,
    options: &SessionOptions,
    beside: RunControls<'a>,
    observer: impl FnOnce(Setup) -> Box<dyn DiagnosisObserver>,
) -> Result<StartedRun<'a, L, A>, RunError> {
    let RunControls { stop, notes, socket } = beside;
    let is_virtual = options.real_time.is_none();
    let (ask, probes) = sync_channel(PROBES);
    let untold = Arc::<AtomicU64>::default();
    let (tap, judging) = match &options.diagnose {
        None => (None, None),
        Some(setup) => {
            let (tap, listener) = tap(is_virtual);
            // In virtual time the judge has no time of its own: when it asked would be chance.
            let setup = Setup { probes: !is_virtual, ..setup.clone() };
            let (notes, untold) = (notes.clone(), Arc::clone(&untold));
            let told = DiagnosisOutput { notes, untold, probes: ask };
            let thread = judge(observer(setup), listener, told).map_err(RunError::Thread)?;
            (Some(tap), Some(thread))
        }
    };
    // Threads started from here on would be real-time ones.
    let granted = options.real_time.map(RealTime::ask).unwrap_or_default();
    let allowed_misses = options.allowed_misses.filter(|_| !application.is_idle());
    let hold_at = options.hold.then_some(AlState::PreOp);
    let settings = Options { allowed_misses, hold_at, ..line.options() };
    let driver = Driver::new(line, settings);
    let begun = driver.now();
    let session = RunSession {
        wanted: Some(wanted),
        application,
        io_at: IoAt::default(),
        notes,
        probes: tap.is_some().then_some(probes),
        tap,
        plan: None,
        begun: false,
        reached_at: None,
        failure: None,
        lateness: Lateness::default(),
        ended: false,
        leaving: false,
        withheld: false,
        held: options.hold,
        scan_until: Instant::MAX,
        socket,
        untold,
        missed_told: (0, Instant::ZERO),
        begun_at: begun,
        granted,
        on: options.on.clone(),
        pauses: false,
        paused: false,
        old: false,
    };
    Ok(StartedRun {
        driver,
        session,
        judging,
        stop,
        until: options.lasts.map_or(Instant::MAX, |lasts| begun + lasts),
        leave: options.leave,
        ran: Ok(()),
    })
}

impl<L: Transport, A: Application> StartedRun<'_, L, A> {
    /// Drives the line until its time is over, somebody wants it to stop, or the application has enough.
    pub fn drive(&mut self) {
        self.ran = self.session.drive(&mut self.driver, self.until, self.stop);
    }

    /// Drives the line until the application has been called, and the turn is the caller's: [`StartedRun::io`].
    /// Outputs of the turn before count as given anew unless they are `old`. False when the run is over.
    pub fn cycle(&mut self, old: bool) -> bool {
        if self.ran.is_err() {
            return false;
        }
        (self.session.pauses, self.session.old) = (true, old);
        self.drive();
        self.session.paused && self.ran.is_ok()
    }

    /// The process data of the cycle whose turn it is.
    pub fn io(&mut self) -> Io<'_> {
        let (now, withheld) = (self.driver.now(), self.session.withheld);
        let main = self.driver.main_mut();
        let missed = main.statistics().cycles_missed;
        Io { main, now, missed, withheld, old: false }
    }

    /// Stops the line: outputs to zero, SubDevices to where they shall be left.
    ///
    /// # Errors
    /// When nothing could be run: the line does not answer, or is not what was wanted.
    pub fn end(self) -> Result<RunOutcome, RunError> {
        let Self { mut driver, mut session, judging, leave, ran, .. } = self;
        (session.pauses, session.paused) = (false, false);
        let now = driver.now();
        let mut report = session.report(now, driver.main_mut());
        let times = session.plan.as_deref().zip(driver.main_mut().bring_up_times());
        report.bring_up = times.map(|(plan, times)| BringUpReport::of(plan, &times));
        let error = match (session.failure.take(), ran) {
            (Some(failure), _) => Some(failure),
            // Where the interface has failed, nothing can be left in order.
            (None, Err(error @ RunError::Link(_))) => Some(error),
            (None, Err(error)) => session.leave(&mut driver, leave).err().or(Some(error)),
            (None, Ok(())) => session.leave(&mut driver, leave).err(),
        };
        if let Some(error) = &error {
            report.error = Some(error.to_string());
        }
        let planned = session.plan.is_some();
        // Ends the tap, and with it the thread that judges.
        drop(session);
        let judged = judging.map(|thread| match thread.join() {
            Ok(judged) => judged,
            Err(panic) => {
                Err(PartFailure::of_panic("the diagnosis", "nothing was judged", &*panic))
            }
        });
        let (diagnosis, failed) = match judged.transpose() {
            Ok(diagnosis) => (diagnosis, None),
            Err(failure) => (None, Some(failure)),
        };
        report.diagnosis = diagnosis;
        report.failed.extend(failed.iter().map(PartFailure::to_string));
        match error {
            Some(error) if !planned => Err(error),
            error => Ok(RunOutcome { report, error, failed }),
        }
    }
}
