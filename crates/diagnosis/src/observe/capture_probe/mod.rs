//! Capture probe: the copies of one frame at several ports of a probe, put together to its passage of the line.
//!
//! A probe that is looped into links (ET2000: four channels of two ports) records a frame on its way out at one port
//! of a channel and on its way back at the other, with several channels many times. The copies of one frame are one
//! [`Passage`]: where it was seen whole, where damaged, where not any more. What the MainDevice sent and what came
//! back, as far as the probe shows it, goes on to the pairing as with any other recording.
//!
//! The order of the ports on the way of the frames is that of the times of the same frame; how many SubDevices lie
//! before a port is told by the address of broadcasts, which each SubDevice counts up (ETG.1000.4, BRD).

mod passage;
mod port;
mod request;
pub mod tap;

use std::collections::VecDeque;

use linesman_proto::esl::{EslRecord, PORTS};
use linesman_proto::ethernet::MacAddress;
use linesman_proto::frame::FrameView;
use linesman_proto::time::{Instant, Span};

use self::passage::{Copied, SenderWay};
pub use self::passage::{DamageMark, Passage, Sight};
pub use self::port::{PortOrder, ProbePort};
use self::request::ProbeReach;
use super::{Direction, Fingerprint, FrameSeen};

/// A frame is on its way for less than this, through all of a line.
const LONGEST: Span = Span::ms(20);
/// Copies at the beginning that are held back until it is known how the ports are used.
const HELD: usize = 64;
/// The order of the ports is taken as known after so many passages.
const LEARNT: u64 = 64;
/// Most frames on their way at a time.
const MOST_UNDER_WAY: usize = 4096;

/// Use of the ports of a probe.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
enum UseOfPorts {
    /// Too few frames came.
    #[default]
    Unknown,
    /// One port alone, or channels on lines of their own: nothing can be said that other recordings do not say.
    Apart,
    /// The same frames pass them.
    OneLine,
}

/// A probe: its ports, and frames that are on their way.
#[derive(Clone, Default, Debug)]
pub struct ProbePassages {
    held: Vec<Copied>,
    use_of_ports: UseOfPorts,
    order: PortOrder,
    ways: Vec<SenderWay>,
    under_way: VecDeque<Passage>,
    next: u64,
    /// By port: the number of the passage that was seen there last.
    last_at: [u64; PORTS as usize],
    settled: u64,
    reach: ProbeReach,
}

