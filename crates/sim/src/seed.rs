//! Randomness: everything that is chance in a segment comes from one seed, through named streams.
//!
//! A stream belongs to a name ("noise K1.C>B3.A"), not to an order of construction: adding a fault
//! leaves all other streams as they were.

use linesman_proto::time::Span;
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};

/// The seed of a run.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default)]
pub struct Seed(pub u64);

impl Seed {
    /// The stream that belongs to `name`.
    #[must_use]
    pub fn stream(self, name: &str) -> Stream {
        Stream(ChaCha8Rng::seed_from_u64(self.0 ^ fnv1a(name.as_bytes())))
    }

    /// A seed that belongs to `name`, for a part that hands out streams of its own.
    #[must_use]
    pub fn child(self, name: &str) -> Self {
        Self(self.stream(name).number())
    }
}

/// FNV-1a, 64 bit: spreads names over seeds; the streams do the mixing.
fn fnv1a(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xCBF2_9CE4_8422_2325, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01B3)
    })
}

/// A stream of random numbers, the same on every machine.
#[derive(Clone, Debug)]
pub struct Stream(ChaCha8Rng);

impl Stream {
    /// Any 64-bit number.
    pub fn number(&mut self) -> u64 {
        self.0.next_u64()
    }

    /// A number in `0..bound`; 0 when `bound` is 0.
    pub fn below(&mut self, bound: u64) -> u64 {
        // The high half of a wide product: no modulo bias worth the name below 2^32.
        ((u128::from(self.number()) * u128::from(bound)) >> 64) as u64
    }

    /// A number in `low..=high`, or `low` when the range is empty.
    pub fn between(&mut self, low: u64, high: u64) -> u64 {
        low + self.below(high.saturating_sub(low).saturating_add(1))
    }

    /// A number in [0, 1).
    pub fn fraction(&mut self) -> f64 {
        (self.number() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// True with this probability (0..=1).
    pub fn chance(&mut self, probability: f64) -> bool {
        self.fraction() < probability
    }

    /// Waiting time to the next event of a Poisson process with `rate_per_s` events a second.
    ///
    /// A rate of zero or below gives a wait that never ends.
    pub fn wait(&mut self, rate_per_s: f64) -> Span {
        if rate_per_s <= 0.0 {
            return Span::ns(u64::MAX);
        }
        let seconds = -(1.0 - self.fraction()).ln() / rate_per_s;
        Span::ns((seconds * 1e9).max(1.0) as u64)
    }

    /// One of `items`; `None` when there are none.
    pub fn pick<'a, T>(&mut self, items: &'a [T]) -> Option<&'a T> {
        items.get(self.below(items.len() as u64) as usize)
    }

    /// A number between `low` and `high` (both above 0) whose logarithm is evenly spread.
    pub fn log_uniform(&mut self, low: f64, high: f64) -> f64 {
        (low.ln() + self.fraction() * (high.ln() - low.ln())).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_belong_to_names() {
        let draw = |name: &str| Seed(7).stream(name).number();
        assert_eq!(draw("noise a"), draw("noise a"));
        assert_ne!(draw("noise a"), draw("noise b"));
        assert_ne!(Seed(8).stream("noise a").number(), draw("noise a"));
    }

    #[test]
    fn waits_have_the_asked_for_rate() {
        let mut stream = Seed(1).stream("rate");
        let total: u64 = (0..10_000).map(|_| stream.wait(40.0).as_nanos()).sum();
        let mean_ms = total as f64 / 10_000.0 / 1e6;
        assert!((24.0..26.0).contains(&mean_ms), "{mean_ms} ms, expected 25");
        assert_eq!(stream.wait(0.0), Span::ns(u64::MAX));
    }

    #[test]
    fn bounds_are_kept() {
        let mut stream = Seed(2).stream("bounds");
        for _ in 0..1_000 {
            assert!(stream.below(3) < 3);
            assert!((5..=7).contains(&stream.between(5, 7)));
            assert!((1.0..=100.0).contains(&stream.log_uniform(1.0, 100.0)));
        }
        assert_eq!(stream.below(0), 0);
        assert_eq!(stream.pick::<u8>(&[]), None);
    }
}
