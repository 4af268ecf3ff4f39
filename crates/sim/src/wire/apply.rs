//! Each change of the world, made at its instant.
//!
//! One arm a change. What takes more than a few lines is a method in the file of its concept.

use linesman_proto::register::ErrorCounter;
use linesman_proto::time::Instant;
use linesman_proto::topology::End;

use super::change::{Change, DirectedLink};
use super::link::{ArmedFrameError, Hit};
use super::node::{Glitch, NodeAction};
use super::world::World;
use crate::controller::{CountKind, PortEvent};
use crate::device::Refusal;
use crate::truth::{Cause, Effect, FaultId, Place};

impl World {
    // Long for its number of changes: one short arm each.
    pub(super) fn apply(&mut self, at: Instant, fault: FaultId, change: Change) {
        match change {
            Change::Hit { direction, flip } => self.hit(at, fault, direction, flip),
            Change::FrameHit { direction, part, flip } => {
                let frame_error = ArmedFrameError { from: at, part, flip, fault };
                self.links[direction.link].noise[usize::from(direction.downstream)]
                    .arm_frame_error(frame_error);
                self.is_noisy(direction.link);
            }
            Change::Open { link } => {
                self.way_changes(at);
                let was_whole = self.links[link].contact.is_whole();
                self.links[link].contact.break_at(at, fault);
                if was_whole {
                    self.signal_changed(link, at);
                }
            }
            Change::Close { link } => {
                self.way_changes(at);
                self.links[link].contact.mend_at(at, fault);
                if self.links[link].contact.is_whole() {
                    self.signal_changed(link, at);
                }
            }
            Change::Break { direction } => {
                self.way_changes(at);
                self.links[direction.link].pair[usize::from(direction.downstream)]
                    .break_at(at, fault);
                self.signal_changed(direction.link, at);
            }
            Change::Mend { direction } => {
                self.way_changes(at);
                self.links[direction.link].pair[usize::from(direction.downstream)]
                    .mend_at(at, fault);
                self.signal_changed(direction.link, at);
            }
            Change::Swallow { direction } => {
                self.way_changes(at);
                self.links[direction.link].passage[usize::from(direction.downstream)]
                    .break_at(at, fault);
            }
            Change::Carry { direction } => {
                self.way_changes(at);
                self.links[direction.link].passage[usize::from(direction.downstream)]
                    .mend_at(at, fault);
            }
            Change::Early { link, blind } => {
                self.links[link].early = blind.map(|blind| (blind, fault));
            }
            Change::ForeignSender { direction, what } => {
                self.foreign_senders.push(at, fault, direction, what)
            }
            Change::Delay { card, by } => self.cards[card.index()].delay_next(at, by, fault),
            Change::Drop { card } => self.cards[card.index()].drop_next(at, fault),
            Change::Off { node } => {
                self.way_changes(at);
                let was_on = self.nodes[node].power.is_whole();
                self.nodes[node].power.break_at(at, fault);
                let place = Place::Device(self.id(node));
                self.truth.effect(at, Some(fault), place, Effect::PowerLost);
                if was_on {
                    self.nodes[node].act_at(at, NodeAction::Off);
                    self.supply_changed(node, at);
                }
            }
            Change::On { node } => {
                self.way_changes(at);
                self.nodes[node].power.mend_at(at, fault);
                if self.nodes[node].power.is_whole() {
                    let place = Place::Device(self.id(node));
                    self.truth.effect(at, Some(fault), place, Effect::PowerBack);
                    self.nodes[node].act_at(at, NodeAction::On);
                    self.supply_changed(node, at);
                }
            }
            Change::Glitch { node, part, flip } => {
                self.nodes[node].glitches.push_back(Glitch { from: at, part, flip, fault });
            }
            Change::Silence { path, until } => self.silence(at, fault, path, until),
            Change::Watchdog { node, time } => self.set_watchdog(at, fault, node, time),
            Change::Readdress { node, like } => self.readdress(at, fault, node, like),
            Change::Software { node, change } => self.change_software(at, fault, node, change),
            Change::Timing { node, change } => self.change_timing(at, fault, node, change),
            Change::Late { path, by } => self.make_late(at, fault, path, by),
            Change::Refuse { node, refusal } => {
                self.nodes[node].refused_by = refusal.map(|_| fault);
                self.nodes[node].act_at(at, NodeAction::Refuse(refusal));
                if let Some(Refusal { code, .. }) = refusal {
                    let place = Place::Device(self.id(node));
                    let effect = Effect::StateRefused { code: code.0 };
                    self.truth.effect(at, Some(fault), place, effect);
                }
            }
        }
    }

    fn supply_changed(&mut self, node: usize, at: Instant) {
        let links = self.nodes[node].leaving.0;
        for direction in links.into_iter().flatten() {
            self.signal_changed(direction.link, at);
        }
    }

    /// A symbol is destroyed. Without a signal there is none to destroy.
    pub(super) fn hit(&mut self, at: Instant, fault: FaultId, direction: DirectedLink, flip: u8) {
        let link = &mut self.links[direction.link];
        if !link.receives[usize::from(direction.downstream)] {
            return;
        }
        link.noise[usize::from(direction.downstream)].push_hit(Hit { at, flip, fault });
        self.is_noisy(direction.link);
        self.symbol_error(at, Cause::Fault(fault), direction);
    }

    /// The receiver of a line sees a symbol that it cannot decode.
    pub(super) fn symbol_error(&mut self, at: Instant, cause: Cause, direction: DirectedLink) {
        self.truth.effect(at, cause.fault(), self.direction_place(direction), Effect::SymbolError);
        let (_, to) = self.links[direction.link].from_to(direction.downstream);
        if let End::Controller(node, port) = to {
            self.post(node, at, cause, PortEvent::Count { port, kind: CountKind::SymbolError });
            if self.nodes[node].controller.has_enhanced_link_detection(port) {
                self.watch_symbols(at, cause, direction);
            }
        }
    }

    /// Tells a controller, and the log what may move because of it.
    pub(super) fn post(&mut self, node: usize, at: Instant, cause: Cause, event: PortEvent) {
        self.nodes[node].controller.post(at, event);
        let counter = match event {
            PortEvent::Link { up: true, .. } => return,
            PortEvent::Link { port, up: false } => ErrorCounter::LostLink(port),
            PortEvent::Count { port, kind } => match kind {
                CountKind::SymbolError => ErrorCounter::PhysicalLayer(port),
                CountKind::InvalidFrame => ErrorCounter::InvalidFrame(port),
                CountKind::ForwardedError => ErrorCounter::Forwarded(port),
                CountKind::ProcessingUnitError => ErrorCounter::ProcessingUnit,
                CountKind::LostLink => ErrorCounter::LostLink(port),
            },
        };
        self.truth.may_move(self.id(node), counter, cause);
    }
}
