//! DL status of one controller over time: how its ports stood.

use std::collections::VecDeque;

use linesman_proto::port::Port;
use linesman_proto::register::DlStatus;
use linesman_proto::time::Instant;

use super::{Seen, push_kept};

/// DL status over time.
#[derive(Clone, Default, Debug)]
pub struct DlHistory {
    /// DL status (0x0110) as first read.
    pub first: Option<Seen<DlStatus>>,
    /// As last read.
    pub last: Option<Seen<DlStatus>>,
    /// Time of the latest reading, whether or not it was news.
    pub latest_reading: Option<Instant>,
    /// Whether the latest reading is but what follows from a state that a list names.
    pub is_assumed: bool,
    /// Changes, oldest first, at most [`CHANGES_KEPT`](super::CHANGES_KEPT).
    pub changes: VecDeque<DlChange>,
    /// All changes, also those forgotten.
    pub change_count: u64,
}

/// A change of DL status.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct DlChange {
    /// As it was.
    pub from: DlStatus,
    /// As it is then.
    pub to: DlStatus,
    /// When.
    pub at: Instant,
    /// The number of the frame that showed it.
    pub frame: Option<u64>,
}

impl DlHistory {
    /// Takes a reading of DL status. Says whether it is news.
    pub fn record(&mut self, status: DlStatus, at: Instant, frame: Option<u64>) -> bool {
        self.latest_reading = self.latest_reading.max(Some(at));
        let seen = Seen::new(status, at, frame);
        let Some(last) = self.last else {
            self.first = Some(seen);
            self.last = Some(seen);
            return true;
        };
        if last.value == status {
            return false;
        }
        self.last = Some(seen);
        self.change_count += 1;
        push_kept(&mut self.changes, DlChange { from: last.value, to: status, at, frame });
        true
    }

    /// Whether a port is in use now; `None` when DL status was never read.
    #[must_use]
    pub fn is_active(&self, port: Port) -> Option<bool> {
        Some(self.last?.value.port_state(port).is_active())
    }

    /// Whether a port was in use when it was first read.
    #[must_use]
    pub fn was_active(&self, port: Port) -> Option<bool> {
        Some(self.first?.value.port_state(port).is_active())
    }
}
