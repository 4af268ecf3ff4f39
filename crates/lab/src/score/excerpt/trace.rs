//! Traces of trouble in the frames of an excerpt, found without the diagnosis: by comparing what is left with the
//! line's own best times.

use std::collections::{BTreeMap, BTreeSet};

use linesman_proto::command::{Addressing, Command};
use linesman_proto::frame::FrameView;
use linesman_proto::register::table;
use linesman_proto::time::Span;

use super::TapedFrame;

/// A sign of trouble.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Trace {
    /// A request without a return, with others that came back later.
    LostFrame,
    /// A register that every controller has was asked, and nobody answered.
    Unanswered,
    /// A working counter was lower than the line's best.
    WorkingCounter,
    /// AL status with the error bit, outside of the acknowledgement that a start brings.
    AlError,
    /// A SubDevice was seen in a lower state than before.
    FellState,
    /// An error counter rose between two readings.
    CounterRise,
    /// DL status changed between two readings.
    LinkChange,
}

/// Registers from here on are optional, so nobody needs to answer.
const FIRST_OPTIONAL: u16 = 0x0600;

/// A frame is back within this time.
const ON_ITS_WAY: Span = Span::ms(1);

/// Looks through the frames of an excerpt; `whole` is the recording from which it was taken.
pub(super) fn find(whole: &[TapedFrame], left: &[TapedFrame], snap: Option<usize>) -> Vec<Trace> {
    let best = best_counters(whole);
    // In a ring nobody touches the copies of card B, and each copy has a part of the working counter.
    let touched = |frame: &&TapedFrame| {
        FrameView::parse(&frame.bytes).is_ok_and(|view| view.source().is_marked())
    };
    let is_ring = whole.iter().any(|frame| !frame.is_sent && !touched(&frame));
    let mut seen = Seen { is_ring, ..Seen::default() };
    for frame in left.iter().filter(|frame| !frame.is_sent).filter(touched) {
        let kept = snap.map_or(frame.bytes.len(), |snap| snap.min(frame.bytes.len()));
        seen.take(&frame.bytes[..kept], &best);
    }
    let (sent, back): (Vec<_>, Vec<_>) = left.iter().partition(|frame| frame.is_sent);
    if !sent.is_empty() && !back.is_empty() {
        seen.lost(left);
    }
    seen.traces.sort_unstable();
    seen.traces.dedup();
    seen.traces
}

/// A logical datagram: command, address, length.
type Key = (u8, u32, usize);

/// The highest working counter of each logical datagram in the whole recording.
fn best_counters(whole: &[TapedFrame]) -> BTreeMap<Key, u16> {
    let mut best = BTreeMap::new();
    for frame in whole.iter().filter(|frame| !frame.is_sent) {
        let Ok(view) = FrameView::parse(&frame.bytes) else { continue };
        for datagram in view.datagrams().flatten() {
            if datagram.command().map(Command::addressing) == Some(Addressing::Logical) {
                let key = (datagram.code(), datagram.logical().0, datagram.data_len());
                let known: &mut u16 = best.entry(key).or_default();
                *known = (*known).max(datagram.wkc().0);
            }
        }
    }
    best
}

/// What was read so far.
#[derive(Default)]
struct Seen {
    traces: Vec<Trace>,
    is_ring: bool,
    /// The latest bytes of counters by station and address.
    counters: BTreeMap<(u16, u16), u8>,
    links: BTreeMap<u16, u16>,
    states: BTreeMap<u16, u8>,
    /// Whether a logical datagram has been at its best in the excerpt.
    was_best: BTreeMap<Key, bool>,
}

