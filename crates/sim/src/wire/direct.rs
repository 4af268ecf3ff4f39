//! A frame that meets nothing but controllers at rest needs no walk: its way is known, and each
//! datagram is executed where it is for somebody.
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

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use linesman_proto::address::Path;
use linesman_proto::command::{Addressing, Command};
use linesman_proto::ethernet::{self, SOURCE_MARK, Wrapping};
use linesman_proto::frame::{DATAGRAM_HEADER_LEN, ETHERCAT_HEADER_LEN, FrameType, WKC_LEN};
use linesman_proto::register as r;
use linesman_proto::time::{Instant, Span};

use super::change::Line;
use super::route::Route;
use super::walk::{Outcome, Traveller};
use super::world::World;
use crate::controller::Header;

/// As many answers to "who maps these logical bytes" are kept.
const KEPT_QUERIES: usize = 1_024;

/// As many routes may wait to be noted.
const MOST_UNNOTED: usize = 8;

/// What is kept from frame to frame.
#[derive(Default, Debug)]
pub(crate) struct Direct {
    /// All frames are to walk.
    pub(crate) forbidden: bool,
    /// Frames that needed no walk.
    pub(crate) frames: u64,
    routes: [Known; 2],
    /// [`Directory::ways`](super::directory::Directory::ways) when the routes were found.
    ways: u64,
    /// Who maps these logical bytes: places on the route of a card, in order.
    queries: BTreeMap<(usize, u32, u16), Arc<[u32]>>,
    /// [`Directory::mappings`](super::directory::Directory::mappings) when they were asked.
    mappings: u64,
    /// Nodes at which something is due, nodes that were touched: kept for their memory.
    due: Vec<u32>,
    /// By card: until when no device samples anything new.
    resting: [Resting; 2],
    /// The last frame on each route since the last walk: where it came in is not noted yet.
    unnoted: Vec<Passed>,
    touched: Vec<u32>,
    places: Vec<u32>,
}

/// No device on a route samples anything new before an instant, as long as all this stays as it is.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
struct Resting {
    until: Instant,
    ways: u64,
    samplers_woken: u64,
    signals: u64,
}

/// A frame that did not walk.
#[derive(Debug)]
struct Passed {
    route: Arc<Route>,
    at: Instant,
    duration: Span,
    number: u64,
}

/// What is known of the way from a card.
#[derive(Clone, Default, Debug)]
enum Known {
    #[default]
    Nothing,
    /// There is none without a walk.
    NoRoute,
    Route(Arc<Route>),
}

impl Direct {
    /// Links or supplies have changed.
    pub(super) fn forget_routes(&mut self) {
        self.routes = [Known::Nothing, Known::Nothing];
        self.queries.clear();
    }
}

/// A frame on its way.
struct Journey<'a> {
    route: &'a Route,
    card: Path,
    at: Instant,
    duration: Span,
    number: u64,
}

impl Journey<'_> {
    fn at_place(&self, place: u32) -> (usize, Instant) {
        let visit = self.route.visits[place as usize];
        (visit.node as usize, self.at + visit.after)
    }
}

impl World {
    /// Sends a frame off by a card at `at`: past everybody at once if that comes to the same, else
    /// step by step.
    pub(crate) fn carry(&mut self, card: Path, at: Instant, traveller: &mut Traveller) -> Outcome {
        match self.go_directly(card, at, traveller) {
            Some(outcome) => {
                self.direct.frames += 1;
                outcome
            }
            None => {
                self.note_entries();
                self.walk(card, at, traveller)
            }
        }
    }

    /// Controllers learn when frames came in at their ports that did not walk: some of them latch
    /// the time of a frame other than the one that asks for it.
    pub(super) fn note_entries(&mut self) {
        for Passed { route, at, duration, number } in self.direct.unnoted.drain(..) {
            for (node, port, after) in &route.entries {
                let controller = &mut self.nodes.quietly(*node as usize).controller;
                controller.note_entry(*port, number, at + *after, duration);
            }
        }
    }

    /// Before ports of these nodes count anything: when the last frame came in there may tell what
    /// they count.
    fn note_entries_for(&mut self, due: &[u32]) {
        let nodes = &self.nodes;
        if !self.direct.unnoted.is_empty()
            && due.iter().any(|node| nodes[*node as usize].controller.has_port_events())
        {
            self.note_entries();
        }
    }

    /// Brings every node to `now` at which something is due.
    #[inline]
    pub(super) fn touch_due(&mut self, now: Instant) {
        let mut due = std::mem::take(&mut self.direct.due);
        due.clear();
        self.nodes.due_until(now, &mut due);
        if !due.is_empty() {
            self.note_entries_for(&due);
            // Devices meet in signals: the order is that of the nodes.
            due.sort_unstable();
            for node in &due {
                self.nodes[*node as usize].touch(now, &mut self.signals);
            }
        }
        self.direct.due = due;
    }

    fn passed(&mut self, route: Arc<Route>, at: Instant, duration: Span, number: u64) {
        if self.direct.unnoted.len() >= MOST_UNNOTED {
            self.note_entries();
        }
        let known = &mut self.direct.unnoted;
        match known.last_mut() {
            Some(last) if Arc::ptr_eq(&last.route, &route) => {
                (last.at, last.duration, last.number) = (at, duration, number);
            }
            _ => {
                known.retain(|passed| !Arc::ptr_eq(&passed.route, &route));
                known.push(Passed { route, at, duration, number });
            }
        }
    }

