//! Properties of any line: route and walk agree, and the tree is found again from what was seen of
//! it.

use proptest::prelude::*;

use super::line::{CARDS, Cable, Line, Socket, Walk, any_line};
use crate::address::Path;
use crate::port::{Port, PortMap};
use crate::time::{DcTime32, Span};
use crate::topology::delay::Delays;
use crate::topology::derive::{EntryBasis, Reconstruction, SeenController, derive};
use crate::topology::route::{Leg, Route};
use crate::topology::tree::{Tree, Wired};
use crate::topology::wiring::{End, Link};

fn port(number: usize) -> Port {
    Port::from_index(number).unwrap()
}

fn end((node, number): Socket) -> End {
    match (node, number) {
        (CARDS, 0) => End::MainDevice(Path::A),
        (CARDS, _) => End::MainDevice(Path::B),
        (node, number) => End::Controller(node, port(number)),
    }
}

/// The description of a line as it was plugged together, whole or not.
fn described(line: &Line) -> Tree {
    let wired: Vec<Wired> = line.cables[..line.len]
        .iter()
        .map(|cable| Wired { on: end(cable.near), entry: port(cable.far.1) })
        .collect();
    let ring = line.cables.get(line.len).map(|ring| (ring.near.0, port(ring.near.1)));
    Tree::from_wiring(&wired, ring).unwrap()
}

/// What a scan sees of a whole line with card A: the controllers in processing order, with receive
/// times where `has_clock`.
fn seen(line: &Line, walk: &Walk, has_clock: impl Fn(usize) -> bool) -> Vec<SeenController> {
    let (open, latched) = (line.open(), line.latched(walk));
    let one = |&(node, _): &(usize, usize)| SeenController {
        open: PortMap(open[node]),
        received: PortMap(latched[node].map(|time| has_clock(node).then_some(DcTime32(time)))),
    };
    walk.processed.iter().map(one).collect()
}

/// Adds the cable to card B at a free port chosen by `choice`, and breaks the cables `broken`.
fn close_and_break(line: &mut Line, choice: usize, broken: &[usize]) {
    let open = line.open();
    let free: Vec<Socket> = (0..line.len)
        .flat_map(|node| (0..4).map(move |port| (node, port)))
        .filter(|&(node, port)| !open[node][port])
        .collect();
    let near = free[choice % free.len()];
    line.cables.push(Cable { near, far: (CARDS, 1), delay: 500, whole: true });
    let count = line.cables.len();
    for index in broken {
        line.cables[index % count].whole = false;
    }
}

fn check_against_walk(route: &Route, walk: &Walk) -> Result<(), TestCaseError> {
    let hops: Vec<(End, End)> = route.hops().iter().map(|hop| (hop.from, hop.to)).collect();
    let walked: Vec<(End, End)> = walk.hops.iter().map(|&(a, b)| (end(a), end(b))).collect();
    prop_assert_eq!(hops, walked);
    let processed: Vec<(usize, usize)> =
        route.processing().iter().map(|passed| (passed.node, passed.after + 1)).collect();
    prop_assert_eq!(&processed, &walk.processed);
    let checks: Vec<(usize, Port)> = route.checks().map(|c| (c.node, c.port)).collect();
    let received: Vec<(usize, Port)> = walk.received.iter().map(|r| (r.0, port(r.1))).collect();
    prop_assert_eq!(&checks, &received);
    let mut once = checks;
    once.sort_unstable();
    once.dedup();
    prop_assert_eq!(once.len(), received.len(), "every check appears once");
    for check in route.checks() {
        prop_assert_eq!(route.hop_to(check.node, check.port), Some(check.hop));
        let first = route.checks().find(|other| other.node == check.node).map(|c| c.hop);
        prop_assert_eq!(route.first_hop_to(check.node), first);
        let last = walk.hops.iter().rposition(|&((node, _), _)| node == check.node);
        prop_assert_eq!(route.last_hop_from(check.node), last);
    }
    for (hop, &(from, to)) in walk.hops.iter().enumerate() {
        let opposite = walk.hops.iter().position(|&other| other == (to, from));
        prop_assert_eq!(route.opposite(hop), opposite);
        let back = opposite.is_some_and(|opposite| opposite < hop);
        prop_assert_eq!(route.leg(hop), Some(if back { Leg::Back } else { Leg::Out }));
        let executed = walk.processed.iter().filter(|&&(_, hops)| hops <= hop).count();
        prop_assert_eq!(route.executed_before(hop).len(), executed);
        prop_assert_eq!(route.not_executed_before(hop).len(), processed.len() - executed);
    }
    Ok(())
}

