//! Properties of any line.

use std::collections::BTreeMap;

use linesman_proto::address::Path;
use linesman_proto::register::ErrorCounter;
use linesman_proto::topology::Route;
use proptest::prelude::*;

use super::rig::{Bench, any_shape, tree, usual};
use crate::controller::tests::rig::{answers, at, frame};
use crate::wire::DirectedLink;
use crate::wire::walk::Outcome;
use linesman_proto::command::Command;
use linesman_proto::topology::route::Direction;

/// What the topology says of a broadcast by a card while links are open.
fn expected(route: &Route) -> Option<(Path, bool, u16)> {
    if route.destroyed_by().is_some() {
        return None;
    }
    let path = route.arrives_at()?;
    Some((path, true, route.processing().len() as u16))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    // proves: ESC-07 partial
    #[test]
    fn a_broadcast_counts_each_controller_once(shape in any_shape(24)) {
        let tree = tree(&shape, None);
        // With two reversed controllers no frame comes home: see below.
        prop_assume!(Route::intact(&tree).destroyed_by().is_none());
        let mut bench = Bench::new(&tree, |_| usual());
        let count = tree.len() as u16;
        prop_assert_eq!(bench.broadcast(Path::A), Some((Path::A, true, count)));
        prop_assert_eq!(bench.counters(), vec![]);
    }

    #[test]
    fn positions_are_those_of_the_tree(shape in any_shape(16)) {
        let tree = tree(&shape, None);
        prop_assume!(Route::intact(&tree).destroyed_by().is_none());
        let mut bench = Bench::new(&tree, |_| usual());
        for (position, node) in tree.order().iter().enumerate() {
            let adp = 0u16.wrapping_sub(position as u16);
            let mark = (0x1000 + *node as u16).to_le_bytes();
            let (_, frame) = bench.send_by(Path::A, frame(&[(Command::Apwr, at(adp, 0x0010), &mark)]));
            prop_assert_eq!(answers(&frame)[0].1, 1);
        }
        for node in 0..tree.len() {
            let station = bench.world.nodes[node].controller.station_address();
            prop_assert_eq!(usize::from(station.0), 0x1000 + node);
        }
    }

    // proves: RED-10 partial, ESC-04 partial
    #[test]
    fn open_links_leave_what_the_route_says(
        shape in any_shape(16),
        broken in proptest::collection::vec(any::<usize>(), 1..4),
        ring in proptest::option::of(any::<usize>()),
    ) {
        let tree = tree(&shape, ring);
        let mut bench = Bench::new(&tree, |_| usual());
        let mut links: Vec<usize> = broken.iter().map(|link| link % tree.links().len()).collect();
        links.sort_unstable();
        links.dedup();
        bench.open(&links);
        for card in Path::ALL {
            let route = Route::of(&tree, card, &links);
            prop_assert_eq!(bench.broadcast(card), expected(&route), "card {}", card);
        }
    }

    // proves: HW-18 partial, HW-22 partial, HW-28 partial
    #[test]
    fn a_hit_counts_where_the_route_is_checked(
        shape in any_shape(16),
        ring in proptest::option::of(any::<usize>()),
        hop in any::<usize>(),
        old in proptest::collection::vec(any::<bool>(), 16),
    ) {
        let tree = tree(&shape, ring);
        let route = Route::intact(&tree);
        // A wiring on which no frame comes home has no whole way to speak of.
        prop_assume!(route.destroyed_by().is_none());
        let without_forwarded = |node: usize| old[node % old.len()];
        let mut bench = Bench::new(&tree, |node| {
            let mut hardware = usual();
            hardware.counting.forwarded = !without_forwarded(node);
            hardware
        });
        let hop = hop % route.hops().len();
        let hit = route.hops()[hop];
        bench.arm_frame_error(DirectedLink { link: hit.link, downstream: hit.direction == Direction::Downstream });
        let arrived = bench.broadcast(Path::A);
        prop_assert_eq!(arrived.map(|(path, whole, _)| (path, whole)), route.arrives_at().map(|path| (path, false)));

        let mut counted: BTreeMap<(usize, ErrorCounter), u8> = BTreeMap::new();
        for check in route.checks_from(hop) {
            let counter = if check.hop == hop {
                *counted.entry((check.node, ErrorCounter::PhysicalLayer(check.port))).or_default() += 1;
                ErrorCounter::InvalidFrame(check.port)
            } else if without_forwarded(check.node) {
                ErrorCounter::InvalidFrame(check.port)
            } else {
                ErrorCounter::Forwarded(check.port)
            };
            *counted.entry((check.node, counter)).or_default() += 1;
        }
        for passed in route.not_executed_before(hop) {
            *counted.entry((passed.node, ErrorCounter::ProcessingUnit)).or_default() += 1;
        }
        let shown: BTreeMap<_, _> =
            bench.counters().into_iter().map(|(node, counter, value)| ((node, counter), value)).collect();
        prop_assert_eq!(shown, counted);
    }

    #[test]
    fn a_frame_that_is_hit_wrote_registers_before_the_hit_only(
        shape in any_shape(12),
        hop in any::<usize>(),
    ) {
        let tree = tree(&shape, None);
        let route = Route::intact(&tree);
        prop_assume!(route.destroyed_by().is_none());
        let mut bench = Bench::new(&tree, |_| usual());
        let hop = hop % route.hops().len();
        let hit = route.hops()[hop];
        bench.arm_frame_error(DirectedLink { link: hit.link, downstream: hit.direction == Direction::Downstream });
        // The hit is in the padding: what is written is what was sent.
        let write = frame(&[(Command::Bwr, at(0, 0x0010), &[0x34, 0x12])]);
        let (outcome, _) = bench.send_by(Path::A, write);
        prop_assert!(matches!(outcome, Outcome::Arrived(Path::A, _)));
        for node in 0..tree.len() {
            let executed = route.executed_before(hop).iter().any(|passed| passed.node == node);
            let station = bench.world.nodes[node].controller.station_address().0;
            prop_assert_eq!(station, if executed { 0x1234 } else { 0 });
        }
    }
}

#[test]
fn two_controllers_over_closed_ports_let_no_frame_home() {
    // Both are entered by B, and nothing is plugged into A: S1, circulating frames.
    let shape = vec![(0, 1), (2, 1)];
    let tree = tree(&shape, None);
    assert!(tree.is_reversed(0) && tree.is_reversed(1));
    let route = Route::intact(&tree);
    let mut bench = Bench::new(&tree, |_| usual());
    assert_eq!(bench.broadcast(Path::A), expected(&route));
    let destroyed = route.destroyed_by().unwrap();
    assert_eq!(bench.counters(), [(destroyed.node, ErrorCounter::ProcessingUnit, 1)]);
}
