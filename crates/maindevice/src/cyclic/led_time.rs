//! Time that the reference clock is led to: that of this computer, of another network of the process, or of a clock
//! outside (DC-10 to DC-12).
//!
//! Each cycle one datagram writes a time to the reference clock (0x0910); its own loop follows that, as the loops of
//! all others follow the reference. Reference: S1 9.1.3.
//!
//! Of a clock outside only the speed is taken over: how far its time is ahead of that of the network stays as it was
//! when it was first known, and is told to whoever reckons with both (S0 L799-805). The time that a program tells is taken
//! over itself where it is near, as it is when the program told it before the start: the network is a clocked SubDevice of
//! an upper one then, whose clock the program reads (S0 L909-943). What is known of it are pairs, a
//! time of the network and the time outside at the same moment. From the first pairs follows the difference in speed.
//! Then a proportional and an integral part hold the distance; they are slower than the loop in the reference clock,
//! which takes some seconds to learn a new speed.

use linesman_config::plan::{TimeSource, TimeStampPlace};
use linesman_proto::time::{DcTime, Instant, Span};

use super::network_time::NetworkTime;
use crate::network_group::{NetworkGroup, SPEED_PLACES};

/// A time of this computer, of the process, or of a program, that is no further off is kept itself, not only its speed.
const SAME: u64 = 1_000_000;
/// OutsidePairs from which the speed outside is taken.
const FIRST_PAIRS: u32 = 512;
/// So much of the distance is corrected with each pair: 1/256.
const PROPORTIONAL_PLACES: u32 = 8;
/// And so much is learnt of the speed: 1/2^18 a cycle.
const INTEGRAL_PLACES: u32 = 18;
/// After so many pairs a distance that is acted upon in part only has to have become smaller: else the speed was taken while
/// the network had not found its own yet, and is taken anew.
const WORK_OFF_PAIRS: u32 = 4_096;
/// More of the distance than this is not acted upon at once, in ns: the reference clock cannot follow it.
const MOST: i64 = 5_000;
/// A clock outside that is further off than this was set anew, in ns.
const SET_ANEW: i64 = 10_000_000;
/// The fastest and slowest clock that is followed, against this computer: 300 ppm, in 2^-48.
const MOST_SPEED: i64 = ((1_i128 << SPEED_PLACES) * 300 / 1_000_000) as i64;
/// Within this distance for [`STEADY`] pairs in a row a network counts as in step with the clock outside, in ns.
const IN_STEP: u64 = 1_000;
const STEADY: u32 = 10;

/// Time of a clock outside of the network, against that of the network (DC-11).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct OutsideTime {
    /// How far the time outside is ahead of that of the network, in ns, as it was last read. To have the time
    /// outside, add it to a time of the network: nothing else does.
    pub ahead_ns: i64,
    /// What that is more than when the speed outside became known, in ns: 0 where the speeds agree. Where the time itself
    /// is taken over, it is the whole distance.
    pub deviation_ns: i64,
    /// The deviation was within 1 µs ten times in a row.
    pub in_step: bool,
}

/// Whose time it is.
#[derive(Debug)]
enum LedBy {
    /// This computer's: the time at the start of the run.
    Host(DcTime),
    /// That of the network that leads.
    Group(NetworkGroup),
    /// One outside.
    Outside(Option<TimeStampPlace>),
}

/// A clock that runs beside the network's, and that the reference clock is led to.
#[derive(Clone, Copy, Debug)]
struct HeldClock {
    at: Instant,
    time: u64,
    /// In 2^-48 ns.
    fraction: i64,
    /// How much faster than this computer, in 2^-48.
    speed: i64,
}

/// What is known of a clock outside.
#[derive(Clone, Copy, Debug, Default)]
struct OutsidePairs {
    /// The first pair: the time of the network and the distance.
    first: Option<(u64, i64)>,
    /// How many came since.
    count: u32,
    /// The distance that is kept.
    kept: Option<i64>,
    latest: Option<OutsideTime>,
    steady: u32,
    /// The distance left to work off when it was looked at last, in ns, and pairs since.
    left: (u64, u32),
    /// The internal time of the latest pair, which does not count twice.
    internal: Option<u64>,
}

/// The time that is written to the reference clock.
#[derive(Debug)]
pub(super) struct LedTime {
    source: LedBy,
    /// What is added to the time of the source, once that is known.
    offset: Option<i64>,
    held: Option<HeldClock>,
    pairs: OutsidePairs,
    /// Lead of the network over the one that leads, in ns.
    ahead_of_group: Option<i64>,
}

