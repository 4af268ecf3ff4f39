//! Sources that several kinds use.

use std::collections::VecDeque;

use linesman_proto::time::{Instant, Span};

use super::{ChangesSource, Parameter, Shape};
use crate::seed::Stream;
use crate::wire::{Change, DirectedLink, Source};

/// For kinds that destroy symbols: an exact number of spoiled frames instead of a rate.
pub(super) const HITS: Parameter = Parameter {
    key: "hits",
    meaning: "Exactly so many frames are hit, evenly over time and even if that takes longer than `to_ms`, instead of `hits_per_s`.",
    shape: Shape::Whole { low: 1, high: 1_000_000, default: None },
};

/// What a damaged output or input stage of a port takes.
pub(super) const PORT_CIRCUIT: &[Parameter] = &[
    Parameter {
        key: "hits_per_s",
        meaning: "Mean number of destroyed symbols a second.",
        shape: Shape::Number { low: 0.0, high: 1e6, default: Some(100.0) },
    },
    HITS,
];

/// Damage that always acts, whatever is moved or switched: `hits` spoiled frames if so many were
/// asked for, else `hits_per_s` destroyed symbols.
pub(super) fn steady(start: &ChangesSource<'_>, directions: Vec<DirectedLink>) -> Box<dyn Source> {
    let stream = start.stream.clone();
    if let Some(count) = start.values.whole(HITS.key) {
        let hits = &mut start.hits.clone().unwrap_or(stream);
        return frame_hits(count, start.interval(), &directions, hits);
    }
    let rate = start.number("hits_per_s");
    Box::new(PoissonErrors::new(directions, rate, Envelope::Constant, start.from, stream))
}

/// A few changes that are known from the start.
#[derive(Clone, Default, Debug)]
pub(super) struct ListedChanges(pub(super) VecDeque<(Instant, Change)>);

impl ListedChanges {
    pub(super) fn boxed(changes: impl IntoIterator<Item = (Instant, Change)>) -> Box<dyn Source> {
        Box::new(Self(changes.into_iter().collect()))
    }
}

impl Source for ListedChanges {
    fn next_change(&mut self) -> Option<(Instant, Change)> {
        self.0.pop_front()
    }
}

/// How strong noise is over time.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Envelope {
    /// Always the same.
    Constant,
    /// It swells and fades, as a cable that is moved to and fro: `period` long, `phase` (0..1) of
    /// it gone at the begin. Its mean is 3/8 of its peak.
    Swell { period: Span, phase: f64 },
}

impl Envelope {
    /// The mean over time, of a peak of 1.
    const SWELL_MEAN: f64 = 3.0 / 8.0;

    /// The peak that gives a mean of 1.
    fn peak(self) -> f64 {
        match self {
            Self::Constant => 1.0,
            Self::Swell { .. } => 1.0 / Self::SWELL_MEAN,
        }
    }

    /// The share of the peak, 0..1, `since` the begin.
    fn share(self, since: Span) -> f64 {
        match self {
            Self::Constant => 1.0,
            Self::Swell { period, phase } => {
                let turns = since.as_secs_f64() / period.as_secs_f64() + phase;
                // sin⁴: long calm, short peaks.
                (turns * std::f64::consts::PI).sin().powi(4)
            }
        }
    }
}

/// Symbol errors that come by chance, on each of some lines for itself.
#[derive(Clone, Debug)]
pub(super) struct PoissonErrors {
    directions: Vec<DirectedLink>,
    /// Mean rate of all lines together.
    rate_per_s: f64,
    envelope: Envelope,
    from: Instant,
    at: Instant,
    stream: Stream,
}

impl PoissonErrors {
    /// `rate_per_s` is the mean of each line.
    pub(super) fn new(
        directions: Vec<DirectedLink>,
        rate_per_s: f64,
        envelope: Envelope,
        from: Instant,
        stream: Stream,
    ) -> Self {
        let rate_per_s = rate_per_s * directions.len() as f64;
        Self { directions, rate_per_s, envelope, from, at: from, stream }
    }
}

impl Source for PoissonErrors {
    fn next_change(&mut self) -> Option<(Instant, Change)> {
        let peak = self.rate_per_s * self.envelope.peak();
        if peak <= 0.0 {
            return None;
        }
        loop {
            // Draw at the peak's rate and keep each with the envelope's share.
            self.at += self.stream.wait(peak);
            if self.at == Instant::MAX {
                return None;
            }
            let kept = self.stream.chance(self.envelope.share(self.at.since(self.from)));
            let direction = *self.stream.pick(&self.directions)?;
            let flip = flip(&mut self.stream);
            if kept {
                return Some((self.at, Change::Hit { direction, flip }));
            }
        }
    }
}

/// What a destroyed symbol does to its byte: one half of it becomes another.
pub(super) fn flip(stream: &mut Stream) -> u8 {
    let nibble = stream.between(1, 15) as u8;
    if stream.chance(0.5) { nibble << 4 } else { nibble }
}

/// How far into a frame.
pub(super) fn part(stream: &mut Stream) -> u16 {
    stream.below(1 << 16) as u16
}

/// `count` instants spread over an interval: one in each equal part of it, by chance where.
pub(super) fn spread(
    count: u32,
    (from, to): (Instant, Instant),
    stream: &mut Stream,
) -> Vec<Instant> {
    let slot = to.since(from).as_nanos() / u64::from(count.max(1));
    (0..u64::from(count)).map(|i| from + Span::ns(i * slot + stream.below(slot.max(1)))).collect()
}

/// Exactly so many hits in frames, spread over an interval and over lines.
pub(super) fn frame_hits(
    count: u32,
    interval: (Instant, Instant),
    directions: &[DirectedLink],
    stream: &mut Stream,
) -> Box<dyn Source> {
    let instants = spread(count, interval, stream);
    let hits = instants.into_iter().filter_map(|at| {
        let direction = *stream.pick(directions)?;
        Some((at, frame_hit(direction, stream)))
    });
    ListedChanges::boxed(hits.collect::<Vec<_>>())
}

/// A hit in the frame that passes a line next.
pub(super) fn frame_hit(direction: DirectedLink, stream: &mut Stream) -> Change {
    Change::FrameHit { direction, part: part(stream), flip: flip(stream) }
}
