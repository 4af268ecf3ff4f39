//! The distributed clocks of a plan as JSON.

use linesman_config::plan::Plan;
use serde::Serialize;

/// The distributed clocks.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct ClockReport {
    /// Number of the reference clock.
    reference: u32,
    /// Shift of the outputs in the first task with a clock: from its frames to SYNC0.
    outputs_shift_ns: u64,
    /// Shift of the inputs in that task: to SYNC0 of SubDevices with inputs only; negative: before the frames.
    inputs_shift_ns: i64,
    /// What the line and the frames themselves take at least, without cables and jitter: outputs cannot be
    /// there sooner.
    least_outputs_shift_ns: u64,
    devices: Vec<ClockDeviceReport>,
}

/// A SubDevice with a distributed clock.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct ClockDeviceReport {
    no: u32,
    assign_activate: u16,
    sync0_cycle_ns: u64,
    /// Its own shift, on top of that of the network.
    sync0_shift_ns: i64,
    /// From the shift of the outputs to SYNC0, as the SubDevice is shown it.
    sync0_after_outputs_shift_ns: i64,
    /// From the frames at the reference clock to SYNC0.
    sync0_after_frames_ns: i64,
    sync1_cycle_ns: u64,
}

/// The clocks of a plan, if it has any.
pub(super) fn of(plan: &Plan) -> Option<ClockReport> {
    let reference = plan.reference_clock()?;
    let clocked = || plan.devices.iter().filter_map(|one| Some((one, one.settings.clock?)));
    let task = clocked().find_map(|(device, _)| plan.task_of(device.id));
    let task = task.or(plan.tasks.first())?;
    Some(ClockReport {
        reference: reference.no(),
        outputs_shift_ns: plan.outputs_shift(task).as_nanos(),
        inputs_shift_ns: plan.inputs_shift_ns(task),
        least_outputs_shift_ns: plan.least_outputs_shift(task).as_nanos(),
        devices: clocked()
            .map(|(device, clock)| ClockDeviceReport {
                no: device.id.no(),
                assign_activate: clock.assign_activate,
                sync0_cycle_ns: clock.sync0_cycle.as_nanos(),
                sync0_shift_ns: clock.sync0_shift_ns,
                sync0_after_outputs_shift_ns: plan.sync0_after_outputs_shift_ns(device),
                sync0_after_frames_ns: plan.sync0_shift_ns(device),
                sync1_cycle_ns: clock.sync1_cycle.as_nanos(),
            })
            .collect(),
    })
}
