//! Shift of SYNC0 within the cycle.
//!
//! A cycle begins when its first frame is at the reference clock (SYN-09). A SubDevice that works with
//! SYNC0 needs its outputs before it, in every cycle: the signal comes some time after the frames, so that
//! their jitter, their own length and the delay of the line do no harm (SYN-05, SYN-06). This shift is the
//! same for all; what a SubDevice wants of its own comes on top (SYN-10).

use linesman_proto::time::Span;

use super::{DevicePlan, Plan, Task};

/// Share of the cycle that the outputs are shifted by unless said otherwise (SYN-11).
const USUAL_PERCENT: u64 = 30;
/// Share of the cycle that is left for jitter where the line itself takes more than the usual shift.
const JITTER_PERCENT: u64 = 10;
/// At most this share of the cycle.
const MOST_PERCENT: u64 = 90;

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

    /// Where SYNC0 of a SubDevice falls, in ns after the begin of its task's cycle: the shift of all and
    /// its own. Where it comes several times a cycle, the first may come sooner.
    #[must_use]
    pub fn sync0_shift_ns(&self, device: &DevicePlan) -> i64 {
        let Some(clock) = device.settings.clock else { return 0 };
        let task = self.task_of(device.id).or(self.tasks.first());
        let Some(task) = task else { return clock.sync0_shift_ns };
        let shift = self.outputs_shift(task).as_nanos();
        let sync0 = clock.sync0_cycle.as_nanos();
        let is_often = sync0 > 0 && sync0 < task.cycle.as_nanos();
        // A shift by whole cycles of SYNC0 would put it upon the frames again.
        let shift = if is_often { sync0 * USUAL_PERCENT / 100 } else { shift };
        i64::try_from(shift).unwrap_or(i64::MAX).saturating_add(clock.sync0_shift_ns)
    }
}

#[cfg(test)]
mod tests {
    use linesman_proto::address::DeviceId;
    use linesman_proto::topology::Tree;

    use super::*;
    use crate::plan::{ClockSettings, IoAt, SyncUnit};

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

    // proves: SYN-11, SYN-10 partial: the MainDevice's view, SYN-07 partial: outputs
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
}