impl Seen {
    fn take(&mut self, bytes: &[u8], best: &BTreeMap<Key, u16>) {
        let Ok(view) = FrameView::parse(bytes) else { return };
        for datagram in view.datagrams() {
            let Ok(datagram) = datagram else { return };
            let Some(command) = datagram.command() else { continue };
            let (station, start) = (datagram.adp(), datagram.ado().0);
            match command.addressing() {
                Addressing::Logical => {
                    let key = (datagram.code(), datagram.logical().0, datagram.data_len());
                    let wanted = best.get(&key).copied().unwrap_or(0);
                    let is_best = datagram.wkc().0 >= wanted;
                    let was_best = self.was_best.entry(key).or_default();
                    // On the way up it has not been there yet.
                    if !is_best && *was_best && !self.is_ring {
                        self.traces.push(Trace::WorkingCounter);
                    }
                    *was_best |= is_best;
                }
                Addressing::Station if datagram.wkc().0 == 0 => {
                    if start < FIRST_OPTIONAL && !self.is_ring {
                        self.traces.push(Trace::Unanswered);
                    }
                }
                Addressing::Station
                    if command.effect().reads && !command.effect().multiple_write =>
                {
                    self.registers(station, start, datagram.data());
                }
                Addressing::Station
                | Addressing::Position
                | Addressing::Broadcast
                | Addressing::None => {}
            }
        }
    }

    fn registers(&mut self, station: u16, start: u16, data: &[u8]) {
        let at = |address: u16| data.get(usize::from(address.checked_sub(start)?)).copied();
        for address in 0x0300..0x0314 {
            let Some(value) = at(address) else { continue };
            let before = self.counters.insert((station, address), value);
            if before.is_some_and(|before| value > before) {
                self.traces.push(Trace::CounterRise);
            }
        }
        if let (Some(low), Some(high)) = (at(0x0110), at(0x0111)) {
            // The lowest four bits are about the processor.
            let links = u16::from_le_bytes([low & 0xF0, high]);
            if self.links.insert(station, links).is_some_and(|before| before != links) {
                self.traces.push(Trace::LinkChange);
            }
        }
        if let Some(status) = at(0x0130) {
            let state = status & 0x0F;
            if status & 0x10 != 0 && state != 1 {
                self.traces.push(Trace::AlError);
            }
            if self.states.insert(station, state).is_some_and(|before| state < before) {
                self.traces.push(Trace::FellState);
            }
        }
    }

    /// Requests that later ones overtook: returns come in the order of requests.
    fn lost(&mut self, left: &[TapedFrame]) {
        let key = |frame: &TapedFrame| {
            let view = FrameView::parse(&frame.bytes).ok()?;
            let first = view.datagrams().next()?.ok()?;
            Some((first.index(), first.code(), frame.bytes.len()))
        };
        let mut open: Vec<(usize, (u8, u8, usize))> = Vec::new();
        let mut closed = BTreeSet::new();
        for (number, frame) in left.iter().enumerate() {
            let Some(key) = key(frame) else { continue };
            if frame.is_sent {
                if note_closed(&frame.bytes, &mut closed) {
                    // What is on its way then may be lost, too.
                    open.retain(|(number, _)| frame.time.since(left[*number].time) > ON_ITS_WAY);
                }
                // What does not come back while ports are closed on purpose is no trouble.
                if closed.is_empty() {
                    open.push((number, key));
                }
            } else if let Some(at) = open.iter().position(|(_, known)| *known == key) {
                open.remove(at);
            }
        }
        // What is on its way when the excerpt ends is not lost.
        let end = left.len().saturating_sub(200);
        if open.iter().any(|(number, _)| *number < end) {
            self.traces.push(Trace::LostFrame);
        }
    }
}

/// Notes the stations that a request orders to close a port, or to leave all of them to themselves. Says whether it
/// closes one.
fn note_closed(bytes: &[u8], closed: &mut BTreeSet<u16>) -> bool {
    let Ok(view) = FrameView::parse(bytes) else { return false };
    let mut closes = false;
    for datagram in view.datagrams().flatten() {
        let writes = datagram.command().is_some_and(|command| command.effect().writes);
        let is_control = datagram.ado() == table::DL_CONTROL.address;
        if let (true, true, [_, loops, ..]) = (writes, is_control, datagram.data()) {
            if *loops == 0 {
                closed.remove(&datagram.adp());
            } else {
                closed.insert(datagram.adp());
                closes = true;
            }
        }
    }
    closes
}
