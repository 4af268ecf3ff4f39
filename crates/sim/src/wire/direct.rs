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

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use linesman_proto::address::{LogicalAddress, Path};
use linesman_proto::command::{Addressing, Command};
use linesman_proto::ethernet::{self, SOURCE_MARK, Wrapping};
use linesman_proto::frame::{DATAGRAM_HEADER_LEN, ETHERCAT_HEADER_LEN, FrameType, WKC_LEN};
use linesman_proto::register as r;
use linesman_proto::time::{Instant, Span};

use super::change::Line;
use super::route::Route;
use super::walk::{Outcome, Traveller};
use super::world::World;
use crate::controller::{Answer, Header, PlainRead};

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

    fn execute_all(&mut self, journey: &Journey<'_>, bytes: &mut [u8]) {
        let interrupting = self.nodes.directory.interrupting();
        let irq = interrupting.iter().filter(|node| journey.route.place(**node).is_some());
        let irq = irq.fold(0, |irq, node| irq | self.nodes[*node as usize].controller.irq());
        let mut rest = bytes;
        while let Some((header, body)) = rest.split_first_chunk_mut::<DATAGRAM_HEADER_LEN>() {
            let read = Header::read(header);
            if irq != 0 {
                let irq = u16::from_le_bytes([header[8], header[9]]) | irq;
                header[8..10].copy_from_slice(&irq.to_le_bytes());
            }
            let (data, behind) = body.split_at_mut(read.len);
            let Some((counter, next)) = behind.split_first_chunk_mut::<WKC_LEN>() else { return };
            if let Some(command) = read.command {
                if command.increments_position() {
                    let passed = read.adp.wrapping_add(journey.route.visits.len() as u16);
                    header[2..4].copy_from_slice(&passed.to_le_bytes());
                }
                let increment = self.execute(journey, command, read, data);
                *counter = u16::from_le_bytes(*counter).wrapping_add(increment).to_le_bytes();
            }
            if !read.more {
                return;
            }
            rest = next;
        }
    }

    /// Executes a datagram at everybody it is for, and says what to add to its working counter.
    fn execute(
        &mut self,
        journey: &Journey<'_>,
        command: Command,
        header: Header,
        data: &mut [u8],
    ) -> u16 {
        let effect = command.effect();
        let plain = if effect.reads && !effect.writes && !effect.multiple_write {
            PlainRead::of(header.ado, header.len)
        } else {
            None
        };
        let addressing = command.addressing();
        if effect.multiple_write {
            return self.execute_everywhere(journey, addressing, header, data);
        }
        let ors = effect.ors;
        match addressing {
            Addressing::None => 0,
            Addressing::Broadcast => match plain {
                Some(read) => self.broadcast(journey, &read, header, data),
                None => self.execute_everywhere(journey, addressing, header, data),
            },
            Addressing::Position => {
                let first = usize::from(0_u16.wrapping_sub(header.adp));
                let header = Header { adp: 0, ..header };
                let mut sum = 0_u16;
                for place in (first..journey.route.visits.len()).step_by(1 << 16) {
                    let place = place as u32;
                    sum = sum.wrapping_add(self.one(
                        journey,
                        place,
                        plain.as_ref(),
                        ors,
                        header,
                        data,
                    ));
                }
                sum
            }
            Addressing::Station => {
                let mut places = std::mem::take(&mut self.direct.places);
                places.clear();
                let nodes = self.nodes.directory.stations(header.adp);
                places.extend(nodes.filter_map(|node| journey.route.place(node)));
                if places.len() > 1 {
                    places.sort_unstable();
                }
                let mut sum = 0_u16;
                for place in &places {
                    sum = sum.wrapping_add(self.one(
                        journey,
                        *place,
                        plain.as_ref(),
                        ors,
                        header,
                        data,
                    ));
                }
                self.direct.places = places;
                sum
            }
            Addressing::Logical => {
                let places = self.mapped(journey, header.logical(), header.len);
                let mut sum = 0_u16;
                for place in places.iter() {
                    sum = sum.wrapping_add(self.at(journey, *place, header, data));
                }
                sum
            }
        }
    }

    /// Reads registers of all controllers into one.
    fn broadcast(
        &mut self,
        journey: &Journey<'_>,
        read: &PlainRead,
        header: Header,
        data: &mut [u8],
    ) -> u16 {
        let mut sum = 0_u16;
        for place in 0..journey.route.visits.len() {
            let node = journey.route.visits[place].node as usize;
            match self.nodes[node].controller.read_plainly(read, data, true) {
                Answer::Nothing => {}
                Answer::Read => sum = sum.wrapping_add(1),
                Answer::Effect => {
                    sum = sum.wrapping_add(self.at(journey, place as u32, header, data));
                }
            }
        }
        sum
    }

    /// Goes past all controllers, as auto-increment and multiple-write commands need it.
    fn execute_everywhere(
        &mut self,
        journey: &Journey<'_>,
        addressing: Addressing,
        header: Header,
        data: &mut [u8],
    ) -> u16 {
        let counts = addressing == Addressing::Position;
        let mut sum = 0_u16;
        for place in 0..journey.route.visits.len() as u32 {
            let adp = if counts { header.adp.wrapping_add(place as u16) } else { header.adp };
            sum = sum.wrapping_add(self.at(journey, place, Header { adp, ..header }, data));
        }
        sum
    }

    /// Executes a datagram at one controller that it is for.
    #[inline]
    fn one(
        &mut self,
        journey: &Journey<'_>,
        place: u32,
        plain: Option<&PlainRead>,
        ors: bool,
        header: Header,
        data: &mut [u8],
    ) -> u16 {
        if let Some(read) = plain {
            let node = journey.route.visits[place as usize].node as usize;
            match self.nodes[node].controller.read_plainly(read, data, ors) {
                Answer::Nothing => return 0,
                Answer::Read => return 1,
                Answer::Effect => {}
            }
        }
        self.at(journey, place, header, data)
    }

    /// Executes a datagram at one controller.
    #[inline]
    fn at(&mut self, journey: &Journey<'_>, place: u32, header: Header, data: &mut [u8]) -> u16 {
        let (index, at) = journey.at_place(place);
        let node = self.nodes.quietly(index);
        if node.last_frame != journey.number {
            node.last_frame = journey.number;
            node.controller.begin(at, journey.number);
            self.direct.touched.push(place);
        }
        node.controller.execute(&header, data)
    }

    /// The frame has passed all.
    fn end_all(&mut self, journey: &Journey<'_>) {
        let mut touched = std::mem::take(&mut self.direct.touched);
        for place in touched.drain(..) {
            let (index, at) = journey.at_place(place);
            let changed = self.nodes.quietly(index).controller.end(at + journey.duration);
            if changed {
                self.nodes.wake(index);
            } else {
                self.nodes.reschedule(index);
            }
        }
        self.direct.touched = touched;
    }

    /// Places on the way with FMMUs that map any of these logical bytes, in order.
    fn mapped(&mut self, journey: &Journey<'_>, start: LogicalAddress, len: usize) -> Arc<[u32]> {
        let directory = &self.nodes.directory;
        if self.direct.mappings != directory.mappings() || self.direct.queries.len() > KEPT_QUERIES
        {
            self.direct.mappings = directory.mappings();
            self.direct.queries.clear();
        }
        let key = (journey.card.index(), start.0, len as u16);
        if let Some(places) = self.direct.queries.get(&key) {
            return Arc::clone(places);
        }
        let nodes = directory.mapping(start, len);
        let mut places: Vec<u32> = nodes.filter_map(|node| journey.route.place(node)).collect();
        places.sort_unstable();
        places.dedup();
        let places: Arc<[u32]> = places.into();
        self.direct.queries.insert(key, Arc::clone(&places));
        places
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
