//! Fast path for undisturbed frames: route and addresses are known, so that each datagram is
//! executed only at the controllers that it is for.
//!
//! What comes of it is the same to the last bit; [`World::walk`] is what it is held against. So it
//! must be sure beforehand that the frame meets no destroyed symbol, no open contact, no failing
//! supply, no loop that opens or closes, no controller that waits for a frame, and nothing in its
//! datagrams that changes the way it takes itself. Where it is not sure, the frame walks.
//!
//! What a controller does by itself while the frame is on its way ([`Node::touch`](super::node::Node::touch))
//! and inputs that are sampled as it begins to pass are done at the frame's time at that
//! controller, in the order of the way, as in the walk.

mod execute;

use std::ops::Range;

use linesman_proto::address::Path;
use linesman_proto::command::{Addressing, Command};
use linesman_proto::ethernet::{self, SOURCE_MARK, Wrapping};
use linesman_proto::frame::{DATAGRAM_HEADER_LEN, ETHERCAT_HEADER_LEN, FrameType, WKC_LEN};
use linesman_proto::register as r;
use linesman_proto::time::{Instant, Span};

use super::address_cache::AddressCache;
use super::change::DirectedLink;
use super::route::Route;
use super::walk::{FrameInTransit, Outcome};
use super::world::World;
use crate::controller::Header;

/// What is kept from frame to frame.
#[derive(Default, Debug)]
pub(crate) struct FastPath {
    /// All frames are to walk.
    pub(crate) forbidden: bool,
    /// Frames that needed no walk.
    pub(crate) frames: u64,
    /// The way from each card.
    routes: [CachedRoute; 2],
    /// By card: the last frame that did not walk, if controllers do not know yet where it came in.
    last: [Option<FastFrame>; 2],
    /// Changes whenever ways are forgotten.
    edition: u64,
    /// [`AddressDirectory::ways`](super::address_directory::AddressDirectory::ways) when the ways were found.
    ways: u64,
    /// Who answers to what, on which way.
    address_cache: AddressCache,
    /// Nodes at which something is due: kept for its memory, as are those below.
    due: Vec<u32>,
    /// Places at which something is to be done before the datagrams, the last first.
    turns: Vec<u32>,
    /// Places that datagrams of this frame have touched.
    touched: Vec<u32>,
}

/// What is known of the way from a card.
#[derive(Default, Debug)]
enum CachedRoute {
    #[default]
    Nothing,
    /// There is none without a walk.
    NoWay,
    Way(Box<Route>),
}

/// A frame that did not walk.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) struct FastFrame {
    pub(super) number: u64,
    pub(super) at: Instant,
    pub(super) duration: Span,
}

/// A frame on its way.
struct FastTransit<'a> {
    route: &'a Route,
    card: Path,
    at: Instant,
    duration: Span,
    number: u64,
}

impl FastTransit<'_> {
    #[inline]
    fn at_place(&self, place: u32) -> (usize, Instant) {
        let visit = self.route.visits[place as usize];
        (visit.node as usize, self.at + visit.after)
    }
}

impl World {
    /// Sends a frame off by a card at `at`: past everybody at once if that comes to the same, else
    /// step by step.
    pub(crate) fn carry(
        &mut self,
        card: Path,
        at: Instant,
        in_transit: &mut FrameInTransit,
    ) -> Outcome {
        match self.go_directly(card, at, in_transit) {
            Some(outcome) => {
                self.fast_path.frames += 1;
                outcome
            }
            None => {
                self.note_entries();
                self.walk(card, at, in_transit)
            }
        }
    }

    /// Controllers learn when frames came in at their ports that did not walk: some of them latch
    /// the time of a frame other than the one that asks for it.
    pub(super) fn note_entries(&mut self) {
        for card in self.fast_path.by_age() {
            if let Some(passed) = self.fast_path.last[card].take()
                && let CachedRoute::Way(route) = &self.fast_path.routes[card]
            {
                self.nodes.note_entries(route.entries(), passed);
            }
        }
    }

    /// Before ports of these nodes count anything: when the last frame came in there may tell what
    /// they count. The way of a frame that is being sent is `leaving`.
    fn note_entries_for(&mut self, due: &[u32], leaving: Option<&FastTransit<'_>>) {
        for node in due.iter().copied() {
            if !self.nodes[node as usize].controller.has_port_events() {
                continue;
            }
            for card in self.fast_path.by_age() {
                let leaving = leaving.filter(|transit| transit.card.index() == card);
                let route = match (leaving, &self.fast_path.routes[card]) {
                    (Some(transit), _) => transit.route,
                    (None, CachedRoute::Way(route)) => route,
                    (None, CachedRoute::Nothing | CachedRoute::NoWay) => continue,
                };
                if let Some(passed) = self.fast_path.last[card] {
                    self.nodes.note_entries(route.entries_of(node), passed);
                }
            }
        }
    }

