//! Interface of an application to the cycle.

use linesman_maindevice::{FrameStatus, OutsideTime, Quality, Statistics, TaskTimes};
use linesman_proto::state::{DeviceState, NetworkState};
use linesman_proto::time::{DcTime, Instant};
use linesman_runtime::run as running;
pub use linesman_runtime::run::{Next, StartTime};
use linesman_session::image::Value;

use crate::application::Handoff;
use crate::handle::{DeviceHandle, Input, Output, PlanId};
use crate::record::{InputRecord, InputsOf, OutputRecord, OutputsOf};

/// A program that is called once a cycle. It must not wait for anything: while it runs, no frame is
/// sent.
pub trait Application {
    /// The time that the network starts in, where its project has `time_source = "program"`; `now` is the time of the run.
    /// Asked before the first cycle, again and again while it is [awaited](StartTime::Awaited), for 60 s at most. With the
    /// time of an upper network, told here and in each cycle by [`Io::tell_outside_time`], the network is a clocked
    /// SubDevice of that: it has its time and its phase.
    fn start_time(&mut self, _now: Instant) -> StartTime {
        StartTime::OfHost
    }

    /// One cycle. Where the task exchanges at its begin, it is called when the frames are back: inputs are
    /// fresh, outputs leave at the next begin, whenever this returns. Where it exchanges at its end
    /// ([`RunOptions::exchange_at_end`](crate::RunOptions::exchange_at_end)), it is called when the cycle begins:
    /// inputs are those of the cycle before, outputs leave as soon as this returns (SYN-13).
    fn cycle(&mut self, io: &mut Io<'_>) -> Next;

    /// A second program of a task that exchanges at its end: called when the outputs of
    /// [`cycle`](Self::cycle) have gone out and the inputs are back, for what must not delay them (SYN-14).
    /// Outputs that it sets leave with the next cycle, unless that sets them anew. Of a task that exchanges
    /// at its begin it is never called: there `cycle` itself runs after the outputs went out.
    fn after_outputs(&mut self, _io: &mut Io<'_>) {}

    /// The interface of the line, or its driver, is gone: the run ends with an error. Nothing that is set goes out any more.
    fn interface_gone(&mut self, _io: &mut Io<'_>) {}
}

impl<F: FnMut(&mut Io<'_>) -> Next> Application for F {
    fn cycle(&mut self, io: &mut Io<'_>) -> Next {
        self(io)
    }
}

/// The process data of a cycle, and how the line is.
pub struct Io<'a> {
    inner: running::Io<'a>,
    plan: PlanId,
    handoff: &'a Handoff,
}

impl<'a> Io<'a> {
    pub(crate) const fn new(inner: running::Io<'a>, plan: PlanId, handoff: &'a Handoff) -> Self {
        Self { inner, plan, handoff }
    }

    /// True for a handle of the plan that runs. The first of another plan is noted, and ends the run.
    #[inline]
    fn admits(&self, plan: PlanId) -> bool {
        if plan == self.plan {
            return true;
        }
        self.handoff.foreign.set(self.handoff.foreign.get().or(Some(plan)));
        false
    }

    /// The value of an input.
    #[must_use]
    pub fn get<T: Value>(&self, input: Input<T>) -> T {
        let inputs = if self.admits(input.plan) { self.inner.inputs() } else { &[] };
        input.variable.get(inputs)
    }

    /// Sets an output.
    pub fn set<T: Value>(&mut self, output: Output<T>, value: T) {
        if self.admits(output.plan) {
            self.inner.set(output.variable, value);
        }
    }

    /// The value that an output has been set to.
    #[must_use]
    pub fn get_output<T: Value>(&mut self, output: Output<T>) -> T {
        match self.admits(output.plan) {
            true => output.variable.get(self.inner.outputs_mut()),
            false => output.variable.get(&[]),
        }
    }

    /// The inputs of a SubDevice that a record names.
    #[must_use]
    pub fn read<R: InputRecord>(&self, inputs: InputsOf<R>) -> R {
        R::read(self, inputs.handles)
    }

    /// Sets the outputs of a SubDevice that a record names.
    pub fn write<R: OutputRecord>(&mut self, outputs: OutputsOf<R>, record: R) {
        record.write(self, outputs.handles);
    }

    /// All inputs as bytes, laid out as the plan says.
    #[must_use]
    pub fn inputs(&self) -> &[u8] {
        self.inner.inputs()
    }

    /// All outputs as bytes, laid out as the plan says.
    pub fn outputs_mut(&mut self) -> &mut [u8] {
        self.inner.outputs_mut()
    }

    /// Says that nobody has given outputs in this cycle. Otherwise an application that returns in time
    /// counts as having given them, changed or not.
    pub fn outputs_are_old(&mut self) {
        self.handoff.old.set(true);
    }

    /// True while outputs are withheld because they were not given in time.
    #[must_use]
    pub const fn is_withheld(&self) -> bool {
        self.inner.is_withheld()
    }

    /// Validity and age of the process data of a SubDevice.
    #[must_use]
    pub fn quality(&self, device: DeviceHandle) -> Quality {
        match self.admits(device.plan) {
            true => self.inner.quality(device.id),
            false => Quality::default(),
        }
    }

    /// True when a working counter that a SubDevice has a share in was wrong the last time: for all that
    /// share the datagram, whoever is to blame (PLC-03). [`Io::state`] tells who that is.
    #[must_use]
    pub fn wc_state(&self, device: DeviceHandle) -> bool {
        !self.quality(device).valid
    }

    /// The state word of a SubDevice: its software in the low byte, its wiring in the high byte
    /// (PLC-04 to PLC-06). [`DeviceState::OP`] is OP and nothing wrong.
    #[must_use]
    pub fn state(&self, device: DeviceHandle) -> DeviceState {
        match self.admits(device.plan) {
            true => self.inner.state(device.id),
            false => DeviceState::default(),
        }
    }

    /// Resets the network: outputs that are locked after a link error (`lock_after_link_error` of a project) are sent again.
    pub fn reset(&mut self) {
        self.inner.reset();
    }

    /// The state word of the network (PLC-07); 0 when all is well.
    #[must_use]
    pub fn network_state(&self) -> NetworkState {
        self.inner.network_state()
    }

    /// Number of SubDevices that are there, of those that are planned (PLC-08).
    #[must_use]
    pub fn present(&self) -> usize {
        self.inner.present()
    }

    /// True if a hot connect group of this name is plugged in, and all of it have reached their states; `None` if the plan
    /// has none of that name.
    #[must_use]
    pub fn has_joined(&self, group: &str) -> Option<bool> {
        self.inner.has_joined(group)
    }

    /// Numbers of SubDevices of hot connect groups: planned, and there (HC-15).
    #[must_use]
    pub fn hot_connect_counts(&self) -> (usize, usize) {
        self.inner.hot_connect_counts()
    }

    /// Numbers of SubDevices that had processed what each card of a ring received of the last broadcast read, card A
    /// first (RED-15): `[0, all]` while the ring is whole, each card's half while it is open. `None` without a ring,
    /// and before the first cycle.
    #[must_use]
    pub fn responding_by_card(&self) -> Option<[u16; 2]> {
        self.inner.responding_by_card()
    }

    /// Result of a frame of a task, the last time.
    #[must_use]
    pub fn frame_status(&self, task: usize, frame: usize) -> Option<FrameStatus> {
        self.inner.frame_status(task, frame)
    }

    /// True when every SubDevice is in its target state.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        self.inner.is_settled()
    }

    /// The time of the run, of the line's own clock: virtual in a virtual segment.
    #[must_use]
    pub const fn now(&self) -> Instant {
        self.inner.now()
    }

    /// Task start, last base tick and now, by the time of the network: ns since 2000, as the reference clock counts
    /// them (DC-08). A frame that leaves at one of these times is at the reference clock when that shows it. Before the
    /// clocks are set, and on a line without clocks, it is this computer's time.
    #[must_use]
    pub fn times(&self) -> TaskTimes {
        self.inner.times()
    }

    /// How far the clock outside is ahead that the network follows, in ns: another network behind a bridge, IEEE 1588, or
    /// one that a program tells (DC-11). Only its speed is taken over; to have the time outside, add
    /// [`OutsideTime::ahead_ns`] to one of [`Io::times`]. `None` where the network follows none, or nothing is known yet.
    #[must_use]
    pub fn outside_time(&self) -> Option<OutsideTime> {
        self.inner.outside_time()
    }

    /// Tells a time outside that is `time` when the application is called, in ns since 2000, where the project says
    /// `time_source = "program"`. To be told about once a cycle; jitter is averaged.
    pub fn tell_outside_time(&mut self, time: DcTime) {
        self.inner.tell_outside_time(time);
    }

    /// Cycles that were left out so far because the host was late.
    #[must_use]
    pub const fn missed(&self) -> u64 {
        self.inner.missed()
    }

    /// Counts of what has been sent and received so far.
    #[must_use]
    pub fn statistics(&self) -> Statistics {
        self.inner.statistics()
    }

    /// The SubDevices of the plan that runs, in the order in which frames pass.
    pub fn devices(&self) -> impl Iterator<Item = DeviceHandle> {
        let planned = self.inner.plan().into_iter().flat_map(|plan| &plan.devices);
        planned.map(|device| DeviceHandle { id: device.id, plan: self.plan })
    }

    /// The plan that runs, as the crates below this one see it.
    #[must_use]
    pub fn plan(&self) -> Option<&linesman_config::plan::Plan> {
        self.inner.plan()
    }
}
