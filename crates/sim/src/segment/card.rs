//! A card of the MainDevice: it sends, receives, checks, and counts as a real one does.

use std::collections::VecDeque;

use linesman_proto::time::{Instant, Span};

use super::tx_delay::TxDelay;
use crate::truth::FaultId;

/// What a card's driver tells: carrier and counters since the start of the run.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct HostPort {
    /// Whether there is a link.
    pub carrier: bool,
    /// How often the carrier came or went.
    pub carrier_changes: u64,
    /// Frames given to the wire.
    pub tx_frames: u64,
    /// Frames that could not be sent: no carrier, or longer than Ethernet allows.
    pub tx_dropped: u64,
    /// Frames received and passed on.
    pub rx_frames: u64,
    /// Frames dropped because their check sequence was wrong.
    pub rx_crc_errors: u64,
    /// Frames dropped because they were too short: rests of frames.
    pub rx_length_errors: u64,
    /// Frames that came back whole, and that the host lost before anyone could read them.
    pub rx_dropped: u64,
}

/// So long after one change of a link the kernel may keep the next one to itself (`net/core/link_watch.c` of
/// Linux, `linkwatch_schedule_work`); a carrier that lets frames through again it tells at once.
const TOLD_APART: Span = Span::s(1);

/// What became of the frames that the MainDevice's cards sent, since the start of the run.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct FrameTally {
    /// Given to the wire.
    pub sent: u64,
    /// Came back as they should.
    pub whole: u64,
    /// Came back damaged: the card drops them.
    pub damaged: u64,
    /// Will not come back.
    pub vanished: u64,
    /// Came back, and were lost by the host.
    pub dropped: u64,
}

/// A card, with its PHY.
#[derive(Clone, Debug)]
pub(crate) struct Card {
    /// Receiver and transmitter together, for one crossing.
    pub(crate) crossing: Span,
    /// From the loss of the signal to the loss of the carrier.
    pub(crate) loss_detection: Span,
    /// From the signal to the carrier: auto-negotiation.
    pub(crate) link_up: Span,
    /// Counters; its carrier is that of `carrier`.
    pub(crate) counts: HostPort,
    /// When it sends nothing, and whose doing that is.
    silent: Vec<(Instant, Instant, FaultId)>,
    /// How late its frames leave.
    pub(super) tx_delay: TxDelay,
    /// Changes of the carrier that are known, in the order of time.
    carrier: Vec<(Instant, bool)>,
    /// The carrier that the kernel has told of by itself, and when.
    told: (bool, Instant),
    /// Frames that the host loses after they came back, in the order of time.
    drops: VecDeque<(Instant, FaultId)>,
    /// When the last frame has left.
    pub(crate) sent_until: Instant,
}

impl Default for Card {
    fn default() -> Self {
        Self {
            crossing: Span::ns(400),
            loss_detection: Span::ms(1),
            link_up: Span::ms(1_600),
            counts: HostPort::default(),
            silent: Vec::new(),
            tx_delay: TxDelay::default(),
            carrier: Vec::new(),
            told: (false, Instant::ZERO),
            drops: VecDeque::new(),
            sent_until: Instant::ZERO,
        }
    }
}

impl Card {
    pub(crate) fn set_carrier(&mut self, at: Instant, up: bool) {
        self.carrier.push((at, up));
    }

    pub(crate) fn drop_next(&mut self, from: Instant, fault: FaultId) {
        self.drops.push_back((from, fault));
    }

    /// Who makes the host lose a frame that arrives at `now`, if anyone does.
    #[inline]
    pub(crate) fn dropped(&mut self, now: Instant) -> Option<FaultId> {
        self.drops.pop_front_if(|(from, _)| *from <= now).map(|(_, fault)| fault)
    }

    /// A fault is healed: what still waits for a frame goes with it.
    pub(crate) fn disarm(&mut self, fault: FaultId) {
        self.delay_no_more(fault);
        self.drops.retain(|(_, by)| *by != fault);
    }

