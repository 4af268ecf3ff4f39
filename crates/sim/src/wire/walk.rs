//! The walk: one frame, from a card through every port it meets, in real order and real time.
//!
//! It is literal on purpose: each receiver checks the frame, each open loop sends it out, each line
//! may spoil, cut or swallow it. Nothing is known beforehand about where the frame will come out.
//!
//! Times are those of the frame's first bit. Behind a port's receiver a controller takes
//! `forward`, or `process` through its processing unit, to the transmitter of the next open port
//! (S1 figure 2); a line takes its transit time.

use linesman_proto::address::Path;
use linesman_proto::frame::size::BYTE_NS;
use linesman_proto::port::Port;
use linesman_proto::register::{self as r, ErrorCounter};
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::End;

use super::capture_probe::ProbeView;
use super::change::DirectedLink;
use super::world::World;
use crate::controller::{CountKind, Forwarding, PortEvent};
use crate::frame::{PREAMBLE_LEN, WireFrame};
use crate::truth::{Cause, Effect, FaultId, Place};

/// A frame in one controller meets each port at most this often: the rule on circulating frames
/// destroys it in its second round, unless the MainDevice has switched that off.
const MOST_STOPS: usize = 16;

/// A frame on its way, and who is to blame for its state.
#[derive(Debug)]
pub(crate) struct FrameInTransit {
    pub(crate) frame: WireFrame,
    /// Who spoiled it first.
    pub(crate) spoiled_by: Option<FaultId>,
    /// A processing unit marked it for what its sender put into it.
    pub(crate) refused: bool,
    /// Who sent it, if not the MainDevice.
    pub(crate) foreign_sender: Option<FaultId>,
}

impl FrameInTransit {
    /// A frame that leaves a card.
    pub(crate) const fn new(frame: WireFrame) -> Self {
        Self { frame, spoiled_by: None, refused: false, foreign_sender: None }
    }

    /// A frame that a foreign sender sends.
    pub(crate) const fn of(frame: WireFrame, foreign_sender: FaultId) -> Self {
        Self { frame, spoiled_by: None, refused: false, foreign_sender: Some(foreign_sender) }
    }

    /// Whose content it is.
    fn content(&self) -> Cause {
        self.foreign_sender.map_or(Cause::Content, Cause::Fault)
    }

    /// Why a receiver finds it damaged.
    fn cause(&self) -> Cause {
        match self.spoiled_by {
            Some(fault) => Cause::Fault(fault),
            None if self.refused => self.content(),
            None => Cause::Unknown,
        }
    }
}

/// Where a walk ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Outcome {
    /// At a card, with its last bit at this instant.
    Arrived(Path, Instant),
    /// Nowhere.
    Vanished,
}

/// What a line did to a frame.
enum Crossing {
    /// Its first bit is at the receiver at this instant; whether the line spoiled it.
    Through {
        at: Instant,
        spoiled: bool,
    },
    Lost,
}

impl World {
    /// Sends a frame off by a card at `at`, port by port.
    pub(crate) fn walk(
        &mut self,
        card: Path,
        at: Instant,
        in_transit: &mut FrameInTransit,
    ) -> Outcome {
        match self.leaving[card.index()] {
            Some(direction) => self.walk_from(direction, at, in_transit),
            None => Outcome::Vanished,
        }
    }

