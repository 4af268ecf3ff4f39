//! SubDevices that come back without their station addresses, known by the place at which they hang.
//!
//! Of several equal ones of which a part is back, their order on the line does not tell which: half a ring may be up again
//! and the other half not yet. The ports tell: a controller that hangs on a port of a known one, by the port that is planned, is
//! the planned one there.

use std::collections::BTreeSet;
use std::ops::Range;

use linesman_config::plan::DevicePlan;
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::port::{Port, PortMap};
use linesman_proto::register::{DL_STATUS, DlStatus};
use linesman_proto::topology::{End, Reconstruction, SeenController, Tree};

use super::Context;
use super::locate::FoundController;
use crate::exchange::{Reply, Target};
use crate::executor::lock;

/// The wiring of what was seen, as the ports tell: one tree for each card.
pub(super) async fn trees(
    context: &Context,
    seen: &[FoundController],
) -> Vec<(Range<usize>, Tree)> {
    let wire = &context.wire;
    let reads: Vec<_> =
        seen.iter().map(|one| wire.read(one.place, DL_STATUS.address, DL_STATUS.len)).collect();
    let mut ports = Vec::with_capacity(reads.len());
    for read in reads {
        let reply = read.await.ok().filter(Reply::answered);
        let status = reply.map(|reply| DlStatus(reply.word(0)));
        let open = PortMap::from_fn(|port| {
            status.is_some_and(|status| status.port_state(port).is_active())
        });
        ports.push(SeenController { open, ..SeenController::default() });
    }
    let is_on_b = |one: &FoundController| matches!(one.place, Target::PositionOnB(_));
    let on_a = seen.iter().take_while(|one| !is_on_b(one)).count();
    let card = |range: Range<usize>, path| {
        let tree = Reconstruction::of(path, &ports[range.clone()]).tree;
        (range, tree)
    };
    let both = [card(0..on_a, Path::A), card(on_a..seen.len(), Path::B)];
    both.into_iter().filter(|(range, _)| !range.is_empty()).collect()
}

/// Notes at each unknown controller which planned SubDevice hangs there, as far as ports and those that are known tell.
pub(super) async fn note(context: &Context, seen: &mut [FoundController]) {
    if seen.iter().all(|one| one.known.is_some()) {
        return;
    }
    let trees = trees(context, seen).await;
    let known: Vec<_> = seen.iter().map(|one| one.known).collect();
    let cards = trees.iter().map(|(range, tree)| (range, tree, card_of(seen, range)));
    let placed: Vec<(usize, DeviceId)> = cards
        .flat_map(|(range, tree, card)| {
            let placed = place(&context.plan.tree, tree, card, &known[range.clone()]);
            placed.into_iter().map(|(node, id)| (range.start + node, id)).collect::<Vec<_>>()
        })
        .collect();
    for (at, id) in placed {
        let is_fixed = |device: &DevicePlan| context.plan.group_of(device.id).is_none();
        let is_missing = !lock(&context.device_table).is_there(id);
        if is_missing && context.plan.device(id).is_some_and(is_fixed) {
            seen[at].wired = Some(id);
        }
    }
}

fn card_of(seen: &[FoundController], range: &Range<usize>) -> Path {
    match seen.get(range.start).map(|one| one.place) {
        Some(Target::PositionOnB(_)) => Path::B,
        _ => Path::A,
    }
}

/// Nodes of a found tree of which nothing else is known, with the planned SubDevices that they are: each hangs on one that is known,
/// or on the card, and both ends of the cable are the planned ones.
fn place(
    planned: &Tree,
    found: &Tree,
    card: Path,
    known: &[Option<DeviceId>],
) -> Vec<(usize, DeviceId)> {
    let mut who: Vec<Option<usize>> =
        known.iter().map(|known| known.map(|id| id.index())).collect();
    let mut placed = Vec::new();
    // A node may hang on one that comes later; each round settles one more step outwards.
    loop {
        let before = placed.len();
        for node in 0..known.len() {
            if who[node].is_some() {
                continue;
            }
            let upstream = match found.upstream(node) {
                Some(End::Controller(above, port)) => {
                    who[above].map(|above| End::Controller(above, port))
                }
                Some(End::MainDevice(_)) => Some(End::MainDevice(card)),
                None => None,
            };
            let opposite = upstream.and_then(|end| planned.opposite(end));
            if let Some(End::Controller(it, entry)) = opposite
                && entry == found.entry(node)
                && !who.contains(&Some(it))
            {
                who[node] = Some(it);
                placed.push((node, DeviceId(it as u32)));
            }
        }
        if placed.len() == before {
            return placed;
        }
    }
}

