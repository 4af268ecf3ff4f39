//! Pairing of requests with their returns.
//!
//! A live socket knows what it sent and what it received. Most captures do not: there a frame is a
//! return when it fits an outstanding request and differs from it in what controllers change, or
//! carries the mark that the first controller sets in the source address. A frame that fits no
//! request is a return whose request was not seen if it is marked like one or was answered, and a
//! new request otherwise.
//!
//! Frames of one line come back in the order in which they were sent, so a request that later ones
//! overtook is lost. What was recorded is not quite in that order, though: a card takes frames from several
//! queues, and a long frame among many short ones is noted late. So a few that overtake a request lose it
//! only when it has been out for long; where time stamps do not tell, since those of captures jump and run
//! backwards, many do.

mod loss;
mod one_way;
mod request_copy;
mod returned;
mod sent_by;

use std::collections::VecDeque;

use linesman_proto::address::Path;
use linesman_proto::ethernet::MacAddress;
use linesman_proto::frame::FrameView;
use linesman_proto::time::{Instant, Span};

use self::one_way::OneWay;
use super::sender::{Senders, Written};
use super::{Direction, Exchange, Fingerprint, FrameCopy, FrameSeen, Sender};

/// Most requests waiting for their return; beyond, the oldest is lost.
const MOST_PENDING: usize = 256;
/// On a live socket a frame that is not back by then never comes.
const TIMEOUT: Span = Span::ms(100);
/// Two equal requests closer than this are one that was recorded twice: the shortest frame takes
/// longer.
const RECORDED_TWICE: Span = Span::us(3);
/// When the input ends, so many requests may be on their way.
const MOST_IN_FLIGHT: usize = 32;
/// And for so long.
const IN_FLIGHT: Span = Span::ms(5);
/// The copy for the other card of a ring follows within this time.
const OTHER_CARD: Span = Span::ms(1);
/// How many returns are remembered to know one that was recorded twice.
const REMEMBERED: usize = 8;

/// What a frame turned out to be, besides the exchange it may complete.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum PairingOutcome {
    /// A request.
    Request,
    /// The same request by the other card.
    RequestCopy,
    /// A return.
    Return,
    /// A return whose request was not seen.
    ReturnAlone,
    /// A frame that was recorded twice.
    Duplicate,
}

/// Requests that wait for their return.
#[derive(Clone, Default, Debug)]
pub struct Pairing {
    pending: VecDeque<PendingRequest>,
    spare: Vec<Vec<u8>>,
    spare_sums: Vec<Vec<u16>>,
    returned: [Option<(Fingerprint, Instant)>; REMEMBERED],
    returned_next: usize,
    senders: Senders,
    returns: u64,
    one_way: OneWay,
    /// The second card of a ring, where cards are not told apart: it sends what the first one sends.
    other_card: Option<MacAddress>,
    /// Requests of which both copies came back.
    whole: u64,
    /// Whether that is so of the latest one of which it is known.
    was_whole: bool,
    /// True if the ring was whole once, and of a later request one copy alone came back.
    has_lost_copies: bool,
    /// Returns that were taken for requests, since this was asked.
    mistaken: u64,
    /// Requests that were sent and not recorded, as their numbers tell, since this was asked.
    unrecorded: u64,
    /// Frames that came back a second time, since this was asked.
    doubled: u64,
    /// Returns without a request since the recording began to look as if it had no requests.
    alone: u32,
}

#[derive(Clone, Debug)]
struct PendingRequest {
    print: Fingerprint,
    bytes: Vec<u8>,
    time: Instant,
    number: u64,
    path: Option<Path>,
    source: MacAddress,
    /// Who sent the same at the same time: the other card of a ring.
    copy_by: Option<MacAddress>,
    /// Whether it is a copy for the other card with less in it.
    is_part: bool,
    is_live: bool,
    sent: [bool; 2],
    /// Copies that are still out.
    out: u8,
    /// Requests of which both copies had come back when it went out, if the latest one was one of them.
    whole_before: Option<u64>,
    /// The card to which the first copy came back.
    came_to: Path,
    overtaken: u16,
    returns_before: u64,
    /// Working counters of copies that came back.
    sums: Vec<u16>,
}

impl PendingRequest {
    fn copy(&self) -> FrameCopy<'_> {
        FrameCopy { bytes: &self.bytes, time: self.time, number: self.number, path: self.path }
    }
}

