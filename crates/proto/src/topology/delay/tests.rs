//! The published cases: two real lines, and the differences by processing unit.

use super::*;
use crate::topology::derive::{SeenController, derive};
use crate::topology::tree::Wired;
use Port::{A, B, C, D};

type Times = PortMap<Option<DcTime32>>;

fn at(times: &[(Port, u32)]) -> Times {
    let mut map = PortMap::default();
    for &(port, time) in times {
        map[port] = Some(DcTime32(time));
    }
    map
}

/// Derives the tree from times alone, then measures.
fn from_reference(times: &[Times]) -> (Tree, Vec<u64>) {
    let seen: Vec<SeenController> = times
        .iter()
        .map(|&received| SeenController {
            open: PortMap::from_fn(|port| received[port].is_some()),
            received,
        })
        .collect();
    let tree = derive(&seen).unwrap();
    let delays = Delays::measure(&tree, Path::A, times, Span::ZERO).unwrap();
    let ns = (0..tree.len()).map(|node| delays.of(node).unwrap().from_reference.as_nanos());
    let ns = ns.collect();
    (tree, ns)
}

// Times and delays of both lines were read from real hardware (ethercrab's recordings). A leaf's
// own time has no part in its delay; zero stands in for it.
// proves: DC-07 partial
#[test]
fn a_coupler_a_junction_and_two_branches_measure_as_on_the_bench() {
    let (tree, delays) = from_reference(&[
        at(&[(A, 3_380_373_882), (B, 3_380_374_482), (C, 3_380_375_762)]), // EK1100
        at(&[(A, 3_384_116_362), (C, 3_384_116_672)]),                     // EK1122
        at(&[(A, 0)]),                                                     // EL9560
        at(&[(A, 3_373_883_962), (B, 3_373_884_272)]),                     // EK1914
        at(&[(A, 0)]),                                                     // EL1008
    ]);
    assert_eq!(delays, [0, 145, 300, 1085, 1240]);
    assert_eq!(tree.upstream(3), Some(End::Controller(0, C)));
}

// proves: DC-07 partial
#[test]
fn a_junction_with_four_ports_measures_as_on_the_bench() {
    let (tree, delays) = from_reference(&[
        at(&[(A, 3_493_061_450), (B, 3_493_064_460)]), // EK1100
        // EK1122
        at(&[(A, 3_493_293_220), (D, 3_493_294_570), (B, 3_493_295_650), (C, 3_493_295_940)]),
        at(&[(A, 3_485_337_450), (B, 3_485_337_760)]), // EK1914
        at(&[(A, 0)]),                                 // EL1008
        at(&[(A, 0)]),                                 // EK1101
        at(&[(A, 0)]),                                 // EL9560
    ]);
    assert_eq!(delays, [0, 145, 665, 820, 2035, 2720]);
    assert_eq!(tree.children(1).collect::<Vec<_>>(), [(D, 2), (B, 4), (C, 5)]);
}

// Read from a real EK1100, EL2828, EL2889 (ethercrab's recordings), leftovers of closed ports and
// all: "hoff" and "Verl" are pieces of the vendor's name.
// proves: DC-07 partial, ESC-13 partial
#[test]
fn leftovers_in_times_of_closed_ports_change_nothing() {
    let hoff = u32::from_le_bytes(*b"hoff");
    let verl = u32::from_le_bytes(*b"Verl");
    let received = [
        at(&[(A, 0x041B_2492), (B, 0x041B_26EA), (C, 0), (D, verl)]),
        at(&[(A, 0x04C5_F1D8), (B, 0x04C5_F30E), (C, 0), (D, verl)]),
        at(&[(A, 0x0439_936B), (B, hoff), (C, 0), (D, verl)]),
    ];
    let open = [&[A, B][..], &[A, B], &[A]];
    let seen: Vec<SeenController> = open
        .into_iter()
        .zip(received)
        .map(|(open, received)| SeenController { received, ..SeenController::open_at(open) })
        .collect();
    let tree = derive(&seen).unwrap();
    assert!((0..3).all(|node| !tree.is_reversed(node)));
    let delays = Delays::measure(&tree, Path::A, &received, Span::ZERO).unwrap();
    let from_reference = [0, 1, 2].map(|node| delays.of(node).unwrap().from_reference);
    assert_eq!(from_reference, [0, 145, 300].map(Span::ns));
}

