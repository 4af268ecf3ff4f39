//! Status of one SubDevice.

use std::collections::VecDeque;

use linesman_config::plan::{DevicePlan, Plan};
use linesman_proto::address::DeviceId;
use linesman_proto::port::{Port, PortMap};
use linesman_proto::register::{AlStatus, DlStatus};
use linesman_proto::sii::Identity;
use linesman_proto::state::{AlState, AlStatusCode, DeviceState, StateValue};
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::End;

use super::CounterTotals;
use crate::event::Event;

/// So many abnormal changes are remembered of each SubDevice.
const REMEMBERED: usize = 16;

/// A SubDevice left the state it was to be in.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct AbnormalChange {
    /// When it was seen.
    pub at: Instant,
    /// Where it was.
    pub from: AlState,
    /// Where it went.
    pub to: StateValue,
    /// Why, as it says; [`AlStatusCode::NO_ERROR`] when it gives no reason.
    pub code: AlStatusCode,
}

/// What is known of one SubDevice.
#[derive(Clone, Debug)]
pub struct WatchedDevice {
    id: DeviceId,
    /// Which ports have a neighbour in the plan.
    planned: PortMap<bool>,
    /// Ports at which a hot connect group may come and go.
    changeable: PortMap<bool>,
    /// It may be absent.
    optional: bool,
    /// The state that the plan drives it to.
    target: AlState,
    present: Option<bool>,
    status: Option<AlStatus>,
    code: AlStatusCode,
    found: Option<Identity>,
    wrong_identity: bool,
    clock_wide: bool,
    init_error: bool,
    links: Option<DlStatus>,
    counters: CounterTotals,
    abnormal: u64,
    not_present: u64,
    history: VecDeque<AbnormalChange>,
    /// How far its clock was off when it was told last, and whether that is out of the window.
    clock: Option<(Span, bool)>,
}

impl WatchedDevice {
    pub(super) fn new(plan: &Plan, device: &DevicePlan) -> Self {
        let node = device.id.index();
        let is_planned =
            |port| node < plan.tree.len() && plan.tree.open_ports(node).any(|open| open == port);
        Self {
            id: device.id,
            planned: PortMap::from_fn(is_planned),
            changeable: PortMap::from_fn(|port| is_changeable(plan, node, port)),
            optional: plan.is_optional(device.id),
            target: device.target,
            present: None,
            status: None,
            code: AlStatusCode::NO_ERROR,
            found: None,
            wrong_identity: false,
            clock_wide: false,
            init_error: false,
            links: None,
            counters: CounterTotals::default(),
            abnormal: 0,
            not_present: 1,
            history: VecDeque::new(),
            clock: None,
        }
    }

    /// Who it is.
    #[must_use]
    pub fn id(&self) -> DeviceId {
        self.id
    }

    /// Whether it answers; `None` before it was looked for.
    #[must_use]
    pub fn is_present(&self) -> Option<bool> {
        self.present
    }

    /// Who is there, planned or not; `None` before it was asked.
    #[must_use]
    pub fn found(&self) -> Option<&Identity> {
        self.found.as_ref()
    }

    /// Whether a port has a neighbour in the plan.
    #[must_use]
    pub fn is_planned(&self, port: Port) -> bool {
        self.planned[port]
    }

    /// State and error as AL status says; `None` before it was read.
    #[must_use]
    pub fn al_status(&self) -> Option<AlStatus> {
        self.status
    }

