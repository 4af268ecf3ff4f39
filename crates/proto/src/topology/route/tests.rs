//! The fifteen-SubDevice line of the sources in both variants, and rings.

use super::*;
use crate::topology::tree::Wired;
use Port::{A, B, C, D};

fn on(no: usize, port: Port) -> Wired {
    Wired { on: End::Controller(no - 1, port), entry: A }
}

const FIRST: Wired = Wired { on: End::MainDevice(Path::A), entry: A };

/// The line of the sources' error search. `branch` is the port of SubDevice 9 on which SubDevice 11
/// hangs: the English deck has C, the Chinese B; each agrees with its own counter table.
fn fifteen(branch: Port) -> Tree {
    let mut wired = vec![FIRST];
    wired.extend((1..9).map(|no| on(no, B)));
    wired.extend([on(9, D), on(9, branch), on(11, B), on(12, B), on(6, C), on(1, C)]);
    Tree::from_wiring(&wired, None).unwrap()
}

/// Port and SubDevice of each check as the sources list them; `branch` as above.
fn listed(branch: usize) -> Vec<(usize, usize)> {
    let mut steps: Vec<(usize, usize)> = (1..=10).map(|no| (0, no)).collect();
    steps.extend([(3, 9), (0, 11), (0, 12), (0, 13), (1, 12), (1, 11), (branch, 9)]);
    steps.extend([(1, 8), (1, 7), (1, 6), (0, 14), (2, 6)]);
    steps.extend([(1, 5), (1, 4), (1, 3), (1, 2), (1, 1), (0, 15), (2, 1)]);
    steps
}

// proves: HW-18, HW-22, ESC-13 partial
#[test]
fn the_fifteen_line_is_checked_in_the_29_listed_steps() {
    for branch in [C, B] {
        let tree = fifteen(branch);
        let route = Route::intact(&tree);
        let steps: Vec<(usize, usize)> =
            route.checks().map(|check| (check.port.index(), check.node + 1)).collect();
        assert_eq!(steps.len(), 29);
        assert_eq!(steps, listed(branch.index()), "branch at {branch}");
        assert_eq!(route.hops().len(), 2 * tree.links().len());
        assert!(route.order().eq(0..15));
        for check in route.checks() {
            // Port 0 checks on the way out, the others on the way back.
            let leg = if check.port == A { Leg::Out } else { Leg::Back };
            assert_eq!(route.leg(check.hop), Some(leg));
            assert_eq!(route.hop_to(check.node, check.port), Some(check.hop));
        }
    }
}

// proves: HW-23 partial
#[test]
fn the_first_counting_port_in_check_order_is_the_place() {
    // Port and SubDevice that count, in either deck's table; the Chinese one is partly shifted and
    // names a port (SubDevice 5, port 2) that is not wired.
    let english = [(2, B), (5, B), (6, C), (14, A), (15, A)];
    let chinese = [(3, B), (5, B), (5, C), (14, A), (15, A)];
    for (branch, counting) in [(C, english), (B, chinese)] {
        let tree = fifteen(branch);
        let route = Route::intact(&tree);
        let first =
            route.checks().find(|check| counting.contains(&(check.node + 1, check.port))).unwrap();
        let link = tree.links()[route.hops()[first.hop].link];
        assert_eq!(link.map(|node| node + 1).to_string(), "6.C-14.A");
        assert_eq!(route.hops()[first.hop].direction, Direction::Downstream);
        assert_eq!(route.hop_to(4, C), None);
    }
}

#[test]
fn what_is_spoiled_on_a_hop_is_seen_by_all_later_checks_and_executed_before() {
    let route = Route::intact(&fifteen(C));
    let to_14 = route.hop_to(13, A).unwrap();
    let seen: Vec<usize> = route.checks_from(to_14).map(|check| check.node + 1).collect();
    assert_eq!(seen, [14, 6, 5, 4, 3, 2, 1, 15, 1]);
    assert_eq!(route.executed_before(to_14).len(), 13);
    let missed: Vec<usize> =
        route.not_executed_before(to_14).iter().map(|passed| passed.node + 1).collect();
    assert_eq!(missed, [14, 15]);
    let back = route.opposite(to_14).unwrap();
    assert_eq!(back, to_14 + 1);
    assert_eq!(route.executed_before(back).len(), 14);
    assert_eq!(route.first_hop_to(0), Some(0));
    assert_eq!(route.last_hop_from(0), Some(29));
    assert_eq!(route.opposite(0), Some(29));
    assert_eq!(route.opposite(29), Some(0));
    assert_eq!(route.processing_of(13).map(|passed| passed.after), Some(to_14));
    assert_eq!((route.leg(29), route.leg(30)), (Some(Leg::Back), None));
}

