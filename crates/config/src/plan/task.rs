//! Cyclic exchange of a plan: tasks, their sync units, frames, datagrams, and who owns which bytes.

use std::ops::Range;

use linesman_proto::address::DeviceId;
use linesman_proto::command::Command;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::frame::size::{frame_size, wire_time};
use linesman_proto::sii::Direction;
use linesman_proto::time::Span;
use serde::{Deserialize, Serialize};

/// What is exchanged with one cycle time.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Task {
    /// Name for people.
    pub name: String,
    /// Cycle time.
    pub cycle: Span,
    /// When its frames leave, in relation to the application.
    pub io_at: IoAt,
    /// SubDevices whose data are good or bad together.
    pub sync_units: Vec<SyncUnit>,
    /// Frames sent every cycle, in order.
    pub frames: Vec<FramePlan>,
}

/// When the frames of a task leave (SYN-13, SYN-14).
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum IoAt {
    /// When the cycle begins, with the outputs of the last one: steady, for motion.
    #[default]
    TaskBegin,
    /// When the application has finished: the freshest outputs, for logic.
    TaskEnd,
}

/// SubDevices of one task whose process data travel in datagrams of their own.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct SyncUnit {
    /// Name for people.
    pub name: String,
    /// Who belongs to it.
    pub devices: Vec<DeviceId>,
}

/// One cyclic frame.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct FramePlan {
    /// Its datagrams, in order.
    pub datagrams: Vec<DatagramPlan>,
    /// How much earlier it leaves than the other frames of its task: inputs that are fetched
    /// separately (SYN-15).
    pub ahead: Span,
    /// How often it is sent again at once, so that one lost copy costs nothing (FRM-27).
    pub repeats: u8,
}

impl FramePlan {
    /// A frame that is sent once, with its task.
    #[must_use]
    pub fn new(datagrams: Vec<DatagramPlan>) -> Self {
        Self { datagrams, ahead: Span::ZERO, repeats: 0 }
    }

    /// True if one of its datagrams is for this.
    #[must_use]
    pub fn has(&self, role: Role) -> bool {
        self.datagrams.iter().any(|datagram| datagram.role == role)
    }

    /// Size in bytes without padding and check sequence.
    #[must_use]
    pub fn size(&self) -> usize {
        frame_size(self.datagrams.iter().map(|datagram| datagram.len))
    }

    /// Time that all its copies hold the wire.
    #[must_use]
    pub fn wire_time(&self) -> Span {
        wire_time(self.size()) * (u64::from(self.repeats) + 1)
    }
}

/// One cyclic datagram.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct DatagramPlan {
    /// What it asks.
    pub command: Command,
    /// Whom.
    pub address: DatagramAddress,
    /// Length of its data in bytes.
    pub len: usize,
    /// What it is for.
    pub role: Role,
    /// Index in [`Task::sync_units`]; `None` when it carries no process data.
    pub sync_unit: Option<usize>,
    /// Who owns which bytes; empty when it carries no process data.
    pub ownership: Vec<Ownership>,
}

/// What a cyclic datagram is for.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Role {
    /// Outputs and inputs; its working counter is judged.
    ProcessData,
    /// The broadcast read of AL status: how many are there, and in which states.
    Presence,
    /// A place for the latched receive time (NOP at 0x0900).
    LatchedTime,
    /// Spreads the time of the reference clock (ARMW or FRMW at 0x0910).
    ReferenceClock,
    /// Shifts the reference clock to that of the MainDevice (write at 0x0910).
    ClockShift,
    /// Reads the bits that say which mailboxes hold something: bit *n* is that of the *n*th SubDevice
    /// with a [`mailbox_state`](super::DevicePlan::mailbox_state).
    MailboxStates,
    /// Something that an imported configuration wants on the wire.
    Other,
}

impl Role {
    /// Whether a wrong working counter of such a datagram means anything. Clocks and mailbox bits are
    /// answered by whoever has them, in whatever state it is.
    #[must_use]
    pub const fn is_judged(self) -> bool {
        match self {
            Self::ProcessData | Self::Presence => true,
            Self::LatchedTime
            | Self::ReferenceClock
            | Self::ClockShift
            | Self::MailboxStates
            | Self::Other => false,
        }
    }
}

/// A range of a datagram's data and whose it is.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Ownership {
    /// Whose.
    pub device: DeviceId,
    /// Outputs are written by the MainDevice, inputs come from the SubDevice. Both may own the same
    /// bytes of an LRW: what is written is taken out on the way, what is read put in its place.
    pub direction: Direction,
    /// Bytes within the datagram's data.
    pub range: Range<usize>,
    /// Where these bytes begin in the outputs or inputs of the process image.
    pub image_at: usize,
    /// Which bits of the first and of the last byte are its: SubDevices with a few bits each share
    /// bytes. [`Ownership::WHOLE`] for whole bytes; of a range of one byte both hold.
    pub masks: [u8; 2],
}

impl Ownership {
    /// The masks of whole bytes.
    pub const WHOLE: [u8; 2] = [0xFF, 0xFF];

    /// Which bits of the byte at `at` within [`range`](Self::range) are its.
    #[must_use]
    pub fn mask_of(&self, at: usize) -> u8 {
        let [first, last] = self.masks;
        let begins = if at == 0 { first } else { 0xFF };
        let ends = if at + 1 == self.range.len() { last } else { 0xFF };
        begins & ends
    }

    /// Whether it owns whole bytes only.
    #[must_use]
    pub fn is_bytewise(&self) -> bool {
        self.masks == Self::WHOLE
    }
}
