//! Distributed clocks: the time that the reference clock gives, and how far the others are off it.

use std::collections::VecDeque;

use linesman_proto::address::DeviceId;
use linesman_proto::time::{Instant, Span};

use super::Seen;

/// A clock that is nearer than this follows, in ns.
const NEAR: u64 = 5_000;
/// A clock that was near and is this far off does not follow any more, in ns: no SubDevice needs it closer
/// than its SYNC signals are apart, and steered clocks stay within a microsecond.
const FAR: u64 = 20_000;
/// Readings of 0x092C that are kept.
const KEPT: usize = 16;
/// Readings that are closer together say nothing of the speed.
const SPEED_FROM: Span = Span::ms(50);

/// How far a clock is off the reference clock, over time.
#[derive(Clone, Default, Debug)]
pub struct ClockHistory {
    /// Readings of 0x092C in ns since it was set, oldest first.
    pub differences: VecDeque<Seen<i64>>,
    /// When it last was near the reference, since it was set.
    pub near: Option<Seen<i64>>,
    /// The latest time in which it did not follow.
    pub astray: Option<ClockDeviation>,
}

/// A stretch of time in which a clock that had followed did not.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ClockDeviation {
    /// When it was last near.
    pub near: Seen<i64>,
    /// The first reading that was far.
    pub far: Seen<i64>,
    /// The farthest.
    pub worst: Seen<i64>,
    /// How fast it went away at most, in parts per million; positive while it is too fast.
    pub ppm: i64,
    /// When it was near again, or set anew.
    pub ended: Option<Instant>,
}

impl ClockHistory {
    /// Whether its difference to the reference clock was ever read.
    #[must_use]
    pub fn is_known(&self) -> bool {
        !self.differences.is_empty() || self.near.is_some()
    }

    /// A reading of 0x092C, in ns. Says whether it is news.
    pub fn record(&mut self, seen: Seen<i64>) -> bool {
        if self.differences.len() == KEPT {
            self.differences.pop_front();
        }
        let ppm = self.ppm(&seen);
        self.differences.push_back(seen);
        let off = seen.value.unsigned_abs();
        let open = self.astray.as_mut().filter(|astray| astray.ended.is_none());
        if off < NEAR {
            self.near = Some(seen);
            let was_astray = open.map(|astray| astray.ended = Some(seen.at)).is_some();
            return was_astray;
        }
        if let Some(astray) = open {
            if off > astray.worst.value.unsigned_abs() {
                astray.worst = seen;
            }
            if let Some(ppm) = ppm.filter(|ppm| ppm.abs() > astray.ppm.abs()) {
                astray.ppm = ppm;
            }
            return true;
        }
        let Some(near) = self.near.filter(|_| off >= FAR) else { return false };
        let ppm = ppm.unwrap_or(0);
        self.astray = Some(ClockDeviation { near, far: seen, worst: seen, ppm, ended: None });
        true
    }

    /// It was set anew at `at`: what it was off before says nothing of it now.
    pub fn set(&mut self, at: Instant) {
        self.differences.clear();
        self.near = None;
        if let Some(astray) = &mut self.astray {
            astray.ended.get_or_insert(at);
        }
    }

    /// How fast it went since the earliest reading that is kept.
    fn ppm(&self, seen: &Seen<i64>) -> Option<i64> {
        // The latest one that is far enough away: a fault that has just begun shows at once.
        let mut earlier = self.differences.iter().rev();
        let before = earlier.find(|one| one.at + SPEED_FROM <= seen.at)?;
        let passed = seen.at.since(before.at).as_nanos();
        let gained = i128::from(seen.value - before.value) * 1_000_000;
        i64::try_from(gained / i128::from(passed.max(1))).ok()
    }
}

/// The time that a frame took along from the reference clock.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ReferenceReading {
    /// When the frame was sent.
    pub sent: Instant,
    /// What the reference clock showed when the frame passed it, in ns.
    pub time: u64,
    /// Whether only the low 32 bits of that were taken along.
    pub is_short: bool,
}

impl ReferenceReading {
    /// A frame may be on its way for so long after it was sent: the host stood still. In ns.
    const AHEAD: i64 = 200_000_000;

