//! Lines as a scan sees them: straight, reversed, ambiguous, inconsistent, and very long.

use super::*;
use crate::topology::tree::Wired;
use Port::{A, B, C, D};

fn open(ports: &[Port]) -> SeenController {
    SeenController::open_at(ports)
}

fn timed(times: &[(Port, u32)]) -> SeenController {
    let mut seen = SeenController::default();
    for &(port, time) in times {
        seen.open[port] = true;
        seen.received[port] = Some(DcTime32(time));
    }
    seen
}

fn of(seen: &[SeenController]) -> Reconstruction {
    Reconstruction::of(Path::A, seen)
}

/// Who hangs where, as `parent.port>entry`, counted from 1 as people do.
fn places(tree: &Tree) -> Vec<String> {
    let place = |node| match tree.upstream(node) {
        Some(End::MainDevice(card)) => format!("MainDevice.{card}>{}", tree.entry(node)),
        Some(End::Controller(on, port)) => format!("{}.{port}>{}", on + 1, tree.entry(node)),
        None => "detached".to_owned(),
    };
    (0..tree.len()).map(place).collect()
}

fn wired(on: &[(usize, Port)]) -> Tree {
    let first = Wired { on: End::MainDevice(Path::A), entry: A };
    let rest = on.iter().map(|&(no, port)| Wired { on: End::Controller(no - 1, port), entry: A });
    Tree::from_wiring(&std::iter::once(first).chain(rest).collect::<Vec<_>>(), None).unwrap()
}

// proves: ESC-13
#[test]
fn the_fifteen_line_follows_from_open_ports_in_both_variants() {
    for branch in [B, C] {
        let mut seen = vec![open(&[A, B, C])];
        seen.extend([open(&[A, B]); 4]);
        seen.extend([open(&[A, B, C]), open(&[A, B]), open(&[A, B]), open(&[A, D, branch])]);
        seen.extend([open(&[A]), open(&[A, B]), open(&[A, B]), open(&[A]), open(&[A]), open(&[A])]);
        let mut on: Vec<(usize, Port)> = (1..9).map(|no| (no, B)).collect();
        on.extend([(9, D), (9, branch), (11, B), (12, B), (6, C), (1, C)]);
        assert_eq!(derive(&seen), Ok(wired(&on)));
    }
}

#[test]
fn the_one_open_port_that_is_left_over_closes_the_ring() {
    let line = of(&[open(&[A, B]), open(&[A, B]), open(&[A, B])]);
    assert_eq!(line.tree.closes_at(), Some((2, B)));
    assert_eq!(line.errors, []);
    // A last coupler with terminals: they are processed before the frame leaves by port C.
    let coupler = derive(&[open(&[A, B]), open(&[A, B, C]), open(&[A])]).unwrap();
    assert_eq!(coupler.closes_at(), Some((1, C)));
    // The half on card B has no other end.
    let half = Reconstruction::of(Path::B, &[open(&[A, B])]);
    assert_eq!(half.errors, [TopologyError::NothingBehind { node: 0, port: B, others: 0 }]);
}

// proves: RED-11 partial
#[test]
fn the_far_half_of_a_broken_ring_is_entered_at_the_out_ports() {
    let seen = [open(&[B]), open(&[A, B]), open(&[A, B])];
    let half = Reconstruction::of(Path::B, &seen);
    assert_eq!(places(&half.tree), ["2.A>B", "3.A>B", "MainDevice.B>B"]);
    assert_eq!(
        half.entry_basis,
        [EntryBasis::OnlyPort, EntryBasis::OnlyPlace, EntryBasis::OnlyPlace]
    );
    assert_eq!(half.tree.order(), [0, 1, 2]);
    assert_eq!((half.errors, half.doubts), (vec![], vec![]));
}

