//! Synchronisation of a device: by itself, with the frames, or with the SYNC signals of its clock.
//!
//! Read first: ETG.1020, synchronisation; objects 0x1C32 (outputs) and 0x1C33 (inputs). Everything
//! that a type can and wants stands in those two objects: modes (04), shortest cycle (05), time to
//! calculate and copy (06), delay (09), shift (03). What goes wrong is counted in them: outputs that
//! did not come before their SYNC (0B), work that was not done before the next (0C), outputs that
//! came too shortly before (0D); 20 shows that the last cycle was one of those.
//!
//! In step with a clock, inputs are latched at the signal (and 03 of 0x1C33 after it) and can be fetched when they are
//! calculated and copied (06 of 0x1C33): a frame that passes in between fetches those of the cycle before, without any
//! error. Where 06 says nothing they can be fetched at once.
//!
//! An edge that follows the last one within a quarter of the cycle is none of the SYNC unit: the line
//! to the processor is disturbed. Such an edge starts no work; it weighs like a miss.
//!
//! A miss weighs three times what a good cycle makes up for; beyond the limit in 0x10F1:02 (4 where
//! there is no such object) the device leaves OP, as public SubDevice stack code does it.

use linesman_proto::mailbox::coe::{ObjectAddress, ObjectIndex};
use linesman_proto::state::AlStatusCode;
use linesman_proto::time::{Instant, Span};

use super::sync_mode::{SyncMode, mode};
use crate::controller::{Pdi, SyncSignal};
use crate::device::dictionary::Dictionary;

const OUTPUTS: u16 = ObjectIndex::OUTPUT_SYNC.0;
const INPUTS: u16 = ObjectIndex::INPUT_SYNC.0;
/// Object and subindex of the limit of misses.
const ERROR_LIMIT: (u16, u8) = (0x10F1, 2);
const DEFAULT_LIMIT: u64 = 4;
/// What a miss weighs.
const MISS: u32 = 3;
/// Pulses in a row, each in its time, that make a device trust its clock.
const LOCKED: u32 = 5;
/// So many stray edges are borne.
const STRAYS: u32 = 4;
/// Cycles in a row with their outputs that make it go to OP.
const STEADY: u32 = 3;
/// So many cycles without a pulse are too many.
const SILENT_CYCLES: u64 = 3;
/// The local timer in free run, where nobody has set one.
const OWN_CYCLE: Span = Span::ms(1);

/// Subindices of 0x1C32 and 0x1C33.
mod sub {
    pub(super) const MODE: u8 = 0x01;
    pub(super) const CYCLE: u8 = 0x02;
    pub(super) const SHIFT: u8 = 0x03;
    pub(super) const SUPPORTED: u8 = 0x04;
    pub(super) const SHORTEST_CYCLE: u8 = 0x05;
    pub(super) const CALC_AND_COPY: u8 = 0x06;
    pub(super) const MEASURE: u8 = 0x08;
    pub(super) const DELAY: u8 = 0x09;
    pub(super) const SYNC0_CYCLE: u8 = 0x0A;
    pub(super) const EVENT_MISSED: u8 = 0x0B;
    pub(super) const CYCLE_EXCEEDED: u8 = 0x0C;
    pub(super) const SHIFT_TOO_SHORT: u8 = 0x0D;
    pub(super) const SYNC_ERROR: u8 = 0x20;
}

/// Bit of subindex 04: times are measured on demand.
const MEASURES: u64 = 1 << 14;

/// What a type needs for its work, in ns.
#[derive(Clone, Copy, Default, Debug)]
struct SyncNeeds {
    /// For everything it does in a cycle.
    cycle: u64,
    /// For getting outputs ready.
    calc_and_copy: u64,
    /// From the latch of the inputs to where they can be fetched.
    input_copy: u64,
    /// From there to the terminal.
    delay: u64,
}

/// What a pulse finds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Flow {
    /// There are outputs.
    pub(super) outputs: bool,
    /// The inputs of the last cycle were fetched.
    pub(super) inputs_fetched: bool,
    /// The device is in OP.
    pub(super) operational: bool,
}

/// The state of it.
#[derive(Debug)]
pub(super) struct Synchronisation {
    needs: SyncNeeds,
    mode: SyncMode,
    /// From one pulse to the next.
    cycle: Span,
    /// What it wrote into the cycle time itself.
    shown_cycle: u64,
    /// What stands there after power-on, for outputs and inputs: nobody has asked for that.
    default_cycles: [u64; 2],
    last_pulse: Option<Instant>,
    /// Pulses in their time, in a row.
    in_time: u32,
    /// Cycles with their outputs, in a row.
    steady: u32,
    /// When outputs came, since the last pulse.
    arrived: Option<Instant>,
    /// Outputs have come since the set-up.
    ever_arrived: bool,
    busy_until: Instant,
    misses: u32,
    /// Edges that were none of the SYNC unit, weighed like misses.
    strays: u32,
    /// How long its work takes instead of what it needs: a fault.
    takes: Option<Span>,
    drive_at: Option<Instant>,
    latch_at: Option<Instant>,
    /// Time from which latched inputs can be fetched.
    give_at: Option<Instant>,
}