    /// What the reference clock went on by since an earlier frame, in ns. The low 32 bits alone come round
    /// every 4.3 s: then that is meant which is nearest to what passed for the sender.
    const fn since(&self, earlier: &Self) -> i64 {
        let passed = self.time.wrapping_sub(earlier.time);
        // A clock of 32 bits answers the upper half with zeros.
        let are_low = (self.time | earlier.time) >> 32 == 0;
        if !(self.is_short || earlier.is_short || are_low) {
            return passed as i64;
        }
        let expected = self.sent.as_nanos().wrapping_sub(earlier.sent.as_nanos());
        let beside = passed.wrapping_sub(expected) as u32 as i32 as i64;
        // No clock goes ahead by so much: then it has gone back, and come round.
        let round = if beside > Self::AHEAD { 1_i64 << 32 } else { 0 };
        expected as i64 + beside - round
    }
}

/// The reference clock, as each frame shows it that hands its time round.
#[derive(Clone, Debug)]
pub struct Reference {
    /// Whose it is.
    pub device: DeviceId,
    /// The latest frame that took its time along, since it was set.
    last: Option<Seen<ReferenceReading>>,
    /// When the latest frame was sent that did, whether it was set since or not.
    handed: Option<Instant>,
    /// When it was set anew, since it stood or went backwards.
    pub mended: Option<Instant>,
    /// When it stood: from the first frame to the last that found it so; the latest time only.
    pub stood: Option<ClockStandstill>,
    /// When it went backwards, and to where by its own time, in ns.
    pub went_back: Option<Seen<i64>>,
    /// Its frames that found it standing, in a row.
    standing: u32,
    /// How much faster it went than the clock of whoever sends when it was worst, if no sound quartz does
    /// so, in parts per million.
    pub wrong_speed: Option<i64>,
    /// The frame of the present stretch that was on its way for the shortest time, by both clocks.
    best: Option<ReferenceReading>,
    /// When that stretch began.
    begun: Instant,
    /// The best of each of the latest stretches.
    marks: VecDeque<ReferenceReading>,
    /// The latest times in which no frame handed its time round: whoever follows it was left alone.
    gaps: VecDeque<ReferenceGap>,
}

/// A time in which frames did not hand the reference's time round.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct ReferenceGap {
    /// The last frame before that did.
    from: Instant,
    /// The first that did again.
    to: Instant,
}

/// A time in which the reference clock stood.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ClockStandstill {
    /// The last frame that saw it go.
    pub since: Seen<u64>,
    /// The latest frame that found it so.
    pub last: Instant,
    /// Whether it goes on again.
    pub is_over: bool,
}

impl Reference {
    /// Two frames pass a controller at least the shortest frame apart; times are taken with some ns of
    /// noise. In ns.
    const NOISE: i64 = 1_000;
    /// Who goes back by less was read on another way, such as by the other card of a ring. In ns.
    const BACK: i64 = 10_000_000;
    /// Frames that are sent closer together than this say nothing.
    const APART: Span = Span::us(50);
    /// In less time no sound quartz goes from near to far.
    const GAP: Span = Span::ms(50);
    /// Such times that are kept.
    const GAPS: usize = 32;
    /// So many frames in a row that found it standing are no accident.
    const SURE: u32 = 3;
    /// Its speed is taken between marks: of each stretch of this length the frame that was least late.
    const STRETCH: Span = Span::ms(200);
    const MARKS: usize = 10;
    /// Two sound quartzes, of the computer and of a SubDevice, do not differ by more, in parts per million.
    pub const SOUND: i64 = 300;

    /// The first frame that hands its time round.
    #[must_use]
    pub fn new(device: DeviceId, seen: Seen<ReferenceReading>) -> Self {
        Self {
            device,
            last: Some(seen),
            handed: Some(seen.value.sent),
            mended: None,
            stood: None,
            went_back: None,
            standing: 0,
            wrong_speed: None,
            best: None,
            begun: Instant::ZERO,
            marks: VecDeque::new(),
            gaps: VecDeque::new(),
        }
    }

