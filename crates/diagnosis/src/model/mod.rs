//! Model of one network: what is known of it, and its registers over time.
//!
//! Frames teach it, or an observation file fills it in directly; rules only look at it. Everything
//! keeps when and by which frame it was learnt, so that a finding can point there.

pub mod al_history;
pub mod clock;
pub mod counters;
pub mod cycle_timing;
pub mod cyclic;
pub mod device;
pub mod dl_history;
pub mod ethernet;
pub mod event_field;
mod expected_wkc;
pub mod host;
pub mod input_activity;
pub mod learn;
pub mod mailbox;
pub mod path_delay;
pub mod probe_record;
pub mod reported;
pub mod round_trip;
pub mod search;
pub mod set_up;
pub mod sii_image;
pub mod spell;
pub mod stillness;
pub mod terminal_bus;
pub mod traffic;
pub mod up_time;
pub mod working_counter;

use std::collections::{BTreeMap, VecDeque};

use linesman_config::inventory::label;
use linesman_config::plan::PlannedExchange;
use linesman_config::project::Project;
use linesman_proto::address::{DeviceId, LogicalAddress, Network, Path, Position, StationAddress};
use linesman_proto::port::Port;
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::{End, Link, Reconstruction, Tree};

use crate::main_device::{Habits, MainDeviceKind};

pub use al_history::{AlChange, AlError, AlHistory, StateRequest};
pub use clock::{ClockHistory, Reference};
pub use counters::{CounterHistory, CounterTrack, Rise};
pub use cycle_timing::{CycleDeviation, CycleTiming, Pause};
pub use cyclic::{Cyclic, Owner};
pub use device::{Absence, Chip, Device, Planned, SeenIdentity, SharedAddress, SharedBy, Trouble};
pub use dl_history::{DlChange, DlHistory};
pub use event_field::{EventField, EventTrack};
pub use host::{CardHistory, HostHistory, Tally};
use learn::AwaitedBit;
pub use learn::Learner;
pub use path_delay::{PathDelayStep, PathDelays};
pub use probe_record::ProbeRecord;
pub use reported::{Counting, ErrorSum, Reported, ReportedTrouble};
pub use round_trip::RoundTripTimes;
pub use search::LoopWrite;
pub use set_up::{ClockSetUp, SetUp};
pub use sii_image::{Power, SiiImage};
pub use spell::Spell;
pub use stillness::Stillness;
pub use terminal_bus::is_on_terminal_bus;
pub use traffic::{Silence, Traffic};
pub use up_time::UpTime;
pub use working_counter::{Deficit, Ordered, WorkingCounterHistory};

/// How many changes of one kind are kept of a controller; older ones are forgotten.
pub const CHANGES_KEPT: usize = 64;

/// Something that was learnt, with when and from which frame.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Seen<T> {
    /// What.
    pub value: T,
    /// When.
    pub at: Instant,
    /// The number of the frame that showed it; `None` when it came by another way, such as an
    /// observation file.
    pub frame: Option<u64>,
}

impl<T> Seen<T> {
    /// Learnt at `at` from the frame `frame`.
    pub const fn new(value: T, at: Instant, frame: Option<u64>) -> Self {
        Self { value, at, frame }
    }
}

/// A search for the place where frames vanish, by closing ports for a moment.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct HoleSearch {
    /// The first request that did not come back.
    pub since: Seen<()>,
    /// The link (index in [`NetworkModel::tree`]) behind whose near port frames vanish.
    pub found: Option<Seen<usize>>,
    /// Whether a port that was closed has brought frames back, and they vanished again when it was open.
    pub has_helped: bool,
    /// When it was over, found or not.
    pub ended: Option<Instant>,
}

/// After DL control was written, ports are in motion for so long: until it is written back.
const ORDER_LASTS: Span = Span::ms(200);
/// Frames that were sent so shortly before are on their way then.
const ORDER_IN_FLIGHT: Span = Span::ms(2);

/// Errors that come after so long a time without any are a new spell.
pub const SPELL_GAP: Span = Span::s(2);
/// Errors after so long a time are a new spell even where some counters were not read in between.
pub const SPELL_GAP_MOST: Span = Span::s(10);

