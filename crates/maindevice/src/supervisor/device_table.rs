//! Table of the SubDevices as they are now: shared by the cyclic exchange, which judges by it, and
//! by the supervisors, which fill it.

mod reference_clock;

use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::task::Waker;

use linesman_config::plan::expect::{Presence, Served};
use linesman_config::plan::{DevicePlan, Plan};
use linesman_proto::address::{DeviceId, Path, StationAddress, WorkingCounter};
use linesman_proto::sii::Identity;
use linesman_proto::state::{AlState, OredStates};
use linesman_proto::time::{DcTime, Instant, Span};

use super::group_table::GroupTable;
use super::times::{BringUpTimes, Phase};
use crate::executor::waitlist::Waitlist;

pub(crate) use reference_clock::ReferenceClock;

/// Whether and how a SubDevice can be reached.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(crate) enum Reachability {
    /// It has not been looked for yet.
    #[default]
    Unknown,
    /// It does not answer.
    Lost,
    /// It answers at its station address.
    There {
        /// It has just been given that address: it must be set up from INIT.
        restarted: bool,
    },
}

#[derive(Clone, Copy, Default, Debug)]
struct DeviceEntry {
    found: Reachability,
    served: bool,
    /// What it serves is known. It is not while it is on its way, or stuck with an error: its
    /// SyncManagers may take data or deny them.
    settled: bool,
    /// It is at its target.
    reached: bool,
    /// How often its mailbox was opened: each time both ends begin to count anew.
    openings: u32,
    mailbox: bool,
    /// Its clock was set since it was last without power: after so many others.
    clock_set: Option<u64>,
    /// That clock has 64 bits.
    clock_wide: bool,
    /// It was seen to have no clock.
    lacks_clock: bool,
    /// That is the one of BOOT, for files only.
    boots: bool,
    /// How far it is to be driven; what the plan says unless asked for otherwise.
    target: Option<AlState>,
    /// How often a state was asked for.
    requests: u32,
    /// How often it was lost.
    losses: u32,
    /// Changes when its error counters are about to be cleared, and when they are.
    clears: u32,
}

impl DeviceEntry {
    /// True if it can be reached, and its clock shows the time of all others.
    const fn shows_time(&self) -> bool {
        self.clock_set.is_some() && matches!(self.found, Reachability::There { .. })
    }
}

/// The SubDevices of a network as they are.
#[derive(Debug, Default)]
pub(crate) struct DeviceTable {
    devices: Vec<DeviceEntry>,
    /// Shared, so that the cycle sees without a lock whether anything has changed.
    version: Arc<AtomicU64>,
    pub(super) alerts: u64,
    /// Sleeps that an alert ends, in the order in which they began.
    pub(super) waiting: Waitlist<Waker>,
    /// Devices whose presence has changed since [`DeviceTable::take_changes`].
    changed: Vec<DeviceId>,
    /// How many are at their targets.
    reached: usize,
    /// How many are not there, and need not be.
    excused: usize,
    pub(super) groups: GroupTable,
    responding: Option<WorkingCounter>,
    states: Option<OredStates>,
    all_reached: bool,
    /// Who was found that the plan does not have, or not there: told once.
    strangers: BTreeSet<(Option<DeviceId>, Identity)>,
    /// No SubDevice goes beyond it for the time being.
    hold: Option<AlState>,
    /// Outputs are locked after a link error: no SubDevice goes beyond SAFEOP.
    locked: bool,
    times: Option<BringUpTimes>,
    /// How often clocks were set, and the system time at the start of the run.
    clock_base: Option<(u32, DcTime)>,
    clocks_ready: bool,
    /// Count of the clocks that were set, one after the other.
    clocks_set: u64,
    /// Whom all other clocks follow: its address, and who it is if the plan has it.
    reference: Option<(StationAddress, Option<DeviceId>)>,
    /// The planned station addresses, by [`DeviceId`].
    stations: Vec<StationAddress>,
    /// Two cards send each frame.
    is_ring: bool,
    /// [`ReferenceClock::second_card_ns`], once that is known.
    second_card_ns: Option<i64>,
    /// Until when the ring is open by an order of our own, or may seem to be.
    pub(crate) opened_until: Instant,
    /// The delays that clocks were told are those of the line as it is; `None` where nobody measures them again.
    pub(super) delays_known: Option<bool>,
    /// The ring has become whole again, and delays were not measured since.
    pub(super) ring_mended: bool,
    /// Count of the times that clocks were told other delays than they had.
    pub(super) delays_told: u64,
    /// Of the half of an open ring without the reference, the clock whose delay stayed as it was then.
    pub(super) far_base: Option<StationAddress>,
    /// Receive times are being latched and read.
    pub(super) is_latching: bool,
}

