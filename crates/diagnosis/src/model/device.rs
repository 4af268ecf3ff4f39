//! One controller: identity, position, states and counters.

use std::collections::{BTreeMap, VecDeque};

use linesman_config::identity::RevisionRule;
use linesman_config::inventory::label;
use linesman_proto::address::{DeviceId, Position, StationAddress, StationAlias};
use linesman_proto::mailbox::coe::Emergency;
use linesman_proto::port::PortMap;
use linesman_proto::register::{
    ControllerType, DlControl, EscInformation, FmmuConfig, WatchdogDivider, WatchdogTime,
};
use linesman_proto::sii::Identity;
use linesman_proto::state::AlStatusCode;
use linesman_proto::state::status_code::Class as CodeClass;
use linesman_proto::time::{DcTime32, Instant, Span};
use linesman_proto::topology::SeenController;

use super::mailbox::MailboxHistory;
use super::{
    AlChange, AlError, AlHistory, ClockHistory, CounterHistory, Counting, DlHistory, ErrorSum,
    Power, ReportedTrouble, Seen, SetUp, SiiImage, UpTime, push_kept,
};

/// A state that was lost is read so long after what it was lost by, at most.
const READ_WITHIN: Span = Span::s(2);

/// A controller.
#[derive(Clone, Debug)]
pub struct Device {
    /// Its identity within the run.
    pub id: DeviceId,
    /// Its name in the project.
    pub name: Option<String>,
    /// Its type: from the project, from its SII, or from CoE 0x1008.
    pub type_name: Option<String>,
    /// What was planned for it.
    pub planned: Option<Planned>,
    /// What it says of itself.
    pub identity: SeenIdentity,
    /// The type of its EtherCAT chip: registers 0x0000 and 0x0001.
    pub chip: Option<Seen<Chip>>,
    /// When another tool reported that it is not the planned one, without saying what it is instead.
    pub reported_wrong: Option<Seen<()>>,
    /// Its station address now.
    pub station: Option<StationAddress>,
    /// When it last answered while process data lacked shares.
    pub heard_short: Option<Instant>,
    /// When it was read at its position without the station address that it had been given: it has started anew.
    pub lost_address: Option<Seen<()>>,
    /// Its alias.
    pub alias: Option<StationAlias>,
    /// Its position now; `None` when it is known to be unreachable, or never was seen.
    pub position: Option<Position>,
    /// DL control (0x0100) as it was last read.
    pub dl_control: Option<DlControl>,
    /// When another controller answered to its station address, too.
    pub shared_address: Option<SharedAddress>,
    /// When it last answered anything.
    pub answered: Option<Seen<()>>,
    /// When it did not answer for the first time since it last answered; `None` while it answers.
    pub silent: Option<Seen<()>>,
    /// When it last did not answer.
    pub last_unanswered: Option<Instant>,
    /// When it did not answer, oldest first, at most [`CHANGES_KEPT`](super::CHANGES_KEPT).
    pub absences: VecDeque<Absence>,
    /// Its state.
    pub al: AlHistory,
    /// Its ports.
    pub dl: DlHistory,
    /// Its error counters.
    pub counters: CounterHistory,
    /// How it counts them, where its controller is known.
    pub counting: Option<Counting>,
    /// Errors of all its ports together, where a tool says no more.
    pub error_sum: Option<ErrorSum>,
    /// Trouble that another tool reports, in order of time.
    pub reported_trouble: Vec<Seen<ReportedTrouble>>,
    /// How long a frame is on its way from the reference clock to it: register 0x0928.
    pub delay: Option<Span>,
    /// Emergencies it sent, oldest first, at most [`CHANGES_KEPT`](super::CHANGES_KEPT).
    pub emergencies: VecDeque<Seen<Emergency>>,
    /// What its mailbox tells of trouble.
    pub mailbox: MailboxHistory,
    /// Its process data watchdog, as last read or written.
    pub watchdog: Watchdog,
    /// When a frame was received at each port, by its own clock: registers 0x0900 to 0x090F as last
    /// read. Those of closed ports mean nothing; `None` for one that the frame did not meet.
    pub received: Option<PortMap<Option<DcTime32>>>,
    /// Time since it came up, as last read.
    pub up_time: Option<UpTime>,
    /// Whether its SYNC signals are switched on: register 0x0981 as last written.
    pub sync_on: Option<Seen<bool>>,
    /// How far its clock is off the reference clock.
    pub clock: ClockHistory,
    /// What it counts of its cycles in 0x1C32 and 0x1C33, by index and subindex, as read.
    pub sync_counts: BTreeMap<(u16, u8), Seen<u16>>,
    /// Its FMMUs, as they were set up.
    pub fmmus: BTreeMap<u8, FmmuConfig>,
    /// Its SyncManagers and its clock, as they were set up.
    pub set_up: SetUp,
    /// What was seen of its SII.
    pub sii: SiiImage,
    /// What that says of the E-bus.
    pub power: Option<Seen<Power>>,
}

