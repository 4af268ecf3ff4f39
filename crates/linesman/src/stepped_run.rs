//! A run that its caller drives, cycle by cycle.

use std::rc::Rc;
use std::sync::mpsc::Receiver;

use linesman_diagnosis::Event;
use linesman_link::error::LinkError;
use linesman_proto::time::DcTime;
use linesman_runtime::run::report::RunReport;
use linesman_runtime::run::{Next, Note, StartedRun};
use linesman_runtime::transport::Transport;

use crate::application::{Handoff, ServedApplication};
use crate::handle::PlanId;
use crate::{Application, Error, Io};

/// A run whose cycles the caller takes one by one, in a loop and a thread of its own: [`Segment::start`](
/// crate::Segment::start). When it is dropped, the line is stopped as by [`SteppedRun::stop`].
///
/// ```
/// use linesman::prelude::*;
///
/// # fn first_lines() -> Result<(), linesman::Error> {
/// let devices = [("K1", "EK1100"), ("Lamps", "EL2008")];
/// let mut segment = Segment::simulated(&SegmentFile::in_a_row("machine", 1, &devices))?;
/// let plan = segment.scan()?.plan()?;
/// let lamp: Output<bool> = plan.output("EL2008/1")?;
/// let mut run = segment.start(plan, RunOptions::us(1_000))?;
/// let mut settled = 0;
/// while let Some(mut io) = run.cycle() {
///     settled += u32::from(io.is_settled());
///     io.set(lamp, settled % 2 == 0);
///     if settled == 100 {
///         break;
///     }
/// }
/// assert_eq!(run.stop()?.counts.working_counter_errors, 0);
/// # Ok(())
/// # }
/// # first_lines().unwrap();
/// ```
pub struct SteppedRun<'a> {
    started: Option<
        StartedRun<'a, &'a mut dyn Transport<Error = LinkError>, ServedApplication<'a, Caller>>,
    >,
    /// Where findings come from, if the run is diagnosed.
    notes: Option<Receiver<Note>>,
    plan: PlanId,
    handoff: Rc<Handoff>,
}

/// The application of a run whose caller is the application.
pub(crate) struct Caller;

impl Application for Caller {
    fn cycle(&mut self, _: &mut Io<'_>) -> Next {
        Next::Continue
    }
}

impl<'a> SteppedRun<'a> {
    pub(crate) const fn new(
        started: StartedRun<
            'a,
            &'a mut dyn Transport<Error = LinkError>,
            ServedApplication<'a, Caller>,
        >,
        notes: Option<Receiver<Note>>,
        plan: PlanId,
        handoff: Rc<Handoff>,
    ) -> Self {
        Self { started: Some(started), notes, plan, handoff }
    }

    /// Waits for the next cycle and gives its process data; `None` when the run is over, and [`SteppedRun::stop`] says why.
    /// Outputs that are set leave with the next frames. The cycle begins at its time: a caller that comes back
    /// later is late, and what that means is said at [`RunOptions::allow_misses`](crate::RunOptions::allow_misses).
    ///
    /// Cycles begin before all SubDevices are up: [`Io::is_settled`] tells.
    pub fn cycle(&mut self) -> Option<Io<'_>> {
        let started = self.started.as_mut()?;
        if self.handoff.foreign.get().is_some() || !started.cycle(self.handoff.old.take()) {
            return None;
        }
        Some(Io::new(started.io(), self.plan, &self.handoff))
    }

    /// Tells a time outside that is `time` now, where the project has `time_source = "program"`. Before the first
    /// [`cycle`](Self::cycle) it is the time that the clocks are set to: that of an upper network, told on by
    /// [`Io::tell_outside_time`] in each cycle, makes this network a clocked SubDevice of that.
    pub fn tell_outside_time(&mut self, time: DcTime) {
        if let Some(started) = &mut self.started {
            started.io().tell_outside_time(time);
        }
    }

    /// Changes of findings since this was asked last: those that opened, were confirmed, or closed. Empty
    /// unless the run is [diagnosed](crate::RunOptions::diagnosed).
    pub fn findings(&self) -> impl Iterator<Item = Event> {
        self.notes.iter().flat_map(Receiver::try_iter).filter_map(|note| match note {
            Note::Finding(event) => Some(*event),
            Note::Scanned(_)
            | Note::Planned(_)
            | Note::Event(..)
            | Note::Host(_)
            | Note::Missed(..)
            | Note::Failed(_)
            | Note::AwaitsTime(..)
            | Note::Leaving(_) => None,
        })
    }

    /// Stops the line: outputs to zero, SubDevices to the state of [`RunOptions::leave_in`](
    /// crate::RunOptions::leave_in). The report has the whole diagnosis, if there is one.
    ///
    /// # Errors
    /// The reason that ended the run, or that it could not be stopped; or a handle of another plan.
    pub fn stop(mut self) -> Result<RunReport, Error> {
        self.end()
    }

    fn end(&mut self) -> Result<RunReport, Error> {
        let ended = self.started.take().ok_or(Error::Stopped)?.end()?;
        self.handoff.report(ended, self.plan)
    }
}

impl Drop for SteppedRun<'_> {
    fn drop(&mut self) {
        // Nobody is there to be told.
        let _ = self.end();
    }
}
