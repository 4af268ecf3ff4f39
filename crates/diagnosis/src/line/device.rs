//! One controller: who it is, where it stands, what it said.

use std::collections::{BTreeMap, VecDeque};

use linesman_config::identity::RevisionRule;
use linesman_proto::address::{DeviceId, Position, StationAddress, StationAlias};
use linesman_proto::mailbox::coe::Emergency;
use linesman_proto::port::{Port, PortMap};
use linesman_proto::register::{AlControl, AlStatus, DlStatus, FmmuConfig};
use linesman_proto::sii::Identity;
use linesman_proto::state::{AlState, AlStatusCode, StateValue};
use linesman_proto::time::{DcTime32, Instant};
use linesman_proto::topology::SeenController;

use super::{CounterHistory, Seen, SiiImage};

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
    /// When it did not answer, oldest first, at most [`CHANGES_KEPT`].
    pub absences: VecDeque<Absence>,
    /// Its state.
    pub al: AlHistory,
    /// Its ports.
    pub dl: DlHistory,
    /// Its error counters.
    pub counters: CounterHistory,
    /// Emergencies it sent, oldest first, at most [`CHANGES_KEPT`].
    pub emergencies: VecDeque<Seen<Emergency>>,
    /// When a frame was received at each port, by its own clock: registers 0x0900 to 0x090F as last
    /// read. Those of closed ports mean nothing.
    pub received: Option<PortMap<DcTime32>>,
    /// Its FMMUs, as they were set up.
    pub fmmus: BTreeMap<u8, FmmuConfig>,
    /// What was seen of its SII.
    pub sii: SiiImage,
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
    /// Errors it signalled, oldest first, at most [`CHANGES_KEPT`].
    pub errors: VecDeque<AlError>,
    /// Whether it was in the state last asked for, without error, since it was asked.
    pub has_arrived: bool,
}

/// An error that a controller signalled in AL status.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct AlError {
    /// AL status with the error bit, when it was first read.
    pub status: Seen<AlStatus>,
    /// The code, as far as it was read while the error stood.
    pub code: Option<Seen<AlStatusCode>>,
    /// The state before; `None` when none was read.
    pub from: Option<AlState>,
    /// The state asked for at that time.
    pub requested: Option<Seen<StateValue>>,
    /// Whether it had been in the state asked for: then it left it by itself, else it refused.
    pub had_arrived: bool,
    /// When the error was gone.
    pub ended: Option<Instant>,
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
    /// The state asked for at that time, where a request was seen.
    pub requested: Option<AlState>,
}

/// A stretch of time in which a controller did not answer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Absence {
    /// The first datagram that it did not answer.
    pub since: Seen<()>,
    /// When it answered again.
    pub ended: Option<Instant>,
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
            absences: VecDeque::new(),
            al: AlHistory::default(),
            dl: DlHistory::default(),
            counters: CounterHistory::default(),
            emergencies: VecDeque::new(),
            received: None,
            fmmus: BTreeMap::new(),
            sii: SiiImage::default(),
        }
    }

    /// Its ports as they were first seen, for the tree.
    #[must_use]
    pub fn as_first_seen(&self) -> SeenController {
        let first = self.dl.first.map(|first| first.value).unwrap_or_default();
        SeenController {
            open: PortMap::from_fn(|port| first.port_state(port).is_active()),
            received: PortMap::from_fn(|port| self.received.map(|times| times[port])),
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
        if self.silent.take().is_some()
            && let Some(absence) = self.absences.back_mut()
        {
            absence.ended = Some(at);
        }
    }

    /// Notes that it did not answer though it was asked.
    pub fn is_silent(&mut self, at: Instant, frame: Option<u64>) {
        if self.silent.is_none() {
            let since = Seen::new((), at, frame);
            self.silent = Some(since);
            push(&mut self.absences, Absence { since, ended: None });
        }
    }

    /// Notes an emergency.
    pub fn record_emergency(&mut self, emergency: Seen<Emergency>) {
        push(&mut self.emergencies, emergency);
    }

    /// When it first was in trouble of its own, or did not answer, within a stretch of time.
    #[must_use]
    pub fn trouble_within(&self, from: Instant, to: Instant) -> Option<Trouble> {
        let overlaps = |since: Instant, ended: Option<Instant>| {
            since <= to && ended.is_none_or(|ended| ended >= from)
        };
        let mut absences = self.absences.iter();
        if let Some(absence) = absences.find(|absence| overlaps(absence.since.at, absence.ended)) {
            return Some(Trouble::Absent(*absence));
        }
        let mut errors = self.al.errors.iter();
        if let Some(error) = errors.find(|error| overlaps(error.status.at, error.ended)) {
            return Some(Trouble::Error(*error));
        }
        let mut falls = self.al.changes.iter().filter(|change| change.is_own_fall());
        let fall = falls.find(|change| change.at >= from && change.at <= to);
        fall.map(|change| Trouble::Fall(*change))
    }
}