impl LedTime {
    /// The one that a plan wants, or that somebody has who follows a group; `None` where the reference clock is left
    /// to itself.
    pub(super) fn new(
        wanted: Option<TimeSource>,
        stamps: Option<TimeStampPlace>,
        follows: Option<NetworkGroup>,
        epoch: DcTime,
    ) -> Option<Self> {
        let source = match (wanted, follows) {
            (Some(TimeSource::ReferenceClock), _)
            | (None | Some(TimeSource::UpperNetwork), None) => return None,
            (Some(TimeSource::Host), _) => LedBy::Host(epoch),
            (Some(TimeSource::Program), _) => LedBy::Outside(None),
            (Some(TimeSource::Device(_)), _) => LedBy::Outside(Some(stamps?)),
            (None | Some(TimeSource::UpperNetwork), Some(group)) => LedBy::Group(group),
        };
        let (offset, held, ahead_of_group) = (None, None, None);
        Some(Self { source, offset, held, pairs: OutsidePairs::default(), ahead_of_group })
    }

    /// Lead of the network over the one that leads its group, in ns, with the last frame.
    pub(super) const fn ahead_of_group(&self) -> Option<i64> {
        self.ahead_of_group
    }

    /// What is known of the clock outside, if it is one.
    pub(super) const fn outside(&self) -> Option<OutsideTime> {
        self.pairs.latest
    }

    /// The clocks were set anew: the time begins anew with them.
    pub(super) fn restart(&mut self) {
        (self.offset, self.held, self.pairs) = (None, None, OutsidePairs::default());
        self.ahead_of_group = None;
    }

    /// The time for a frame that leaves at `departed`. `None` while there is none: then nothing is written.
    pub(super) fn time(
        &mut self,
        departed: Instant,
        network: &NetworkTime,
        inputs: &[u8],
        cycle: Span,
    ) -> Option<u64> {
        let shown = network.at(departed)?;
        let source = match &self.source {
            LedBy::Host(epoch) => epoch.0.wrapping_add(departed.as_nanos()),
            LedBy::Group(group) => group.told()?.time_at(departed).0,
            LedBy::Outside(stamps) => {
                if let Some(stamps) = *stamps {
                    let read = stamps.read(inputs)?;
                    if self.pairs.internal.replace(read.internal) != Some(read.internal) {
                        self.take_pair(read.internal, read.ahead_ns, cycle);
                    }
                }
                return self.outside_time(departed, shown, network.speed());
            }
        };
        let ahead = shown.0.wrapping_sub(source) as i64;
        if matches!(self.source, LedBy::Group(_)) {
            self.ahead_of_group = Some(ahead);
        }
        let offset =
            self.offset.get_or_insert(if ahead.unsigned_abs() <= SAME { 0 } else { ahead });
        // Who leads has set its clocks anew: its speed goes on, its time is another one.
        if ahead.wrapping_sub(*offset).unsigned_abs() > 4 * SAME {
            *offset = ahead;
        }
        Some(source.wrapping_add_signed(*offset))
    }

    /// A pair: a time of the network, and how far the clock outside was ahead at that moment, in ns.
    pub(super) fn take_pair(&mut self, network: u64, ahead_ns: i64, cycle: Span) {
        let takes_time =
            matches!(self.source, LedBy::Outside(None)) && ahead_ns.unsigned_abs() <= SAME;
        let to_keep = if takes_time { 0 } else { ahead_ns };
        let pairs = &mut self.pairs;
        let kept = *pairs.kept.get_or_insert(to_keep);
        let deviation = ahead_ns.wrapping_sub(kept);
        if deviation.abs() > SET_ANEW {
            *pairs = OutsidePairs { first: Some((network, ahead_ns)), ..OutsidePairs::default() };
            return;
        }
        pairs.steady = if deviation.unsigned_abs() <= IN_STEP { pairs.steady + 1 } else { 0 };
        let in_step = pairs.steady >= STEADY && pairs.count >= FIRST_PAIRS;
        pairs.latest = Some(OutsideTime { ahead_ns, deviation_ns: deviation, in_step });
        let Some(held) = &mut self.held else { return };
        if pairs.count < FIRST_PAIRS {
            let (since, before) = *pairs.first.get_or_insert((network, ahead_ns));
            pairs.count += 1;
            let passed = network.wrapping_sub(since);
            if pairs.count == FIRST_PAIRS && passed > 0 {
                let gained = i128::from(ahead_ns.wrapping_sub(before)) << SPEED_PLACES;
                held.add_speed((gained / i128::from(passed)) as i64);
                pairs.kept = Some(to_keep);
            }
            return;
        }
        let acted = i128::from(deviation.clamp(-MOST, MOST));
        held.add((acted << SPEED_PLACES) >> PROPORTIONAL_PLACES);
        if pairs.is_stuck(deviation.unsigned_abs()) {
            (pairs.first, pairs.count) = (None, 0);
            return;
        }
        if deviation.abs() < MOST {
            let cycle = i128::from(cycle.as_nanos().max(1));
            held.add_speed(((acted << (SPEED_PLACES - INTEGRAL_PLACES)) / cycle) as i64);
        }
    }

