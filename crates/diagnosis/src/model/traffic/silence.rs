//! Stretches of time in which requests went out and nothing came back.

use std::collections::VecDeque;

use linesman_proto::time::Instant;

use crate::model::Seen;

/// Silences kept.
pub const SILENCES_KEPT: usize = 16;
/// With fewer requests than this it is no silence.
const SHORT: u64 = 3;

/// A stretch of time in which requests went out and nothing came back.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Silence {
    /// The first request without a return.
    pub since: Seen<()>,
    /// The latest one.
    pub last: Seen<()>,
    /// Number of requests.
    pub frames: u64,
    /// When something came back again.
    pub ended: Option<Instant>,
    /// When the two requests before the latest one were sent, the earlier one first.
    before_last: [Instant; 2],
    /// Number of frames that had come back before.
    pub(super) returns_before: u64,
}

impl Silence {
    /// Of one request so far.
    pub(super) const fn begin(seen: Seen<()>, ended: Option<Instant>, returns_before: u64) -> Self {
        let before_last = [seen.at; 2];
        Self { since: seen, last: seen, frames: 1, ended, before_last, returns_before }
    }

    /// One more request is lost.
    pub(super) const fn goes_on(&mut self, seen: Seen<()>) {
        self.before_last = [self.before_last[1], self.last.at];
        self.last = seen;
        self.frames += 1;
    }

    /// True if its latest three requests, at least, were sent from `from` on.
    #[must_use]
    pub fn has_three_since(&self, from: Instant) -> bool {
        self.frames >= 3 && self.before_last[0] >= from
    }
}

/// Adds a silence to those that are kept: one of few frames before it is none, and goes.
pub(super) fn keep(silences: &mut VecDeque<Silence>, silence: Silence) {
    if silences.back().is_some_and(|latest| latest.frames < SHORT) {
        // A few frames lost among others are no silence worth keeping.
        silences.pop_back();
    } else if silences.len() == SILENCES_KEPT {
        silences.pop_front();
    }
    silences.push_back(silence);
}
