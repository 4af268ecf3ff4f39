//! Wiring that was found, laid upon the plan, and whether that says anything.

use linesman_config::compare::{Comparison, Difference, Side, There, Wanted, compare, unlike};
use linesman_proto::address::{DeviceId, Path, Position};
use linesman_proto::port::Port;
use linesman_proto::time::Instant;
use linesman_proto::topology::derive::EntryBasis;
use linesman_proto::topology::{Reconstruction, SeenController, Tree};

use crate::model::{Device, NetworkModel};

/// Found wiring, as far as it is enough to be laid upon the plan.
pub(crate) struct FoundWiring<'a> {
    pub(crate) model: &'a NetworkModel,
    pub(crate) planned: &'a Tree,
    pub(crate) wanted: Vec<Wanted>,
    pub(crate) tree: Tree,
    pub(crate) basis: Vec<EntryBasis>,
    /// SubDevices for whose answers those of the found nodes are taken: positions move with what is missing.
    pub(crate) ids: Vec<DeviceId>,
    pub(crate) there: Vec<There>,
    /// When the last of it was learnt.
    pub(crate) at: Instant,
    pub(crate) frame: Option<u64>,
}

impl<'a> FoundWiring<'a> {
    pub(crate) fn of(model: &'a NetworkModel) -> Option<Self> {
        let planned = model.tree.as_ref().filter(|_| model.tree_is_planned)?;
        let is_ring = planned.closes_at().is_some();
        if !model.devices.iter().any(is_known_to_plan) || (is_ring && !is_closed(model)) {
            return None;
        }
        let mut ids: Vec<DeviceId> =
            planned.order().iter().map(|node| DeviceId(*node as u32)).collect();
        ids.extend(
            model.devices.iter().map(|device| device.id).filter(|id| id.index() >= planned.len()),
        );
        let count = usize::from(model.traffic.broadcasts.positions());
        if count == 0 || count > ids.len() {
            return None;
        }
        ids.truncate(count);
        // Where positions have moved, their station addresses tell whose answers they are taken for.
        let placed =
            (0..model.traffic.broadcasts.positions()).map(|at| model.by_position(Position(at)));
        if let Some(placed) = placed.collect::<Option<Vec<DeviceId>>>() {
            ids = placed;
        }
        let devices: Vec<&Device> = ids.iter().filter_map(|id| model.device(*id)).collect();
        let is_whole = devices.len() == count
            && devices
                .iter()
                .all(|device| device.dl.first.is_some() && device.identity.identity().is_some());
        if !is_whole {
            return None;
        }
        let seen: Vec<_> = devices.iter().map(|device| device.as_first_seen()).collect();
        let derived = if is_ring { ring_of(&seen)? } else { Reconstruction::of(Path::A, &seen) };
        let Reconstruction { tree, entry_basis, errors, .. } = derived;
        if !errors.is_empty() || tree.detached().next().is_some() {
            return None;
        }
        let wanted = (0..planned.len()).map(|node| wanted(model.devices.get(node))).collect();
        let there = devices.iter().map(|device| There {
            identity: device.identity.identity(),
            alias: device.alias.map(|alias| alias.value()),
        });
        let latest = devices.iter().filter_map(|device| device.identity.product_code);
        let latest = latest.max_by_key(|seen| seen.at);
        Some(Self {
            model,
            planned,
            wanted,
            there: there.collect(),
            tree,
            basis: entry_basis,
            ids,
            at: latest.map_or(Instant::ZERO, |seen| seen.at),
            frame: latest.and_then(|seen| seen.frame),
        })
    }

    pub(crate) fn compare(&self) -> Comparison {
        if self.is_as_planned() {
            return Comparison::default();
        }
        compare(
            Side { tree: self.planned, nodes: &self.wanted },
            Side { tree: &self.tree, nodes: &self.there },
        )
        .without_groups(|node| self.model.optional.contains_key(&DeviceId(node as u32)))
    }

    /// The cheap answer for a line that is well.
    fn is_as_planned(&self) -> bool {
        self.tree.len() == self.planned.len()
            && self.ids.iter().enumerate().all(|(node, id)| {
                let wanted = id.index();
                self.tree.entry(node) == self.planned.entry(wanted)
                    && Port::ALL.into_iter().all(|port| {
                        self.tree.is_open(node, port) == self.planned.is_open(wanted, port)
                    })
                    && unlike(&self.wanted[wanted], &self.there[node]).is_none()
            })
    }

    /// True if a comparison says anything that can be relied on.
    pub(crate) fn tells(&self, comparison: &Comparison) -> bool {
        let ring = self.planned.ring_nodes();
        let is_gone = |difference: &Difference| {
            // A ring that is closed goes on behind who is missing: it is not without power, or cut off.
            matches!(difference, Difference::Missing { planned, all }
                if all.len() == self.planned.subtree(*planned).len() && !ring.contains(planned))
        };
        let is_seen = |found: &usize| {
            matches!(
                self.basis.get(*found),
                Some(EntryBasis::ReceiveTimes | EntryBasis::OnlyPlace | EntryBasis::OnlyPort)
            )
        };
        let is_guessed = |difference: &Difference| matches!(difference, Difference::Reversed { found, .. } if !is_seen(found));
        // Too much that differs is another line, and not this one with a fault.
        let most = 2 + self.planned.len() / 4;
        let differences = &comparison.differences;
        !differences.is_empty()
            && differences.len() <= most
            && !differences.iter().all(is_gone)
            && !differences.iter().any(is_guessed)
    }
}

/// True if the ring was seen closed, with everybody in it plugged in the right way round: frames of card A are
/// processed by all of them, and those of card B by nobody.
fn is_closed(model: &NetworkModel) -> bool {
    let by = model.traffic.broadcasts.processed_alone().map(|seen| seen.value);
    model.traffic.broadcasts.was_processed_by_one() && by != Some(Path::B)
}

/// The closed ring that these controllers form. All on its way are entered at port A, since they process the
/// frames of card A; the frame that takes receive times comes back to none of them, so that times tell of
/// what hangs beside the ring alone.
fn ring_of(seen: &[SeenController]) -> Option<Reconstruction> {
    let timeless = |seen: &SeenController| SeenController { open: seen.open, ..Default::default() };
    let mut all: Vec<_> = seen.iter().map(timeless).collect();
    let first = Reconstruction::of(Path::A, &all);
    let ring = first.tree.ring_nodes();
    for (node, controller) in all.iter_mut().enumerate() {
        if !ring.is_empty() && !ring.contains(&node) {
            *controller = seen[node];
        }
    }
    let derived = Reconstruction::of(Path::A, &all);
    derived.tree.closes_at().is_some().then_some(derived)
}

fn is_known_to_plan(device: &Device) -> bool {
    device.planned.is_some_and(|planned| planned.identity.is_some())
}

pub(crate) fn wanted(device: Option<&Device>) -> Wanted {
    let planned = device.and_then(|device| device.planned);
    planned.map_or_else(Wanted::default, |planned| Wanted {
        identity: planned.identity,
        rule: planned.rule,
        alias: planned.alias,
    })
}