impl Pairing {
    /// Takes a whole, undamaged frame, and hands over every exchange it completes or settles.
    pub fn take(
        &mut self,
        frame: &FrameSeen<'_>,
        view: &FrameView<'_>,
        print: Fingerprint,
        settle: &mut impl FnMut(&Exchange<'_>),
    ) -> PairingOutcome {
        let source = view.source();
        let is_unknown = frame.direction == Direction::Unknown;
        // In a recording of returns alone the copy that card B sent looks like a request; what card A sent is no
        // answer to it.
        let is_others = |pending: &PendingRequest| {
            is_unknown
                && source.is_marked()
                && !pending.source.is_marked()
                && pending.copy_by.is_none()
                && pending.source.marked() != source
        };
        // Indexes are used again: of several that fit, one that others overtook is lost.
        let fits = |pending: &PendingRequest| {
            pending.print.lasting == print.lasting && !is_others(pending)
        };
        let fitting = self.pending.iter().enumerate().filter(|(_, pending)| fits(pending));
        let found = fitting.min_by_key(|(_, pending)| pending.overtaken).map(|(index, pending)| {
            // Who asks the same again long after has given the first one up.
            let is_old = gap(pending.time, frame.time) > IN_FLIGHT;
            let newest = || self.pending.iter().rposition(fits);
            if is_old { newest().unwrap_or(index) } else { index }
        });
        if is_unknown && self.is_one_way_for_sure() && !source.is_marked() {
            // The copy of a ring's second card, which no controller has touched.
            return PairingOutcome::Duplicate;
        }
        let is_return = match frame.direction {
            Direction::Sent => false,
            Direction::Received => true,
            Direction::Unknown => self.is_return(found, source, print),
        };
        if !is_return {
            let other = |found: usize| self.pending[found].source != source;
            let is_repeated = found.is_some_and(other) || self.other_card == Some(source);
            return self.request(frame, source, is_repeated, print, settle);
        }
        let Some(found) = found else {
            if self.was_returned(print, frame.time, RECORDED_TWICE) {
                return PairingOutcome::Duplicate;
            }
            if frame.direction == Direction::Received
                && self.was_returned(print, frame.time, TIMEOUT)
            {
                self.doubled += 1;
                return PairingOutcome::Duplicate;
            }
            if frame.direction == Direction::Unknown {
                self.weigh_one_way(source, print, settle);
            }
            self.remember(print, frame.time);
            self.note_elsewhere(frame, view, source, print);
            settle(&Exchange {
                request: None,
                reply: Some(copy(frame)),
                earlier: &[],
                is_last: true,
                returns_before: self.returns,
                is_cut_off: false,
                is_part: false,
                copy_lost: None,
                copy_gone: None,
                sent_by: None,
            });
            self.returns += 1;
            return PairingOutcome::ReturnAlone;
        };
        self.one_way = OneWay::No;
        self.remember(print, frame.time);
        self.returns += 1;
        self.give_back(found, frame, view, settle);
        PairingOutcome::Return
    }

    /// Settles what a live socket waited for in vain.
    pub fn expire(&mut self, now: Instant, settle: &mut impl FnMut(&Exchange<'_>)) {
        while self.timeout().is_some_and(|at| at <= now) {
            self.lose(0, false, settle);
        }
    }

    /// When [`Pairing::expire`] has something to do.
    #[must_use]
    pub fn timeout(&self) -> Option<Instant> {
        self.pending.front().filter(|oldest| oldest.is_live).map(|oldest| oldest.time + TIMEOUT)
    }

    /// Settles all requests that are still out: the input has ended at `now`.
    pub fn finish(&mut self, now: Instant, settle: &mut impl FnMut(&Exchange<'_>)) {
        // An input that stops between requests and their returns loses nothing.
        let waiting = || self.pending.iter().filter(|pending| pending.overtaken == 0);
        let is_short = match (waiting().next(), waiting().next_back()) {
            (Some(first), Some(last)) => gap(first.time, last.time) <= IN_FLIGHT,
            (None, _) | (_, None) => true,
        };
        let is_few = waiting().count() <= MOST_IN_FLIGHT;
        // Who listened on for so long would have seen them.
        let is_late = waiting().next_back().is_some_and(|last| gap(last.time, now) >= TIMEOUT);
        let may_return = self.returns > 0 && is_short && is_few && !is_late;
        while let Some(oldest) = self.pending.front() {
            let is_cut_off = may_return && oldest.overtaken == 0;
            self.lose(0, is_cut_off, settle);
        }
    }

    /// Forgets what is still out: frames were missed, and their returns may be among them.
    pub fn forget(&mut self) {
        self.pending.clear();
    }

    /// Requests whose return is still awaited.
    #[must_use]
    pub fn outstanding(&self) -> usize {
        self.pending.len()
    }

    /// Who sent requests, at most four.
    #[must_use]
    pub fn senders(&self) -> &[Sender] {
        self.senders.all()
    }

    /// Whether there is a new sender, or one proved to be none's second card, since this was asked.
    pub fn senders_changed(&mut self) -> bool {
        self.senders.take_changed()
    }

    /// Whether a frame of unknown direction is on its way back.
    fn is_return(&self, found: Option<usize>, source: MacAddress, print: Fingerprint) -> bool {
        if self.is_one_way_for_sure() {
            return true;
        }
        let Some(pending) = found.map(|index| &self.pending[index]) else {
            let is_own = |sender: &Sender| !sender.mac.is_marked() && sender.mac.marked() == source;
            return print.is_answered
                || self.one_way == OneWay::From(source)
                || self.senders.all().iter().any(is_own);
        };
        // The copy of the other card comes back as it went, as long as the ring is whole: nobody on its
        // way processes it.
        let is_copy = self.other_card == Some(source)
            && (pending.copy_by == Some(source) || pending.source == source);
        if print.changing != pending.print.changing || is_copy {
            return true;
        }
        match (pending.source.is_marked(), source.is_marked()) {
            (false, marked) => marked,
            // An address that is marked from the start shows nothing. Where answers are known to
            // come, a second frame is the return; else it is the request again.
            (true, _) => self.returns > 0,
        }
    }

    fn request(
        &mut self,
        frame: &FrameSeen<'_>,
        source: MacAddress,
        is_repeated: bool,
        print: Fingerprint,
        settle: &mut impl FnMut(&Exchange<'_>),
    ) -> PairingOutcome {
        if self.take_copy(frame, source, is_repeated, print) {
            return PairingOutcome::RequestCopy;
        }
        let was_recorded = |pending: &PendingRequest| {
            pending.print == print
                && pending.path == frame.path
                && gap(pending.time, frame.time) <= RECORDED_TWICE
                && pending.bytes == frame.bytes
        };
        // What is recorded twice follows at once, so only the latest ones can be meant.
        if frame.direction == Direction::Unknown
            && self.pending.iter().rev().take(8).any(was_recorded)
        {
            return PairingOutcome::Duplicate;
        }
        // For the two cards of a ring some commands are replaced by NOP, now in the one copy, now in the other.
        let is_twin = |pending: &PendingRequest| {
            pending.print.skeleton == print.skeleton
                && pending.source.marked() != source.marked()
                && gap(pending.time, frame.time) <= OTHER_CARD
        };
        let is_repeated =
            is_repeated || (frame.path.is_none() && self.pending.iter().rev().take(8).any(is_twin));
        self.senders.note(frame, source, is_repeated);
        if frame.direction == Direction::Unknown && !is_repeated {
            self.unrecorded += self.senders.number(source, &print);
        }
        let is_by_other_card = |pending: &PendingRequest| {
            pending.print.skeleton == print.skeleton
                && (pending.source, pending.path) != (source, frame.path)
                && gap(pending.time, frame.time) <= OTHER_CARD
        };
        // What the second card alone asks goes round a whole ring untouched: it is only to see which way it comes back.
        let is_second_card = frame.path == Some(Path::B) || self.other_card == Some(source);
        let is_less = |pending: &PendingRequest| {
            let (its, own) = (pending.print.commands, print.commands);
            is_by_other_card(pending) && (its > own || (is_second_card && its < own))
        };
        let is_part = self.pending.iter().rev().take(8).any(is_less);
        if self.pending.len() >= MOST_PENDING {
            self.lose(0, false, settle);
        }
        let mut bytes = self.spare.pop().unwrap_or_default();
        bytes.clear();
        bytes.extend_from_slice(frame.bytes);
        let mut sums = self.spare_sums.pop().unwrap_or_default();
        sums.clear();
        let mut sent = [false; 2];
        sent[frame.path.unwrap_or_default().index()] = true;
        self.pending.push_back(PendingRequest {
            print,
            bytes,
            time: frame.time,
            number: frame.number,
            path: frame.path,
            source,
            copy_by: None,
            is_part,
            is_live: frame.direction != Direction::Unknown,
            sent,
            out: 1,
            whole_before: self.was_whole.then_some(self.whole),
            came_to: Path::A,
            overtaken: 0,
            returns_before: self.returns,
            sums,
        });
        PairingOutcome::Request
    }

    /// A return of a request that was not seen: where requests are, somebody else sent it.
    fn note_elsewhere(
        &mut self,
        frame: &FrameSeen<'_>,
        view: &FrameView<'_>,
        source: MacAddress,
        print: Fingerprint,
    ) {
        // A recording may begin, or have gaps, between a request and its return: but then the address
        // is known from others.
        let is_told = match frame.direction {
            Direction::Received => true,
            Direction::Unknown => print.is_answered && self.one_way == OneWay::No,
            Direction::Sent => false,
        };
        if !is_told {
            return;
        }
        let datagrams = view.datagrams().map_while(Result::ok);
        let written = datagrams.filter_map(|datagram| Written::by(&datagram)).max();
        self.senders.note_elsewhere(frame, source, written);
    }

    /// Pairs a return with pending request `found`.
    fn give_back(
        &mut self,
        found: usize,
        frame: &FrameSeen<'_>,
        view: &FrameView<'_>,
        settle: &mut impl FnMut(&Exchange<'_>),
    ) {
        let sent_by = self.sent_by(&self.pending[found], view.source());
        let pending = &mut self.pending[found];
        pending.out -= 1;
        let is_last = pending.out == 0;
        if !is_last {
            // While the ring is whole, what one card sends comes to the other one.
            let is_other = self.other_card.is_some_and(|other| other == view.source());
            let guess = if is_other { Path::A } else { Path::B };
            pending.came_to = frame.path.unwrap_or(guess);
        } else if !pending.sums.is_empty() {
            self.whole += 1;
            self.was_whole = true;
        }
        // What the second card alone has sent so far comes round untouched: its first card is late, or sends
        // nothing. That nobody answers it says nothing.
        let is_alone = frame.path.is_none()
            && pending.copy_by.is_none()
            && self.other_card == Some(pending.source);
        settle(&Exchange {
            request: Some(pending.copy()),
            reply: Some(copy(frame)),
            earlier: &pending.sums,
            is_last,
            returns_before: pending.returns_before,
            is_cut_off: false,
            is_part: pending.is_part || is_alone,
            copy_lost: None,
            copy_gone: None,
            sent_by,
        });
        if is_last {
            self.remove(found);
        } else {
            let readable = view.datagrams().map_while(Result::ok);
            for (index, datagram) in readable.enumerate() {
                let wkc = datagram.wkc().0;
                match pending.sums.get_mut(index) {
                    Some(sum) => *sum = sum.saturating_add(wkc),
                    None => pending.sums.push(wkc),
                }
            }
        }
        if found > 0 {
            self.overtake(found, frame.time, settle);
        }
    }
}

const fn copy<'a>(frame: &FrameSeen<'a>) -> FrameCopy<'a> {
    FrameCopy { bytes: frame.bytes, time: frame.time, number: frame.number, path: frame.path }
}

/// The time between two instants in either order.
fn gap(one: Instant, other: Instant) -> Span {
    if one < other { other.since(one) } else { one.since(other) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ask::tests::frame::{Frame, lrw};

    #[test]
    fn lost_frame_does_not_take_the_return_of_a_later_one_with_its_index() {
        let mut pairing = Pairing::default();
        let (mut round_trips, mut lost) = (Vec::new(), Vec::new());
        // SOEM has 16 indexes and uses them in turn.
        for cycle in 0..200_u64 {
            let at = Instant::ZERO + Span::ms(2 * cycle);
            let source = MacAddress([1; 6]);
            let frame = Frame::from(source, (cycle % 16) as u8, &[lrw(0, &[0; 4])]);
            let back = frame.clone().returned(&[4]);
            let copies =
                [(&frame, Direction::Sent, at), (&back, Direction::Received, at + Span::us(50))];
            for (frame, direction, time) in copies {
                if cycle == 60 && direction == Direction::Received {
                    continue;
                }
                let seen = FrameSeen {
                    network: Default::default(),
                    path: None,
                    direction,
                    time,
                    number: cycle,
                    fcs: None,
                    truncated: false,
                    probe: None,
                    bytes: &frame.0,
                };
                let view = frame.view();
                pairing.take(&seen, &view, Fingerprint::of(&view), &mut |exchange| {
                    let sent = exchange.request.unwrap();
                    match exchange.reply {
                        Some(reply) => round_trips.push(reply.time.since(sent.time)),
                        None => lost.push(sent.number),
                    }
                });
            }
        }
        assert_eq!(lost, [60]);
        assert!(round_trips.iter().all(|trip| *trip == Span::us(50)), "{round_trips:?}");
    }
}