    /// The clock that is led by pairs; before there are enough of them, as fast as the network.
    fn outside_time(&mut self, departed: Instant, shown: DcTime, speed: i64) -> Option<u64> {
        let Some(held) = &mut self.held else {
            self.held = Some(HeldClock { at: departed, time: shown.0, fraction: 0, speed });
            return None;
        };
        if self.pairs.count < FIRST_PAIRS {
            // Nobody leads yet: it stays with the network.
            *held = HeldClock { at: departed, time: shown.0, fraction: 0, speed };
            return None;
        }
        held.advance(departed);
        Some(held.time)
    }
}

impl OutsidePairs {
    /// True if a distance is no smaller than it was [`WORK_OFF_PAIRS`] before.
    fn is_stuck(&mut self, distance: u64) -> bool {
        let (before, passed) = self.left;
        if distance < MOST as u64 {
            self.left = (u64::MAX, 0);
            return false;
        }
        self.left.1 = passed + 1;
        if passed < WORK_OFF_PAIRS {
            return false;
        }
        self.left = (distance, 0);
        // What is left after the first look is the begin.
        before != 0 && distance >= before
    }
}

impl HeldClock {
    fn advance(&mut self, at: Instant) {
        let passed = at.since(self.at).as_nanos();
        self.at = at;
        self.time = self.time.wrapping_add(passed);
        self.add(i128::from(passed) * i128::from(self.speed));
    }

    /// Moves it by so much, in 2^-48 ns.
    fn add(&mut self, more: i128) {
        let sum = i128::from(self.fraction) + more;
        self.time = self.time.wrapping_add_signed((sum >> SPEED_PLACES) as i64);
        self.fraction = (sum & ((1 << SPEED_PLACES) - 1)) as i64;
    }

