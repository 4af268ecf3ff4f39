//! Links that a PHY drops although their signal is there: because it sees too many bad symbols, or
//! because the MainDevice told it to.
//!
//! Read first: S1, enhanced link detection; facts 3.5: at 32 bad symbols within 10 µs the port is
//! closed and the negotiation begins anew, so that the partner loses its link, too.

use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::End;

use super::change::DirectedLink;
use super::link::EndState;
use super::link_event::LinkEvent;
use super::outage_history::OutageHistory;
use super::world::World;
use crate::controller::PhyAction;
use crate::truth::Cause;

/// So many bad symbols ...
const MOST_BAD_SYMBOLS: usize = 32;
/// ... within this time are too many.
const WINDOW: Span = Span::us(10);

impl World {
    /// A receiver with enhanced link detection saw a bad symbol.
    pub(super) fn watch_symbols(&mut self, at: Instant, cause: Cause, direction: DirectedLink) {
        let link = &mut self.links[direction.link];
        let end = usize::from(direction.downstream);
        let seen = &mut link.bad_symbols[end];
        seen.push_back(at);
        if seen.len() > MOST_BAD_SYMBOLS {
            seen.pop_front();
        }
        let too_many = seen.len() == MOST_BAD_SYMBOLS
            && seen.front().is_some_and(|first| at.since(*first) <= WINDOW);
        if too_many && link.ends[end] == EndState::Up {
            seen.clear();
            self.drop_link(direction.link, end, cause, at);
        }
    }

    /// What the MainDevice wrote to PHYs of a controller is on its way.
    pub(super) fn take_phy_actions(&mut self, node: usize) {
        for (at, port, act) in self.nodes[node].controller.take_phy_actions() {
            let Some(direction) = self.nodes[node].leaving[port] else { continue };
            // The line leaves by its sender: that is this end.
            let end = usize::from(!direction.downstream);
            self.link_events
                .push(at.max(self.horizon), LinkEvent::Phy { link: direction.link, end, act });
        }
    }

    pub(super) fn phy_action(&mut self, link: usize, end: usize, act: PhyAction, at: Instant) {
        match act {
            PhyAction::Restart => self.drop_link(link, end, Cause::Content, at),
            PhyAction::Sleep => {
                self.links[link].asleep[end] = true;
                self.links[link].dropped.get_or_insert(Cause::Content);
                self.signal_changed(link, at);
            }
            PhyAction::Wake => {
                self.links[link].asleep[end] = false;
                self.links[link].dropped.get_or_insert(Cause::Content);
                self.signal_changed(link, at);
            }
        }
    }

    /// One end drops a link and negotiates anew: it has none from now on, the other end finds out.
    fn drop_link(&mut self, index: usize, end: usize, cause: Cause, at: Instant) {
        let link = &mut self.links[index];
        if link.receives != [true; 2] || link.ends[end] != EndState::Up {
            return;
        }
        link.dropped = Some(cause);
        for epoch in &mut link.epochs {
            *epoch += 1;
        }
        let epochs = link.epochs;
        self.end_lost(index, end, at);
        self.begins_to_lose(index, 1 - end, at);
        self.link_events.push(at + self.link_up_time(index), LinkEvent::Up { link: index, epochs });
    }

    /// Why a link is as it is: a PHY dropped it, or somebody broke it.
    pub(super) fn cause_of_link(&self, index: usize, at: Instant) -> Cause {
        let link = &self.links[index];
        let whole = link.contact.is_whole()
            && link.pair.iter().all(OutageHistory::is_whole)
            && link.both_ends().into_iter().all(|end| match end {
                End::MainDevice(_) => true,
                End::Controller(node, _) => self.nodes[node].power.is_whole(),
            });
        match link.dropped {
            Some(cause) if whole => cause,
            Some(_) | None => self.blame(index, at).into(),
        }
    }
}
