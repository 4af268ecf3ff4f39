//! Round-trip times of frames, and frames that came back later than the line can make them.
//!
//! A line takes the same time for the same frame, to some ns: what a frame waits for is the frame before it on
//! the card, and that is known. What comes back later was kept back by a computer, a card or a queue, on its
//! way out or in.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use linesman_proto::address::Path;
use linesman_proto::time::{Instant, Span};

use super::PathDelays;
use super::spell::{Spell, SpellEntry};

/// Lengths of frames that are followed.
const LENGTHS: usize = 128;
/// Frames of a length after which its usual time is known.
const KNOWN: u32 = 48;
/// The shortest time is that of the latest one or two times so many frames: lines change.
const BUCKET: u32 = 64;
/// Nothing is late by less: a queue of a few frames, a clock that is read late.
const LEAST: u64 = 60_000;
/// A host whose frames wander anyway is late when it is this many times worse than usual.
const WORSE: u64 = 8;
/// From so many frames in the beginning it is learnt what this host does anyway.
const LEARNT_FROM: u64 = 500;
/// Nothing is late by less than this many times the worst of them.
const WORST: u64 = 2;
/// How slowly the usual is learnt: by this part of each frame.
const SLOWLY: u64 = 256;
/// So many in a row that took the same longer time took another way: a link was opened, or closed.
const OTHER_WAY: usize = 8;
/// How alike they are then, in ns.
const ALIKE: u64 = 5_000;
/// And so long they do: frames that leave together wait for the same.
const LASTING: Span = Span::ms(5);
/// What comes between frames that are late does not tell what this host does anyway, until so many in a row were in time.
const CALM: u64 = 16;
/// When two of three frames are late, it is a queue, in percent …
const MOST: u64 = 66;
/// … if there were so many at all.
const SEVERAL: u64 = 8;
/// On 100 Mbit/s, in ns.
const BYTE: u64 = 80;
/// Preamble, check sequence and the gap to the next frame, in bytes.
const AROUND: u64 = 8 + 4 + 12;
/// The shortest frame, without its check sequence, in bytes.
const SHORTEST: u64 = 60;
/// Steps by which it is counted how much later than the fastest frames come back: each twice the one before, in ns.
const STEPS: usize = 32;

/// A frame that came back late.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct LateFrame {
    /// When it was sent.
    pub sent: Instant,
    /// Its number when it came back.
    pub frame: u64,
    /// How much later than usual it came back.
    pub by: Span,
}

impl SpellEntry for LateFrame {
    fn at(&self) -> Instant {
        self.sent
    }

    fn by(&self) -> Span {
        self.by
    }
}

/// Frames that came back later than the fastest of their length by some time or more.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct HeldBack {
    /// How many.
    pub count: u64,
    /// Of how many that were compared.
    pub compared: u64,
    /// By how much at least.
    pub by: Span,
    /// The first of them.
    pub first: LateFrame,
    /// The latest of them.
    pub last: LateFrame,
    /// The latest one of those that were latest by most, within a factor of two.
    pub worst: LateFrame,
}

/// Frames that were later than the fastest of their length by one step or more, and by less than the next.
#[derive(Clone, Copy, Debug)]
struct DelayBucket {
    count: u64,
    first: LateFrame,
    last: LateFrame,
}

/// How long frames are on their way.
#[derive(Clone, Default, Debug)]
pub struct RoundTripTimes {
    /// By length in bytes.
    usual: BTreeMap<usize, LengthTimes>,
    /// Until when the frames before are on their way out of each card: those of a ring send at the same time.
    busy_until: [Instant; 2],
    /// Frames that came back.
    frames: u64,
    /// Those since the latest late one; all, if none was.
    in_time: u64,
    /// The latest of the first ones, in ns.
    worst_learnt: u64,
    /// Late ones in a row, as long as they may be on another way.
    alike: Vec<LateFrame>,
    /// Late ones.
    pub late: Spell<LateFrame>,
    /// All late ones.
    pub late_count: u64,
    /// Frames that were compared from the first late one to the latest.
    pub compared: u64,
    /// Frames that were compared since the first late one.
    since_first: u64,
    /// Frames by how much later than the fastest of their length they came back: from 2^n ns on.
    steps: [Option<DelayBucket>; STEPS],
    /// Frames that are counted so.
    stepped: u64,
    /// The fastest of them, from time to time.
    pub path_delays: PathDelays,
}

/// Frames of one length.
#[derive(Clone, Default, Debug)]
struct LengthTimes {
    count: u32,
    /// The first ones, with how long they took, until the fastest are known.
    first: Vec<LateFrame>,
    shortest: u64,
    next_shortest: u64,
    /// How much longer than the shortest they usually are.
    wanders: u64,
}

