//! Latency of something that was requested and then polled: between the last poll that still saw
//! the old and the first that saw the new.

use linesman_proto::time::{Instant, Span};

/// Something that is under way.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Waiting {
    since: Instant,
    /// When it was last seen not to be done.
    last: Instant,
}

impl Waiting {
    pub(super) fn since(at: Instant) -> Self {
        Self { since: at, last: at }
    }

    /// A poll saw the old.
    pub(super) fn still(&mut self, at: Instant) {
        self.last = self.last.max(at);
    }

    /// When it was last seen not to be done.
    pub(super) fn last_seen(&self) -> Instant {
        self.last
    }

    /// A poll saw the new: how long it took, half way between the two polls.
    pub(super) fn done(&self, at: Instant) -> Span {
        let before = self.last.since(self.since).as_nanos();
        let after = at.since(self.since).as_nanos();
        Span::ns(before + after.saturating_sub(before) / 2)
    }
}
