//! The segment as physics knows it, and how it changes.

use linesman_proto::address::{DeviceId, Path};
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::{End, Tree};

use super::capture_probe::LoopedProbe;
use super::change::{Change, DirectedLink};
use super::fast_path::FastPath;
use super::foreign_sender::ForeignSenders;
use super::link::{CABLE_NS_PER_M, Link, Noise};
use super::link_event::LinkEvent;
use super::nodes::Nodes;
use super::plug_noise::PlugNoise;
use crate::controller::Controller;
use crate::device::Signals;
use crate::event_queue::EventQueue;
use crate::fault::Running;
use crate::hardware::PortKind;
use crate::seed::Seed;
use crate::segment::card::Card;
use crate::truth::{FaultId, Place, TruthLog};

/// Hits are kept this long: longer than any frame is on its way.
const MEMORY: Span = Span::ms(2);

/// Controllers, cards and links with their histories.
#[derive(Debug)]
pub(crate) struct World {
    /// By node of the tree.
    pub(crate) nodes: Nodes,
    /// In the order of [`Tree::links`].
    pub(crate) links: Vec<Link>,
    pub(crate) cards: [Card; 2],
    pub(crate) signals: Signals,
    pub(crate) truth: TruthLog,
    pub(super) link_events: EventQueue<LinkEvent>,
    pub(crate) running: Vec<Running>,
    /// The line that leaves each card.
    pub(super) leaving: [Option<DirectedLink>; 2],
    /// All changes up to here are made; what is injected begins later.
    pub(crate) horizon: Instant,
    /// An upper bound of the time that a frame of no length takes through all of it, twice.
    round: Span,
    pub(crate) frames: u64,
    pub(crate) plug_noise: PlugNoise,
    pub(super) foreign_senders: ForeignSenders,
    /// Links on which something lies in wait.
    pub(super) noisy: Vec<usize>,
    /// The last instant, so far as is known, at which a link or a supply changed.
    pub(super) changed_at: Instant,
    /// What frames can be spared of the walk.
    pub(crate) fast_path: FastPath,
    /// A capture probe, where one is looped in.
    pub(crate) capture_probe: Option<LoopedProbe>,
}

impl World {
    /// A segment that was on before the run began: all links are up, all SII are loaded.
    ///
    /// `controllers` are in the order of the tree's nodes, `cable_m` in the order of its links.
    pub(crate) fn new(
        tree: &Tree,
        controllers: Vec<Controller>,
        cable_m: &[f64],
        signals: Signals,
    ) -> Self {
        let mut world = Self {
            nodes: Nodes::new(controllers),
            links: Vec::new(),
            cards: [Card::default(), Card::default()],
            signals,
            truth: TruthLog::default(),
            link_events: EventQueue::default(),
            running: Vec::new(),
            leaving: [None; 2],
            horizon: Instant::ZERO,
            round: Span::ZERO,
            frames: 0,
            plug_noise: PlugNoise::new(0.0, Seed(0).stream("plug noise")),
            foreign_senders: ForeignSenders::default(),
            noisy: Vec::new(),
            changed_at: Instant::ZERO,
            fast_path: FastPath::default(),
            capture_probe: None,
        };
        for (index, wired) in tree.links().iter().enumerate() {
            world.plug(*wired, index, cable_m.get(index).copied().unwrap_or(0.0));
        }
        world.round = world.measure_round();
        for node in world.nodes.iter_mut() {
            node.controller.power_on_before(Instant::ZERO, &mut world.signals);
        }
        for link in 0..world.links.len() {
            world.link_up(link, Instant::ZERO);
        }
        for node in world.nodes.iter_mut() {
            node.touch(Instant::ZERO, &mut world.signals);
        }
        world
    }

    fn plug(&mut self, wired: linesman_proto::topology::Link, index: usize, cable_m: f64) {
        let cable = Span::ns((cable_m * CABLE_NS_PER_M).max(0.0) as u64);
        let kind = [wired.upstream, wired.downstream]
            .into_iter()
            .find_map(|end| match end {
                End::MainDevice(_) => None,
                End::Controller(node, port) => {
                    Some(self.nodes[node].controller.hardware().ports[port])
                }
            })
            .unwrap_or(PortKind::Mii);
        let transit = self.ports(wired.upstream, wired.downstream, kind) + cable;
        self.links.push(Link::new(wired.upstream, wired.downstream, kind, transit));
        for direction in DirectedLink::both(index) {
            let (from, _) = self.links[index].from_to(direction.downstream);
            match from {
                End::MainDevice(path) => self.leaving[path.index()] = Some(direction),
                End::Controller(node, port) => self.nodes[node].leaving[port] = Some(direction),
            }
        }
    }