/// A network as far as it is known.
#[derive(Clone, Debug, Default)]
pub struct NetworkModel {
    /// Which network.
    pub network: Network,
    /// Its controllers; the index is the identity.
    pub devices: Vec<Device>,
    /// How they are wired when all is well: planned, or as first seen whole. Node *n* is device *n*.
    pub tree: Option<Tree>,
    /// Whether the tree comes from a project or an observation file, not from what was seen.
    pub tree_is_planned: bool,
    /// Controllers of hot connect groups that may be absent, each with the first one of its group.
    pub optional: BTreeMap<DeviceId, DeviceId>,
    /// Whether this program drives the line, so that no order to a SubDevice goes unseen.
    pub sees_all_orders: bool,
    /// Process data that were planned: working counters that are expected from the start.
    pub planned_exchange: PlannedExchange,
    /// Habits of the MainDevice by which it is recognised.
    pub habits: Habits,
    /// What the host noticed.
    pub host: HostHistory,
    /// Logical datagrams that are sent again and again.
    pub cyclic: Vec<Cyclic>,
    /// Reference clocks, whose time the frames hand round: one, unless the MainDevice took another.
    pub references: Vec<Reference>,
    /// How long frames are on their way.
    pub round_trips: RoundTripTimes,
    /// Events that controllers report in frames that pass them.
    pub events: EventField,
    /// Frames and datagrams.
    pub traffic: Traffic,
    /// Station addresses that were asked without any answer, and that no SubDevice was seen to have: in the order of
    /// the first request, some dozens at most.
    pub asked_in_vain: Vec<StationAddress>,
    /// Bits of process data that will tell of answers in mailboxes: of requests that wait.
    awaited_bits: Vec<AwaitedBit>,
    /// Record of a capture probe on links.
    pub capture_probe: ProbeRecord,
    /// What another program says of the line.
    pub reported: Reported,
    /// The time of the latest frame or observation.
    pub now: Instant,
    /// When the present spell of errors began: at the earliest time that its first reading allows.
    pub spell_began: Instant,
    last_errors: Option<Instant>,
    /// The search for the place where frames vanish, going on or done.
    pub hole: Option<HoleSearch>,
    /// The links that the latest search has left over: what it looked for was at one of them.
    pub hole_left: Vec<usize>,
    /// When DL control was last written to stay, as a MainDevice does to measure delays on an opened ring: frames that
    /// were on their way then are lost by order.
    pub loops_ordered: Option<Instant>,
    /// The first of those writes that followed each other.
    loops_first_ordered: Option<Instant>,
    /// DL control as it was written for temporary use, in the order of time.
    pub loop_writes: VecDeque<LoopWrite>,
    /// True if the frame that latched receive times last went out by both cards of a ring.
    pub latched_in_ring: bool,
    revision: u64,
    /// The state in which all were, without an error, when all were last read at once, and the revision then.
    calm_state: Option<(AlState, u64)>,
    /// From how many controllers and receive times the tree was derived.
    tree_basis: (usize, usize),
}

impl NetworkModel {
    /// A network of which nothing is known.
    #[must_use]
    pub fn new(network: Network) -> Self {
        Self { network, ..Self::default() }
    }

    /// Loops of a controller were written for a moment.
    pub fn note_loops(&mut self, write: LoopWrite) {
        search::note(&mut self.loop_writes, write);
        self.touch();
    }

    /// The port of a controller that is closed by order at `at`, for temporary use.
    #[must_use]
    pub fn closed_by_order(&self, id: DeviceId, at: Instant) -> Option<Port> {
        let write = self.loop_writes.iter().rev().find(|write| write.device == id)?;
        write.closed.filter(|_| at.since(write.seen.at) < search::TOGETHER)
    }

    /// A network as it was planned: names, identities and wiring. A plan whose wiring contradicts
    /// itself gives no tree.
    #[must_use]
    pub fn planned(network: Network, project: &Project) -> Self {
        let devices = project.devices.iter().zip(project.stations()).enumerate();
        let devices = devices.map(|(index, (planned, station))| {
            let id = DeviceId(index as u32);
            let mut device = Device::new(id);
            device.name = Some(planned.name.clone());
            device.type_name = Some(planned.type_name.clone()).filter(|name| !name.is_empty());
            device.planned = Some(Planned {
                identity: planned.identity(),
                rule: planned.rule(),
                station,
                station_is_given: planned.station.is_some(),
                alias: planned.alias,
            });
            device
        });
        let devices = devices.collect();
        let tree = project.tree().ok();
        let tree_is_planned = tree.is_some();
        let optional = project.optional_devices().into_iter();
        let optional = optional.map(|(of, first)| (DeviceId(of as u32), DeviceId(first as u32)));
        let optional = optional.collect();
        Self { network, devices, tree, tree_is_planned, optional, ..Self::default() }
    }

    /// Takes the process data that were planned: who has which FMMU, and the working counter of each datagram.
    pub fn expect_exchange(&mut self, planned: &PlannedExchange) {
        for (id, no, fmmu) in &planned.fmmus {
            if let Some(device) = self.device_mut(*id) {
                device.fmmus.insert(*no, *fmmu);
            }
        }
        self.planned_exchange = planned.clone();
    }