    /// Another frame took its time along. Says whether it is news.
    pub fn record(&mut self, seen: Seen<ReferenceReading>) -> bool {
        if self.last.is_some_and(|last| seen.value.sent < last.value.sent + Self::APART) {
            return false;
        }
        self.note_gap(seen.value.sent);
        let Some(before) = self.last.replace(seen) else { return false };
        let went = seen.value.since(&before.value);
        if went < -Self::BACK {
            self.went_back = Some(Seen::new(went, seen.at, seen.frame));
            self.mended = None;
            self.standing = 0;
            (self.best, self.marks) = (None, VecDeque::new());
            return true;
        }
        if went.abs() < Self::NOISE {
            self.standing += 1;
            if self.standing < Self::SURE {
                return false;
            }
            match self.stood.as_mut().filter(|stood| !stood.is_over) {
                Some(stood) => stood.last = seen.at,
                None => {
                    let since = Seen::new(seen.value.time, before.at, before.frame);
                    self.stood = Some(ClockStandstill { since, last: seen.at, is_over: false });
                    self.mended = None;
                    return true;
                }
            }
            return false;
        }
        self.standing = 0;
        if let Some(stood) = self.stood.as_mut().filter(|stood| !stood.is_over) {
            stood.is_over = true;
            (self.best, self.marks) = (None, VecDeque::new());
            return true;
        }
        self.mark(seen.value)
    }

    /// A frame hands its time round that was sent at `sent`.
    fn note_gap(&mut self, sent: Instant) {
        let Some(from) = self.handed.replace(sent).filter(|from| *from + Self::GAP <= sent) else {
            return;
        };
        if self.gaps.len() == Self::GAPS {
            self.gaps.pop_front();
        }
        self.gaps.push_back(ReferenceGap { from, to: sent });
    }

    /// For how long its time was not handed round before a difference that was read at `far`. What was read at
    /// `near` within such a time is from before it: 0x092C changes with each frame that hands a time round.
    #[must_use]
    pub fn withheld(&self, near: Instant, far: Instant) -> Span {
        let now =
            self.handed.map(|from| ReferenceGap { from, to: far }).filter(|gap| gap.from < far);
        let now = now.filter(|gap| gap.from + Self::GAP <= gap.to);
        let meanwhile = self.gaps.iter().copied().chain(now);
        let meanwhile = meanwhile.filter(|gap| gap.to >= near && gap.from <= far);
        Span::ns(meanwhile.map(|gap| gap.to.min(far).since(gap.from).as_nanos()).sum())
    }

    /// It was set at `at`: that its time jumps then means nothing.
    pub fn set(&mut self, at: Instant) {
        self.last = None;
        self.standing = 0;
        (self.best, self.marks) = (None, VecDeque::new());
        if self.stood.is_some() || self.went_back.is_some() {
            self.mended.get_or_insert(at);
        }
    }

    /// Notes a frame of the present stretch. Says whether it is known now that the speed is wrong, or worse.
    fn mark(&mut self, passed: ReferenceReading) -> bool {
        let Some(best) = self.best else {
            (self.best, self.begun) = (Some(passed), passed.sent);
            return false;
        };
        if passed.sent >= self.begun + Self::STRETCH {
            if self.marks.len() == Self::MARKS {
                self.marks.pop_front();
            }
            self.marks.push_back(best);
            (self.best, self.begun) = (Some(passed), passed.sent);
            let worst = self.wrong_speed.map_or(Self::SOUND, i64::abs);
            let before = self.wrong_speed;
            self.wrong_speed = self.ppm().filter(|ppm| ppm.abs() >= worst).or(before);
            return self.wrong_speed != before;
        }
        // Earlier by its own clock than by the sender's: it was less late.
        let sooner = passed.since(&best) < passed.sent.since(best.sent).as_nanos() as i64;
        if sooner {
            self.best = Some(passed);
        }
        false
    }

