//! Pauses of the MainDevice: its computer does something else, so that it neither sends nor receives.
//!
//! On the line a pause and a card that falls silent are the same. To our own MainDevice it is the card that happens
//! (`watchdog-starved` with a card); one with the habits of others is stopped with it, as by a debugger or a program
//! that waits: it has sent nothing that could be missing, and knows nothing of the time that has passed.

use std::collections::VecDeque;

use linesman_proto::address::Path;
use linesman_proto::time::Instant;
use linesman_session::DiagnosisInput;
use linesman_session::transport::{FrameSink, RxFrame, Transport};

use super::{FRAME, Lab};
use crate::habit::Habit;

/// Frames that have arrived while nobody fetched them.
#[derive(Default)]
pub(super) struct Socket {
    waiting: VecDeque<(Path, Vec<u8>)>,
    arrival: Vec<u8>,
}

impl FrameSink for Socket {
    fn room(&mut self) -> &mut [u8] {
        self.arrival.resize(FRAME, 0);
        &mut self.arrival
    }

    fn frame_received(&mut self, received: RxFrame) {
        let frame = self.arrival.get(..received.len).unwrap_or_default();
        self.waiting.push_back((received.path, frame.to_vec()));
    }
}

impl Lab {
    /// Until when the MainDevice does nothing, if it is in a pause.
    fn paused_until(&mut self) -> Option<Instant> {
        if self.options.habit == Habit::Own {
            return None;
        }
        let now = self.now();
        self.line.segment_mut().silent_until(now, Path::A)
    }

    pub(super) fn is_paused(&mut self) -> bool {
        self.paused_until().is_some()
    }

    /// When the MainDevice has something to do.
    pub(super) fn main_due(&mut self) -> Option<Instant> {
        self.paused_until().or_else(|| match &self.other {
            Some(other) => other.soem.poll_timeout(),
            None => self.session.poll_timeout(),
        })
    }

    /// Lets frames come, and nobody fetch them.
    pub(super) fn take_in_paused(&mut self, now: Instant) {
        let Self { line, socket, session, .. } = self;
        let shown = session.hooks_mut().diagnosis_mut();
        let Ok(_) = line.receive(now, socket);
        let Ok(()) = line.look_at_host(now, &mut |observation| shown.host(observation));
    }

    /// Hands over what has arrived during a pause.
    pub(super) fn fetch_waiting(&mut self, now: Instant) {
        while let Some((path, frame)) = self.socket.waiting.pop_front() {
            match &mut self.other {
                Some(other) => {
                    let shown = self.session.hooks_mut().diagnosis_mut();
                    other.handle_frame(now, path, &frame, shown);
                }
                None => self.session.handle_frame(now, now, path, &frame),
            }
        }
    }
}
