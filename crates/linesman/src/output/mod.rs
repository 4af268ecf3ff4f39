//! Where answers go: text for people, JSON for programs, complaints and progress to the side.

pub(crate) mod paint;
pub(crate) mod progress;
pub(crate) mod table;
pub(crate) mod wrap;

use std::io::{self, IsTerminal as _, Write as _};

use serde::Serialize;

pub(crate) use paint::Paint;
pub(crate) use progress::Progress;
pub(crate) use table::Table;
pub(crate) use wrap::wrapped;

use crate::cli::ColorChoice;
use crate::failure::Failure;

/// Widest text, in columns: longer lines are hard to read.
const MAX_WIDTH: usize = 110;
/// Width where no terminal says, such as in a file.
const PLAIN_WIDTH: usize = 100;

/// Standard output and standard error.
pub(crate) struct Output {
    paint: Paint,
    complaints: Paint,
    width: usize,
    /// Set once nobody reads any more; then nothing is written, and nothing is an error.
    closed: bool,
    /// Why something of the answer could not be written, where somebody wants to read it.
    lost: Option<io::Error>,
}

impl Output {
    /// An output that writes in colour when it should.
    pub(crate) fn new(color: ColorChoice) -> Self {
        let width = terminal_size::terminal_size().map(|(width, _)| usize::from(width.0));
        Self {
            paint: Paint::for_stream(color, io::stdout().is_terminal()),
            complaints: Paint::for_stream(color, io::stderr().is_terminal()),
            width: width.map_or(PLAIN_WIDTH, |width| width.clamp(40, MAX_WIDTH)),
            closed: false,
            lost: None,
        }
    }

    /// The colours of standard output.
    pub(crate) const fn paint(&self) -> Paint {
        self.paint
    }

    /// Columns there are for text.
    pub(crate) const fn width(&self) -> usize {
        self.width
    }

    /// Whether the reader went away (`| head`).
    pub(crate) const fn is_closed(&self) -> bool {
        self.closed
    }

    /// Writes text as it is.
    pub(crate) fn text(&mut self, text: &str) {
        if self.closed {
            return;
        }
        let mut stdout = io::stdout().lock();
        if let Err(error) = stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
            self.closed = true;
            // A reader that has seen enough is no error; a full disk is.
            self.lost = Some(error).filter(|error| error.kind() != io::ErrorKind::BrokenPipe);
        }
    }

    /// Why the answer could not be written to its end, if it could not.
    pub(crate) fn loss(&self) -> Option<Failure> {
        let lost = self.lost.as_ref()?;
        let reason = format!("standard output: writing the answer: {lost}");
        Some(Failure::new(reason, "make room where it is written to, then repeat the command"))
    }

    /// Writes text and ends the line.
    pub(crate) fn line(&mut self, text: &str) {
        self.text(&format!("{text}\n"));
    }

    /// Writes one JSON object.
    pub(crate) fn json<T: Serialize>(&mut self, value: &T) {
        match serde_json::to_string_pretty(value) {
            Ok(text) => self.line(&text),
            Err(error) => self.warn(&format!("writing JSON: {error}")),
        }
    }

    /// Writes one JSON object on one line.
    pub(crate) fn json_line<T: Serialize>(&mut self, value: &T) {
        match serde_json::to_string(value) {
            Ok(text) => self.line(&text),
            Err(error) => self.warn(&format!("writing JSON: {error}")),
        }
    }

    /// Says to the side why there is no answer.
    pub(crate) fn complain(&self, failure: &Failure) {
        let paint = self.complaints;
        let mut text = format!("{} {}\n", paint.bad("error:"), failure.reason);
        if !failure.next_step.is_empty() {
            text.push_str(&format!("{} {}\n", paint.bold("do:"), failure.next_step));
        }
        aside(&text);
    }

    /// Says something to the side that does not belong to the answer.
    pub(crate) fn warn(&self, text: &str) {
        aside(&format!("{} {text}\n", self.complaints.warning("note:")));
    }
}

fn aside(text: &str) {
    // There is nobody left to tell when standard error is closed.
    let _ = io::stderr().lock().write_all(text.as_bytes());
}
