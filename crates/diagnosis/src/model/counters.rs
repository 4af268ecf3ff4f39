//! Error counters of one controller over time: the first reading is history, rises count.

mod standing;

use std::collections::VecDeque;

use linesman_proto::address::RegisterAddress;
use linesman_proto::port::Port;
use linesman_proto::register::{ClearGroup, Difference, ErrorCounter, ErrorCounters, Total};
use linesman_proto::time::Instant;

use self::standing::StandingReading;
use super::Seen;

/// How many rises of one counter are kept; older ones are forgotten, the total stays.
pub const RISES_KEPT: usize = 256;
/// Where a register of eight bits stops.
const END: u64 = 255;

/// All counters of one controller.
#[derive(Clone, Default, Debug)]
pub struct CounterHistory {
    tracks: CounterTracks,
    /// Falls without a write that was seen: the line has another reader, or the supply was gone.
    clears: u32,
    /// When that was last read, and before which fall.
    cleared: Option<Seen<(ErrorCounter, u64)>>,
    /// When a rise was last read.
    last_rise: Option<Instant>,
    /// When the counters of bad frames were last cleared by a write that was seen.
    cleared_by_order: Option<Instant>,
    /// The frame whose write last cleared a group.
    cleared_in: [Option<u64>; ClearGroup::ALL.len()],
    /// When a write that would clear a group was last sent, of which nobody saw whether it arrived.
    may_be_cleared: [Option<Instant>; ClearGroup::ALL.len()],
    /// When the counter that fell had been read before.
    before_cleared: Instant,
    /// The latest reading of registers, if one like it adds nothing.
    standing: Option<StandingReading>,
}

/// Tracks of the counters that were read, in the order of [`ErrorCounter`]. A slot for each, since they are looked up
/// for each reading.
#[derive(Clone, Default, Debug)]
struct CounterTracks([Option<Box<CounterTrack>>; COUNTERS.len()]);

/// All counters in their order, by kind and port.
const COUNTERS: [ErrorCounter; ErrorCounter::ALL.len()] = {
    use ErrorCounter::{Forwarded, InvalidFrame, LostLink, Pdi, PhysicalLayer, ProcessingUnit};
    use Port::{A, B, C, D};
    [
        InvalidFrame(A),
        InvalidFrame(B),
        InvalidFrame(C),
        InvalidFrame(D),
        PhysicalLayer(A),
        PhysicalLayer(B),
        PhysicalLayer(C),
        PhysicalLayer(D),
        Forwarded(A),
        Forwarded(B),
        Forwarded(C),
        Forwarded(D),
        ProcessingUnit,
        Pdi,
        LostLink(A),
        LostLink(B),
        LostLink(C),
        LostLink(D),
    ]
};

impl CounterTracks {
    /// Index of a counter in [`COUNTERS`].
    const fn index(counter: ErrorCounter) -> usize {
        match counter {
            ErrorCounter::InvalidFrame(port) => port as usize,
            ErrorCounter::PhysicalLayer(port) => 4 + port as usize,
            ErrorCounter::Forwarded(port) => 8 + port as usize,
            ErrorCounter::ProcessingUnit => 12,
            ErrorCounter::Pdi => 13,
            ErrorCounter::LostLink(port) => 14 + port as usize,
        }
    }

    fn get(&self, counter: ErrorCounter) -> Option<&CounterTrack> {
        self.0.get(Self::index(counter))?.as_deref()
    }

    fn get_mut(&mut self, counter: ErrorCounter) -> Option<&mut CounterTrack> {
        self.0.get_mut(Self::index(counter))?.as_deref_mut()
    }
}

/// One counter over time.
#[derive(Clone, Debug)]
pub struct CounterTrack {
    /// The first reading.
    pub first: Seen<u64>,
    /// The latest reading.
    pub last: Seen<u64>,
    /// Whether a tool adds it up: then it stops nowhere. A register stops at 255.
    pub is_total: bool,
    /// Whether the value before the first reading that somebody gave is not known and was taken for 0: what it
    /// counts may be old.
    pub may_be_old: bool,
    /// Rises together, through clears.
    pub total: Total,
    /// What `total` was when the present spell of errors began.
    pub before_spell: u64,
    /// The latest rises, oldest first, at most [`RISES_KEPT`].
    pub rises: VecDeque<Rise>,
}

