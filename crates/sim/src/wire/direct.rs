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

use std::ops::Range;

use linesman_proto::address::Path;
use linesman_proto::command::{Addressing, Command};
use linesman_proto::ethernet::{self, SOURCE_MARK, Wrapping};
use linesman_proto::frame::{DATAGRAM_HEADER_LEN, ETHERCAT_HEADER_LEN, FrameType, WKC_LEN};
use linesman_proto::register as r;
use linesman_proto::time::{Instant, Span};

use super::change::Line;
use super::kept::Kept;
use super::route::Route;
use super::walk::{Outcome, Traveller};
use super::world::World;
use crate::controller::Header;

/// What is kept from frame to frame.
#[derive(Default, Debug)]
pub(crate) struct Direct {
    /// All frames are to walk.
    pub(crate) forbidden: bool,
    /// Frames that needed no walk.
    pub(crate) frames: u64,
    /// The way from each card.
    known: [Known; 2],
    /// By card: the last frame that did not walk, if controllers do not know yet where it came in.
    last: [Option<Passed>; 2],
    /// Changes whenever ways are forgotten.
    edition: u64,
    /// [`Directory::ways`](super::directory::Directory::ways) when the ways were found.
    ways: u64,
    /// Who answers to what, on which way.
    kept: Kept,
    /// Nodes at which something is due: kept for its memory, as are those below.
    due: Vec<u32>,
    /// Places at which something is to be done before the datagrams, the last first.
    turns: Vec<u32>,
    /// Places that datagrams of this frame have touched.
    touched: Vec<u32>,
}

/// What is known of the way from a card.
#[derive(Default, Debug)]
enum Known {
    #[default]
    Nothing,
    /// There is none without a walk.
    NoWay,
    Way(Box<Route>),
}