/// Work of the application that is due.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub(super) struct DueWork {
    /// Outputs are driven.
    pub(super) drive: bool,
    /// Inputs are latched.
    pub(super) latch: bool,
    /// Latched inputs are put where frames fetch them.
    pub(super) give: bool,
}

fn get(dictionary: &Dictionary, index: u16, subindex: u8) -> u64 {
    dictionary.number_at(ObjectAddress::new(index, subindex))
}

fn put(dictionary: &mut Dictionary, index: u16, subindex: u8, value: u64) {
    if let Some(at) = dictionary.find(ObjectAddress::new(index, subindex)) {
        dictionary.set_number(at, value);
    }
}

/// One more, up to the end of 16 bits.
fn count(dictionary: &mut Dictionary, index: u16, subindex: u8) {
    let value = get(dictionary, index, subindex);
    put(dictionary, index, subindex, (value + 1).min(u64::from(u16::MAX)));
}

fn has(dictionary: &Dictionary, index: u16) -> bool {
    dictionary.object(ObjectIndex(index)).is_some()
}

/// The object that says how the device keeps step: that of the outputs, if there are any.
fn leading(outputs: bool) -> u16 {
    if outputs { OUTPUTS } else { INPUTS }
}

impl Synchronisation {
    /// That of a device with these objects, as they are after power-on.
    pub(super) fn new(fresh: &Dictionary) -> Self {
        let most = |subindex| {
            get(fresh, OUTPUTS, subindex).max(get(fresh, INPUTS, subindex)).min(1_000_000_000)
        };
        let needs = SyncNeeds {
            cycle: most(sub::SHORTEST_CYCLE),
            calc_and_copy: most(sub::CALC_AND_COPY),
            input_copy: get(fresh, INPUTS, sub::CALC_AND_COPY).min(1_000_000_000),
            delay: most(sub::DELAY),
        };
        Self {
            needs,
            mode: SyncMode::Frames,
            cycle: Span::ZERO,
            shown_cycle: 0,
            default_cycles: [OUTPUTS, INPUTS].map(|index| get(fresh, index, sub::CYCLE)),
            last_pulse: None,
            in_time: 0,
            steady: 0,
            arrived: None,
            ever_arrived: false,
            busy_until: Instant::ZERO,
            misses: 0,
            strays: 0,
            takes: None,
            drive_at: None,
            latch_at: None,
            give_at: None,
        }
    }

    /// The device starts: what has to be measured is not known yet.
    pub(super) fn start(&mut self, fresh: &Dictionary, dictionary: &mut Dictionary) {
        *self = Self { takes: self.takes, ..Self::new(fresh) };
        for index in [OUTPUTS, INPUTS] {
            if get(dictionary, index, sub::SUPPORTED) & MEASURES != 0 {
                for subindex in [sub::SHORTEST_CYCLE, sub::CALC_AND_COPY, sub::DELAY] {
                    put(dictionary, index, subindex, 0);
                }
            }
        }
    }

    /// Its work takes so long from now on; `None` for as long as it needs.
    pub(super) fn set_takes(&mut self, takes: Option<Span>) {
        self.takes = takes;
    }

    fn takes(&self) -> Span {
        self.takes.unwrap_or(Span::ns(self.needs.cycle))
    }

    // ---- set-up ----

    /// Finds out what to keep step with, from the objects and from what the MainDevice has switched
    /// on in the SYNC unit; the code to show when that cannot be. `unit_alone`: a unit without signals
    /// counts as off.
    pub(super) fn set_up(
        &mut self,
        dictionary: &mut Dictionary,
        outputs: bool,
        unit_alone: bool,
        pdi: &Pdi<'_>,
    ) -> Result<(), AlStatusCode> {
        const SIGNALS: u8 = 0b110;
        let activation = pdi.sync_activation();
        let activation = if unit_alone && activation & SIGNALS == 0 { 0 } else { activation };
        let leads = leading(outputs);
        let wanted = get(dictionary, leads, sub::MODE);
        let supported =
            if has(dictionary, leads) { get(dictionary, leads, sub::SUPPORTED) } else { u64::MAX };
        let mode = mode(wanted, supported, activation)?;
        let cycle = match mode {
            SyncMode::FreeRun | SyncMode::Frames => 0,
            SyncMode::Clock(signal) => self.check_cycle(dictionary, leads, signal, pdi)?,
        };
        *self = Self {
            needs: self.needs,
            takes: self.takes,
            default_cycles: self.default_cycles,
            mode,
            cycle: Span::ns(cycle),
            ..Self::new(dictionary)
        };
        if let SyncMode::Clock(signal) = mode {
            let number = match signal {
                SyncSignal::Sync0 => 2,
                SyncSignal::Sync1 => 3,
            };
            for index in [OUTPUTS, INPUTS] {
                put(dictionary, index, sub::MODE, number);
                put(dictionary, index, sub::CYCLE, cycle);
                put(
                    dictionary,
                    index,
                    sub::SYNC0_CYCLE,
                    u64::from(pdi.sync_cycle(SyncSignal::Sync0)),
                );
            }
            self.shown_cycle = cycle;
        }
        Ok(())
    }