/// A rise of a counter between two readings.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Rise {
    /// The reading before it.
    pub before: u64,
    /// The reading after it.
    pub after: u64,
    /// By how much it certainly rose, and whether that is exact.
    pub difference: Difference,
    /// When the reading before was made; the rise happened between the two.
    pub after_time: Instant,
    /// When it was read.
    pub at: Instant,
    /// The number of the frame that showed it.
    pub frame: Option<u64>,
}

impl CounterHistory {
    /// Takes the counters that `data`, read from `start` on, cover. Says whether any rose or fell.
    pub fn record(
        &mut self,
        start: RegisterAddress,
        data: &[u8],
        at: Instant,
        frame: Option<u64>,
    ) -> bool {
        if self.standing.as_ref().is_some_and(|standing| standing.is(start, data)) {
            self.record_again(at, frame);
            return false;
        }
        let news = self.record_all(ErrorCounters::covered(data, start), at, frame);
        self.standing = self.standing_at(start, data, frame);
        news
    }

    /// True if a reading in a frame shows what was before a write in the same frame: that takes effect when the frame has
    /// passed and its check sequence was right.
    #[inline]
    fn is_old(&self, counter: ErrorCounter, frame: Option<u64>) -> bool {
        frame.is_some() && self.cleared_in[counter.clear_group() as usize] == frame
    }

    /// Takes a reading of some counters. Says whether any of them rose or fell, or is new.
    ///
    /// Where one counter of a group fell, all that were read with it count as cleared.
    pub fn record_counters(
        &mut self,
        reading: &ErrorCounters,
        at: Instant,
        frame: Option<u64>,
    ) -> bool {
        self.record_all(reading.iter(), at, frame)
    }

    fn record_all(
        &mut self,
        reading: impl Iterator<Item = (ErrorCounter, u8)> + Clone,
        at: Instant,
        frame: Option<u64>,
    ) -> bool {
        let mut fell = [false; ClearGroup::ALL.len()];
        self.standing = None;
        for (counter, value) in reading.clone() {
            if self.is_old(counter, frame) {
                continue;
            }
            self.note_fall(counter, value.into(), &mut fell, Seen::new((), at, frame));
        }
        self.clears += fell.iter().filter(|fell| **fell).count() as u32;
        let mut news = false;
        for (counter, value) in reading {
            if self.is_old(counter, frame) {
                continue;
            }
            let group = counter.clear_group() as usize;
            let track = self.track_of(counter, value.into(), at, frame, &mut news);
            if !fell[group] && track.stands_at(value) {
                track.last = Seen::new(value.into(), at, frame);
                if track.last_rise().is_some_and(|rise| rise.at == at) {
                    self.last_rise = Some(at);
                }
                continue;
            }
            let difference = match fell[group] {
                true => track.total.record_after_clear(value),
                false => track.total.record(value),
            };
            news |= track.record(value.into(), difference, at, frame);
            if track.last_rise().is_some_and(|rise| rise.at == at) {
                self.last_rise = Some(at);
            }
        }
        news
    }

    /// Takes totals that a tool adds up, of any size. Says whether any of them rose or fell, or is new.
    pub fn record_totals(
        &mut self,
        reading: &[(ErrorCounter, u64)],
        at: Instant,
        frame: Option<u64>,
    ) -> bool {
        let mut fell = [false; ClearGroup::ALL.len()];
        self.standing = None;
        for (counter, value) in reading {
            self.note_fall(*counter, *value, &mut fell, Seen::new((), at, frame));
        }
        self.clears += fell.iter().filter(|fell| **fell).count() as u32;
        let mut news = false;
        for (counter, value) in reading {
            let track = self.track_of(*counter, *value, at, frame, &mut news);
            track.is_total = true;
            let difference = track.total.record_total(*value);
            news |= track.record(*value, difference, at, frame);
            if track.last_rise().is_some_and(|rise| rise.at == at) {
                self.last_rise = Some(at);
            }
        }
        news
    }

