//! A plan as JSON, `linesman.plan/1`.

mod clock;
pub(super) mod removable;
pub(super) mod timing;

use linesman_config::plan::timing::PlanTiming;
use linesman_config::plan::{
    DatagramPlan, DevicePlan, Doubt, FramePlan, IoAt, PathView, Plan, Presence, Role, Severity,
    Task, expect,
};
use linesman_proto::address::DeviceId;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::frame::size::load_percent;
use linesman_proto::sii::Direction;
use linesman_runtime::plan_file::PlanFile;
use serde::Serialize;

use self::clock::ClockReport;
use self::removable::{CableReport, HotConnectReport};
use self::timing::PlanTimingReport;
use super::ethernet::EthernetPlanReport;
use crate::command::ebus::{self, EbusReport};
use crate::version;

/// A plan.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlanReport {
    /// `linesman.plan/1`.
    schema: String,
    /// Name and version of the program.
    tool: String,
    /// What the network is called.
    name: String,
    /// Share of the wire's time that all cyclic frames take, in percent.
    load_percent: f64,
    /// Bytes of outputs in the process image.
    outputs_bytes: usize,
    /// Bytes of inputs in the process image.
    inputs_bytes: usize,
    /// The SubDevices, by number.
    devices: Vec<DeviceReport>,
    /// What is exchanged cyclically.
    tasks: Vec<TaskReport>,
    /// The budget of the E-bus, by feeder.
    ebus: Vec<EbusReport>,
    /// The distributed clocks; `null` without any.
    clock: Option<ClockReport>,
    /// Groups that join and leave while the network runs.
    groups: Vec<HotConnectReport>,
    /// The cables, and which of them may break without the loss of a SubDevice.
    cables: Vec<CableReport>,
    /// The timing of SubDevices with SYNC0; `null` unless asked for (`--timing`).
    timing: Option<PlanTimingReport>,
    /// Ethernet over EtherCAT; `null` unless asked for (`--ethernet`).
    ethernet: Option<EthernetPlanReport>,
    /// What is doubtful, the worst first.
    findings: Vec<FindingReport>,
    /// What the file says and the plan leaves out.
    notes: Vec<String>,
}

/// A SubDevice.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct DeviceReport {
    no: u32,
    name: String,
    #[serde(rename = "type")]
    type_name: String,
    station: u16,
    vendor_id: u32,
    product_code: u32,
    revision: u32,
    /// The state it is driven to.
    state: String,
    /// Bits of its outputs and inputs.
    outputs_bits: u32,
    inputs_bits: u32,
    /// The task and sync unit that have its process data; `null` without any.
    task: Option<String>,
    sync_unit: Option<String>,
    mailbox: bool,
    /// What it adds to the working counters of which datagrams.
    working_counters: Vec<Share>,
    /// SyncManagers for process data.
    sync_managers: Vec<SyncManagerReport>,
    /// FMMUs for process data.
    fmmus: Vec<FmmuReport>,
    /// What it is told at its transitions, in order.
    start_up: Vec<StartUpReport>,
}

/// What a SubDevice adds to a working counter.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct Share {
    frame: usize,
    datagram: usize,
    adds: u16,
}

/// A SyncManager.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct SyncManagerReport {
    index: u8,
    start: u16,
    len: u16,
    control: u8,
}

/// An FMMU.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct FmmuReport {
    index: u8,
    direction: &'static str,
    logical: u32,
    logical_start_bit: u8,
    bits: u32,
    physical: u16,
    physical_start_bit: u8,
}

/// A start-up command.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct StartUpReport {
    /// Two letters, such as `PS`.
    transition: String,
    /// What is done.
    text: String,
}

/// A task.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct TaskReport {
    name: String,
    cycle_ns: u64,
    /// `task-begin` or `task-end`.
    io_at: IoAt,
    load_percent: f64,
    sync_units: Vec<String>,
    frames: Vec<FrameReport>,
}

/// A frame.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct FrameReport {
    /// Counted from 0 over all tasks.
    no: usize,
    /// Bytes without padding and check sequence.
    size: usize,
    /// How often it is sent in a cycle.
    copies: u8,
    /// Time that all copies hold the wire.
    wire_ns: u64,
    /// Share of the cycle, in percent.
    load_percent: f64,
    /// How much earlier than the other frames of its task it leaves.
    ahead_ns: u64,
    datagrams: Vec<DatagramReport>,
}

