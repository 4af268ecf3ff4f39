//! The expected working counter: a function of (datagram, who is present and serves what, path).
//!
//! Each SubDevice adds what `proto::command` says, at most once a direction. A constant would be
//! wrong the moment a SubDevice is taken away on purpose, is not in OP yet, or is reached over the
//! other card of an open ring.

use linesman_proto::address::{DeviceId, Path, WorkingCounter};
use linesman_proto::command::{Addressing, Command};
use linesman_proto::sii::Direction;

use super::DatagramPlan;

/// What a SubDevice does with process data right now.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct Served {
    /// The card over which frames reach its processing unit; `None` when none does.
    pub reached_by: Option<Path>,
    /// Its inputs are read: SyncManager and FMMU are set up, state SAFEOP or OP.
    pub inputs: bool,
    /// Its outputs are taken.
    pub outputs: bool,
}

impl Served {
    /// Reached over the main card, both directions at work.
    pub const FULL: Self = Self { reached_by: Some(Path::A), inputs: true, outputs: true };
}

/// Who is present, by [`DeviceId`].
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Presence {
    devices: Vec<Served>,
}

impl Presence {
    /// `count` SubDevices that are all present and serve all they have.
    #[must_use]
    pub fn full(count: usize) -> Self {
        Self { devices: vec![Served::FULL; count] }
    }

    /// `count` SubDevices of which none is there.
    #[must_use]
    pub fn none(count: usize) -> Self {
        Self { devices: vec![Served::default(); count] }
    }

    /// What a SubDevice does; nothing for one that is not of this network.
    #[must_use]
    pub fn of(&self, id: DeviceId) -> Served {
        self.devices.get(id.index()).copied().unwrap_or_default()
    }

    /// Notes what a SubDevice does; an unknown one is ignored.
    pub fn set(&mut self, id: DeviceId, served: Served) {
        if let Some(device) = self.devices.get_mut(id.index()) {
            *device = served;
        }
    }

    /// How many there are in the network, present or not.
    #[must_use]
    pub fn len(&self) -> usize {
        self.devices.len()
    }

    /// Whether the network has no SubDevices.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.devices.is_empty()
    }
}

/// Whose copy of a frame the working counter is of.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum PathView {
    /// The copies of both cards together.
    Merged,
    /// The copy that one card sent.
    SentBy(Path),
}

impl PathView {
    fn sees(self, served: Served) -> bool {
        match (self, served.reached_by) {
            (_, None) => false,
            (Self::Merged, Some(_)) => true,
            (Self::SentBy(path), Some(reached_by)) => path == reached_by,
        }
    }
}

/// The working counter that `datagram` must come back with.
#[must_use]
pub fn expect(datagram: &DatagramPlan, presence: &Presence, view: PathView) -> WorkingCounter {
    let sum = match datagram.command.addressing() {
        Addressing::Logical => logical(datagram, presence, view),
        Addressing::Broadcast => present(presence, view) * one(datagram.command),
        // The one that gives and all that take; a plan addresses only who is planned to be there.
        Addressing::Position | Addressing::Station if datagram.command.effect().multiple_write => {
            present(presence, view)
        }
        Addressing::Position | Addressing::Station => one(datagram.command),
        Addressing::None => 0,
    };
    WorkingCounter(sum)
}

/// What one SubDevice adds when all it is asked for succeeds.
fn one(command: Command) -> u16 {
    command.increment(true, true)
}

fn present(presence: &Presence, view: PathView) -> u16 {
    presence.devices.iter().filter(|served| view.sees(**served)).count() as u16
}