/// Pairs of found and planned ones, left out those that may as well be others: of several equal ones of `planned`, which are missing, it
/// is only one whose neighbour in the planned tree is back.
pub(super) fn without_doubtful(
    tree: &Tree,
    is_there: impl Fn(DeviceId) -> bool,
    pairs: Vec<(usize, DeviceId)>,
    planned: &[DeviceId],
    fits: impl Fn(usize, DeviceId) -> bool,
) -> Vec<(usize, DeviceId)> {
    let taken: BTreeSet<DeviceId> = pairs.iter().map(|(_, id)| *id).collect();
    let may_be_another =
        |at: usize| planned.iter().any(|other| !taken.contains(other) && fits(at, *other));
    let (mut doubtful, mut sure): (Vec<_>, Vec<_>) =
        pairs.into_iter().partition(|(at, _)| may_be_another(*at));
    loop {
        let back: BTreeSet<DeviceId> = sure.iter().map(|(_, id)| *id).collect();
        let is_beside_one = |id: DeviceId| {
            let ends = Port::ALL.map(|port| tree.opposite(End::Controller(id.index(), port)));
            ends.into_iter().flatten().any(|end| match end {
                End::MainDevice(_) => true,
                End::Controller(node, _) => {
                    let other = DeviceId(node as u32);
                    back.contains(&other) || is_there(other)
                }
            })
        };
        let (more, rest): (Vec<_>, Vec<_>) =
            doubtful.into_iter().partition(|(_, id)| is_beside_one(*id));
        if more.is_empty() {
            sure.sort_unstable();
            return sure;
        }
        sure.extend(more);
        doubtful = rest;
    }
}

#[cfg(test)]
mod tests {
    use linesman_proto::topology::derive::derive;

    use super::*;

    /// A line of controllers with these open ports.
    fn line(open: &[&[Port]]) -> Tree {
        let seen: Vec<_> = open.iter().map(|ports| SeenController::open_at(ports)).collect();
        derive(&seen).expect("it is a line")
    }

    #[test]
    fn of_equal_ones_that_are_missing_one_is_taken_if_its_neighbour_is_back() {
        use Port::{A, B};
        // A line of five; the last three are missing, and equal.
        let planned = line(&[&[A, B], &[A, B], &[A, B], &[A, B], &[A]]);
        let id = DeviceId;
        let missing = [id(2), id(3), id(4)];
        let left = |pairs: &[(usize, DeviceId)], equal: &[DeviceId]| {
            let fits = |_: usize, other: DeviceId| equal.contains(&other);
            let is_there = |id: DeviceId| id.0 < 2;
            without_doubtful(&planned, is_there, pairs.to_vec(), &missing, fits)
        };
        assert_eq!(left(&[(0, id(2))], &missing), [(0, id(2))], "the one before it is there");
        assert_eq!(left(&[(0, id(4))], &missing), [], "it may be any of the three");
        let both = [(0, id(2)), (1, id(3))];
        assert_eq!(left(&both, &missing), both, "each is beside one that is back");
        assert_eq!(left(&[(0, id(4))], &[id(4)]), [(0, id(4))], "no other one is like it");
    }

    #[test]
    fn controllers_are_known_by_the_ports_on_which_they_hang() {
        use Port::{A, B, C};
        // K0 with T1, T2; K3 with T4; all terminals are equal.
        let planned = line(&[&[A, B, C], &[A, B], &[A], &[A, B], &[A]]);
        // T1 and T2 are not back.
        let found = line(&[&[A, C], &[A, B], &[A]]);
        let known = [Some(DeviceId(0)), None, None];
        let placed = place(&planned, &found, Path::A, &known);
        assert_eq!(placed, [(1, DeviceId(3)), (2, DeviceId(4))]);
        // Nothing is known but the card.
        let placed = place(&planned, &found, Path::A, &[None; 3]);
        assert_eq!(placed.len(), 3);
        // What hangs on a port on which nobody is planned is nobody.
        let found = line(&[&[A, B, C], &[A], &[A, B, C], &[A], &[A]]);
        let known = [Some(DeviceId(0)), Some(DeviceId(1)), Some(DeviceId(3)), None, None];
        assert_eq!(place(&planned, &found, Path::A, &known), [(3, DeviceId(4))]);
    }
}
