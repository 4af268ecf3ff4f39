//! Noise when a link comes up during the run: contacts bounce, receivers find their level.
//!
//! "A few counts around power-up and plugging are normal" (facts 3.4): a segment file may ask for
//! them, so that a diagnosis is tried with them.

use linesman_proto::time::Span;

use super::change::DirectedLink;
use crate::seed::Stream;

/// How long a link is noisy when it comes up.
const LASTS: Span = Span::us(500);

/// Draws the symbols that are destroyed when a link comes up.
#[derive(Clone, Debug)]
pub(crate) struct PlugNoise {
    /// Mean number on each line.
    mean: f64,
    stream: Stream,
}

impl PlugNoise {
    pub(crate) const fn new(mean: f64, stream: Stream) -> Self {
        Self { mean, stream }
    }

    /// Hits on both lines of a link: where, how long after it came up, what they do to a byte.
    pub(super) fn draw(&mut self, link: usize) -> Vec<(DirectedLink, Span, u8)> {
        if self.mean <= 0.0 {
            return Vec::new();
        }
        let mut hits = Vec::new();
        let rate_per_s = self.mean / LASTS.as_secs_f64();
        for direction in DirectedLink::both(link) {
            let mut after = self.stream.wait(rate_per_s);
            while after < LASTS {
                hits.push((direction, after, self.stream.between(1, 255) as u8));
                after += self.stream.wait(rate_per_s);
            }
        }
        hits
    }
}
