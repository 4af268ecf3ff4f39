//! Status of a network: each SubDevice, and the network's state word.
//!
//! [`NetworkStatus`] is fed with the [`Event`]s of a MainDevice and words nothing. A MainDevice that runs a
//! plan keeps one, so that an application sees the state words in its cycle
//! ([`MainDevice::network_status`](crate::MainDevice::network_status)); [`Watch`](super::Watch) keeps one for people.

use linesman_config::plan::Plan;
use linesman_proto::address::{DeviceId, Path, WorkingCounter};
use linesman_proto::state::{AlState, NetworkState, StateValue};
use linesman_proto::time::Instant;

use super::device::concerned;
use super::group_status::{GroupRefusal, GroupStatus};
use super::{CounterTotals, WatchedDevice};
use crate::event::Event;
use crate::supervisor::GroupPlace;

/// How the network of a plan stands.
#[derive(Clone, Debug)]
pub struct NetworkStatus {
    devices: Vec<WatchedDevice>,
    /// The hot connect groups of the plan, in its order.
    groups: Vec<GroupStatus>,
    /// Bits that do not follow from the SubDevices.
    own: NetworkState,
    /// No SubDevice answers any more.
    all_lost: bool,
    responding: Option<WorkingCounter>,
    /// Whose clock is the reference, and how far it is ahead of the host's, in ns.
    network_time: Option<(DeviceId, i64)>,
}

impl NetworkStatus {
    /// The SubDevices of a plan, of which nothing is known yet.
    #[must_use]
    pub fn new(plan: &Plan) -> Self {
        let devices = plan.devices.iter().map(|device| WatchedDevice::new(plan, device)).collect();
        let groups = plan.groups.iter().map(GroupStatus::new).collect();
        let own = NetworkState::default();
        Self { devices, groups, own, all_lost: false, responding: None, network_time: None }
    }

    /// What is known of each SubDevice, by [`DeviceId`].
    #[must_use]
    pub fn devices(&self) -> &[WatchedDevice] {
        &self.devices
    }

    /// What is known of one SubDevice.
    #[must_use]
    pub fn device(&self, id: DeviceId) -> Option<&WatchedDevice> {
        self.devices.get(id.index())
    }

    /// The hot connect groups, in the order of the plan.
    #[must_use]
    pub fn groups(&self) -> &[GroupStatus] {
        &self.groups
    }

    /// How many SubDevices of hot connect groups are planned, and how many of them are there (HC-15).
    #[must_use]
    pub fn hot_connect_counts(&self) -> (usize, usize) {
        let members = || self.groups.iter().flat_map(GroupStatus::members);
        let is_there = |id: &&DeviceId| {
            self.device(**id).is_some_and(|device| device.is_present() == Some(true))
        };
        (members().count(), members().filter(is_there).count())
    }

    /// How many SubDevices are not there, and may be absent.
    pub(super) fn excused(&self) -> usize {
        self.devices.iter().filter(|device| device.is_excused()).count()
    }

    /// All SubDevices in the order of a topology list: those that are always there in processing order, then
    /// the groups (HC-15).
    #[must_use]
    pub fn topology_order(&self) -> Vec<DeviceId> {
        let of_groups: Vec<DeviceId> =
            self.groups.iter().flat_map(GroupStatus::members).copied().collect();
        let all = self.devices.iter().map(WatchedDevice::id);
        let fixed = all.filter(|id| !of_groups.contains(id));
        fixed.chain(of_groups.iter().copied()).collect()
    }

    /// The network's state word (PLC-07).
    #[must_use]
    pub fn network_state(&self) -> NetworkState {
        let mut word = self.own;
        for device in self.devices.iter().filter(|device| !device.is_excused()) {
            let state = device.state();
            let bit = match state.state() {
                StateValue::Known(AlState::PreOp) => NetworkState::SOME_PREOP,
                StateValue::Known(AlState::SafeOp) => NetworkState::SOME_SAFEOP,
                StateValue::Known(AlState::Op) => 0,
                StateValue::Known(AlState::Init | AlState::Boot) | StateValue::Unknown(_) => {
                    NetworkState::SOME_INIT
                }
            };
            word = word.with(bit, true);
            if device.is_clock_apart() {
                word = word.with(NetworkState::CLOCKS_APART, true);
            }
            if device.has_error() {
                word = word.with(NetworkState::SOME_ERROR, true);
            }
        }
        word
    }

    /// How many SubDevices answered the last broadcast read.
    #[must_use]
    pub fn responding(&self) -> Option<WorkingCounter> {
        self.responding
    }

    /// Whose clock is the reference clock, and how far the network's time is ahead of the host's, in ns
    /// (DC-09), as it was told last; negative: it is behind. `None`: no clock is in use.
    #[must_use]
    pub fn network_time(&self) -> Option<(DeviceId, i64)> {
        self.network_time
    }

    /// How many SubDevices are there, of those that are planned (PLC-08).
    #[must_use]
    pub fn present(&self) -> usize {
        self.devices.iter().filter(|device| device.is_present() == Some(true)).count()
    }

