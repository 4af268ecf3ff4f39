//! Links that a PHY drops by itself: enhanced link detection.

use linesman_proto::address::{DeviceId, Path};
use linesman_proto::port::{Port, PortMap};
use linesman_proto::register::ErrorCounter;
use linesman_proto::time::{Instant, Span};

use super::rig::{Bench, Shape, tree};
use crate::controller::tests::rig::{hardware, sii};
use crate::controller::{Controller, LocalClock};
use crate::device::{NoFirmware, Signals};
use crate::hardware::{Hardware, PortKind};
use crate::wire::world::World;
use crate::wire::{Change, DirectedLink};

/// Two controllers over a cable; the SII of the second wants enhanced link detection, or not.
fn bench(wants: bool) -> Bench {
    let shape: Shape = vec![(0, 0), (0, 0)];
    let tree = tree(&shape, None);
    let hardware = Hardware { ports: PortMap([PortKind::Mii; 4]), features: 0x00FC, ..hardware() };
    let controllers = (0..2).map(|node| {
        let mut image = sii(true);
        image[1] |= if wants && node == 1 { 0x10 } else { 0 };
        let (id, clock) = (DeviceId(node), LocalClock::default());
        Controller::new(id, hardware.clone(), clock, Box::new(NoFirmware), image)
    });
    let cables = vec![7.0; tree.links().len()];
    let world = World::new(&tree, controllers.collect(), &cables, Signals::default());
    Bench { world, now: Instant::from_nanos(1_000_000) }
}

fn burst(bench: &mut Bench, symbols: u64, apart: Span) {
    let direction = DirectedLink { link: 1, downstream: true };
    let hits = (0..symbols).map(|n| {
        let at = bench.now + Span::us(10) + Span::ns(n * apart.as_nanos());
        (at, Change::Hit { direction, flip: 1 })
    });
    let hits = hits.collect();
    bench.script(hits);
    bench.now += Span::ms(2);
    bench.world.advance(bench.now);
}

// facts 3.5: 32 symbols in about 10 µs close the port, and the partner loses its link, too.
#[test]
fn a_burst_of_bad_symbols_drops_the_link() {
    let mut noisy = bench(true);
    burst(&mut noisy, 40, Span::ns(240));
    let lost = |bench: &Bench, node, port| bench.counter(node, ErrorCounter::LostLink(port));
    let near = noisy.world.nodes[0].controller.dl_status();
    let port = near.active_ports().last().unwrap();
    assert_eq!(port, Port::A, "only the way to the card is left");
    assert_eq!(lost(&noisy, 1, Port::A), 1);
    assert_eq!(noisy.broadcast(Path::A).unwrap().2, 1);
    noisy.now += Span::s(2);
    noisy.world.advance(noisy.now);
    assert_eq!(noisy.broadcast(Path::A).unwrap().2, 2, "negotiated anew");
    let status = noisy.world.nodes[1].controller.dl_status();
    assert!(status.enhanced_link_detection());
}

#[test]
fn fewer_symbols_or_a_controller_without_it_keep_the_link() {
    let mut calm = bench(true);
    burst(&mut calm, 31, Span::ns(240));
    assert_eq!(calm.broadcast(Path::A).unwrap().2, 2);
    burst(&mut calm, 60, Span::ns(480));
    assert_eq!(calm.broadcast(Path::A).unwrap().2, 2, "never 32 within 10 µs");
    let mut without = bench(false);
    burst(&mut without, 200, Span::ns(240));
    assert_eq!(without.broadcast(Path::A).unwrap().2, 2);
}
