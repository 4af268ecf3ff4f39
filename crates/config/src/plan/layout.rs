//! Laying out the logical space: which SubDevice's process data lie where, in which datagram of
//! which frame, and the FMMUs that follow.
//!
//! SubDevices are taken in their order and grouped until a datagram is full; a group's outputs come
//! first, its inputs behind them, so that one LRW serves both. Those that cannot take LRW get LWR
//! and LRD instead. No SubDevice's data are split over two datagrams: they would be of two cycles.

use std::ops::Range;

use linesman_proto::address::{DeviceId, LogicalAddress, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::ethernet::MAX_LEN;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::frame::{DATAGRAM_OVERHEAD, MAX_DATAGRAM_DATA};
use linesman_proto::register::{AL_STATUS, FmmuConfig, SyncManagerConfig};
use linesman_proto::sii::Direction;
use linesman_proto::time::Span;
use linesman_proto::topology::Tree;

use super::{
    DatagramPlan, DevicePlan, FramePlan, IoAt, Ownership, Plan, PlannedDevice, Role, SyncUnit, Task,
};
use crate::profile::ProcessSyncManager;

/// Where the process data of the first task begin in the logical space.
pub const LOGICAL_START: LogicalAddress = LogicalAddress(0x0100_0000);

/// Choices that the SubDevices leave open.
#[derive(Clone, Debug)]
pub struct PlanOptions {
    /// Cycle time of the one task.
    pub cycle: Span,
    /// LRD and LWR for all, as a ring over two cards prefers when a SubDevice's data must not mix.
    pub separate_directions: bool,
}

impl Default for PlanOptions {
    fn default() -> Self {
        Self { cycle: Span::ms(1), separate_directions: false }
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
            ..Self::empty(tree)
        };
        let mut layout = Layout { next: LOGICAL_START, datagrams: Vec::new() };
        for group in groups(devices, options)? {
            layout.place(&group, devices, &mut plan);
        }
        let sync_unit = SyncUnit { name: "<default>".to_owned(), devices: layout.owners() };
        layout.datagrams.push(presence_monitor());
        plan.tasks.push(Task {
            name: "cyclic".to_owned(),
            cycle: options.cycle,
            io_at: IoAt::default(),
            sync_units: vec![sync_unit],
            frames: frames(layout.datagrams),
        });
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
        settings: planned.settings.clone(),
        ebus_current_ma: planned.profile.ebus_current_ma,
        ports: planned.profile.ports,
        ..DevicePlan::bare(DeviceId(id))
    }
}

/// The broadcast read of the AL status that closes the last frame: its working counter says how
/// many SubDevices the frame reached.
fn presence_monitor() -> DatagramPlan {
    DatagramPlan {
        command: Command::Brd,
        address: DatagramAddress::Physical(0, AL_STATUS.address),
        len: 2,
        role: Role::Presence,
        sync_unit: None,
        ownership: Vec::new(),
    }
}

/// SubDevices that share datagrams.
struct Group {
    members: Vec<usize>,
    lrw: bool,
}

fn groups(devices: &[PlannedDevice], options: &PlanOptions) -> Result<Vec<Group>, PlanError> {
    let mut groups: Vec<Group> = Vec::new();
    // One group of each kind is being filled; `open` holds its index and length.
    let mut open: [Option<(usize, usize)>; 2] = [None; 2];
    for (index, device) in devices.iter().enumerate() {
        let outputs = device.profile.process_len(Direction::Outputs);
        let inputs = device.profile.process_len(Direction::Inputs);
        let len = outputs + inputs;
        if len == 0 {
            continue;
        }
        if len > MAX_DATAGRAM_DATA {
            return Err(PlanError::TooMuchProcessData { name: device.name.clone(), len });
        }
        let lrw = !(options.separate_directions || device.profile.no_lrw);
        let slot = &mut open[usize::from(lrw)];
        match slot {
            Some((group, used)) if *used + len <= MAX_DATAGRAM_DATA => {
                groups[*group].members.push(index);
                *used += len;
            }
            Some(_) | None => {
                *slot = Some((groups.len(), len));
                groups.push(Group { members: vec![index], lrw });
            }
        }
    }
    Ok(groups)
}

