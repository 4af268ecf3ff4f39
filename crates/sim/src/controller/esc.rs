//! The controller with the device behind it, as the wire sees it.
//!
//! Read first: S1 chapter 3. Time is an argument everywhere; between two calls everything that was
//! due happens in the order of its time ([`Controller::advance`]). A call with an earlier time than
//! one before finds the controller as the later one left it.

use linesman_proto::address::DeviceId;
use linesman_proto::port::Port;
use linesman_proto::time::{Instant, Span};

use super::clock::{LocalClock, SyncSignal};
use super::core::Core;
use super::fast_path::Sampling;
use super::kind::ControllerKind;
use super::pdi::Pdi;
use super::phy::PhyAction;
use super::port_event::{PortEvent, QueuedEvent};
use super::sii::Outcome;
use crate::device::{Firmware, Signals};
use crate::frame::WireFrame;
use crate::hardware::PortKind;

/// A wake-up is at least this much later than the call that asked for it.
const SHORTEST_NAP: Span = Span::us(1);

/// What becomes of a frame behind the processing unit.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[must_use]
pub enum Forwarding {
    /// It goes on.
    Forward,
    /// It ends here: a frame that circulates, or one without EtherCAT where those are not wanted.
    /// The unit has counted it.
    Destroy,
}

/// An EtherCAT controller with the device behind it.
///
/// For each frame the wire calls [`enters`](Self::enters) at the port it comes by and, where its way
/// leads past port A, [`process`](Self::process). It posts what ports and the unit see of *damage*
/// ([`CountKind`](super::CountKind)); what is wrong with the content of an intact frame the unit
/// counts itself, and lost links the controller counts when their loss is posted.
#[derive(Debug)]
pub struct Controller {
    pub(super) core: Core,
    pub(super) firmware: Box<dyn Firmware>,
    pub(super) powered: bool,
    /// The supply went and the signals of the device do not know yet.
    pub(super) going_dark: bool,
    pub(super) samples: bool,
    pub(super) sampling: Sampling,
    /// When something is due next; [`Instant::MAX`] for nothing.
    pub(super) next: Instant,
}

/// What can be due. Of things due at the same instant the first in this list comes first.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Due {
    Port,
    Loops,
    LoopsReturn,
    Sii,
    Phy,
    ProcessDataWatchdog,
    PdiWatchdog,
    Reset,
    Sync,
    Firmware,
}

impl Controller {
    /// A controller without power. `sii` is the content of its EEPROM; empty means that there is
    /// none.
    #[must_use]
    pub fn new(
        id: DeviceId,
        hardware: impl Into<ControllerKind>,
        clock: LocalClock,
        firmware: Box<dyn Firmware>,
        sii: Vec<u8>,
    ) -> Self {
        let mut core = Core::new(id, hardware.into(), clock, sii);
        core.sii.emulate(firmware.emulates_sii());
        Self {
            core,
            firmware,
            powered: false,
            going_dark: false,
            samples: false,
            sampling: Sampling::default(),
            next: Instant::MAX,
        }
    }

    // ---- power ----

    /// The supply comes: registers as after a reset, no links, counters 0, station address 0, INIT.
    /// The SII is loaded [`STARTUP_DELAY`](super::STARTUP_DELAY) later, and then the device starts;
    /// until then process-data RAM cannot be reached. Links come with posted events.
    pub fn power_on(&mut self, at: Instant) {
        self.powered = true;
        self.samples = false;
        while let Some(first) = self.core.ports.queue.next_at().filter(|first| *first < at) {
            self.core.ports.queue.pop_until(first);
        }
        self.core.start(at);
        self.reschedule();
    }

    /// The same, long ago: the SII is loaded and the device has started. For a line that was on
    /// before the run began.
    pub fn power_on_before(&mut self, at: Instant, signals: &mut Signals) {
        if std::mem::take(&mut self.going_dark) {
            self.firmware.stop(signals);
        }
        self.power_on(at);
        self.core.clock_runs_before(at);
        while !self.core.startup.loaded && self.core.sii.done_at().is_some() {
            self.finish_sii(at, signals);
        }
        self.reschedule();
    }

