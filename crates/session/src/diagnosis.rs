//! Input of a diagnosis beside a session: inline, or behind a queue.
//!
//! An [`Engine`] takes frames at once: in virtual time, where its work costs nobody anything. On a real line what keeps
//! frames for another thread stands in its place.

use linesman_diagnosis::{Engine, Event, FrameSeen, HostObservation, Probe};
use linesman_proto::time::Instant;

use crate::frame::FrameSummary;

/// Interface of a session to a diagnosis: frames and observations in, questions and findings out.
pub trait DiagnosisInput {
    /// A frame left a card or came back.
    fn frame(&mut self, frame: &FrameSeen<'_>);
    /// As [`SessionHooks::room`](crate::SessionHooks::room).
    fn room(&mut self, _now: Instant) -> Option<&mut [u8]> {
        None
    }
    /// As [`SessionHooks::keep`](crate::SessionHooks::keep).
    fn keep(&mut self, _passed: &FrameSummary, _len: usize) {}
    /// The host noticed something.
    fn host(&mut self, observation: &HostObservation);
    /// Everything up to `now` is shown.
    fn turn(&mut self, now: Instant);
    /// When [`turn`](Self::turn) has something to do.
    fn poll_timeout(&self) -> Option<Instant>;
    /// Next question: something that it would like to have read.
    fn poll_probe(&mut self) -> Option<Probe>;
    /// Next change of a finding.
    fn poll_event(&mut self) -> Option<Event>;
}

impl DiagnosisInput for Engine {
    fn frame(&mut self, frame: &FrameSeen<'_>) {
        self.handle_frame(frame);
    }

    fn host(&mut self, observation: &HostObservation) {
        self.handle_host(observation);
    }

    fn turn(&mut self, now: Instant) {
        self.handle_timeout(now);
    }

    fn poll_timeout(&self) -> Option<Instant> {
        Self::poll_timeout(self)
    }

    fn poll_probe(&mut self) -> Option<Probe> {
        Self::poll_probe(self)
    }

    fn poll_event(&mut self) -> Option<Event> {
        Self::poll_event(self)
    }
}