    /// How much faster it goes than the clock of whoever sends, in parts per million, over the latest
    /// second or two; `None` as long as that is not known.
    #[must_use]
    pub fn ppm(&self) -> Option<i64> {
        let (first, last) = (self.marks.front()?, self.marks.back()?);
        let sent = last.sent.since(first.sent);
        if sent < Self::STRETCH * 3 {
            return None;
        }
        let sent = sent.as_nanos() as i64;
        let gained = i128::from(last.since(first) - sent) * 1_000_000;
        i64::try_from(gained / i128::from(sent)).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(ms: u64) -> Instant {
        Instant::from_nanos(ms * 1_000_000)
    }

    fn read(clock: &mut ClockHistory, ms: u64, ns: i64) -> bool {
        clock.record(Seen::new(ns, at(ms), None))
    }

    #[test]
    fn a_clock_goes_astray_only_from_near_and_until_it_is_set() {
        let mut clock = ClockHistory::default();
        assert!(!read(&mut clock, 0, 900_000), "it was never near");
        read(&mut clock, 100, 800);
        assert!(!read(&mut clock, 200, 15_000), "not far yet");
        assert!(read(&mut clock, 300, 115_000));
        read(&mut clock, 400, 215_000);
        let astray = clock.astray.unwrap();
        assert_eq!((astray.near.at, astray.far.at, astray.ended), (at(100), at(300), None));
        assert_eq!((astray.worst.value, astray.ppm), (215_000, 1_000));
        clock.set(at(500));
        assert_eq!(clock.astray.unwrap().ended, Some(at(500)));
        assert!(!read(&mut clock, 600, 900_000));
    }

    fn pass(reference: &mut Reference, ms: u64, time: u64) -> bool {
        let passed = ReferenceReading { sent: at(ms), time, is_short: false };
        reference.record(Seen::new(passed, at(ms), Some(ms)))
    }

    fn running_at(ns_per_ms: u64) -> Reference {
        let first = ReferenceReading { sent: at(0), time: 7_000_000_000, is_short: false };
        let mut reference = Reference::new(DeviceId(0), Seen::new(first, at(0), None));
        for ms in 1..=1_000 {
            // Every seventh frame is late by 0.3 ms.
            let late = if ms % 7 == 0 { 300_000 } else { 0 };
            let was = reference.wrong_speed;
            let is_news = pass(&mut reference, ms, 7_000_000_000 + ms * ns_per_ms + late);
            assert_eq!(is_news, reference.wrong_speed != was, "what is worse is told at once");
        }
        reference
    }

    fn running() -> Reference {
        running_at(1_001_000)
    }

    #[test]
    fn the_speed_of_the_reference_is_told_against_the_senders_clock() {
        assert_eq!(running().wrong_speed, Some(1_000));
        assert_eq!(running_at(999_000).wrong_speed, Some(-1_000));
        assert_eq!(running_at(1_000_100).wrong_speed, None);
    }

    #[test]
    fn a_short_time_that_came_round_in_a_long_silence_did_not_go_back() {
        let short = |ms: u64, time: u64| {
            let time = time & 0xFFFF_FFFF;
            Seen::new(ReferenceReading { sent: at(ms), time, is_short: true }, at(ms), Some(ms))
        };
        let mut reference = Reference::new(DeviceId(0), short(0, 1_000));
        assert!(!reference.record(short(1, 1_001_000)));
        // 2.2 s are more than 31 bits of nanoseconds, 5 s more than 32.
        assert!(!reference.record(short(2_201, 2_201_001_000)));
        assert!(!reference.record(short(7_201, 7_201_001_000)));
        assert_eq!(reference.went_back, None);
        assert!(reference.record(short(7_202, 7_101_001_000)));
        assert!(reference.went_back.is_some_and(|seen| seen.value < -90_000_000));
    }

    #[test]
    fn times_in_which_nobody_was_given_the_time_are_known() {
        let mut reference = running();
        let end = 7_000_000_000 + 1_000 * 1_001_000;
        assert_eq!(reference.withheld(at(0), at(1_020)), Span::ms(0), "a few frames");
        assert_eq!(reference.withheld(at(0), at(1_400)), Span::ms(400), "none since");
        pass(&mut reference, 1_500, end + 500_000_000);
        assert_eq!(reference.withheld(at(900), at(1_540)), Span::ms(500));
        assert_eq!(reference.withheld(at(1_300), at(1_540)), Span::ms(500), "read within it");
        assert_eq!(reference.withheld(at(1_501), at(1_600)), Span::ms(100), "none since");
        assert_eq!(reference.withheld(at(100), at(900)), Span::ms(0), "before it");
    }

    #[test]
    fn a_reference_that_stands_or_goes_back_is_noticed() {
        let mut stands = running();
        let time = 7_000_000_000 + 1_000 * 1_001_000;
        let noticed: Vec<u64> = (1_001..1_010).filter(|ms| pass(&mut stands, *ms, time)).collect();
        assert_eq!(noticed, [1_003]);
        assert_eq!(stands.stood.map(|stood| stood.is_over), Some(false));
        assert!(pass(&mut stands, 1_010, time + 1_000_000));
        assert_eq!(stands.stood.map(|stood| stood.is_over), Some(true));
        let mut back = running();
        assert!(pass(&mut back, 1_001, 5_000));
        assert!(back.went_back.is_some_and(|seen| seen.value < 0));
    }
}
