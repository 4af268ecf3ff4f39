//! Calibration: the share of findings that are right, by the confidence of their rule.
//!
//! A rule says how sure it is by its own evidence, so that hypotheses can be ranked. Whether 70 % is right seven
//! times of ten only a corpus can tell: `linesman lab score` holds both against each other. The table is
//! drawn through such figures of seeds 981271127000 to 981271127299: the share of findings with just the right cause and
//! place, without admitted sets. How well it fits now is in the last table of `docs/score.md`.

/// What a rule says, and what was measured, smoothed so that more never becomes less. Up to one half rules are
/// taken at their word: they name sets of causes there, with several about as likely.
const MEASURED: [(f64, f64); 7] =
    [(0.0, 0.0), (0.5, 0.5), (0.6, 0.86), (0.7, 0.95), (0.8, 0.985), (0.9, 0.995), (1.0, 1.0)];

/// The measured share for what a rule says.
pub(super) fn measured(said: f64) -> f64 {
    let said = said.clamp(0.0, 1.0);
    let between = MEASURED.windows(2).find(|pair| said <= pair[1].0);
    between.map_or(1.0, |pair| {
        let [(from, low), (to, high)] = [pair[0], pair[1]];
        low + (said - from) / (to - from) * (high - low)
    })
}

/// What becomes of an alternative beside a first cause of which a rule is so sure: they share what is left.
pub(super) fn beside(said: f64, alternative: f64) -> f64 {
    let left = 1.0 - said.clamp(0.0, 1.0);
    if left <= 0.0 { 0.0 } else { alternative * ((1.0 - measured(said)) / left).min(1.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_never_becomes_less_and_all_together_is_at_most_1() {
        let mut last = 0.0;
        for percent in 0..=100 {
            let said = f64::from(percent) / 100.0;
            let shown = measured(said);
            assert!(shown >= last && shown >= said - 1e-9, "{said}: {shown} after {last}");
            assert!(shown + beside(said, 1.0 - said) <= 1.0 + 1e-9, "{said}");
            last = shown;
        }
        assert!((measured(0.65) - 0.905).abs() < 1e-9);
        assert!((beside(0.8, 0.1) - 0.0075).abs() < 1e-9);
    }
}
