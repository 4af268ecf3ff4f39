//! The timing of a plan as JSON.

use linesman_config::plan::timing::{
    CycleTimes, DeviceTiming, FrameArrival, PlanTiming, RuleTiming, TimingVerdict,
};
use linesman_config::plan::{Plan, ShiftReference};
use linesman_proto::address::DeviceId;
use linesman_proto::time::Span;
use serde::Serialize;

/// The timing: whether each SubDevice with SYNC0 is in time, and by how much.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct PlanTimingReport {
    /// `pass`, `fail`, or `not-judged` where something is not known; one that fails decides.
    verdict: &'static str,
    /// How early and how late the MainDevice sends at the most, given or assumed.
    jitter_ns: u64,
    /// The smallest shift of the outputs by rule of thumb, without the length of the frames.
    outputs_estimate: OutputsEstimateReport,
    /// The smallest shift of the inputs by rule of thumb; `null` where no SubDevice refers to it.
    inputs_estimate: Option<InputsEstimateReport>,
    /// The shift of the outputs with which all pass that refer to it; `null` where they do, or none mends them.
    proposed_outputs_shift_ns: Option<u64>,
    /// The same of the inputs; negative: before the frames.
    proposed_inputs_shift_ns: Option<i64>,
    /// The SubDevices with SYNC0.
    devices: Vec<DeviceTimingReport>,
    /// What was not given and is assumed.
    assumed: Vec<String>,
}

/// Parts of the smallest shift of the outputs.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct OutputsEstimateReport {
    /// SubDevices with a port for a cable, from the reference clock on.
    cabled: u32,
    /// SubDevices with E-bus ports only.
    terminals: u32,
    devices_ns: u64,
    cables_ns: u64,
    jitter_ns: u64,
    task_jitter_ns: u64,
    execution_ns: u64,
    margin_ns: u64,
    /// The sum.
    total_ns: u64,
}

/// Parts of the smallest shift of the inputs.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct InputsEstimateReport {
    jitter_ns: u64,
    /// The largest 0x1C33:05 of SubDevices that refer to this shift.
    min_cycle_ns: u64,
    /// Numbers of SubDevices whose 0x1C33:05 is not known.
    unknown: Vec<u32>,
    ahead_ns: u64,
    task_jitter_ns: u64,
    margin_ns: u64,
    /// The sum.
    total_ns: u64,
}

/// A SubDevice with SYNC0. Times are in ns after its task's cycle begins at the reference clock.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct DeviceTimingReport {
    no: u32,
    name: String,
    verdict: &'static str,
    /// The shift that its SYNC0 refers to: `outputs` or `inputs`.
    reference: &'static str,
    /// Every SYNC0 comes after the frames.
    after_frames: RuleReport,
    /// The last access to process data is over before the next frames.
    before_next: RuleReport,
    /// The shortest cycle that it bears, where its SYNC0 comes more often; else `null`.
    too_fast_ns: Option<u64>,
    /// Its times; `null` where they are not known.
    times: Option<TimesReport>,
    /// The `sync0_shift_ns` of its own with which it passes; `null` where it does, or none mends it.
    proposed_sync0_shift_ns: Option<i64>,
    /// The cycle that it needs where no shift mends it; else `null`.
    proposed_cycle_ns: Option<u64>,
    /// A task of the plan that is as slow; `null` for none.
    proposed_task: Option<String>,
    /// What is assumed of it.
    assumed: Vec<String>,
}

/// A rule.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct RuleReport {
    verdict: &'static str,
    /// What is left; negative: what is missing.
    margin_ns: Option<i64>,
    /// The frame that decides.
    frame: Option<usize>,
    /// What is not known; `null` where it was judged.
    lacks: Option<String>,
}

/// The times of a SubDevice.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct TimesReport {
    cycle_ns: u64,
    sync0_cycle_ns: u64,
    /// The time after which SYNC0 and frames meet in the same way again.
    period_ns: u64,
    /// The first SYNC0.
    sync0_ns: i64,
    /// What its SYNC0 lies behind the shift of the outputs, as the SubDevice is shown it.
    sync0_after_outputs_shift_ns: i64,
    /// From SYNC0 to the end of reading the outputs; `null`: not known, or no outputs.
    outputs_read_ns: Option<u64>,
    /// From SYNC0 to the input latch; `null` without inputs.
    input_latch_ns: Option<u64>,
    /// From SYNC0 to the end of writing the inputs; `null`: not known, or no inputs.
    inputs_written_ns: Option<u64>,
    /// The frames that count, at the SubDevice.
    frames: Vec<ArrivalReport>,
}

