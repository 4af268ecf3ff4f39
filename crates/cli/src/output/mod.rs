//! Output of a command: text for people, JSON for programs, complaints and progress to the side.

pub(crate) mod markdown;
pub(crate) mod paint;
pub(crate) mod progress;
pub(crate) mod table;
pub(crate) mod wrap;

use std::cell::Cell;
use std::io::{self, IsTerminal as _, Write as _};
use std::os::fd::AsFd;

use linesman_link::signal::is_without_reader;
use serde::Serialize;

pub(crate) use paint::Paint;
pub(crate) use progress::Progress;
pub(crate) use table::Table;
use terminal_size::terminal_size_of;
use wrap::fitted;
pub(crate) use wrap::wrapped;

use crate::cli::ColorChoice;
use crate::failure::Failure;
use crate::hint;

/// Widest text, in columns: longer lines are hard to read. Tables may be wider.
const MAX_WIDTH: usize = 110;
/// Width where no terminal says, such as in a file.
const PLAIN_WIDTH: usize = 100;
/// Narrower terminals break the lines themselves.
const MIN_WIDTH: usize = 40;

/// Standard output and standard error.
pub(crate) struct Output {
    paint: Paint,
    complaints: Paint,
    width: usize,
    /// Set once nobody reads any more; then nothing is written, and nothing is an error.
    closed: bool,
    /// Why something of the answer could not be written, where somebody wants to read it.
    lost: Option<io::Error>,
    /// Whether a part of the command failed, which was said.
    failed: Cell<bool>,
    /// Where the line is, as the user has named it: for commands that are advised.
    place: String,
}

impl Output {
    /// An output that writes in colour when it should.
    pub(crate) fn new(color: ColorChoice) -> Self {
        let limit = limit_of(&io::stdout());
        let aside = limit_of(&io::stderr());
        Self {
            paint: Paint::for_stream(color, io::stdout().is_terminal()).with_limit(limit),
            complaints: Paint::for_stream(color, io::stderr().is_terminal()).with_limit(aside),
            width: limit.map_or(PLAIN_WIDTH, |width| width.min(MAX_WIDTH)),
            closed: false,
            lost: None,
            failed: Cell::new(false),
            place: String::new(),
        }
    }

    /// The same for a command at a place.
    pub(crate) fn at(mut self, place: Option<&str>) -> Self {
        place.unwrap_or_default().clone_into(&mut self.place);
        self
    }

    /// A text whose commands can be run as they are printed.
    pub(crate) fn hint(&self, text: &str) -> String {
        hint::complete(text, &self.place)
    }

    /// A failure whose advice can be run as it is printed.
    pub(crate) fn made(&self, failure: &Failure) -> Failure {
        Failure::new(self.hint(&failure.reason), self.hint(&failure.next_step))
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

    /// Notices that the reader went away although nothing is written meanwhile.
    pub(crate) fn look_for_reader(&mut self) {
        self.closed |= is_without_reader(io::stdout());
    }

    /// Writes text for people: lines that are longer than the terminal is wide are broken at words.
    pub(crate) fn text(&mut self, text: &str) {
        match self.paint.limit() {
            Some(limit) => self.raw(&fitted(text, limit)),
            None => self.raw(text),
        }
    }

    /// Writes text for programs, as it is.
    pub(crate) fn raw(&mut self, text: &str) {
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

    /// Says at once that a part of the command has failed, though the rest goes on: it does not end with success.
    pub(crate) fn fail(&self, failure: &Failure) {
        self.failed.set(true);
        self.complain(failure);
    }

    /// Whether a part of the command has failed.
    pub(crate) fn has_failed(&self) -> bool {
        self.failed.get()
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
            Ok(text) => self.raw(&format!("{text}\n")),
            Err(error) => self.fail(&unwritable(&error)),
        }
    }

    /// Writes one JSON object on one line.
    pub(crate) fn json_line<T: Serialize>(&mut self, value: &T) {
        match serde_json::to_string(value) {
            Ok(text) => self.raw(&format!("{text}\n")),
            Err(error) => self.fail(&unwritable(&error)),
        }
    }

    /// Says to the side why there is no answer.
    pub(crate) fn complain(&self, failure: &Failure) {
        let (failure, paint) = (self.made(failure), self.complaints);
        let mut text = format!("{} {}\n", paint.bad("error:"), failure.reason);
        if !failure.next_step.is_empty() {
            text.push_str(&format!("{} {}\n", paint.bold("do:"), failure.next_step));
        }
        self.aside(&text);
    }

    /// Says something to the side that does not belong to the answer.
    pub(crate) fn warn(&self, text: &str) {
        let text = self.hint(text);
        self.aside(&format!("{} {text}\n", self.complaints.warning("note:")));
    }

    fn aside(&self, text: &str) {
        let fitted = self.complaints.limit().map(|limit| fitted(text, limit));
        // There is nobody left to tell when standard error is closed.
        let _ = io::stderr().lock().write_all(fitted.as_deref().unwrap_or(text).as_bytes());
    }
}

/// What cannot be put into JSON.
fn unwritable(error: &serde_json::Error) -> Failure {
    Failure::new(
        format!("the answer cannot be written as JSON: {error}"),
        "repeat it without --json",
    )
}

/// Columns of the terminal behind a stream; where there is none, those that COLUMNS says. `None` in
/// files and pipes: whoever searches there wants a line for each thing.
fn limit_of(stream: &impl AsFd) -> Option<usize> {
    let told = || std::env::var("COLUMNS").ok()?.parse().ok();
    let terminal = terminal_size_of(stream).map(|(width, _)| usize::from(width.0));
    terminal.or_else(told).filter(|width| *width > 0).map(|width| width.max(MIN_WIDTH))
}
