//! One controller: who it is, where it stands, what it said.

use std::collections::VecDeque;

use linesman_config::identity::RevisionRule;
use linesman_proto::address::{DeviceId, Position, StationAddress, StationAlias};
use linesman_proto::port::Port;
use linesman_proto::register::{AlStatus, DlStatus};
use linesman_proto::sii::Identity;
use linesman_proto::state::{AlState, AlStatusCode, StateValue};
use linesman_proto::time::Instant;

use super::{CounterHistory, Seen};

/// How many changes of one kind are kept; older ones are forgotten and counted.
pub const CHANGES_KEPT: usize = 64;

/// A controller.
#[derive(Clone, Debug)]
pub struct Device {
    /// Its identity within the run.
    pub id: DeviceId,
    /// Its name in the project.
    pub name: Option<String>,
    /// Its type: from the project, or from its SII.
    pub type_name: Option<String>,
    /// What was planned for it.
    pub planned: Option<Planned>,
    /// What it says of itself.
    pub identity: SeenIdentity,
    /// Its station address now.
    pub station: Option<StationAddress>,
    /// Its alias.
    pub alias: Option<StationAlias>,
    /// Its position now; `None` when it is known to be unreachable, or never was seen.
    pub position: Option<Position>,
    /// When it last answered anything.
    pub answered: Option<Seen<()>>,
    /// When it did not answer for the first time since it last answered; `None` while it answers.
    pub silent: Option<Seen<()>>,
    /// Its state.
    pub al: AlHistory,
    /// Its ports.
    pub dl: DlHistory,
    /// Its error counters.
    pub counters: CounterHistory,
}

/// What the project says of a controller.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Planned {
    /// Who it must be; `None` when the project does not say.
    pub identity: Option<Identity>,
    /// How the revision is compared.
    pub rule: RevisionRule,
    /// The station address it is to have.
    pub station: StationAddress,
}

/// What was read of a controller's identity, part by part.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct SeenIdentity {
    /// Vendor: SII word 0x08, or CoE 0x1018:01.
    pub vendor_id: Option<Seen<u32>>,
    /// Product code: SII word 0x0A, or CoE 0x1018:02.
    pub product_code: Option<Seen<u32>>,
    /// Revision: SII word 0x0C, or CoE 0x1018:03.
    pub revision: Option<Seen<u32>>,
    /// Serial number: SII word 0x0E, or CoE 0x1018:04.
    pub serial: Option<Seen<u32>>,
}

/// States over time.
#[derive(Clone, Default, Debug)]
pub struct AlHistory {
    /// AL status (0x0130) as last read.
    pub status: Option<Seen<AlStatus>>,
    /// AL status code (0x0134) as last read.
    pub code: Option<Seen<AlStatusCode>>,
    /// The state last asked for (0x0120).
    pub requested: Option<Seen<StateValue>>,
    /// The highest state it was ever seen in.
    pub highest: Option<AlState>,
    /// Changes of status, oldest first, at most [`CHANGES_KEPT`].
    pub changes: VecDeque<AlChange>,
    /// All changes, also those forgotten.
    pub change_count: u64,
}

/// A change of AL status.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct AlChange {
    /// As it was.
    pub from: AlStatus,
    /// As it is then.
    pub to: AlStatus,
    /// When, by which frame.
    pub at: Instant,
    /// The number of the frame that showed it.
    pub frame: Option<u64>,
}

/// DL status over time.
#[derive(Clone, Default, Debug)]
pub struct DlHistory {
    /// DL status (0x0110) as first read.
    pub first: Option<Seen<DlStatus>>,
    /// As last read.
    pub last: Option<Seen<DlStatus>>,
    /// Changes, oldest first, at most [`CHANGES_KEPT`].
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

impl Device {
    /// A controller of which nothing is known.
    #[must_use]
    pub fn new(id: DeviceId) -> Self {
        Self {
            id,
            name: None,
            type_name: None,
            planned: None,
            identity: SeenIdentity::default(),
            station: None,
            alias: None,
            position: None,
            answered: None,
            silent: None,
            al: AlHistory::default(),
            dl: DlHistory::default(),
            counters: CounterHistory::default(),
        }
    }

    /// The name of the project, else the type.
    #[must_use]
    pub fn best_name(&self) -> Option<&str> {
        self.name.as_deref().or(self.type_name.as_deref())
    }

    /// Notes that it answered.
    pub fn answers(&mut self, at: Instant, frame: Option<u64>) {
        self.answered = Some(Seen::new((), at, frame));
        self.silent = None;
    }

    /// Notes that it did not answer though it was asked.
    pub fn is_silent(&mut self, at: Instant, frame: Option<u64>) {
        self.silent.get_or_insert(Seen::new((), at, frame));
    }
}

impl SeenIdentity {
    /// The identity, once vendor, product code and revision are known. A serial number that was not
    /// read counts as 0.
    #[must_use]
    pub fn identity(&self) -> Option<Identity> {
        Some(Identity {
            vendor_id: self.vendor_id?.value,
            product_code: self.product_code?.value,
            revision: self.revision?.value,
            serial_number: self.serial.map_or(0, |serial| serial.value),
        })
    }
}

impl AlHistory {
    /// Takes a reading of AL status. Says whether it is news.
    pub fn record_status(&mut self, status: AlStatus, at: Instant, frame: Option<u64>) -> bool {
        let before = self.status.replace(Seen::new(status, at, frame));
        self.highest = self.highest.max(status.state().state());
        let Some(before) = before else { return true };
        if before.value == status {
            // The first sighting is the evidence, not the thousandth.
            self.status = Some(before);
            return false;
        }
        self.change_count += 1;
        push(&mut self.changes, AlChange { from: before.value, to: status, at, frame });
        true
    }

    /// Takes a reading of AL status code. Says whether it is news.
    pub fn record_code(&mut self, code: AlStatusCode, at: Instant, frame: Option<u64>) -> bool {
        if self.code.is_some_and(|known| known.value == code) {
            return false;
        }
        self.code = Some(Seen::new(code, at, frame));
        true
    }

    /// The state, where one was read and it names one.
    #[must_use]
    pub fn state(&self) -> Option<AlState> {
        self.status?.value.state().state()
    }
}

impl DlHistory {
    /// Takes a reading of DL status. Says whether it is news.
    pub fn record(&mut self, status: DlStatus, at: Instant, frame: Option<u64>) -> bool {
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
        push(&mut self.changes, DlChange { from: last.value, to: status, at, frame });
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

fn push<T>(changes: &mut VecDeque<T>, change: T) {
    if changes.len() == CHANGES_KEPT {
        changes.pop_front();
    }
    changes.push_back(change);
}
