//! Timing of one SubDevice: its frames against its SYNC0, its work against its next frames.
//!
//! Two rules hold for each (S0 L651-663, SYN-27, SYN-28). By the first every SYNC0 comes after the frames, also
//! when they come at their latest; by the second the last access to process data is over before the first of the
//! next frames, also when it comes at its earliest. Of a SubDevice's own task the frames with its data count; of
//! other tasks with the same cycle those with data of SubDevices in step with SYNC0.

use linesman_proto::address::DeviceId;
use linesman_proto::sii::Direction;
use linesman_proto::time::Span;

use super::super::shift::signed;
use super::super::{DevicePlan, FramePlan, Plan, ShiftReference, Task};
use super::frame_time::FrameTime;

/// A frame at a SubDevice, in ns after its task's cycle begins at the reference clock.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct FrameArrival {
    /// Its number over all tasks, from 0.
    pub frame: usize,
    /// When it begins without jitter, as soon as it is due.
    pub due_ns: i64,
    /// When it begins at the earliest.
    pub earliest_ns: i64,
    /// When it has ended at the latest.
    pub latest_ns: i64,
    /// It has outputs or inputs of this SubDevice; else it is of another task.
    pub own: bool,
    /// It fetches inputs of this SubDevice.
    pub fetches: bool,
}

/// What the timing of a SubDevice is.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum TimingVerdict {
    /// It is in time, and that is proven under what is assumed.
    Pass,
    /// It is not in time.
    Fail,
    /// Something that is needed is not known.
    NotJudged,
}

/// A rule and what came of it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct RuleTiming {
    /// What came of it.
    pub verdict: TimingVerdict,
    /// What is left over, in ns; negative: what is missing. `None` where nothing was reckoned.
    pub margin_ns: Option<i64>,
    /// The frame that decides, by its number over all tasks.
    pub frame: Option<usize>,
    /// What is not known, where it was not judged; else empty.
    pub lacks: String,
}

impl RuleTiming {
    pub(super) fn not_judged(lacks: &str) -> Self {
        let verdict = TimingVerdict::NotJudged;
        Self { verdict, margin_ns: None, frame: None, lacks: lacks.to_owned() }
    }
}

/// The times of a SubDevice in a cycle, in ns after its task's cycle begins at the reference clock.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct CycleTimes {
    /// The cycle of its task.
    pub cycle: Span,
    /// The cycle of its SYNC0.
    pub sync0_cycle: Span,
    /// The time after which SYNC0 and frames meet in the same way again: the cycle, unless SYNC0 or the frame that
    /// brings the time have another.
    pub period: Span,
    /// The first SYNC0 from the begin of the cycle on.
    pub sync0_ns: i64,
    /// What has to lie between the frame and SYNC0 besides: calculating and copying (0x1C32:06), 0 where that is
    /// not known.
    pub before_sync0: Span,
    /// From SYNC0 to the end of reading the outputs; `None`: not known, or no outputs.
    pub outputs_read: Option<Span>,
    /// From SYNC0 to the input latch.
    pub input_latch: Span,
    /// From SYNC0 to the end of writing the inputs; `None`: not known, or no inputs.
    pub inputs_written: Option<Span>,
    /// From SYNC0 to the end of its work; `None`: not known.
    pub work: Option<Span>,
    /// How long that may take from the frame before SYNC0 on: up to the next frame that counts.
    pub(super) limit: Span,
    /// The frames that count, at the SubDevice.
    pub frames: Vec<FrameArrival>,
}

/// What SYNC0 at some time is judged by.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Margins {
    /// Of the first rule, and the frame that decides.
    pub(super) first: (i64, usize),
    /// Of the second rule; without known work, that up to SYNC0 itself.
    pub(super) second: (i64, usize),
}

