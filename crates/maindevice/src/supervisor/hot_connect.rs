//! Hot connect groups on the line: found by the number of their first SubDevice, wherever they are plugged
//! in, and given their addresses (HC-01, HC-02).
//!
//! A newcomer is known by nothing but its place until it has told who it is and its number. Only then its
//! group gets its station addresses, and the supervisors of its SubDevices bring it up, beside the cycle. Its
//! data have datagrams of their own, which are judged as soon as it serves them.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::ops::Range;

use linesman_config::identity::mismatch;
use linesman_config::plan::{
    DevicePlan, HotConnectGroup, IdentificationCheck, IdentificationSource,
};
use linesman_proto::address::{DeviceId, StationAddress};
use linesman_proto::port::Port;
use linesman_proto::register::STATION_ADDRESS;
use linesman_proto::sii::Identity;
use linesman_proto::topology::{End, Tree};

use super::Context;
use super::by_wiring::trees;
use super::group_table::{GroupPlace, NotTaken};
use super::locate::{Equals, FoundController, identify, stretch};
use crate::event::Event;
use crate::exchange::Target;
use crate::executor::lock;
use crate::procedure::identification;

/// A group whose first SubDevice was found, or of which some come back.
pub(super) struct FoundGroup {
    group: usize,
    /// Its SubDevices that have no address of the plan yet, in processing order.
    seen: Vec<FoundController>,
    /// Where it hangs: the controller above it, and its port.
    above: Option<(Target, Port)>,
    /// Its first SubDevice is new.
    is_new: bool,
}

/// What was seen, and what was learnt of it.
struct GroupSearch<'a> {
    context: &'a Context,
    seen: Vec<FoundController>,
    trees: Vec<(Range<usize>, Tree)>,
}

/// Takes out of `seen` what belongs to groups. The groups that were found are to be settled when the others
/// have their addresses.
pub(super) async fn claim(
    context: &Context,
    seen: Vec<FoundController>,
) -> (Vec<FoundGroup>, Vec<FoundController>) {
    if context.plan.groups.is_empty() {
        return (Vec::new(), seen);
    }
    let mut line = GroupSearch { context, seen, trees: Vec::new() };
    let unknown: Vec<usize> = line.unknown();
    if unknown.is_empty() {
        let rest = line.rest(&[]);
        return (Vec::new(), rest);
    }
    identify(context, &mut line.seen).await;
    line.trees = trees(context, &line.seen).await;
    let heads = line.heads(&unknown).await;
    let mut found = Vec::new();
    // Places of a group, and of those that are left alone: they are no other planned SubDevice.
    let mut taken: Vec<usize> = Vec::new();
    let borders: Vec<usize> = heads.iter().map(|(at, ..)| *at).collect();
    for (at, verdict) in &heads {
        let region = line.region(*at, &borders);
        taken.extend(&region);
        let seen: Vec<FoundController> = region.iter().map(|at| line.seen[*at]).collect();
        if verdict.is_none() {
            leave_alone(context, &seen).await;
        }
        if let Some(group) = verdict {
            let above = line.above(*at);
            found.push(FoundGroup { group: *group, seen, above, is_new: true });
        }
    }
    // Of a group that is there some may come back.
    for (group, planned) in context.plan.groups.iter().enumerate() {
        let Some(at) = line.place_of(planned.first()) else { continue };
        let region = line.region(at, &borders);
        let seen: Vec<FoundController> = (region.iter())
            .filter(|at| unknown.contains(at) && !taken.contains(at))
            .map(|at| line.seen[*at])
            .collect();
        taken.extend(&region);
        if !seen.is_empty() {
            found.push(FoundGroup { group, seen, above: None, is_new: false });
        }
    }
    (found, line.rest(&taken))
}

/// Gives the groups that were found their addresses, where they may be plugged in.
pub(super) async fn settle(context: &Context, found: Vec<FoundGroup>) {
    for FoundGroup { group, seen, above, is_new } in found {
        let Some(planned) = context.plan.groups.get(group) else { continue };
        if is_new {
            let place = place(context, above).await;
            if !may_be_at(planned, place) {
                let refusal = NotTaken::Place(place);
                if lock(&context.device_table).groups.refuse(planned.first(), refusal) {
                    context.wire.emit(Event::GroupMisplaced { group, place });
                }
                leave_alone(context, &seen).await;
                continue;
            }
            lock(&context.device_table).groups.found(group, place);
        }
        stretch(context, &seen, planned.members.clone(), Equals::First).await;
    }
}