    /// What both ports of a link add to its transit: half a crossing each.
    pub(super) fn ports(&self, one: End, other: End, kind: PortKind) -> Span {
        let crossing = |end: End| match end {
            End::MainDevice(path) => self.cards[path.index()].crossing,
            End::Controller(node, _) => {
                let timing = self.nodes[node].controller.hardware().timing;
                match kind {
                    PortKind::Ebus => timing.ebus_crossing,
                    PortKind::Mii | PortKind::Absent => timing.mii_crossing,
                }
            }
        };
        Span::ns((crossing(one) + crossing(other)).as_nanos() / 2)
    }

    /// The upstream end of a link that is open is plugged in elsewhere.
    pub(crate) fn rewire(&mut self, link: usize, upstream: End) {
        let (before, downstream) = (self.links[link].upstream, self.links[link].downstream);
        let kind = self.links[link].kind;
        let cable =
            self.links[link].transit.as_nanos() - self.ports(before, downstream, kind).as_nanos();
        match before {
            End::MainDevice(path) => self.leaving[path.index()] = None,
            End::Controller(node, port) => self.nodes[node].leaving[port] = None,
        }
        let direction = Some(DirectedLink { link, downstream: true });
        match upstream {
            End::MainDevice(path) => self.leaving[path.index()] = direction,
            End::Controller(node, port) => self.nodes[node].leaving[port] = direction,
        }
        self.links[link].upstream = upstream;
        self.links[link].transit = self.ports(upstream, downstream, kind) + Span::ns(cable);
        self.round = self.measure_round();
        self.way_changes(self.horizon);
    }

    /// A capture probe has made a link longer: all frames walk past it.
    pub(super) fn probe_changes_round(&mut self) {
        self.round = self.measure_round();
        self.fast_path.forbidden = true;
        self.way_changes(self.horizon);
    }

    fn measure_round(&self) -> Span {
        let links = self.links.iter().fold(Span::ZERO, |sum, link| sum + link.transit * 2);
        let nodes = self.nodes.iter().fold(Span::ZERO, |sum, node| {
            let timing = node.controller.hardware().timing;
            sum + timing.process + timing.forward * 3
        });
        (links + nodes) * 2
    }

    /// An upper bound of the time that a frame of no length takes through all of it, twice.
    pub(crate) fn round(&self) -> Span {
        self.round
    }

    // ---- names ----

    pub(crate) fn id(&self, node: usize) -> DeviceId {
        self.nodes[node].controller.id()
    }

    pub(crate) fn name_end(&self, end: End) -> End<DeviceId> {
        end.map(|node| self.id(node))
    }

    /// The place of a line in the truth log.
    pub(crate) fn direction_place(&self, direction: DirectedLink) -> Place {
        let (from, to) = self.links[direction.link].from_to(direction.downstream);
        Place::Direction(self.name_end(from), self.name_end(to))
    }

    // ---- time ----

    /// Makes all changes that a frame of `frame_time` which enters at `now` can meet.
    #[inline]
    pub(crate) fn look_ahead(&mut self, now: Instant, frame_time: Span) {
        let until = now + self.round + frame_time;
        if self.is_uneventful() {
            self.horizon = self.horizon.max(until);
            return;
        }
        self.send_foreign_frames_until(now);
        self.change_until(until);
        if !self.noisy.is_empty() {
            self.forget_noise(now - MEMORY);
        }
    }

    /// Whether nothing is going to change, no foreign sender sends and no noise lies in wait.
    #[inline]
    fn is_uneventful(&self) -> bool {
        self.running.is_empty()
            && self.link_events.is_empty()
            && self.noisy.is_empty()
            && self.foreign_senders.next_at().is_none()
    }

    /// Foreign senders send what they send until `now`: each frame as if somebody looked at its time, so
    /// that it is all the same who looks and when.
    #[inline]
    fn send_foreign_frames_until(&mut self, now: Instant) {
        /// Longer than the frame of any foreign sender.
        const FRAME: Span = Span::us(20);
        while let Some(at) = self.next_foreign_frame().filter(|at| *at <= now) {
            self.change_until(at + self.round + FRAME);
            self.touch_due(at);
            self.send_foreign_frames(at);
        }
    }

    fn forget_noise(&mut self, before: Instant) {
        let links = &mut self.links;
        self.noisy.retain(|link| {
            let noise = &mut links[*link].noise;
            for direction in &mut *noise {
                direction.forget(before);
            }
            !noise.iter().all(Noise::is_quiet)
        });
    }

    /// Something lies in wait on a link.
    pub(super) fn is_noisy(&mut self, link: usize) {
        if !self.noisy.contains(&link) {
            self.noisy.push(link);
        }
    }

    /// Brings everything to `now`.
    #[inline]
    pub(crate) fn advance(&mut self, now: Instant) {
        if self.is_uneventful() {
            self.horizon = self.horizon.max(now);
        } else {
            self.send_foreign_frames_until(now);
            self.change_until(now);
        }
        self.touch_due(now);
    }

    /// Makes all changes up to and at an instant.
    #[inline]
    fn change_until(&mut self, until: Instant) {
        if !self.running.is_empty() || !self.link_events.is_empty() {
            self.make_changes(until);
        }
        self.horizon = self.horizon.max(until);
    }

