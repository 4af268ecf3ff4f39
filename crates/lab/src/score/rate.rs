//! A share with the interval that it is known by.

use serde::Serialize;

/// Quantile of the normal distribution for 95 %.
const Z: f64 = 1.959_963_985;

/// So many of so many.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rate {
    /// How many were right.
    pub right: u64,
    /// Of how many.
    pub of: u64,
    /// Their share, 0 to 1; 0 of none.
    pub share: f64,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end of it.
    pub high: f64,
}

impl Rate {
    /// `right` of `of`, with the interval of Wilson (1927), which holds for small numbers and for
    /// shares near 0 and 1, too.
    #[must_use]
    pub fn of(right: u64, of: u64) -> Self {
        if of == 0 {
            return Self { high: 1.0, ..Self::default() };
        }
        let n = of as f64;
        let share = right as f64 / n;
        let (z2, scale) = (Z * Z, 1.0 + Z * Z / n);
        let middle = (share + z2 / (2.0 * n)) / scale;
        let half = Z * (share * (1.0 - share) / n + z2 / (4.0 * n * n)).sqrt() / scale;
        let (low, high) = ((middle - half).max(0.0), (middle + half).min(1.0));
        Self { right, of, share: rounded(share), low: rounded(low), high: rounded(high) }
    }
}

/// With four decimals: more is not known, and the same on every machine.
#[must_use]
pub fn rounded(share: f64) -> f64 {
    (share * 10_000.0).round() / 10_000.0
}

/// Rate in a thousand hours.
pub(super) fn per_1000_hours(count: f64, hours: f64) -> Option<f64> {
    (hours > 0.0).then(|| rounded(count * 1_000.0 / hours))
}

/// Upper end of the 95 % interval of a number that is counted (Poisson, one-sided), by the approximation of Byar.
pub(super) fn at_most(count: u64) -> f64 {
    let n = count as f64 + 1.0;
    n * (1.0 - 1.0 / (9.0 * n) + 1.645 / (3.0 * n.sqrt())).powi(3)
}

/// Counts towards a rate.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Count {
    right: u64,
    of: u64,
}

impl Count {
    /// One more.
    pub fn add(&mut self, is_right: bool) {
        self.right += u64::from(is_right);
        self.of += 1;
    }

    /// The rate.
    #[must_use]
    pub fn rate(self) -> Rate {
        Rate::of(self.right, self.of)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilson_intervals_are_those_of_the_tables() {
        // Newcombe (1998), table I: 81 of 263, 15 of 148, 0 of 20, 1 of 29.
        for (right, of, low, high) in [
            (81, 263, 0.2553, 0.3662),
            (15, 148, 0.0624, 0.1605),
            (0, 20, 0.0, 0.1611),
            (1, 29, 0.0061, 0.1718),
        ] {
            let rate = Rate::of(right, of);
            assert_eq!((rate.low, rate.high), (low, high), "{right} of {of}");
        }
        assert_eq!(Rate::of(0, 0), Rate { high: 1.0, ..Rate::default() });
    }
}