    /// Sends a frame along a line at `at`.
    pub(super) fn walk_from(
        &mut self,
        direction: DirectedLink,
        at: Instant,
        in_transit: &mut FrameInTransit,
    ) -> Outcome {
        let (mut direction, mut at) = (direction, at);
        let mut made_anew = false;
        // Every line twice in each direction is more than any frame can do.
        for _ in 0..4 * self.links.len() {
            let Crossing::Through { at: arrives, spoiled } = self.cross(direction, at, in_transit)
            else {
                return Outcome::Vanished;
            };
            let (_, to) = self.links[direction.link].from_to(direction.downstream);
            let (node, port) = match to {
                End::Controller(node, port) => (node, port),
                End::MainDevice(path) => {
                    return Outcome::Arrived(path, arrives + in_transit.frame.duration());
                }
            };
            if made_anew {
                self.symbol_error(arrives, in_transit.cause(), direction);
            }
            let Some((left_by, left_at)) =
                self.pass(node, port, direction, arrives, spoiled || made_anew, in_transit)
            else {
                return Outcome::Vanished;
            };
            let Some(next) = self.nodes[node].leaving[left_by] else {
                // A loop that stands open by hand, or port A as the last way out, with no plug.
                self.lost(left_at, None, Place::Device(self.id(node)), in_transit);
                return Outcome::Vanished;
            };
            let counting = self.nodes[node].controller.hardware().counting;
            made_anew = counting.remakes_symbol_errors && !in_transit.frame.damage.is_intact();
            (direction, at) = (next, left_at);
        }
        self.lost(at, None, self.direction_place(direction), in_transit);
        Outcome::Vanished
    }

    // ---- on a line ----

    /// Carries a frame along a line. Its first bit enters at `at`.
    #[inline]
    fn cross(
        &mut self,
        direction: DirectedLink,
        at: Instant,
        in_transit: &mut FrameInTransit,
    ) -> Crossing {
        let mut view = self.probe_view(direction, &in_transit.frame);
        let crossing = self.cross_by(direction, at, in_transit, view.as_deref_mut());
        if let Some(view) = view
            && (matches!(crossing, Crossing::Through { .. }) || !view.is_at_receiver())
        {
            self.passes_probe(*view, direction, at);
        }
        crossing
    }

    /// Carries a frame along a line, past a capture probe if one is looped in.
    #[inline]
    fn cross_by(
        &mut self,
        direction: DirectedLink,
        at: Instant,
        in_transit: &mut FrameInTransit,
        mut view: Option<&mut ProbeView>,
    ) -> Crossing {
        let link = &self.links[direction.link];
        let arrives = at + link.transit;
        let duration = in_transit.frame.duration();
        let mut spoiled = false;
        // The contact lies half way.
        let contact = at + Span::ns(link.transit.as_nanos() / 2);
        if let Some((cut, fault)) = self.first_silence(direction, contact, contact + duration) {
            let whole = in_transit.frame.byte_at(cut.since(contact));
            self.lost(cut, Some(fault), self.direction_place(direction), in_transit);
            match whole {
                Some(bytes) if cut > contact => {
                    in_transit.frame.bytes.truncate(bytes);
                    in_transit.frame.damage.cut_off = true;
                    in_transit.spoiled_by.get_or_insert(fault);
                    spoiled = true;
                    if let Some(view) = view.as_deref_mut().filter(|view| view.is_at_receiver()) {
                        view.cut_off(bytes);
                    }
                }
                Some(_) | None => return Crossing::Lost,
            }
        }
        let noise = &self.links[direction.link].noise[usize::from(direction.downstream)];
        if !noise.is_quiet() {
            match self.disturb(direction, arrives, duration, in_transit, view) {
                Some(hit) => spoiled |= hit,
                None => return Crossing::Lost,
            }
        }
        Crossing::Through { at: arrives, spoiled }
    }