    /// Notes which group was cleared, where a counter fell.
    #[inline]
    fn note_fall(
        &mut self,
        counter: ErrorCounter,
        value: u64,
        fell: &mut [bool; ClearGroup::ALL.len()],
        seen: Seen<()>,
    ) {
        let Some(track) = self.tracks.get(counter) else { return };
        let (last, read) = (track.last.value, track.last.at);
        if value < last {
            let group = counter.clear_group() as usize;
            if self.may_be_cleared[group].is_some_and(|sent| sent >= read) {
                // By a write of our own, whose return was lost.
                self.note_clear(counter.clear_group(), read, None);
                return;
            }
            fell[group] = true;
            self.before_cleared = read;
            self.cleared = Some(Seen::new((counter, last), seen.at, seen.frame));
        }
    }

    #[inline]
    fn track_of(
        &mut self,
        counter: ErrorCounter,
        value: u64,
        at: Instant,
        frame: Option<u64>,
        news: &mut bool,
    ) -> &mut CounterTrack {
        self.tracks.0[CounterTracks::index(counter)].get_or_insert_with(|| {
            *news = true;
            let seen = Seen::new(value, at, frame);
            Box::new(CounterTrack {
                first: seen,
                last: seen,
                is_total: false,
                may_be_old: false,
                total: Total::default(),
                before_spell: 0,
                rises: VecDeque::new(),
            })
        })
    }

    /// Notes that the value before a counter's first reading is not known, and was taken for 0.
    pub fn note_may_be_old(&mut self, counter: ErrorCounter) {
        if let Some(track) = self.tracks.get_mut(counter) {
            track.may_be_old = true;
        }
    }

    /// Notes that a write in a frame cleared a group on purpose: readings of the frames behind it count from 0.
    pub fn note_clear(&mut self, group: ClearGroup, at: Instant, frame: Option<u64>) {
        self.cleared_in[group as usize] = frame;
        self.standing = None;
        if group == ClearGroup::Rx {
            self.cleared_by_order = Some(at);
        }
        for counter in ErrorCounter::ALL {
            if counter.clear_group() != group {
                continue;
            }
            if let Some(track) = self.tracks.get_mut(counter) {
                track.total.note_own_clear();
                track.last.value = 0;
            }
        }
    }

    /// Notes that a write which would clear a group was sent, and that its return was lost: it may have been
    /// executed. A fall since then proves nothing of others.
    pub fn note_lost_clear(&mut self, group: ClearGroup, sent: Instant) {
        self.may_be_cleared[group as usize] = Some(sent);
        let is_it = |cleared: &Seen<(ErrorCounter, u64)>| {
            cleared.value.0.clear_group() == group
                && self.before_cleared <= sent
                && sent <= cleared.at
        };
        if self.cleared.is_some_and(|cleared| is_it(&cleared)) {
            self.cleared = None;
            self.clears = self.clears.saturating_sub(1);
        }
    }

    /// One counter over time; `None` when it was never read.
    #[must_use]
    pub fn track(&self, counter: ErrorCounter) -> Option<&CounterTrack> {
        self.tracks.get(counter)
    }

    /// All counters that were read, in order of addresses within their kind.
    pub fn tracks(&self) -> impl Iterator<Item = (ErrorCounter, &CounterTrack)> {
        let read = COUNTERS.into_iter().zip(&self.tracks.0);
        read.filter_map(|(counter, track)| Some((counter, track.as_deref()?)))
    }

    /// By how much a counter rose since its first reading, through clears; 0 when never read.
    #[must_use]
    pub fn rise(&self, counter: ErrorCounter) -> u64 {
        self.tracks.get(counter).map_or(0, |track| track.total.rise())
    }

    /// Whether any counter of a port rose: invalid frames or physical-layer errors.
    #[must_use]
    pub fn port_rose(&self, port: Port) -> bool {
        self.rise(ErrorCounter::InvalidFrame(port)) + self.rise(ErrorCounter::PhysicalLayer(port))
            > 0
    }