impl CycleTimes {
    /// The times of a SubDevice; `Err` says what is not known.
    pub(super) fn of(
        plan: &Plan,
        device: &DevicePlan,
        frames: &[FrameTime],
        (earlier_ns, later_ns): (i64, i64),
    ) -> Result<Self, &'static str> {
        let clock = device.settings.clock.filter(|clock| clock.sync0());
        let clock = clock.ok_or("it has no SYNC0")?;
        let task = plan.task_of(device.id).ok_or("no task exchanges data of it")?;
        let (cycle, sync0) = (task.cycle.as_nanos(), clock.sync0_cycle.as_nanos());
        if sync0 == 0 || cycle == 0 {
            return Err("its SYNC0 comes once, not in every cycle");
        }
        let begins = plan.cycle_begin_ns(task);
        let counted = frames.iter().filter_map(|time| {
            let (own, fetches) = counts(plan, device.id, task, time)?;
            Some(FrameArrival {
                frame: time.number,
                due_ns: time.due_ns.saturating_sub(begins).saturating_add(earlier_ns),
                earliest_ns: time.earliest_ns.saturating_sub(begins).saturating_add(earlier_ns),
                latest_ns: time.latest_ns.saturating_sub(begins).saturating_add(later_ns),
                own,
                fetches,
            })
        });
        let counted: Vec<FrameArrival> = counted.collect();
        if !counted.iter().any(|frame| frame.own) {
            return Err("no cyclic frame carries data of it");
        }
        // The servo ties the frames to the cycle of the task that brings the time, others by way of that.
        let of_time = frames.iter().find(|time| brings_time(plan, time.number));
        let of_time = of_time.and_then(|time| plan.tasks.get(time.task)).unwrap_or(task);
        let tied = greatest_common(cycle, of_time.cycle.as_nanos());
        let period = greatest_common(sync0, tied);
        let is_slow = sync0.is_multiple_of(cycle) && tied == cycle;
        let times = device.sync_times;
        let has = |outputs: bool| match outputs {
            true => !device.outputs.is_empty(),
            false => !device.inputs.is_empty(),
        };
        let outputs_read = times.outputs.work().filter(|_| has(true));
        let input_latch = times.inputs.shift();
        let inputs_written =
            times.inputs.work().map(|work| work + input_latch).filter(|_| has(false));
        let is_known =
            (outputs_read.is_some() || !has(true)) && (inputs_written.is_some() || !has(false));
        Ok(Self {
            cycle: task.cycle,
            sync0_cycle: clock.sync0_cycle,
            period: Span::ns(period),
            sync0_ns: plan
                .sync0_shift_ns(device)
                .rem_euclid(i64::try_from(period).unwrap_or(1).max(1)),
            before_sync0: times.outputs.calc_and_copy().filter(|_| has(true)).unwrap_or_default(),
            outputs_read,
            input_latch,
            inputs_written,
            work: outputs_read.max(inputs_written).filter(|_| is_known),
            limit: Span::ns(if is_slow { sync0 } else { period }),
            frames: counted,
        })
    }

    /// The margins with SYNC0 at this time.
    pub(super) fn margins(&self, sync0_ns: i64) -> Margins {
        let period = signed(self.period).max(1);
        let before = signed(self.before_sync0);
        let free = signed(self.limit).saturating_sub(signed(self.work.unwrap_or_default()));
        let of = |frame: &FrameArrival| {
            // From the last time that the frame was due up to SYNC0; the next is due a period later.
            let since = sync0_ns.saturating_sub(frame.due_ns).rem_euclid(period);
            let late = frame.latest_ns.saturating_sub(frame.due_ns);
            let early = frame.due_ns.saturating_sub(frame.earliest_ns);
            let first = since.saturating_sub(late).saturating_sub(before);
            let second = free.saturating_sub(since).saturating_sub(early);
            ((first, frame.frame), (second, frame.frame))
        };
        let each = || self.frames.iter().map(of);
        let least = |margins: Option<(i64, usize)>| margins.unwrap_or((i64::MIN, 0));
        Margins {
            first: least(each().map(|(first, _)| first).min()),
            second: least(each().map(|(_, second)| second).min()),
        }
    }

    /// Times at which SYNC0 comes as soon as a frame allows it, or as late as the next frame does.
    pub(super) fn candidates(&self, margin: i64) -> impl Iterator<Item = i64> {
        let before = signed(self.before_sync0).saturating_add(margin);
        let free = signed(self.limit).saturating_sub(signed(self.work.unwrap_or_default()));
        let free = free.saturating_sub(margin);
        self.frames.iter().flat_map(move |frame| {
            [frame.latest_ns.saturating_add(before), frame.earliest_ns.saturating_add(free)]
        })
    }

    /// The shortest period in which frames, SYNC0 and work find room.
    pub(super) fn least_period(&self, margin: Span) -> Span {
        let first = self.frames.iter().map(|frame| frame.earliest_ns).min().unwrap_or(0);
        let last = self.frames.iter().map(|frame| frame.latest_ns).max().unwrap_or(0);
        let frames = Span::ns(last.saturating_sub(first).max(0).unsigned_abs());
        frames + self.before_sync0 + self.work.unwrap_or_default() + margin * 2
    }

    /// What of its work is not known, in words.
    pub(super) fn lacks(&self, device: &DevicePlan) -> Option<&'static str> {
        let outputs = self.outputs_read.is_none() && !device.outputs.is_empty();
        let inputs = self.inputs_written.is_none() && !device.inputs.is_empty();
        match (outputs, inputs) {
            (false, false) => None,
            (true, false) => Some("neither 0x1C32:06 nor 0x1C32:05 is known"),
            (false, true) => Some("neither 0x1C33:06 nor 0x1C33:05 is known"),
            (true, true) => Some("neither :06 nor :05 of 0x1C32 and 0x1C33 are known"),
        }
    }
}