impl LengthTimes {
    /// A frame took so long: how much longer than the fastest ones, once that is known, and whether it is late.
    fn take(&mut self, took: u64, least: u64, is_calm: bool) -> Option<(u64, bool)> {
        self.count += 1;
        if self.count == 1 {
            (self.shortest, self.next_shortest) = (took, took);
        }
        self.shortest = self.shortest.min(took);
        self.next_shortest = self.next_shortest.min(took);
        if self.count.is_multiple_of(BUCKET) {
            (self.shortest, self.next_shortest) = (self.next_shortest, u64::MAX);
        }
        let longer = took - self.shortest.min(took);
        let limit = (self.wanders * WORSE).max(least);
        let is_known = self.count > KNOWN;
        let is_late = is_known && longer > limit;
        if !is_late && is_calm {
            self.wanders = (self.wanders * (SLOWLY - 1) + longer) / SLOWLY;
        }
        is_known.then_some((longer, is_late))
    }
}

impl RoundTripTimes {
    /// A frame of `len` bytes went out by a card; by the first one where that is not known. Gives when its first bit
    /// left, which the frames before it on that card may have kept waiting.
    pub fn depart(
        &mut self,
        sent: Instant,
        back: Instant,
        len: usize,
        card: Option<Path>,
    ) -> Instant {
        let duration = Span::ns((len as u64).max(SHORTEST).saturating_add(AROUND) * BYTE);
        let busy_until = &mut self.busy_until[card.unwrap_or_default().index()];
        let leaves = sent.max((*busy_until).min(back));
        *busy_until = leaves + duration;
        leaves
    }

