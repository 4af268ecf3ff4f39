//! Fault of an expression: its place in the text, what is wrong there, and what to write.

use std::ops::Range;

/// Why a text is no expression, or why one cannot be evaluated.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("column {}: {reason}. Do: {next_step}", .at.start + 1)]
pub struct ExpressionError {
    /// Place in the text, in bytes.
    pub at: Range<usize>,
    /// The mistake there: expected, received.
    pub reason: String,
    /// Next step for the user.
    pub next_step: String,
}

impl ExpressionError {
    pub(super) fn new(
        at: Range<usize>,
        reason: impl Into<String>,
        next_step: impl Into<String>,
    ) -> Self {
        Self { at, reason: reason.into(), next_step: next_step.into() }
    }

    /// The text with a mark beneath the place, in two lines.
    #[must_use]
    pub fn pointer(&self, text: &str) -> String {
        let line: String =
            text.chars().map(|letter| if letter.is_control() { ' ' } else { letter }).collect();
        let columns = |end: usize| text.get(..end).map_or(0, |part| part.chars().count());
        let (start, end) = (columns(self.at.start), columns(self.at.end));
        let marks = "^".repeat(end.saturating_sub(start).max(1));
        format!("  {line}\n  {}{marks}", " ".repeat(start))
    }
}