proptest! {
    // proves: ESC-07 partial, ESC-09 partial, HW-18 partial
    #[test]
    fn a_route_is_the_literal_walk(line in any_line(80, 4)) {
        let (tree, walk) = (described(&line), line.carry(0));
        let route = Route::intact(&tree);
        check_against_walk(&route, &walk)?;
        prop_assert_eq!(route.hops().len(), 2 * tree.links().len());
        prop_assert_eq!(route.arrives_at(), Some(Path::A));
        prop_assert_eq!(route.unprocessed().count(), 0, "each unit is passed");
        prop_assert!(route.order().eq(tree.order().iter().copied()));
        let mut nodes: Vec<usize> = route.order().collect();
        nodes.sort_unstable();
        prop_assert!(nodes.into_iter().eq(0..tree.len()), "and passed once");
    }

    // proves: RED-01 partial, RED-03 partial, RED-10 partial
    #[test]
    fn rings_whole_and_broken_are_walked_from_both_cards(
        mut line in any_line(40, 5),
        closing in any::<usize>(),
        broken in proptest::collection::vec(any::<usize>(), 0..3),
    ) {
        close_and_break(&mut line, closing, &broken);
        let tree = described(&line);
        let broken: Vec<usize> =
            (0..line.cables.len()).filter(|&index| !line.cables[index].whole).collect();
        for (number, path) in Path::ALL.into_iter().enumerate() {
            let route = Route::of(&tree, path, &broken);
            check_against_walk(&route, &line.carry(number))?;
            prop_assert_eq!(route.arrives_at().is_none(), route.hops().is_empty());
        }
        let processed: usize =
            Path::ALL.iter().map(|&path| Route::of(&tree, path, &broken).order().count()).sum();
        prop_assert!(processed <= tree.len(), "none is processed by both");
        let on_ring = (0..line.cables.len()).filter(|&link| tree.is_on_ring(link));
        for link in on_ring {
            let one = |path| Route::of(&tree, path, &[link]).order().count();
            prop_assert_eq!(one(Path::A) + one(Path::B), tree.len(), "link {}", link);
        }
    }

    #[test]
    fn queries_of_a_tree_follow_from_its_upstream_ends(line in any_line(40, 4)) {
        let tree = described(&line);
        for node in 0..tree.len() {
            let path = tree.path_to(node);
            prop_assert_eq!(tree.depth(node), path.len());
            prop_assert_eq!(tree.order()[tree.position(node).unwrap()], node);
            for other in 0..tree.len() {
                let below = other != node && tree.path_to(other).contains(&node);
                prop_assert_eq!(tree.is_downstream_of(other, node), below);
                prop_assert_eq!(tree.subtree(node).contains(&other), below || other == node);
            }
            for port in Port::ALL {
                let here = End::Controller(node, port);
                let plugged = |link: &Link| link.upstream == here || link.downstream == here;
                let link = tree.links().iter().position(plugged);
                prop_assert_eq!(tree.link_at(here), link);
                prop_assert_eq!(tree.is_open(node, port), link.is_some());
                if let Some(there) = tree.opposite(here) {
                    prop_assert_eq!(tree.opposite(there), Some(here));
                }
            }
        }
        prop_assert_eq!(Tree::from_wiring(&tree.wiring().unwrap(), None), Ok(tree.clone()));
        let sorted = tree.in_processing_order();
        prop_assert!(sorted.order().iter().copied().eq(0..tree.len()));
        prop_assert_eq!(sorted.in_processing_order(), sorted);
    }

    // proves: ESC-13 partial
    #[test]
    fn a_line_plugged_in_right_is_found_from_open_ports_alone(line in any_line(200, 0)) {
        let found = Reconstruction::of(Path::A, &seen(&line, &line.carry(0), |_| false));
        prop_assert_eq!(found.errors, []);
        prop_assert_eq!(found.doubts, []);
        prop_assert_eq!(found.tree, described(&line).in_processing_order());
    }

    // proves: ESC-13 partial
    #[test]
    fn a_reversed_line_is_found_with_receive_times(line in any_line(120, 2)) {
        let found = Reconstruction::of(Path::A, &seen(&line, &line.carry(0), |_| true));
        prop_assert_eq!(found.errors, []);
        prop_assert_eq!(found.doubts, []);
        prop_assert_eq!(found.tree, described(&line).in_processing_order());
    }

    // proves: ESC-13 partial
    #[test]
    fn a_ring_is_found_with_the_port_that_closes_it(line in any_line(80, 0)) {
        // The legal place: the port a frame comes to when all else is behind it.
        let walk = line.carry(0);
        let tree = described(&line);
        let &(last, _) = walk.processed.last().unwrap();
        let closed = tree.closed_at(last, Port::C).unwrap();
        let mut line = line;
        line.cables.push(Cable { near: (last, 2), far: (CARDS, 1), delay: 9, whole: true });
        let found = derive(&seen(&line, &line.carry(0), |_| false));
        prop_assert_eq!(found, Ok(closed.in_processing_order()));
    }

    /// Clocks may be missing where a controller is plugged in right: then what is found is right or
    /// doubted.
    #[test]
    fn what_is_found_without_doubt_is_right(
        line in any_line(40, 3),
        clocks in proptest::collection::vec(proptest::bool::weighted(0.7), 40),
    ) {
        let has_clock = |node: usize| line.cables[node].far.1 != 0 || clocks[node];
        let found = Reconstruction::of(Path::A, &seen(&line, &line.carry(0), has_clock));
        let is_sure = found.doubts.is_empty() && found.entry_basis.iter().all(|basis| match basis {
            EntryBasis::OnlyPort | EntryBasis::ReceiveTimes | EntryBasis::PortAOpen => true,
            EntryBasis::LastInFrameOrder | EntryBasis::OnlyPlace | EntryBasis::NoOpenPort => false,
        });
        if is_sure {
            prop_assert_eq!(found.errors, []);
            prop_assert_eq!(found.tree, described(&line).in_processing_order());
        } else if found.errors.is_empty() {
            // One of the lines that look like this.
            prop_assert!(found.tree.order().iter().copied().eq(0..line.len));
        }
    }

    /// Any open ports and any times at all: no panic, and errors exactly where the tree has gaps.
    #[test]
    fn nonsense_is_reported_and_never_panics(
        open in proptest::collection::vec((any::<[bool; 4]>(), any::<[Option<u32>; 4]>()), 0..30),
    ) {
        let nonsense: Vec<SeenController> = open
            .into_iter()
            .map(|(open, times)| SeenController {
                open: PortMap(open),
                received: PortMap(times.map(|time| time.map(DcTime32))),
            })
            .collect();
        let found = Reconstruction::of(Path::A, &nonsense);
        prop_assert_eq!(found.tree.len(), nonsense.len());
        prop_assert_eq!(derive(&nonsense).is_err(), !found.errors.is_empty());
        if found.errors.is_empty() {
            prop_assert_eq!(found.tree.detached().count(), 0);
            for (node, seen) in nonsense.iter().enumerate() {
                prop_assert_eq!(PortMap::from_fn(|port| found.tree.is_open(node, port)), seen.open);
            }
            // The line that was put together is walked in the order that was seen.
            prop_assert!(found.tree.order().iter().copied().eq(0..nonsense.len()));
        }
        let route = Route::intact(&found.tree);
        prop_assert!(route.order().all(|node| found.tree.is_attached(node)));
        let received: Vec<_> = nonsense.iter().map(|seen| seen.received).collect();
        let _ = Delays::measure(&found.tree, Path::A, &received, Span::ZERO);
    }

    // proves: RED-11 partial
    #[test]
    fn the_halves_of_a_broken_ring_join_to_the_ring(
        line in any_line(60, 0),
        broken in any::<usize>(),
    ) {
        let ring = described(&line).in_processing_order();
        let ring = ring.closed_at(ring.len() - 1, Port::C).unwrap();
        let trunk: Vec<usize> = (0..ring.len()).filter(|&link| ring.is_on_ring(link)).collect();
        let broken = trunk[broken % trunk.len()];
        let link = ring.links()[broken];
        let (End::Controller(near, near_port), End::Controller(far, far_port)) =
            (link.upstream, link.downstream)
        else {
            return Ok(()); // broken at card A: there is one half only
        };
        let halves = Path::ALL.map(|path| {
            let order: Vec<usize> = Route::of(&ring, path, &[broken]).order().collect();
            let is_open = |node: usize, port: Port| {
                ring.link_at(End::Controller(node, port)).is_some_and(|link| link != broken)
            };
            let seen = |&node: &usize| SeenController {
                open: PortMap::from_fn(|port| is_open(node, port)),
                received: receive_times(&ring, path, broken, node),
            };
            let seen: Vec<SeenController> = order.iter().map(seen).collect();
            (order, Reconstruction::of(path, &seen))
        });
        let [(order_a, half_a), (order_b, half_b)] = halves;
        prop_assert_eq!((half_a.errors, half_b.errors), (vec![], vec![]));
        let new = |node: usize| {
            order_a.iter().chain(&order_b).position(|&other| other == node).unwrap()
        };
        let both = half_a.tree.beside(&half_b.tree);
        let joined = both.joined((new(near), near_port), (new(far), far_port)).unwrap();
        prop_assert_eq!(joined.in_processing_order(), ring);
        for path in Path::ALL {
            let (alone, cut) = (Route::of(&both, path, &[]), {
                let broken = joined.link_at(End::Controller(new(far), far_port)).unwrap();
                Route::of(&joined, path, &[broken])
            });
            let ends = |route: &Route| -> Vec<(End, End)> {
                route.hops().iter().map(|hop| (hop.from, hop.to)).collect()
            };
            prop_assert_eq!(ends(&alone), ends(&cut));
            prop_assert_eq!(alone.processing(), cut.processing());
        }
    }

    // proves: DC-07 partial
    #[test]
    fn delays_are_the_true_ones(line in any_line(80, 4)) {
        let (tree, walk) = (described(&line), line.carry(0));
        let latched = line.latched(&walk);
        let received: Vec<_> =
            latched.iter().map(|times| PortMap(times.map(|time| Some(DcTime32(time))))).collect();
        let difference = Span::ns(line.processing.unsigned_abs());
        let delays = Delays::measure(&tree, Path::A, &received, difference).unwrap();
        let zero = walk.unit_reached[0];
        prop_assert_eq!(delays.reference(), Some(walk.processed[0].0));
        for (&(node, _), &reached) in walk.processed.iter().zip(&walk.unit_reached) {
            let delay = delays.of(node).unwrap();
            prop_assert_eq!(delay.from_reference, Span::ns((reached - zero).unsigned_abs()));
            if let Some(hop) = delay.hop {
                let cable = line.cables[node].delay;
                let unit = hop.as_nanos() as i64 - cable - line.forwarding;
                prop_assert!(unit == 0 || unit == line.processing, "{} ns", unit);
            }
        }
    }
}

/// Receive times of a frame of `path` on the ring with one link broken: one microsecond a hop.
fn receive_times(ring: &Tree, path: Path, broken: usize, node: usize) -> PortMap<Option<DcTime32>> {
    let route = Route::of(ring, path, &[broken]);
    PortMap::from_fn(|port| {
        let hop = u32::try_from(route.hop_to(node, port)?).ok()?;
        Some(DcTime32(hop.wrapping_mul(1_000).wrapping_sub(9_000)))
    })
}
