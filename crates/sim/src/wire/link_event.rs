//! Link events: detection times, loss of signal, link up.

use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::End;

use super::change::DirectedLink;
use super::link::{EndState, Medium};
use super::world::World;
use crate::controller::{PhyAction, PortEvent};
use crate::hardware::PortKind;
use crate::truth::{Effect, FaultId, Place};

/// What was scheduled for a link.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum LinkEvent {
    /// An end finds its signal gone.
    Lost { link: usize, end: usize, epoch: u64 },
    /// Both ends have a link.
    Up { link: usize, epochs: [u64; 2] },
    /// One end has a link.
    EndUp { link: usize, end: usize, epoch: u64 },
    /// A symbol is destroyed as a link comes up.
    Noise { direction: DirectedLink, flip: u8, fault: FaultId },
    /// A link that was up too early carries frames.
    Carries { link: usize, fault: FaultId },
    /// A PHY does something to its link.
    Phy { link: usize, end: usize, act: PhyAction },
}

impl World {
    /// Whether an end of a link receives symbols: way whole, both ends on and awake. Between media
    /// converters it is the near one that sends them.
    fn receives(&self, index: usize, end: usize) -> bool {
        let link = &self.links[index];
        let ends = link.both_ends();
        let is_there = |end: usize| self.is_on(ends[end]) && !link.asleep[end];
        let whole = link.contact.is_whole() && link.pair[end].is_whole();
        is_there(end) && (link.medium == Medium::Converters || (is_there(1 - end) && whole))
    }

    fn is_on(&self, end: End) -> bool {
        end.node().is_none_or(|node| self.nodes[node].power.is_whole())
    }

    /// Whether an end that loses its link takes the other's with it: by autonegotiation on copper,
    /// by the handshake of enhanced link detection on the E-bus (S1 chapter 6).
    fn falls_together(&self, index: usize, before: [bool; 2], now: [bool; 2]) -> bool {
        let link = &self.links[index];
        let one_sided = before[0] != before[1] || now[0] != now[1];
        let detects = |end: End| {
            end.node().is_some_and(|node| {
                self.nodes[node].controller.dl_status().enhanced_link_detection()
            })
        };
        match (link.medium, link.kind) {
            (Medium::Fibre | Medium::Converters, _) => false,
            (Medium::Direct, _) if link.has_hole() => false,
            (Medium::Direct, PortKind::Ebus) => {
                !one_sided || link.both_ends().into_iter().any(detects)
            }
            (Medium::Direct, PortKind::Mii | PortKind::Absent) => true,
        }
    }

    /// The signal of a link may have come or gone.
    pub(super) fn signal_changed(&mut self, index: usize, at: Instant) {
        let receives = [0, 1].map(|end| self.receives(index, end));
        let before = std::mem::replace(&mut self.links[index].receives, receives);
        let together = self.falls_together(index, before, receives);
        for end in 0..2 {
            let flipped = before[end] != receives[end] || (together && before != receives);
            self.links[index].epochs[end] += u64::from(flipped);
        }
        for (end, place) in self.links[index].both_ends().into_iter().enumerate() {
            if !self.is_on(place) {
                self.links[index].ends[end] = EndState::Down;
            } else if !receives[end] {
                self.begins_to_lose(index, end, at);
            }
        }
        if before == receives {
            return;
        }
        if together {
            if receives == [true; 2] {
                self.both_receive_again(index, at);
            }
            return;
        }
        for end in 0..2 {
            // An end that kept its signal may have waited for the other: now it goes on alone.
            let waits = self.links[index].ends[end] == EndState::Down;
            if receives[end] && (!before[end] || waits) {
                self.receives_again(index, end, at);
            }
        }
    }

    pub(super) fn begins_to_lose(&mut self, index: usize, end: usize, at: Instant) {
        if self.links[index].ends[end] == EndState::Up {
            self.links[index].ends[end] = EndState::Losing;
            let place = self.links[index].both_ends()[end];
            let detection = self.loss_detection(index, place);
            let epoch = self.links[index].epochs[end];
            self.link_events.push(at + detection, LinkEvent::Lost { link: index, end, epoch });
        }
    }

    fn both_receive_again(&mut self, index: usize, at: Instant) {
        let ends = self.links[index].ends;
        if !ends.contains(&EndState::Down) {
            // Back before anyone noticed.
            self.links[index].ends = [EndState::Up; 2];
            return;
        }
        // One end that lost its link starts it anew, and the other sees that.
        for (end, state) in ends.into_iter().enumerate() {
            if state != EndState::Down {
                self.end_lost(index, end, at);
            }
        }
        let epochs = self.links[index].epochs;
        self.link_events.push(at + self.link_up_time(index), LinkEvent::Up { link: index, epochs });
    }

