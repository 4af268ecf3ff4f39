//! Frames that are not EtherCAT.

use linesman_proto::time::Instant;

use crate::model::Seen;

/// Frames that are not EtherCAT. The intake of frames fills it in.
#[derive(Clone, Default, Debug)]
pub struct ForeignFrames {
    count: u64,
    received: u64,
    first: Option<Seen<u16>>,
    latest: Option<Instant>,
}

impl ForeignFrames {
    /// One was seen, by its EtherType or length. Says whether it is news.
    pub fn record(&mut self, seen: Seen<u16>, is_received: bool) -> bool {
        self.count += 1;
        self.received += u64::from(is_received);
        self.first.get_or_insert(seen);
        self.latest = self.latest.max(Some(seen.at));
        // The thousandth is none.
        self.count.is_power_of_two() || self.received == 1
    }

    /// Number of foreign frames that were seen.
    #[must_use]
    pub const fn count(&self) -> u64 {
        self.count
    }

    /// Number of them that came in, as a live socket tells.
    #[must_use]
    pub const fn received(&self) -> u64 {
        self.received
    }

    /// The first of them, by its EtherType or length.
    #[must_use]
    pub const fn first(&self) -> Option<Seen<u16>> {
        self.first
    }

    /// When the latest was seen.
    #[must_use]
    pub const fn latest(&self) -> Option<Instant> {
        self.latest
    }
}
