//! Traces of trouble in the frames of an excerpt, or in those that a listener has heard, found without the diagnosis: by
//! comparing them with the line's own best times.

use std::collections::{BTreeMap, BTreeSet};

use linesman_proto::address::Path;
use linesman_proto::command::{Addressing, Command};
use linesman_proto::ethernet::MIN_LEN;
use linesman_proto::frame::{Datagram, FrameView};
use linesman_proto::register::table;
use linesman_proto::time::{Instant, Span};

use super::recorder::RecordedFrame;
use crate::soem;

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
    /// Nothing was sent for several cycles.
    Pause,
    /// Process data left unevenly, or came back late, by a tenth of the cycle or more.
    Late,
}

impl Trace {
    /// What it is, in a few words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::LostFrame => "lost frames",
            Self::Unanswered => "unanswered requests",
            Self::WorkingCounter => "short working counters",
            Self::AlError => "AL errors",
            Self::FellState => "lower states",
            Self::CounterRise => "counters that rose",
            Self::LinkChange => "links that changed",
            Self::Pause => "a pause",
            Self::Late => "frames out of time",
        }
    }
}

/// Registers from here on are optional, so nobody needs to answer.
const FIRST_OPTIONAL: u16 = 0x0600;

/// A frame is back within this time.
const ON_ITS_WAY: Span = Span::ms(1);
/// So many cycles, and so long, without a frame are a pause.
const PAUSE: (u64, Span) = (5, Span::ms(20));
/// Frames that wait for another one leave as late as this.
const LATE: Span = Span::us(150);