    /// The state word: software in the low byte, wiring in the high byte.
    #[must_use]
    pub fn state(&self) -> DeviceState {
        let here = self.present == Some(true) || self.wrong_identity;
        let state = match self.status {
            Some(status) if here => status.state(),
            Some(_) | None => StateValue::Known(AlState::Init),
        };
        let mut word = DeviceState::new(state);
        let bit = |set: bool, bits: u16| if set { bits } else { 0 };
        let error = here && self.status.is_some_and(AlStatus::error);
        word = word
            .with(bit(error, DeviceState::ERROR))
            .with(bit(self.wrong_identity, DeviceState::WRONG_IDENTITY))
            .with(bit(self.init_error, DeviceState::INIT_ERROR))
            .with(bit(!here, DeviceState::NOT_PRESENT));
        let Some(links) = self.links.filter(|_| here) else { return word };
        for port in Port::ALL {
            let seen = links.port_state(port);
            let planned = self.planned[port];
            // A port with a link that waits for its order to open (JCT-12) leads nowhere.
            let talks = seen.communication && !(planned && seen.closed);
            let bits = match (planned, seen.link, talks) {
                (true, false, _) | (false, _, true) if self.changeable[port] => continue,
                (true, false, _) => DeviceState::MISSING_LINK,
                (true, true, false) => DeviceState::LINK_ERROR,
                (false, _, true) => DeviceState::ADDITIONAL_LINK,
                (true, true, true) | (false, _, false) => continue,
            };
            word = word.with(bits).at_port(port);
        }
        word
    }

    /// Why it signals an error; [`AlStatusCode::NO_ERROR`] when it does not.
    #[must_use]
    pub fn code(&self) -> AlStatusCode {
        self.code
    }

    /// Whether it is absent, and may be.
    pub(super) fn is_excused(&self) -> bool {
        self.optional && self.present != Some(true) && !self.wrong_identity
    }

    /// Whether it signals an error, is not there although it should be, or is somebody else.
    pub(super) fn has_error(&self) -> bool {
        if self.is_excused() {
            return false;
        }
        let faults = [
            DeviceState::ERROR,
            DeviceState::WRONG_IDENTITY,
            DeviceState::INIT_ERROR,
            DeviceState::NOT_PRESENT,
        ];
        let word = self.state();
        faults.into_iter().any(|bit| word.contains(bit))
    }

    /// True if nothing is left to be done to bring it up for now: it is in its target state, has refused that, is another one,
    /// or is not there.
    pub(super) fn is_up(&self) -> bool {
        let is_there = self.status.is_some_and(|one| one.state() == StateValue::Known(self.target));
        let failed = self.init_error || self.wrong_identity || self.present == Some(false);
        is_there || failed || self.is_excused()
    }

    /// Its ports as they were read last.
    #[must_use]
    pub fn links(&self) -> Option<DlStatus> {
        self.links
    }

    /// Its error counters, summed up.
    #[must_use]
    pub fn counters(&self) -> &CounterTotals {
        &self.counters
    }

    /// The first of the two change counters of the online list: how often it left a state by itself. 0 is healthy.
    #[must_use]
    pub fn abnormal_changes(&self) -> u64 {
        self.abnormal
    }

    /// The second: 1 from the start, and one more each time it stopped answering.
    #[must_use]
    pub fn presence_changes(&self) -> u64 {
        self.not_present
    }

    /// How far its clock is off the reference clock, as it was told last; `None`: it has none that is in use,
    /// or is that itself.
    #[must_use]
    pub fn clock_difference(&self) -> Option<Span> {
        self.clock.map(|(difference, _)| difference)
    }

    /// True if its clock was set, and counts 64 bits.
    #[must_use]
    pub fn has_wide_clock(&self) -> bool {
        self.clock_wide
    }

    /// Whether its clock is out of the window (DC-21).
    #[must_use]
    pub fn is_clock_apart(&self) -> bool {
        self.clock.is_some_and(|(_, apart)| apart)
    }

    /// The last abnormal changes, the oldest first, with the reasons that it gave.
    pub fn history(&self) -> impl Iterator<Item = &AbnormalChange> {
        self.history.iter()
    }