    /// For each SubDevice the sum of its frame and symbol errors at all ports, to be looked at often; then
    /// at the ports of those whose sum has risen (PLC-14).
    pub fn error_sums(&self) -> impl Iterator<Item = u64> {
        self.devices.iter().map(|device| device.counters().sum())
    }

    /// Sets or clears bits of the network that do not follow from the SubDevices. Says whether that
    /// changed them.
    pub fn set(&mut self, bits: u16, set: bool) -> bool {
        let before = self.own;
        self.own = before.with(bits, set);
        self.own != before
    }

    /// A card has a link, or has none. True if that is news.
    pub fn set_carrier(&mut self, card: Path, carrier: bool) -> bool {
        let bit = match card {
            Path::A => NetworkState::LINK_ERROR,
            Path::B => NetworkState::REDUNDANCY_LINK_ERROR,
        };
        self.set(bit, !carrier)
    }

    /// The network is brought up from now on, anew or for the first time, until each SubDevice is in its target state, has
    /// refused it, is another one, or is not there.
    pub fn begin_reset(&mut self) {
        self.set(NetworkState::RESET, true);
    }

    /// Something happened.
    #[allow(clippy::wildcard_enum_match_arm, reason = "the others are of one SubDevice")]
    pub fn handle_event(&mut self, now: Instant, event: &Event) {
        match event {
            Event::Responding { now: count, .. } => self.responding = Some(*count),
            Event::Ring { intact } => {
                self.set(NetworkState::REDUNDANCY_FRAME_MISSING, !intact);
            }
            Event::GroupJoined { group, place } => {
                if let Some(group) = self.groups.get_mut(*group) {
                    (group.joined, group.place, group.refusal) = (true, *place, None);
                }
            }
            Event::GroupLeft { group } => {
                if let Some(group) = self.groups.get_mut(*group) {
                    (group.joined, group.place) = (false, None);
                }
            }
            Event::GroupMisplaced { group, place } => {
                if let Some(group) = self.groups.get_mut(*group) {
                    group.refusal = Some(GroupRefusal::Place(*place));
                }
            }
            Event::WrongIdentification { id, check, found, .. } => {
                self.refuse(*id, GroupRefusal::Number { check: *check, found: *found });
            }
            Event::IdentificationShared { id, check, count } => {
                self.refuse(*id, GroupRefusal::Shared { check: *check, count: *count });
            }
            // Whoever was plugged in there is pulled.
            Event::Links { id, status } => {
                let is_there = |place: Option<GroupPlace>| {
                    place.is_some_and(|(at, port)| at == *id && !status.port_state(port).link)
                };
                for group in &mut self.groups {
                    if matches!(group.refusal, Some(GroupRefusal::Place(at)) if is_there(at)) {
                        group.refusal = None;
                    }
                }
            }
            Event::NetworkTime { id, ahead_ns } => self.network_time = Some((*id, *ahead_ns)),
            Event::OutputsWithheld { .. } => {
                self.set(NetworkState::WATCHDOG, true);
            }
            Event::OutputsResumed { .. } => {
                self.set(NetworkState::WATCHDOG, false);
            }
            Event::OutputsLocked => {
                self.set(NetworkState::LOCKED, true);
            }
            Event::ResetBegun => {
                self.set(NetworkState::LOCKED, false);
                self.begin_reset();
            }
            _ => {}
        }
        if let Some(id) = concerned(event)
            && let Some(device) = self.devices.get_mut(id.index())
        {
            device.handle_event(now, event);
            // The first that is back after all were lost: the whole line is brought up.
            if device.is_present() == Some(true) {
                if std::mem::take(&mut self.all_lost) {
                    self.begin_reset();
                }
            } else if matches!(event, Event::DeviceLost { .. }) {
                self.all_lost = self.devices.iter().all(|one| one.is_present() == Some(false));
            }
        }
        if self.own.contains(NetworkState::RESET)
            && (matches!(event, Event::AllReached) || self.devices.iter().all(WatchedDevice::is_up))
        {
            self.set(NetworkState::RESET, false);
        }
    }

    /// What was plugged in for the group with this first SubDevice is not taken.
    fn refuse(&mut self, first: DeviceId, refusal: GroupRefusal) {
        let is_its = |group: &&mut GroupStatus| group.members().first() == Some(&first);
        if let Some(group) = self.groups.iter_mut().find(is_its) {
            group.refusal = Some(refusal);
        }
    }

    /// All error counters and change counters begin at 0 again. Nothing is written to the SubDevices:
    /// other tools go on as they were, and no count is lost.
    pub fn clear(&mut self) {
        self.devices.iter_mut().for_each(WatchedDevice::clear);
    }

    /// The counters of a SubDevice.
    #[must_use]
    pub fn counters(&self, id: DeviceId) -> Option<&CounterTotals> {
        self.device(id).map(WatchedDevice::counters)
    }
}