/// Sums over the owners of a logical datagram; each counts once a direction, however many ranges.
fn logical(datagram: &DatagramPlan, presence: &Presence, view: PathView) -> u16 {
    let mut sum = 0;
    for (at, ownership) in datagram.ownership.iter().enumerate() {
        let same = |other: &&super::Ownership| {
            other.device == ownership.device && other.direction == ownership.direction
        };
        // Owners are few and lie side by side: looking back is cheaper than keeping a set.
        if datagram.ownership[..at].iter().rev().any(|other| same(&other)) {
            continue;
        }
        let served = presence.of(ownership.device);
        if !view.sees(served) {
            continue;
        }
        sum += match ownership.direction {
            Direction::Inputs => datagram.command.increment(served.inputs, false),
            Direction::Outputs => datagram.command.increment(false, served.outputs),
        };
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::super::{Ownership, Role};
    use super::*;
    use linesman_proto::address::{LogicalAddress, RegisterAddress};
    use linesman_proto::frame::builder::DatagramAddress;

    fn process(command: Command, owners: &[(u32, Direction)]) -> DatagramPlan {
        let ownership = owners.iter().enumerate().map(|(at, (device, direction))| Ownership {
            device: DeviceId(*device),
            direction: *direction,
            range: at..at + 1,
            image_at: at,
            masks: Ownership::WHOLE,
        });
        DatagramPlan {
            command,
            address: DatagramAddress::Logical(LogicalAddress(0x0100_0000)),
            len: owners.len(),
            role: Role::ProcessData,
            sync_unit: Some(0),
            ownership: ownership.collect(),
        }
    }

    fn both(devices: std::ops::Range<u32>) -> Vec<(u32, Direction)> {
        devices.flat_map(|id| [(id, Direction::Outputs), (id, Direction::Inputs)]).collect()
    }

    // proves: FRM-15 partial, FRM-16 partial, FRM-26 partial
    #[test]
    fn working_counters_of_the_sources() {
        let table = [
            (Command::Lrw, both(0..1), 3),
            (Command::Lrw, both(0..8), 24),
            (Command::Lrw, both(0..7), 21),
            (Command::Lrw, both(0..4), 12),
            (Command::Lrd, (0..4).map(|id| (id, Direction::Inputs)).collect(), 4),
            (Command::Lwr, (0..2).map(|id| (id, Direction::Outputs)).collect(), 2),
        ];
        for (command, owners, expected) in table {
            let datagram = process(command, &owners);
            let presence = Presence::full(8);
            let wkc = expect(&datagram, &presence, PathView::Merged);
            assert_eq!(wkc, WorkingCounter(expected), "{command} {owners:?}");
        }
    }

    #[test]
    fn several_ranges_of_one_direction_count_once() {
        let owners = [(0, Direction::Inputs), (0, Direction::Inputs), (1, Direction::Inputs)];
        let datagram = process(Command::Lrd, &owners);
        let wkc = expect(&datagram, &Presence::full(2), PathView::Merged);
        assert_eq!(wkc, WorkingCounter(2));
    }

    #[test]
    fn it_changes_with_who_is_present_and_with_the_path() {
        let datagram = process(Command::Lrw, &both(0..4));
        let presence_monitor = DatagramPlan {
            command: Command::Brd,
            address: DatagramAddress::Physical(0, RegisterAddress(0x0130)),
            len: 2,
            role: Role::Presence,
            sync_unit: None,
            ownership: Vec::new(),
        };
        let counters = |presence: &Presence, view| {
            [expect(&datagram, presence, view).0, expect(&presence_monitor, presence, view).0]
        };
        let mut presence = Presence::full(4);
        assert_eq!(counters(&presence, PathView::Merged), [12, 4]);

        // One falls to SAFEOP with its outputs locked, one is gone.
        presence.set(DeviceId(1), Served { outputs: false, ..Served::FULL });
        presence.set(DeviceId(3), Served::default());
        assert_eq!(counters(&presence, PathView::Merged), [3 + 1 + 3, 3]);

        // The ring opens between the first two: the rest is reached over card B.
        presence.set(DeviceId(2), Served { reached_by: Some(Path::B), ..Served::FULL });
        assert_eq!(counters(&presence, PathView::SentBy(Path::A)), [3 + 1, 2]);
        assert_eq!(counters(&presence, PathView::SentBy(Path::B)), [3, 1]);
        assert_eq!(counters(&presence, PathView::Merged), [7, 3]);
    }
}
