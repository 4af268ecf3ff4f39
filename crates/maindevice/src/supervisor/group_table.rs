//! Hot connect groups as they are: who belongs to which, which are there, and where.

use std::collections::BTreeMap;

use linesman_config::plan::Plan;
use linesman_proto::address::DeviceId;
use linesman_proto::port::Port;

/// Where a group is plugged in: a port of a planned SubDevice.
pub type GroupPlace = (DeviceId, Port);

/// A group as it is.
#[derive(Clone, Copy, Default, Debug)]
struct GroupEntry {
    /// All of it have been at their targets since it was plugged in.
    joined: bool,
    /// Its first SubDevice answers.
    is_there: bool,
    place: Option<GroupPlace>,
    losses: u32,
}

/// Why a SubDevice, or a group, is not taken: told once, and again when it was gone meanwhile.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) enum NotTaken {
    /// It tells another number, or none.
    Number(Option<u32>),
    /// So many tell its number.
    Shared(u16),
    /// It is plugged in where it may not be.
    Place(Option<GroupPlace>),
}

/// The groups of a plan.
#[derive(Debug, Default)]
pub(crate) struct GroupTable {
    groups: Vec<GroupEntry>,
    /// The group of each SubDevice that is in one, and whether it may be absent.
    members: BTreeMap<DeviceId, (usize, bool)>,
    /// Who was not taken and why, with the search in which that was seen last.
    refusals: BTreeMap<(DeviceId, NotTaken), u64>,
    searches: u64,
}

impl GroupTable {
    pub(super) fn new(plan: &Plan) -> Self {
        let groups = vec![GroupEntry::default(); plan.groups.len()];
        let members = (plan.groups.iter().enumerate()).flat_map(|(at, group)| {
            group.members.iter().map(move |id| (*id, (at, group.optional)))
        });
        let members = members.collect();
        Self { groups, members, ..Self::default() }
    }

    /// The group that a SubDevice belongs to, by its index in the plan.
    pub(super) fn group_of(&self, id: DeviceId) -> Option<usize> {
        self.members.get(&id).map(|(group, _)| *group)
    }

    /// Whether a SubDevice may be absent.
    pub(super) fn is_optional(&self, id: DeviceId) -> bool {
        self.members.get(&id).is_some_and(|(_, optional)| *optional)
    }

    /// Notes where a group was found.
    pub(super) fn found(&mut self, group: usize, place: Option<GroupPlace>) {
        if let Some(entry) = self.groups.get_mut(group) {
            (entry.is_there, entry.place) = (true, place);
        }
    }

    /// Notes that all of a group are at their targets. Where it is, the first time since it came.
    pub(super) fn join(&mut self, group: usize) -> Option<Option<GroupPlace>> {
        let entry = self.groups.get_mut(group)?;
        (!std::mem::replace(&mut entry.joined, true)).then_some(entry.place)
    }

    /// Notes that the first SubDevice of a group is gone. True if it was there.
    pub(super) fn leave(&mut self, group: usize) -> bool {
        let Some(entry) = self.groups.get_mut(group) else { return false };
        let was_there = entry.is_there;
        *entry =
            GroupEntry { losses: entry.losses + u32::from(was_there), ..GroupEntry::default() };
        was_there
    }

    /// How often groups have left.
    pub(super) fn losses(&self) -> u32 {
        self.groups.iter().map(|entry| entry.losses).sum()
    }

    /// A search of the line begins.
    pub(super) fn begin_search(&mut self) {
        self.searches += 1;
        let last = self.searches - 1;
        self.refusals.retain(|_, seen| *seen >= last);
    }

    /// Notes why a SubDevice is not taken; true if that is news.
    pub(super) fn refuse(&mut self, id: DeviceId, refusal: NotTaken) -> bool {
        self.refusals.insert((id, refusal), self.searches).is_none()
    }

    /// A SubDevice is taken.
    pub(super) fn accept(&mut self, id: DeviceId) {
        self.refusals.retain(|(refused, _), _| *refused != id);
    }
}
