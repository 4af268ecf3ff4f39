//! Progress of long work: one line on standard error, when that is a terminal.

use std::io::{self, IsTerminal as _, Write as _};
use std::time::{Duration, Instant};

use terminal_size::terminal_size_of;

/// Short work shows nothing.
const FIRST: Duration = Duration::from_millis(700);
/// Between two lines.
const EVERY: Duration = Duration::from_millis(200);

/// A line that is written over and over.
pub(crate) struct Progress {
    on: bool,
    next: Instant,
    shown: bool,
}

impl Progress {
    /// One that has shown nothing.
    pub(crate) fn new() -> Self {
        Self { on: io::stderr().is_terminal(), next: Instant::now() + FIRST, shown: false }
    }

    /// Shows the line, if it is time.
    pub(crate) fn show(&mut self, line: impl FnOnce() -> String) {
        if !self.on || Instant::now() < self.next {
            return;
        }
        self.next = Instant::now() + EVERY;
        self.shown = true;
        let columns = terminal_size_of(io::stderr()).map_or(80, |(width, _)| usize::from(width.0));
        // A line that is broken could not be taken away.
        let line: String = line().chars().take(columns.saturating_sub(5)).collect();
        // There is nobody left to tell when standard error is closed.
        let _ = write!(io::stderr().lock(), "\r\x1b[K  {line} …");
    }

    /// Takes the line away.
    pub(crate) fn clear(&mut self) {
        if std::mem::take(&mut self.shown) {
            let _ = write!(io::stderr().lock(), "\r\x1b[K");
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.clear();
    }
}