/// Result of a copy, or of a frame that has passed.
#[derive(Debug)]
pub enum ProbeOutput<'a> {
    /// A frame as the MainDevice's own card would have shown it.
    Frame(FrameSeen<'a>),
    /// A frame that has passed, with the ports that it was to pass.
    Passed(&'a Passage, &'a [u8], &'a PortOrder),
}

impl ProbePassages {
    /// A probe on a line of which is planned what all SubDevices together answer, or is not.
    #[must_use]
    pub fn on_line(is_planned: bool) -> Self {
        Self { reach: ProbeReach::of_plan(is_planned), ..Self::default() }
    }

    /// Tells how many SubDevices lie before each channel, channel 0 first, of a tap that adds no records of its own.
    pub fn tell_places(&mut self, before: &[u16]) {
        self.order.tell_places(before);
    }

    /// Takes a copy that came to a port of the probe.
    pub fn take(
        &mut self,
        frame: &FrameSeen<'_>,
        record: EslRecord,
        out: &mut impl FnMut(ProbeOutput<'_>),
    ) {
        let Some(port) = record.port.filter(|port| *port < PORTS) else {
            return out(ProbeOutput::Frame(FrameSeen { probe: None, ..*frame }));
        };
        match self.use_of_ports {
            UseOfPorts::Unknown => {
                self.order.note(port, frame, record);
                self.vote_by_held(frame, port, record);
                self.held.push(Copied::of(frame, port, record));
                if self.held.len() == HELD {
                    self.decide(out);
                }
            }
            UseOfPorts::Apart => out(ProbeOutput::Frame(FrameSeen { probe: None, ..*frame })),
            UseOfPorts::OneLine => {
                self.order.note(port, frame, record);
                self.track(frame, port, record, out);
            }
        }
    }

    /// The input ends: what is still under way is judged as far as it came.
    pub fn finish(&mut self, out: &mut impl FnMut(ProbeOutput<'_>)) {
        self.decide(out);
        let end = self.under_way.back().map(|passage| passage.began());
        while let Some(mut passage) = self.under_way.pop_front() {
            passage.is_cut_off = end.is_some_and(|end| end.since(passage.began()) < LONGEST);
            self.settle(&passage, out);
        }
    }

    /// The ports in the order in which frames pass them.
    #[must_use]
    pub const fn order(&self) -> &PortOrder {
        &self.order
    }

    /// Decides by the frames that were held back how the ports are used, and lets these frames go.
    fn decide(&mut self, out: &mut impl FnMut(ProbeOutput<'_>)) {
        let held = std::mem::take(&mut self.held);
        if held.is_empty() {
            return;
        }
        if self.order.len() < 2 || are_lines_of_their_own(&held) {
            self.use_of_ports = UseOfPorts::Apart;
            self.order = self.order.without_ports();
            held.iter().for_each(|copy| out(ProbeOutput::Frame(copy.seen(Default::default()))));
            return;
        }
        self.use_of_ports = UseOfPorts::OneLine;
        for copy in held {
            self.track(&copy.seen(Default::default()), copy.port, copy.record, out);
        }
    }

    /// Copies of the same frame that are held back tell the order of the ports before it is known how they are used.
    fn vote_by_held(&mut self, frame: &FrameSeen<'_>, port: u8, record: EslRecord) {
        let parsed = FrameView::parse(frame.bytes).ok().filter(|_| !record.is_damaged());
        let Some(key) = parsed.as_ref().map(key) else { return };
        for copy in &self.held {
            let held = copy.seen(Default::default());
            let is_same = FrameView::parse(held.bytes).is_ok_and(|view| self::key(&view) == key);
            if is_same && copy.port != port && frame.time.since(held.time) < LONGEST {
                self.order.vote(copy.port, held.time, port, frame.time);
            }
        }
    }

    fn track(
        &mut self,
        frame: &FrameSeen<'_>,
        port: u8,
        record: EslRecord,
        out: &mut impl FnMut(ProbeOutput<'_>),
    ) {
        self.settle_old(frame.time, out);
        let is_damaged = record.is_damaged() || frame.fcs == Some(false);
        let parsed = FrameView::parse(frame.bytes).ok().filter(|_| !is_damaged);
        if parsed.is_none() && !is_damaged {
            // No EtherCAT: it is shown once, where it came by first or left last.
            return self.other(frame, port, out);
        }
        let found = match &parsed {
            Some(view) => {
                let key = key(view);
                self.under_way.iter().rposition(|passage| passage.takes(key, port))
            }
            None => self.nearest(frame, port),
        };
        let index = found.unwrap_or_else(|| {
            self.next += 1;
            let source = parsed.as_ref().map(|view| view.source().marked());
            let key = parsed.as_ref().map_or(0, key);
            self.under_way.push_back(Passage::new(self.next, key, source));
            self.under_way.len() - 1
        });
        let passage = &mut self.under_way[index];
        for sight in passage.sights() {
            self.order.vote(sight.port, sight.time, port, frame.time);
        }
        passage.see(Copied::of(frame, port, record), is_damaged);
        self.last_at[usize::from(port)] = passage.number;
        if self.under_way.len() > MOST_UNDER_WAY {
            self.settle_first(out);
        }
        self.settle_whole(out);
    }

    /// The frame under way that a damaged copy is most alike: frames do not overtake each other.
    fn nearest(&self, frame: &FrameSeen<'_>, port: u8) -> Option<usize> {
        let last = self.last_at[usize::from(port)];
        let rank = self.order.rank(port);
        let is_before = |sight: &Sight| self.order.rank(sight.port) < rank;
        let open = self.under_way.iter().enumerate().filter(|(_, passage)| {
            passage.number > last && !passage.was_at(port) && passage.sights().iter().all(is_before)
        });
        let likeness = |passage: &Passage| passage.likeness(frame.bytes);
        let alike = open.filter(|(_, passage)| likeness(passage) >= passage::ALIKE);
        // Of several that are as much alike the one that went out first.
        let best =
            alike.min_by_key(|(_, passage)| (std::cmp::Reverse(likeness(passage)), passage.number));
        best.map(|(index, _)| index)
    }

    fn other(&mut self, frame: &FrameSeen<'_>, port: u8, out: &mut impl FnMut(ProbeOutput<'_>)) {
        let ends = (self.order.ports().first(), self.order.ports().last());
        let direction = match ends {
            (Some(first), _) if first.number == port => Direction::Sent,
            (_, Some(last)) if last.number == port => Direction::Received,
            (_, _) => return,
        };
        out(ProbeOutput::Frame(FrameSeen { direction, probe: None, ..*frame }));
    }

    /// Frames that went out long ago do not come any more.
    fn settle_old(&mut self, now: Instant, out: &mut impl FnMut(ProbeOutput<'_>)) {
        while self.under_way.front().is_some_and(|first| first.began() + LONGEST < now) {
            self.settle_first(out);
        }
    }

    /// The first one, as soon as it has passed all ports.
    fn settle_whole(&mut self, out: &mut impl FnMut(ProbeOutput<'_>)) {
        while self.settled >= LEARNT
            && self.under_way.front().is_some_and(|first| self.has_passed_all(first))
        {
            self.settle_first(out);
        }
    }

    fn has_passed_all(&self, passage: &Passage) -> bool {
        self.way(passage).is_some_and(|way| way.ports(&self.order).all(|port| passage.was_at(port)))
    }

    fn way(&self, passage: &Passage) -> Option<&SenderWay> {
        let own = passage.source.and_then(|mac| self.ways.iter().find(|way| way.source == mac));
        own.or(self.ways.first())
    }

    fn settle_first(&mut self, out: &mut impl FnMut(ProbeOutput<'_>)) {
        if let Some(passage) = self.under_way.pop_front() {
            self.settle(&passage, out);
        }
    }

    fn settle(&mut self, passage: &Passage, out: &mut impl FnMut(ProbeOutput<'_>)) {
        self.settled += 1;
        if let Some(source) = passage.source {
            SenderWay::note(&mut self.ways, source, passage);
        }
        let usual: Vec<u8> =
            self.way(passage).map_or_else(Vec::new, |way| way.ports(&self.order).collect());
        let ports = self.order.ports().iter().map(|port| port.number);
        let expected: Vec<u8> =
            ports.filter(|port| usual.contains(port) || passage.was_at(*port)).collect();
        out(ProbeOutput::Passed(passage, &expected, &self.order));
        let turns = usual.iter().any(|port| usual.contains(&(port ^ 1)));
        passage.exchange(&self.order, turns, &mut self.reach, &mut |seen| {
            out(ProbeOutput::Frame(seen))
        });
    }
}

/// True if there are several channels, and no frame came by two of them.
fn are_lines_of_their_own(held: &[Copied]) -> bool {
    let mut channels: Vec<u8> = held.iter().map(|copy| copy.port / 2).collect();
    channels.sort_unstable();
    channels.dedup();
    let mut seen: Vec<(u64, u8)> = Vec::new();
    for copy in held {
        let frame = copy.seen(Default::default());
        let Ok(view) = FrameView::parse(frame.bytes) else { continue };
        seen.push((key(&view), copy.port / 2));
    }
    seen.sort_unstable();
    seen.dedup();
    channels.len() > 1 && seen.windows(2).all(|pair| pair[0].0 != pair[1].0)
}

/// Key that all copies of a frame have in common.
fn key(view: &FrameView<'_>) -> u64 {
    let source = view.source().marked();
    let MacAddress(octets) = source;
    let mac = octets.iter().fold(0, |sum: u64, octet| sum << 8 | u64::from(*octet));
    Fingerprint::of(view).lasting ^ mac.rotate_left(13)
}