fn ring() -> Tree {
    let wired = [FIRST, on(1, B), on(2, B), on(3, B)];
    Tree::from_wiring(&wired, Some((3, B))).unwrap()
}

fn steps(route: &Route) -> Vec<String> {
    route.checks().map(|check| format!("{}.{}", check.node + 1, check.port)).collect()
}

// proves: RED-03 partial, RED-05 partial
#[test]
fn in_an_intact_ring_card_a_is_processed_and_card_b_passes_through() {
    let tree = ring();
    let main = Route::intact(&tree);
    assert_eq!(main.arrives_at(), Some(Path::B));
    assert_eq!(steps(&main), ["1.A", "2.A", "3.A", "4.A"]);
    assert!(main.order().eq(0..4));
    let second = Route::of(&tree, Path::B, &[]);
    assert_eq!(second.arrives_at(), Some(Path::A));
    assert_eq!(steps(&second), ["4.B", "3.B", "2.B", "1.B"]);
    assert_eq!(second.order().count(), 0);
    assert_eq!(second.unprocessed().count(), 4);
    for route in [main, second] {
        assert_eq!(route.hops().len(), tree.links().len());
        assert!((0..5).all(|hop| route.leg(hop) == Some(Leg::Out)));
    }
}

// proves: RED-01 partial, RED-06 partial, RED-10 partial
#[test]
fn a_broken_ring_is_processed_in_two_halves_each_once() {
    let tree = ring();
    for broken in 0..tree.links().len() {
        let [main, second] = Path::ALL.map(|path| Route::of(&tree, path, &[broken]));
        assert!(main.order().eq(0..broken));
        assert!(second.order().eq(broken..4), "the tail keeps the order of the intact ring");
        assert_eq!(main.arrives_at(), (broken > 0).then_some(Path::A));
        assert_eq!(second.arrives_at(), (broken < 4).then_some(Path::B));
        let marks = second.processing().iter().filter(|passed| passed.over_closed_loop).count();
        assert_eq!(marks, usize::from(broken < 4), "only the first of the tail marks the frame");
        assert_eq!(second.destroyed_by(), None);
        assert_eq!(main.hops().len() + second.hops().len(), 2 * (tree.links().len() - 1));
    }
    let [main, second] = Path::ALL.map(|path| Route::of(&tree, path, &[1, 3]));
    assert!(main.order().eq([0]) && second.order().eq([3]), "those between two breaks are lost");
}

// proves: RED-07 partial
#[test]
fn a_ring_closed_in_the_middle_leaves_units_to_the_frames_of_card_b() {
    // 1 has a branch on C which comes after the way to 2, and the ring closes at 2.
    let wired = [FIRST, on(1, B), on(1, C)];
    let tree = Tree::from_wiring(&wired, Some((1, B))).unwrap();
    let main = Route::intact(&tree);
    assert!(main.order().eq([0, 1]) && main.unprocessed().eq([2]));
    assert!(Route::of(&tree, Path::B, &[]).order().eq([2]));
}

#[test]
fn a_reversed_controller_on_a_closed_ring_is_processed_by_frames_of_card_b() {
    let reversed = Wired { entry: B, ..on(1, B) };
    let tree = Tree::from_wiring(&[FIRST, reversed, on(2, A)], Some((2, B))).unwrap();
    assert!(Route::intact(&tree).order().eq([0, 2]));
    assert!(Route::of(&tree, Path::B, &[]).order().eq([1]));
    assert_eq!(tree.order(), [0, 2, 1], "while the ring is open");
}

#[test]
fn two_closed_ports_a_on_one_way_destroy_every_frame() {
    let reversed = |end: Wired| Wired { entry: B, ..end };
    let one = Tree::from_wiring(&[FIRST, reversed(on(1, B))], None).unwrap();
    assert_eq!(Route::intact(&one).destroyed_by(), None);
    let both = [FIRST, reversed(on(1, B)), reversed(on(1, C))];
    let both = Tree::from_wiring(&both, None).unwrap();
    assert_eq!(Route::intact(&both).destroyed_by().map(|passed| passed.node), Some(2));
}

#[test]
fn without_controllers_nothing_leaves() {
    let tree = Tree::from_wiring(&[], None).unwrap();
    let route = Route::intact(&tree);
    assert_eq!((route.hops(), route.arrives_at(), route.leg(0)), (&[][..], None, None));
    assert_eq!(route.executed_before(0), []);
}