    #[inline]
    pub(crate) fn has_carrier(&self, at: Instant) -> bool {
        let known = self.carrier.iter().rev().find(|(since, _)| *since <= at);
        known.map_or(self.counts.carrier, |(_, up)| *up)
    }

    /// Whether the kernel tells of the carrier at `now` without being asked, which it does once for a change.
    #[inline]
    pub(crate) fn takes_news(&mut self, now: Instant) -> bool {
        let is_up = self.has_carrier(now);
        let (told, at) = self.told;
        let is_news = is_up != told && (is_up || now >= at + TOLD_APART);
        if is_news {
            self.told = (is_up, now);
        }
        is_news
    }

    /// From one instant to another it sends nothing.
    pub(crate) fn mute(&mut self, from: Instant, until: Instant, fault: FaultId) {
        self.silent.retain(|(_, end, _)| *end > from);
        self.silent.push((from, until, fault));
    }

    /// A fault is over: it sends again.
    pub(crate) fn unmute(&mut self, at: Instant, fault: FaultId) {
        for (_, until, by) in &mut self.silent {
            if *by == fault {
                *until = at.min(*until);
            }
        }
    }

    /// Whose doing it is that it sends nothing at an instant.
    #[inline]
    pub(crate) fn silenced_by(&self, at: Instant) -> Option<FaultId> {
        let silent = self.silent.iter().find(|(from, until, _)| (*from..*until).contains(&at));
        silent.map(|(_, _, fault)| *fault)
    }

    /// Until when it sends nothing, of an instant at which it does not.
    pub(crate) fn silent_until(&self, at: Instant) -> Option<Instant> {
        let silent = self.silent.iter().filter(|(from, until, _)| (*from..*until).contains(&at));
        silent.map(|(_, until, _)| *until).max()
    }

    /// Whether the kernel hands frames to the driver at an instant: until it knows that there is no carrier, and
    /// while the card takes any.
    pub(super) fn takes_frames(&self, at: Instant) -> bool {
        (self.has_carrier(at) || self.told.0) && self.silenced_by(at).is_none()
    }

    /// Makes the changes of the carrier up to `now`.
    #[inline]
    pub(crate) fn settle(&mut self, now: Instant) {
        if !self.carrier.is_empty() {
            self.change_carrier(now);
        }
    }

    fn change_carrier(&mut self, now: Instant) {
        let due = self.carrier.partition_point(|(at, _)| *at <= now);
        for (_, up) in self.carrier.drain(..due) {
            if self.counts.carrier != up {
                self.counts.carrier = up;
                self.counts.carrier_changes += 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_carrier_is_known_ahead_and_shown_when_its_time_comes() {
        let at = Instant::from_nanos;
        let mut card = Card::default();
        card.set_carrier(at(10), true);
        card.set_carrier(at(20), false);
        let ahead = [5, 10, 19, 20].map(|nanos| card.has_carrier(at(nanos)));
        assert_eq!(ahead, [false, true, true, false]);
        assert!(!card.counts.carrier);
        card.settle(at(15));
        assert!(card.counts.carrier && card.counts.carrier_changes == 1);
        card.settle(at(25));
        assert!(!card.counts.carrier && card.counts.carrier_changes == 2);
        assert!(!card.has_carrier(at(30)));
    }

    #[test]
    fn a_carrier_that_comes_is_told_at_once_and_one_that_goes_soon_after_a_second_later() {
        let ms = |ms| Instant::ZERO + Span::ms(ms);
        let mut card = Card::default();
        for (at, up) in [(10, true), (2_000, false), (3_600, true), (3_700, false)] {
            card.set_carrier(ms(at), up);
        }
        let told: Vec<u64> = (0..5_000).filter(|now| card.takes_news(ms(*now))).collect();
        assert_eq!(told, [10, 2_000, 3_600, 4_600]);
    }
}
