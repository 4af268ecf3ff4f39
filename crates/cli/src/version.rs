//! Version of this build.

/// `0.1.0 (1a2b3c4d5e)`, or without the commit where it was built outside of a clone.
pub(crate) const VERSION: &str = {
    const COMMIT: &str = env!("LINESMAN_COMMIT");
    if COMMIT.is_empty() {
        env!("CARGO_PKG_VERSION")
    } else {
        concat!(env!("CARGO_PKG_VERSION"), " (", env!("LINESMAN_COMMIT"), ")")
    }
};

/// The field `tool` of every JSON output.
pub(crate) fn tool() -> String {
    format!("linesman {VERSION}")
}

/// The first of the seeds that belong to this commit alone; `None` where it is not known.
///
/// They lie above a billion, where nothing is tuned: whoever changes the program changes its commit and gets others.
pub(crate) fn first_fresh_seed() -> Option<u64> {
    const TUNED: u64 = 1_000_000_000;
    let commit = u64::from_str_radix(env!("LINESMAN_COMMIT"), 16).ok()?;
    Some(TUNED + (commit % 1_000_000) * 1_000_000)
}