    /// Links, loops or supplies have changed.
    pub(super) fn forget_ways(&mut self) {
        self.note_entries();
        self.fast_path.routes = [CachedRoute::Nothing, CachedRoute::Nothing];
        self.fast_path.edition += 1;
        self.nodes.forget_departures();
    }

    /// Brings every node to `now` at which something is due.
    #[inline]
    pub(super) fn touch_due(&mut self, now: Instant) {
        if self.nodes.may_be_due(now) {
            self.touch_all_due(now);
        }
    }

    fn touch_all_due(&mut self, now: Instant) {
        let mut due = std::mem::take(&mut self.fast_path.due);
        self.nodes.due_until(now, &mut due);
        if !due.is_empty() {
            self.note_entries_for(&due, None);
            // Devices meet in signals: the order is that of the nodes.
            due.sort_unstable();
            for node in due.drain(..) {
                self.nodes[node as usize].touch(now, &mut self.signals);
            }
        }
        self.fast_path.due = due;
    }

    fn go_directly(
        &mut self,
        card: Path,
        at: Instant,
        in_transit: &mut FrameInTransit,
    ) -> Option<Outcome> {
        if self.fast_path.forbidden || self.changed_at >= at || !in_transit.frame.damage.is_intact()
        {
            return None;
        }
        let first = datagrams(&in_transit.frame.bytes)?;
        if self.signals.has_fresh() {
            self.hear_signals(None);
        }
        self.nodes.settle();
        let route = self.take_way(card)?;
        let edition = self.fast_path.edition;
        let (duration, number) = (in_transit.frame.duration(), in_transit.frame.number);
        let transit = FastTransit { route: &route, card, at, duration, number };
        let outcome = self.is_calm(&transit).then(|| {
            self.prepare(&transit);
            let bytes = &mut in_transit.frame.bytes;
            if route.marks_source {
                bytes[6] |= SOURCE_MARK;
            }
            self.execute_all(&transit, &mut bytes[first..]);
            if !self.fast_path.touched.is_empty() {
                self.end_all(&transit);
            }
            self.fast_path.last[card.index()] = Some(FastFrame { number, at, duration });
            Outcome::Arrived(route.arrives_at, at + route.takes + duration)
        });
        self.fast_path.routes[card.index()] = CachedRoute::Way(route);
        if self.fast_path.edition != edition {
            self.forget_ways();
        }
        outcome
    }

    /// The way from a card, to be put back.
    #[inline]
    fn take_way(&mut self, card: Path) -> Option<Box<Route>> {
        let ways = self.nodes.address_directory.ways();
        if self.fast_path.ways != ways {
            self.forget_ways();
            self.fast_path.ways = ways;
        }
        match std::mem::take(&mut self.fast_path.routes[card.index()]) {
            CachedRoute::Way(route) => Some(route),
            CachedRoute::Nothing => self.find_way(card),
            CachedRoute::NoWay => {
                self.fast_path.routes[card.index()] = CachedRoute::NoWay;
                None
            }
        }
    }

    fn find_way(&mut self, card: Path) -> Option<Box<Route>> {
        let Some(route) = self.find_route(card) else {
            self.fast_path.routes[card.index()] = CachedRoute::NoWay;
            return None;
        };
        let visits = route.visits.iter().map(|visit| (visit.node, visit.after));
        self.nodes.plan_departures(card, visits);
        Some(Box::new(route))
    }

    /// Whether nothing on the way happens to a frame.
    #[inline]
    fn is_calm(&mut self, transit: &FastTransit<'_>) -> bool {
        let FastTransit { route, at, duration, .. } = *transit;
        for link in &self.noisy {
            for direction in DirectedLink::both(*link) {
                let noise = &self.links[*link].noise[usize::from(direction.downstream)];
                let Some(after) = route.crossing(direction) else { continue };
                if noise.strikes(at + after, at + after + duration) {
                    return false;
                }
            }
        }
        !self.nodes.ways_change_until(at + route.takes + duration)
    }

    /// What is due on the way is done, and inputs are sampled, as the frame comes by.
    #[inline]
    fn prepare(&mut self, transit: &FastTransit<'_>) {
        if self.nodes.may_meet(transit.card, transit.at) {
            self.meet(transit);
        }
    }

