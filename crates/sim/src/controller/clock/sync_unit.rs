//! The unit that makes SYNC0 and SYNC1: pulses at given system times.
//!
//! Reference: S2 2.15.3 and 2.15.4; S1 9.2. The unit compares the system time with that of the next
//! pulse. A start time in the past is therefore met only when the clock wraps: after 4.29 s with
//! 32 bits, never with 64.
//!
//! Pulses are worked out when somebody looks (a register is read), and one by one only when the
//! device behind hears them.

use linesman_proto::register::{self as r, AlEvents, Features};
use linesman_proto::time::{Instant, Span};

use crate::controller::access::touches;
use crate::controller::core::Core;
use crate::controller::memory::at;

/// The device is not called more often than this, whatever the cycle time says.
const SHORTEST_CYCLE: Span = Span::us(10);
/// Bits of 0x0981.
const CYCLIC: u8 = 1;
const AUTO_ACTIVATION: u8 = 1 << 3;
const EXTENDS_START: u8 = 1 << 4;
const CHECKS_START: u8 = 1 << 5;
const NEAR_IS_SHORT: u8 = 1 << 6;
const DEBUG_PULSE: u8 = 1 << 7;
/// What is near for a start time when bit 6 is set: 2^31 ns.
const SHORT_RANGE: u64 = 1 << 31;
/// Bit 0 of 0x0980: the processor sets the unit.
const OWNED_BY_PDI: u8 = 1;
/// Bit 2 of 0x0984.
const IMPLAUSIBLE: u8 = 1 << 2;

/// A signal that the unit makes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SyncSignal {
    /// SYNC0, the base.
    Sync0,
    /// SYNC1, behind SYNC0 or rarer.
    Sync1,
}

impl SyncSignal {
    /// Both, SYNC0 first.
    pub const ALL: [Self; 2] = [Self::Sync0, Self::Sync1];

    const fn enable_bit(self) -> u8 {
        match self {
            Self::Sync0 => 1 << 1,
            Self::Sync1 => 1 << 2,
        }
    }

    const fn status(self) -> &'static r::Register {
        match self {
            Self::Sync0 => &r::SYNC0_STATUS,
            Self::Sync1 => &r::SYNC1_STATUS,
        }
    }

    const fn event(self) -> AlEvents {
        match self {
            Self::Sync0 => AlEvents::SYNC0,
            Self::Sync1 => AlEvents::SYNC1,
        }
    }

    /// Bit of 0x0151 that makes it an AL event.
    const fn mapping_bit(self) -> u8 {
        match self {
            Self::Sync0 => 1 << 3,
            Self::Sync1 => 1 << 7,
        }
    }
}

/// State of the unit.
#[derive(Clone, Copy, Default, Debug)]
pub(in crate::controller) struct SyncUnit {
    running: bool,
    /// The system time up to which pulses have been worked out.
    settled: u64,
    /// System time of the next pulse of each signal; `None` for no more.
    next: [Option<u64>; 2],
    /// No pulse has come yet.
    pending: [bool; 2],
    implausible: bool,
    /// When a pulse comes that is heard, or one that raised an event ends.
    due: Option<Instant>,
    /// When the events of pulses end.
    pulse_ends: Option<Instant>,
    /// When the device was called last.
    called: Instant,
    /// The device behind takes the signals.
    pub(in crate::controller) heard: bool,
    /// The line from the unit to the device is broken: a fault.
    pub(in crate::controller) cut: bool,
    /// It carries each edge twice: a fault.
    pub(in crate::controller) bounces: bool,
}

impl SyncUnit {
    /// As after power-on; a line that is broken or bounces stays so.
    pub(in crate::controller) fn restarted(&self) -> Self {
        Self { cut: self.cut, bounces: self.bounces, ..Self::default() }
    }

    /// When something is to be done.
    pub(in crate::controller) fn due(&self) -> Option<Instant> {
        self.due
    }
}

impl Core {
    fn activation(&self) -> u8 {
        self.memory.u8(&r::SYNC_ACTIVATION)
    }

    fn is_enabled(&self, signal: SyncSignal) -> bool {
        self.activation() & signal.enable_bit() != 0
    }

    /// Whether the EtherCAT side sets the unit.
    pub(in crate::controller) fn sync_is_for_ecat(&self) -> bool {
        self.memory.u8(&r::CYCLIC_UNIT_CONTROL) & OWNED_BY_PDI == 0
    }

