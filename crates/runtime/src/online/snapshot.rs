//! Snapshot of what only the thread that drives a line knows, taken quickly: nothing is worded
//! there.

use linesman_config::plan::Plan;
use linesman_maindevice::mailbox::ProtocolError;
use linesman_maindevice::{FrameStatus, MainDevice, Quality, Statistics};
use linesman_proto::address::{DeviceId, WorkingCounter};
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};

/// What is counted over.
const SECOND: Span = Span::s(1);

/// Frames a second, of the last second that has passed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rates {
    since: Option<(Instant, Statistics)>,
    /// Cyclic and queued frames a second.
    last: Option<[f64; 2]>,
}

impl Rates {
    /// Time has passed; `statistics` is asked when it is time.
    #[inline]
    pub fn turn(&mut self, now: Instant, statistics: impl FnOnce() -> Statistics) {
        match self.since {
            Some((since, _)) if now < since + SECOND => {}
            Some((since, before)) => {
                let counts = statistics();
                let seconds = now.since(since).as_nanos() as f64 / 1e9;
                let rate = |now: u64, before: u64| (now - before) as f64 / seconds;
                self.last = Some([
                    rate(counts.cyclic_sent, before.cyclic_sent),
                    rate(counts.queued_sent(), before.queued_sent()),
                ]);
                self.since = Some((now, counts));
            }
            None => self.since = Some((now, statistics())),
        }
    }

    /// Cyclic and queued frames a second; `None` before a second has passed.
    #[must_use]
    pub const fn last(&self) -> Option<[f64; 2]> {
        self.last
    }
}

/// What the thread that drives a line knows at a moment.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// The moment.
    pub now: Instant,
    /// Counts since the start.
    pub statistics: Statistics,
    /// Cyclic and queued frames a second.
    pub rates: Option<[f64; 2]>,
    /// The process data of each SubDevice.
    pub qualities: Vec<Quality>,
    /// The state in which each SubDevice shall be.
    pub wanted: Vec<AlState>,
    /// The cyclic frames, task by task.
    pub frames: Vec<FrameStatus>,
    /// How many answered the last cyclic broadcast read.
    pub responding: Option<WorkingCounter>,
    /// The same by the card that received it, card A first; of a ring only.
    pub responding_by_card: Option<[WorkingCounter; 2]>,
    /// True if the network leads the others of the process.
    pub leads_group: bool,
    /// Lead over the network that leads, in ns.
    pub ahead_of_group: Option<i64>,
    /// Mailboxes in which something went wrong: whose, how often, and what stands.
    pub mailboxes: Vec<(DeviceId, u64, Vec<ProtocolError>)>,
}

impl Snapshot {
    /// The moment `now`.
    #[must_use]
    pub fn of(main: &MainDevice, now: Instant, rates: &Rates) -> Self {
        let mut snapshot = Self {
            now,
            statistics: main.statistics(),
            rates: rates.last(),
            qualities: Vec::new(),
            wanted: main.wanted_states(),
            frames: Vec::new(),
            responding: main.responding(),
            responding_by_card: main.responding_by_card(),
            leads_group: main.leads_group(),
            ahead_of_group: main.ahead_of_group(),
            mailboxes: Vec::new(),
        };
        if let Some(plan) = main.plan() {
            snapshot.take(plan, main);
        }
        snapshot
    }

    fn take(&mut self, plan: &Plan, main: &MainDevice) {
        self.qualities.extend(plan.devices.iter().map(|device| main.quality(device.id)));
        for (at, task) in plan.tasks.iter().enumerate() {
            let frames = 0..task.frames.len();
            self.frames.extend(frames.map(|one| main.frame_status(at, one).unwrap_or_default()));
        }
        self.mailboxes = main.mailbox_troubles();
    }
}
