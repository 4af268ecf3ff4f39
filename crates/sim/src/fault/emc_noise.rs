//! `emc-noise`: outside interference couples into one or more cables, in bursts.
//!
//! All lines share the schedule of bursts (a converter switches, a welder fires); within a burst
//! each line is hit by chance for itself.

use linesman_config::fault::FaultName;
use linesman_proto::time::{Instant, Span};

use super::source::{HITS, ListedChanges, flip, frame_hit, frame_hits, spread};
use super::{Kind, Parameter, PlaceRule, Shape};
use crate::seed::Stream;
use crate::wire::{Change, DirectedLink, Source};

pub(super) const KIND: Kind = Kind {
    name: FaultName::EmcNoise,
    place: PlaceRule::ManyDirections,
    parameters: &[
        Parameter {
            key: "hits_per_s",
            meaning: "Mean number of destroyed symbols a second, on each line.",
            shape: Shape::Number { low: 0.0, high: 1e6, default: Some(40.0) },
        },
        Parameter {
            key: "bursts_per_s",
            meaning: "Mean number of bursts a second.",
            shape: Shape::Number { low: 0.01, high: 10_000.0, default: Some(10.0) },
        },
        Parameter {
            key: "burst_ms",
            meaning: "Duration of a burst, in ms.",
            shape: Shape::Number { low: 0.001, high: 1_000.0, default: Some(5.0) },
        },
        Parameter {
            meaning: "Exactly so many frames are hit, as many in each burst and even if that \
                takes longer than `to_ms`, instead of `hits_per_s`; in more bursts than \
                `bursts_per_s` where so many frames do not come by in them.",
            ..HITS
        },
    ],
    start: |start| {
        let mut stream = start.stream.clone();
        let burst = start.milliseconds("burst_ms").max(Span::ns(1));
        let bursts_per_s = start.number("bursts_per_s");
        if let Some(count) = start.values.whole(HITS.key) {
            let rhythm = (burst, bursts_per_s);
            let directions = &start.target.directions;
            if let Some(mut hits) = start.hits.clone() {
                return Ok(frame_hits(count, start.interval(), directions, &mut hits));
            }
            let hits = in_bursts(count, start.interval(), rhythm, directions, &mut stream);
            let hits =
                hits.into_iter().map(|(at, direction)| (at, frame_hit(direction, &mut stream)));
            return Ok(ListedChanges::boxed(hits));
        }
        let per_burst = start.number("hits_per_s") / bursts_per_s;
        let directions = start.target.directions;
        let rate_in_burst = per_burst / burst.as_secs_f64() * directions.len() as f64;
        Ok(Box::new(Bursts {
            directions,
            bursts_per_s,
            burst,
            rate_in_burst,
            at: start.from,
            until: start.from + burst,
            stream,
        }))
    },
};

/// A frame that is hit in a burst comes by within this time.
const FRAME_EVERY: Span = Span::ms(2);

/// `count` hits in bursts that are spread over an interval, as many in each burst, on one line after the other. A
/// line is not hit more often in a burst than frames come by in it; if that is too little there are more bursts.
fn in_bursts(
    count: u32,
    (from, to): (Instant, Instant),
    (burst, bursts_per_s): (Span, f64),
    directions: &[DirectedLink],
    stream: &mut Stream,
) -> Vec<(Instant, DirectedLink)> {
    let of_direction = (burst.as_nanos() / FRAME_EVERY.as_nanos()).max(1);
    let most = of_direction.saturating_mul(directions.len().max(1) as u64);
    let least = u64::from(count).div_ceil(most).max(1) as f64;
    let bursts = (to.since(from).as_secs_f64() * bursts_per_s).round();
    // A burst in which nobody is hit makes no difference: there are no more of them than hits.
    let bursts = bursts.clamp(least, f64::from(count.max(1))) as u32;
    // The last one, too, is over with the interval.
    let burst = burst.min(to.since(from));
    let begins = spread(bursts, (from, to.before(burst)), stream);
    let mut hits = Vec::with_capacity(count as usize);
    for (index, begin) in (0..).zip(begins) {
        let share = |index: u64| (index * u64::from(count) / u64::from(bursts)) as u32;
        let first = stream.below(directions.len().max(1) as u64) as usize;
        let instants = spread(share(index + 1) - share(index), (begin, begin + burst), stream);
        let in_turn = directions.iter().cycle().skip(first).copied();
        hits.extend(instants.into_iter().zip(in_turn));
    }
    hits.sort_by_key(|(at, _)| *at);
    hits
}

#[derive(Debug)]
struct Bursts {
    directions: Vec<DirectedLink>,
    bursts_per_s: f64,
    burst: Span,
    /// On all lines together.
    rate_in_burst: f64,
    at: Instant,
    /// The end of the present burst.
    until: Instant,
    stream: Stream,
}

impl Source for Bursts {
    fn next_change(&mut self) -> Option<(Instant, Change)> {
        if self.rate_in_burst <= 0.0 || self.directions.is_empty() {
            return None;
        }
        loop {
            self.at += self.stream.wait(self.rate_in_burst);
            if self.at < self.until {
                let direction = *self.stream.pick(&self.directions)?;
                return Some((self.at, Change::Hit { direction, flip: flip(&mut self.stream) }));
            }
            if self.at == Instant::MAX {
                return None;
            }
            self.at = self.until + self.stream.wait(self.bursts_per_s);
            self.until = self.at + self.burst;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;

    #[test]
    fn a_number_of_hits_keeps_to_the_bursts() {
        let (from, to) = (Instant::ZERO + Span::s(1), Instant::ZERO + Span::s(3));
        let directions = [(0, true), (0, false), (3, true)];
        let directions = directions.map(|(link, downstream)| DirectedLink { link, downstream });
        for (seed, count, burst, bursts_per_s, bursts) in [
            (1, 1, Span::ms(5), 10.0, 1),
            (2, 7, Span::ms(5), 10.0, 7),
            (3, 100, Span::ms(5), 10.0, 20),
            (4, 100, Span::ms(100), 0.01, 1),
            (5, 90, Span::ms(5), 1e4, 90),
            // More than come by: three lines, in each of them one frame a burst.
            (6, 500, Span::us(400), 10.0, 167),
        ] {
            let mut stream = Seed(seed).stream("bursts");
            let hits =
                in_bursts(count, (from, to), (burst, bursts_per_s), &directions, &mut stream);
            assert_eq!(hits.len(), count as usize);
            assert!(hits.is_sorted_by_key(|(at, _)| *at));
            assert!(hits.iter().all(|(at, _)| (from..to).contains(at)));
            // No more groups than bursts, none longer than a burst; in each the lines are hit equally.
            let mut groups: Vec<Vec<(Instant, DirectedLink)>> = Vec::new();
            for hit in hits {
                match groups.last_mut().filter(|group| hit.0.since(group[0].0) < burst) {
                    Some(group) => group.push(hit),
                    None => groups.push(vec![hit]),
                }
            }
            assert!(groups.len() <= bursts, "{} groups of {bursts} bursts", groups.len());
            let most = (burst.as_nanos() / FRAME_EVERY.as_nanos()).max(1) as usize;
            // Two bursts may follow each other closely.
            for group in &groups {
                let of = |direction: &DirectedLink| {
                    group.iter().filter(|(_, on)| on == direction).count()
                };
                assert!(directions.iter().all(|direction| of(direction) <= 2 * most), "{group:?}");
            }
        }
    }
}
