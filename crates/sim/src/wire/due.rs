//! Links notice what has become of their signal: detection times, loss, link up.

use std::collections::BTreeMap;

use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::End;

use super::link::EndState;
use super::world::World;
use crate::controller::{PhyAct, PortEvent};
use crate::hardware::PortKind;
use crate::truth::{Effect, Place};

/// What was scheduled for a link.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Due {
    /// An end finds its signal gone.
    Lost { link: usize, end: usize, epoch: u64 },
    /// Both ends have a link.
    Up { link: usize, epoch: u64 },
    /// A PHY does something to its link.
    Phy { link: usize, end: usize, act: PhyAct },
}

/// What is due, by time; of the same instant in the order in which it was scheduled.
#[derive(Clone, Default, Debug)]
pub(super) struct Agenda {
    due: BTreeMap<(Instant, u64), Due>,
    next: u64,
}

impl Agenda {
    pub(super) fn push(&mut self, at: Instant, due: Due) {
        self.due.insert((at, self.next), due);
        self.next += 1;
    }

    pub(super) fn next_at(&self) -> Option<Instant> {
        self.due.first_key_value().map(|((at, _), _)| *at)
    }

    pub(super) fn pop(&mut self) -> Option<(Instant, Due)> {
        self.due.pop_first().map(|((at, _), due)| (at, due))
    }
}

impl World {
    /// Whether the signal of a link is there in both directions: contact closed, both ends on.
    pub(super) fn has_signal(&self, link: usize) -> bool {
        let link = &self.links[link];
        let awake = link.asleep == [false; 2];
        awake && link.contact.is_whole() && link.both_ends().into_iter().all(|end| self.is_on(end))
    }

    fn is_on(&self, end: End) -> bool {
        end.node().is_none_or(|node| self.nodes[node].power.is_whole())
    }

    /// The signal of a link may have come or gone.
    pub(super) fn signal_changed(&mut self, index: usize, at: Instant) {
        let signal = self.has_signal(index);
        let flipped = self.links[index].signal != signal;
        self.links[index].signal = signal;
        self.links[index].epoch += u64::from(flipped);
        let epoch = self.links[index].epoch;
        if !signal {
            for (end, place) in self.links[index].both_ends().into_iter().enumerate() {
                if !self.is_on(place) {
                    self.links[index].ends[end] = EndState::Down;
                } else if self.links[index].ends[end] == EndState::Up {
                    self.links[index].ends[end] = EndState::Losing;
                    let detection = self.loss_detection(index, place);
                    self.agenda.push(at + detection, Due::Lost { link: index, end, epoch });
                }
            }
            return;
        }
        if !flipped {
            return;
        }
        if self.links[index].ends == [EndState::Losing; 2] {
            // Back before anyone noticed.
            self.links[index].ends = [EndState::Up; 2];
            return;
        }
        // One end that lost its link starts it anew, and the other sees that.
        for end in 0..2 {
            if self.links[index].ends[end] != EndState::Down {
                self.end_lost(index, end, at);
            }
        }
        self.agenda.push(at + self.link_up_time(index), Due::Up { link: index, epoch });
    }

    pub(super) fn serve(&mut self, at: Instant, due: Due) {
        match due {
            Due::Lost { link, end, epoch } => {
                let state = self.links[link].ends[end];
                if self.links[link].epoch == epoch && state == EndState::Losing {
                    self.end_lost(link, end, at);
                }
            }
            Due::Phy { link, end, act } => self.phy_acts(link, end, act, at),
            Due::Up { link, epoch } => {
                if self.links[link].epoch == epoch {
                    self.link_up(link, at);
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
        self.way_changes(at);
        self.links[index].ends = [EndState::Up; 2];
        let fault = self.cause_of_link(index, at).fault();
        self.links[index].dropped = None;
        if fault.is_some() {
            self.truth.effect(at, fault, self.link_place(index), Effect::SignalBack);
        }
        for place in self.links[index].both_ends() {
            match place {
                End::MainDevice(path) => self.cards[path.index()].set_carrier(at, true),
                End::Controller(node, port) => {
                    self.post(node, at, fault.into(), PortEvent::Link { port, up: true });
                }
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
