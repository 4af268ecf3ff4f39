//! A link: two ends, two directions, a contact that may open.
//!
//! Reference: S1 3.1 (loops follow links), 6 (physical layer); facts on cable delay: 5 ns/m.

use std::collections::VecDeque;

use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::End;

use super::outage_history::OutageHistory;
use crate::hardware::PortKind;
use crate::truth::{Cause, FaultId};

/// Signal delay of a copper cable.
pub const CABLE_NS_PER_M: f64 = 5.0;

/// A destroyed symbol on a line, at the receiver.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Hit {
    pub(super) at: Instant,
    pub(super) flip: u8,
    pub(super) fault: FaultId,
}

/// A hit that waits for a frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct ArmedFrameError {
    pub(super) from: Instant,
    pub(super) part: u16,
    pub(super) flip: u8,
    pub(super) fault: FaultId,
}

/// What lies in wait on one line.
#[derive(Clone, Default, Debug)]
pub(super) struct Noise {
    /// In the order of time.
    hits: VecDeque<Hit>,
    /// In the order of time.
    frame_errors: VecDeque<ArmedFrameError>,
}

impl Noise {
    pub(super) fn push_hit(&mut self, hit: Hit) {
        let behind = self.hits.iter().rev().take_while(|other| other.at > hit.at).count();
        self.hits.insert(self.hits.len() - behind, hit);
    }

    pub(super) fn arm_frame_error(&mut self, frame_error: ArmedFrameError) {
        self.frame_errors.push_back(frame_error);
    }

    #[inline]
    pub(super) fn is_quiet(&self) -> bool {
        self.hits.is_empty() && self.frame_errors.is_empty()
    }

    /// Whether a frame that is at the receiver from `from` until before `to` meets anything.
    pub(super) fn strikes(&self, from: Instant, to: Instant) -> bool {
        let waits = self.frame_errors.front().is_some_and(|frame_error| frame_error.from <= from);
        waits || self.hits(from, to).next().is_some()
    }

    /// The hits from `from` on and before `to`.
    pub(super) fn hits(&self, from: Instant, to: Instant) -> impl Iterator<Item = Hit> + '_ {
        let first = self.hits.partition_point(|hit| hit.at < from);
        self.hits.range(first..).take_while(move |hit| hit.at < to).copied()
    }

    /// What waits for a frame that begins at `from`, if anything does. It strikes once.
    pub(super) fn strike(&mut self, from: Instant) -> Option<ArmedFrameError> {
        let ready = self.frame_errors.front().is_some_and(|frame_error| frame_error.from <= from);
        if ready { self.frame_errors.pop_front() } else { None }
    }

    /// A fault is over: what still waits for a frame goes with it.
    pub(super) fn disarm(&mut self, fault: FaultId) {
        self.frame_errors.retain(|frame_error| frame_error.fault != fault);
    }

    /// Forgets hits before an instant.
    pub(super) fn forget(&mut self, before: Instant) {
        while self.hits.front().is_some_and(|hit| hit.at < before) {
            self.hits.pop_front();
        }
    }
}

/// How one end of a link stands.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub(super) enum EndState {
    /// No link.
    #[default]
    Down,
    /// A link.
    Up,
    /// A link whose signal is gone; the end will find out.
    Losing,
}

/// What a link is made of between its ends.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Medium {
    /// Contacts of the E-bus, or two pairs of copper with autonegotiation (100BASE-TX): an end that
    /// loses its signal starts the negotiation anew, and so the other end loses its link, too.
    #[default]
    Direct,
    /// Two fibres (100BASE-FX) without negotiation: an end that still receives light keeps its link,
    /// whatever the other one sees.
    Fibre,
    /// A pair of media converters: each end has a link to its own converter, whatever happens
    /// between the two.
    Converters,
}

