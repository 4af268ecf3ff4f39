//! A whole network: controllers, wires, the cards of the MainDevice.
//!
//! A [`Segment`] takes frames from a card ([`Segment::handle_frame`]) and gives those that arrive
//! at one ([`Segment::poll_arrival`]). Time is an argument and never goes back; nothing happens
//! between two calls that does not depend on them alone, so the same calls give the same bytes.

mod bridge;
mod build;
mod build_deviations;
mod capture_probe;
pub(crate) mod card;
mod ethernet;
mod from_controllers;
mod identification;
mod injection;
pub mod plug;
mod port_swap;
mod signal_wires;
mod tx_capture;
mod tx_delay;

use std::collections::{BTreeMap, BTreeSet};

use linesman_proto::address::{DeviceId, Path};
use linesman_proto::ethernet::{MAX_LEN, MIN_LEN};
use linesman_proto::register::{ErrorCounter, WATCHDOG_COUNTER_PDI, WATCHDOG_COUNTER_PROCESS_DATA};
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::Tree;

pub use bridge::BridgedSides;
pub use build::BuildError;
pub use capture_probe::{ProbeFrame, ProbePlaceError};
pub use card::{FrameTally, HostPort};
pub use ethernet::EthernetPortError;
pub use plug::PlugError;
pub use tx_capture::Outgoing;

use crate::controller::{Controller, WatchdogKind};
use crate::device::{SignalId, Signals};
use crate::event_queue::EventQueue;
use crate::frame::{Damage, WireFrame};
use crate::seed::Seed;
use crate::segment_file::{SegmentFile, Supply};
use crate::truth::{self, AuditedCounter, Effect, FaultId, Place, TruthLog, Unexplained};
use crate::wire::walk::{FrameInTransit, Outcome};
use crate::wire::world::World;

/// Buffers kept for frames to come.
const SPARE_BUFFERS: usize = 32;

/// A frame that arrives at a card.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Arrival {
    /// When its last bit was there.
    pub at: Instant,
    /// The card.
    pub path: Path,
    /// Whether its check sequence is right. If not, the card drops and counts it, and no driver
    /// sees it.
    pub intact: bool,
}

/// A network: its controllers, links and cards, and what goes wrong with them.
#[derive(Debug)]
pub struct Segment {
    name: String,
    tree: Tree,
    world: World,
    seed: Seed,
    /// By node.
    devices: Vec<DeviceInfo>,
    /// Current that each node takes from the E-bus, in mA.
    ebus_ma: Vec<i16>,
    /// Whether a terminal without a controller feeds the E-bus anew before a node.
    fed_anew: Vec<bool>,
    /// Devices by the hot connect groups that the file names, as `group:A`.
    groups: BTreeMap<String, Vec<DeviceId>>,
    /// Supplies that devices share.
    supplies: Vec<Supply>,
    /// The node of each device that is there.
    nodes: BTreeMap<DeviceId, usize>,
    /// Names of all devices that were planned.
    names: Vec<String>,
    now: Instant,
    /// Frames on their way to a card.
    arrivals: EventQueue<(Path, WireFrame)>,
    /// Nodes whose cable was pulled, and the open link that this is.
    unplugged: BTreeMap<usize, FaultId>,
    /// Numbers of frames among them that foreign senders sent.
    strange: BTreeSet<u64>,
    spare: Vec<Vec<u8>>,
    /// Frames that wait in the cards, by the time at which they leave.
    waiting: EventQueue<tx_delay::DelayedFrame>,
    /// Frames that go out, for who listens.
    tx_capture: tx_capture::TxCapture,
    tally: FrameTally,
}

/// What a segment knows about a controller beside the controller itself.
#[derive(Clone, PartialEq, Eq, Debug)]
struct DeviceInfo {
    outputs: Vec<SignalId>,
    inputs: Vec<SignalId>,
}

impl Segment {
    /// Builds what a file describes: the line was on before the run began, all links are up. Faults
    /// of the file are scheduled.
    ///
    /// # Errors
    /// [`BuildError`] names the device or fault that cannot be built, and why.
    pub fn build(file: &SegmentFile) -> Result<Self, BuildError> {
        build::build(file)
    }

    // ---- frames ----

    /// A card sends a frame: its first bit leaves the card at `now`, or when the frame before it has left. A card pads what is shorter
    /// than 60 bytes, and sends nothing without a carrier or longer than 1514 bytes.
    pub fn handle_frame(&mut self, now: Instant, path: Path, frame: &[u8]) {
        self.now = self.now.max(now);
        let now = self.now;
        self.send_kept_back(now);
        if !self.keep_back(now, path, frame) {
            self.send(now, path, frame, false);
        }
    }