    fn add_speed(&mut self, more: i64) {
        self.speed = self.speed.saturating_add(more).clamp(-MOST_SPEED, MOST_SPEED);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CYCLE: Span = Span::ms(1);

    /// A clock that does at once what it is told, 20 ppm fast against this computer, and one outside that is
    /// `outside_ppm` fast and 77 s ahead: by how much their distance changes, in ns.
    fn distance_after(outside_ppm: i64, seconds: u64) -> (i64, OutsideTime) {
        let wanted = Some(TimeSource::Program);
        let mut led = LedTime::new(wanted, None, None, DcTime(0)).expect("a source");
        let (mut network, mut reference, mut base) = (NetworkTime::default(), 5_000_000_i64, 0);
        for number in 1..=seconds * 1_000 {
            let now = number as i64 * 1_000_000;
            let at = Instant::from_nanos(now as u64);
            reference += 1_000_020;
            let outside = 77_000_000_000 + now + now / 1_000_000 * outside_ppm;
            network.take(at, reference as u64, 20 * (1 << SPEED_PLACES) / 1_000_000);
            if let Some(time) = led.time(at, &network, &[], CYCLE) {
                reference = time as i64;
            }
            led.take_pair(reference as u64, outside - reference, CYCLE);
            if number == 1 {
                base = outside - reference;
            }
        }
        let latest = led.outside().expect("pairs were told");
        (latest.ahead_ns - base, latest)
    }

    #[test]
    fn speed_outside_is_taken_over_and_the_distance_stays() {
        for ppm in [-60, 0, 20, 90] {
            let (early, _) = distance_after(ppm, 1);
            let (late, latest) = distance_after(ppm, 20);
            assert!((late - early).abs() < 200, "{ppm} ppm: {early} then {late} ns");
            assert!(latest.in_step && latest.deviation_ns.abs() < 100, "{ppm} ppm: {latest:?}");
            assert!(latest.ahead_ns > 76_000_000_000, "the distance itself is not touched");
        }
    }

    #[test]
    fn time_of_a_program_that_is_near_is_taken_itself() {
        let taken = |ahead_ns: i64| {
            let wanted = Some(TimeSource::Program);
            let mut led = LedTime::new(wanted, None, None, DcTime(0)).expect("a source");
            let (mut network, mut reference) = (NetworkTime::default(), 5_000_000_i64);
            for number in 1..=40_000_i64 {
                let at = Instant::from_nanos(number as u64 * 1_000_000);
                reference += 1_000_020;
                // 30 ppm slow.
                let outside = 5_000_000 + ahead_ns + number * 999_970;
                network.take(at, reference as u64, 20 * (1 << SPEED_PLACES) / 1_000_000);
                if let Some(time) = led.time(at, &network, &[], CYCLE) {
                    reference = time as i64;
                }
                led.take_pair(reference as u64, outside - reference, CYCLE);
            }
            led.outside().expect("pairs were told")
        };
        for ahead_ns in [-300_000, 0, 300_000] {
            let OutsideTime { ahead_ns: left, deviation_ns, in_step } = taken(ahead_ns);
            assert!(in_step && left.abs() < 100 && deviation_ns == left, "{ahead_ns}: {left} ns");
        }
        let far = taken(2_000_000);
        assert!(far.in_step && far.ahead_ns > 1_900_000, "only its speed: {far:?}");
    }

    #[test]
    fn speed_that_was_taken_too_early_is_taken_anew() {
        let mut led = LedTime::new(Some(TimeSource::Program), None, None, DcTime(0)).unwrap();
        let (mut network, mut reference) = (NetworkTime::default(), 5_000_000_i64);
        for number in 1..=60_000_i64 {
            let at = Instant::from_nanos(number as u64 * 1_000_000);
            reference += 1_000_020;
            let outside = 5_000_000 + number * 999_970;
            // While the first pairs come, the speed of the network is not what it is later.
            let ppm = if number < 1_000 { 60 } else { 20 };
            network.take(at, reference as u64, ppm * (1 << SPEED_PLACES) / 1_000_000);
            if let Some(time) = led.time(at, &network, &[], CYCLE) {
                reference = time as i64;
            }
            led.take_pair(reference as u64, outside - reference, CYCLE);
        }
        let OutsideTime { ahead_ns, in_step, .. } = led.outside().expect("pairs were told");
        assert!(in_step && ahead_ns.abs() < 100, "{ahead_ns} ns");
    }

    #[test]
    fn nothing_is_written_before_the_speed_outside_is_known() {
        let mut led = LedTime::new(Some(TimeSource::Program), None, None, DcTime(0)).unwrap();
        let mut network = NetworkTime::default();
        assert_eq!(led.time(Instant::from_nanos(5), &network, &[], CYCLE), None);
        network.take(Instant::ZERO, 1_000, 0);
        for number in 0..100 {
            assert_eq!(
                led.time(Instant::from_nanos(number * 1_000_000), &network, &[], CYCLE),
                None
            );
        }
        assert_eq!(led.outside(), None);
    }

    #[test]
    fn time_of_the_computer_that_is_near_is_taken_itself_and_else_its_speed() {
        // Far off.
        let mut led = LedTime::new(Some(TimeSource::Host), None, None, DcTime(0)).unwrap();
        let mut network = NetworkTime::default();
        network.take(Instant::ZERO, 40_000_000, 0);
        let at = Instant::from_nanos(500);
        assert_eq!(led.time(at, &network, &[], CYCLE), Some(40_000_500), "nothing jumps");
        let later = led.time(at + CYCLE, &network, &[], CYCLE);
        assert_eq!(later, Some(41_000_500), "it goes as fast as the computer");
        let mut led = LedTime::new(Some(TimeSource::Host), None, None, DcTime(300)).unwrap();
        let mut network = NetworkTime::default();
        network.take(Instant::ZERO, 1_300, 0);
        let at = Instant::from_nanos(500);
        assert_eq!(led.time(at, &network, &[], CYCLE), Some(800), "1 µs is worked off");
    }

    #[test]
    fn left_to_itself_unless_a_source_is_wanted_or_a_group_followed() {
        let wanted = |source| LedTime::new(source, None, None, DcTime(0)).is_some();
        assert!(!wanted(None) && !wanted(Some(TimeSource::ReferenceClock)));
        assert!(wanted(Some(TimeSource::Host)));
        let group = Some(NetworkGroup::new());
        assert!(LedTime::new(None, None, group.clone(), DcTime(0)).is_some());
        let untouched = LedTime::new(Some(TimeSource::ReferenceClock), None, group, DcTime(0));
        assert!(untouched.is_none(), "a setting comes first");
    }
}
