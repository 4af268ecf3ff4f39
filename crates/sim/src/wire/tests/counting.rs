//! Differences between types of controllers, and hits in particular places of a frame.

use linesman_proto::address::Path;
use linesman_proto::port::Port;
use linesman_proto::register::ErrorCounter;
use linesman_proto::time::{Instant, Span};

use super::rig::{Bench, Shape, tree, usual};
use crate::hardware::Hardware;
use crate::wire::{Change, DirectedLink};

/// Four controllers in a row, A to B.
fn row(of: impl Fn(usize) -> Hardware) -> Bench {
    let mut shape: Shape = vec![(0, 0)];
    // Free ports after the first: B, C, D of it, and so on: always the first of the newest.
    shape.extend([(0, 0), (2, 0), (4, 0)]);
    let tree = tree(&shape, None);
    let bench = Bench::new(&tree, of);
    assert_eq!((0..4).map(|node| tree.depth(node)).collect::<Vec<_>>(), [1, 2, 3, 4]);
    bench
}

/// The line towards a controller.
fn to(node: usize) -> DirectedLink {
    DirectedLink { link: node, downstream: true }
}

#[test]
fn a_controller_that_makes_symbol_errors_anew_hides_where_the_first_was() {
    let mut bench = row(|node| {
        let mut hardware = usual();
        hardware.counting.remakes_symbol_errors = node == 1;
        hardware
    });
    bench.arm_frame_error(to(1));
    bench.broadcast(Path::A);
    let physical = |node| bench.counter(node, ErrorCounter::PhysicalLayer(Port::A));
    let invalid = |node| bench.counter(node, ErrorCounter::InvalidFrame(Port::A));
    let forwarded = |node| bench.counter(node, ErrorCounter::Forwarded(Port::A));
    assert_eq!([0, 1, 2, 3].map(physical), [0, 1, 1, 0]);
    assert_eq!([0, 1, 2, 3].map(invalid), [0, 1, 1, 0]);
    assert_eq!([0, 1, 2, 3].map(forwarded), [0, 0, 0, 1]);
}

/// The first frame is sent at 2 ms; this is the instant at which its first bit reaches controller 1.
fn arrives_at_1(bench: &Bench) -> Instant {
    let timing = usual().timing;
    let links = &bench.world.links;
    Instant::from_nanos(2_000_000) + links[0].transit + timing.process + links[1].transit
}

fn hit_at(offset: Span) -> (Bench, Option<(Path, bool, u16)>) {
    let mut bench = row(|_| usual());
    let at = arrives_at_1(&bench) + offset;
    bench.script(vec![(at, Change::Hit { direction: to(1), flip: 1 })]);
    bench.now = Instant::from_nanos(2_000_000);
    let arrived = bench.broadcast(Path::A);
    (bench, arrived)
}

#[test]
fn a_hit_is_in_the_frame_or_beside_it_to_the_nanosecond() {
    let physical = ErrorCounter::PhysicalLayer(Port::A);
    let invalid = ErrorCounter::InvalidFrame(Port::A);
    // A frame of 60 bytes: 8 bytes of preamble, 60 bytes, 4 bytes of check sequence, 80 ns each.
    let end = Span::ns(72 * 80);
    for (offset, in_frame) in [
        (Span::ZERO, true),
        (Span::ns(8 * 80), true),
        (Span::ns(67 * 80), true),
        (end.saturating_sub(Span::ns(1)), true),
        (end, false),
        (end + Span::us(3), false),
    ] {
        let (bench, arrived) = hit_at(offset);
        assert_eq!(bench.counter(1, physical), 1, "{offset}");
        assert_eq!(bench.counter(1, invalid), u8::from(in_frame), "{offset}");
        assert_eq!(arrived.map(|(_, whole, _)| whole), Some(!in_frame), "{offset}");
    }
    let mut bench = row(|_| usual());
    let before = arrives_at_1(&bench) - Span::ns(1);
    bench.script(vec![(before, Change::Hit { direction: to(1), flip: 1 })]);
    bench.now = Instant::from_nanos(2_000_000);
    assert_eq!(bench.broadcast(Path::A), Some((Path::A, true, 4)));
    assert_eq!(bench.counter(1, physical), 1);
}

#[test]
fn without_its_start_delimiter_a_frame_ends() {
    let (bench, arrived) = hit_at(Span::ns(7 * 80 + 40));
    assert_eq!(arrived, None);
    assert_eq!(bench.counter(1, ErrorCounter::InvalidFrame(Port::A)), 1);
    assert_eq!(bench.counter(2, ErrorCounter::Forwarded(Port::A)), 0, "nothing went on");
    let mut profile = usual();
    profile.counting.counts_missing_start = false;
    let mut bench = row(|_| profile.clone());
    let at = arrives_at_1(&bench) + Span::ns(7 * 80 + 40);
    bench.script(vec![(at, Change::Hit { direction: to(1), flip: 1 })]);
    bench.now = Instant::from_nanos(2_000_000);
    assert_eq!(bench.broadcast(Path::A), None);
    assert_eq!(bench.counter(1, ErrorCounter::InvalidFrame(Port::A)), 0);
    assert_eq!(bench.counter(1, ErrorCounter::PhysicalLayer(Port::A)), 1);
}

#[test]
fn a_frame_that_was_hit_twice_is_invalid_twice() {
    let mut bench = row(|_| usual());
    bench.arm_frame_error(to(1));
    bench.arm_frame_error(to(3));
    bench.broadcast(Path::A);
    let invalid = |node| bench.counter(node, ErrorCounter::InvalidFrame(Port::A));
    let forwarded = |node| bench.counter(node, ErrorCounter::Forwarded(Port::A));
    assert_eq!([0, 1, 2, 3].map(invalid), [0, 1, 0, 1]);
    assert_eq!([0, 1, 2, 3].map(forwarded), [0, 0, 1, 0]);
}

#[test]
fn a_signal_that_returns_at_once_costs_no_link() {
    let mut bench = row(|_| usual());
    let at = bench.now;
    bench.script(vec![
        (at, Change::Open { link: 2 }),
        (at + Span::us(10), Change::Close { link: 2 }),
    ]);
    bench.now += Span::ms(5);
    assert_eq!(bench.broadcast(Path::A), Some((Path::A, true, 4)));
    assert_eq!(bench.counters(), []);
}

#[test]
fn a_supply_that_is_gone_for_a_moment_makes_the_neighbours_start_their_links_anew() {
    let mut bench = row(|_| usual());
    let at = bench.now;
    bench.script(vec![(at, Change::Off { node: 2 }), (at + Span::us(5), Change::On { node: 2 })]);
    bench.now += Span::ms(5);
    assert_eq!(bench.broadcast(Path::A), Some((Path::A, true, 2)), "up to controller 1");
    assert_eq!(bench.counter(1, ErrorCounter::LostLink(Port::B)), 1);
    assert_eq!(bench.counter(3, ErrorCounter::LostLink(Port::A)), 1);
    bench.now += Span::s(2);
    assert_eq!(bench.broadcast(Path::A), Some((Path::A, true, 4)));
}
