//! Requests and returns that were not what they seemed, and the latest returns, by which a second one is known.

use linesman_proto::time::{Instant, Span};

use super::{Fingerprint, Pairing, REMEMBERED, gap};

impl Pairing {
    /// How many requests turned out to be returns whose request was not seen, since this was asked.
    pub fn take_mistaken(&mut self) -> u64 {
        std::mem::take(&mut self.mistaken)
    }

    /// How many frames came back a second time, since this was asked.
    pub fn take_doubled(&mut self) -> u64 {
        std::mem::take(&mut self.doubled)
    }

    /// How many requests were sent and not recorded, as their numbers tell, since this was asked.
    pub fn take_unrecorded(&mut self) -> u64 {
        std::mem::take(&mut self.unrecorded)
    }

    pub(super) fn remember(&mut self, print: Fingerprint, time: Instant) {
        self.returned[self.returned_next] = Some((print, time));
        self.returned_next = (self.returned_next + 1) % REMEMBERED;
    }

    /// Whether the same came back within some time.
    pub(super) fn was_returned(&self, print: Fingerprint, time: Instant, within: Span) -> bool {
        let known = self.returned.iter().flatten();
        known.into_iter().any(|(other, at)| *other == print && gap(*at, time) <= within)
    }
}
