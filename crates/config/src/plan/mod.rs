//! Plan, made from project and inventory: addresses, SyncManagers, FMMUs, frames, and the working
//! counter that each datagram must come back with.
//!
//! A plan is of one network. Tasks have sync units; a task's frames carry datagrams; every byte of
//! a logical datagram is owned by one SubDevice and direction ([`Ownership`]), so that a missing
//! counter can be explained and two copies of a frame can be merged. The expected working counter
//! is never a number here but a function: see [`expect`].

mod cable;
mod cycle;
pub mod ethernet;
mod exchange;
pub mod expect;
mod hot_connect;
mod info_data;
pub mod layout;
pub mod lint;
pub mod reference;
pub mod settings;
mod shift;
pub mod task;
pub mod time_source;
pub mod timing;
pub mod variable;

#[cfg(test)]
mod tables;

use std::ops::Range;

use linesman_proto::address::{DeviceId, StationAddress};
use linesman_proto::ads::AmsNetId;
use linesman_proto::port::PortMap;
use linesman_proto::register::{FmmuConfig, SyncManagerConfig};
use linesman_proto::sii::{Identity, PortKind};
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use linesman_proto::topology::Tree;

use crate::identity::RevisionRule;
use crate::profile::{DeviceProfile, Mailbox, SyncTimes};
use crate::start_up::StartUpCommand;

pub use cable::PlannedCable;
pub use cycle::CycleError;
pub use exchange::{PlannedCounter, PlannedExchange};
pub use expect::{PathView, Presence, Served};
pub use hot_connect::{HotConnectGroup, IdentificationCheck, IdentificationSource};
pub use info_data::{InfoData, configuration_object};
pub use layout::{PlanError, PlanOptions};
pub use lint::{Doubt, Severity};
pub use settings::{
    AddressingChoice, AutomaticActions, ClockSettings, DeviceSettings, OnWrongCounter,
    ProcessAccess, WatchdogSettings,
};
pub use shift::ShiftReference;
pub use task::{DatagramPlan, FramePlan, IoAt, Ownership, Role, SyncUnit, Task};
pub use time_source::{StampPair, TimeSource, TimeStampPlace};
pub use variable::Variable;

/// A SubDevice that the plan is made for.
#[derive(Clone, Debug)]
pub struct PlannedDevice {
    /// Name for people, unique in the network.
    pub name: String,
    /// Station address it shall have.
    pub station: StationAddress,
    /// Who it must be.
    pub identity: Identity,
    /// How its revision is compared.
    pub revision_rule: RevisionRule,
    /// What it needs.
    pub profile: DeviceProfile,
    /// How far it is to be driven.
    pub target: AlState,
    /// What it is told on its way, in order.
    pub start_up: Vec<StartUpCommand>,
    /// What the user chose for it.
    pub settings: DeviceSettings,
}

/// Everything the MainDevice needs to run one network.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Plan {
    /// The SubDevices, by [`DeviceId`]: in the order in which the whole line is processed.
    pub devices: Vec<DevicePlan>,
    /// How they are wired.
    pub tree: Tree,
    /// What is exchanged cyclically.
    pub tasks: Vec<Task>,
    /// Bytes of outputs in the process image.
    pub outputs_len: usize,
    /// Bytes of inputs in the process image.
    pub inputs_len: usize,
    /// What the bits of the process image are called, outputs first, in the order of their places.
    pub variables: Vec<Variable>,
    /// The shift of the outputs, where it was chosen; see [`Plan::outputs_shift`].
    pub outputs_shift: Option<Span>,
    /// The shift of the inputs in ns, where it was chosen; see [`Plan::inputs_shift_ns`].
    pub inputs_shift_ns: Option<i64>,
    /// How far a clock may be off the reference clock (0x092C) before that is told (DC-21); `None`: as far as
    /// the MainDevice lets it be before OP.
    pub sync_window: Option<Span>,
    /// Whose time the network has; `None`: its reference clock's, unless another network of the process leads.
    pub time_source: Option<TimeSource>,
    /// Where the time stamps of the SubDevice lie that tells the time outside, if there is one.
    pub time_stamps: Option<TimeStampPlace>,
    /// The base time: cycles and earlier fetches are whole numbers of it (SYN-16).
    pub base_tick: Span,
    /// Ports whose link was lost stay closed until they are ordered to open (JCT-12).
    pub ports_open_by_order: bool,
    /// Once the line has no link any more, outputs are withheld until the network is reset (PLC-07).
    pub lock_after_link_error: bool,
    /// Groups that join and leave while the network runs.
    pub groups: Vec<HotConnectGroup>,
    /// What is said of the clocks of its ring.
    pub ring_clocks: RingClocks,
}

/// What a project says of the clocks of its ring (RED-12).
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct RingClocks {
    /// The ports of a port multiplier (CU2508) at which the ring begins and ends, counted from 1; `None`: it hangs at
    /// cards.
    pub port_multiplier: Option<[u8; 2]>,
    /// Clocks in the ring without a port multiplier are an error.
    pub need_port_multiplier: bool,
}

