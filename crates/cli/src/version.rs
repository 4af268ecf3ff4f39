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