    fn go_directly(
        &mut self,
        card: Path,
        at: Instant,
        traveller: &mut Traveller,
    ) -> Option<Outcome> {
        if self.direct.forbidden || self.changed_at >= at || !traveller.frame.damage.is_intact() {
            return None;
        }
        let first = datagrams(&traveller.frame.bytes)?;
        self.nodes.settle();
        let route = self.route(card)?;
        let duration = traveller.frame.duration();
        if !self.is_calm(&route, at, duration) {
            return None;
        }
        let number = traveller.frame.number;
        let journey = Journey { route: &route, card, at, duration, number };
        self.prepare(&journey);
        let bytes = &mut traveller.frame.bytes;
        if route.marks_source {
            bytes[6] |= SOURCE_MARK;
        }
        self.execute_all(&journey, &mut bytes[first..]);
        self.end_all(&journey);
        let outcome = Outcome::Arrived(route.arrives_at, at + route.takes + duration);
        self.passed(route, at, duration, number);
        Some(outcome)
    }

    fn route(&mut self, card: Path) -> Option<Arc<Route>> {
        let ways = self.nodes.directory.ways();
        if self.direct.ways != ways {
            self.direct.ways = ways;
            self.direct.forget_routes();
        }
        if let Known::Nothing = self.direct.routes[card.index()] {
            let found = self.find_route(card);
            self.direct.routes[card.index()] =
                found.map_or(Known::NoRoute, |route| Known::Route(Arc::new(route)));
        }
        match &self.direct.routes[card.index()] {
            Known::Route(route) => Some(Arc::clone(route)),
            Known::Nothing | Known::NoRoute => None,
        }
    }

    /// Whether nothing on the way happens to a frame. Notes the nodes at which something is due
    /// that does not concern it.
    fn is_calm(&mut self, route: &Route, at: Instant, duration: Span) -> bool {
        for link in &self.noisy {
            for line in Line::both(*link) {
                let noise = &self.links[*link].noise[usize::from(line.downstream)];
                let Some(after) = route.crossing(line) else { continue };
                if noise.strikes(at + after, at + after + duration) {
                    return false;
                }
            }
        }
        let end = at + route.takes + duration;
        self.direct.due.clear();
        self.nodes.due_until(end, &mut self.direct.due);
        let nodes = &self.nodes;
        self.direct.due.iter().all(|node| nodes[*node as usize].next_way_event() > end)
    }

    /// What is due on the way is done, and inputs are sampled, as the frame comes by.
    fn prepare(&mut self, journey: &Journey<'_>) {
        let route = journey.route;
        let due = std::mem::take(&mut self.direct.due);
        self.note_entries_for(&due);
        let mut places = std::mem::take(&mut self.direct.places);
        places.clear();
        places.extend(due.iter().filter_map(|node| route.place(*node)));
        self.direct.due = due;
        let rests = places.is_empty() && self.rests(journey);
        if !places.is_empty() {
            places.sort_unstable();
        }
        let samplers = if rests { &[] } else { route.samplers.as_slice() };
        let mut samplers = samplers.iter().copied().peekable();
        let mut touches = places.iter().copied().peekable();
        loop {
            let place = match (touches.peek(), samplers.peek()) {
                (None, None) => break,
                (Some(place), None) | (None, Some(place)) => *place,
                (Some(one), Some(other)) => *one.min(other),
            };
            let (node, at) = journey.at_place(place);
            if touches.next_if_eq(&place).is_some() {
                self.nodes[node].touch(at, &mut self.signals);
                if self.nodes[node].controller.has_phy_acts() {
                    self.take_phy_acts(node);
                }
            }
            if samplers.next_if_eq(&place).is_some()
                && self.nodes[node].controller.wants_sample(&self.signals) <= at
            {
                let controller = &mut self.nodes[node].controller;
                controller.sample(at, &mut self.signals);
                controller.begin(at, journey.number);
                let _ = controller.end(at + journey.duration);
            }
        }
        self.direct.places = places;
        self.nodes.settle();
        if !rests {
            self.note_rest(journey);
        }
    }

    /// Whether no device on the way samples anything new.
    fn rests(&self, journey: &Journey<'_>) -> bool {
        let resting = &self.direct.resting[journey.card.index()];
        let end = journey.at + journey.route.takes;
        let same = Resting { until: resting.until, ..self.rest_now() };
        same == *resting && end < resting.until
    }

    /// What must stay as it is for devices to rest.
    fn rest_now(&self) -> Resting {
        Resting {
            until: Instant::ZERO,
            ways: self.nodes.directory.ways(),
            samplers_woken: self.nodes.samplers_woken(),
            signals: self.signals.edition(),
        }
    }

    fn note_rest(&mut self, journey: &Journey<'_>) {
        let visits = &journey.route.visits;
        let samplers = journey.route.samplers.iter();
        let nodes = samplers.map(|place| &self.nodes[visits[*place as usize].node as usize]);
        let wanted = nodes.map(|node| node.controller.wants_sample(&self.signals)).min();
        let until = wanted.unwrap_or(Instant::MAX);
        self.direct.resting[journey.card.index()] = Resting { until, ..self.rest_now() };
    }
}

/// Where the datagrams of a frame begin, if it is whole and they change nothing about its way.
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
fn leads_elsewhere(command: Command, header: &Header) -> bool {
    const SENSITIVE: [Range<usize>; 4] = [
        r::ESC_RESET_ECAT.address.0 as usize..r::ESC_RESET_ECAT.address.0 as usize + 2,
        r::DL_CONTROL.address.0 as usize..r::DL_CONTROL.address.0 as usize + 4,
        r::PHY_CONTROL_STATUS.address.0 as usize..r::PHY_CONTROL_STATUS.address.0 as usize + 16,
        r::RECEIVE_TIME.address.0 as usize..r::RECEIVE_TIME.address.0 as usize + 16,
    ];
    let effect = command.effect();
    if !(effect.writes || effect.multiple_write) || command.addressing() == Addressing::Logical {
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
