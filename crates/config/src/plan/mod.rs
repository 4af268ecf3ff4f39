//! What follows from what was wanted and what is there: addresses, SyncManagers, FMMUs, frames, and
//! which working counter each datagram must come back with.
//!
//! A plan is of one network. Tasks have sync units; a task's frames carry datagrams; every byte of
//! a logical datagram is owned by one SubDevice and direction ([`Ownership`]), so that a missing
//! counter can be explained and two copies of a frame can be merged. The expected working counter
//! is never a number here but a function: see [`expect`].

pub mod expect;
pub mod layout;

use std::ops::Range;

use linesman_proto::address::{DeviceId, StationAddress};
use linesman_proto::command::Command;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::frame::size::frame_size;
use linesman_proto::register::{FmmuConfig, SyncManagerConfig};
use linesman_proto::sii::{Direction, Identity};
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use linesman_proto::topology::Tree;

use crate::identity::RevisionRule;
use crate::profile::{DeviceProfile, Mailbox};
use crate::start_up::StartUpCommand;

pub use expect::{PathView, Presence, Served};
pub use layout::{PlanError, PlanOptions};

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
}

/// Everything the MainDevice needs to run one network.
#[derive(Clone, Debug)]
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
}

/// What one SubDevice is set up with.
#[derive(Clone, Debug)]
pub struct DevicePlan {
    /// Who it is within this run.
    pub id: DeviceId,
    /// Name for people.
    pub name: String,
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
}

/// What is exchanged with one cycle time.
#[derive(Clone, Debug)]
pub struct Task {
    /// Name for people.
    pub name: String,
    /// Cycle time.
    pub cycle: Span,
    /// SubDevices whose data are good or bad together.
    pub sync_units: Vec<SyncUnit>,
    /// Frames sent every cycle, in order.
    pub frames: Vec<FramePlan>,
}

/// SubDevices of one task whose process data travel in datagrams of their own.
#[derive(Clone, Debug)]
pub struct SyncUnit {
    /// Name for people.
    pub name: String,
    /// Who belongs to it.
    pub devices: Vec<DeviceId>,
}

/// One cyclic frame.
#[derive(Clone, Debug)]
pub struct FramePlan {
    /// Its datagrams, in order.
    pub datagrams: Vec<DatagramPlan>,
}

impl FramePlan {
    /// Size in bytes without padding and check sequence.
    #[must_use]
    pub fn size(&self) -> usize {
        frame_size(self.datagrams.iter().map(|datagram| datagram.len))
    }
}

/// One cyclic datagram.
#[derive(Clone, Debug)]
pub struct DatagramPlan {
    /// What it asks.
    pub command: Command,
    /// Whom.
    pub address: DatagramAddress,
    /// Length of its data in bytes.
    pub len: usize,
    /// Index in [`Task::sync_units`]; `None` when it carries no process data.
    pub sync_unit: Option<usize>,
    /// Who owns which bytes; empty when it carries no process data.
    pub ownership: Vec<Ownership>,
}

/// A range of a datagram's data and whose it is.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Ownership {
    /// Whose.
    pub device: DeviceId,
    /// Outputs are written by the MainDevice, inputs come from the SubDevice.
    pub direction: Direction,
    /// Bytes within the datagram's data.
    pub range: Range<usize>,
    /// Where these bytes begin in the outputs or inputs of the process image.
    pub image_at: usize,
}

impl Plan {
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