    /// What of a time the unit looks at.
    fn time_mask(&self) -> u64 {
        if Features(self.hardware.features).clock_64_bit() { u64::MAX } else { u64::from(u32::MAX) }
    }

    fn sync0_cycle(&self) -> u64 {
        u64::from(self.memory.u32(&r::SYNC0_CYCLE_TIME))
    }

    /// From one pulse to the next; 0 for a single one.
    fn period(&self, signal: SyncSignal) -> u64 {
        let (sync0, sync1) = (self.sync0_cycle(), u64::from(self.memory.u32(&r::SYNC1_CYCLE_TIME)));
        match signal {
            SyncSignal::Sync0 => sync0,
            // The delay begins anew with the first SYNC0 behind a SYNC1.
            SyncSignal::Sync1 => sync1.checked_div(sync0).map_or(0, |whole| (whole + 1) * sync0),
        }
    }

    // ---- what is written ----

    /// Something among the registers of the unit was written; `before` is what the activation was.
    pub(super) fn sync_written(
        &mut self,
        range: &std::ops::Range<usize>,
        before: u8,
        end: Instant,
    ) {
        let enhanced = Features(self.hardware.features).enhanced_sync_activation();
        let mut activation = self.activation();
        if !enhanced {
            activation &= 0b111;
        }
        let start_written = touches(range, &r::START_TIME);
        if start_written && activation & AUTO_ACTIVATION != 0 {
            activation |= CYCLIC;
        }
        let pulse = activation & DEBUG_PULSE != 0;
        activation &= !DEBUG_PULSE;
        self.memory.set_u8(&r::SYNC_ACTIVATION, activation);
        let restarts = start_written && activation & AUTO_ACTIVATION != 0;
        if activation & CYCLIC == 0 {
            self.stop_sync();
        } else if before & CYCLIC == 0 || restarts {
            self.start_sync(activation, end);
        }
        if pulse {
            for signal in SyncSignal::ALL {
                if self.is_enabled(signal) {
                    self.raise_sync(signal, end);
                }
            }
        }
        self.plan_sync(end);
    }

    fn stop_sync(&mut self) {
        self.sync.running = false;
        self.sync.next = [None; 2];
        self.sync.pending = [false; 2];
    }

    fn start_sync(&mut self, activation: u8, end: Instant) {
        let now = self.system_time(end);
        let mask = self.time_mask();
        let mut start = self.memory.u64(&r::START_TIME) & mask;
        if activation & EXTENDS_START != 0 {
            // The next time at which the low half reads like that.
            start = now.wrapping_add(u64::from((start as u32).wrapping_sub(now as u32))) & mask;
        }
        self.sync.implausible = false;
        if activation & CHECKS_START != 0 {
            let near = if activation & NEAR_IS_SHORT != 0 { SHORT_RANGE } else { mask / 2 };
            if start.wrapping_sub(now) & mask > near {
                self.sync.implausible = true;
                start = now & mask;
            }
        }
        let sync1 = start.wrapping_add(u64::from(self.memory.u32(&r::SYNC1_CYCLE_TIME)));
        self.sync.running = true;
        self.sync.settled = now;
        self.sync.next = [Some(start), Some(sync1 & mask)];
        self.sync.pending = [true; 2];
    }

    /// The system time has jumped, or is about to: pulses up to now have come, those that were
    /// jumped over will not.
    pub(super) fn sync_jumps(&mut self, now: Instant) {
        self.sync.settled = self.system_time(now);
    }

    // ---- pulses ----

    /// Works out the pulses up to an instant: how many of each signal.
    pub(super) fn settle_sync(&mut self, now: Instant) -> [u64; 2] {
        let mut counts = [0; 2];
        if !self.sync.running {
            return counts;
        }
        let time = self.system_time(now);
        let passed = time.wrapping_sub(self.sync.settled);
        if passed > i64::MAX as u64 {
            // Somebody asks about an earlier instant.
            return counts;
        }
        let mask = self.time_mask();
        for (index, signal) in SyncSignal::ALL.into_iter().enumerate() {
            let Some(next) = self.sync.next[index] else { continue };
            let ahead = next.wrapping_sub(self.sync.settled) & mask;
            if ahead > passed {
                continue;
            }
            let period = self.period(signal);
            counts[index] = (passed - ahead).checked_div(period).map_or(1, |more| more + 1);
            self.sync.next[index] =
                (period != 0).then(|| next.wrapping_add(counts[index].wrapping_mul(period)) & mask);
            self.sync.pending[index] = false;
            if self.is_enabled(signal) && self.acknowledges() {
                self.memory.set_u8(signal.status(), 1);
            }
        }
        self.sync.settled = time;
        counts
    }

