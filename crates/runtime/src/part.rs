//! Parts of a command that work beside it, and what is said when one of them fails.
//!
//! A thread that panics would end without a word. [`guard`] turns the panic into a [`PartFailure`], which whoever
//! waits for the thread tells the user at once, and which keeps the command from ending with success.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// A part of a command that does not do its work any more.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{part}: {why}; {effect}. Do: {next_step}")]
pub struct PartFailure {
    /// The part: `the diagnosis`.
    pub part: &'static str,
    /// The reason.
    pub why: String,
    /// The consequence for the command: `the line is driven on, and no longer judged`.
    pub effect: &'static str,
    /// The next step.
    pub next_step: &'static str,
}

/// Advice after a panic: it is never the user's fault.
const REPORT: &str =
    "report it as a fault of linesman, with the message above that begins with `thread`";

impl PartFailure {
    /// The failure of a part that panicked.
    #[must_use]
    pub fn of_panic(part: &'static str, effect: &'static str, panic: &(dyn Any + Send)) -> Self {
        let why = format!("it failed because of a fault of this program: {}", words(panic));
        Self { part, why, effect, next_step: REPORT }
    }
}

/// The message of a panic.
fn words(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("no message")
}

/// Does the work of a part. What it holds is dropped where it panics, so that others that wait for it go on.
///
/// # Errors
/// When it panicked.
pub fn guard<T>(
    part: &'static str,
    effect: &'static str,
    work: impl FnOnce() -> T,
) -> Result<T, PartFailure> {
    // Whoever shares something with the part learns that it failed, and uses no more of it than is sound.
    catch_unwind(AssertUnwindSafe(work))
        .map_err(|panic| PartFailure::of_panic(part, effect, &*panic))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_a_failure_with_part_reason_effect_and_next_step() {
        let index = std::hint::black_box(3);
        let failure = guard("the diagnosis", "nothing is judged", || [1, 2][index]).unwrap_err();
        let text = failure.to_string();
        assert!(text.starts_with("the diagnosis: it failed because of a fault"), "{text}");
        assert!(
            text.contains("the len is 2 but the index is 3; nothing is judged. Do: "),
            "{text}"
        );
        assert_eq!(guard("the diagnosis", "", || 5), Ok(5));
    }
}