    /// A frame leaves its card, which may have been shown to who listens before.
    fn send(&mut self, now: Instant, path: Path, frame: &[u8], was_captured: bool) {
        let mut bytes = self.spare.pop().unwrap_or_default();
        bytes.clear();
        bytes.extend_from_slice(frame);
        bytes.resize(frame.len().max(MIN_LEN), 0);
        self.world.frames += 1;
        let given = frame;
        let frame = WireFrame { bytes, damage: Damage::default(), number: self.world.frames };
        let duration = frame.duration();
        self.world.look_ahead(now, duration);
        self.world.advance(now);
        self.fetch_foreign_frames();
        if !was_captured && frame.bytes.len() <= MAX_LEN {
            self.capture(now, path, given);
        }
        let card = &mut self.world.cards[path.index()];
        if frame.bytes.len() > MAX_LEN || !card.has_carrier(now) {
            card.counts.tx_dropped += 1;
            self.recycle(frame.bytes);
            return;
        }
        if let Some(fault) = card.silenced_by(now) {
            card.counts.tx_dropped += 1;
            let lost = Effect::FrameLost { frame: frame.number };
            self.world.truth.effect(now, Some(fault), Place::Host(path), lost);
            self.recycle(frame.bytes);
            return;
        }
        card.counts.tx_frames += 1;
        self.tally.sent += 1;
        // Another's frame may be on the line.
        let leaves = self.world.behind_foreign_frames(path, now);
        if leaves > now {
            self.world.look_ahead(leaves, duration);
        }
        let card = &mut self.world.cards[path.index()];
        card.sent_until = leaves + duration;
        card.tx_delay.sends(leaves, duration);
        let mut in_transit = FrameInTransit::new(frame);
        match self.world.carry(path, leaves, &mut in_transit) {
            Outcome::Arrived(path, at) => self.arrivals.push(at, (path, in_transit.frame)),
            Outcome::Vanished => {
                self.tally.vanished += 1;
                self.recycle(in_transit.frame.bytes);
            }
        }
    }

    /// Frames of foreign senders arrive as all others do.
    #[inline]
    fn fetch_foreign_frames(&mut self) {
        if self.world.foreign_frames_came_back() {
            self.take_foreign_frames();
        }
    }

    fn take_foreign_frames(&mut self) {
        for (at, path, frame) in self.world.take_foreign_frames() {
            self.strange.insert(frame.number);
            self.arrivals.push(at, (path, frame));
        }
    }

    /// The earliest frame that has arrived by the time last told ([`Segment::advance`],
    /// [`Segment::handle_frame`]); its bytes replace those in `buffer`.
    pub fn poll_arrival(&mut self, buffer: &mut Vec<u8>) -> Option<Arrival> {
        loop {
            let (at, (path, mut frame)) = self.arrivals.pop_until(self.now)?;
            let intact = frame.damage.is_intact();
            let kept = self.receive(at, path, &frame);
            if kept {
                std::mem::swap(buffer, &mut frame.bytes);
            }
            self.recycle(frame.bytes);
            if kept {
                return Some(Arrival { at, path, intact });
            }
        }
    }

    /// A card and its host take in what arrived; false if the host loses it.
    fn receive(&mut self, at: Instant, path: Path, frame: &WireFrame) -> bool {
        let card = &mut self.world.cards[path.index()];
        let own = u64::from(self.strange.is_empty() || !self.strange.remove(&frame.number));
        if !frame.damage.is_intact() {
            if frame.bytes.len() < MIN_LEN {
                card.counts.rx_length_errors += 1;
            } else {
                card.counts.rx_crc_errors += 1;
            }
            self.tally.damaged += own;
            return true;
        }
        if let Some(fault) = card.dropped(at) {
            card.counts.rx_dropped += 1;
            self.tally.dropped += own;
            let effect = Effect::FrameLost { frame: frame.number };
            self.world.truth.effect(at, Some(fault), Place::Host(path), effect);
            return false;
        }
        card.counts.rx_frames += 1;
        self.tally.whole += own;
        true
    }

    fn recycle(&mut self, bytes: Vec<u8>) {
        if self.spare.len() < SPARE_BUFFERS {
            self.spare.push(bytes);
        }
    }