    /// The cycle that the SYNC unit is set to, if the device can follow it.
    fn check_cycle(
        &self,
        dictionary: &Dictionary,
        leads: u16,
        signal: SyncSignal,
        pdi: &Pdi<'_>,
    ) -> Result<u64, AlStatusCode> {
        let sync0 = u64::from(pdi.sync_cycle(SyncSignal::Sync0));
        let sync1 = u64::from(pdi.sync_cycle(SyncSignal::Sync1));
        if sync0 == 0 {
            return Err(AlStatusCode::DC_INVALID_SYNC_CYCLE_TIME);
        }
        let (cycle, too_short) = match signal {
            SyncSignal::Sync0 => (sync0, AlStatusCode::DC_SYNC0_CYCLE_TIME),
            SyncSignal::Sync1 => ((sync1 / sync0 + 1) * sync0, AlStatusCode::DC_SYNC1_CYCLE_TIME),
        };
        if cycle < self.needs.cycle {
            return Err(too_short);
        }
        let written = get(dictionary, leads, sub::CYCLE);
        let own = [0, self.shown_cycle, self.default_cycles[usize::from(leads == INPUTS)]];
        if written != cycle && !own.contains(&written) {
            return Err(AlStatusCode::DC_INVALID_SYNC_CYCLE_TIME);
        }
        Ok(cycle)
    }

    // ---- the way to OP ----

    /// Whether the clock can be trusted; if not, the code to show should that not change.
    pub(super) fn readiness(&self, outputs: bool) -> Result<(), AlStatusCode> {
        let SyncMode::Clock(_) = self.mode else { return Ok(()) };
        if self.strays > MISS * STRAYS {
            Err(AlStatusCode::DC_SYNC_IO_ERROR)
        } else if self.in_time < LOCKED {
            Err(AlStatusCode::NO_SYNC_ERROR)
        } else if outputs && !self.ever_arrived {
            Err(AlStatusCode::SYNC_MANAGER_WATCHDOG)
        } else if outputs && self.steady < STEADY {
            Err(AlStatusCode::SYNCHRONIZATION_ERROR)
        } else {
            Ok(())
        }
    }

    /// Whether a signal of the clock is what the device keeps step with.
    pub(super) fn follows(&self, signal: SyncSignal) -> bool {
        self.mode == SyncMode::Clock(signal)
    }

    /// Whether inputs are taken with the frames.
    pub(super) fn samples_with_frames(&self) -> bool {
        !matches!(self.mode, SyncMode::Clock(_))
    }

    // ---- what happens ----

    /// Fresh outputs came: whether they are to be driven at once.
    pub(super) fn outputs_came(&mut self, dictionary: &mut Dictionary, pdi: &Pdi<'_>) -> bool {
        let now = pdi.now();
        self.ever_arrived = true;
        match self.mode {
            SyncMode::Clock(_) => {
                self.arrived = Some(now);
                false
            }
            SyncMode::FreeRun => {
                let set = get(dictionary, OUTPUTS, sub::CYCLE);
                let timer = if set == 0 { OWN_CYCLE.as_nanos() } else { set };
                self.drive_at = Some(now + Span::ns(timer - pdi.local_time() % timer));
                false
            }
            SyncMode::Frames if now < self.busy_until => {
                count(dictionary, OUTPUTS, sub::CYCLE_EXCEEDED);
                self.drive_at = Some(self.busy_until);
                false
            }
            SyncMode::Frames => {
                self.busy_until = now + self.takes();
                self.measure(dictionary);
                true
            }
        }
    }