    /// A number that grows whenever something was learnt that a rule may want to look at.
    #[must_use]
    pub const fn revision(&self) -> u64 {
        self.revision
    }

    /// Notes that something was learnt.
    pub const fn touch(&mut self) {
        self.revision += 1;
    }

    /// Errors are about to be recorded that happened after `since` and were read at `at`.
    ///
    /// After a time without any, they are a new spell: trouble of its own, whatever was counted before.
    pub fn note_errors(&mut self, since: Instant, at: Instant) {
        let is_new = |last: Instant| {
            since > last + SPELL_GAP && (since > last + SPELL_GAP_MOST || self.is_read_since(last))
        };
        if self.last_errors.is_some_and(is_new) {
            self.spell_began = since;
            for device in &mut self.devices {
                device.counters.begin_spell();
            }
            self.host.begin_spell();
            self.traffic.losses.begin_spell();
        }
        self.last_errors = self.last_errors.max(Some(at));
    }

    /// True if the counters of all who are read have been read after `last`: until then it is not known which of them
    /// had a part in the errors of that time.
    fn is_read_since(&self, last: Instant) -> bool {
        self.devices.iter().filter(|device| device.silent.is_none()).all(|device| {
            let read = device.counters.tracks().map(|(_, track)| track.last.at).max();
            read.is_none_or(|at| at > last)
        })
    }

    /// Whether a request that was sent at `at` may be lost because the MainDevice opened or closed ports.
    #[must_use]
    pub fn is_lost_by_order(&self, at: Instant) -> bool {
        // What was lost between closing and opening may be heard of when the port is open again.
        let (first, last) = (self.loops_first_ordered, self.loops_ordered);
        first.zip(last).is_some_and(|(first, last)| {
            let begin = first.max(last.before(ORDER_LASTS)).before(ORDER_IN_FLIGHT);
            begin <= at && at.since(last) < ORDER_LASTS
        })
    }

    /// Notes that somebody wrote DL control at `at`.
    pub fn note_order(&mut self, at: Instant) {
        let goes_on = self.loops_ordered.is_some_and(|last| at.since(last) < ORDER_LASTS);
        if !goes_on {
            self.loops_first_ordered = Some(at);
        }
        self.loops_ordered = Some(self.loops_ordered.map_or(at, |last| last.max(at)));
    }

    /// A controller.
    #[must_use]
    pub fn device(&self, id: DeviceId) -> Option<&Device> {
        self.devices.get(id.index())
    }

    /// A controller, to be taught.
    pub fn device_mut(&mut self, id: DeviceId) -> Option<&mut Device> {
        self.devices.get_mut(id.index())
    }

    /// Adds a controller and gives it the next identity.
    pub fn add_device(&mut self) -> DeviceId {
        let id = DeviceId(self.devices.len() as u32);
        self.devices.push(Device::new(id));
        self.touch();
        id
    }

    /// The controller that answers to a station address.
    #[must_use]
    pub fn by_station(&self, station: StationAddress) -> Option<DeviceId> {
        let mut all = self.devices.iter();
        all.find(|device| device.station == Some(station)).map(|device| device.id)
    }

    /// The controller at a position of the line as it is now.
    #[must_use]
    pub fn by_position(&self, position: Position) -> Option<DeviceId> {
        let mut all = self.devices.iter();
        all.find(|device| device.position == Some(position)).map(|device| device.id)
    }

    /// What people call a controller: `Term 7 (EL2004)`, or `SubDevice 7` where nothing is known of it.
    #[must_use]
    pub fn label(&self, id: DeviceId) -> String {
        self.device(id).map_or_else(|| label(id, "", ""), Device::label)
    }