/// A datagram.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct DatagramReport {
    command: &'static str,
    /// Logical address; `null` for a physical one.
    logical: Option<u32>,
    /// Position or station; `null` for a logical address.
    address: Option<u16>,
    /// Register; `null` for a logical address.
    register: Option<u16>,
    len: usize,
    /// The working counter with which it comes back when all is well.
    wkc: u16,
    /// Whether another one is an error.
    judged: bool,
    /// `process-data`, `presence`, `mailbox-states`, `reference-clock`, `latched-time`, `clock-shift`,
    /// `other`.
    role: &'static str,
    sync_unit: Option<String>,
    /// Which bytes are whose.
    owners: Vec<OwnerReport>,
}

/// Bytes of a datagram.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct OwnerReport {
    no: u32,
    direction: &'static str,
    /// First byte, and the one behind the last.
    from: usize,
    to: usize,
    /// Which bits of the first and last byte; `[255, 255]` for whole bytes.
    masks: [u8; 2],
}

/// Something doubtful.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct FindingReport {
    /// `error`, `warning` or `info`.
    severity: &'static str,
    /// Such as `ebus-overload`.
    name: &'static str,
    /// Number of the SubDevice it is about.
    no: Option<u32>,
    text: String,
    action: String,
}

/// The report of a plan.
pub(super) fn report(
    file: &PlanFile,
    doubts: &[Doubt],
    timing: Option<&PlanTiming>,
    ethernet: Option<EthernetPlanReport>,
) -> PlanReport {
    let plan = &file.plan;
    let present = Presence::full(plan.devices.len());
    let mut number = 0..;
    let mut frames = |task: &Task| -> Vec<FrameReport> {
        let frames = task.frames.iter().zip(&mut number);
        frames.map(|(frame, no)| frame_report(frame, no, task, plan, &present)).collect()
    };
    PlanReport {
        schema: "linesman.plan/1".to_owned(),
        tool: version::tool(),
        name: file.name.clone(),
        load_percent: plan.load_percent(),
        outputs_bytes: plan.outputs_len,
        inputs_bytes: plan.inputs_len,
        devices: plan.devices.iter().map(|device| device_report(device, plan)).collect(),
        tasks: plan
            .tasks
            .iter()
            .map(|task| TaskReport {
                name: task.name.clone(),
                cycle_ns: task.cycle.as_nanos(),
                io_at: task.io_at,
                load_percent: plan.task_load_percent(task),
                sync_units: task.sync_units.iter().map(|unit| unit.name.clone()).collect(),
                frames: frames(task),
            })
            .collect(),
        ebus: ebus::of(plan.ebus_groups(), |id| {
            plan.device(id).map_or_else(String::new, |device| device.name.clone())
        }),
        clock: clock::of(plan),
        groups: removable::groups(plan),
        cables: removable::cables(plan),
        timing: timing.map(|timing| timing::of(plan, timing)),
        ethernet,
        findings: doubts.iter().map(finding).collect(),
        notes: file.notes.clone(),
    }
}

fn finding(doubt: &Doubt) -> FindingReport {
    FindingReport {
        severity: match doubt.severity {
            Severity::Info => "info",
            Severity::Warning => "warning",
            Severity::Error => "error",
        },
        name: doubt.name,
        no: doubt.device.map(DeviceId::no),
        text: doubt.text.clone(),
        action: doubt.advice.clone(),
    }
}

/// The working counter with which a datagram comes back when all is well.
pub(super) fn counter(datagram: &DatagramPlan, plan: &Plan, present: &Presence) -> u16 {
    match datagram.role {
        Role::MailboxStates => {
            plan.devices.iter().filter(|device| device.mailbox_state.is_some()).count() as u16
        }
        Role::ProcessData
        | Role::Presence
        | Role::LatchedTime
        | Role::ReferenceClock
        | Role::ClockShift
        | Role::Other => expect::expect(datagram, present, PathView::Merged).0,
    }
}

const fn role(role: Role) -> &'static str {
    match role {
        Role::ProcessData => "process-data",
        Role::Presence => "presence",
        Role::LatchedTime => "latched-time",
        Role::ReferenceClock => "reference-clock",
        Role::ClockShift => "clock-shift",
        Role::MailboxStates => "mailbox-states",
        Role::Other => "other",
    }
}

const fn way(direction: Direction) -> &'static str {
    match direction {
        Direction::Outputs => "outputs",
        Direction::Inputs => "inputs",
    }
}