/// Looks through the frames of an excerpt; `whole` is the recording from which it was taken.
pub(super) fn find(
    whole: &[RecordedFrame],
    left: &[RecordedFrame],
    snap: Option<usize>,
) -> Vec<Trace> {
    let best = best_counters(whole);
    // In a ring nobody touches the copies of card B, and each copy has a part of the working counter.
    let touched = |frame: &&RecordedFrame| {
        FrameView::parse(&frame.bytes).is_ok_and(|view| view.source().is_marked())
    };
    let is_copy = |frame: &RecordedFrame| !frame.is_sent && !is_companion(frame);
    let is_ring = whole.iter().any(|frame| is_copy(frame) && !touched(&frame));
    let mut seen = Seen { is_ring, ..Seen::default() };
    for frame in left.iter().filter(|frame| is_copy(frame)).filter(touched) {
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

/// Looks through what a listener has heard of a line. From the start it hears the bring-up; one that joins later
/// meets what was set up before, and a line that it does not know at its best: `whole` is all that was to be heard.
pub(super) fn heard(
    whole: &[RecordedFrame],
    heard: &[RecordedFrame],
    cycle: Span,
    from_start: bool,
) -> Vec<Trace> {
    let mut traces = find(whole, heard, None);
    let mut seen = NormalTraffic::new(whole, cycle, from_start);
    for frame in heard.iter().filter(|frame| !is_companion(frame)) {
        seen.take(frame, &mut traces);
    }
    traces.sort_unstable();
    traces.dedup();
    traces
}

/// What comes back of a line, held against how it is while all is well.
struct NormalTraffic {
    cycle: Span,
    /// The highest working counter of each datagram that is for all or for a logical address.
    best: BTreeMap<Key, u16>,
    states: BTreeMap<u16, u8>,
    /// The shortest time that a frame with process data takes.
    round_trip: Option<Span>,
    from_start: bool,
    /// Logical datagrams that have not been at their best yet: on the way up they cannot.
    rising: BTreeSet<Key>,
    last_sent: Option<Instant>,
    /// When each frame of a cycle has left last.
    last_data: BTreeMap<(Option<Path>, u32), Instant>,
    /// When process data left that have not come back.
    out: BTreeMap<(Option<Path>, u8), Instant>,
    /// Each copy of a frame has a part of the working counter.
    is_ring: bool,
    /// Of a ring: the working counters of copies that have come back alone so far, by index and datagram.
    first_copies: BTreeMap<(u8, Key), (Instant, u16)>,
}

impl NormalTraffic {
    fn new(whole: &[RecordedFrame], cycle: Span, from_start: bool) -> Self {
        let mut usual = Self {
            cycle,
            best: BTreeMap::new(),
            states: BTreeMap::new(),
            round_trip: None,
            from_start,
            rising: BTreeSet::new(),
            last_sent: None,
            last_data: BTreeMap::new(),
            out: BTreeMap::new(),
            // Beside SOEM's frames the second card sends no copies.
            is_ring: whole.iter().any(|frame| frame.path == Some(Path::B))
                && !whole.iter().any(is_companion),
            first_copies: BTreeMap::new(),
        };
        for frame in whole.iter().filter(|frame| !is_companion(frame)) {
            usual.learn(frame);
        }
        usual.out.clear();
        usual.first_copies.clear();
        if from_start {
            let is_logical = |key: &&Key| {
                let command = Command::from_code(key.0);
                command.map(Command::addressing) == Some(Addressing::Logical)
            };
            usual.rising = usual.best.keys().filter(is_logical).copied().collect();
        }
        usual
    }

    fn learn(&mut self, frame: &RecordedFrame) {
        let Ok(view) = FrameView::parse(&frame.bytes) else { return };
        if let Some(trip) = self.round_trip_of(frame, &view) {
            self.round_trip = Some(self.round_trip.map_or(trip, |known| known.min(trip)));
        }
        if frame.is_sent {
            return;
        }
        for datagram in view.datagrams().map_while(Result::ok) {
            if let Some((key, sum)) = self.whole_counter(&datagram, frame.time) {
                let known: &mut u16 = self.best.entry(key).or_default();
                *known = (*known).max(sum);
            }
            if let Some((station, status)) = state_read(&datagram) {
                let known: &mut u8 = self.states.entry(station).or_default();
                *known = (*known).max(status & 0x0F);
            }
        }
    }

    /// The working counter of a datagram to which all add; in a ring, that of both copies together, once the second one
    /// is back.
    fn whole_counter(&mut self, datagram: &Datagram<'_>, at: Instant) -> Option<(Key, u16)> {
        let (key, counter) = (key_of_all(datagram)?, datagram.wkc().0);
        if !self.is_ring {
            return Some((key, counter));
        }
        let of_frame = (datagram.index(), key);
        match self.first_copies.remove(&of_frame) {
            Some((first, other)) if at.since(first) <= ON_ITS_WAY => {
                Some((key, counter.saturating_add(other)))
            }
            Some(_) | None => {
                self.first_copies.insert(of_frame, (at, counter));
                None
            }
        }
    }

    /// How long process data were under way, when they come back. In a ring they come back to the other card.
    fn round_trip_of(&mut self, frame: &RecordedFrame, view: &FrameView<'_>) -> Option<Span> {
        let first = view.datagrams().next()?.ok()?.index();
        data_of(view).filter(|_| !self.is_ring)?;
        let key = (frame.path, first);
        if frame.is_sent {
            self.out.insert(key, frame.time);
            return None;
        }
        self.out.remove(&key).map(|left| frame.time.since(left))
    }

    fn take(&mut self, frame: &RecordedFrame, traces: &mut Vec<Trace>) {
        let Ok(view) = FrameView::parse(&frame.bytes) else { return };
        let data = data_of(&view);
        let tenth = Span::ns(self.cycle.as_nanos() / 10).max(LATE);
        if frame.is_sent {
            let gap = self.last_sent.map_or(Span::ZERO, |last| frame.time.since(last));
            if !self.last_data.is_empty() && gap > PAUSE.1.max(self.cycle * PAUSE.0) {
                traces.push(Trace::Pause);
            }
            let before =
                data.and_then(|data| self.last_data.insert((frame.path, data), frame.time));
            if let Some(last) = before {
                let interval = frame.time.since(last);
                let off = interval.max(self.cycle).as_nanos() - interval.min(self.cycle).as_nanos();
                // A cycle that is brought into step with clocks begins unevenly.
                if Span::ns(off) > tenth && self.rising.is_empty() {
                    traces.push(Trace::Late);
                }
            }
            self.last_sent = Some(frame.time);
        }
        let trip = self.round_trip_of(frame, &view);
        if trip.zip(self.round_trip).is_some_and(|(trip, usual)| trip > usual + tenth) {
            traces.push(Trace::Late);
        }
        if !frame.is_sent {
            self.take_back(&view, frame.time, traces);
        }
    }

    fn take_back(&mut self, view: &FrameView<'_>, at: Instant, traces: &mut Vec<Trace>) {
        for datagram in view.datagrams().map_while(Result::ok) {
            let counted = self.whole_counter(&datagram, at);
            let is_short = counted.is_some_and(|(key, counter)| {
                counter < self.best.get(&key).copied().unwrap_or_default()
            });
            if let Some((key, _)) = counted.filter(|_| !is_short) {
                self.rising.remove(&key);
            }
            if !self.rising.is_empty() {
                continue;
            }
            if is_short {
                traces.push(Trace::WorkingCounter);
            }
            if let Some((station, status)) = state_read(&datagram).filter(|_| !self.from_start) {
                let usual = self.states.get(&station).copied().unwrap_or_default();
                if station != 0 && status & 0x0F < usual {
                    traces.push(Trace::FellState);
                }
                if status & 0x10 != 0 && status & 0x0F != 1 {
                    traces.push(Trace::AlError);
                }
            }
        }
    }
}

/// The logical address of the process data that a frame carries first, if it carries any.
fn data_of(view: &FrameView<'_>) -> Option<u32> {
    let mut datagrams = view.datagrams().map_while(Result::ok);
    let found = datagrams
        .find(|datagram| datagram.command().map(Command::addressing) == Some(Addressing::Logical));
    found.map(|datagram| datagram.logical().0)
}

/// Whether a frame is what SOEM's second card sends beside one of the first.
fn is_companion(frame: &RecordedFrame) -> bool {
    FrameView::parse(&frame.bytes).is_ok_and(|view| soem::is_companion(&view))
}

/// A datagram to which all add that have what it asks for.
fn key_of_all(datagram: &Datagram<'_>) -> Option<Key> {
    let address = match datagram.command()?.addressing() {
        Addressing::Logical => datagram.logical().0,
        Addressing::Broadcast => u32::from(datagram.ado().0),
        Addressing::Station | Addressing::Position | Addressing::None => return None,
    };
    Some((datagram.code(), address, datagram.data_len()))
}

/// AL status as it was read: the station, 0 for all at once, and its first byte.
fn state_read(datagram: &Datagram<'_>) -> Option<(u16, u8)> {
    let effect = datagram.command()?.effect();
    let station = match effect.addressing {
        Addressing::Station if datagram.wkc().0 > 0 => datagram.adp(),
        Addressing::Broadcast if datagram.wkc().0 > 0 => 0,
        Addressing::Station
        | Addressing::Broadcast
        | Addressing::Logical
        | Addressing::Position
        | Addressing::None => return None,
    };
    let is_read = effect.reads && !effect.writes && datagram.ado() == table::AL_STATUS.address;
    Some((station, *datagram.data().first().filter(|_| is_read)?))
}

/// A logical datagram: command, address, length.
type Key = (u8, u32, usize);

/// The highest working counter of each logical datagram in the whole recording.
fn best_counters(whole: &[RecordedFrame]) -> BTreeMap<Key, u16> {
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
            // A controller without a processor repeats the acknowledgement as its state; there is no code then.
            let has_code = [0x0134, 0x0135].into_iter().filter_map(at).any(|byte| byte != 0);
            if status & 0x10 != 0 && state != 1 && (has_code || at(0x0135).is_none()) {
                self.traces.push(Trace::AlError);
            }
            if self.states.insert(station, state).is_some_and(|before| state < before) {
                self.traces.push(Trace::FellState);
            }
        }
    }

    /// Requests that later ones overtook: returns come in the order of requests.
    fn lost(&mut self, left: &[RecordedFrame]) {
        let key = |frame: &RecordedFrame| {
            let view = FrameView::parse(&frame.bytes).ok()?;
            let first = view.datagrams().next()?.ok()?;
            // A frame that is too short for the wire comes back longer than it was handed to the card.
            Some((first.index(), first.code(), frame.bytes.len().max(MIN_LEN)))
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