    /// Whether a pulse lasts until the processor acknowledges it.
    fn acknowledges(&self) -> bool {
        self.memory.u16(&r::SYNC_PULSE_LENGTH) == 0
    }

    /// The pulses that come at `at`, for the device to hear.
    pub(in crate::controller) fn serve_sync(&mut self, at: Instant) -> [bool; 2] {
        if self.sync.pulse_ends.is_some_and(|end| end <= at) {
            self.sync.pulse_ends = None;
            self.clear_al_events(AlEvents::SYNC0.with(AlEvents::SYNC1));
        }
        let held = SyncSignal::ALL.map(|signal| self.memory.u8(signal.status()) != 0);
        let counts = self.settle_sync(at);
        let mut heard = [false; 2];
        for (index, signal) in SyncSignal::ALL.into_iter().enumerate() {
            // A signal that was not acknowledged has no new edge.
            if counts[index] > 0 && self.is_enabled(signal) && !held[index] {
                self.raise_sync(signal, at);
                heard[index] = self.sync.heard && !self.sync.cut;
                self.sync.called = at;
            }
        }
        self.plan_sync(at);
        heard
    }

    fn raise_sync(&mut self, signal: SyncSignal, at: Instant) {
        if self.memory.u8(&r::SYNC_LATCH_CONFIGURATION) & signal.mapping_bit() != 0 {
            self.raise_al_events(signal.event(), at);
            if !self.acknowledges() {
                let length = u64::from(self.memory.u16(&r::SYNC_PULSE_LENGTH)) * 10;
                self.sync.pulse_ends = Some(at + Span::ns(length));
            }
        }
    }

    /// The processor reads the status of a signal, which ends it.
    pub(in crate::controller) fn acknowledge_sync(&mut self, signal: SyncSignal) {
        self.memory.set_u8(signal.status(), 0);
        if self.acknowledges() {
            self.clear_al_events(signal.event());
        }
    }

    /// Finds out when the unit is to be served, from `from` on.
    pub(in crate::controller) fn plan_sync(&mut self, from: Instant) {
        let mapped = self.memory.u8(&r::SYNC_LATCH_CONFIGURATION);
        let next = SyncSignal::ALL.into_iter().zip(self.sync.next).filter_map(|(signal, next)| {
            let wanted = self.sync.heard || mapped & signal.mapping_bit() != 0;
            next.filter(|_| wanted && self.is_enabled(signal))
        });
        let mask = self.time_mask();
        let settled = self.sync.settled;
        let ahead = next.map(|next| next.wrapping_sub(settled) & mask).min();
        let pulse = ahead.filter(|_| self.sync.running).and_then(|ahead| {
            let target = settled.checked_add(ahead)?.wrapping_sub(self.system_time_offset());
            let at = self.clock.when(target, from)?;
            Some(at.max(self.sync.called + SHORTEST_CYCLE))
        });
        self.sync.due = [pulse, self.sync.pulse_ends].into_iter().flatten().min();
        self.rescheduled = true;
    }

    // ---- what is read ----

    /// Registers of the unit as they are when the frame begins.
    pub(super) fn show_sync(&mut self) {
        // What would have been done at its time is done then; a look ahead changes nothing.
        if self.sync.due.is_none() {
            self.settle_sync(self.passing.began);
        }
        if self.sync.running {
            for (register, next) in [&r::START_TIME, &r::NEXT_SYNC1].into_iter().zip(self.sync.next)
            {
                if let Some(next) = next {
                    self.put_time(register, next);
                }
            }
        }
        let [sync0, sync1] = self.sync.pending;
        let enabled = |signal, pending: bool| pending && self.is_enabled(signal);
        let status = u8::from(enabled(SyncSignal::Sync0, sync0))
            | u8::from(enabled(SyncSignal::Sync1, sync1)) << 1
            | if self.sync.implausible { IMPLAUSIBLE } else { 0 };
        self.memory.bytes_mut()[at(&r::SYNC_ACTIVATION_STATUS)] = status;
    }
}