/// What keeps a controller from doing its share.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Trouble {
    /// It does not answer.
    Absent(Absence),
    /// It signals an error.
    Error(AlError),
    /// It left its state by itself, without an error.
    Fall(AlChange),
}

impl AlChange {
    /// Whether it went to a lower state though nobody asked for one, and without an error.
    #[must_use]
    pub fn is_own_fall(&self) -> bool {
        let (from, to) = (self.from.state().state(), self.to.state().state());
        let (Some(from), Some(to)) = (from, to) else { return false };
        let was_asked = self.requested.is_none_or(|requested| requested < from);
        to < from && !was_asked && !self.to.error()
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
        self.record_error(status, at, frame);
        let before = self.status.replace(Seen::new(status, at, frame));
        self.highest = self.highest.max(status.state().state());
        let Some(before) = before else { return true };
        if before.value == status {
            // The first sighting is the evidence, not the thousandth.
            self.status = Some(before);
            return false;
        }
        self.change_count += 1;
        let requested = self.requested.and_then(|requested| requested.value.state());
        push(&mut self.changes, AlChange { from: before.value, to: status, at, frame, requested });
        true
    }

    /// Whether the error bit is but an echo: a controller without a processor behind it copies AL
    /// control to AL status, with the bit that acknowledges errors. An error of its own would keep
    /// a SubDevice from the state asked for.
    fn is_echo(&self, status: AlStatus) -> bool {
        match self.requested {
            Some(requested) => requested.value == status.state(),
            // Nobody was seen asking: a MainDevice that starts does so with INIT and acknowledge.
            None => status.state().state() == Some(AlState::Init),
        }
    }

    fn record_error(&mut self, status: AlStatus, at: Instant, frame: Option<u64>) {
        let is_error = status.error() && !self.is_echo(status);
        let open = self.errors.back_mut().filter(|error| error.ended.is_none());
        if !is_error {
            if let Some(error) = open {
                error.ended = Some(at);
            }
            let requested = self.requested.map(|requested| requested.value);
            self.has_arrived |= requested == Some(status.state());
            return;
        }
        if open.is_some() {
            return;
        }
        push(
            &mut self.errors,
            AlError {
                status: Seen::new(status, at, frame),
                code: None,
                from: self.status.and_then(|status| status.value.state().state()),
                requested: self.requested,
                had_arrived: self.has_arrived,
                ended: None,
            },
        );
        // The code is read after the status; what was read earlier is about something else.
        self.code = None;
    }

    /// Takes a write to AL control.
    pub fn record_request(&mut self, control: AlControl, requested: Seen<StateValue>) {
        if control.acknowledges_error()
            && let Some(error) = self.errors.back_mut()
        {
            error.ended.get_or_insert(requested.at);
        }
        let is_new = self.requested.is_none_or(|known| known.value != requested.value);
        if is_new {
            self.has_arrived = false;
        }
        self.requested = Some(requested);
    }

    /// Whether the MainDevice asked for a state without process data.
    #[must_use]
    pub fn is_asked_down(&self) -> bool {
        let requested = self.requested.and_then(|requested| requested.value.state());
        requested.is_some_and(|state| !state.has_inputs())
    }

    /// Whether it signals an error now.
    #[must_use]
    pub fn has_error(&self) -> bool {
        self.errors.back().is_some_and(|error| error.ended.is_none())
    }

    /// Takes a reading of AL status code. Says whether it is news.
    pub fn record_code(&mut self, code: AlStatusCode, at: Instant, frame: Option<u64>) -> bool {
        if self.code.is_some_and(|known| known.value == code) {
            return false;
        }
        let seen = Seen::new(code, at, frame);
        self.code = Some(seen);
        if code.0 != 0
            && let Some(error) = self.errors.back_mut()
            && error.ended.is_none()
        {
            error.code.get_or_insert(seen);
        }
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