    fn receives_again(&mut self, index: usize, end: usize, at: Instant) {
        match self.links[index].ends[end] {
            EndState::Losing => self.links[index].ends[end] = EndState::Up,
            EndState::Down => {
                let epoch = self.links[index].epochs[end];
                let up = at + self.link_up_time(index);
                self.link_events.push(up, LinkEvent::EndUp { link: index, end, epoch });
            }
            EndState::Up => {}
        }
    }

    pub(super) fn serve(&mut self, at: Instant, due: LinkEvent) {
        match due {
            LinkEvent::Lost { link, end, epoch } => {
                let state = self.links[link].ends[end];
                if self.links[link].epochs[end] == epoch && state == EndState::Losing {
                    self.end_lost(link, end, at);
                    let receives = self.links[link].receives;
                    if self.falls_together(link, receives, receives) {
                        self.begins_to_lose(link, 1 - end, at);
                    }
                }
            }
            LinkEvent::Phy { link, end, act } => self.phy_action(link, end, act, at),
            LinkEvent::Up { link, epochs } => {
                if self.links[link].epochs == epochs {
                    self.link_up(link, at);
                }
            }
            LinkEvent::EndUp { link, end, epoch } => {
                let waits = self.links[link].ends[end] == EndState::Down;
                if waits && self.links[link].epochs[end] == epoch {
                    self.end_up(link, end, at);
                    self.comes_up(link, at);
                }
            }
            LinkEvent::Noise { direction, flip, fault } => self.hit(at, fault, direction, flip),
            LinkEvent::Carries { link, fault } => {
                self.way_changes(at);
                for direction in DirectedLink::both(link) {
                    self.links[link].passage[usize::from(direction.downstream)].mend_at(at, fault);
                }
            }
        }
    }

    pub(super) fn end_lost(&mut self, index: usize, end: usize, at: Instant) {
        self.way_changes(at);
        self.links[index].ends[end] = EndState::Down;
        let place = self.links[index].both_ends()[end];
        let cause = self.cause_of_link(index, at);
        self.truth.effect(at, cause.fault(), self.link_place(index), Effect::SignalLost);
        match place {
            End::MainDevice(path) => self.cards[path.index()].set_carrier(at, false),
            End::Controller(node, port) => {
                self.post(node, at, cause, PortEvent::Link { port, up: false });
            }
        }
    }

    /// Both ends have a link.
    pub(super) fn link_up(&mut self, index: usize, at: Instant) {
        for end in 0..2 {
            self.end_up(index, end, at);
        }
        self.comes_up(index, at);
    }

    fn end_up(&mut self, index: usize, end: usize, at: Instant) {
        self.way_changes(at);
        self.links[index].ends[end] = EndState::Up;
        let fault = self.cause_of_link(index, at).fault();
        if fault.is_some() {
            self.truth.effect(at, fault, self.link_place(index), Effect::SignalBack);
        }
        match self.links[index].both_ends()[end] {
            End::MainDevice(path) => self.cards[path.index()].set_carrier(at, true),
            End::Controller(node, port) => {
                self.post(node, at, fault.into(), PortEvent::Link { port, up: true });
            }
        }
    }

    /// What a link does when it comes up: it may carry nothing yet, and it may be noisy.
    fn comes_up(&mut self, index: usize, at: Instant) {
        self.links[index].dropped = None;
        if let Some((blind, fault)) = self.links[index].early {
            for passage in &mut self.links[index].passage {
                passage.break_at(at, fault);
            }
            self.link_events.push(at + blind, LinkEvent::Carries { link: index, fault });
        }
        if let Some(fault) = self.blame(index, at) {
            for (direction, after, flip) in self.plug_noise.draw(index) {
                self.link_events.push(at + after, LinkEvent::Noise { direction, flip, fault });
            }
        }
    }

    pub(super) fn loss_detection(&self, link: usize, end: End) -> Span {
        match end {
            End::MainDevice(path) => self.cards[path.index()].loss_detection,
            End::Controller(node, _) => {
                let timing = self.nodes[node].controller.hardware().timing;
                match self.links[link].kind {
                    PortKind::Ebus => timing.ebus_loss_detection,
                    PortKind::Mii | PortKind::Absent => timing.mii_loss_detection,
                }
            }
        }
    }

    pub(super) fn link_up_time(&self, link: usize) -> Span {
        if let Some(said) = self.links[link].link_up {
            return said;
        }
        let times = self.links[link].both_ends().map(|end| match end {
            End::MainDevice(path) => self.cards[path.index()].link_up,
            End::Controller(node, _) => {
                let timing = self.nodes[node].controller.hardware().timing;
                match self.links[link].kind {
                    PortKind::Ebus => timing.ebus_link_up,
                    PortKind::Mii | PortKind::Absent => timing.mii_link_up,
                }
            }
        });
        times[0].max(times[1])
    }

    /// The place of a link in the truth log.
    pub(crate) fn link_place(&self, index: usize) -> Place {
        let link = &self.links[index];
        Place::Link(self.name_end(link.upstream), self.name_end(link.downstream))
    }
}
