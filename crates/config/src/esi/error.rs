//! Errors of a device description, with their places.

/// A device description that cannot be used.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("line {line}, {element}: {reason}")]
pub struct EsiError {
    /// The line, from 1.
    pub line: u32,
    /// The element, such as `Device EL2004/Sm`.
    pub element: String,
    /// What is wrong, and what was expected.
    pub reason: String,
}

impl EsiError {
    pub(crate) fn new(line: u32, element: &str, reason: impl Into<String>) -> Self {
        Self { line, element: element.to_owned(), reason: reason.into() }
    }

    /// The same, seen from the element around it.
    pub(crate) fn within(mut self, outer: &str) -> Self {
        self.element = format!("{outer}/{}", self.element);
        self
    }
}