    /// The supply goes: nothing is known any more, all loops are closed. Its outputs are no longer
    /// driven from the next [`Controller::advance`] on.
    pub fn power_off(&mut self, at: Instant) {
        if self.powered {
            self.powered = false;
            self.going_dark = true;
            self.core.power_off();
            self.next = at;
        }
    }

    /// Whether it has power.
    #[must_use]
    pub fn is_powered(&self) -> bool {
        self.powered
    }

    // ---- time ----

    /// Everything that happens by itself up to and at `now`: posted port events in the order of
    /// time, loops, SII, watchdogs, wake-ups of the device.
    #[inline]
    pub fn advance(&mut self, now: Instant, signals: &mut Signals) {
        if self.next <= now {
            self.catch_up(now, signals);
        }
    }

    fn catch_up(&mut self, now: Instant, signals: &mut Signals) {
        if std::mem::take(&mut self.going_dark) {
            self.firmware.stop(signals);
        }
        if !self.powered {
            while self.core.ports.queue.pop_until(now).is_some() {}
        }
        loop {
            let (at, due) = self.due();
            if at > now || at == Instant::MAX {
                self.next = at;
                break;
            }
            self.serve(at, due, signals);
        }
        self.sampling.renew();
    }

    /// When something will happen by itself, if anything will.
    #[must_use]
    pub fn next_event(&self) -> Option<Instant> {
        (self.next != Instant::MAX).then_some(self.next)
    }

    /// What is due first, and when; [`Instant::MAX`] for nothing.
    fn due(&self) -> (Instant, Due) {
        let core = &self.core;
        let mut first = (Instant::MAX, Due::Firmware);
        if !self.powered {
            return first;
        }
        let mut consider = |at: Option<Instant>, due: Due| {
            if let Some(at) = at
                && at < first.0
            {
                first = (at, due);
            }
        };
        consider(core.ports.queue.next_at(), Due::Port);
        consider(core.ports.change_at, Due::Loops);
        consider(core.ports.returns.map(|(at, _)| at), Due::LoopsReturn);
        consider(core.sii.done_at(), Due::Sii);
        consider(core.phys.done_at(), Due::Phy);
        consider(core.watchdogs.process_data_expires(), Due::ProcessDataWatchdog);
        consider(core.watchdogs.pdi_expires(), Due::PdiWatchdog);
        consider(core.reset.at, Due::Reset);
        consider(core.sync.due(), Due::Sync);
        consider(core.firmware_at, Due::Firmware);
        first
    }

    pub(super) fn reschedule(&mut self) {
        self.next = if self.going_dark { Instant::ZERO } else { self.due().0 };
    }

    fn serve(&mut self, at: Instant, due: Due, signals: &mut Signals) {
        let core = &mut self.core;
        match due {
            Due::Port => {
                if let Some((_, event)) = core.ports.queue.pop_until(at) {
                    core.happens(event, at);
                }
            }
            Due::Loops => core.change_loops(),
            Due::LoopsReturn => core.return_loops(),
            Due::Sii => self.finish_sii(at, signals),
            Due::Phy => core.finish_phy(),
            Due::ProcessDataWatchdog => core.expire_process_data_watchdog(at),
            Due::PdiWatchdog => core.expire_pdi_watchdog(at),
            Due::Reset => {
                self.samples = false;
                self.firmware.stop(signals);
                core.start(at);
            }
            Due::Sync => self.serve_sync(at, signals),
            Due::Firmware => self.run_firmware(at, signals),
        }
    }

    fn finish_sii(&mut self, at: Instant, signals: &mut Signals) {
        let core = &mut self.core;
        let starting = !core.startup.started;
        match core.sii.finish(&mut core.memory) {
            Outcome::None => return,
            Outcome::Loaded => core.loaded(),
            Outcome::NotLoaded => {}
        }
        core.refresh_dl_status();
        if starting {
            core.startup.started = true;
            self.firmware.start(at, &mut Pdi { core, signals, now: at });
            self.samples = self.firmware.samples();
            core.sync.heard = self.firmware.synchronises();
            core.call_firmware(at);
        }
    }