impl DeviceTable {
    pub(crate) fn new(plan: &Plan) -> Self {
        let count = plan.devices.len();
        let changed = (0..count as u32).map(DeviceId).collect();
        let live = |device: &DevicePlan| DeviceEntry {
            target: Some(device.target),
            ..DeviceEntry::default()
        };
        let devices = plan.devices.iter().map(live).collect();
        let times = Some(BringUpTimes::new(count));
        let stations = plan.devices.iter().map(|device| device.station).collect();
        let is_ring = plan.tree.closes_at().is_some();
        let groups = GroupTable::new(plan);
        Self { devices, changed, times, stations, is_ring, groups, ..Self::default() }
    }

    /// Changes whenever presence or "settled" changes.
    pub(crate) fn version(&self) -> u64 {
        self.version.load(Ordering::Relaxed)
    }

    /// The same, to be looked at without the line.
    pub(crate) fn live_version(&self) -> Arc<AtomicU64> {
        Arc::clone(&self.version)
    }

    /// Who serves process data, of those for whom that has changed since the last call: `least` those
    /// that surely do, `most` also those that may, being on their way between states or stuck short
    /// of their target.
    pub(crate) fn take_changes(&mut self, least: &mut Presence, most: &mut Presence) {
        for id in self.changed.drain(..) {
            let Some(live) = self.devices.get(id.index()) else { continue };
            let serves = |serves: bool| Served {
                reached_by: serves.then_some(Path::A),
                inputs: serves,
                outputs: serves,
            };
            let (surely, perhaps) = match live.found {
                // It may still be running as an earlier plan left it.
                Reachability::Unknown => (false, true),
                Reachability::Lost => (false, false),
                Reachability::There { .. } => {
                    (live.served && live.settled, live.served || !live.settled)
                }
            };
            least.set(id, serves(surely));
            most.set(id, serves(perhaps));
        }
    }

    fn live(&mut self, id: DeviceId) -> Option<&mut DeviceEntry> {
        self.devices.get_mut(id.index())
    }

    pub(crate) fn found(&self, id: DeviceId) -> Reachability {
        self.devices.get(id.index()).map_or(Reachability::Unknown, |live| live.found)
    }

    /// True if a SubDevice is where it can be reached.
    pub(crate) fn is_there(&self, id: DeviceId) -> bool {
        matches!(self.found(id), Reachability::There { .. })
    }

    /// Whether every SubDevice is where it can be reached.
    pub(crate) fn are_all_there(&self) -> bool {
        self.devices.iter().all(|live| matches!(live.found, Reachability::There { .. }))
    }

    /// Notes where a SubDevice is; returns where it was.
    pub(crate) fn set_found(&mut self, id: DeviceId, found: Reachability) -> Reachability {
        self.changes(id);
        let Some(live) = self.live(id) else { return Reachability::Unknown };
        let before = std::mem::replace(&mut live.found, found);
        // Whoever is lost serves nothing, and that is known; whoever comes is on its way.
        let settled = match found {
            Reachability::Lost => true,
            Reachability::There { .. } | Reachability::Unknown => false,
        };
        let losses =
            live.losses + u32::from(found == Reachability::Lost && before != Reachability::Lost);
        // What was seen and asked for outlives a loss; what it serves does not.
        let DeviceEntry { openings, reached, target, requests, clock_set, clock_wide, .. } = *live;
        let clock_set = clock_set.filter(|_| found != Reachability::There { restarted: true });
        let new = DeviceEntry {
            found,
            settled,
            openings,
            reached,
            target,
            requests,
            losses,
            clock_set,
            clock_wide,
            ..DeviceEntry::default()
        };
        *live = new;
        if self.groups.is_optional(id) {
            self.excused += usize::from(found == Reachability::Lost);
            self.excused -= usize::from(before == Reachability::Lost);
        }
        self.set_at_target(id, false);
        before
    }

