//! Interface of the application to a cycle.

use linesman_config::plan::Plan;
use linesman_maindevice::service::{Service, ServiceAnswer, ServiceFailure, ServiceTicket};
use linesman_maindevice::watch::{GroupStatus, NetworkStatus};
use linesman_maindevice::{FrameStatus, MainDevice, OutsideTime, Quality, Statistics, TaskTimes};
use linesman_proto::address::DeviceId;
use linesman_proto::state::{DeviceState, NetworkState};
use linesman_proto::time::{DcTime, Instant};

use crate::image::{Input, Output, Value};

/// Whether the application goes on.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Next {
    /// With the next cycle.
    Continue,
    /// The line is stopped: outputs to zero, states back.
    Stop,
}

/// Time of a network when it starts, where its plan says that a program tells it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum StartTime {
    /// That of this computer: the network begins in a time of its own.
    OfHost,
    /// Not known yet: the start waits.
    Awaited,
    /// The time outside at this moment (ns since 2000): the network begins in it.
    Told(DcTime),
}

/// A program that is called once a cycle. It must not wait for anything: while it runs, no frame is
/// sent.
pub trait Application {
    /// The time that the network starts in, where its plan has it follow a time that a program tells
    /// ([`TimeSource::Program`](linesman_config::plan::TimeSource)). Asked before [`begin`](Self::begin), again and again
    /// while it is awaited, for [`TIME_PATIENCE`](crate::TIME_PATIENCE) at most.
    fn start_time(&mut self, _now: Instant) -> StartTime {
        StartTime::OfHost
    }

    /// The line is about to be started with this plan.
    ///
    /// # Errors
    /// Why it cannot be started.
    fn begin(&mut self, _plan: &Plan) -> Result<(), String> {
        Ok(())
    }

    /// One cycle. Where the task exchanges at its begin ([`IoAt::TaskBegin`](linesman_config::plan::IoAt)),
    /// it is called when the frames are back: inputs are fresh, outputs leave at the next begin, whenever
    /// this returns. Where it exchanges at its end, it is called when the cycle begins: inputs are those of
    /// the cycle before, outputs leave as soon as this returns (SYN-13).
    fn cycle(&mut self, io: &mut Io<'_>) -> Next;

    /// A second program of a task that exchanges at its end: called when the outputs of
    /// [`cycle`](Self::cycle) have gone out and the inputs are back, for what must not delay them (SYN-14).
    /// Outputs that it sets leave with the next cycle, unless that sets them anew. Of a task that exchanges
    /// at its begin it is never called: there `cycle` itself runs after the outputs went out.
    fn after_outputs(&mut self, _io: &mut Io<'_>) {}

    /// A service that [`Io::serve`] has begun is done.
    fn served(&mut self, _ticket: ServiceTicket, _result: &Result<ServiceAnswer, ServiceFailure>) {}

    /// The interface of the line, or its driver, is gone: the run ends. Nothing that is set goes out any more.
    fn interface_gone(&mut self, _io: &mut Io<'_>) {}

    /// Whether it gives outputs at all. One that does not is not watched for being late.
    fn is_idle(&self) -> bool {
        false
    }
}

/// Nobody: outputs stay zero.
#[derive(Clone, Copy, Debug, Default)]
pub struct Idle;

impl Application for Idle {
    fn cycle(&mut self, _: &mut Io<'_>) -> Next {
        Next::Continue
    }

    fn is_idle(&self) -> bool {
        true
    }
}

impl<F: FnMut(&mut Io<'_>) -> Next> Application for F {
    fn cycle(&mut self, io: &mut Io<'_>) -> Next {
        self(io)
    }
}

/// Of a SubDevice that nobody has looked for: INIT, and not there.
const UNKNOWN: DeviceState = DeviceState(DeviceState::NOT_PRESENT | 1);

/// The process data of a cycle.
pub struct Io<'a> {
    pub(crate) main: &'a mut MainDevice,
    pub(crate) now: Instant,
    pub(crate) missed: u64,
    pub(crate) withheld: bool,
    pub(crate) old: bool,
}

impl Io<'_> {
    /// The same cycle for a shorter time. That outputs are old has to be said to the first one.
    pub const fn reborrow(&mut self) -> Io<'_> {
        let Self { now, missed, withheld, .. } = *self;
        Io { main: &mut *self.main, now, missed, withheld, old: false }
    }

    /// Begins a service for one SubDevice beside the cycle; [`Application::served`] has its end.
    pub fn serve(&mut self, id: DeviceId, service: Service) -> ServiceTicket {
        self.main.serve(self.now, id, service)
    }

    /// The value of an input.
    #[must_use]
    pub fn get<T: Value>(&self, input: Input<T>) -> T {
        input.get(self.main.inputs())
    }