/// What one SubDevice is set up with.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct DevicePlan {
    /// Who it is within this run.
    pub id: DeviceId,
    /// Name for people.
    pub name: String,
    /// Order designation, such as `EL2004`; may be empty.
    pub type_name: String,
    /// Station address.
    pub station: StationAddress,
    /// Who it must be.
    pub identity: Identity,
    /// How its revision is compared.
    pub revision_rule: RevisionRule,
    /// Mailbox, if it has one.
    pub mailbox: Option<Mailbox>,
    /// SyncManagers for process data by number; mailbox ones follow from `mailbox`.
    pub sync_managers: Vec<(u8, SyncManagerConfig)>,
    /// FMMUs by number.
    pub fmmus: Vec<(u8, FmmuConfig)>,
    /// The FMMU that maps the full bit of its mailbox for [`Role::MailboxStates`], by number. It is
    /// set up before PREOP.
    pub mailbox_state: Option<(u8, FmmuConfig)>,
    /// AL status mirrors AL control: no acknowledge bit is sent.
    pub device_emulation: bool,
    /// How far it is driven.
    pub target: AlState,
    /// What it is told on its way, in order.
    pub start_up: Vec<StartUpCommand>,
    /// Where its outputs lie in the process image, in bytes.
    pub outputs: Range<usize>,
    /// Where its inputs lie in the process image, in bytes.
    pub inputs: Range<usize>,
    /// What the user chose for it.
    pub settings: DeviceSettings,
    /// Current from the E-bus in mA; negative supplies. `None`: not said.
    pub ebus_current_ma: Option<i16>,
    /// What its ports are; `None`: not said.
    pub ports: Option<PortMap<PortKind>>,
    /// What it needs for its work in a cycle, as far as that is known.
    pub sync_times: SyncTimes,
    /// Numbers of its drive channels, from 0; empty for all but drives.
    pub channels: Vec<u8>,
}

impl DevicePlan {
    /// A SubDevice without process data and mailbox that is driven to OP, at the default station
    /// address of its number.
    #[must_use]
    pub fn bare(id: DeviceId) -> Self {
        Self {
            id,
            name: id.no().to_string(),
            type_name: String::new(),
            station: StationAddress(0x1000_u16.wrapping_add(id.no() as u16)),
            identity: Identity::default(),
            revision_rule: RevisionRule::default(),
            mailbox: None,
            sync_managers: Vec::new(),
            fmmus: Vec::new(),
            mailbox_state: None,
            device_emulation: false,
            target: AlState::Op,
            start_up: Vec::new(),
            outputs: 0..0,
            inputs: 0..0,
            settings: DeviceSettings::default(),
            ebus_current_ma: None,
            ports: None,
            sync_times: SyncTimes::default(),
            channels: Vec::new(),
        }
    }

    /// Its NetId, for AoE: what a start-up command gives it, else what its configuration says; `None`: nobody says.
    #[must_use]
    pub fn net_id(&self) -> Option<AmsNetId> {
        let given = self.start_up.iter().rev().find_map(|command| command.action.net_id());
        given.or(self.settings.net_id)
    }
}

impl Plan {
    /// A plan without SubDevices, to be filled.
    #[must_use]
    pub const fn empty(tree: Tree) -> Self {
        Self {
            devices: Vec::new(),
            tree,
            tasks: Vec::new(),
            outputs_len: 0,
            inputs_len: 0,
            variables: Vec::new(),
            outputs_shift: None,
            inputs_shift_ns: None,
            sync_window: None,
            time_source: None,
            time_stamps: None,
            base_tick: Span::ms(1),
            ports_open_by_order: false,
            lock_after_link_error: false,
            groups: Vec::new(),
            ring_clocks: RingClocks { port_multiplier: None, need_port_multiplier: false },
        }
    }

    /// Whose clock all others follow: the one that was chosen, else the first with a clock that is used and that
    /// is not in a group that may be absent, else the first with a clock that is used.
    #[must_use]
    pub fn reference_clock(&self) -> Option<DeviceId> {
        let clocked = || self.devices.iter().filter(|device| device.settings.clock.is_some());
        let chosen = |device: &&DevicePlan| device.settings.clock.is_some_and(|one| one.reference);
        let stays = |device: &&DevicePlan| !self.is_optional(device.id);
        let first = clocked().find(chosen).or_else(|| clocked().find(stays));
        first.or_else(|| clocked().next()).map(|device| device.id)
    }

    /// The plan of a SubDevice; `None` for an identity that is not of this plan.
    #[must_use]
    pub fn device(&self, id: DeviceId) -> Option<&DevicePlan> {
        self.devices.get(id.index())
    }

    /// All cyclic datagrams with the index of their task and frame.
    pub fn datagrams(&self) -> impl Iterator<Item = (usize, usize, &DatagramPlan)> {
        self.tasks.iter().enumerate().flat_map(|(task_index, task)| {
            task.frames.iter().enumerate().flat_map(move |(frame_index, frame)| {
                frame.datagrams.iter().map(move |datagram| (task_index, frame_index, datagram))
            })
        })
    }
}
