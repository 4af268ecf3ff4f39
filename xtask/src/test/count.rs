//! Counting tests from what the test harness prints.

/// Sums over all test programs of one run.
#[derive(Debug, Default, Eq, PartialEq)]
pub(super) struct Counts {
    pub(super) passed: u64,
    pub(super) failed: u64,
    pub(super) ignored: u64,
    /// Test programs.
    pub(super) programs: u64,
    /// Lines in which a test says that it skipped something.
    pub(super) skipped: Vec<String>,
}

impl Counts {
    /// Reads the output of `cargo test`.
    pub(super) fn parse(output: &str) -> Self {
        let mut counts = Self::default();
        for line in output.lines() {
            let line = line.trim();
            if let Some(rest) = line.strip_prefix("test result: ") {
                counts.programs += 1;
                counts.passed += number(rest, " passed");
                counts.failed += number(rest, " failed");
                counts.ignored += number(rest, " ignored");
            } else if line.to_ascii_lowercase().starts_with("skip") {
                counts.skipped.push(line.to_owned());
            }
        }
        counts
    }
}

/// The number in front of a word.
fn number(text: &str, word: &str) -> u64 {
    let Some(end) = text.find(word) else { return 0 };
    let digits = text[..end].rsplit(|letter: char| !letter.is_ascii_digit()).next();
    digits.and_then(|digits| digits.parse().ok()).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_of_all_programs_are_summed() {
        let output = "running 2 tests\ntest a ... ok\n\
            test result: ok. 12 passed; 0 failed; 1 ignored; 0 measured; 3 filtered out; \
            finished in 0.01s\nSKIPPED: no data\n\
            test result: FAILED. 3 passed; 2 failed; 0 ignored; 0 measured; 0 filtered out\n";
        let counts = Counts::parse(output);
        assert_eq!((counts.passed, counts.failed), (15, 2));
        assert_eq!((counts.ignored, counts.programs), (1, 2));
        assert_eq!(counts.skipped, ["SKIPPED: no data"]);
    }

    #[test]
    fn other_output_counts_nothing() {
        assert_eq!(Counts::parse("test result\n3 passed\n"), Counts::default());
    }
}
