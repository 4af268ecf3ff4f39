//! Laying out the logical space: which SubDevice's process data lie where, in which datagram of
//! which frame, and the FMMUs that follow.
//!
//! SubDevices are taken in their order, task by task and sync unit by sync unit, and grouped until a
//! datagram is full. No SubDevice's data of one direction are split over two datagrams: they would be
//! of two cycles. Where LRW is used, a SubDevice's outputs and inputs are in the same datagram.

mod area;
mod extra;
mod group;

use linesman_proto::address::{DeviceId, LogicalAddress};
use linesman_proto::command::Command;
use linesman_proto::ethernet::MAX_LEN;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::frame::{DATAGRAM_OVERHEAD, MAX_DATAGRAM_DATA};
use linesman_proto::register::SyncManagerConfig;
use linesman_proto::sii::Direction;
use linesman_proto::time::Span;
use linesman_proto::topology::Tree;

use self::area::Run;
use self::group::{Group, groups};
use super::{
    DatagramPlan, DevicePlan, FramePlan, HotConnectGroup, IoAt, Ownership, Plan, PlannedDevice,
    RingClocks, Role, SyncUnit, Task, TimeSource,
};
use crate::profile::ProcessSyncManager;

/// Where the process data of the first task begin in the logical space.
pub const LOGICAL_START: LogicalAddress = LogicalAddress(0x0100_0000);
/// Where the mailbox bits lie.
pub const MAILBOX_STATES: LogicalAddress = LogicalAddress(0x0900_0000);
/// Logical space of one task.
const TASK_SPACE: u32 = 0x0100_0000;
/// With [`Grouping::ByKind`] each datagram's data begin at a multiple of this.
const WINDOW: u32 = 0x0800;
/// The sync unit of those that were put into none.
pub const DEFAULT_UNIT: &str = "<default>";
/// The task of those that were put into none, when there is but one.
pub const DEFAULT_TASK: &str = "cyclic";

/// Choices that the SubDevices leave open.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct PlanOptions {
    /// Cycle time of the one task, where `tasks` is empty.
    pub cycle: Span,
    /// LRD and LWR for all, as a ring over two cards prefers when a SubDevice's data must not mix.
    pub separate_directions: bool,
    /// The tasks; empty: one.
    pub tasks: Vec<TaskOptions>,
    /// Which SubDevices share datagrams.
    pub grouping: Grouping,
    /// SubDevices with a few bits each share bytes.
    pub pack_bits: bool,
    /// Cyclic datagrams for the distributed clocks, where a SubDevice has one that is used.
    pub clock_datagrams: bool,
    /// A cyclic datagram that reads which mailboxes hold something.
    pub mailbox_states: bool,
    /// A cyclic datagram that reads AL status of all by broadcast, behind the process data.
    pub presence: bool,
    /// The shift of the outputs: from the frames to SYNC0. `None`: 30 % of the cycle (SYN-11).
    pub outputs_shift: Option<Span>,
    /// The shift of the inputs in ns: from the frames to SYNC0 of SubDevices with inputs only. `None`: -10 % of
    /// the cycle.
    pub inputs_shift_ns: Option<i64>,
    /// How far a clock may be off the reference clock before that is told, where that is chosen.
    pub sync_window: Option<Span>,
    /// Whose time the network has, where that is chosen.
    pub time_source: Option<TimeSource>,
    /// The base time: cycles and earlier fetches are whole numbers of it.
    pub base_tick: Span,
    /// Ports whose link was lost open by order only.
    pub ports_open_by_order: bool,
    /// Outputs are withheld after a link error until the network is reset.
    pub lock_after_link_error: bool,
    /// Groups that join and leave while the network runs.
    pub groups: Vec<HotConnectGroup>,
    /// What is said of the clocks of its ring.
    pub ring_clocks: RingClocks,
}

impl Default for PlanOptions {
    fn default() -> Self {
        Self {
            cycle: Span::ms(1),
            separate_directions: false,
            tasks: Vec::new(),
            grouping: Grouping::Compact,
            pack_bits: false,
            clock_datagrams: false,
            mailbox_states: false,
            presence: true,
            outputs_shift: None,
            inputs_shift_ns: None,
            sync_window: None,
            time_source: None,
            base_tick: Span::ms(1),
            ports_open_by_order: false,
            lock_after_link_error: false,
            groups: Vec::new(),
            ring_clocks: RingClocks::default(),
        }
    }
}

