//! The distributed clocks of a plan as JSON.

use linesman_config::plan::Plan;
use serde::Serialize;

/// Share of a cycle that is usual for the shift of outputs (SYN-11).
const USUAL_SHIFT_PERCENT: u64 = 30;

/// The distributed clocks.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct ClockReport {
    /// Number of the reference clock.
    reference: u32,
    /// Shift of the outputs that is usual: 30 % of the cycle of the first task with a clock.
    outputs_shift_ns: u64,
    /// What the line delays a frame at least, without cables and jitter: outputs cannot be there sooner.
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
    sync0_shift_ns: i64,
    sync1_cycle_ns: u64,
}

/// The clocks of a plan, if it has any.
pub(super) fn of(plan: &Plan) -> Option<ClockReport> {
    let reference = plan.reference_clock()?;
    let clocked = || plan.devices.iter().filter_map(|one| Some((one, one.settings.clock?)));
    let task = clocked().find_map(|(device, _)| plan.task_of(device.id));
    let cycle = task.or(plan.tasks.first()).map_or(0, |task| task.cycle.as_nanos());
    Some(ClockReport {
        reference: reference.no(),
        outputs_shift_ns: cycle * USUAL_SHIFT_PERCENT / 100,
        least_outputs_shift_ns: plan.least_delay().as_nanos(),
        devices: clocked()
            .map(|(device, clock)| ClockDeviceReport {
                no: device.id.no(),
                assign_activate: clock.assign_activate,
                sync0_cycle_ns: clock.sync0_cycle.as_nanos(),
                sync0_shift_ns: clock.sync0_shift_ns,
                sync1_cycle_ns: clock.sync1_cycle.as_nanos(),
            })
            .collect(),
    })
}
