//! The watch: what a person or a control program wants to see of a running network.
//!
//! [`Watch`] is an engine that is fed with the [`Event`]s of a MainDevice. It keeps the state words
//! of each SubDevice and of the network, the error counters as totals that survive clears and
//! restarts, the change counters of the vendor's online list, and it words what happened as
//! [`LogEntry`]s. It knows no clock and asks for nothing: it costs the cycle nothing.
//!
//! Read first: `facts` 3.1 and 3.2 of the vendor interface (online list, message texts).

mod counters;
mod device;
mod entry;
mod group_status;
mod network_status;
mod topology;
mod wording;

use std::collections::VecDeque;
use std::sync::Arc;

use linesman_config::plan::Plan;
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::state::NetworkState;
use linesman_proto::time::{Instant, Span};

use crate::event::Event;

pub use counters::CounterTotals;
pub use device::{AbnormalChange, WatchedDevice};
pub use entry::{EntryKind, LogEntry, Severity};
pub use group_status::{GroupRefusal, GroupStatus};
pub use network_status::NetworkStatus;
pub use topology::TopologyEntry;

/// So many entries wait for somebody who fetches them; older ones are dropped and counted.
const WAITING_ENTRIES: usize = 10_000;
/// SubDevices that get lost within this time are told of together: a cable takes all behind it.
const LOST_TOGETHER: Span = Span::ms(20);

/// The watch over one network.
#[derive(Debug)]
pub struct Watch {
    plan: Arc<Plan>,
    network_status: NetworkStatus,
    /// SubDevices that got lost and were not told of yet, and since when.
    lost: Vec<DeviceId>,
    lost_at: Instant,
    entries: VecDeque<LogEntry>,
    dropped: u64,
}

impl Watch {
    /// A watch over the SubDevices of a plan, of which nothing is known yet.
    #[must_use]
    pub fn new(plan: Arc<Plan>) -> Self {
        Self {
            network_status: NetworkStatus::new(&plan),
            plan,
            lost: Vec::new(),
            lost_at: Instant::ZERO,
            entries: VecDeque::new(),
            dropped: 0,
        }
    }

    // ---- getters ----

    /// How the network stands.
    #[must_use]
    pub fn network_status(&self) -> &NetworkStatus {
        &self.network_status
    }

    /// The plan that is watched.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// How many entries were dropped because nobody fetched them.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    // ---- what comes in ----

    /// Something happened.
    pub fn handle_event(&mut self, now: Instant, event: &Event) {
        self.handle_timeout(now);
        // That a group has left is told by itself.
        if let Event::DeviceLost { id } = event
            && !self.plan.is_optional(*id)
        {
            if self.lost.is_empty() {
                self.lost_at = now;
            }
            self.lost.push(*id);
        }
        // The wording may need what was before.
        let entries = wording::of(now, event, &self.plan, &self.network_status);
        self.network_status.handle_event(now, event);
        for entry in entries {
            self.push(entry);
        }
    }

    /// The carrier of a card came or went.
    pub fn handle_carrier(&mut self, now: Instant, card: Path, carrier: bool) {
        if self.network_status.set_carrier(card, carrier) {
            self.push(wording::carrier(now, card, carrier));
        }
    }

    /// The line is being brought up.
    pub fn begin_reset(&mut self) {
        self.network_status.begin_reset();
    }

    /// The card took a frame, or did not.
    pub fn handle_send_failure(&mut self, failing: bool) {
        self.network_status.set(NetworkState::OUT_OF_SEND_RESOURCES, failing);
    }

    /// Time has passed: what was waited with is told.
    pub fn handle_timeout(&mut self, now: Instant) {
        if now >= self.lost_at + LOST_TOGETHER {
            self.flush();
        }
    }

    /// What is waited with is told at once: nothing more will come.
    pub fn flush(&mut self) {
        let mut lost = std::mem::take(&mut self.lost);
        lost.sort_unstable();
        for entry in wording::lost(self.lost_at, &lost, &self.plan) {
            self.push(entry);
        }
    }

    // ---- commands ----

    /// All error counters and change counters of the list begin at 0 again. Nothing is written to
    /// the SubDevices: other tools go on as they were, and no count is lost.
    pub fn clear(&mut self) {
        self.network_status.clear();
    }

    // ---- what goes out ----

    /// The next entry of the log.
    pub fn poll_entry(&mut self) -> Option<LogEntry> {
        self.entries.pop_front()
    }

    /// When [`handle_timeout`](Self::handle_timeout) has something to do.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Instant> {
        (!self.lost.is_empty()).then(|| self.lost_at + LOST_TOGETHER)
    }

    fn push(&mut self, entry: LogEntry) {
        if self.entries.len() >= WAITING_ENTRIES {
            self.entries.pop_front();
            self.dropped += 1;
        }
        self.entries.push_back(entry);
    }
}

#[cfg(test)]
mod tests;
