//! Requests that a MainDevice sends, and frames that come back.

use linesman_proto::time::Instant;

use crate::model::Seen;
use crate::observe::Sender;

/// Returns whose times are kept: a request is known to be lost after so many later ones at most.
const RECENT: u64 = 64;

/// Requests: frames on their way out, each once. The intake of frames fills it in.
#[derive(Clone, Default, Debug)]
pub struct Requests {
    sent: u64,
    senders: Vec<Sender>,
}

impl Requests {
    /// A request, or the copy of it for a ring's second card, was sent.
    pub(crate) const fn record(&mut self) {
        self.sent += 1;
    }

    /// Takes frames out of the requests again: they are returns.
    pub(super) const fn take_back(&mut self, count: u64) {
        self.sent = self.sent.saturating_sub(count);
    }

    /// Replaces the senders of requests.
    pub(crate) fn set_senders(&mut self, senders: &[Sender]) {
        self.senders = senders.to_vec();
    }

    /// Number of requests that were sent.
    #[must_use]
    pub const fn sent(&self) -> u64 {
        self.sent
    }

    /// Senders of the requests, at most four.
    #[must_use]
    pub fn senders(&self) -> &[Sender] {
        &self.senders
    }
}

/// Frames that came back. The intake of frames fills it in, the learner what somebody had processed.
#[derive(Clone, Default, Debug)]
pub struct Returns {
    count: u64,
    alone: u64,
    doubled: u64,
    latest: Option<Seen<()>>,
    processed: u64,
    latest_processed: Option<Instant>,
    recent: RecentReturns,
}

/// Times of the latest returns, in a circle.
#[derive(Clone, Debug)]
struct RecentReturns([Instant; RECENT as usize]);

impl Default for RecentReturns {
    fn default() -> Self {
        Self([Instant::default(); RECENT as usize])
    }
}

impl Returns {
    /// A frame came back.
    pub(super) const fn record(&mut self, seen: Seen<()>) {
        self.recent.0[(self.count % RECENT) as usize] = seen.at;
        self.count += 1;
        self.latest = Some(seen);
    }

    /// The request of a frame that came back was not seen.
    pub(crate) const fn record_alone(&mut self) {
        self.alone += 1;
    }

    /// Counts frames as returns without a request; they were taken for requests.
    pub(super) const fn take_over(&mut self, count: u64) {
        self.count += count;
        self.alone += count;
    }

    /// Counts frames that came back a second time.
    pub(crate) const fn record_doubled(&mut self, count: u64) {
        self.doubled += count;
    }

    /// A frame came back that somebody had processed, as one of its datagrams tells.
    pub(super) fn record_processed(&mut self, at: Instant) {
        // Each datagram of a frame tells it.
        self.processed += u64::from(self.latest_processed != Some(at));
        self.latest_processed = Some(at);
    }

    /// Number of frames that came back.
    #[must_use]
    pub const fn count(&self) -> u64 {
        self.count
    }

    /// Number of them whose request was not seen.
    #[must_use]
    pub const fn alone(&self) -> u64 {
        self.alone
    }

    /// Frames that came back a second time, as a live socket tells.
    #[must_use]
    pub const fn doubled(&self) -> u64 {
        self.doubled
    }

    /// The latest frame that came back.
    #[must_use]
    pub const fn latest(&self) -> Option<Seen<()>> {
        self.latest
    }

    /// Number of them that somebody had processed.
    #[must_use]
    pub const fn processed(&self) -> u64 {
        self.processed
    }

    /// The latest time at which one came back that somebody had processed.
    #[must_use]
    pub const fn latest_processed(&self) -> Option<Instant> {
        self.latest_processed
    }

    /// When the first frame came back after so many others; `sent`, if that is long ago.
    pub(super) fn after(&self, returns_before: u64, sent: Instant) -> Option<Instant> {
        match self.count.checked_sub(returns_before) {
            None | Some(0) => None,
            Some(later) if later <= RECENT => {
                Some(self.recent.0[(returns_before % RECENT) as usize])
            }
            Some(_) => Some(sent),
        }
    }
}