    fn meet(&mut self, transit: &FastTransit<'_>) {
        let mut due = std::mem::take(&mut self.fast_path.due);
        self.nodes.met_by(transit.card, transit.at, &mut due);
        if !due.is_empty() {
            self.take_turns(transit, &due);
            due.clear();
        }
        self.fast_path.due = due;
    }

    fn take_turns(&mut self, transit: &FastTransit<'_>, met: &[u32]) {
        self.note_entries_for(met, Some(transit));
        self.fast_path.turns.clear();
        let places = met.iter().filter_map(|node| transit.route.place(*node));
        self.fast_path.turns.extend(places);
        self.fast_path.turns.sort_unstable_by_key(|place| std::cmp::Reverse(*place));
        while let Some(place) = self.fast_path.turns.pop() {
            let (node, at) = transit.at_place(place);
            self.nodes[node].touch(at, &mut self.signals);
            if self.nodes[node].controller.has_phy_actions() {
                self.take_phy_actions(node);
            }
            self.hear_signals(Some((transit.route, place)));
            if self.nodes[node].next_sample() <= at {
                let controller = &mut self.nodes[node].controller;
                controller.sample(at, &mut self.signals);
                controller.begin(at, transit.number);
                let _ = controller.end(at + transit.duration);
                self.hear_signals(Some((transit.route, place)));
            }
        }
        self.nodes.settle();
    }

    /// Devices hear of the signals that have changed: those behind a place on the way of a frame
    /// sample them as it comes by, all others with the next.
    fn hear_signals(&mut self, behind: Option<(&Route, u32)>) {
        while let Some(signal) = self.signals.take_fresh() {
            for listener in self.nodes.listeners(signal) {
                let node = self.nodes.listener(listener);
                if !self.nodes[node as usize].controller.waits_for_signals() {
                    continue;
                }
                self.nodes[node as usize].controller.hear();
                let Some((route, here)) = behind else { continue };
                if let Some(place) = route.place(node).filter(|place| *place > here) {
                    let turns = &mut self.fast_path.turns;
                    let at = turns.partition_point(|other| *other > place);
                    if turns.get(at) != Some(&place) {
                        turns.insert(at, place);
                    }
                }
            }
        }
    }
}

impl FastPath {
    /// The cards, that whose last frame came earlier first.
    fn by_age(&self) -> [usize; 2] {
        if self.last[0] <= self.last[1] { [0, 1] } else { [1, 0] }
    }
}

/// Where the datagrams of a frame begin, if it is whole and they change nothing about its way.
#[inline]
fn datagrams(bytes: &[u8]) -> Option<usize> {
    let (wrapping, header_at) = ethernet::locate(bytes)?;
    if wrapping == Wrapping::Udp {
        return None;
    }
    let kind = FrameType::from_bits(bytes.get(header_at + 1)? >> 4);
    if kind != FrameType::Datagrams {
        return None;
    }
    let first = header_at + ETHERCAT_HEADER_LEN;
    let mut rest = &bytes[first..];
    loop {
        let (header, body) = rest.split_first_chunk::<DATAGRAM_HEADER_LEN>()?;
        let read = Header::read(header);
        rest = body.get(read.len + WKC_LEN..)?;
        if read.command.is_some_and(|command| leads_elsewhere(command, &read)) {
            return None;
        }
        if !read.more {
            return Some(first);
        }
    }
}

/// Whether a datagram writes what the rest of its frame's way depends on: resets, loops, PHYs, and
/// receive times, which are taken on the way back, too.
#[inline]
fn leads_elsewhere(command: Command, header: &Header) -> bool {
    const SENSITIVE: [Range<usize>; 4] = [
        r::ESC_RESET_ECAT.address.0 as usize..r::ESC_RESET_ECAT.address.0 as usize + 2,
        r::DL_CONTROL.address.0 as usize..r::DL_CONTROL.address.0 as usize + 4,
        r::PHY_CONTROL_STATUS.address.0 as usize..r::PHY_CONTROL_STATUS.address.0 as usize + 16,
        r::RECEIVE_TIME.address.0 as usize..r::RECEIVE_TIME.address.0 as usize + 16,
    ];
    let effect = command.effect();
    if !(effect.writes || effect.multiple_write) || effect.addressing == Addressing::Logical {
        return false;
    }
    // Where a read goes with a write, 0x0108 may move the write.
    if effect.reads && effect.writes && !effect.multiple_write {
        return true;
    }
    let start = usize::from(header.ado);
    let end = start + header.len;
    SENSITIVE.iter().any(|area| start < area.end && area.start < end)
}