    /// The links of the tree with controllers by identity; empty without a tree.
    pub fn links(&self) -> impl Iterator<Item = Link<DeviceId>> + '_ {
        let links = self.tree.iter().flat_map(|tree| tree.links());
        links.map(|link| link.map(|node| DeviceId(node as u32)))
    }

    /// The far end of a port by the tree; `None` where nothing is wired or no tree is known.
    #[must_use]
    pub fn opposite(&self, id: DeviceId, port: Port) -> Option<End<DeviceId>> {
        let tree = self.tree.as_ref().filter(|tree| id.index() < tree.len())?;
        let end = tree.opposite(End::Controller(id.index(), port))?;
        Some(end.map(|node| DeviceId(node as u32)))
    }

    /// How many controllers there are at least: the planned ones do not count until they answer.
    #[must_use]
    pub fn device_count(&self) -> usize {
        let answered = self.devices.iter().filter(|device| device.answered.is_some()).count();
        let traffic = &self.traffic;
        answered.max(usize::from(traffic.broadcasts.counted()))
    }

    /// The time at the end of the input in which nothing was sent any more.
    #[must_use]
    pub fn stillness(&self) -> Option<Stillness> {
        Stillness::of(self)
    }

    /// The highest state that any controller was ever seen in.
    #[must_use]
    pub fn highest_state(&self) -> Option<AlState> {
        let states = self.devices.iter().map(|device| device.al.highest);
        states.max().flatten().max(self.traffic.broadcasts.al_highest())
    }

    /// The MainDevice that drives the line: by its habits, or whose tools have told of the line.
    #[must_use]
    pub fn main_device_kind(&self) -> MainDeviceKind {
        self.habits.recognised().map_or(self.reported.kind, |found| found.kind)
    }

    /// When DL status of a SubDevice changed for the last time while process data were exchanged, as the event field of
    /// frames tells: before that links come as the line is brought up.
    #[must_use]
    pub fn changed_link(&self) -> Option<Seen<()>> {
        let is_running = |at: Instant| self.cyclic.iter().any(|cyclic| cyclic.wkc.first().at < at);
        self.events.dl_status.came.filter(|came| is_running(came.at))
    }

    /// When no frame at all was seen for several cycles of the process data, latest first.
    pub fn quiet(&self) -> impl Iterator<Item = Pause> + '_ {
        let cycle = self.cyclic.iter().filter_map(|cyclic| cyclic.sent.cycle()).min();
        let is_long = move |pause: &Pause| cycle.is_some_and(|cycle| pause.span() >= cycle * 3);
        self.traffic.recording.quiet().iter().rev().copied().filter(is_long)
    }

    /// When no frame at all was seen before those, or between those, that a silence consists of.
    #[must_use]
    pub fn quiet_before(&self, silence: &Silence) -> Option<Pause> {
        let is_then = |pause: &Pause| silence.since.at <= pause.to && pause.to <= silence.last.at;
        self.quiet().find(is_then)
    }

    /// Who has an FMMU on a logical datagram, as far as it was seen being set up.
    pub fn owners(&self, cyclic: &Cyclic) -> impl Iterator<Item = Owner> + '_ {
        owners(&self.devices, cyclic.start, cyclic.len)
    }

    /// Forgets a tree that was put together from what was seen: controllers have other numbers now.
    pub fn forget_tree(&mut self) {
        if !self.tree_is_planned {
            (self.tree, self.tree_basis) = (None, (0, 0));
        }
    }

    /// Puts the tree together from what was seen, once all ports of all controllers are known; not
    /// where it was planned. Says whether there is a new one.
    ///
    /// Only what was first seen counts: the tree is how things are wired when all is well.
    pub fn derive_tree(&mut self) -> bool {
        let is_known = !self.devices.is_empty()
            && self.devices.len() >= self.device_count()
            && self.devices.iter().all(|device| device.dl.first.is_some());
        if self.tree_is_planned || !is_known {
            return false;
        }
        let times = self.devices.iter().filter(|device| device.received.is_some()).count();
        let basis = (self.devices.len(), times);
        if self.tree.is_some() && self.tree_basis == basis {
            return false;
        }
        self.tree_basis = basis;
        let mut seen: Vec<_> = self.devices.iter().map(Device::as_first_seen).collect();
        let mut tree = Reconstruction::of(Path::A, &seen).tree;
        // Behind an open port may be SubDevices that frames reach only behind a probe inside the line: no ring.
        if self.capture_probe.inside().is_some()
            && let Some((node, port)) = tree.closes_at()
        {
            seen[node].open[port] = false;
            tree = Reconstruction::of(Path::A, &seen).tree;
        }
        let is_new = self.tree.as_ref() != Some(&tree);
        self.tree = Some(tree);
        is_new
    }
}

/// Who has an FMMU on a stretch of logical addresses.
pub(crate) fn owners(
    devices: &[Device],
    start: LogicalAddress,
    len: u16,
) -> impl Iterator<Item = Owner> + '_ {
    devices.iter().filter_map(move |device| {
        let mut owner = Owner { device: device.id, reads: false, writes: false };
        for fmmu in device.fmmus.values() {
            if fmmu.active && fmmu.overlap(start, len).is_some() {
                owner.reads |= fmmu.reads;
                owner.writes |= fmmu.writes;
            }
        }
        (owner.reads || owner.writes).then_some(owner)
    })
}

/// Adds a change; the oldest one goes when there are too many.
fn push_kept<T>(changes: &mut VecDeque<T>, change: T) {
    if changes.len() == CHANGES_KEPT {
        changes.pop_front();
    }
    changes.push_back(change);
}