    /// Whether any counter was read at all.
    #[must_use]
    pub fn is_known(&self) -> bool {
        self.tracks.0.iter().any(Option::is_some)
    }

    /// When the errors happened that a reading shows, at the earliest; `None` when it shows none.
    #[must_use]
    pub fn errors_since(&self, start: RegisterAddress, data: &[u8]) -> Option<Instant> {
        let is_standing = |standing: &StandingReading| standing.is(start, data);
        if self.standing.as_ref().is_some_and(is_standing) || data.iter().all(|byte| *byte == 0) {
            return None;
        }
        let reading = ErrorCounters::from_bytes(data, start);
        let risen = reading.iter().filter(|(counter, value)| {
            *value > 0 && self.latest(*counter).is_some_and(|last| last != u64::from(*value))
        });
        risen.filter_map(|(counter, _)| Some(self.tracks.get(counter)?.last.at)).min()
    }

    /// A new spell of errors begins: what was counted so far belongs to earlier ones.
    pub fn begin_spell(&mut self) {
        for track in self.tracks.0.iter_mut().flatten() {
            track.before_spell = track.total.rise();
            track.total.begin_anew();
        }
    }

    /// When a rise of any of them was last read.
    #[must_use]
    pub const fn last_rise(&self) -> Option<Instant> {
        self.last_rise
    }

    /// When the counters of bad frames were last cleared by a write that was seen.
    #[must_use]
    pub const fn cleared_by_order(&self) -> Option<Instant> {
        self.cleared_by_order
    }

    /// How often a group of counters fell without a write that was seen.
    #[must_use]
    pub const fn foreign_clears(&self) -> u32 {
        self.clears
    }

    /// The latest fall without a write that was seen: which counter, and what it had counted.
    #[must_use]
    pub const fn cleared(&self) -> Option<Seen<(ErrorCounter, u64)>> {
        self.cleared
    }

    /// The latest value of a counter; `None` when it was never read.
    #[must_use]
    pub fn latest(&self, counter: ErrorCounter) -> Option<u64> {
        self.tracks.get(counter).map(|track| track.last.value)
    }
}

impl CounterTrack {
    /// True if a reading of this value is the one before once more, and adds nothing. One at the end of the counter may
    /// hide some.
    #[inline]
    fn stands_at(&self, value: u8) -> bool {
        let value = u64::from(value);
        value < END && self.last.value == value && self.total.last() == Some(value)
    }

    #[inline]
    fn record(
        &mut self,
        value: u64,
        difference: Option<Difference>,
        at: Instant,
        frame: Option<u64>,
    ) -> bool {
        let before = self.last;
        // The time of the latest reading matters even when nothing changed: a later rise happened
        // after it.
        self.last = Seen::new(value, at, frame);
        let Some(difference) = difference else { return false };
        if difference.rise > 0 {
            if self.rises.len() == RISES_KEPT {
                self.rises.pop_front();
            }
            self.rises.push_back(Rise {
                before: before.value,
                after: value,
                difference,
                after_time: before.at,
                at,
                frame,
            });
        }
        difference.rise > 0 || difference.cleared
    }

    /// Whether it stands at its end and counts no more: 255 of a register.
    #[must_use]
    pub const fn is_at_end(&self) -> bool {
        !self.is_total && self.last.value == END
    }

    /// Whether it stood at its end when it was first read.
    #[must_use]
    pub const fn was_at_end(&self) -> bool {
        !self.is_total && self.first.value == END
    }

    /// Rises of the present spell of errors.
    #[must_use]
    pub const fn spell_rise(&self) -> u64 {
        self.total.rise() - self.before_spell
    }

    /// The first rise that is still kept.
    #[must_use]
    pub fn first_rise(&self) -> Option<&Rise> {
        self.rises.front()
    }

    /// The latest rise.
    #[must_use]
    pub fn last_rise(&self) -> Option<&Rise> {
        self.rises.back()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_counter_has_a_slot_of_its_own_in_their_order() {
        assert!(COUNTERS.is_sorted());
        for (index, counter) in COUNTERS.into_iter().enumerate() {
            assert_eq!(CounterTracks::index(counter), index, "{counter}");
        }
    }
}
