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

    /// So many that were taken for requests are returns.
    pub(super) const fn take_back(&mut self, count: u64) {
        self.sent = self.sent.saturating_sub(count);
    }

    /// Who sends requests is known anew.
    pub(crate) fn set_senders(&mut self, senders: &[Sender]) {
        self.senders = senders.to_vec();
    }

    /// How many were sent.
    #[must_use]
    pub const fn sent(&self) -> u64 {
        self.sent
    }

    /// Who sent them, at most four.
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

    /// So many that were taken for requests are returns without one.
    pub(super) const fn take_over(&mut self, count: u64) {
        self.count += count;
        self.alone += count;
    }

    /// So many frames came back a second time.
    pub(crate) const fn record_doubled(&mut self, count: u64) {
        self.doubled += count;
    }

    /// A frame came back that somebody had processed, as one of its datagrams tells.
    pub(super) fn record_processed(&mut self, at: Instant) {
        // Each datagram of a frame tells it.
        self.processed += u64::from(self.latest_processed != Some(at));
        self.latest_processed = Some(at);
    }

    /// How many came back.
    #[must_use]
    pub const fn count(&self) -> u64 {
        self.count
    }

    /// Those of them whose request was not seen.
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

    /// Those that somebody had processed.
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