    /// When the next frame arrives, of those on their way, when one leaves a card that is late, or
    /// when a foreign sender sends one. What else happens in the segment needs no call at its time: it is
    /// made up for, in its order, by the next one.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Instant> {
        let due =
            [self.arrivals.next_at(), self.waiting.next_at(), self.world.next_foreign_frame()];
        due.into_iter().flatten().min()
    }

    /// Time passes: devices, links and faults up to `now`.
    pub fn advance(&mut self, now: Instant) {
        self.now = self.now.max(now);
        self.send_kept_back(self.now);
        self.world.advance(self.now);
        self.fetch_foreign_frames();
        for card in &mut self.world.cards {
            card.settle(self.now);
        }
    }

    /// Lets every frame walk port by port, or only those that meet more than controllers at rest,
    /// as is usual. Nothing that can be seen depends on it but the time it takes: this is for those
    /// who want to see that.
    pub fn set_walks_always(&mut self, always: bool) {
        self.world.fast_path.forbidden = always;
    }

    /// How many frames needed no walk so far.
    #[must_use]
    pub fn frames_without_walk(&self) -> u64 {
        self.world.fast_path.frames
    }

    // ---- what there is ----

    /// Longer than a frame is on its way through all of it and back, whatever way it takes, without
    /// its own duration.
    #[must_use]
    pub fn longest_way(&self) -> Span {
        self.world.round()
    }

    /// What the segment is called.
    #[must_use]
    pub fn title(&self) -> &str {
        &self.name
    }

    /// The wiring that is really there. Its nodes are in the order of [`Segment::devices`].
    #[must_use]
    pub const fn tree(&self) -> &Tree {
        &self.tree
    }

    /// Controllers that are there, in the order of the tree's nodes.
    pub fn devices(&self) -> impl Iterator<Item = DeviceId> {
        (0..self.world.nodes.len()).map(|node| self.world.id(node))
    }

    /// The node of a device in [`Segment::tree`]; `None` for one that is not there.
    #[must_use]
    pub fn node(&self, device: DeviceId) -> Option<usize> {
        self.nodes.get(&device).copied()
    }

    /// What a device is called; empty for one that was never planned.
    #[must_use]
    pub fn name(&self, device: DeviceId) -> &str {
        self.names.get(device.index()).map_or("", String::as_str)
    }

    /// A controller; `None` for one that is not there.
    #[must_use]
    pub fn controller(&self, device: DeviceId) -> Option<&Controller> {
        Some(&self.world.nodes[self.node(device)?].controller)
    }

    /// All signals.
    #[must_use]
    pub const fn signals(&self) -> &Signals {
        &self.world.signals
    }

    /// All signals, to drive inputs from outside.
    pub fn signals_mut(&mut self) -> &mut Signals {
        self.world.signals.at(self.now)
    }

    /// The signals that a device drives, channel by channel.
    #[must_use]
    pub fn outputs(&self, device: DeviceId) -> &[SignalId] {
        self.node(device).map_or(&[], |node| &self.devices[node].outputs)
    }

    /// The signals that a device takes, channel by channel.
    #[must_use]
    pub fn inputs(&self, device: DeviceId) -> &[SignalId] {
        self.node(device).map_or(&[], |node| &self.devices[node].inputs)
    }

    /// What the driver of a card tells, as of the time last told.
    #[must_use]
    pub fn host(&self, path: Path) -> HostPort {
        let card = self.world.card(path);
        HostPort { carrier: card.has_carrier(self.now), ..card.counts }
    }

    /// Whether the kernel tells of the link of a card without being asked, as of the time last told; once for
    /// each change. Who hears it looks at all cards.
    pub fn takes_card_news(&mut self) -> bool {
        let now = self.now;
        self.world.cards.iter_mut().fold(false, |told, card| card.takes_news(now) | told)
    }

    /// Until when a card sends nothing, if a fault silences it at `now`.
    pub fn silent_until(&mut self, now: Instant, path: Path) -> Option<Instant> {
        self.world.look_ahead(now, Span::ZERO);
        self.world.card(path).silent_until(now)
    }

    /// What became of the frames that the cards sent.
    #[must_use]
    pub const fn frames(&self) -> FrameTally {
        self.tally
    }

    // ---- truth ----

    /// What was done to the segment, and what came of it.
    #[must_use]
    pub const fn truth(&self) -> &TruthLog {
        &self.world.truth
    }

    /// Takes the entries of the log out of it ([`TruthLog::take_entries`]).
    pub fn take_truth(&mut self) -> Vec<truth::Entry> {
        self.world.truth.take_entries()
    }

    /// Counters that moved, since the audit before, without a cause in the log: of errors, and of
    /// watchdogs. Those that ran out are entered now.
    pub fn audit(&mut self) -> Vec<Unexplained> {
        self.world.enter_expiries();
        let nodes = self.world.nodes.iter();
        let tx_capture = nodes.flat_map(|node| {
            let id = node.controller.id();
            let counters = node.controller.error_counters();
            let counters: Vec<_> = counters.iter().collect();
            // What a processor does to its controller is no business of the wires.
            let counters = counters.into_iter().filter(|(which, _)| *which != ErrorCounter::Pdi);
            let errors = counters.map(|(counter, value)| (AuditedCounter::Error(counter), value));
            let watchdogs = [
                (WatchdogKind::ProcessData, WATCHDOG_COUNTER_PROCESS_DATA),
                (WatchdogKind::Pdi, WATCHDOG_COUNTER_PDI),
            ];
            let watchdogs = watchdogs.map(|(kind, register)| {
                (AuditedCounter::Watchdog(kind), node.controller.register(register.address))
            });
            errors.chain(watchdogs).map(move |(counter, value)| (id, counter, value))
        });
        self.world.truth.audit(tx_capture)
    }

    /// Gives a counter a value, as history does. Nothing for a device that is not there.
    pub fn set_counter(&mut self, device: DeviceId, counter: ErrorCounter, value: u8) {
        if let Some(node) = self.node(device) {
            let at = self.now;
            self.world.nodes[node].controller.set_counter(counter, value);
            self.world.truth.set(device, counter, value);
            let place = Place::Device(device);
            self.world.truth.effect(at, None, place, Effect::OldCounters);
        }
    }
}