    /// Notes that a SubDevice is on its way between states, and what it serves meanwhile.
    pub(crate) fn set_moving(&mut self, id: DeviceId, state: Option<AlState>) {
        self.set(id, state, false, false);
    }

    /// Notes that a SubDevice is where it shall be.
    pub(crate) fn set_reached(&mut self, id: DeviceId, state: AlState) {
        self.set(id, Some(state), true, true);
    }

    /// Whether a SubDevice is where it shall be.
    pub(crate) fn has_reached(&self, id: DeviceId) -> bool {
        self.devices.get(id.index()).is_some_and(|live| live.reached)
    }

    fn set(&mut self, id: DeviceId, state: Option<AlState>, settled: bool, reached: bool) {
        let Some(live) = self.live(id) else { return };
        live.served = state.is_some_and(AlState::has_inputs);
        let (mailbox, boots) =
            (state.is_some_and(AlState::has_mailbox), state == Some(AlState::Boot));
        live.openings += u32::from(mailbox && (!live.mailbox || boots != live.boots));
        (live.mailbox, live.boots) = (mailbox, boots);
        live.settled = settled;
        self.set_at_target(id, reached);
        self.changes(id);
    }

    fn set_at_target(&mut self, id: DeviceId, reached: bool) {
        let Some(live) = self.live(id) else { return };
        let before = std::mem::replace(&mut live.reached, reached);
        self.reached = self.reached + usize::from(reached) - usize::from(before);
    }

    /// Whether all are where they shall be, but for those that may be absent and are.
    pub(crate) fn have_all_reached(&self) -> bool {
        self.reached + self.excused == self.devices.len()
    }

    fn changes(&mut self, id: DeviceId) {
        self.version.fetch_add(1, Ordering::Relaxed);
        self.changed.push(id);
    }

    /// Whether the mailbox of a SubDevice can be used.
    pub(crate) fn has_mailbox(&self, id: DeviceId) -> bool {
        self.devices.get(id.index()).is_some_and(|live| live.mailbox)
    }

    /// Whether it is the mailbox of BOOT.
    pub(crate) fn boots(&self, id: DeviceId) -> bool {
        self.devices.get(id.index()).is_some_and(|live| live.boots)
    }

    /// How often the mailbox of a SubDevice was opened so far.
    pub(crate) fn mailbox_openings(&self, id: DeviceId) -> u32 {
        self.devices.get(id.index()).map_or(0, |live| live.openings)
    }

    /// Notes that all have reached their targets; true the first time.
    pub(crate) fn set_all_reached(&mut self, now: Instant) -> bool {
        if let Some(times) = &mut self.times {
            times.reached.get_or_insert(now);
        }
        !std::mem::replace(&mut self.all_reached, true)
    }

    /// Whether all have been at their targets at once.
    pub(crate) fn all_have_been_reached(&self) -> bool {
        self.all_reached
    }

    /// Clocks were set for the first time, or there are none to be set.
    pub(crate) fn set_clocks_ready(&mut self) {
        self.clocks_ready = true;
        self.alert();
    }

    /// Whether SubDevices may use their clocks.
    pub(crate) fn are_clocks_ready(&self) -> bool {
        self.clocks_ready
    }

    /// The state in which a SubDevice shall be now.
    pub(crate) fn wanted(&self, id: DeviceId) -> AlState {
        let target = self.devices.get(id.index()).and_then(|live| live.target);
        let target = target.unwrap_or(AlState::Init);
        match self.limit() {
            // BOOT and INIT are no further than any other state.
            Some(hold) if target != AlState::Boot && target.bits() > hold.bits() => hold,
            Some(_) | None => target,
        }
    }

    /// The state beyond which no SubDevice goes.
    fn limit(&self) -> Option<AlState> {
        match self.hold {
            Some(hold) if self.locked && hold.bits() > AlState::SafeOp.bits() => {
                Some(AlState::SafeOp)
            }
            None if self.locked => Some(AlState::SafeOp),
            hold => hold,
        }
    }

    /// The states in which the SubDevices shall be now, by [`DeviceId`].
    pub(crate) fn all_wanted(&self) -> Vec<AlState> {
        (0..self.devices.len() as u32).map(|id| self.wanted(DeviceId(id))).collect()
    }

