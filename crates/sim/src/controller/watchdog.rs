//! The watchdogs: times that run out unless they are triggered.
//!
//! Read first: S2 2.10. Ticks run by themselves since power-on; a watchdog of n ticks expires at
//! the first tick that is at least n ticks behind its trigger, that is between n and n + 1 ticks
//! later.

use linesman_proto::register::{self as r, WatchdogDivider, WatchdogTime};
use linesman_proto::time::{Instant, Span};

use super::core::Core;

/// One of the two watchdogs of a controller.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum WatchdogKind {
    /// That of the process data, counted at 0x0442.
    ProcessData,
    /// That of the processor, counted at 0x0443.
    Pdi,
}

/// A watchdog that ran out.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct WatchdogExpiry {
    /// Which.
    pub kind: WatchdogKind,
    /// When.
    pub at: Instant,
    /// How long what it waits for had not come.
    pub silence: Span,
}

/// Expiries that are kept until somebody asks for them: no counter counts further.
const KEPT: usize = 256;

/// One watchdog.
#[derive(Clone, Copy, Default, Debug)]
struct Watchdog {
    expires: Option<Instant>,
    /// When it was triggered last.
    triggered: Instant,
}

impl Watchdog {
    /// When it will expire, if it runs.
    fn expires(&self) -> Option<Instant> {
        self.expires
    }

    /// How long it has not been triggered at an instant.
    fn silence(&self, at: Instant) -> Span {
        at.since(self.triggered)
    }

    fn is_running(&self) -> bool {
        self.expires.is_some()
    }

    fn stop(&mut self) {
        self.expires = None;
    }

    /// Starts it anew. With time 0 it is off and never expires.
    fn trigger(
        &mut self,
        at: Instant,
        ticks_since: Instant,
        divider: WatchdogDivider,
        time: WatchdogTime,
    ) {
        self.triggered = at;
        self.expires = time.span(divider).map(|span| {
            let tick = divider.tick().as_nanos();
            let earliest = (at + span).since(ticks_since).as_nanos();
            ticks_since + Span::ns(earliest.next_multiple_of(tick))
        });
    }
}

/// Both watchdogs of a controller.
///
/// That of the process data runs from the first outputs on. That of the processor runs only while the
/// processor is stuck, and is not expired otherwise.
#[derive(Clone, Debug)]
pub(super) struct Watchdogs {
    process_data: Watchdog,
    pdi: Watchdog,
    /// That of the processor is not expired.
    pub(super) pdi_ok: bool,
    /// Those that ran out, until somebody asks.
    pub(super) expiries: Vec<WatchdogExpiry>,
}

impl Default for Watchdogs {
    fn default() -> Self {
        Self {
            process_data: Watchdog::default(),
            pdi: Watchdog::default(),
            pdi_ok: true,
            expiries: Vec::new(),
        }
    }
}

impl Watchdogs {
    /// As after power-on: both stand, neither is expired. Expiries wait on for who asks.
    pub(super) fn restart(&mut self) {
        self.stop();
        self.pdi_ok = true;
    }

    pub(super) fn stop(&mut self) {
        self.process_data.stop();
        self.pdi.stop();
    }

    /// When that of the process data will expire, if it runs.
    pub(super) fn process_data_expires(&self) -> Option<Instant> {
        self.process_data.expires()
    }

    /// When that of the processor will expire, if it runs.
    pub(super) fn pdi_expires(&self) -> Option<Instant> {
        self.pdi.expires()
    }

    fn note_expiry(&mut self, kind: WatchdogKind, at: Instant, silence: Span) {
        if self.expiries.len() < KEPT {
            self.expiries.push(WatchdogExpiry { kind, at, silence });
        }
    }
}

impl Core {
    fn divider(&self) -> WatchdogDivider {
        WatchdogDivider(self.memory.u16(&r::WATCHDOG_DIVIDER))
    }