/// A frame at a SubDevice.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct ArrivalReport {
    frame: usize,
    /// When it begins without jitter.
    due_ns: i64,
    /// When it begins at the earliest.
    earliest_ns: i64,
    /// When it has ended at the latest.
    latest_ns: i64,
    /// Whether it has data of this SubDevice; else it is of another task.
    own: bool,
    /// Whether it fetches inputs of this SubDevice.
    fetches: bool,
}

/// A verdict in JSON.
pub(in crate::command::plan) const fn word(verdict: TimingVerdict) -> &'static str {
    match verdict {
        TimingVerdict::Pass => "pass",
        TimingVerdict::Fail => "fail",
        TimingVerdict::NotJudged => "not-judged",
    }
}

/// The report.
pub(super) fn of(plan: &Plan, timing: &PlanTiming) -> PlanTimingReport {
    let ns = Span::as_nanos;
    let outputs = &timing.outputs;
    PlanTimingReport {
        verdict: word(timing.verdict()),
        jitter_ns: ns(timing.jitter),
        outputs_estimate: OutputsEstimateReport {
            cabled: outputs.cabled,
            terminals: outputs.terminals,
            devices_ns: ns(outputs.devices),
            cables_ns: ns(outputs.cables),
            jitter_ns: ns(outputs.jitter),
            task_jitter_ns: ns(outputs.task_jitter),
            execution_ns: ns(outputs.execution),
            margin_ns: ns(outputs.margin),
            total_ns: ns(outputs.total()),
        },
        inputs_estimate: timing.inputs.as_ref().map(|inputs| InputsEstimateReport {
            jitter_ns: ns(inputs.jitter),
            min_cycle_ns: ns(inputs.min_cycle),
            unknown: inputs.unknown.iter().map(|id| id.no()).collect(),
            ahead_ns: ns(inputs.ahead),
            task_jitter_ns: ns(inputs.task_jitter),
            margin_ns: ns(inputs.margin),
            total_ns: ns(inputs.total()),
        }),
        proposed_outputs_shift_ns: timing.outputs_shift.map(ns),
        proposed_inputs_shift_ns: timing.inputs_shift_ns,
        devices: timing.devices.iter().map(|device| device_report(plan, device)).collect(),
        assumed: timing.assumed.clone(),
    }
}

fn device_report(plan: &Plan, device: &DeviceTiming) -> DeviceTimingReport {
    DeviceTimingReport {
        no: device.device.no(),
        name: plan.device(device.device).map_or_else(String::new, |one| one.name.clone()),
        verdict: word(device.verdict),
        reference: match device.reference {
            ShiftReference::Outputs => "outputs",
            ShiftReference::Inputs => "inputs",
        },
        after_frames: rule(&device.after_frames),
        before_next: rule(&device.before_next),
        too_fast_ns: device.too_fast.map(Span::as_nanos),
        times: device.times.as_ref().map(|times| times_report(plan, device.device, times)),
        proposed_sync0_shift_ns: device.own_shift_ns,
        proposed_cycle_ns: device.slower.as_ref().map(|slower| slower.cycle.as_nanos()),
        proposed_task: device.slower.as_ref().and_then(|slower| slower.task.clone()),
        assumed: device.assumed.clone(),
    }
}

fn rule(rule: &RuleTiming) -> RuleReport {
    RuleReport {
        verdict: word(rule.verdict),
        margin_ns: rule.margin_ns,
        frame: rule.frame,
        lacks: Some(rule.lacks.clone()).filter(|lacks| !lacks.is_empty()),
    }
}

fn times_report(plan: &Plan, device: DeviceId, times: &CycleTimes) -> TimesReport {
    let planned = plan.device(device);
    let has_inputs = planned.is_some_and(|planned| !planned.inputs.is_empty());
    TimesReport {
        cycle_ns: times.cycle.as_nanos(),
        sync0_cycle_ns: times.sync0_cycle.as_nanos(),
        period_ns: times.period.as_nanos(),
        sync0_ns: times.sync0_ns,
        sync0_after_outputs_shift_ns: planned
            .map_or(0, |planned| plan.sync0_after_outputs_shift_ns(planned)),
        outputs_read_ns: times.outputs_read.map(Span::as_nanos),
        input_latch_ns: has_inputs.then(|| times.input_latch.as_nanos()),
        inputs_written_ns: times.inputs_written.map(Span::as_nanos),
        frames: times.frames.iter().map(arrival).collect(),
    }
}

fn arrival(frame: &FrameArrival) -> ArrivalReport {
    let FrameArrival { frame, due_ns, earliest_ns, latest_ns, own, fetches } = *frame;
    ArrivalReport { frame, due_ns, earliest_ns, latest_ns, own, fetches }
}