/// Which SubDevices share datagrams.
#[derive(
    Clone, Copy, PartialEq, Eq, Hash, Debug, Default, serde::Serialize, serde::Deserialize,
)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Grouping {
    /// All that fit: the fewest datagrams.
    #[default]
    Compact,
    /// Those with outputs and inputs in LRW, those with outputs in LWR, those with inputs in LRD, as
    /// the common configuration tools do: a wrong working counter says more (FRM-12, FRM-23).
    ByKind,
}

/// A task.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct TaskOptions {
    /// Its name.
    pub name: String,
    /// Cycle time.
    pub cycle: Span,
    /// When its frames leave.
    pub io_at: IoAt,
    /// Inputs are fetched in frames of their own, so much earlier (SYN-15).
    pub separate_inputs: Option<Span>,
    /// How often a frame is sent again, if all in it allow that (FRM-27).
    pub repeats: u8,
}

impl TaskOptions {
    /// A task with this cycle time and nothing special.
    #[must_use]
    pub fn new(name: &str, cycle: Span) -> Self {
        Self {
            name: name.to_owned(),
            cycle,
            io_at: IoAt::default(),
            separate_inputs: None,
            repeats: 0,
        }
    }
}

/// No plan can be made.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum PlanError {
    /// A SubDevice has more process data than one datagram carries.
    #[error(
        "{name} has {len} bytes of process data, one datagram carries at most {MAX_DATAGRAM_DATA}: \
         choose fewer or smaller PDOs"
    )]
    TooMuchProcessData {
        /// Whose.
        name: String,
        /// Bytes in both directions.
        len: usize,
    },
    /// The tree has another number of controllers than there are SubDevices.
    #[error("the wiring has {wired} controllers, {planned} SubDevices are planned")]
    WiringDiffers {
        /// Controllers in the tree.
        wired: usize,
        /// Planned SubDevices.
        planned: usize,
    },
    /// A SubDevice is in a task that is not there.
    #[error("{name} is in task \"{task}\", but there is none of that name; there is {has}")]
    UnknownTask {
        /// Whose.
        name: String,
        /// The name of the task.
        task: String,
        /// The names there are.
        has: String,
    },
    /// More process data than the logical space of a task has room for.
    #[error("the process data of task \"{task}\" do not fit into its logical space")]
    TaskTooLarge {
        /// Which.
        task: String,
    },
}

impl Plan {
    /// Makes the plan for `devices`, given in processing order, which becomes the order of their
    /// [`DeviceId`]s; node *n* of `tree` is device *n*.
    ///
    /// # Errors
    /// [`PlanError`] when a SubDevice's data fit into no datagram, or wiring and devices disagree.
    pub fn build(
        devices: &[PlannedDevice],
        tree: Tree,
        options: &PlanOptions,
    ) -> Result<Self, PlanError> {
        if tree.len() != devices.len() {
            let (wired, planned) = (tree.len(), devices.len());
            return Err(PlanError::WiringDiffers { wired, planned });
        }
        let mut plan = Self {
            devices: devices.iter().zip(0..).map(|(planned, id)| device(planned, id)).collect(),
            outputs_shift: options.outputs_shift,
            inputs_shift_ns: options.inputs_shift_ns,
            sync_window: options.sync_window,
            base_tick: options.base_tick,
            ports_open_by_order: options.ports_open_by_order,
            lock_after_link_error: options.lock_after_link_error,
            groups: options.groups.clone(),
            ring_clocks: options.ring_clocks,
            ..Self::empty(tree)
        };
        let tasks = match options.tasks.as_slice() {
            [] => vec![TaskOptions::new(DEFAULT_TASK, options.cycle)],
            tasks => tasks.to_vec(),
        };
        let members = members(devices, &tasks)?;
        let mut extra = extra::head(&mut plan, devices, options);
        let last = tasks.len() - 1;
        for (index, (task, members)) in tasks.iter().zip(members).enumerate() {
            let mut layout = TaskLayout::new(index, task, options);
            let mut datagrams = std::mem::take(&mut extra);
            for unit in units(devices, &members, &options.groups) {
                layout.place_unit(unit, devices, &mut plan, &mut datagrams)?;
            }
            if index == last && options.presence {
                datagrams.push(extra::presence_monitor());
            }
            let frames = layout.frames(datagrams, devices);
            plan.tasks.push(Task {
                name: task.name.clone(),
                cycle: task.cycle,
                io_at: task.io_at,
                sync_units: layout.units,
                frames,
            });
        }
        extra::settle_mailbox_fmmus(&mut plan);
        plan.name_variables(devices);
        plan.take_time_source(options.time_source, devices);
        Ok(plan)
    }
}

