//! Shift of SYNC0 within the cycle.
//!
//! A cycle begins when its first frame is at the reference clock (SYN-09). A SubDevice that works with
//! SYNC0 needs its outputs before it, in every cycle: the signal comes some time after the frames, so that
//! their jitter, their own length and the delay of the line do no harm (SYN-05, SYN-06). One that has inputs
//! only needs them taken before the next frames: the other shift (SYN-07). Each is the same for all that refer to
//! it; what a SubDevice wants of its own comes on top (SYN-10).

use linesman_proto::time::Span;

use super::{DevicePlan, FramePlan, Plan, Role, Task};

/// Share of the cycle that the outputs are shifted by unless said otherwise (SYN-11).
const USUAL_PERCENT: u64 = 30;
/// Share of the cycle by which SYNC0 of SubDevices with inputs only comes before the frames, unless said
/// otherwise: 200 µs of 2 ms (SYN-11).
const USUAL_INPUTS_PERCENT: u64 = 10;
/// Share of the cycle that is left for jitter where the line itself takes more than the usual shift.
pub(super) const JITTER_PERCENT: u64 = 10;
/// At most this share of the cycle.
const MOST_PERCENT: u64 = 90;

/// The shift of the network that SYNC0 of a SubDevice refers to.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum ShiftReference {
    /// That of the outputs: SYNC0 comes after the frames.
    Outputs,
    /// That of the inputs: SYNC0 comes before the next frames.
    Inputs,
}

impl Plan {
    /// The shift of the outputs in a task: from its frames at the reference clock to SYNC0.
    #[must_use]
    pub fn outputs_shift(&self, task: &Task) -> Span {
        self.outputs_shift.unwrap_or_else(|| {
            let share = |percent| task.cycle.as_nanos() * percent / 100;
            let needed = self.least_outputs_shift(task).as_nanos() + share(JITTER_PERCENT);
            Span::ns(share(USUAL_PERCENT).max(needed.min(share(MOST_PERCENT))))
        })
    }

    /// What the outputs of a task need at least to be everywhere, without cables and jitter (SYN-17): the
    /// delay of the line and the length of the frames.
    #[must_use]
    pub fn least_outputs_shift(&self, task: &Task) -> Span {
        let frames: u64 = task.frames.iter().map(|frame| frame.wire_time().as_nanos()).sum();
        Span::ns(self.least_delay().as_nanos() + frames)
    }

    /// The shift of the inputs in a task, in ns: from its frames at the reference clock to SYNC0 of SubDevices
    /// that have inputs only. Negative: before the next frames (SYN-07).
    #[must_use]
    pub fn inputs_shift_ns(&self, task: &Task) -> i64 {
        self.inputs_shift_ns.unwrap_or_else(|| {
            -signed(Span::ns(task.cycle.as_nanos() * USUAL_INPUTS_PERCENT / 100))
        })
    }

    /// The shift that SYNC0 of a SubDevice refers to: exactly one of the two. Its description or the user says
    /// which; where nobody does, its process data (SYN-07, SYN-08).
    #[must_use]
    pub fn shift_reference(&self, device: &DevicePlan) -> ShiftReference {
        let has_only_inputs = device.outputs.is_empty() && !device.inputs.is_empty();
        let said = device.settings.clock.and_then(|clock| clock.input_reference);
        match said.unwrap_or(has_only_inputs) {
            true => ShiftReference::Inputs,
            false => ShiftReference::Outputs,
        }
    }

    /// Where SYNC0 of a SubDevice falls, in ns after the begin of its task's cycle: the shift of the network
    /// and its own. Where it comes several times a cycle, the first may come sooner.
    #[must_use]
    pub fn sync0_shift_ns(&self, device: &DevicePlan) -> i64 {
        let Some(clock) = device.settings.clock else { return 0 };
        let Some(task) = self.clocked_task(device) else { return clock.sync0_shift_ns };
        self.network_shift_ns(device, task).saturating_add(clock.sync0_shift_ns)
    }

    /// The same as the SubDevice is shown it: against the shift of the outputs, so that the two together are
    /// [`Plan::sync0_shift_ns`] (SYN-10).
    #[must_use]
    pub fn sync0_after_outputs_shift_ns(&self, device: &DevicePlan) -> i64 {
        let task = self.clocked_task(device).filter(|_| device.settings.clock.is_some());
        let outputs = task.map_or(0, |task| match self.comes_often(device, task) {
            Some(sync0) => percent_of(sync0, USUAL_PERCENT),
            None => signed(self.outputs_shift(task)),
        });
        self.sync0_shift_ns(device).saturating_sub(outputs)
    }