const FIRST: Wired = Wired { on: End::MainDevice(Path::A), entry: A };

fn on(parent: usize, port: Port) -> Wired {
    Wired { on: End::Controller(parent, port), entry: A }
}

fn hops(wired: &[Wired], times: &[Times], difference: Span) -> Vec<Option<u64>> {
    let tree = Tree::from_wiring(wired, None).unwrap();
    let delays = Delays::measure(&tree, Path::A, times, difference).unwrap();
    let hop = |node| delays.of(node).and_then(|delay| delay.hop).map(Span::as_nanos);
    (0..tree.len()).map(hop).collect()
}

// proves: DC-07 partial
#[test]
fn the_processing_unit_adds_its_difference_where_the_way_leads_through_it() {
    let difference = Span::ns(20);
    // Last of a line: half of the time away. Before it: half of (away less stay, plus 20).
    let line = [FIRST, on(0, B), on(1, B)];
    let times = [at(&[(A, 0), (B, 1_000)]), at(&[(A, 0), (B, 400)]), at(&[(A, 0)])];
    assert_eq!(hops(&line, &times, difference), [None, Some(310), Some(200)]);
    assert_eq!(hops(&line, &times, Span::ZERO), [None, Some(300), Some(200)]);
    // Behind a later port: without the 20, and 20 less for a leaf.
    let fork = [FIRST, on(0, B), on(0, C), on(2, B)];
    let times = [
        at(&[(A, 0), (B, 400), (C, 1_400)]),
        at(&[(A, 0)]),
        at(&[(A, 0), (B, 400)]),
        at(&[(A, 0)]),
    ];
    assert_eq!(hops(&fork, &times, difference), [None, Some(200), Some(300), Some(200)]);
    let leaf = [FIRST, on(0, B), on(0, C)];
    assert_eq!(hops(&leaf, &times, difference), [None, Some(200), Some(490)]);
}

// proves: DC-02 partial
#[test]
fn receive_times_may_wrap_between_two_ports() {
    let line = [FIRST, on(0, B)];
    let times = [at(&[(A, u32::MAX - 99), (B, 200)]), at(&[(A, 7)])];
    assert_eq!(hops(&line, &times, Span::ZERO), [None, Some(150)]);
}

// proves: DC-03 partial
#[test]
fn a_controller_without_a_clock_is_part_of_the_cable() {
    let line = [FIRST, on(0, B), on(1, B), on(2, B)];
    let none = at(&[]);
    let clock = at(&[(A, 0), (B, 1_000)]);
    let leaf = at(&[(A, 5)]);
    assert_eq!(hops(&line, &[clock, none, none, leaf], Span::ZERO), [None, None, None, Some(500)]);
    let tree = Tree::from_wiring(&line, None).unwrap();
    let delays = Delays::measure(&tree, Path::A, &[none, clock, none, leaf], Span::ZERO).unwrap();
    assert_eq!(delays.reference(), Some(1));
    assert_eq!(delays.of(0), None);
    assert_eq!(delays.of(3).unwrap().from_reference, Span::ns(500));
    let delays = Delays::measure(&tree, Path::A, &[], Span::ZERO).unwrap();
    assert_eq!(delays.reference(), None);
}