fn device(planned: &PlannedDevice, id: u32) -> DevicePlan {
    let mapped = planned.profile.process.iter().filter(|manager| manager.len > 0);
    DevicePlan {
        name: planned.name.clone(),
        type_name: planned.profile.type_name.clone(),
        station: planned.station,
        identity: planned.identity,
        revision_rule: planned.revision_rule,
        mailbox: planned.profile.mailbox,
        sync_managers: mapped
            .filter(|manager| !manager.is_virtual)
            .map(|manager| {
                let ProcessSyncManager { index, start, len, control, .. } = *manager;
                (index, SyncManagerConfig::enabled(start, len, control))
            })
            .collect(),
        device_emulation: planned.profile.device_emulation,
        target: planned.target,
        start_up: planned.start_up.clone(),
        settings: planned.settings.clone(),
        ebus_current_ma: planned.profile.ebus_current_ma,
        ports: planned.profile.ports,
        sync_times: planned.profile.sync_times,
        channels: super::info_data::drive_channels(&planned.profile),
        ..DevicePlan::bare(DeviceId(id))
    }
}

/// Which SubDevices are in which task.
fn members(devices: &[PlannedDevice], tasks: &[TaskOptions]) -> Result<Vec<Vec<usize>>, PlanError> {
    let mut members = vec![Vec::new(); tasks.len()];
    for (index, device) in devices.iter().enumerate() {
        let task = match &device.settings.task {
            None => Some(0),
            Some(name) => tasks.iter().position(|task| task.name == *name),
        };
        match task.and_then(|task| members.get_mut(task)) {
            Some(of_task) => of_task.push(index),
            None => {
                let names: Vec<_> = tasks.iter().map(|task| format!("\"{}\"", task.name)).collect();
                return Err(PlanError::UnknownTask {
                    name: device.name.clone(),
                    task: device.settings.task.clone().unwrap_or_default(),
                    has: names.join(", "),
                });
            }
        }
    }
    Ok(members)
}

/// The sync units of a task in the order in which they first occur, with those that have process
/// data. A hot connect group has sync units of its own, behind all others: datagrams of others keep their
/// working counters when it comes and goes (HC-01).
fn units<'a>(
    devices: &'a [PlannedDevice],
    members: &[usize],
    groups: &'a [HotConnectGroup],
) -> Vec<(&'a str, Vec<usize>)> {
    let mut units: Vec<(&str, Vec<usize>)> = Vec::new();
    // The group of a sync unit, in the same order.
    let mut owners: Vec<Option<usize>> = Vec::new();
    let group_of = |member: usize| {
        groups.iter().position(|group| group.members.contains(&DeviceId(member as u32)))
    };
    let (mut of_groups, mut fixed): (Vec<usize>, Vec<usize>) =
        members.iter().partition(|member| group_of(**member).is_some());
    of_groups.sort_by_key(|member| group_of(*member));
    fixed.append(&mut of_groups);
    let members = fixed;
    for member in members {
        let device = &devices[member];
        if device.profile.process.iter().all(|manager| manager.len == 0) {
            continue;
        }
        let group = group_of(member);
        let default = group.map_or(DEFAULT_UNIT, |group| groups[group].name.as_str());
        let name = device.settings.sync_unit.as_deref().unwrap_or(default);
        let known = units.iter_mut().zip(&owners);
        let mut same = known.filter(|((known, _), owner)| *known == name && **owner == group);
        match same.next() {
            Some(((_, of_unit), _)) => of_unit.push(member),
            None => {
                units.push((name, vec![member]));
                owners.push(group);
            }
        }
    }
    if units.is_empty() {
        units.push((DEFAULT_UNIT, Vec::new()));
    }
    units
}

/// The logical space of a task as it is being filled.
struct TaskLayout<'a> {
    task: &'a TaskOptions,
    options: &'a PlanOptions,
    next: LogicalAddress,
    end: u64,
    units: Vec<SyncUnit>,
}

impl<'a> TaskLayout<'a> {
    fn new(index: usize, task: &'a TaskOptions, options: &'a PlanOptions) -> Self {
        // The ninth task's space is that of the mailbox bits.
        let mailboxes = (MAILBOX_STATES.0 / TASK_SPACE) as usize - 1;
        let number = if index < mailboxes { index } else { index + 1 };
        let start = u64::from(LOGICAL_START.0) + number as u64 * u64::from(TASK_SPACE);
        let end = (start + u64::from(TASK_SPACE)).min(u64::from(u32::MAX));
        let next = LogicalAddress(u32::try_from(start).unwrap_or(u32::MAX));
        Self { task, options, next, end, units: Vec::new() }
    }