impl GroupSearch<'_> {
    /// The group member that a controller is, by its station address alone.
    fn member(&self, at: usize) -> Option<DeviceId> {
        let station = self.seen.get(at)?.station;
        let is_alone = self.seen.iter().filter(|other| other.station == station).count() == 1;
        let is_it = |device: &&DevicePlan| device.station == station;
        let device = self.context.plan.devices.iter().find(is_it).filter(|_| is_alone)?;
        let device_table = lock(&self.context.device_table);
        let is_there = device_table.is_there(device.id);
        (is_there && device_table.groups.group_of(device.id).is_some()).then_some(device.id)
    }

    /// Where a member that is there is seen.
    fn place_of(&self, id: DeviceId) -> Option<usize> {
        (0..self.seen.len()).find(|at| self.member(*at) == Some(id))
    }

    /// Those of whom nothing is known.
    fn unknown(&self) -> Vec<usize> {
        let is_unknown = |at: &usize| {
            let seen = &self.seen[*at];
            seen.known.is_none() && !seen.by_alias && self.member(*at).is_none()
        };
        (0..self.seen.len()).filter(is_unknown).collect()
    }

    /// What does not belong to groups.
    fn rest(self, taken: &[usize]) -> Vec<FoundController> {
        let keep: Vec<bool> = (0..self.seen.len())
            .map(|at| !taken.contains(&at) && !self.seen[at].by_alias && self.member(at).is_none())
            .collect();
        self.seen.into_iter().zip(keep).filter(|(_, keep)| *keep).map(|(seen, _)| seen).collect()
    }

    /// Controllers that may be the first ones of groups, with the group that each of them is; `None` for one
    /// that is left alone, which was told.
    async fn heads(&self, unknown: &[usize]) -> Vec<(usize, Option<usize>)> {
        let mut heads: Vec<(usize, Option<usize>)> = Vec::new();
        for &at in unknown {
            let Some(identity) = self.seen[at].identity else { continue };
            let alike = self.alike(&identity);
            let Some(first) = alike.first() else { continue };
            let mut numbers: BTreeMap<IdentificationSource, Option<u32>> = BTreeMap::new();
            for (_, check) in &alike {
                if let Entry::Vacant(unread) = numbers.entry(check.source) {
                    let (wire, place) = (&self.context.wire, self.seen[at].place);
                    let number = identification::read(wire, place, check.source, &identity).await;
                    unread.insert(number);
                }
            }
            let told = |check: &IdentificationCheck| numbers.get(&check.source).copied().flatten();
            let meant = alike.iter().find(|(_, check)| told(check) == Some(check.value));
            match meant {
                Some((group, _)) => heads.push((at, Some(*group))),
                None if self.is_wanted_elsewhere(&identity) => {}
                None => {
                    let absent = alike.iter().find(|(group, _)| !self.is_there(*group));
                    let (group, check) = absent.unwrap_or(first);
                    self.refuse(*group, *check, told(check));
                    heads.push((at, None));
                }
            }
        }
        self.without_doubles(&heads)
    }

    /// Of several with the number of one group none is taken.
    fn without_doubles(&self, heads: &[(usize, Option<usize>)]) -> Vec<(usize, Option<usize>)> {
        let mut kept = Vec::with_capacity(heads.len());
        for (at, group) in heads {
            let Some(group) = *group else {
                kept.push((*at, None));
                continue;
            };
            let same = heads.iter().filter(|(_, other)| *other == Some(group)).count();
            let count = same + usize::from(self.is_there(group));
            if count == 1 {
                kept.push((*at, Some(group)));
                continue;
            }
            let id = self.context.plan.groups[group].first();
            let Some(check) = self.check(id) else { continue };
            let count = u16::try_from(count).unwrap_or(u16::MAX);
            let refusal = NotTaken::Shared(count);
            if lock(&self.context.device_table).groups.refuse(id, refusal) {
                self.context.wire.emit(Event::IdentificationShared { id, check, count });
            }
            kept.push((*at, None));
        }
        kept
    }

    /// Groups whose first SubDevice is of this type, whatever its serial number, with its number.
    fn alike(&self, found: &Identity) -> Vec<(usize, IdentificationCheck)> {
        let groups = self.context.plan.groups.iter().enumerate();
        groups
            .filter_map(|(at, group)| {
                let device = self.context.plan.device(group.first())?;
                let planned = Identity { serial_number: 0, ..device.identity };
                let check = device.settings.identification?;
                mismatch(&planned, found, device.revision_rule).is_none().then_some((at, check))
            })
            .collect()
    }

    fn check(&self, id: DeviceId) -> Option<IdentificationCheck> {
        self.context.plan.device(id)?.settings.identification
    }

    fn is_there(&self, group: usize) -> bool {
        let first = self.context.plan.groups.get(group).map(HotConnectGroup::first);
        first.is_some_and(|id| lock(&self.context.device_table).is_there(id))
    }

    /// Whether it may be one of those that are in no group, and are not there.
    fn is_wanted_elsewhere(&self, found: &Identity) -> bool {
        let device_table = lock(&self.context.device_table);
        self.context.plan.devices.iter().any(|device| {
            device_table.groups.group_of(device.id).is_none()
                && !device_table.is_there(device.id)
                && mismatch(&device.identity, found, device.revision_rule).is_none()
        })
    }

    /// Tells that a controller with another number than that of a group was plugged in.
    fn refuse(&self, group: usize, check: IdentificationCheck, found: Option<u32>) {
        let Some(id) = self.context.plan.groups.get(group).map(HotConnectGroup::first) else {
            return;
        };
        if lock(&self.context.device_table).groups.refuse(id, NotTaken::Number(found)) {
            let event = Event::WrongIdentification { id, check, found, belongs_to: None };
            self.context.wire.emit(event);
        }
    }

    /// The controllers that came with this one: it and all behind it, but for those that belong to another group.
    fn region(&self, at: usize, borders: &[usize]) -> Vec<usize> {
        let Some((range, tree)) = self.trees.iter().find(|(range, _)| range.contains(&at)) else {
            return vec![at];
        };
        let node = at - range.start;
        let is_border = |other: &usize| *other != at && borders.contains(other);
        let is_inside = |other: usize| other == node || tree.is_downstream_of(other, node);
        let is_of_other = |other: usize| {
            borders.iter().filter(|border| is_border(border) && range.contains(border)).any(
                |border| {
                    let border = border - range.start;
                    is_inside(border) && (other == border || tree.is_downstream_of(other, border))
                },
            )
        };
        let nodes = (0..range.len()).filter(|other| is_inside(*other) && !is_of_other(*other));
        nodes.map(|node| node + range.start).collect()
    }

    /// The controller above one, and its port.
    fn above(&self, at: usize) -> Option<(Target, Port)> {
        let (range, tree) = self.trees.iter().find(|(range, _)| range.contains(&at))?;
        match tree.upstream(at - range.start)? {
            End::Controller(node, port) => Some((self.seen.get(range.start + node)?.place, port)),
            End::MainDevice(_) => None,
        }
    }
}

/// The planned SubDevice above a group, and its port.
async fn place(context: &Context, above: Option<(Target, Port)>) -> Option<GroupPlace> {
    let (target, port) = above?;
    let station = STATION_ADDRESS;
    let reply = context.wire.read_one(target, station.address, station.len).await.ok()?;
    let station = StationAddress(reply.word(0));
    let device = context.plan.devices.iter().find(|device| device.station == station)?;
    Some((device.id, port))
}

/// Whether a group may be plugged in there.
fn may_be_at(group: &HotConnectGroup, place: Option<GroupPlace>) -> bool {
    group.places.is_empty()
        || place.is_some_and(|(id, port)| group.places.contains(&End::Controller(id.index(), port)))
}

/// Brings SubDevices that are not taken to INIT: they move nothing.
pub(super) async fn leave_alone(context: &Context, seen: &[FoundController]) {
    for one in seen {
        identification::calm_down(&context.wire, one.place).await;
    }
}
