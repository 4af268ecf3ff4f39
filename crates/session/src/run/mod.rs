//! Run of a plan: scan, plan, start, application and diagnosis while it lasts, and its end.

mod ending;

use std::collections::VecDeque;
use std::sync::Arc;

use linesman_config::inventory::Inventory;
use linesman_config::plan::{IoAt, Plan, TimeSource};
use linesman_diagnosis::{FrameSeen, HostObservation};
use linesman_maindevice::{Event, MainDevice};
use linesman_proto::time::{Instant, Span};

use self::ending::Ending;
use crate::application::{Application, Io, Next, StartTime};
use crate::diagnosis::DiagnosisInput;
use crate::frame::FrameSummary;
use crate::probe;
use crate::session::SessionHooks;

/// Time that a scan of a line of usual length may take: one of a thousand SubDevices takes some
/// seconds.
pub const SCAN_PATIENCE: Span = Span::s(60);

/// Time for which a start waits for the time that its network is to begin in.
pub const TIME_PATIENCE: Span = Span::s(60);

/// Interval at which a network looks for those that lead it to have begun, and for a time to begin in.
const GROUP_POLL: Span = Span::ms(1);

/// Plan that is to be run.
pub enum PlanSource {
    /// A plan that is made already.
    Plan(Box<Plan>),
    /// One that is made of what a scan finds; or why it cannot be made.
    Found(MakePlan),
}

/// Makes a plan of what was found.
pub type MakePlan = Box<dyn FnOnce(&Inventory) -> Result<Plan, String> + Send>;

/// Something that happened in a run.
#[derive(Clone, Debug)]
pub enum RunEvent {
    /// Inventory that the scan found.
    Scanned(Box<Inventory>),
    /// The plan that is started.
    Planned(Arc<Plan>),
    /// The MainDevice tells something.
    MainDevice(Instant, Box<Event>),
    /// The host has noticed something.
    Host(HostObservation),
    /// The diagnosis tells something.
    Finding(Box<linesman_diagnosis::Event>),
    /// The start waits for the time of this source, until the second time at most.
    AwaitsTime(Instant, Instant, TimeSource),
    /// The line is being stopped.
    Leaving(Instant),
}

/// Why a line cannot be run.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum RunFailure {
    /// The line does not answer.
    #[error("{0}")]
    Scan(String),
    /// The line is not the one that is wanted.
    #[error("{0}")]
    Plan(String),
}

/// The [hooks](SessionHooks) of a session that runs a plan with an application, and has it judged.
pub struct PlanRun<A, D> {
    wanted: Option<PlanSource>,
    application: A,
    diagnosis: D,
    io_at: IoAt,
    plan: Option<Arc<Plan>>,
    begun: bool,
    /// It waits for networks that lead it, or for their time; then it is looked again.
    waits_until: Option<Instant>,
    /// A plan that waits for the time it is to begin in.
    awaiting: Option<Box<Plan>>,
    /// End of that wait.
    awaited_until: Option<Instant>,
    scan_until: Instant,
    reached_at: Option<Instant>,
    failure: Option<RunFailure>,
    /// The application has enough, or the MainDevice has stopped.
    ended: bool,
    ending: Option<Ending>,
    withheld: bool,
    /// SubDevices wait in PREOP for the first outputs.
    held: bool,
    /// After each call of the application the turn is the caller's; and it is.
    pauses: bool,
    paused: bool,
    /// The caller has given no outputs.
    old: bool,
    events: VecDeque<RunEvent>,
}

impl<A: Application, D: DiagnosisInput> PlanRun<A, D> {
    /// A run of what is wanted; of nothing, until [`start`](Self::start), if that is `None`. With `held` SubDevices stay
    /// in PREOP until the application gives outputs for the first time (SW-16).
    pub const fn new(wanted: Option<PlanSource>, application: A, diagnosis: D, held: bool) -> Self {
        Self {
            wanted,
            application,
            diagnosis,
            io_at: IoAt::TaskBegin,
            plan: None,
            begun: false,
            waits_until: None,
            awaiting: None,
            awaited_until: None,
            scan_until: Instant::MAX,
            reached_at: None,
            failure: None,
            ended: false,
            ending: None,
            withheld: false,
            held,
            pauses: false,
            paused: false,
            old: false,
            events: VecDeque::new(),
        }
    }

    /// The plan that runs.
    #[must_use]
    pub const fn plan(&self) -> Option<&Arc<Plan>> {
        self.plan.as_ref()
    }

    /// When all SubDevices were in their target states for the first time.
    #[must_use]
    pub const fn reached_at(&self) -> Option<Instant> {
        self.reached_at
    }