    fn place_unit(
        &mut self,
        (name, members): (&str, Vec<usize>),
        devices: &[PlannedDevice],
        plan: &mut Plan,
        datagrams: &mut Vec<DatagramPlan>,
    ) -> Result<(), PlanError> {
        for group in groups(&members, devices, self.task, self.options)? {
            self.place(&group, devices, plan, datagrams)?;
            if self.options.grouping == Grouping::ByKind {
                self.next = LogicalAddress(self.next.0.next_multiple_of(WINDOW));
            }
        }
        let ids = members.iter().map(|member| DeviceId(*member as u32)).collect();
        self.units.push(SyncUnit { name: name.to_owned(), devices: ids });
        Ok(())
    }

    fn place(
        &mut self,
        group: &Group,
        devices: &[PlannedDevice],
        plan: &mut Plan,
        datagrams: &mut Vec<DatagramPlan>,
    ) -> Result<(), PlanError> {
        let start = self.next;
        if u64::from(start.0) + MAX_DATAGRAM_DATA as u64 > self.end {
            return Err(PlanError::TaskTooLarge { task: self.task.name.clone() });
        }
        let mut run = |members: &[usize], direction| {
            let mut run = Run::new(self.next, direction, self.options.pack_bits);
            for &member in members {
                run.take(plan, member, &devices[member].profile.process);
            }
            let (owned, len) = run.finish(plan);
            self.next = LogicalAddress(self.next.0 + len as u32);
            (owned, len)
        };
        let (outputs, outputs_len) = run(&group.outputs, Direction::Outputs);
        let (inputs, inputs_len) = run(&group.inputs, Direction::Inputs);
        let inputs_start = LogicalAddress(start.0 + outputs_len as u32);
        let mut push = |command, at, len, ownership| {
            if len > 0 {
                datagrams.push(DatagramPlan {
                    command,
                    address: DatagramAddress::Logical(at),
                    len,
                    role: Role::ProcessData,
                    sync_unit: Some(self.units.len()),
                    ownership,
                });
            }
        };
        if group.lrw && outputs_len > 0 && inputs_len > 0 {
            let behind = |mut owned: Ownership| {
                owned.range = owned.range.start + outputs_len..owned.range.end + outputs_len;
                owned
            };
            let all = outputs.into_iter().chain(inputs.into_iter().map(behind)).collect();
            push(Command::Lrw, start, outputs_len + inputs_len, all);
        } else {
            push(Command::Lwr, start, outputs_len, outputs);
            push(Command::Lrd, inputs_start, inputs_len, inputs);
        }
        Ok(())
    }

    /// The frames of the task: inputs that are fetched separately first, everything else behind.
    fn frames(&self, datagrams: Vec<DatagramPlan>, devices: &[PlannedDevice]) -> Vec<FramePlan> {
        let mut frames = match self.task.separate_inputs {
            None => filled(datagrams),
            Some(ahead) => {
                let early = |one: &DatagramPlan| match one.role {
                    Role::ProcessData => one.command == Command::Lrd,
                    Role::Presence => false,
                    Role::LatchedTime
                    | Role::ReferenceClock
                    | Role::ClockShift
                    | Role::MailboxStates
                    | Role::Other => true,
                };
                let (inputs, others): (Vec<_>, Vec<_>) = datagrams.into_iter().partition(early);
                let early = filled(inputs).into_iter().map(|frame| FramePlan { ahead, ..frame });
                early.chain(filled(others)).collect()
            }
        };
        for frame in &mut frames {
            let mut owners = frame.datagrams.iter().flat_map(|datagram| &datagram.ownership);
            let allowed = owners.all(|owned| devices[owned.device.index()].settings.frame_repeat);
            frame.repeats = if allowed { self.task.repeats } else { 0 };
        }
        frames
    }
}

/// Distributes datagrams over frames in order, each as full as it gets.
fn filled(datagrams: Vec<DatagramPlan>) -> Vec<FramePlan> {
    let mut frames: Vec<FramePlan> = Vec::new();
    for datagram in datagrams {
        match frames.last_mut() {
            Some(frame) if frame.size() + datagram.len + DATAGRAM_OVERHEAD <= MAX_LEN => {
                frame.datagrams.push(datagram);
            }
            Some(_) | None => frames.push(FramePlan::new(vec![datagram])),
        }
    }
    frames
}

#[cfg(test)]
mod tests;