    fn run_firmware(&mut self, at: Instant, signals: &mut Signals) {
        self.core.firmware_at = None;
        if self.core.processor_stuck {
            return;
        }
        let mut pdi = Pdi { core: &mut self.core, signals, now: at };
        if let Some(wake) = self.firmware.run(at, &mut pdi) {
            self.core.call_firmware(wake.max(at + SHORTEST_NAP));
        }
    }

    /// SYNC0, SYNC1 or both come, and the device hears them.
    fn serve_sync(&mut self, at: Instant, signals: &mut Signals) {
        let heard = self.core.serve_sync(at);
        if self.core.processor_stuck {
            return;
        }
        let edges = if self.core.sync.bounces { 2 } else { 1 };
        for (signal, _) in SyncSignal::ALL.into_iter().zip(heard).filter(|(_, heard)| *heard) {
            for _ in 0..edges {
                let mut pdi = Pdi { core: &mut self.core, signals, now: at };
                if let Some(wake) = self.firmware.sync(signal, at, &mut pdi) {
                    self.core.call_firmware(wake.max(at + SHORTEST_NAP));
                }
            }
        }
    }

    // ---- the wire's side ----

    /// The wire tells what a port sees; it happens when [`Controller::advance`] reaches `at`.
    pub fn post(&mut self, at: Instant, event: PortEvent) {
        self.core.ports.queue.push(at, QueuedEvent::Posted(event));
        if self.powered {
            self.next = self.next.min(at);
        }
    }

    /// Whether the loop of a port is open, as of the last [`Controller::advance`]: frames leave and
    /// enter here. Port A is open when all are closed.
    #[inline]
    #[must_use]
    pub fn is_open(&self, port: Port) -> bool {
        self.powered && self.core.ports.loops.is_open(port)
    }

    /// Whether the loop of a port will be open at `at`, as far as events posted so far tell, without
    /// going there: for a frame that comes back while others are still to come.
    #[must_use]
    pub fn is_open_at(&self, port: Port, at: Instant) -> bool {
        if at < self.next {
            return self.is_open(port);
        }
        self.powered && self.core.loops_at(at).is_open(port)
    }

    /// Whether a frame that passes port A has come round the wrong way: the loop of port A is closed
    /// and its mode is auto or auto close. Such frames may pass once.
    #[must_use]
    pub fn port_zero_closes_ring(&self) -> bool {
        self.core.ports.loops.port_zero_closes_ring()
    }

    /// The first bit of a frame reaches a port from outside at `at`, whether its loop is open or
    /// closed. Call it before [`Controller::process`] for the port the frame came by.
    #[inline]
    pub fn enters(&mut self, at: Instant, port: Port, frame: &WireFrame) {
        if self.powered {
            self.core.enters(at, port, frame);
            if let Some(first) = self.core.ports.queue.next_at() {
                self.next = self.next.min(first);
            }
        }
    }

    /// The processing unit: executes the datagrams of a frame in place. `at` is when its first bit
    /// enters the unit. What a good frame wrote takes effect before this returns; loops, the device
    /// and whatever else it sets going follow at the frame's end, with [`Controller::advance`].
    pub fn process(
        &mut self,
        at: Instant,
        frame: &mut WireFrame,
        signals: &mut Signals,
    ) -> Forwarding {
        if !self.powered {
            return Forwarding::Destroy;
        }
        self.advance(at, signals);
        if self.samples && !self.core.processor_stuck {
            self.sample(at, signals);
        }
        let verdict = self.core.process(at, frame);
        self.passed();
        verdict
    }

    /// Whether PHYs are going to do something to their links.
    #[inline]
    pub(crate) fn has_phy_actions(&self) -> bool {
        self.core.phys.has_actions()
    }

    /// What PHYs were told to do to their links, and when they do it; each is told once.
    pub(crate) fn take_phy_actions(&mut self) -> Vec<(Instant, Port, PhyAction)> {
        self.core.phys.take_actions()
    }

    /// Whether the controller itself closes a port that sees too many bad symbols: enhanced link
    /// detection (0x0141, bits 1 and 4 to 7), on ports with a PHY.
    #[must_use]
    pub fn has_enhanced_link_detection(&self, port: Port) -> bool {
        self.core.detects_links(port) && self.core.hardware.ports[port] == PortKind::Mii
    }
}