    fn make_changes(&mut self, until: Instant) {
        loop {
            let due = self.link_events.next_at().filter(|at| *at <= until);
            let fault = self.next_fault().filter(|(at, _)| *at <= until);
            match (due, fault) {
                (None, None) => break,
                (Some(at), Some((fault_at, index))) if fault_at < at => self.run_fault(index),
                (None, Some((_, index))) => self.run_fault(index),
                (Some(_), _) => {
                    if let Some((at, due)) = self.link_events.pop_until(until) {
                        self.serve(at, due);
                    }
                }
            }
        }
    }

    /// Which running fault does something first, and when.
    fn next_fault(&self) -> Option<(Instant, usize)> {
        let next = self.running.iter().enumerate();
        next.filter_map(|(index, fault)| Some((fault.next_at()?, index))).min()
    }

    fn run_fault(&mut self, index: usize) {
        let fault = self.running[index].id;
        match self.running[index].step() {
            crate::fault::Step::Begin(at) => self.truth.begin(at, fault),
            crate::fault::Step::Change(at, change) => self.apply(at, fault, change),
            crate::fault::Step::End { at, healed, for_good } => {
                if for_good {
                    self.running.remove(index);
                }
                if healed {
                    self.disarm(fault);
                }
                self.release(at, fault);
            }
        }
    }

    /// Hits that still wait for a frame do not come any more. One whose fault ended by itself comes
    /// with the next frame: so many hits were asked for.
    pub(crate) fn disarm(&mut self, fault: FaultId) {
        for noise in self.links.iter_mut().flat_map(|link| &mut link.noise) {
            noise.disarm(fault);
        }
        for node in self.nodes.iter_mut() {
            node.glitches.retain(|glitch| glitch.fault != fault);
        }
        for card in &mut self.cards {
            card.disarm(fault);
        }
        self.foreign_senders.disarm(fault);
    }

    /// A fault is over: everything it holds is let go.
    fn release(&mut self, at: Instant, fault: FaultId) {
        for link in 0..self.links.len() {
            if self.links[link].contact.is_held_by(fault) {
                self.apply(at, fault, Change::Close { link });
            }
            // The signal first: what was in between is still there, and keeps the link of the end that had it.
            for direction in DirectedLink::both(link) {
                if self.links[link].pair[usize::from(direction.downstream)].is_held_by(fault) {
                    self.apply(at, fault, Change::Mend { direction });
                }
            }
            for direction in DirectedLink::both(link) {
                if self.links[link].passage[usize::from(direction.downstream)].is_held_by(fault) {
                    self.apply(at, fault, Change::Carry { direction });
                }
            }
            if self.links[link].early.is_some_and(|(_, by)| by == fault) {
                self.links[link].early = None;
            }
        }
        for node in 0..self.nodes.len() {
            if self.nodes[node].power.is_held_by(fault) {
                self.apply(at, fault, Change::On { node });
            }
            if self.nodes[node].refused_by == Some(fault) {
                self.apply(at, fault, Change::Refuse { node, refusal: None });
            }
        }
        self.release_starved(at, fault);
        self.release_addresses(at, fault);
        self.release_software(at, fault);
        self.release_timing(at, fault);
        self.truth.end(at, fault);
    }

    /// What lies on the way of frames changes at an instant that may be ahead.
    pub(super) fn way_changes(&mut self, at: Instant) {
        self.changed_at = self.changed_at.max(at);
        self.forget_ways();
    }

    // ---- blame ----

    /// Who is to blame for what a link does not carry at an instant: who broke it or the supply at
    /// one of its ends, now or last.
    pub(super) fn blame(&self, link: usize, at: Instant) -> Option<FaultId> {
        let link = &self.links[link];
        let power = |end: End| end.node().map(|node| &self.nodes[node].power);
        let histories = || {
            let ends = link.both_ends().into_iter().filter_map(power);
            let way = std::iter::once(&link.contact).chain(&link.pair).chain(&link.passage);
            way.chain(ends)
        };
        histories()
            .find_map(|history| history.cause_at(at))
            .or_else(|| histories().find_map(|history| history.last_cause(at)))
    }

    /// The first instant of a span at which a line carries nothing, and by whose doing.
    pub(super) fn first_silence(
        &self,
        direction: DirectedLink,
        from: Instant,
        to: Instant,
    ) -> Option<(Instant, FaultId)> {
        let link = &self.links[direction.link];
        let (sender, _) = link.from_to(direction.downstream);
        let side = usize::from(direction.downstream);
        let contact = link.contact.first_break(from, to);
        let pair = link.pair[side].first_break(from, to);
        let passage = link.passage[side].first_break(from, to);
        let sender = sender.node().and_then(|node| self.nodes[node].power.first_break(from, to));
        [contact, pair, passage, sender].into_iter().flatten().min()
    }

    /// The card at a path.
    pub(crate) fn card(&self, path: Path) -> &Card {
        &self.cards[path.index()]
    }
}