    /// Sets an output.
    pub fn set<T: Value>(&mut self, output: Output<T>, value: T) {
        output.set(self.main.image_mut(), value);
    }

    /// All inputs as bytes, laid out as the plan says.
    #[must_use]
    pub fn inputs(&self) -> &[u8] {
        self.main.inputs()
    }

    /// All outputs as bytes, laid out as the plan says.
    pub fn outputs_mut(&mut self) -> &mut [u8] {
        self.main.image_mut()
    }

    /// Says that nobody has given outputs in this cycle. Otherwise an application that returns in time
    /// counts as having given them, changed or not.
    pub fn outputs_are_old(&mut self) {
        self.old = true;
    }

    /// Whether outputs are withheld because they were not given in time.
    #[must_use]
    pub const fn is_withheld(&self) -> bool {
        self.withheld
    }

    /// How good the process data of a SubDevice are, and how old.
    #[must_use]
    pub fn quality(&self, id: DeviceId) -> Quality {
        self.main.quality(id)
    }

    /// Whether a working counter that a SubDevice has a share in was wrong the last time: set for all that
    /// share the datagram, whoever is to blame (PLC-03). [`Io::state`] tells who that is.
    #[must_use]
    pub fn wc_state(&self, id: DeviceId) -> bool {
        !self.main.quality(id).valid
    }

    /// The state word of a SubDevice: its software in the low byte, its wiring in the high byte
    /// (PLC-04 to PLC-06). 8 is OP and nothing wrong.
    #[must_use]
    pub fn state(&self, id: DeviceId) -> DeviceState {
        let known = self.main.network_status().and_then(|status| status.device(id));
        known.map_or(UNKNOWN, |device| device.state())
    }

    /// The state word of the network (PLC-07); 0 when all is well.
    #[must_use]
    pub fn network_state(&self) -> NetworkState {
        self.main.network_status().map_or_else(NetworkState::default, NetworkStatus::network_state)
    }

    /// Resets the network: outputs that are locked after a link error (`lock_after_link_error` of a project) are sent again.
    pub fn reset(&mut self) {
        self.main.reset();
    }

    /// How many SubDevices are there, of those that are planned (PLC-08).
    #[must_use]
    pub fn present(&self) -> usize {
        self.main.network_status().map_or(0, NetworkStatus::present)
    }

    /// Whether a hot connect group of this name is plugged in, and all of it have reached their states; `None` if the plan
    /// has none of that name.
    #[must_use]
    pub fn has_joined(&self, group: &str) -> Option<bool> {
        let groups = self.main.network_status()?.groups();
        groups.iter().find(|one| one.name() == group).map(GroupStatus::has_joined)
    }

    /// How many SubDevices of hot connect groups are planned, and how many of them are there (HC-15).
    #[must_use]
    pub fn hot_connect_counts(&self) -> (usize, usize) {
        self.main.network_status().map_or((0, 0), NetworkStatus::hot_connect_counts)
    }

    /// How many SubDevices had processed what each card of a ring received of the last broadcast read, card A first
    /// (RED-15): `[0, all]` while the ring is whole, each card's half while it is open. `None` without a ring, and
    /// before the first cycle.
    #[must_use]
    pub fn responding_by_card(&self) -> Option<[u16; 2]> {
        self.main.responding_by_card().map(|both| both.map(|count| count.0))
    }

    /// How a frame of a task went the last time.
    #[must_use]
    pub fn frame_status(&self, task: usize, frame: usize) -> Option<FrameStatus> {
        self.main.frame_status(task, frame)
    }

    /// Whether every SubDevice is in its target state.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        self.main.is_settled()
    }

    /// The time of the run.
    #[must_use]
    pub const fn now(&self) -> Instant {
        self.now
    }

    /// Task start, last base tick and now, by the time of the network (DC-08). The task is that of the application,
    /// the first of the plan.
    #[must_use]
    pub fn times(&self) -> TaskTimes {
        self.main.task_times(0, self.now)
    }

    /// How far a clock outside is ahead that the network follows (DC-11); `None` where it follows none, or nothing is
    /// known of it yet.
    #[must_use]
    pub fn outside_time(&self) -> Option<OutsideTime> {
        self.main.outside_time()
    }

    /// Tells a time outside that is `time` now, where the plan has the network follow one that a program tells.
    pub fn tell_outside_time(&mut self, time: DcTime) {
        self.main.tell_outside_time(self.now, time);
    }

    /// Cycles that were left out so far because the host was late.
    #[must_use]
    pub const fn missed(&self) -> u64 {
        self.missed
    }

    /// What has been sent and received so far.
    #[must_use]
    pub fn statistics(&self) -> Statistics {
        self.main.statistics()
    }

    /// The plan that runs.
    #[must_use]
    pub fn plan(&self) -> Option<&Plan> {
        self.main.plan()
    }
}
