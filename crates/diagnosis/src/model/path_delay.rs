//! Transit time of the path through the line, from the fastest of many frames.
//!
//! A frame takes the same time through the same line, to some nanoseconds. A cut shortens its way by all that lies
//! behind, there and back. A host adds what it likes to single frames, so only the fastest of many are compared, and the
//! doubt is how far those differ among themselves.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, VecDeque};

use linesman_proto::time::{Instant, Span};

/// Frames of a length of which the fastest is kept.
const STRETCH: u32 = 32;
/// Stretches that are kept of a length.
const KEPT: usize = 64;
/// Lengths that are followed.
const LENGTHS: usize = 16;
/// Stretches before a moment, and after it, that are compared.
const COMPARED: usize = 4;
/// With fewer the fastest may not have been fast.
const LEAST: usize = 2;
/// Clocks tell no better, in ns.
const CLOCK: u64 = 10;

/// Frames by their length.
#[derive(Clone, Default, Debug)]
pub struct PathDelays {
    by_len: BTreeMap<usize, PathDelay>,
}

/// Frames of one length.
#[derive(Clone, Default, Debug)]
struct PathDelay {
    from: Instant,
    count: u32,
    shortest: u64,
    stretches: VecDeque<DelaySample>,
}

/// Some frames one after the other.
#[derive(Clone, Copy, Debug)]
struct DelaySample {
    from: Instant,
    to: Instant,
    shortest: u64,
}

/// A step in the time that frames take.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PathDelayStep {
    /// The length of the frames, in bytes.
    pub len: usize,
    /// How long the fastest took before.
    pub before: Span,
    /// And after.
    pub after: Span,
    /// How far the fastest differ among themselves.
    pub doubt: Span,
}

impl PathDelayStep {
    /// By how much the way is shorter; zero where it is longer.
    #[must_use]
    pub const fn shorter(&self) -> Span {
        self.before.saturating_sub(self.after)
    }

    /// Whether a part of the line that takes so long is what is missing.
    #[must_use]
    pub fn is(&self, part: Span) -> bool {
        let (ours, its) = (self.shorter().as_nanos(), part.as_nanos());
        // Cables and ports that are left behind a cut take some time, too.
        ours.abs_diff(its) <= self.doubt.as_nanos().saturating_mul(2).saturating_add(its / 8)
    }
}

impl PathDelays {
    /// A frame of `len` bytes that was sent at `sent` took so many ns.
    pub fn record(&mut self, len: usize, took: u64, sent: Instant) {
        let is_full = self.by_len.len() >= LENGTHS;
        let way = match self.by_len.entry(len) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(_) if is_full => return,
            Entry::Vacant(new) => new.insert(PathDelay::default()),
        };
        if way.count == 0 {
            (way.from, way.shortest) = (sent, took);
        }
        way.shortest = way.shortest.min(took);
        way.count += 1;
        if way.count == STRETCH {
            if way.stretches.len() == KEPT {
                way.stretches.pop_front();
            }
            way.stretches.push_back(DelaySample {
                from: way.from,
                to: sent,
                shortest: way.shortest,
            });
            way.count = 0;
        }
    }

    /// The step at a moment, where there is one beyond doubt: of the frames that tell it best.
    #[must_use]
    pub fn step(&self, at: Instant) -> Option<PathDelayStep> {
        let steps = self.by_len.iter().filter_map(|(len, way)| way.step(*len, at));
        steps.min_by_key(|step| step.doubt)
    }
}

impl PathDelay {
    fn step(&self, len: usize, at: Instant) -> Option<PathDelayStep> {
        let before = self.stretches.iter().rev().filter(|stretch| stretch.to <= at);
        let after = self.stretches.iter().filter(|stretch| stretch.from > at);
        let (before, its_doubt) = middle(before.map(|stretch| stretch.shortest))?;
        let (after, other_doubt) = middle(after.map(|stretch| stretch.shortest))?;
        let doubt = its_doubt.max(other_doubt).saturating_add(CLOCK);
        let is_beyond = before.abs_diff(after) > doubt.saturating_mul(2);
        let doubt = Span::ns(doubt);
        let (before, after) = (Span::ns(before), Span::ns(after));
        is_beyond.then_some(PathDelayStep { len, before, after, doubt })
    }
}

/// The middle of the first few, and how far they are apart.
fn middle(times: impl Iterator<Item = u64>) -> Option<(u64, u64)> {
    let mut times: Vec<u64> = times.take(COMPARED).collect();
    times.sort_unstable();
    let (first, last) = (*times.first()?, *times.last()?);
    (times.len() >= LEAST).then(|| (times[times.len() / 2], last - first))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A frame a millisecond, of 64 bytes.
    fn play(path_delays: &mut PathDelays, from: u64, took: impl Iterator<Item = u64>) {
        for (ms, took) in (from..).zip(took) {
            path_delays.record(64, took, Instant::from_nanos(ms * 1_000_000));
        }
    }

    #[test]
    fn cut_shortens_the_way_by_what_lies_behind() {
        let mut path_delays = PathDelays::default();
        play(&mut path_delays, 0, std::iter::repeat_n(9_480, 200));
        play(&mut path_delays, 200, std::iter::repeat_n(6_120, 200));
        let step = path_delays.step(Instant::from_nanos(199_500_000)).unwrap();
        assert_eq!((step.shorter(), step.len), (Span::ns(3_360), 64));
        assert!(step.is(Span::ns(3_300)) && !step.is(Span::ns(2_200)));
        assert_eq!(
            path_delays.step(Instant::from_nanos(100_000_000)),
            None,
            "nothing changed then"
        );
    }

    #[test]
    fn fastest_of_many_tell_a_step_though_single_frames_wander() {
        let wandering = |least: u64| (0..400).map(move |nth| least + nth * 7_919 % 40_000);
        let mut path_delays = PathDelays::default();
        play(&mut path_delays, 0, wandering(50_000));
        play(&mut path_delays, 400, wandering(20_000));
        let step = path_delays.step(Instant::from_nanos(399_500_000)).unwrap();
        assert!(step.is(Span::us(30)), "{step:?}");
        // What the host adds hides what a few SubDevices take.
        let mut path_delays = PathDelays::default();
        play(&mut path_delays, 0, wandering(50_000));
        play(&mut path_delays, 400, wandering(49_000));
        assert_eq!(path_delays.step(Instant::from_nanos(399_500_000)), None);
    }
}