    /// Fresh outputs came.
    pub(super) fn trigger_process_data_watchdog(&mut self, when: Instant) {
        let time = WatchdogTime(self.memory.u16(&r::WATCHDOG_TIME_PROCESS_DATA));
        let divider = self.divider();
        self.watchdogs.process_data.trigger(when, self.startup.powered_at, divider, time);
        self.memory.set_u16(&r::WATCHDOG_STATUS_PROCESS_DATA, 1);
    }

    pub(super) fn expire_process_data_watchdog(&mut self, when: Instant) {
        let silence = self.watchdogs.process_data.silence(when);
        self.watchdogs.note_expiry(WatchdogKind::ProcessData, when, silence);
        self.watchdogs.process_data.stop();
        self.memory.set_u16(&r::WATCHDOG_STATUS_PROCESS_DATA, 0);
        self.increment(r::WATCHDOG_COUNTER_PROCESS_DATA.address);
        self.raise_al_events(r::AlEvents::PROCESS_DATA_WATCHDOG, when);
    }

    /// Divider or times were written: what runs, runs anew; time 0 switches off, and off means "not
    /// expired" (S2 2.10.5).
    pub(super) fn retime_watchdogs(&mut self, when: Instant) {
        let off = self.memory.u16(&r::WATCHDOG_TIME_PROCESS_DATA) == 0;
        if off || self.watchdogs.process_data.is_running() {
            self.trigger_process_data_watchdog(when);
        }
        self.retime_pdi_watchdog(when);
    }

    /// The processor stops serving the controller, or serves it again.
    pub(super) fn set_processor_stuck(&mut self, stuck: bool, when: Instant) {
        self.processor_stuck = stuck;
        if !stuck {
            // What happened meanwhile is still to be served.
            self.call_firmware(when);
        }
        self.retime_pdi_watchdog(when);
    }

    /// While it is served, the PDI watchdog is triggered all the time.
    pub(super) fn retime_pdi_watchdog(&mut self, when: Instant) {
        self.watchdogs.pdi.stop();
        let time = WatchdogTime(self.memory.u16(&r::WATCHDOG_TIME_PDI));
        if self.processor_stuck && self.watchdogs.pdi_ok {
            let divider = self.divider();
            self.watchdogs.pdi.trigger(when, self.startup.powered_at, divider, time);
        }
        let served = !self.processor_stuck && self.memory.u8(&r::PDI_CONTROL) != 0;
        if served || time == WatchdogTime::OFF {
            self.watchdogs.pdi_ok = true;
            self.refresh_dl_status();
        }
    }

    pub(super) fn expire_pdi_watchdog(&mut self, when: Instant) {
        let silence = self.watchdogs.pdi.silence(when);
        self.watchdogs.note_expiry(WatchdogKind::Pdi, when, silence);
        self.watchdogs.pdi.stop();
        self.watchdogs.pdi_ok = false;
        self.increment(r::WATCHDOG_COUNTER_PDI.address);
        self.refresh_dl_status();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        // The window of S2 2.10: between n and n + 1 ticks behind the trigger.
        #[test]
        fn it_expires_within_one_tick(
            since in 0u64..1_000_000, after in 0u64..10_000_000_000, divider: u16, time in 1u16..
        ) {
            let (divider, time) = (WatchdogDivider(divider), WatchdogTime(time));
            let since = Instant::from_nanos(since);
            let at = since + Span::ns(after);
            let mut watchdog = Watchdog::default();
            watchdog.trigger(at, since, divider, time);
            let expires = watchdog.expires().unwrap();
            prop_assert!(expires >= at + time.span(divider).unwrap());
            prop_assert!(expires < at + time.latest_expiry(divider).unwrap());
        }
    }

    #[test]
    fn time_zero_switches_it_off() {
        let mut watchdog = Watchdog::default();
        watchdog.trigger(Instant::ZERO, Instant::ZERO, WatchdogDivider::RESET, WatchdogTime::RESET);
        assert_eq!(watchdog.expires(), Some(Instant::from_nanos(100_000_000)));
        watchdog.trigger(Instant::ZERO, Instant::ZERO, WatchdogDivider::RESET, WatchdogTime::OFF);
        assert!(!watchdog.is_running());
    }
}