/// The logical space as it is being filled.
struct Layout {
    next: LogicalAddress,
    datagrams: Vec<DatagramPlan>,
}

impl Layout {
    fn place(&mut self, group: &Group, devices: &[PlannedDevice], plan: &mut Plan) {
        let start = self.next;
        let mut ownership = [Vec::new(), Vec::new()];
        for (owned, direction) in ownership.iter_mut().zip([Direction::Outputs, Direction::Inputs])
        {
            for &member in &group.members {
                let managers = &devices[member].profile.process;
                for area in areas(managers, direction) {
                    let at = (self.next.0 - start.0) as usize;
                    owned.push(plan.map(member, direction, &area, self.next, at));
                    self.next = LogicalAddress(self.next.0 + u32::from(area.len));
                }
            }
        }
        let [outputs, inputs] = ownership;
        let outputs_len: usize = outputs.iter().map(|owned| owned.range.len()).sum();
        let whole = (self.next.0 - start.0) as usize;
        if group.lrw {
            let command = match (outputs.is_empty(), inputs.is_empty()) {
                (false, false) => Command::Lrw,
                (false, true) => Command::Lwr,
                (true, _) => Command::Lrd,
            };
            let all = outputs.into_iter().chain(inputs).collect();
            self.push(command, start, whole, all);
        } else {
            let shift = |mut owned: Ownership| {
                owned.range = owned.range.start - outputs_len..owned.range.end - outputs_len;
                owned
            };
            let inputs: Vec<Ownership> = inputs.into_iter().map(shift).collect();
            let inputs_start = LogicalAddress(start.0 + outputs_len as u32);
            self.push(Command::Lwr, start, outputs_len, outputs);
            self.push(Command::Lrd, inputs_start, whole - outputs_len, inputs);
        }
    }

    fn push(
        &mut self,
        command: Command,
        start: LogicalAddress,
        len: usize,
        ownership: Vec<Ownership>,
    ) {
        if len > 0 {
            let address = DatagramAddress::Logical(start);
            self.datagrams.push(DatagramPlan {
                command,
                address,
                len,
                role: Role::ProcessData,
                sync_unit: Some(0),
                ownership,
            });
        }
    }

    fn owners(&self) -> Vec<DeviceId> {
        let owners = self.datagrams.iter().flat_map(|datagram| &datagram.ownership);
        let mut ids: Vec<DeviceId> = owners.map(|owned| owned.device).collect();
        ids.sort_unstable();
        ids.dedup();
        ids
    }
}

/// A stretch of a controller's memory that one FMMU maps.
struct Area {
    start: RegisterAddress,
    len: u16,
}

/// The process data of one direction, SyncManagers that lie side by side joined: a terminal with
/// two one-byte SyncManagers in a row needs one FMMU only, and may have no more.
fn areas(managers: &[ProcessSyncManager], direction: Direction) -> Vec<Area> {
    let mut areas: Vec<Area> = Vec::new();
    let mine = managers.iter().filter(|manager| manager.direction == direction && manager.len > 0);
    for manager in mine {
        match areas.last_mut() {
            // Only unbuffered (one-byte) SyncManagers end where the next begins.
            Some(last) if last.start.0.checked_add(last.len) == Some(manager.start.0) => {
                last.len += manager.len;
            }
            Some(_) | None => areas.push(Area { start: manager.start, len: manager.len }),
        }
    }
    areas
}