    /// What noise does to a frame: whether it was spoiled; `None` when it is no frame any more.
    fn disturb(
        &mut self,
        direction: DirectedLink,
        arrives: Instant,
        duration: Span,
        in_transit: &mut FrameInTransit,
        mut view: Option<&mut ProbeView>,
    ) -> Option<bool> {
        let place = self.direction_place(direction);
        let noise = &mut self.links[direction.link].noise[usize::from(direction.downstream)];
        let frame_error = noise.strike(arrives);
        let hits: Vec<_> = noise.hits(arrives, arrives + duration).collect();
        let mut spoiled = false;
        let mut starts = true;
        for hit in hits {
            let offset = hit.at.since(arrives);
            starts &= !is_start_delimiter(offset);
            self.show_hit(view.as_deref_mut(), direction, offset, hit.flip, hit.fault);
            self.spoil(hit.at, offset, hit.flip, hit.fault, place, in_transit);
            spoiled = true;
        }
        if let Some(frame_error) = frame_error {
            let bytes = in_transit.frame.bytes.len() as u64;
            let byte = PREAMBLE_LEN as u64 + bytes * u64::from(frame_error.part) / (1 << 16);
            let offset = Span::ns(byte * BYTE_NS);
            self.symbol_error(arrives + offset, Cause::Fault(frame_error.fault), direction);
            self.show_hit(view, direction, offset, frame_error.flip, frame_error.fault);
            let at = arrives + offset;
            self.spoil(at, offset, frame_error.flip, frame_error.fault, place, in_transit);
            spoiled = true;
        }
        if !starts {
            // Without its start delimiter nobody takes it for a frame.
            self.miss_start(direction, arrives + duration, in_transit);
            return None;
        }
        Some(spoiled)
    }

    /// A capture probe sees what happens to a frame before it.
    fn show_hit(
        &self,
        view: Option<&mut ProbeView>,
        direction: DirectedLink,
        offset: Span,
        flip: u8,
        fault: FaultId,
    ) {
        if let Some(view) = view
            && self.is_before_probe(view, direction, fault)
        {
            view.spoil(offset, flip);
        }
    }

    /// A receiver sees a frame without a start: some count it, none passes it on.
    fn miss_start(&mut self, direction: DirectedLink, end: Instant, in_transit: &FrameInTransit) {
        let fault = in_transit.spoiled_by;
        self.lost(end, fault, self.direction_place(direction), in_transit);
        let (_, to) = self.links[direction.link].from_to(direction.downstream);
        match to {
            End::MainDevice(_) => {}
            End::Controller(node, port) => {
                if self.nodes[node].controller.hardware().counting.counts_missing_start {
                    let kind = CountKind::InvalidFrame;
                    self.post(node, end, fault.into(), PortEvent::Count { port, kind });
                }
            }
        }
    }

    /// Changes the byte that is `offset` behind a frame's first bit; the check sequence no longer
    /// fits.
    fn spoil(
        &mut self,
        at: Instant,
        offset: Span,
        flip: u8,
        fault: FaultId,
        place: Place,
        in_transit: &mut FrameInTransit,
    ) {
        let frame = &mut in_transit.frame;
        if let Some(byte) = frame.byte_at(offset).and_then(|byte| frame.bytes.get_mut(byte)) {
            *byte ^= flip;
        }
        frame.damage.fcs_bad = true;
        in_transit.spoiled_by.get_or_insert(fault);
        let effect = Effect::FrameSpoiled { frame: frame.number };
        self.truth.effect(at, Some(fault), place, effect);
    }

    fn lost(
        &mut self,
        at: Instant,
        fault: Option<FaultId>,
        place: Place,
        in_transit: &FrameInTransit,
    ) {
        let effect = Effect::FrameLost { frame: in_transit.frame.number };
        self.truth.effect(at, fault, place, effect);
    }

    // ---- in a controller ----