    /// The states of those that should be there.
    pub(crate) fn all_expected(&self) -> Vec<AlState> {
        let is_excused =
            |id: &DeviceId| self.groups.is_optional(*id) && self.found(*id) == Reachability::Lost;
        let all = (0..self.devices.len() as u32).map(DeviceId);
        all.filter(|id| !is_excused(id)).map(|id| self.wanted(id)).collect()
    }

    /// Asks for a state of a SubDevice, whatever the plan says. False when there is no such SubDevice.
    pub(crate) fn ask_for(&mut self, id: DeviceId, state: AlState) -> bool {
        let Some(live) = self.live(id) else { return false };
        live.target = Some(state);
        live.requests += 1;
        self.all_reached = false;
        self.alert();
        true
    }

    /// Nobody goes beyond `hold`; `None`: everybody to the target.
    pub(crate) fn set_hold(&mut self, hold: Option<AlState>) {
        self.hold = hold;
        self.all_reached = false;
        self.alert();
    }

    /// Keeps SubDevices below OP while outputs are locked.
    pub(crate) fn set_locked(&mut self, locked: bool) {
        self.locked = locked;
        self.all_reached = false;
        self.alert();
    }

    /// How often a state of a SubDevice was asked for.
    pub(crate) fn requests(&self, id: DeviceId) -> u32 {
        self.devices.get(id.index()).map_or(0, |live| live.requests)
    }

    /// How often a SubDevice was lost.
    pub(crate) fn losses(&self, id: DeviceId) -> u32 {
        self.devices.get(id.index()).map_or(0, |live| live.losses)
    }

    /// The error counters of a SubDevice are about to be cleared, or were.
    pub(crate) fn note_clear(&mut self, id: DeviceId) {
        if let Some(live) = self.live(id) {
            live.clears += 1;
        }
    }

    /// Changes with each clear: a reading that was under way meanwhile may be from before it.
    pub(crate) fn clears(&self, id: DeviceId) -> u32 {
        self.devices.get(id.index()).map_or(0, |live| live.clears)
    }

    /// Notes what a phase of a SubDevice took.
    pub(crate) fn note_time(&mut self, id: DeviceId, phase: Phase, took: Span) {
        if let Some(times) = &mut self.times {
            times.note(id, phase, took);
        }
    }

    /// Notes what a phase of the whole network took, of the first bring-up.
    pub(crate) fn note_network_time(&mut self, phase: Phase, took: Span) {
        if let Some(times) = self.times.as_mut().filter(|times| times.reached.is_none()) {
            times.network.push((phase, took));
        }
    }

    /// A SubDevice is brought up anew.
    pub(crate) fn forget_times(&mut self, id: DeviceId) {
        if let Some(times) = self.times.as_mut().and_then(|times| times.devices.get_mut(id.index()))
        {
            times.phases.clear();
        }
    }

    /// Bringing up begins.
    pub(crate) fn begin_times(&mut self, now: Instant) {
        if let Some(times) = &mut self.times {
            times.began = now;
        }
    }

    /// What bringing up took so far.
    pub(crate) fn times(&self) -> Option<&BringUpTimes> {
        self.times.as_ref()
    }

    /// Notes a stranger, in the place of a planned SubDevice or elsewhere; true the first time.
    pub(crate) fn add_stranger(&mut self, instead_of: Option<DeviceId>, who: Identity) -> bool {
        self.strangers.insert((instead_of, who))
    }

    /// What the cyclic broadcast read brought. Returns the number that answered before if it has
    /// changed.
    pub(crate) fn broadcast(
        &mut self,
        responding: WorkingCounter,
        states: OredStates,
    ) -> Option<WorkingCounter> {
        let before = self.responding.replace(responding);
        let states_before = self.states.replace(states);
        let fewer_or_more = before.filter(|before| *before != responding);
        if fewer_or_more.is_some() && self.delays_known.is_some() {
            // Frames may travel otherwise than before.
            self.set_delays_known(false);
        }
        if fewer_or_more.is_some() || states_before.is_some_and(|before| before != states) {
            self.alert();
        }
        fewer_or_more
    }

    /// How many answered the last cyclic broadcast read.
    pub(crate) fn responding(&self) -> Option<WorkingCounter> {
        self.responding
    }

    /// Something is not as it was: all supervisors shall look at once.
    pub(crate) fn alert(&mut self) {
        self.alerts += 1;
        for waker in self.waiting.take_all() {
            waker.wake();
        }
    }

    pub(crate) fn alerts(&self) -> u64 {
        self.alerts
    }
}