    /// Where SYNC0 of a SubDevice starts, in ns after a multiple of the cycle by the reference clock. There is
    /// the frame that brings its time; where inputs are fetched earlier, the cycle begins behind that
    /// (SYN-09, SYN-15).
    #[must_use]
    pub fn sync0_start_ns(&self, device: &DevicePlan) -> i64 {
        let begins = self.clocked_task(device).map_or(0, |task| self.cycle_begin_ns(task));
        self.sync0_shift_ns(device).saturating_add(begins)
    }

    /// When the cycle of a task begins, in ns after the frame that brings the time of the reference clock is
    /// there: its frames leave then, those that fetch inputs earlier left out.
    #[must_use]
    pub fn cycle_begin_ns(&self, task: &Task) -> i64 {
        let last = task.frames.iter().map(|frame| frame.ahead).min().unwrap_or_default();
        let begins = signed(first_ahead(task).saturating_sub(last));
        let time = self.tasks.iter().find_map(|task| {
            let brings = |frame: &&FramePlan| frame.has(Role::ReferenceClock);
            let frame = task.frames.iter().find(brings)?;
            Some(first_ahead(task).saturating_sub(frame.ahead))
        });
        begins.saturating_sub(signed(time.unwrap_or_default()))
    }

    /// The task whose cycle a SubDevice's SYNC0 follows: that of its process data, else the first.
    pub(super) fn clocked_task(&self, device: &DevicePlan) -> Option<&Task> {
        self.task_of(device.id).or(self.tasks.first())
    }

    /// The shift of the network that SYNC0 of a SubDevice refers to, in ns.
    pub(super) fn network_shift_ns(&self, device: &DevicePlan, task: &Task) -> i64 {
        // A shift by whole cycles of SYNC0 would put it upon the frames again.
        match (self.shift_reference(device), self.comes_often(device, task)) {
            (ShiftReference::Outputs, None) => signed(self.outputs_shift(task)),
            (ShiftReference::Outputs, Some(sync0)) => percent_of(sync0, USUAL_PERCENT),
            (ShiftReference::Inputs, None) => self.inputs_shift_ns(task),
            (ShiftReference::Inputs, Some(sync0)) => -percent_of(sync0, USUAL_INPUTS_PERCENT),
        }
    }

    /// The cycle of SYNC0 where it comes several times in a cycle of the task.
    pub(super) fn comes_often(&self, device: &DevicePlan, task: &Task) -> Option<Span> {
        let sync0 = device.settings.clock?.sync0_cycle;
        (sync0 > Span::ZERO && sync0 < task.cycle).then_some(sync0)
    }
}

/// How much earlier than its last frame the first of a task leaves.
fn first_ahead(task: &Task) -> Span {
    task.frames.iter().map(|frame| frame.ahead).max().unwrap_or_default()
}

fn percent_of(span: Span, percent: u64) -> i64 {
    signed(Span::ns(span.as_nanos() * percent / 100))
}

