//! Likelihood of so many events by chance alone.

/// A count that chance brings less often than this is no chance.
const RARE: f64 = 1e-3;

/// Whether `found` events of `tries` are more than chance brings, where `others` of `other_tries` were usual.
///
/// The usual rate is taken one event too high, since few tries tell it badly.
#[must_use]
pub fn is_more(found: u64, tries: u64, others: u64, other_tries: u64) -> bool {
    if found == 0 {
        return false;
    }
    let rate = (others + 1) as f64 / (other_tries + 1) as f64;
    at_least(found, rate.min(1.0) * tries as f64) < RARE
}

/// Above so many expected events the distribution is taken for a normal one.
const MANY: f64 = 300.0;
/// So many standard deviations above the mean are as rare as [`RARE`].
const DEVIATIONS: f64 = 3.1;

/// Probability of `found` events or more where `expected` are usual: that of Poisson's distribution.
fn at_least(found: u64, expected: f64) -> f64 {
    if expected > MANY {
        let is_rare = found as f64 > expected + DEVIATIONS * expected.sqrt();
        return if is_rare { 0.0 } else { 1.0 };
    }
    let mut term = (-expected).exp();
    let mut below = 0.0;
    for number in 0..found {
        below += term;
        term *= expected / (number + 1) as f64;
    }
    (1.0 - below).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probabilities_are_those_of_the_table() {
        assert!((at_least(1, 1.0) - 0.632_120_6).abs() < 1e-6);
        assert!((at_least(3, 0.5) - 0.014_387_7).abs() < 1e-6);
        assert!(at_least(0, 3.0) > 0.999_999);
    }

    #[test]
    fn same_rate_is_chance_and_a_higher_one_is_not() {
        assert!(!is_more(5, 100, 500, 10_000));
        assert!(is_more(20, 100, 500, 10_000));
        assert!(!is_more(1, 50, 0, 500), "one of few may be chance");
        assert!(is_more(4, 50, 0, 500));
        assert!(!is_more(0, 50, 0, 500));
        assert!(!is_more(5_050, 10_000, 50_000, 100_000));
        assert!(is_more(6_000, 10_000, 50_000, 100_000));
    }
}