    /// A frame of `len` bytes whose first bit left at `leaves` came back. Says whether it is news.
    pub fn record(
        &mut self,
        sent: Instant,
        leaves: Instant,
        back: Instant,
        frame: u64,
        len: usize,
    ) -> bool {
        let took = back.since(leaves).as_nanos();
        self.path_delays.record(len, took, sent);
        let least = LEAST.max(self.worst_learnt * WORST);
        let is_calm = self.late_count == 0 || self.in_time >= CALM;
        let is_full = self.usual.len() >= LENGTHS;
        let usual = match self.usual.entry(len) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(_) if is_full => return false,
            Entry::Vacant(new) => new.insert(LengthTimes::default()),
        };
        let compared = usual.take(took, least, is_calm);
        match compared {
            Some((longer, _)) => {
                let first = std::mem::take(&mut usual.first);
                let shortest = Span::ns(usual.shortest);
                for early in first {
                    self.count_step(LateFrame { by: early.by.saturating_sub(shortest), ..early });
                }
                self.count_step(LateFrame { sent, frame, by: Span::ns(longer) });
            }
            None => usual.first.push(LateFrame { sent, frame, by: Span::ns(took) }),
        }
        let late = compared.filter(|(_, is_late)| *is_late).map(|(longer, _)| longer);
        self.frames += 1;
        self.in_time = if late.is_some() { 0 } else { self.in_time + 1 };
        if self.frames <= LEARNT_FROM {
            self.worst_learnt = self.worst_learnt.max(late.unwrap_or(0));
            return false;
        }
        self.since_first += u64::from(self.late_count > 0);
        let Some(by) = late else {
            let was_late = !self.alike.is_empty();
            self.settle();
            return was_late;
        };
        let late = LateFrame { sent, frame, by: Span::ns(by) };
        let is_alike = |other: &LateFrame| other.by.as_nanos().abs_diff(by) <= ALIKE;
        if !self.alike.last().is_some_and(is_alike) {
            self.settle();
        }
        self.alike.push(late);
        let lasted = self.alike.first().map_or(Span::ZERO, |first| sent.since(first.sent));
        if self.alike.len() >= OTHER_WAY && lasted >= LASTING {
            self.alike.clear();
            self.usual.clear();
        }
        true
    }

    fn count_step(&mut self, late: LateFrame) {
        self.stepped += 1;
        let Some(step) = late.by.as_nanos().checked_ilog2() else { return };
        let Some(step) = self.steps.get_mut(step as usize) else { return };
        let step = step.get_or_insert(DelayBucket { count: 0, first: late, last: late });
        step.count += 1;
        step.last = late;
    }

    /// Frames that came back later than the fastest of their length by `least` or more, rounded up to the next power of
    /// two in ns: whatever this computer does anyway. `None` where there are none.
    #[must_use]
    pub fn held_back(&self, least: Span) -> Option<HeldBack> {
        let from = least.as_nanos().max(1).next_power_of_two().ilog2() as usize;
        let steps: Vec<&DelayBucket> = self.steps.get(from..)?.iter().flatten().collect();
        Some(HeldBack {
            count: steps.iter().map(|step| step.count).sum(),
            compared: self.stepped,
            by: Span::ns(1 << from),
            first: steps.iter().map(|step| step.first).min_by_key(|late| late.sent)?,
            last: steps.iter().map(|step| step.last).max_by_key(|late| late.sent)?,
            worst: steps.last()?.last,
        })
    }

    /// How many of a hundred frames were late while any were.
    #[must_use]
    pub fn share(&self) -> u64 {
        self.late_count * 100 / self.compared.max(1)
    }

    /// Whether so many were late that they wait in a queue.
    #[must_use]
    pub fn is_queue(&self) -> bool {
        self.late_count >= SEVERAL && self.share() >= MOST
    }

    /// What was late, was.
    fn settle(&mut self) {
        for late in self.alike.drain(..) {
            self.late.push(late);
            self.late_count += 1;
            self.compared = self.since_first.max(self.late_count);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn take(
        round_trips: &mut RoundTripTimes,
        sent: Instant,
        back: Instant,
        frame: u64,
        len: usize,
        card: Option<Path>,
    ) {
        let leaves = round_trips.depart(sent, back, len, card);
        round_trips.record(sent, leaves, back, frame, len);
    }

    /// A frame a millisecond, of 64 bytes; each takes so many µs.
    fn play(round_trips: &mut RoundTripTimes, from: u64, took_us: &[u64]) {
        for (ms, us) in (from..).zip(took_us) {
            let sent = Instant::from_nanos(ms * 1_000_000);
            take(round_trips, sent, sent + Span::us(*us), ms, 64, None);
        }
    }

    #[test]
    fn a_frame_that_takes_longer_than_the_line_does_is_late() {
        let mut round_trips = RoundTripTimes::default();
        play(&mut round_trips, 0, &[20; 600]);
        play(&mut round_trips, 600, &[20, 150, 20]);
        assert_eq!(round_trips.late_count, 1);
        assert_eq!(round_trips.late.latest()[0].by, Span::us(130));
        assert_eq!(round_trips.late.latest()[0].frame, 601);
    }

    #[test]
    fn a_longer_way_and_a_host_that_always_wanders_are_not_late() {
        let mut round_trips = RoundTripTimes::default();
        play(&mut round_trips, 0, &[20; 600]);
        play(&mut round_trips, 600, &[120; 300]);
        assert_eq!(round_trips.late_count, 0, "another way");
        let mut round_trips = RoundTripTimes::default();
        let wandering: Vec<u64> = (0..900).map(|nth| 20 + nth * 37 % 50).collect();
        play(&mut round_trips, 0, &wandering);
        assert_eq!(round_trips.late_count, 0);
    }

    #[test]
    fn whoever_waits_for_the_frame_before_is_not_late() {
        let mut round_trips = RoundTripTimes::default();
        for burst in 0..300_u64 {
            let sent = Instant::from_nanos(burst * 1_000_000);
            for nth in 0..4_u64 {
                // 1514 bytes and what is around them take 123.04 µs.
                let back = sent + Span::ns(200_000 + nth * 123_040);
                take(&mut round_trips, sent, back, burst, 1514, None);
            }
        }
        assert_eq!(round_trips.late_count, 0);
    }

    /// While two cards send long frames at once, neither waits for the other: a frame behind them took no less time.
    #[test]
    fn frames_of_one_card_do_not_wait_for_those_of_the_other() {
        let mut round_trips = RoundTripTimes::default();
        for cycle in 0..600_u64 {
            let sent = Instant::from_nanos(cycle * 1_000_000);
            let is_busy = cycle % 100 == 50;
            for nth in 0..if is_busy { 4_u64 } else { 0 } {
                let back = sent + Span::ns(200_000 + nth * 123_040);
                for card in Path::ALL {
                    take(&mut round_trips, sent, back, cycle, 1514, Some(card));
                }
            }
            let waits = if is_busy { 4 * 123_040 } else { 0 };
            let back = sent + Span::ns(20_000 + waits);
            for card in Path::ALL {
                take(&mut round_trips, sent, back, cycle, 64, Some(card));
            }
        }
        let usual = &round_trips.usual[&64];
        assert_eq!((usual.shortest, round_trips.late_count), (20_000, 0));
    }

    #[test]
    fn frames_held_back_before_the_fastest_are_known_are_counted() {
        let mut round_trips = RoundTripTimes::default();
        play(&mut round_trips, 0, &(0..60).map(|nth| 20 + nth * 13).collect::<Vec<u64>>());
        play(&mut round_trips, 60, &[20; 500]);
        let held = round_trips.held_back(Span::us(200)).unwrap();
        assert_eq!((held.count, held.compared), (39, 560), "from 282 µs on");
        assert_eq!(held.first.frame, 21);
    }

    #[test]
    fn frames_held_back_from_the_first_one_on_are_counted() {
        let mut round_trips = RoundTripTimes::default();
        let one_in_thirty: Vec<u64> =
            (0..900).map(|nth| if nth % 30 == 7 { 3_020 } else { 20 }).collect();
        play(&mut round_trips, 0, &one_in_thirty);
        assert_eq!(round_trips.late_count, 0, "this host does so all the time");
        let held = round_trips.held_back(Span::us(800)).unwrap();
        assert_eq!((held.by, held.worst.by), (Span::ns(1 << 20), Span::us(3_000)));
        assert!(held.count * 100 >= held.compared * 3, "{held:?}");
        assert_eq!(round_trips.held_back(Span::ms(5)), None);
    }
}
