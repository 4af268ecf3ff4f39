//! Colour and columns of terminals. Meaning never hangs on colour alone.

use crate::cli::ColorChoice;

/// What a stream can show: colours, and how many columns.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Paint {
    on: bool,
    /// Most columns of a line; `None` where lines may be as long as they are, as in a file.
    limit: Option<usize>,
}

impl Paint {
    /// Without colour, in lines of any length.
    pub(crate) const PLAIN: Self = Self { on: false, limit: None };

    /// The same with lines of so many columns at most.
    #[must_use]
    pub(crate) const fn with_limit(mut self, limit: Option<usize>) -> Self {
        self.limit = limit;
        self
    }

    /// Most columns of a line.
    pub(crate) const fn limit(self) -> Option<usize> {
        self.limit
    }

    /// For a stream: see <https://no-color.org>.
    pub(crate) fn for_stream(choice: ColorChoice, is_terminal: bool) -> Self {
        let set = |name| std::env::var_os(name).is_some_and(|value| !value.is_empty());
        let dumb = std::env::var_os("TERM").is_some_and(|term| term == "dumb");
        let on = match choice {
            ColorChoice::Always => true,
            ColorChoice::Never => false,
            ColorChoice::Auto => is_terminal && !set("NO_COLOR") && !dumb,
        };
        Self { on, limit: None }
    }

    fn with(self, code: &str, text: &str) -> String {
        if self.on && !text.is_empty() {
            format!("\x1b[{code}m{text}\x1b[0m")
        } else {
            text.to_owned()
        }
    }

    /// Headlines.
    pub(crate) fn bold(self, text: &str) -> String {
        self.with("1", text)
    }

    /// What matters less.
    pub(crate) fn faint(self, text: &str) -> String {
        self.with("2", text)
    }

    /// Code, commands and names to type.
    pub(crate) fn code(self, text: &str) -> String {
        self.with("36", text)
    }

    /// All is well.
    pub(crate) fn good(self, text: &str) -> String {
        self.with("1;32", text)
    }

    /// Something to look at.
    pub(crate) fn warning(self, text: &str) -> String {
        self.with("1;33", text)
    }

    /// Something is wrong.
    pub(crate) fn bad(self, text: &str) -> String {
        self.with("1;31", text)
    }
}

/// How many columns a text takes, colours not counted.
pub(crate) fn columns(text: &str) -> usize {
    let mut count = 0;
    let mut in_escape = false;
    for character in text.chars() {
        match (in_escape, character) {
            (false, '\x1b') => in_escape = true,
            (false, _) => count += 1,
            (true, 'm') => in_escape = false,
            (true, _) => {}
        }
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_take_no_columns() {
        let paint = Paint { on: true, limit: None };
        assert_eq!(paint.bad("ab"), "\x1b[1;31mab\x1b[0m");
        assert_eq!(columns(&paint.bad("ab")), 2);
        assert_eq!(Paint::PLAIN.bad("ab"), "ab");
        assert_eq!(columns("µs ─"), 4);
    }

    #[test]
    fn a_choice_beats_the_terminal() {
        assert_eq!(Paint::for_stream(ColorChoice::Always, false), Paint { on: true, limit: None });
        assert_eq!(Paint::for_stream(ColorChoice::Never, true), Paint { on: false, limit: None });
        assert_eq!(Paint::for_stream(ColorChoice::Auto, false), Paint { on: false, limit: None });
    }
}