fn frame_report(
    frame: &FramePlan,
    no: usize,
    task: &Task,
    plan: &Plan,
    present: &Presence,
) -> FrameReport {
    let copies = frame.repeats + 1;
    let datagrams = frame.datagrams.iter().map(|datagram| {
        let (logical, address, register) = match datagram.address {
            DatagramAddress::Logical(logical) => (Some(logical.0), None, None),
            DatagramAddress::Physical(address, register) => (None, Some(address), Some(register.0)),
        };
        let unit = datagram.sync_unit.and_then(|unit| task.sync_units.get(unit));
        let owners = datagram.ownership.iter().map(|owned| OwnerReport {
            no: owned.device.no(),
            direction: way(owned.direction),
            from: owned.range.start,
            to: owned.range.end,
            masks: owned.masks,
        });
        DatagramReport {
            command: datagram.command.name(),
            logical,
            address,
            register,
            len: datagram.len,
            wkc: counter(datagram, plan, present),
            judged: datagram.role.is_judged(),
            role: role(datagram.role),
            sync_unit: unit.map(|unit| unit.name.clone()),
            owners: owners.collect(),
        }
    });
    FrameReport {
        no,
        size: frame.size(),
        copies,
        wire_ns: frame.wire_time().as_nanos(),
        load_percent: load_percent(frame.size(), task.cycle) * f64::from(copies),
        ahead_ns: frame.ahead.as_nanos(),
        datagrams: datagrams.collect(),
    }
}

/// Bits of process data of a SubDevice in one direction.
pub(super) fn bits(device: &DevicePlan, direction: Direction) -> u32 {
    let fmmus = device.fmmus.iter().map(|(_, fmmu)| fmmu);
    let mine = fmmus.filter(|fmmu| match direction {
        Direction::Outputs => fmmu.writes,
        Direction::Inputs => fmmu.reads,
    });
    mine.map(|fmmu| fmmu.bit_len()).sum()
}

/// What a SubDevice adds to which datagram: index of the frame over all tasks, of the datagram, and how
/// much.
pub(super) fn shares(device: DeviceId, plan: &Plan) -> Vec<(usize, usize, u16)> {
    let mut shares = Vec::new();
    let frames = plan.tasks.iter().flat_map(|task| &task.frames).enumerate();
    for (frame, planned) in frames {
        for (at, datagram) in planned.datagrams.iter().enumerate() {
            if datagram.ownership.iter().any(|owned| owned.device == device) {
                let mut alone = Presence::none(plan.devices.len());
                alone.set(device, linesman_config::plan::Served::FULL);
                shares.push((frame, at, expect::expect(datagram, &alone, PathView::Merged).0));
            }
        }
    }
    shares
}

/// The task and sync unit of a SubDevice's process data.
pub(super) fn unit_of(device: DeviceId, plan: &Plan) -> Option<(&Task, &str)> {
    let task = plan.task_of(device)?;
    let unit = task.sync_units.iter().find(|unit| unit.devices.contains(&device))?;
    Some((task, &unit.name))
}

fn device_report(device: &DevicePlan, plan: &Plan) -> DeviceReport {
    let unit = unit_of(device.id, plan);
    let shares = shares(device.id, plan).into_iter();
    DeviceReport {
        no: device.id.no(),
        name: device.name.clone(),
        type_name: device.type_name.clone(),
        station: device.station.0,
        vendor_id: device.identity.vendor_id,
        product_code: device.identity.product_code,
        revision: device.identity.revision,
        state: device.target.to_string(),
        outputs_bits: bits(device, Direction::Outputs),
        inputs_bits: bits(device, Direction::Inputs),
        task: unit.map(|(task, _)| task.name.clone()),
        sync_unit: unit.map(|(_, name)| name.to_owned()),
        mailbox: device.mailbox.is_some(),
        working_counters: shares
            .map(|(frame, datagram, adds)| Share { frame, datagram, adds })
            .collect(),
        sync_managers: device
            .sync_managers
            .iter()
            .map(|(index, manager)| SyncManagerReport {
                index: *index,
                start: manager.start.0,
                len: manager.length,
                control: manager.control.0,
            })
            .collect(),
        fmmus: device
            .fmmus
            .iter()
            .map(|(index, fmmu)| FmmuReport {
                index: *index,
                direction: way(if fmmu.writes { Direction::Outputs } else { Direction::Inputs }),
                logical: fmmu.logical_start.0,
                logical_start_bit: fmmu.logical_start_bit,
                bits: fmmu.bit_len(),
                physical: fmmu.physical_start.0,
                physical_start_bit: fmmu.physical_start_bit,
            })
            .collect(),
        start_up: device
            .start_up
            .iter()
            .map(|command| StartUpReport {
                transition: command.transition.letters(),
                text: command.to_string(),
            })
            .collect(),
    }
}