impl Plan {
    /// Gives `area` of device `member` its FMMU at `logical` and its place in the process image.
    fn map(
        &mut self,
        member: usize,
        direction: Direction,
        area: &Area,
        logical: LogicalAddress,
        at: usize,
    ) -> Ownership {
        let len = usize::from(area.len);
        let device = &mut self.devices[member];
        let fmmu = match direction {
            Direction::Outputs => FmmuConfig::outputs(logical, area.len, area.start),
            Direction::Inputs => FmmuConfig::inputs(logical, area.len, area.start),
        };
        device.fmmus.push((device.fmmus.len() as u8, fmmu));
        let (image_len, mine) = match direction {
            Direction::Outputs => (&mut self.outputs_len, &mut device.outputs),
            Direction::Inputs => (&mut self.inputs_len, &mut device.inputs),
        };
        let image_at = *image_len;
        *image_len += len;
        extend(mine, image_at, len);
        Ownership {
            device: device.id,
            direction,
            range: at..at + len,
            image_at,
            masks: Ownership::WHOLE,
        }
    }
}

fn extend(range: &mut Range<usize>, at: usize, len: usize) {
    if range.start == range.end {
        range.start = at;
    }
    range.end = at + len;
}

/// Distributes datagrams over frames in order, each as full as it gets.
fn frames(datagrams: Vec<DatagramPlan>) -> Vec<FramePlan> {
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
mod tests {
    use super::super::{DeviceSettings, PathView, Presence, expect};
    use super::*;
    use crate::identity::RevisionRule;
    use crate::profile::DeviceProfile;
    use linesman_proto::address::{Path, StationAddress, WorkingCounter};
    use linesman_proto::port::Port;
    use linesman_proto::register::SmControl;
    use linesman_proto::sii::Identity;
    use linesman_proto::state::AlState;
    use linesman_proto::topology::{End, Wired};
    use proptest::prelude::*;

    fn manager(index: u8, direction: Direction, start: u16, len: u16) -> ProcessSyncManager {
        let control = SmControl(0x20);
        let (start, is_virtual) = (RegisterAddress(start), false);
        ProcessSyncManager { index, direction, start, len, control, is_virtual }
    }

    fn planned(process: Vec<ProcessSyncManager>, no_lrw: bool) -> PlannedDevice {
        PlannedDevice {
            name: format!("{} managers", process.len()),
            station: StationAddress(0x1001),
            identity: Identity::default(),
            revision_rule: RevisionRule::Equal,
            profile: DeviceProfile { process, no_lrw, ..DeviceProfile::default() },
            target: AlState::Op,
            settings: DeviceSettings::default(),
        }
    }

    fn line(len: usize) -> Tree {
        let wired = (0..len).map(|node| Wired {
            on: match node.checked_sub(1) {
                Some(before) => End::Controller(before, Port::B),
                None => End::MainDevice(Path::A),
            },
            entry: Port::A,
        });
        Tree::from_wiring(&wired.collect::<Vec<_>>(), None).unwrap()
    }

    #[test]
    fn outputs_first_then_inputs_in_one_lrw() {
        let devices = [
            planned(vec![], false),
            planned(vec![manager(0, Direction::Outputs, 0x0F00, 1)], false),
            planned(
                vec![
                    manager(2, Direction::Outputs, 0x1100, 8),
                    manager(3, Direction::Inputs, 0x1180, 6),
                ],
                false,
            ),
        ];
        let plan = Plan::build(&devices, line(3), &PlanOptions::default()).unwrap();
        assert_eq!((plan.outputs_len, plan.inputs_len), (9, 6));
        let [frame] = plan.tasks[0].frames.as_slice() else { panic!("one frame") };
        let [process, monitor] = frame.datagrams.as_slice() else { panic!("two datagrams") };
        assert_eq!((process.command, process.len), (Command::Lrw, 15));
        assert_eq!(monitor.command, Command::Brd);
        let wkc = expect::expect(process, &Presence::full(3), PathView::Merged);
        assert_eq!(wkc, WorkingCounter(2 + 3));
        let fmmu = plan.devices[2].fmmus[1].1;
        assert_eq!(fmmu.logical_start, LogicalAddress(LOGICAL_START.0 + 9));
        assert_eq!(plan.devices[2].inputs, 0..6);
        assert_eq!(plan.devices[2].outputs, 1..9);
    }

    #[test]
    fn neighbouring_byte_buffers_share_an_fmmu() {
        let managers = vec![
            manager(0, Direction::Outputs, 0x0F00, 1),
            manager(1, Direction::Outputs, 0x0F01, 1),
        ];
        let plan =
            Plan::build(&[planned(managers, false)], line(1), &PlanOptions::default()).unwrap();
        assert_eq!(plan.devices[0].fmmus.len(), 1);
        assert_eq!(plan.devices[0].fmmus[0].1.length, 2);
        assert_eq!(plan.devices[0].sync_managers.len(), 2);
    }

    // proves: FRM-26 partial
    #[test]
    fn a_device_without_lrw_gets_lwr_and_lrd() {
        let both = || {
            vec![
                manager(2, Direction::Outputs, 0x1100, 4),
                manager(3, Direction::Inputs, 0x1180, 4),
            ]
        };
        let devices = [planned(both(), true), planned(both(), false)];
        let plan = Plan::build(&devices, line(2), &PlanOptions::default()).unwrap();
        let commands: Vec<(Command, u16)> = plan
            .datagrams()
            .map(|(_, _, datagram)| {
                let wkc = expect::expect(datagram, &Presence::full(2), PathView::Merged);
                (datagram.command, wkc.0)
            })
            .collect();
        let expected = [(Command::Lwr, 1), (Command::Lrd, 1), (Command::Lrw, 3), (Command::Brd, 2)];
        assert_eq!(commands, expected);
    }

    #[test]
    fn what_no_datagram_can_carry_is_refused() {
        let devices = [planned(vec![manager(2, Direction::Outputs, 0x1100, 1_487)], false)];
        let error = Plan::build(&devices, line(1), &PlanOptions::default()).unwrap_err();
        assert!(matches!(error, PlanError::TooMuchProcessData { len: 1_487, .. }));
        let error = Plan::build(&devices, line(2), &PlanOptions::default()).unwrap_err();
        assert_eq!(error, PlanError::WiringDiffers { wired: 2, planned: 1 });
    }

    proptest! {
        #[test]
        fn nothing_overlaps_and_everything_is_mapped(
            sizes in prop::collection::vec((0u16..300, 0u16..300, any::<bool>()), 1..60)
        ) {
            let devices: Vec<PlannedDevice> = sizes.iter().map(|(out, inp, no_lrw)| {
                planned(vec![
                    manager(2, Direction::Outputs, 0x1100, *out),
                    manager(3, Direction::Inputs, 0x1800, *inp),
                ], *no_lrw)
            }).collect();
            let plan =
                Plan::build(&devices, line(devices.len()), &PlanOptions::default()).unwrap();
            let mut logical = std::collections::BTreeMap::new();
            let (mut outputs, mut inputs) = (0, 0);
            for (_, _, datagram) in plan.datagrams() {
                prop_assert!(datagram.len <= MAX_DATAGRAM_DATA);
                let DatagramAddress::Logical(start) = datagram.address else { continue };
                let mut covered = 0;
                for owned in &datagram.ownership {
                    prop_assert_eq!(owned.range.start, covered);
                    covered = owned.range.end;
                    for byte in owned.range.clone() {
                        let address = start.0 + byte as u32;
                        prop_assert!(logical.insert(address, owned.device).is_none());
                    }
                    match owned.direction {
                        Direction::Outputs => outputs += owned.range.len(),
                        Direction::Inputs => inputs += owned.range.len(),
                    }
                }
                prop_assert_eq!(covered, datagram.len);
            }
            prop_assert_eq!((outputs, inputs), (plan.outputs_len, plan.inputs_len));
            for device in &plan.devices {
                for (_, fmmu) in &device.fmmus {
                    for byte in 0..u32::from(fmmu.length) {
                        let owner = logical.get(&(fmmu.logical_start.0 + byte));
                        prop_assert_eq!(owner, Some(&device.id));
                    }
                }
            }
            for frame in plan.tasks.iter().flat_map(|task| &task.frames) {
                prop_assert!(frame.size() <= MAX_LEN);
            }
        }
    }
}