/// The type of an EtherCAT chip.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Chip {
    /// Register 0x0000.
    pub kind: ControllerType,
    /// Register 0x0001; 0 when it was not read.
    pub revision: u8,
}

impl Chip {
    /// The name of the chip.
    #[must_use]
    pub fn name(self) -> &'static str {
        let (controller, revision) = (self.kind, self.revision);
        EscInformation { controller, revision, ..EscInformation::default() }.controller_name()
    }
}

/// The process data watchdog of a controller: registers 0x0400 and 0x0420; what was not seen is as after
/// a reset.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct Watchdog {
    /// Length of a tick.
    pub divider: WatchdogDivider,
    /// Ticks until it expires.
    pub time: WatchdogTime,
    /// How it is set, once that was read or written.
    pub setting: Option<WatchdogSetting>,
    /// How it was set before that.
    pub former: Option<WatchdogSetting>,
}

/// How a watchdog is set.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct WatchdogSetting {
    /// How long it holds; `None` when it is switched off.
    pub span: Option<Span>,
    /// When that was first seen.
    pub seen: Seen<()>,
}

impl Watchdog {
    /// How long it holds without outputs; `None` when it is switched off.
    #[must_use]
    pub fn span(&self) -> Option<Span> {
        self.time.span(self.divider)
    }

    /// Its registers were read or written. Says whether it is set otherwise than before.
    pub fn record(
        &mut self,
        divider: Option<WatchdogDivider>,
        time: Option<WatchdogTime>,
        seen: Seen<()>,
    ) -> bool {
        self.divider = divider.unwrap_or(self.divider);
        self.time = time.unwrap_or(self.time);
        let span = self.span();
        if self.setting.is_some_and(|setting| setting.span == span) {
            return false;
        }
        self.former = self.setting.replace(WatchdogSetting { span, seen });
        true
    }
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
    /// Whether the project gives that address; else it follows from its position, and MainDevices count from numbers of
    /// their own.
    pub station_is_given: bool,
    /// Its station alias, where the project gives one.
    pub alias: Option<u16>,
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

/// A station address to which two controllers answer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SharedAddress {
    /// The address.
    pub station: StationAddress,
    /// What showed it first.
    pub first: Seen<SharedBy>,
    /// When it was last shown.
    pub last: Instant,
    /// How often.
    pub times: u64,
}

/// What shows that a station address is shared.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SharedBy {
    /// More answered than one controller can: the working counter.
    WorkingCounter(u16),
    /// Another controller, asked by its position, says that it has the address.
    Reading(DeviceId),
}

/// A stretch of time in which a controller did not answer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Absence {
    /// The first datagram that it did not answer.
    pub since: Seen<()>,
    /// When it answered again.
    pub ended: Option<Instant>,
}

impl Absence {
    /// Whether what was noticed at `at` may come from it: it is noticed a little late, and for some time after it the
    /// controller is still brought back.
    #[must_use]
    pub fn disturbs(&self, at: Instant) -> bool {
        let is_over = self.ended.is_some_and(|ended| ended + Self::REPAIR < at);
        self.since.at.before(Self::NOTICED_WITHIN) <= at && !is_over
    }