/// A link between two ports.
#[derive(Clone, Debug)]
pub struct Link {
    /// The end nearer card A.
    pub upstream: End,
    /// The other end.
    pub downstream: End,
    /// What it is made of.
    pub kind: PortKind,
    /// How long a symbol is on its way, cable and both ports.
    pub transit: Span,
    /// What it is made of between its ends.
    pub medium: Medium,
    /// Time from the signal to the open loop; that of the slower end unless it is said.
    pub link_up: Option<Span>,
    /// The contact: both directions.
    pub contact: OutageHistory,
    /// A pair of wires or a fibre by itself, upstream line first: broken, its receiver has no signal.
    pub pair: [OutageHistory; 2],
    /// Upstream line first: broken, it swallows frames although both ends have a link.
    pub passage: [OutageHistory; 2],
    /// How long it shows up before it carries frames, each time, and whose doing that is.
    pub(super) early: Option<(Span, FaultId)>,
    /// By [`DirectedLink::downstream`](super::DirectedLink): upstream line first.
    pub(super) noise: [Noise; 2],
    /// Upstream end first.
    pub(super) ends: [EndState; 2],
    /// Whether symbols arrive at an end, upstream end first.
    pub(super) receives: [bool; 2],
    /// Counts changes of what an end receives, so that what was scheduled before one can be told.
    pub(super) epochs: [u64; 2],
    /// Whether the PHY of an end sleeps, upstream end first.
    pub(super) asleep: [bool; 2],
    /// Why a PHY dropped the link that its signal would have allowed.
    pub(super) dropped: Option<Cause>,
    /// The last bad symbols of each line, where its receiver looks out for them.
    pub(super) bad_symbols: [VecDeque<Instant>; 2],
}

impl Link {
    /// A link without any signal yet.
    #[must_use]
    pub fn new(upstream: End, downstream: End, kind: PortKind, transit: Span) -> Self {
        Self {
            upstream,
            downstream,
            kind,
            transit,
            medium: Medium::Direct,
            link_up: None,
            contact: OutageHistory::default(),
            pair: [OutageHistory::default(), OutageHistory::default()],
            passage: [OutageHistory::default(), OutageHistory::default()],
            early: None,
            noise: [Noise::default(), Noise::default()],
            ends: [EndState::Down; 2],
            receives: [true; 2],
            epochs: [0; 2],
            asleep: [false; 2],
            dropped: None,
            bad_symbols: [VecDeque::new(), VecDeque::new()],
        }
    }

    /// Both ends, upstream first.
    #[must_use]
    pub const fn both_ends(&self) -> [End; 2] {
        [self.upstream, self.downstream]
    }

    /// Whether something on it holds one direction apart from the other.
    pub(super) fn has_hole(&self) -> bool {
        self.passage.iter().any(|passage| !passage.is_whole())
    }

    /// The end that sends on a line and the one that receives.
    #[must_use]
    pub const fn from_to(&self, downstream: bool) -> (End, End) {
        if downstream { (self.upstream, self.downstream) } else { (self.downstream, self.upstream) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hit(nanos: u64) -> Hit {
        Hit { at: Instant::from_nanos(nanos), flip: 1, fault: FaultId(0) }
    }

    #[test]
    fn hits_are_found_by_time_in_whatever_order_they_came() {
        let mut noise = Noise::default();
        assert!(noise.is_quiet());
        for nanos in [5, 1, 9, 5] {
            noise.push_hit(hit(nanos));
        }
        let found = |from, to| noise.hits(Instant::from_nanos(from), Instant::from_nanos(to));
        assert_eq!(found(0, 100).count(), 4);
        assert_eq!(found(5, 9).count(), 2);
        assert_eq!(found(6, 9).count(), 0);
        noise.forget(Instant::from_nanos(6));
        assert_eq!(noise.hits(Instant::ZERO, Instant::MAX).collect::<Vec<_>>(), [hit(9)]);
    }

    #[test]
    fn armed_frame_error_strikes_once_and_goes_with_its_fault() {
        let mut noise = Noise::default();
        let wait = |from, fault| ArmedFrameError {
            from: Instant::from_nanos(from),
            part: 0,
            flip: 1,
            fault: FaultId(fault),
        };
        noise.arm_frame_error(wait(5, 1));
        noise.arm_frame_error(wait(7, 2));
        noise.arm_frame_error(wait(8, 1));
        assert_eq!(noise.strike(Instant::from_nanos(4)), None);
        assert_eq!(noise.strike(Instant::from_nanos(20)), Some(wait(5, 1)));
        noise.disarm(FaultId(2));
        assert_eq!(noise.strike(Instant::from_nanos(20)), Some(wait(8, 1)));
        assert!(noise.is_quiet());
    }
}