    // Long for its number of events: one short arm each.
    #[allow(clippy::wildcard_enum_match_arm, reason = "the others say nothing of a SubDevice")]
    pub(super) fn handle_event(&mut self, now: Instant, event: &Event) {
        match event {
            Event::DeviceState { status, code, .. } => {
                self.present = Some(true);
                self.status = Some(*status);
                self.code = *code;
            }
            Event::AbnormalState { from, status, code, .. } => {
                self.abnormal += 1;
                if self.history.len() == REMEMBERED {
                    self.history.pop_front();
                }
                let to = status.state();
                self.history.push_back(AbnormalChange { at: now, from: *from, to, code: *code });
            }
            Event::TargetReached { .. } => {
                self.present = Some(true);
                self.wrong_identity = false;
                self.init_error = false;
            }
            Event::Refused { status, code, .. } => {
                self.init_error = true;
                self.status = Some(*status);
                self.code = *code;
            }
            Event::StepTimedOut { status, .. }
            | Event::StartUpFailed { status, .. }
            | Event::WrongModule { status, .. }
            | Event::CycleTooShort { status, .. }
            | Event::ModulesUnread { status, .. } => {
                self.init_error = true;
                self.status = Some(*status);
            }
            Event::DeviceLost { .. } => {
                if self.present == Some(true) {
                    self.not_present += 1;
                }
                self.present = Some(false);
                self.links = None;
                self.clock = None;
            }
            Event::DeviceBack { restarted, .. } => {
                self.present = Some(true);
                self.wrong_identity = false;
                if *restarted {
                    self.counters.restarted();
                }
            }
            Event::Identified { found, .. } => {
                self.found = Some(*found);
                self.wrong_identity = false;
            }
            Event::WrongDevice { found, .. } => {
                self.found = Some(*found);
                self.wrong_identity = true;
            }
            Event::WrongIdentification { check, .. } => self.wrong_identity = check.compulsory,
            Event::Links { status, .. } => {
                self.present = Some(true);
                self.links = Some(*status);
            }
            Event::Counters { counters, .. } => {
                self.counters.record(counters);
            }
            Event::ClockSet { is_wide, .. } => self.clock_wide = *is_wide,
            Event::ClockDifference { difference, apart, .. } => {
                self.clock = Some((*difference, *apart));
            }
            Event::CountersCleared { counters, .. } => {
                self.counters.record(counters);
                self.counters.cleared_by_us();
            }
            _ => {}
        }
    }

    pub(super) fn clear(&mut self) {
        self.counters.clear();
        self.abnormal = 0;
        self.not_present = 1;
    }
}

/// Whether a hot connect group may be plugged in at a port.
fn is_changeable(plan: &Plan, node: usize, port: Port) -> bool {
    let end = End::Controller(node, port);
    let below = plan.tree.child(node, port);
    plan.groups.iter().filter(|group| group.optional).any(|group| {
        let is_its_own = below.is_some_and(|below| group.first().index() == below);
        let is_free = below.is_none() && group.places.is_empty();
        is_its_own || is_free || group.places.contains(&end)
    })
}

/// Whom an event is about.
#[allow(clippy::wildcard_enum_match_arm, reason = "the others are of the network")]
pub(super) fn concerned(event: &Event) -> Option<DeviceId> {
    match event {
        Event::DeviceState { id, .. }
        | Event::TargetReached { id, .. }
        | Event::Refused { id, .. }
        | Event::StepTimedOut { id, .. }
        | Event::StartUpFailed { id, .. }
        | Event::WrongModule { id, .. }
        | Event::CycleTooShort { id, .. }
        | Event::ModulesUnread { id, .. }
        | Event::AbnormalState { id, .. }
        | Event::DeviceLost { id }
        | Event::DeviceBack { id, .. }
        | Event::WrongDevice { id, .. }
        | Event::WrongIdentification { id, .. }
        | Event::Counters { id, .. }
        | Event::CountersCleared { id, .. }
        | Event::ClockSet { id, .. }
        | Event::ClockDifference { id, .. }
        | Event::Identified { id, .. }
        | Event::Links { id, .. }
        | Event::PortOpened { id, .. }
        | Event::Emergency { id, .. }
        | Event::Mailbox { id, .. }
        | Event::SdoUploaded { id, .. }
        | Event::SdoDownloaded { id, .. } => Some(*id),
        _ => None,
    }
}