    /// Who comes back has its station address again after so long at most.
    const ADDRESSED_WITHIN: Span = Span::ms(500);
    const NOTICED_WITHIN: Span = Span::ms(200);
    const REPAIR: Span = Span::ms(1500);
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
            chip: None,
            reported_wrong: None,
            station: None,
            heard_short: None,
            lost_address: None,
            alias: None,
            position: None,
            dl_control: None,
            shared_address: None,
            answered: None,
            silent: None,
            last_unanswered: None,
            absences: VecDeque::new(),
            al: AlHistory::default(),
            dl: DlHistory::default(),
            counters: CounterHistory::default(),
            counting: None,
            error_sum: None,
            reported_trouble: Vec::new(),
            delay: None,
            emergencies: VecDeque::new(),
            mailbox: MailboxHistory::default(),
            watchdog: Watchdog::default(),
            received: None,
            up_time: None,
            sync_on: None,
            clock: ClockHistory::default(),
            sync_counts: BTreeMap::new(),
            fmmus: BTreeMap::new(),
            set_up: SetUp::default(),
            sii: SiiImage::default(),
            power: None,
        }
    }

    /// Its ports as they were first seen, for the tree.
    #[must_use]
    pub fn as_first_seen(&self) -> SeenController {
        let first = self.dl.first.map(|first| first.value).unwrap_or_default();
        SeenController {
            open: PortMap::from_fn(|port| first.port_state(port).is_active()),
            received: self.received.unwrap_or_default(),
        }
    }

    /// What people call it, by the name of the project and its type as far as they are known.
    #[must_use]
    pub fn label(&self) -> String {
        let (name, type_name) = (self.name.as_deref(), self.type_name.as_deref());
        label(self.id, name.unwrap_or_default(), type_name.unwrap_or_default())
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

    /// Whether it started anew at least once, as far as its states and its station address tell.
    #[must_use]
    pub fn has_restarted(&self) -> bool {
        self.lost_address.is_some() || self.al.changes.iter().any(super::AlChange::is_own_fall)
    }

    /// When it did not answer, oldest first; those that follow at once upon each other as one. Who comes back answers to
    /// its position first, and to its address when it has it again.
    #[must_use]
    pub fn joined_absences(&self) -> Vec<Absence> {
        let mut joined: Vec<Absence> = Vec::new();
        for absence in &self.absences {
            match joined.last_mut() {
                Some(last)
                    if last.ended.is_some_and(|ended| {
                        absence.since.at.since(ended) <= Absence::ADDRESSED_WITHIN
                    }) =>
                {
                    last.ended = absence.ended;
                }
                Some(_) | None => joined.push(*absence),
            }
        }
        joined
    }

    /// Notes that it did not answer though it was asked.
    pub fn is_silent(&mut self, at: Instant, frame: Option<u64>) {
        self.last_unanswered = self.last_unanswered.max(Some(at));
        if self.silent.is_none() {
            let since = Seen::new((), at, frame);
            self.silent = Some(since);
            push_kept(&mut self.absences, Absence { since, ended: None });
        }
    }

    /// Notes that another controller answers to its station address, too.
    pub fn shares_address(&mut self, station: StationAddress, seen: Seen<SharedBy>) {
        let known = self.shared_address.filter(|known| known.station == station);
        let mut shared =
            known.unwrap_or(SharedAddress { station, first: seen, last: seen.at, times: 0 });
        // Who it is, is worth more than that there is one.
        if matches!(seen.value, SharedBy::Reading(_)) {
            shared.first.value = seen.value;
        }
        shared.last = seen.at;
        shared.times += 1;
        self.shared_address = Some(shared);
    }

    /// Notes an emergency.
    pub fn record_emergency(&mut self, emergency: Seen<Emergency>) {
        push_kept(&mut self.emergencies, emergency);
    }

    /// Whether it signalled, within a stretch of time or soon after it, that it has lost its step with the SYNC signal
    /// or the frames: an AL status code of the class timing, or an error whose code nobody has read. Who was away just
    /// then has lost it by that. Outputs stayed away for `longest` at most, where that is known: a watchdog that holds
    /// for longer expired by something else.
    #[must_use]
    pub fn lost_step_within(&self, from: Instant, to: Instant, longest: Option<Span>) -> bool {
        let may_starve = |span| longest.is_none_or(|longest| span <= longest);
        let is_starved = self.watchdog.span().is_some_and(may_starve);
        self.al.errors.iter().any(|error| {
            let is_timing = error.code.is_none_or(|code| {
                let is_watchdog = code.value == AlStatusCode::SYNC_MANAGER_WATCHDOG;
                code.value.explain().class == CodeClass::Timing && (is_starved || !is_watchdog)
            });
            let at = error.status.at;
            let was_away = self.absences.iter().any(|one| one.disturbs(at));
            is_timing && !error.may_be_echo() && !was_away && at >= from && at <= to + READ_WITHIN
        })
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
        let mut errors = self.al.errors.iter().filter(|error| !error.may_be_echo());
        if let Some(error) = errors.find(|error| overlaps(error.status.at, error.ended)) {
            return Some(Trouble::Error(*error));
        }
        let mut falls = self.al.changes.iter().filter(|change| change.is_own_fall());
        let fall = falls.find(|change| change.at >= from && change.at <= to);
        fall.map(|change| Trouble::Fall(*change))
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