    /// Takes a frame in by a port and sends it out by another: which one, and when.
    #[inline]
    fn pass(
        &mut self,
        node: usize,
        port: Port,
        direction: DirectedLink,
        at: Instant,
        spoiled: bool,
        in_transit: &mut FrameInTransit,
    ) -> Option<(Port, Instant)> {
        let here = &mut self.nodes[node];
        if port == Port::A {
            here.touch(at, &mut self.signals);
        }
        if let Some((_, fault)) = here.power.first_break(at, at + Span::ns(1)) {
            self.lost(at, Some(fault), Place::Device(self.id(node)), in_transit);
            return None;
        }
        here.controller.enters(at, port, &in_transit.frame);
        if !in_transit.frame.damage.is_intact() {
            self.receive_damaged(node, port, at, spoiled, in_transit);
        }
        if !self.nodes[node].is_open_at(port, at) {
            let fault = self.blame(direction.link, at);
            self.lost(at, fault, self.direction_place(direction), in_transit);
            return None;
        }
        let timing = self.nodes[node].controller.hardware().timing;
        let mut processed = false;
        let mut stop = port;
        for _ in 0..MOST_STOPS {
            if stop == Port::A {
                if self.process(node, at, in_transit) == Forwarding::Destroy {
                    self.lost(at, in_transit.spoiled_by, Place::Device(self.id(node)), in_transit);
                    return None;
                }
                processed = true;
            }
            stop = stop.next();
            if self.nodes[node].is_open_at(stop, at) {
                let takes = if processed { timing.process } else { timing.forward };
                let leaves = at + takes;
                self.glitch(node, leaves, in_transit);
                return Some((stop, leaves));
            }
        }
        self.lost(at, None, Place::Device(self.id(node)), in_transit);
        None
    }

    /// A port counts a damaged frame, and marks it.
    fn receive_damaged(
        &mut self,
        node: usize,
        port: Port,
        at: Instant,
        spoiled: bool,
        in_transit: &mut FrameInTransit,
    ) {
        let forwarded = self.nodes[node].controller.hardware().counting.forwarded;
        let damage = &mut in_transit.frame.damage;
        let kind = if damage.marked && !spoiled && forwarded {
            CountKind::ForwardedError
        } else {
            CountKind::InvalidFrame
        };
        damage.marked = true;
        let end = at + in_transit.frame.duration();
        self.post(node, end, in_transit.cause(), PortEvent::Count { port, kind });
    }

    fn process(&mut self, node: usize, at: Instant, in_transit: &mut FrameInTransit) -> Forwarding {
        let intact = in_transit.frame.damage.is_intact();
        if !intact {
            let end = at + in_transit.frame.duration();
            let kind = CountKind::ProcessingUnitError;
            let event = PortEvent::Count { port: Port::A, kind };
            self.post(node, end, in_transit.cause(), event);
        }
        let errors = r::PROCESSING_UNIT_ERROR_COUNTER.address;
        self.nodes[node].touch(at, &mut self.signals);
        let controller = &mut self.nodes[node].controller;
        let before = controller.register(errors);
        let verdict = controller.process(at, &mut in_transit.frame, &mut self.signals);
        if controller.has_phy_actions() {
            self.take_phy_actions(node);
        }
        let controller = &mut self.nodes[node].controller;
        // At 255 the counter stands still, and the frame is marked all the same.
        let marked = intact && !in_transit.frame.damage.is_intact();
        if marked || controller.register(errors) > before {
            let id = controller.id();
            self.truth.may_move(id, ErrorCounter::ProcessingUnit, in_transit.content());
            in_transit.refused = true;
            let effect = Effect::ContentRefused { frame: in_transit.frame.number };
            let by = in_transit.spoiled_by.or(in_transit.foreign_sender);
            self.truth.effect(at, by, Place::Device(id), effect);
        }
        verdict
    }

    /// A fault inside spoils the frame before it is coded: whoever receives it finds it first.
    #[inline]
    fn glitch(&mut self, node: usize, at: Instant, in_transit: &mut FrameInTransit) {
        if self.nodes[node].glitches.is_empty() {
            return;
        }
        if let Some(glitch) = self.nodes[node].strike(at) {
            let bytes = in_transit.frame.bytes.len() as u64;
            let byte = PREAMBLE_LEN as u64 + bytes * u64::from(glitch.part) / (1 << 16);
            let offset = Span::ns(byte * BYTE_NS);
            let place = Place::Device(self.id(node));
            self.spoil(at + offset, offset, glitch.flip, glitch.fault, place, in_transit);
        }
    }
}

/// Whether the start delimiter is on the wire, the last byte of the preamble.
fn is_start_delimiter(offset: Span) -> bool {
    let byte = (offset.as_nanos() / BYTE_NS) as usize;
    byte == PREAMBLE_LEN - 1
}
