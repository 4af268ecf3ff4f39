//! The check of working counters: what came back against who could be reached.

use linesman_config::plan::Plan;
use linesman_proto::address::DeviceId;
use linesman_proto::command::{Addressing, Command};
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::frame::view::Datagram;
use linesman_proto::register::AL_STATUS;
use linesman_proto::sii::Direction;
use linesman_proto::time::Instant;

/// A working counter that came back.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Returned {
    /// When it arrived.
    pub at: Instant,
    /// Number of the frame in the run.
    pub frame: u64,
    /// What it was of.
    pub kind: Kind,
    /// Its value.
    pub counter: u16,
}

/// The datagrams that are checked.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Kind {
    /// The broadcast read of the AL status: everyone counts.
    Broadcast,
    /// A logical datagram, by its address.
    Logical(u32),
}

impl Kind {
    /// What a datagram is, if it is one that is checked.
    #[must_use]
    pub fn of(datagram: &Datagram<'_>) -> Option<Self> {
        let command = datagram.command()?;
        match command.addressing() {
            Addressing::Logical => Some(Self::Logical(datagram.logical().0)),
            Addressing::Broadcast => {
                let read = command == Command::Brd && datagram.ado() == AL_STATUS.address;
                read.then_some(Self::Broadcast)
            }
            Addressing::Position | Addressing::Station | Addressing::None => None,
        }
    }
}

/// The value that must come back when the nodes in `reached` are there, and those of the plan that
/// are `served` serve all they have; `None` for a datagram that is not of the plan.
///
/// It counts by hand: a broadcast one for each, a logical read one, a write one, both three.
#[must_use]
pub fn expected(
    kind: Kind,
    plan: &Plan,
    reached: &[bool],
    served: impl Fn(DeviceId) -> bool,
) -> Option<u16> {
    match kind {
        Kind::Broadcast => Some(reached.iter().filter(|reached| **reached).count() as u16),
        Kind::Logical(address) => {
            let (.., datagram) = plan.datagrams().find(|(.., datagram)| {
                matches!(datagram.address, DatagramAddress::Logical(at) if at.0 == address)
            })?;
            let written = if datagram.command == Command::Lrw { 2 } else { 1 };
            let mut sum = 0;
            for device in plan.devices.iter().filter(|device| served(device.id)) {
                let has = |direction| {
                    let mut owners = datagram.ownership.iter();
                    owners.any(|own| own.device == device.id && own.direction == direction)
                };
                sum += u16::from(has(Direction::Inputs));
                sum += if has(Direction::Outputs) { written } else { 0 };
            }
            Some(sum)
        }
    }
}