    /// The signal that it keeps step with. The code to show when it cannot any more.
    pub(super) fn pulse(
        &mut self,
        now: Instant,
        dictionary: &mut Dictionary,
        flow: Flow,
    ) -> Option<AlStatusCode> {
        let cycle = self.cycle.as_nanos();
        let since = self.last_pulse.map(|last| now.since(last).as_nanos());
        if since.is_some_and(|since| since < cycle / 4) {
            self.strays = (self.strays + MISS).min(2 * MISS * STRAYS);
            let over = self.strays > MISS * STRAYS;
            return (over && flow.operational).then(|| {
                self.strays = 0;
                AlStatusCode::DC_SYNC_IO_ERROR
            });
        }
        self.strays = self.strays.saturating_sub(1);
        self.last_pulse = Some(now);
        let in_time = since.is_some_and(|since| since.abs_diff(cycle) <= cycle / 4);
        self.in_time = if in_time { self.in_time.saturating_add(1) } else { 0 };
        let leads = leading(flow.outputs);
        let mut missed = false;
        if now < self.busy_until {
            // It has not heard this one: its outputs wait for the next.
            for index in [OUTPUTS, INPUTS] {
                count(dictionary, index, sub::CYCLE_EXCEEDED);
            }
            missed = true;
        } else {
            let arrived = self.arrived.take();
            let came = if flow.outputs { arrived.is_some() } else { flow.inputs_fetched };
            self.steady = if came { self.steady.saturating_add(1) } else { 0 };
            if !came && flow.operational {
                count(dictionary, leads, sub::EVENT_MISSED);
                missed = true;
            }
            let short = |arrived: Instant| now.since(arrived).as_nanos() < self.needs.calc_and_copy;
            if flow.operational && arrived.is_some_and(short) {
                count(dictionary, leads, sub::SHIFT_TOO_SHORT);
                missed = true;
            }
            self.busy_until = now + self.takes();
            self.measure(dictionary);
            let shift = |index| Span::ns(get(dictionary, index, sub::SHIFT).min(cycle));
            let driven = now + shift(OUTPUTS) + Span::ns(self.needs.delay);
            self.drive_at = (arrived.is_some() && flow.operational).then_some(driven);
            self.latch_at = Some(now + shift(INPUTS));
        }
        for index in [OUTPUTS, INPUTS] {
            put(dictionary, index, sub::SYNC_ERROR, u64::from(missed));
        }
        self.weigh(dictionary, missed && flow.operational)
    }

    fn weigh(&mut self, dictionary: &Dictionary, missed: bool) -> Option<AlStatusCode> {
        if !missed {
            self.misses = self.misses.saturating_sub(1);
            return None;
        }
        self.misses += MISS;
        let (index, subindex) = ERROR_LIMIT;
        let limit =
            if has(dictionary, index) { get(dictionary, index, subindex) } else { DEFAULT_LIMIT };
        // 0 switches the watch off.
        let over = limit != 0 && u64::from(self.misses) > limit * u64::from(MISS);
        over.then(|| {
            self.misses = 0;
            AlStatusCode::SYNCHRONIZATION_ERROR
        })
    }

    /// Does what was asked for in subindex 08: shows what the last cycle took.
    fn measure(&self, dictionary: &mut Dictionary) {
        for index in [OUTPUTS, INPUTS] {
            let asked = get(dictionary, index, sub::MEASURE) & 1 != 0;
            if asked && get(dictionary, index, sub::SUPPORTED) & MEASURES != 0 {
                put(dictionary, index, sub::SHORTEST_CYCLE, self.takes().as_nanos());
                put(dictionary, index, sub::CALC_AND_COPY, self.needs.calc_and_copy);
                put(dictionary, index, sub::DELAY, self.needs.delay);
                put(dictionary, index, sub::MEASURE, 0);
            }
        }
    }

    /// True if the last signal was heard, and inputs are to be latched because of it.
    pub(super) fn will_latch(&self) -> bool {
        self.latch_at.is_some()
    }

    /// Takes the work that is due at `now`.
    pub(super) fn take_due(&mut self, now: Instant) -> DueWork {
        let take = |at: &mut Option<Instant>| at.take_if(|at| *at <= now);
        let drive = take(&mut self.drive_at).is_some();
        if drive && self.mode == SyncMode::Frames {
            self.busy_until = now + self.takes();
        }
        let latched = take(&mut self.latch_at);
        if let Some(latched) = latched {
            self.give_at = Some(latched + Span::ns(self.needs.input_copy));
        }
        DueWork { drive, latch: latched.is_some(), give: take(&mut self.give_at).is_some() }
    }

    /// Whether the clock has fallen silent while the device was in OP.
    pub(super) fn is_silent(&self, now: Instant) -> bool {
        self.silent_at().is_some_and(|at| at <= now)
    }

    fn silent_at(&self) -> Option<Instant> {
        let SyncMode::Clock(_) = self.mode else { return None };
        let patience = self.cycle.as_nanos() * SILENT_CYCLES + self.cycle.as_nanos() / 2;
        self.last_pulse.map(|last| last + Span::ns(patience))
    }

    /// When something is due next.
    pub(super) fn next(&self, operational: bool) -> Option<Instant> {
        let silent = self.silent_at().filter(|_| operational);
        [self.drive_at, self.latch_at, self.give_at, silent].into_iter().flatten().min()
    }
}