/// A span as a difference of times, in ns.
pub(super) fn signed(span: Span) -> i64 {
    i64::try_from(span.as_nanos()).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use linesman_proto::address::DeviceId;
    use linesman_proto::command::Command;
    use linesman_proto::frame::builder::DatagramAddress;
    use linesman_proto::register::SYSTEM_TIME;
    use linesman_proto::topology::Tree;

    use super::*;
    use crate::plan::{ClockSettings, DatagramPlan, IoAt, SyncUnit};

    fn plan(cycle: Span, clock: ClockSettings, devices: u32) -> Plan {
        let mut all: Vec<_> = (0..devices).map(|id| DevicePlan::bare(DeviceId(id))).collect();
        all[0].settings.clock = Some(clock);
        let unit = SyncUnit { name: "unit".to_owned(), devices: vec![DeviceId(0)] };
        let task = Task {
            name: "task".to_owned(),
            cycle,
            io_at: IoAt::TaskBegin,
            sync_units: vec![unit],
            frames: Vec::new(),
        };
        let tree = Tree::from_wiring(&[], None).expect("an empty line");
        Plan { devices: all, tasks: vec![task], ..Plan::empty(tree) }
    }

    // proves: SYN-11 partial: outputs
    #[test]
    fn outputs_are_shifted_by_30_percent_of_the_cycle_and_what_a_subdevice_wants_comes_on_top() {
        let of = |cycle, sync0, own| {
            let clock =
                ClockSettings { sync0_cycle: sync0, sync0_shift_ns: own, ..Default::default() };
            let plan = plan(cycle, clock, 3);
            plan.sync0_shift_ns(&plan.devices[0])
        };
        assert_eq!(of(Span::ms(2), Span::ms(2), 0), 600_000);
        assert_eq!(of(Span::ms(2), Span::ms(2), 13_700), 613_700);
        assert_eq!(of(Span::ms(1), Span::ms(1), -20_000), 280_000);
        assert_eq!(of(Span::ms(1), Span::ms(4), 0), 300_000, "every fourth cycle");
        assert_eq!(of(Span::ms(1), Span::us(100), 0), 30_000, "ten times a cycle");
    }

    #[test]
    fn a_line_that_takes_longer_gets_a_longer_shift_and_a_chosen_one_counts() {
        let clock = ClockSettings { sync0_cycle: Span::ms(1), ..ClockSettings::default() };
        let mut plan = plan(Span::ms(1), clock, 400);
        assert_eq!(plan.outputs_shift(&plan.tasks[0]), Span::us(500), "400 µs and a tenth");
        plan.tasks[0].cycle = Span::us(250);
        assert_eq!(plan.outputs_shift(&plan.tasks[0]), Span::us(225), "never a whole cycle");
        plan.outputs_shift = Some(Span::us(70));
        assert_eq!(plan.outputs_shift(&plan.tasks[0]), Span::us(70));
    }

    // S0 L240-274: 613.7 µs for outputs, -200 µs for inputs, nothing of the user's.
    // proves: SYN-11, SYN-07, SYN-08, SYN-10
    #[test]
    fn subdevice_with_inputs_only_uses_the_inputs_shift_unless_its_description_says_otherwise() {
        let of = |outputs: usize, inputs: usize, said, own| {
            let clock = ClockSettings {
                sync0_cycle: Span::ms(2),
                sync0_shift_ns: own,
                input_reference: said,
                ..Default::default()
            };
            let mut plan = plan(Span::ms(2), clock, 1);
            plan.outputs_shift = Some(Span::ns(613_700));
            (plan.devices[0].outputs, plan.devices[0].inputs) = (0..outputs, 0..inputs);
            let device = &plan.devices[0];
            let shown = plan.sync0_after_outputs_shift_ns(device);
            let absolute = plan.sync0_shift_ns(device);
            assert_eq!(shown + 613_700, absolute, "both views agree");
            (plan.shift_reference(device), absolute, shown)
        };
        use ShiftReference::{Inputs, Outputs};
        assert_eq!(of(2, 2, None, 0), (Outputs, 613_700, 0));
        assert_eq!(of(2, 0, None, 0), (Outputs, 613_700, 0));
        assert_eq!(of(0, 2, None, 0), (Inputs, -200_000, -813_700));
        assert_eq!(of(2, 2, Some(true), 0), (Inputs, -200_000, -813_700), "as it is described");
        assert_eq!(of(0, 2, Some(false), 0), (Outputs, 613_700, 0), "as it is described");
        assert_eq!(of(0, 2, None, 5_000), (Inputs, -195_000, -808_700), "the user's part on top");
        assert_eq!(of(2, 2, None, -5_000), (Outputs, 608_700, -5_000));
    }

    // proves: SYN-11 partial: the shift of the inputs
    #[test]
    fn inputs_shift_is_a_tenth_of_the_cycle_before_the_frames_unless_set() {
        let clock = ClockSettings { sync0_cycle: Span::ms(2), ..ClockSettings::default() };
        let mut plan = plan(Span::ms(2), clock, 1);
        plan.devices[0].inputs = 0..2;
        assert_eq!(plan.sync0_shift_ns(&plan.devices[0]), -200_000);
        plan.inputs_shift_ns = Some(-350_000);
        assert_eq!(plan.sync0_shift_ns(&plan.devices[0]), -350_000);
        plan.devices[0].settings.clock =
            Some(ClockSettings { sync0_cycle: Span::us(500), ..clock });
        assert_eq!(plan.sync0_shift_ns(&plan.devices[0]), -50_000, "of each of the four");
        assert_eq!(plan.sync0_after_outputs_shift_ns(&plan.devices[0]), -200_000);
    }

    #[test]
    fn sync0_starts_behind_the_frame_with_outputs_where_inputs_are_fetched_earlier() {
        let clock = ClockSettings { sync0_cycle: Span::ms(2), ..ClockSettings::default() };
        let mut plan = plan(Span::ms(2), clock, 1);
        let time = DatagramPlan {
            command: Command::Armw,
            address: DatagramAddress::Physical(0, SYSTEM_TIME.address),
            len: 4,
            role: Role::ReferenceClock,
            sync_unit: None,
            ownership: Vec::new(),
        };
        let inputs = FramePlan { ahead: Span::us(300), ..FramePlan::new(vec![time]) };
        plan.tasks[0].frames = vec![inputs, FramePlan::new(Vec::new())];
        assert_eq!(plan.cycle_begin_ns(&plan.tasks[0]), 300_000);
        assert_eq!(plan.sync0_shift_ns(&plan.devices[0]), 600_000);
        assert_eq!(plan.sync0_start_ns(&plan.devices[0]), 900_000);
    }
}
