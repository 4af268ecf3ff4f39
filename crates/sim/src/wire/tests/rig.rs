//! Lines of any shape, of bare controllers.

use linesman_config::fault::FaultName;
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::command::Command;
use linesman_proto::port::{Port, PortMap};
use linesman_proto::register::ErrorCounter;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::{End, Tree, Wired};
use proptest::prelude::*;

use crate::controller::tests::rig::{answers, at, frame, hardware, sii};
use crate::controller::{Controller, LocalClock};
use crate::device::{NoFirmware, Signals};
use crate::fault::{Running, Windows};
use crate::frame::WireFrame;
use crate::hardware::{Hardware, PortKind};
use crate::truth::FaultId;
use crate::wire::walk::{FrameInTransit, Outcome};
use crate::wire::world::World;
use crate::wire::{Change, DirectedLink, Source};

/// How a line is put together: for each controller but the first whose free port it hangs on (of
/// those there are), and the port by which it is entered.
pub(super) type Shape = Vec<(usize, usize)>;

/// Any line of 1 to `most` controllers. One in sixteen controllers is reversed.
pub(super) fn any_shape(most: usize) -> impl Strategy<Value = Shape> {
    let entry = prop_oneof![15 => Just(0usize), 1 => 1usize..4];
    proptest::collection::vec((any::<usize>(), entry), 1..=most)
}

/// The tree of a shape.
pub(super) fn tree(shape: &Shape, ring: Option<usize>) -> Tree {
    let port = |number: usize| Port::from_index(number).unwrap();
    let mut free: Vec<End> = vec![End::MainDevice(Path::A)];
    let mut wired = Vec::new();
    for (node, (choice, entry)) in shape.iter().enumerate() {
        let on = free.swap_remove(choice % free.len());
        wired.push(Wired { on, entry: port(*entry) });
        let others = Port::ALL.into_iter().filter(|other| other.index() != *entry);
        free.extend(others.map(|other| End::Controller(node, other)));
        // The card has one socket.
        free.retain(|end| *end != End::MainDevice(Path::A));
    }
    let closes_at = ring.map(|choice| match free[choice % free.len()] {
        End::Controller(node, port) => (node, port),
        End::MainDevice(_) => unreachable!("the first controller hangs on it"),
    });
    Tree::from_wiring(&wired, closes_at).unwrap()
}

/// A controller of the usual kind, with cables at all ports.
pub(super) fn usual() -> Hardware {
    Hardware { ports: PortMap([PortKind::Mii; 4]), ..hardware() }
}

/// What a fault does, written down.
#[derive(Debug)]
pub(super) struct Script(pub(super) Vec<(Instant, Change)>);

impl Source for Script {
    fn next_change(&mut self) -> Option<(Instant, Change)> {
        if self.0.is_empty() { None } else { Some(self.0.remove(0)) }
    }
}

/// A world and its clock.
#[derive(Debug)]
pub(super) struct Bench {
    pub(super) world: World,
    pub(super) now: Instant,
}

impl Bench {
    pub(super) fn new(tree: &Tree, of: impl Fn(usize) -> Hardware) -> Self {
        let controllers = (0..tree.len()).map(|node| {
            let (id, clock) = (DeviceId(node as u32), LocalClock::default());
            Controller::new(id, of(node), clock, Box::new(NoFirmware), sii(true))
        });
        let cables = vec![7.0; tree.links().len()];
        let world = World::new(tree, controllers.collect(), &cables, Signals::default());
        Self { world, now: Instant::from_nanos(1_000_000) }
    }

    /// From now on these things happen.
    pub(super) fn script(&mut self, changes: Vec<(Instant, Change)>) -> FaultId {
        let id = self.world.truth.declare(FaultName::EmcNoise, Vec::new());
        self.world.running.push(Running::new(
            id,
            None,
            Windows::once(self.now, None),
            Box::new(Script(changes)),
        ));
        id
    }

    /// A link opens now, and both ends have noticed when this returns.
    pub(super) fn open(&mut self, links: &[usize]) {
        let changes = links.iter().map(|link| (self.now, Change::Open { link: *link }));
        self.script(changes.collect());
        self.now += Span::ms(1);
        self.world.advance(self.now);
    }

    /// The next frame on a line is hit in the middle.
    pub(super) fn arm_frame_error(&mut self, direction: DirectedLink) {
        self.script(vec![(self.now, Change::FrameHit { direction, part: 1 << 15, flip: 0x10 })]);
    }

    /// Sends a frame; gives where it arrived, what it was, and takes a millisecond.
    pub(super) fn send_by(&mut self, card: Path, frame: WireFrame) -> (Outcome, WireFrame) {
        self.world.frames += 1;
        let frame = WireFrame { number: self.world.frames, ..frame };
        self.world.look_ahead(self.now, frame.duration());
        self.world.advance(self.now);
        let mut in_transit = FrameInTransit::new(frame);
        let outcome = self.world.walk(card, self.now, &mut in_transit);
        self.now += Span::ms(1);
        self.world.advance(self.now);
        (outcome, in_transit.frame)
    }

    /// A broadcast read by a card: where it arrived, whether whole, and its working counter.
    pub(super) fn broadcast(&mut self, card: Path) -> Option<(Path, bool, u16)> {
        let probe = frame(&[(Command::Brd, at(0, 0x0000), &[0; 2])]);
        let (outcome, frame) = self.send_by(card, probe);
        match outcome {
            Outcome::Arrived(path, _) => {
                Some((path, frame.damage.is_intact(), answers(&frame)[0].1))
            }
            Outcome::Vanished => None,
        }
    }

    pub(super) fn counter(&self, node: usize, counter: ErrorCounter) -> u8 {
        self.world.nodes[node].controller.error_counters().value(counter).unwrap()
    }

    /// All counters that are not 0.
    pub(super) fn counters(&self) -> Vec<(usize, ErrorCounter, u8)> {
        let nodes = self.world.nodes.iter().enumerate();
        nodes
            .flat_map(|(node, here)| {
                let counters = here.controller.error_counters();
                let counters: Vec<_> = counters.iter().collect();
                counters.into_iter().map(move |(counter, value)| (node, counter, value))
            })
            .filter(|(_, _, value)| *value != 0)
            .collect()
    }
}