// The same order, open ports and entries fit two wirings; how long frames stay decides.
#[test]
fn receive_times_place_a_reversed_controller() {
    let leaf = timed(&[(A, 77)]);
    let inner = [timed(&[(A, 0), (B, 3_000)]), leaf, timed(&[(B, 500), (A, 1_500)])];
    assert_eq!(places(&derive(&inner).unwrap()), ["MainDevice.A>A", "3.A>A", "1.B>B"]);
    let outer = [timed(&[(A, 0), (B, 1_000)]), leaf, timed(&[(B, 500), (A, 3_500)])];
    assert_eq!(places(&derive(&outer).unwrap()), ["3.A>A", "1.B>A", "MainDevice.A>B"]);
    for seen in [inner, outer] {
        let found = of(&seen);
        assert_eq!(found.doubts, []);
        assert_eq!(found.entry_basis[2], EntryBasis::ReceiveTimes);
        assert!(found.tree.is_reversed(2));
    }
}

#[test]
fn without_receive_times_the_places_that_fit_are_counted() {
    let found = of(&[open(&[A, B]), open(&[A]), open(&[A, B])]);
    assert_eq!(places(&found.tree), ["3.A>A", "1.B>A", "MainDevice.A>B"]);
    assert_eq!(found.entry_basis[2], EntryBasis::OnlyPlace);
    assert_eq!(found.doubts, [Doubt::Place { node: 2, port: A, child: 0, candidates: 2 }]);
    assert_eq!(found.errors, []);
}

#[test]
fn a_main_device_in_the_second_socket_of_a_coupler_is_seen_by_its_closed_port_a() {
    let found = of(&[open(&[B, C]), open(&[A, B]), open(&[A])]);
    assert_eq!(places(&found.tree), ["MainDevice.A>C", "1.B>A", "2.B>A"]);
    assert_eq!(found.entry_basis[0], EntryBasis::LastInFrameOrder);
    assert_eq!(found.doubts, [Doubt::Entry { node: 0, taken: C }]);
    let times = of(&[timed(&[(C, 10), (B, 900)]), open(&[A, B]), open(&[A])]);
    assert_eq!(times.tree, found.tree);
    assert_eq!(times.doubts, []);
}

#[test]
fn receive_times_of_closed_ports_are_not_looked_at() {
    // Leftover text in the registers of ports that are not there, as in real captures.
    let mut seen = timed(&[(A, 3_000_000_000), (B, 3_000_000_900)]);
    seen.received[C] = Some(DcTime32(u32::from_le_bytes(*b"hoff")));
    seen.received[D] = Some(DcTime32(u32::from_le_bytes(*b"Verl")));
    let found = of(&[seen, open(&[A])]);
    assert_eq!(found.entry_basis[0], EntryBasis::ReceiveTimes);
    assert_eq!(places(&found.tree), ["MainDevice.A>A", "1.B>A"]);
}

#[test]
fn port_without_time_is_one_that_the_frame_did_not_come_back_to() {
    let found = of(&[timed(&[(C, 10), (B, 900)]), open(&[A])]);
    assert_eq!(found.entry_basis[0], EntryBasis::ReceiveTimes);
    let mut ring = timed(&[(C, 10), (B, 900)]);
    ring.open[A] = true;
    let found = of(&[ring, open(&[A])]);
    assert_eq!((found.tree.entry(0), found.entry_basis[0]), (C, EntryBasis::ReceiveTimes));
    // Those that are known are in order all the same, or of no use.
    let mut disordered = timed(&[(A, 0), (B, 500), (D, 900)]);
    disordered.open[C] = true;
    assert_eq!(of(&[disordered]).doubts, [Doubt::ReceiveTimes { node: 0 }]);
}

#[test]
fn receive_times_wrap() {
    let found = of(&[timed(&[(B, u32::MAX - 50), (C, 700), (A, 900)]); 1]);
    assert_eq!(found.tree.entry(0), B);
    assert_eq!(found.entry_basis, [EntryBasis::ReceiveTimes]);
}