#[test]
fn a_fork_without_a_clock_hides_what_is_behind_it() {
    let wired = [FIRST, on(0, B), on(1, B), on(1, C)];
    let tree = Tree::from_wiring(&wired, None).unwrap();
    let (none, leaf, clock) = (at(&[]), at(&[(A, 5)]), at(&[(A, 0), (B, 1_000)]));
    let measure = |times: &[Times]| Delays::measure(&tree, Path::A, times, Span::ZERO);
    let hidden = |node| Err(DelayError::ForkWithoutClock { node, fork: 1 });
    assert_eq!(measure(&[clock, none, leaf, none]), hidden(2));
    assert_eq!(measure(&[none, none, leaf, leaf]), hidden(3));
    // One branch with clocks and no clock above needs no knowledge of the fork.
    assert_eq!(measure(&[none, none, none, leaf]).unwrap().reference(), Some(3));
}

#[test]
fn times_that_cannot_be_right_name_the_controller() {
    let wired = [FIRST, on(0, B)];
    let tree = Tree::from_wiring(&wired, None).unwrap();
    let measure = |times: &[Times]| Delays::measure(&tree, Path::A, times, Span::ZERO);
    let leaf = at(&[(A, 5)]);
    assert_eq!(measure(&[at(&[(A, 5)]), leaf]), Err(DelayError::MissingTime { node: 0, port: B }));
    assert_eq!(
        measure(&[at(&[(A, 5), (B, 4)]), leaf]),
        Err(DelayError::OutOfOrder { node: 0, port: B })
    );
    let error = measure(&[at(&[(A, 0), (B, 9_000_000)]), leaf]).unwrap_err();
    assert_eq!(error, DelayError::Implausible { node: 1, hop_ns: 4_500_000 });
    assert_eq!(
        error.to_string(),
        "controller 1: 4500000 ns from the clock above, expected 0 to 1000000 ns; latch again"
    );
    let ring = tree.closed_at(1, B).unwrap();
    let times = [at(&[(A, 0), (B, 500)]), leaf];
    assert_eq!(Delays::measure(&ring, Path::A, &times, Span::ZERO), Err(DelayError::RingClosed));
}

#[test]
fn clock_granularity_does_not_make_a_delay_negative() {
    let line = [FIRST, on(0, B), on(1, B)];
    let times = [at(&[(A, 0), (B, 300)]), at(&[(A, 0), (B, 310)]), at(&[(A, 0)])];
    assert_eq!(hops(&line, &times, Span::ZERO), [None, Some(0), Some(155)]);
}

// proves: DC-07 partial
#[test]
fn in_a_whole_ring_the_copies_of_both_cards_give_the_delays_whichever_comes_first() {
    let line = [FIRST, on(0, B), on(1, B)];
    let ring = Tree::from_wiring(&line, None).unwrap().closed_at(2, B).unwrap();
    // Cables of 100 and 200 ns. The copy of card B reaches the last one 350 ns before that of card A does, or 2,000 ns after it.
    for later in [0_u32, 2_350] {
        let times = [
            at(&[(A, 1_000), (B, 1_250 + later)]),
            at(&[(A, 5_100), (B, 5_150 + later)]),
            at(&[(A, 9_300), (B, 8_950 + later)]),
        ];
        let delays = Delays::measure_whole_ring(&ring, &times, Span::ZERO).unwrap();
        let from_reference = [0, 1, 2].map(|node| delays.of(node).unwrap().from_reference);
        assert_eq!(from_reference, [0, 100, 300].map(Span::ns), "{later} ns");
        let refused = Delays::measure(&ring, Path::A, &times, Span::ZERO);
        assert_eq!(refused, Err(DelayError::RingClosed));
    }
    // No frame of card A gets into a branch behind the port that leads on.
    let fork = [FIRST, on(0, B), on(0, C)];
    let ring = Tree::from_wiring(&fork, None).unwrap().closed_at(1, B).unwrap();
    let times = [at(&[(A, 0), (B, 400), (C, 700)]), at(&[(A, 0), (B, 100)]), at(&[(A, 0)])];
    let refused = Delays::measure_whole_ring(&ring, &times, Span::ZERO);
    assert_eq!(refused, Err(DelayError::RingClosed));
}