/// A SubDevice with SYNC0 and what is to be said of its timing.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct DeviceTiming {
    /// Which SubDevice.
    pub device: DeviceId,
    /// The shift of the network that its SYNC0 refers to.
    pub reference: ShiftReference,
    /// Its times; `None` where they are not known.
    pub times: Option<CycleTimes>,
    /// Every SYNC0 comes after the frames.
    pub after_frames: RuleTiming,
    /// The last access to process data is over before the next frames.
    pub before_next: RuleTiming,
    /// The shortest cycle that it bears, where its SYNC0 comes more often (SYN-25).
    pub too_fast: Option<Span>,
    /// What follows from the three.
    pub verdict: TimingVerdict,
    /// The shift of its own with which it passes, in ns, where it does not and that mends it
    /// (`clock = { sync0_shift_ns = … }`).
    pub own_shift_ns: Option<i64>,
    /// The cycle that it needs, and a task that has it, where no shift mends it.
    pub slower: Option<SlowerTask>,
    /// What is assumed of it.
    pub assumed: Vec<String>,
}

/// A task that is slow enough.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct SlowerTask {
    /// The shortest cycle that will do, a multiple of that of its task.
    pub cycle: Span,
    /// A task of the plan with that cycle or a longer one.
    pub task: Option<String>,
}

impl DeviceTiming {
    /// One of which only this is known: why nothing can be said.
    pub(super) fn unknown(plan: &Plan, device: &DevicePlan, lacks: &str) -> Self {
        Self {
            device: device.id,
            reference: plan.shift_reference(device),
            times: None,
            after_frames: RuleTiming::not_judged(lacks),
            before_next: RuleTiming::not_judged(lacks),
            too_fast: None,
            verdict: TimingVerdict::NotJudged,
            own_shift_ns: None,
            slower: None,
            assumed: Vec::new(),
        }
    }
}

/// Whether a frame counts for a SubDevice: whether it carries data of it, and fetches its inputs.
fn counts(plan: &Plan, device: DeviceId, task: &Task, time: &FrameTime) -> Option<(bool, bool)> {
    let of = plan.tasks.get(time.task)?;
    let frame = numbered(plan, time.number)?;
    let owned = || frame.datagrams.iter().flat_map(|datagram| &datagram.ownership);
    let mine = || owned().filter(|owned| owned.device == device);
    if mine().next().is_some() {
        return Some((true, mine().any(|owned| owned.direction == Direction::Inputs)));
    }
    let is_other = !std::ptr::eq(of, task) && of.cycle == task.cycle;
    (is_other && owned().any(|owned| plan.has_sync0(owned.device))).then_some((false, false))
}

/// A frame by its number over all tasks.
fn numbered(plan: &Plan, number: usize) -> Option<&FramePlan> {
    plan.tasks.iter().flat_map(|task| &task.frames).nth(number)
}

fn brings_time(plan: &Plan, number: usize) -> bool {
    numbered(plan, number).is_some_and(|frame| frame.has(super::super::Role::ReferenceClock))
}

const fn greatest_common(a: u64, b: u64) -> u64 {
    let (mut a, mut b) = (a, b);
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}
