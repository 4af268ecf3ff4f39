//! A controller in its place: plugs, supply, and what is to happen to it.

use std::collections::VecDeque;

use linesman_proto::address::StationAddress;
use linesman_proto::mailbox::coe::Emergency;
use linesman_proto::port::{Port, PortMap};
use linesman_proto::register::WatchdogTime;
use linesman_proto::time::{Instant, Span};

use super::change::DirectedLink;
use super::nodes::Entry;
use super::outage_history::OutageHistory;
use super::software::ActiveSoftwareChange;
use super::timing::ActiveTimingChange;
use crate::controller::Controller;
use crate::device::{Refusal, Signals, SoftwareFault};
use crate::event_queue::EventQueue;
use crate::truth::FaultId;

/// What happens to a controller and cannot be posted to it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum NodeAction {
    Off,
    On,
    Refuse(Option<Refusal>),
    SoftwareFault { software_fault: SoftwareFault, begins: bool },
    Hang(bool),
    Reboot,
    Watchdog(Option<WatchdogTime>),
    Report(Emergency),
    Address(Option<StationAddress>),
    Drift { ppb: i64, ramp_ppb_per_s: i64, ramp: Span },
    RestoreDrift,
    RestartClock,
    CutSync(bool),
    BounceSync(bool),
    SlowDown(Option<Span>),
}

/// A fault inside that waits for a frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Glitch {
    pub(super) from: Instant,
    pub(super) part: u16,
    pub(super) flip: u8,
    pub(super) fault: FaultId,
}

/// A controller in its place.
#[derive(Debug)]
pub(crate) struct Node {
    pub(crate) controller: Controller,
    /// The line that leaves by each port.
    pub(super) leaving: PortMap<Option<DirectedLink>>,
    pub(super) power: OutageHistory,
    pub(super) glitches: VecDeque<Glitch>,
    /// Whose doing it is that the device refuses a state.
    pub(super) refused_by: Option<FaultId>,
    /// Whose doing it is that its watchdog has another time, and the time before.
    pub(super) watchdog_by: Option<FaultId>,
    former_watchdog: Option<WatchdogTime>,
    /// Whose doing it is that it has another station address.
    pub(super) address_by: Option<FaultId>,
    /// Its address before, and the one it was given.
    former_address: Option<[StationAddress; 2]>,
    /// What faults have done to its software.
    pub(super) software: Vec<ActiveSoftwareChange>,
    /// What faults have done to its clock and deadlines.
    pub(super) timing: Vec<ActiveTimingChange>,
    acts: EventQueue<NodeAction>,
    /// What the book of all nodes keeps of it.
    pub(super) entry: Entry,
    /// The last frame that had a datagram for it.
    pub(super) last_frame: u64,
}

impl Node {
    pub(super) fn new(controller: Controller) -> Self {
        Self {
            controller,
            leaving: PortMap::default(),
            power: OutageHistory::default(),
            glitches: VecDeque::new(),
            refused_by: None,
            watchdog_by: None,
            former_watchdog: None,
            address_by: None,
            former_address: None,
            software: Vec::new(),
            timing: Vec::new(),
            acts: EventQueue::default(),
            entry: Entry::default(),
            last_frame: 0,
        }
    }

    pub(super) fn act_at(&mut self, at: Instant, act: NodeAction) {
        self.acts.push(at, act);
    }

    /// Brings the controller to an instant, with all that happens to it on the way.
    #[inline]
    pub(super) fn touch(&mut self, now: Instant, signals: &mut Signals) {
        while let Some((at, act)) = self.acts.pop_until(now) {
            self.controller.advance(at, signals);
            match act {
                NodeAction::Off => self.controller.power_off(at),
                NodeAction::On => self.controller.power_on(at),
                NodeAction::Refuse(refusal) => self.controller.refuse(at, refusal),
                NodeAction::SoftwareFault { software_fault, begins } => {
                    self.controller.software_fault(at, software_fault, begins)
                }
                NodeAction::Hang(hangs) => self.controller.set_processor_stuck(at, hangs),
                NodeAction::Watchdog(time) => {
                    self.set_watchdog(at, time);
                }
                NodeAction::Reboot => self.controller.reboot_processor(at, signals),
                NodeAction::Drift { ppb, ramp_ppb_per_s, ramp } => {
                    self.controller.set_drift(at, ppb, ramp_ppb_per_s, ramp);
                }
                NodeAction::RestoreDrift => self.controller.restore_drift(at),
                NodeAction::RestartClock => self.controller.restart_clock(at),
                NodeAction::CutSync(cut) => self.controller.cut_sync(cut),
                NodeAction::BounceSync(bounces) => self.controller.bounce_sync(bounces),
                NodeAction::SlowDown(takes) => self.controller.slow_down(takes),
                NodeAction::Report(emergency) => self.controller.report(at, emergency),
                NodeAction::Address(address) => self.set_address(address),
            }
        }
        self.controller.advance(now, signals);
    }

    /// Gives it another station address, or back what it had.
    fn set_address(&mut self, address: Option<StationAddress>) {
        if let Some(address) = address {
            let former = self.controller.set_station_address(address);
            self.former_address = Some([former, address]);
        } else if let Some([former, given]) = self.former_address.take()
            && self.controller.station_address() == given
        {
            self.controller.set_station_address(former);
        }
    }

    /// When something happens to it by itself; [`Instant::MAX`] for never.
    #[inline]
    pub(super) fn next_event(&self) -> Instant {
        let act = self.acts.next_at().unwrap_or(Instant::MAX);
        self.controller.next_event().unwrap_or(Instant::MAX).min(act)
    }

    /// When something happens that can lead frames another way.
    pub(super) fn next_way_event(&self) -> Instant {
        let act = self.acts.next_at().unwrap_or(Instant::MAX);
        self.controller.next_way_event().unwrap_or(Instant::MAX).min(act)
    }

    /// Sets the time of the watchdog, or back to what it was.
    fn set_watchdog(&mut self, at: Instant, time: Option<WatchdogTime>) {
        if let Some(time) = time {
            let former = self.controller.set_watchdog_time(at, time);
            self.former_watchdog.get_or_insert(former);
        } else if let Some(former) = self.former_watchdog.take() {
            self.controller.set_watchdog_time(at, former);
        }
    }

    /// A glitch that spoils a frame which passes at `at`, if one waits.
    #[inline]
    pub(super) fn strike(&mut self, at: Instant) -> Option<Glitch> {
        let ready = self.glitches.front().is_some_and(|glitch| glitch.from <= at);
        if ready { self.glitches.pop_front() } else { None }
    }

    /// Whether the loop of a port is open at an instant that may be ahead.
    #[inline]
    pub(super) fn is_open_at(&self, port: Port, at: Instant) -> bool {
        self.controller.is_open_at(port, at)
    }
}
