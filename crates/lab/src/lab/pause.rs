//! Pauses of the MainDevice: its computer does something else, so that it neither sends nor receives.
//!
//! On the line a pause and a card that falls silent are the same. To our own MainDevice it is the card that happens
//! (`watchdog-starved` with a card); one with the habits of others is stopped with it, as by a debugger or a program
//! that waits: it has sent nothing that could be missing, and knows nothing of the time that has passed.

use std::collections::VecDeque;

use linesman_proto::address::Path;
use linesman_proto::time::Instant;

use super::Lab;
use crate::habit::Habit;

/// Frames that have arrived while nobody fetched them.
#[derive(Default)]
pub(super) struct Socket {
    waiting: VecDeque<(Path, Vec<u8>)>,
}

impl Lab {
    /// Until when the MainDevice does nothing, if it is in a pause.
    fn paused_until(&mut self) -> Option<Instant> {
        if self.options.habit == Habit::Own {
            return None;
        }
        self.segment.silent_until(self.now, Path::A)
    }

    pub(super) fn is_paused(&mut self) -> bool {
        self.paused_until().is_some()
    }

    /// When the MainDevice has something to do.
    pub(super) fn main_due(&mut self) -> Option<Instant> {
        self.paused_until().or_else(|| match &self.other {
            Some(other) => other.poll_timeout(),
            None => self.main.poll_timeout(),
        })
    }

    /// Hands a frame to the MainDevice, or keeps it until the pause is over.
    pub(super) fn give_main(&mut self, at: Instant, path: Path, frame: &[u8]) {
        if self.is_paused() {
            self.socket.waiting.push_back((path, frame.to_vec()));
        } else {
            self.hand_over(at, path, frame);
        }
    }

    fn hand_over(&mut self, at: Instant, path: Path, frame: &[u8]) {
        match &mut self.other {
            Some(other) => other.handle_frame(at, path, frame),
            None => self.main.handle_frame(at, path, frame),
        }
    }

    /// Lets the MainDevice do what is due, unless it is in a pause.
    pub(super) fn serve_main(&mut self) {
        if self.is_paused() {
            return;
        }
        while let Some((path, frame)) = self.socket.waiting.pop_front() {
            self.hand_over(self.now, path, &frame);
        }
        match &mut self.other {
            Some(other) => other.handle_timeout(self.now),
            None => self.main.handle_timeout(self.now),
        }
    }
}
