//! Readings of error counters like the one before, which move nothing but its time: counters are polled, and mostly stand.

use linesman_proto::address::RegisterAddress;
use linesman_proto::register::ErrorCounters;
use linesman_proto::time::Instant;

use super::{CounterHistory, CounterTracks};

/// Registers as they were read, where each of their counters stands at what was read, and none at its end.
#[derive(Clone, Copy, Debug)]
pub(super) struct StandingReading {
    start: RegisterAddress,
    len: usize,
    bytes: [u8; ErrorCounters::LEN],
    /// Tracks of the counters in it, as bits by their indexes.
    tracks: u32,
}

impl StandingReading {
    /// True if the same was read once more.
    #[inline]
    pub(super) fn is(&self, start: RegisterAddress, data: &[u8]) -> bool {
        self.start == start && self.bytes.get(..self.len) == Some(data)
    }
}

impl CounterHistory {
    /// Takes the standing reading once more.
    #[inline]
    pub(super) fn record_again(&mut self, at: Instant, frame: Option<u64>) {
        let standing = self.standing.map_or(0, |standing| standing.tracks);
        for (index, track) in self.tracks.0.iter_mut().enumerate() {
            let Some(track) = track.as_deref_mut().filter(|_| standing >> index & 1 != 0) else {
                continue;
            };
            (track.last.at, track.last.frame) = (at, frame);
            if self.last_rise.is_some() && track.last_rise().is_some_and(|rise| rise.at == at) {
                self.last_rise = Some(at);
            }
        }
    }

    /// A reading that was just taken, if each of its counters stands at it.
    pub(super) fn standing_at(
        &self,
        start: RegisterAddress,
        data: &[u8],
        frame: Option<u64>,
    ) -> Option<StandingReading> {
        let mut bytes = [0; ErrorCounters::LEN];
        bytes.get_mut(..data.len())?.copy_from_slice(data);
        let mut tracks = 0;
        for (counter, value) in ErrorCounters::covered(data, start) {
            if self.is_old(counter, frame) || !self.tracks.get(counter)?.stands_at(value) {
                return None;
            }
            tracks |= 1 << CounterTracks::index(counter);
        }
        Some(StandingReading { start, len: data.len(), bytes, tracks })
    }
}

#[cfg(test)]
mod tests {
    use linesman_proto::port::Port;
    use linesman_proto::register::{ClearGroup, ErrorCounter};
    use linesman_proto::time::Span;

    use super::*;

    #[test]
    fn reading_like_the_one_before_moves_its_time_until_the_counter_moves_or_is_cleared() {
        let ms = |ms| Instant::ZERO + Span::ms(ms);
        let counter = ErrorCounter::InvalidFrame(Port::A);
        let mut history = CounterHistory::default();
        let read = |history: &mut CounterHistory, value: u8, at: u64| {
            history.record(counter.address(), &[value, 0], ms(at), Some(at))
        };
        assert!(read(&mut history, 3, 1), "the first one");
        assert!(!read(&mut history, 3, 2));
        assert!(!read(&mut history, 3, 3));
        let last = history.track(counter).unwrap().last;
        assert_eq!((last.value, last.at, last.frame), (3, ms(3), Some(3)));
        assert_eq!(history.errors_since(counter.address(), &[3, 0]), None);
        assert_eq!(history.errors_since(counter.address(), &[4, 0]), Some(ms(3)));
        assert!(read(&mut history, 4, 4));
        assert_eq!(history.track(counter).unwrap().last_rise().unwrap().after_time, ms(3));
        assert!(!read(&mut history, 4, 5));
        // What is read behind the write in its frame is what was before.
        history.note_clear(ClearGroup::Rx, ms(6), Some(6));
        assert!(!read(&mut history, 4, 6));
        assert!(read(&mut history, 4, 7), "four since it was cleared");
        assert_eq!(history.rise(counter), 5);
    }
}
