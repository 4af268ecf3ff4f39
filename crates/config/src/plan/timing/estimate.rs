//! Estimates of the smallest shifts by rule of thumb, as sums of what is known of the line (SYN-17, SYN-18).
//!
//! Reference: S0 L401-445. The sums leave out how long the frames themselves are; the proof of each SubDevice
//! does not.

use linesman_proto::address::DeviceId;
use linesman_proto::time::Span;

use super::super::{IoAt, Plan, ShiftReference};
use super::assumption::Assumed;
use super::line_delay::{cable_delay, cable_links};

/// Parts of the smallest shift of the outputs.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct OutputsEstimate {
    /// SubDevices with a port for a cable, from the reference clock on: 1 µs each.
    pub cabled: u32,
    /// SubDevices with E-bus ports only: 0.3 µs each.
    pub terminals: u32,
    /// What these SubDevices delay a frame together.
    pub devices: Span,
    /// What the copper cables delay it, out and back: 5.3 ns/m twice.
    pub cables: Span,
    /// How late the MainDevice sends at the most.
    pub jitter: Span,
    /// How late the first task ends at the most, where its frames wait for that.
    pub task_jitter: Span,
    /// What the tasks take whose frames come behind the first.
    pub execution: Span,
    /// The margin that was asked for.
    pub margin: Span,
}

impl OutputsEstimate {
    /// The delay of the line alone.
    #[must_use]
    pub fn line(&self) -> Span {
        self.devices + self.cables
    }

    /// The sum.
    #[must_use]
    pub fn total(&self) -> Span {
        self.line() + self.jitter + self.task_jitter + self.execution + self.margin
    }
}

/// Parts of the smallest shift of the inputs: how long before the frames SYNC0 has to come.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct InputsEstimate {
    /// How early the MainDevice sends at the most.
    pub jitter: Span,
    /// The largest shortest cycle (0x1C33:05) of SubDevices that refer to this shift.
    pub min_cycle: Span,
    /// SubDevices of these whose shortest cycle is not known: the sum may be too small.
    pub unknown: Vec<DeviceId>,
    /// How much earlier inputs are fetched than the other frames leave.
    pub ahead: Span,
    /// How early the first task ends at the most, where its frames wait for that.
    pub task_jitter: Span,
    /// The margin that was asked for.
    pub margin: Span,
}

impl InputsEstimate {
    /// The sum.
    #[must_use]
    pub fn total(&self) -> Span {
        self.jitter + self.min_cycle + self.ahead + self.task_jitter + self.margin
    }
}

/// The estimate for the outputs.
pub(super) fn outputs(plan: &Plan, assumed: &Assumed) -> OutputsEstimate {
    let reference = plan.reference_clock().map_or(0, DeviceId::index);
    let devices = plan.devices.get(reference..).unwrap_or_default();
    let cabled = devices.iter().filter(|device| device.has_cable_port()).count();
    let links = (reference + 1..plan.devices.len()).filter(|node| cable_links(plan, *node)).count();
    let first_begins = plan.tasks.first().is_some_and(|task| task.io_at == IoAt::TaskBegin);
    // The source adds the *cycle time* of a first task that sends at its begin; its execution time is what the
    // frames of later tasks wait for.
    let waited = plan.tasks.iter().enumerate().filter(|(number, task)| match number {
        0 => first_begins && plan.tasks.len() > 1,
        _ => task.sync_units.iter().flat_map(|unit| &unit.devices).any(|id| plan.has_sync0(*id)),
    });
    OutputsEstimate {
        cabled: cabled as u32,
        terminals: (devices.len() - cabled) as u32,
        devices: Span::ns(devices.iter().map(|one| one.least_delay().as_nanos()).sum()),
        cables: cable_delay(assumed.cable_m(links)),
        jitter: assumed.jitter,
        task_jitter: assumed.task_jitter,
        execution: Span::ns(waited.map(|(number, _)| assumed.execution(number).as_nanos()).sum()),
        margin: assumed.margin,
    }
}

/// The estimate for the inputs; `None` where no SubDevice refers to their shift.
pub(super) fn inputs(plan: &Plan, assumed: &Assumed) -> Option<InputsEstimate> {
    let refers = |id: DeviceId| {
        let device = plan.device(id).filter(|_| plan.has_sync0(id))?;
        (plan.shift_reference(device) == ShiftReference::Inputs).then_some(device)
    };
    let devices: Vec<_> = plan.devices.iter().filter_map(|device| refers(device.id)).collect();
    let min_cycles = devices.iter().map(|device| (device.id, device.sync_times.inputs.min_cycle()));
    let unknown = min_cycles.clone().filter(|(_, cycle)| cycle.is_none()).map(|(id, _)| id);
    let frames = plan.tasks.iter().flat_map(|task| &task.frames);
    (!devices.is_empty()).then(|| InputsEstimate {
        jitter: assumed.jitter,
        min_cycle: min_cycles.clone().filter_map(|(_, cycle)| cycle).max().unwrap_or_default(),
        unknown: unknown.collect(),
        ahead: frames.map(|frame| frame.ahead).max().unwrap_or_default(),
        task_jitter: assumed.task_jitter,
        margin: assumed.margin,
    })
}