    /// Pauses behind each call of the application, so that the caller gives the outputs; the next turn goes on. Those
    /// of the pause before count as given anew unless they are `old`.
    pub const fn pause(&mut self, old: bool) {
        (self.pauses, self.old) = (true, old);
    }

    /// The process data of the cycle whose pause it is.
    pub fn io<'a>(&self, now: Instant, main: &'a mut MainDevice) -> Io<'a> {
        let missed = main.statistics().cycles_missed;
        Io { main, now, missed, withheld: self.withheld, old: false }
    }

    /// The interface of the line is gone: the application learns of it.
    pub fn interface_gone(&mut self, now: Instant, main: &mut MainDevice) {
        if self.plan.is_some() {
            let missed = main.statistics().cycles_missed;
            let mut io = Io { main, now, missed, withheld: self.withheld, old: false };
            self.application.interface_gone(&mut io);
        }
    }

    /// True while outputs are withheld because they were not given in time.
    #[must_use]
    pub const fn is_withheld(&self) -> bool {
        self.withheld
    }

    /// Why the line is not run.
    #[must_use]
    pub const fn failure(&self) -> Option<&RunFailure> {
        self.failure.as_ref()
    }

    /// The same, which is forgotten: the run goes on to its end.
    pub const fn take_failure(&mut self) -> Option<RunFailure> {
        self.failure.take()
    }

    /// The diagnosis.
    #[must_use]
    pub const fn diagnosis(&self) -> &D {
        &self.diagnosis
    }

    /// The diagnosis.
    pub const fn diagnosis_mut(&mut self) -> &mut D {
        &mut self.diagnosis
    }

    /// The diagnosis, at the end.
    #[must_use]
    pub fn into_diagnosis(self) -> D {
        self.diagnosis
    }

    /// The application.
    pub const fn application_mut(&mut self) -> &mut A {
        &mut self.application
    }

    /// Next event, oldest first; each is given once.
    pub fn poll_event(&mut self) -> Option<RunEvent> {
        self.events.pop_front()
    }

    /// Starts with a plan, as soon as the time is known that it is to begin in.
    pub fn start(&mut self, now: Instant, plan: Plan, main: &mut MainDevice) {
        self.scan_until = Instant::MAX;
        match self.start_time(now, &plan, main) {
            Ok(true) => self.start_now(now, plan, main),
            Ok(false) => self.await_time(now, plan, main),
            Err(why) => self.failure = Some(RunFailure::Plan(why)),
        }
    }

    /// True once the time is known that a plan is to begin in; the MainDevice has it then.
    fn start_time(
        &mut self,
        now: Instant,
        plan: &Plan,
        main: &mut MainDevice,
    ) -> Result<bool, String> {
        match plan.time_source {
            Some(TimeSource::UpperNetwork) if !main.is_in_group() => Err(
                "time_source is `upper-network`, but this run has no other network. Do: run both networks by one \
                 `linesman run` (--on of each), or write another time_source in [network]"
                    .to_owned(),
            ),
            Some(TimeSource::UpperNetwork) => {
                Ok(plan.reference_clock().is_none() || main.knows_group_time())
            }
            Some(TimeSource::Program) => match self.application.start_time(now) {
                StartTime::OfHost => Ok(true),
                StartTime::Awaited => Ok(false),
                StartTime::Told(time) => {
                    main.tell_outside_time(now, time);
                    Ok(true)
                }
            },
            None
            | Some(TimeSource::ReferenceClock | TimeSource::Host | TimeSource::Device(_)) => {
                Ok(true)
            }
        }
    }

    /// Keeps a plan until its time is known, for [`TIME_PATIENCE`] at most.
    fn await_time(&mut self, now: Instant, plan: Plan, main: &mut MainDevice) {
        let until = self.awaited_until.unwrap_or(now + TIME_PATIENCE);
        if self.awaited_until.replace(until).is_none() {
            // The one whose time it waits for may come behind it.
            main.give_up_turn();
            if let Some(source) = plan.time_source {
                self.events.push_back(RunEvent::AwaitsTime(now, until, source));
            }
        }
        if now < until {
            self.waits_until = Some(now + GROUP_POLL);
            self.awaiting = Some(Box::new(plan));
            return;
        }
        let (whose, look) = match plan.time_source {
            Some(TimeSource::UpperNetwork) => (
                "the upper network",
                "look whether the network that leads is up and has clocks (`clock = { reference = true }`)",
            ),
            _ => ("the program", "look why it does not know the time"),
        };
        self.failure = Some(RunFailure::Plan(format!(
            "{whose} has told no time for {} s, in which this network is to begin; it was not started. Do: {look}, or \
             write another time_source in [network]",
            TIME_PATIENCE.as_nanos() / 1_000_000_000
        )));
    }

    fn start_now(&mut self, now: Instant, plan: Plan, main: &mut MainDevice) {
        (self.awaiting, self.waits_until) = (None, None);
        if let Err(why) = self.application.begin(&plan) {
            self.failure = Some(RunFailure::Plan(why));
            return;
        }
        self.io_at = plan.tasks.first().map(|task| task.io_at).unwrap_or_default();
        let plan = Arc::new(plan);
        self.events.push_back(RunEvent::Planned(Arc::clone(&plan)));
        main.start(now, (*plan).clone());
        self.plan = Some(plan);
    }

    fn scanned(&mut self, now: Instant, inventory: Box<Inventory>, main: &mut MainDevice) {
        let wanted = self.wanted.take();
        let made = match wanted {
            Some(PlanSource::Found(make)) => Some(make(&inventory)),
            Some(PlanSource::Plan(_)) | None => None,
        };
        self.events.push_back(RunEvent::Scanned(inventory));
        match made {
            Some(Ok(plan)) => self.start(now, plan, main),
            Some(Err(why)) => self.failure = Some(RunFailure::Plan(why)),
            None => {}
        }
    }

    fn begin(&mut self, now: Instant, main: &mut MainDevice) {
        match self.wanted.take() {
            Some(PlanSource::Plan(plan)) => self.start(now, *plan, main),
            Some(found) => {
                self.wanted = Some(found);
                self.scan_until = now + SCAN_PATIENCE;
                main.scan(now);
            }
            None => {}
        }
    }

    /// Takes what the diagnosis has to say, and asks what it would like to know; it sees the frames.
    fn hear_diagnosis(&mut self, now: Instant, main: &mut MainDevice) {
        self.diagnosis.turn(now);
        let may_ask = self.plan.is_some() && self.ending.is_none();
        while let Some(wish) = self.diagnosis.poll_probe() {
            // What is not read now is asked for again.
            if may_ask {
                probe::ask(&wish, now, main);
            }
        }
        while let Some(event) = self.diagnosis.poll_event() {
            self.events.push_back(RunEvent::Finding(Box::new(event)));
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

impl<A: Application, D: DiagnosisInput> SessionHooks for PlanRun<A, D> {
    #[inline]
    fn frame(&mut self, frame: &FrameSeen<'_>) {
        self.diagnosis.frame(frame);
    }

    #[inline]
    fn room(&mut self, now: Instant) -> Option<&mut [u8]> {
        self.diagnosis.room(now)
    }

    #[inline]
    fn keep(&mut self, passed: &FrameSummary, len: usize) {
        self.diagnosis.keep(passed, len);
    }

    fn host(&mut self, observation: &HostObservation) {
        self.events.push_back(RunEvent::Host(*observation));
        self.diagnosis.host(observation);
    }

    #[allow(clippy::wildcard_enum_match_arm, reason = "all but a few are only passed on")]
    fn event(&mut self, now: Instant, event: Event, main: &mut MainDevice) {
        match event {
            Event::Scanned(inventory) => return self.scanned(now, inventory, main),
            Event::ScanFailed(ref error) => {
                self.failure = Some(RunFailure::Scan(error.to_string()));
            }
            Event::AllReached => {
                self.reached_at.get_or_insert(now);
            }
            Event::OutputsWithheld { .. } => self.withheld = true,
            Event::OutputsResumed { .. } => self.withheld = false,
            Event::Stopped => self.ended = true,
            _ => {}
        }
        self.events.push_back(RunEvent::MainDevice(now, Box::new(event)));
    }

    fn turn(&mut self, now: Instant, main: &mut MainDevice) -> bool {
        if !self.begun {
            self.waits_until = main.waits_for_group().then(|| now + GROUP_POLL);
            if self.waits_until.is_none() {
                self.begun = true;
                self.begin(now, main);
            }
        } else if let Some(plan) = self.awaiting.take() {
            self.start(now, *plan, main);
        }
        if self.plan.is_none() && now > self.scan_until && self.failure.is_none() {
            let words =
                "the scan was not done after 60 s. Do: look at the line with `linesman scan`";
            self.failure = Some(RunFailure::Scan(words.to_owned()));
        }
        self.hear_diagnosis(now, main);
        if self.ending.is_some() {
            self.go_on_ending(now, main);
        } else if self.plan.is_some() {
            self.call(now, main);
        }
        self.failure.is_none() && !self.ended
    }

    fn is_paused(&self) -> bool {
        self.paused
    }

    fn poll_timeout(&self) -> Option<Instant> {
        let ending = self.ending.as_ref().map(Ending::due);
        [ending, self.waits_until, self.diagnosis.poll_timeout()].into_iter().flatten().min()
    }
}