#[test]
fn receive_times_out_of_frame_order_are_left_aside() {
    // In frame order from A comes D, then B.
    let disordered = timed(&[(A, 0), (B, 500), (D, 900)]);
    let equal = timed(&[(A, 0), (B, 0)]);
    for (seen, ends) in [(disordered, 2), (equal, 1)] {
        let mut line = vec![seen];
        line.resize(1 + ends, open(&[A]));
        let found = of(&line);
        assert_eq!(found.doubts, [Doubt::ReceiveTimes { node: 0 }]);
        assert_eq!(found.entry_basis[0], EntryBasis::PortAOpen);
        assert_eq!(found.errors, []);
    }
}

// proves: ESC-13 partial
#[test]
fn what_cannot_be_is_named_and_the_rest_is_kept() {
    let (line, end, none) = (open(&[A, B]), open(&[A]), open(&[]));
    assert_eq!(derive(&[line, end, end]), Err(TopologyError::NoPlace { node: 2, open: 1 }));
    let more = of(&[line, end, end, end]);
    assert_eq!(more.errors.len(), 2);
    assert_eq!(more.tree.detached().collect::<Vec<_>>(), [2, 3]);
    assert_eq!(more.tree.order(), [0, 1]);
    assert_eq!(more.tree.links().len(), 2);

    let silent = of(&[line, none]);
    assert_eq!(silent.errors, [TopologyError::NoOpenPort { node: 1 }]);
    assert_eq!(places(&silent.tree), ["MainDevice.A>A", "1.B>A"]);

    assert_eq!(
        derive(&[open(&[A, B, C]), line]),
        Err(TopologyError::NothingBehind { node: 1, port: B, others: 1 })
    );

    let reversed = timed(&[(B, 0), (A, 700)]);
    assert_eq!(
        derive(&[reversed]),
        Err(TopologyError::NothingBefore { node: 0, entry: B, port: A })
    );
    // What is before it waits for a later controller itself.
    let found = of(&[line, reversed]);
    assert_eq!(found.errors, [TopologyError::NothingBefore { node: 1, entry: B, port: A }]);
    assert_eq!(places(&found.tree), ["MainDevice.A>A", "1.B>B"]);

    let text = derive(&[line, end, end]).unwrap_err().to_string();
    assert!(text.starts_with("position 2: hangs on no controller"), "{text}");
}

#[test]
fn nothing_seen_is_an_empty_line() {
    assert_eq!(derive(&[]).map(|tree| tree.len()), Ok(0));
}

const MOST: usize = 65_535;

// No recursion and no quadratic step: each of these would take minutes or the stack otherwise.
#[test]
fn the_longest_lines_are_derived() {
    let mut line = vec![open(&[A, B]); MOST - 1];
    line.push(open(&[A]));
    let tree = derive(&line).unwrap();
    assert_eq!((tree.depth(MOST - 1), tree.links().len()), (MOST, MOST));

    let comb: Vec<_> =
        (0..MOST).map(|i| open(if i % 2 == 0 { &[A, B, D] } else { &[A] })).collect();
    assert!(of(&comb).tree.detached().next().is_none());

    let mut reversed = vec![open(&[B]); 1];
    reversed.resize(MOST, open(&[A, B]));
    let tree = derive(&reversed).unwrap();
    assert_eq!((tree.depth(0), tree.first(Path::A)), (MOST, Some(MOST - 1)));
}

#[test]
fn many_reversed_controllers_high_above_a_long_line_stay_linear() {
    // Half a line, its end, then reversed ones without times: each climbs to the top.
    let half = MOST / 2;
    let mut seen = vec![open(&[A, B]); half];
    seen.push(open(&[A]));
    seen.resize(MOST, open(&[A, B]));
    let found = of(&seen);
    assert_eq!(found.errors, []);
    assert_eq!(found.doubts.len(), 1);
    assert_eq!(found.tree.depth(half), MOST);
}
