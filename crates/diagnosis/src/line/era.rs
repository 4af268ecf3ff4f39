//! Trouble comes in eras, with quiet between them: what is counted in one says nothing of another.
//!
//! Counters only ever grow, and some stand at their end. A second fault, an hour after the first,
//! must not be weighed against what the first left behind; so each era is counted from where
//! everything stood when it began. Frames lost, counters risen and errors of the card are trouble.

use std::collections::BTreeMap;

use linesman_proto::address::{DeviceId, Path};
use linesman_proto::register::{ErrorCounter, Total};
use linesman_proto::time::{Instant, Span};

use super::{Line, Tally};

/// So long nothing must have happened before new trouble begins an era of its own.
const QUIET: Span = Span::s(1);
/// A controller that was not read for this long does not keep an era from beginning.
const STALE: Span = Span::s(10);
/// How many eras are kept apart; the oldest ones become one.
const KEPT: usize = 16;

/// A time of trouble.
#[derive(Clone, Default, Debug)]
pub struct Era {
    /// When its first trouble was noticed.
    pub began: Instant,
    /// When its latest was.
    pub last: Instant,
    /// What the cards dropped in it for a wrong check sequence.
    pub crc: [Tally; 2],
    /// Requests that were lost in it.
    pub lost: Tally,
    /// Where the counters stood when it began.
    totals: BTreeMap<(DeviceId, ErrorCounter), Total>,
}

impl Era {
    /// Where a counter stood when the era began; nothing for one that was not read before.
    #[must_use]
    pub fn total(&self, device: DeviceId, counter: ErrorCounter) -> Total {
        self.totals.get(&(device, counter)).copied().unwrap_or_default()
    }
}

/// The eras of a line, oldest first.
#[derive(Clone, Default, Debug)]
pub struct Eras(Vec<Era>);

impl Eras {
    /// All of them. Empty for a line on which nothing happened, or that was filled in at once.
    #[must_use]
    pub fn all(&self) -> &[Era] {
        &self.0
    }
}

impl Line {
    /// There is trouble at `at`, not yet taken in: the present era goes on, or a new one begins.
    pub(crate) fn note_trouble(&mut self, at: Instant) {
        let last = self.eras.0.last().map(|era| era.last);
        if last.is_none_or(|last| at > last + QUIET && self.all_read_since(last, at)) {
            self.begin_era(at);
        }
        if let Some(era) = self.eras.0.last_mut() {
            era.last = era.last.max(at);
        }
    }

    /// A request was lost.
    pub(crate) fn note_lost(&mut self, at: Instant) {
        self.note_trouble(at);
        if let Some(era) = self.eras.0.last_mut() {
            era.lost.add(1, at);
        }
    }

    /// A card dropped frames for a wrong check sequence.
    pub(crate) fn note_card_errors(&mut self, path: Path, count: u64, at: Instant) {
        if count == 0 {
            return;
        }
        self.note_trouble(at);
        if let Some(era) = self.eras.0.last_mut() {
            era.crc[path.index()].add(count, at);
        }
    }

    /// Whether no counter that is still being read may hold something of before `last`.
    fn all_read_since(&self, last: Instant, now: Instant) -> bool {
        self.devices.iter().filter(|device| device.silent.is_none()).all(|device| {
            let read = device.counters.tracks().map(|(_, track)| track.last.at).min();
            read.is_none_or(|at| at > last || at + STALE < now)
        })
    }

    fn begin_era(&mut self, at: Instant) {
        let totals = self.devices.iter().flat_map(|device| {
            device.counters.tracks().map(|(counter, track)| ((device.id, counter), track.total))
        });
        // The first era holds all that there was before it, too.
        let totals = if self.eras.0.is_empty() { BTreeMap::new() } else { totals.collect() };
        self.eras.0.push(Era { began: at, last: at, totals, ..Era::default() });
        if self.eras.0.len() > KEPT {
            let second = self.eras.0.remove(1);
            self.eras.0[0].absorb(second);
        }
    }
}

impl Era {
    fn absorb(&mut self, next: Self) {
        self.last = next.last;
        self.lost.absorb(next.lost);
        for (mine, other) in self.crc.iter_mut().zip(next.crc) {
            mine.absorb(other);
        }
    }
}