/// A frame that did not walk.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) struct Passed {
    pub(super) number: u64,
    pub(super) at: Instant,
    pub(super) duration: Span,
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
    #[inline]
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
        for card in self.direct.by_age() {
            if let Some(passed) = self.direct.last[card].take()
                && let Known::Way(route) = &self.direct.known[card]
            {
                self.nodes.note_entries(route.entries(), passed);
            }
        }
    }

    /// Before ports of these nodes count anything: when the last frame came in there may tell what
    /// they count. The way of a frame that is being sent is `leaving`.
    fn note_entries_for(&mut self, due: &[u32], leaving: Option<&Journey<'_>>) {
        for node in due.iter().copied() {
            if !self.nodes[node as usize].controller.has_port_events() {
                continue;
            }
            for card in self.direct.by_age() {
                let leaving = leaving.filter(|journey| journey.card.index() == card);
                let route = match (leaving, &self.direct.known[card]) {
                    (Some(journey), _) => journey.route,
                    (None, Known::Way(route)) => route,
                    (None, Known::Nothing | Known::NoWay) => continue,
                };
                if let Some(passed) = self.direct.last[card] {
                    self.nodes.note_entries(route.entries_of(node), passed);
                }
            }
        }
    }

    /// Links, loops or supplies have changed.
    pub(super) fn forget_ways(&mut self) {
        self.note_entries();
        self.direct.known = [Known::Nothing, Known::Nothing];
        self.direct.edition += 1;
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
        let mut due = std::mem::take(&mut self.direct.due);
        self.nodes.due_until(now, &mut due);
        if !due.is_empty() {
            self.note_entries_for(&due, None);
            // Devices meet in signals: the order is that of the nodes.
            due.sort_unstable();
            for node in due.drain(..) {
                self.nodes[node as usize].touch(now, &mut self.signals);
            }
        }
        self.direct.due = due;
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
        if self.signals.has_fresh() {
            self.hear_signals(None);
        }
        self.nodes.settle();
        let route = self.take_way(card)?;
        let edition = self.direct.edition;
        let (duration, number) = (traveller.frame.duration(), traveller.frame.number);
        let journey = Journey { route: &route, card, at, duration, number };
        let outcome = self.is_calm(&journey).then(|| {
            self.prepare(&journey);
            let bytes = &mut traveller.frame.bytes;
            if route.marks_source {
                bytes[6] |= SOURCE_MARK;
            }
            self.execute_all(&journey, &mut bytes[first..]);
            if !self.direct.touched.is_empty() {
                self.end_all(&journey);
            }
            self.direct.last[card.index()] = Some(Passed { number, at, duration });
            Outcome::Arrived(route.arrives_at, at + route.takes + duration)
        });
        self.direct.known[card.index()] = Known::Way(route);
        if self.direct.edition != edition {
            self.forget_ways();
        }
        outcome
    }

    /// The way from a card, to be put back.
    #[inline]
    fn take_way(&mut self, card: Path) -> Option<Box<Route>> {
        let ways = self.nodes.directory.ways();
        if self.direct.ways != ways {
            self.forget_ways();
            self.direct.ways = ways;
        }
        match std::mem::take(&mut self.direct.known[card.index()]) {
            Known::Way(route) => Some(route),
            Known::Nothing => self.find_way(card),
            Known::NoWay => {
                self.direct.known[card.index()] = Known::NoWay;
                None
            }
        }
    }

    fn find_way(&mut self, card: Path) -> Option<Box<Route>> {
        let Some(route) = self.find_route(card) else {
            self.direct.known[card.index()] = Known::NoWay;
            return None;
        };
        let visits = route.visits.iter().map(|visit| (visit.node, visit.after));
        self.nodes.plan_departures(card, visits);
        Some(Box::new(route))
    }

    /// Whether nothing on the way happens to a frame.
    #[inline]
    fn is_calm(&mut self, journey: &Journey<'_>) -> bool {
        let Journey { route, at, duration, .. } = *journey;
        for link in &self.noisy {
            for line in Line::both(*link) {
                let noise = &self.links[*link].noise[usize::from(line.downstream)];
                let Some(after) = route.crossing(line) else { continue };
                if noise.strikes(at + after, at + after + duration) {
                    return false;
                }
            }
        }
        !self.nodes.ways_change_until(at + route.takes + duration)
    }

    /// What is due on the way is done, and inputs are sampled, as the frame comes by.
    #[inline]
    fn prepare(&mut self, journey: &Journey<'_>) {
        if self.nodes.may_meet(journey.card, journey.at) {
            self.meet(journey);
        }
    }

    fn meet(&mut self, journey: &Journey<'_>) {
        let mut due = std::mem::take(&mut self.direct.due);
        self.nodes.met_by(journey.card, journey.at, &mut due);
        if !due.is_empty() {
            self.take_turns(journey, &due);
            due.clear();
        }
        self.direct.due = due;
    }

    fn take_turns(&mut self, journey: &Journey<'_>, met: &[u32]) {
        self.note_entries_for(met, Some(journey));
        self.direct.turns.clear();
        let places = met.iter().filter_map(|node| journey.route.place(*node));
        self.direct.turns.extend(places);
        self.direct.turns.sort_unstable_by_key(|place| std::cmp::Reverse(*place));
        while let Some(place) = self.direct.turns.pop() {
            let (node, at) = journey.at_place(place);
            self.nodes[node].touch(at, &mut self.signals);
            if self.nodes[node].controller.has_phy_acts() {
                self.take_phy_acts(node);
            }
            self.hear_signals(Some((journey.route, place)));
            if self.nodes[node].next_sample() <= at {
                let controller = &mut self.nodes[node].controller;
                controller.sample(at, &mut self.signals);
                controller.begin(at, journey.number);
                let _ = controller.end(at + journey.duration);
                self.hear_signals(Some((journey.route, place)));
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
                    let turns = &mut self.direct.turns;
                    let at = turns.partition_point(|other| *other > place);
                    if turns.get(at) != Some(&place) {
                        turns.insert(at, place);
                    }
                }
            }
        }
    }
}

impl Direct {
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
