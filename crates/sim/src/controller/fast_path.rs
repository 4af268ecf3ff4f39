//! Interface of a controller to the fast path of the wire: which datagrams of a frame concern it.
//!
//! On a line where nothing else happens the wire need not carry a frame past every controller: it
//! does at each only what leaves a trace there. [`FastPathInfo`] is what it must know of a controller to
//! do so; the rest is the pieces of [`Controller::process`], one by one.

use linesman_proto::port::Port;
use linesman_proto::register::{self as r, DlControl, FmmuConfig};
use linesman_proto::time::{Instant, Span};

use super::esc::Controller;
use super::pdi::Pdi;
use super::plain_read::{Answer, PlainRead};
use super::processing_unit::Header;
use crate::device::{SampleAgain, Signals};

/// Where registers end that act by themselves when they are written.
const REGISTERS_END: u16 = r::DIGITAL_OUTPUT.address.0;

/// What a controller does with frames that are not for it, and by which names it is called.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub(crate) struct FastPathInfo {
    /// Its open ports, one bit each; none without power.
    pub(crate) open: u8,
    /// It acts on frames of no concern to it: a port waits for one, or it marks those that come
    /// round; or an FMMU lets process data write registers.
    pub(crate) acts_on_all_frames: bool,
    /// It sets the bit in the source address.
    pub(crate) marks_source: bool,
    /// The device behind it samples inputs when a frame begins.
    pub(crate) samples: bool,
    /// It adds to the event field of datagrams.
    pub(crate) interrupts: bool,
    /// 0x0010.
    pub(crate) station: u16,
    /// 0x0012, while it is used.
    pub(crate) alias: Option<u16>,
    /// Changes with the FMMUs.
    pub(crate) fmmus: u32,
}

/// Until when sampling again would change nothing.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sampling(SampleAgain);

impl Default for Sampling {
    fn default() -> Self {
        Self(SampleAgain::NextFrame)
    }
}

impl Sampling {
    /// Something happened: the next frame samples.
    pub(super) fn renew(&mut self) {
        self.0 = SampleAgain::NextFrame;
    }
}

impl Controller {
    /// What the wire must know.
    pub(crate) fn fast_path_info(&self) -> FastPathInfo {
        let core = &self.core;
        let control = DlControl(core.memory.u32(&r::DL_CONTROL));
        let writes_registers =
            |config: &FmmuConfig| config.writes && config.physical_start.0 < REGISTERS_END;
        let waits_for_time =
            |port: Port| core.entries.waits[port].is_some() && core.ports.loops.is_open(port);
        FastPathInfo {
            open: if self.powered { core.ports.loops.open_bits() } else { 0 },
            acts_on_all_frames: core.ports.loops.port_zero_closes_ring()
                || core.ports.loops.waits_for_any_frame()
                || core.phys.has_actions()
                || Port::ALL.into_iter().any(waits_for_time)
                || core.fmmus.active().any(writes_registers),
            marks_source: control.destroys_foreign_frames(),
            samples: self.samples,
            interrupts: core.irq != 0,
            station: core.memory.u16(&r::STATION_ADDRESS),
            alias: control.alias_enabled().then(|| core.memory.u16(&r::STATION_ALIAS)),
            fmmus: core.fmmus.edition(),
        }
    }

    /// Logical bytes that its FMMUs map: first, and first behind.
    pub(crate) fn mapped(&self) -> impl Iterator<Item = (u64, u64)> {
        self.core.fmmus.active().map(|config| {
            let start = u64::from(config.logical_start.0);
            (start, start + u64::from(config.length))
        })
    }

    /// When something is due next that can open or close a loop.
    pub(crate) fn next_way_event(&self) -> Option<Instant> {
        let core = &self.core;
        let due = [
            core.ports.queue.next_way_at(),
            core.ports.change_at,
            core.ports.returns.map(|(at, _)| at),
            core.reset.at,
        ];
        due.into_iter().flatten().min()
    }

    /// What it adds to the event field of datagrams.
    #[inline]
    pub(crate) fn irq(&self) -> u16 {
        self.core.irq
    }

    /// A frame that did not walk came in at a port.
    #[inline]
    pub(crate) fn note_entry(&mut self, port: Port, number: u64, at: Instant, duration: Span) {
        self.core.entries.entered[port] = (number, at);
        if let Some(ends) = self.core.rx_reasons.frame_ends(port) {
            *ends = at + duration;
        }
    }

    /// Whether anything is to happen at its ports.
    #[inline]
    pub(crate) fn has_port_events(&self) -> bool {
        self.core.ports.queue.next_at().is_some()
    }

    // ---- sampling ----

    /// From when on sampling could change anything, as long as nothing happens to the controller and
    /// none of the signals changes that it listens to; [`Instant::MAX`] for never.
    #[inline]
    pub(crate) fn wants_sample(&self) -> Instant {
        if self.core.processor_stuck {
            return Instant::MAX;
        }
        match self.sampling.0 {
            SampleAgain::NextFrame => Instant::ZERO,
            SampleAgain::From(from) => from,
            SampleAgain::OnceSignalsChange => Instant::MAX,
        }
    }

    /// Whether it waits for a signal to change before it samples again.
    pub(crate) fn waits_for_signals(&self) -> bool {
        self.sampling.0 == SampleAgain::OnceSignalsChange
    }

    /// A signal has changed that it listens to.
    pub(crate) fn hear(&mut self) {
        self.sampling.renew();
    }

    /// A frame begins at `at`: the device behind samples its inputs.
    pub(crate) fn sample(&mut self, at: Instant, signals: &mut Signals) {
        let mut pdi = Pdi { core: &mut self.core, signals, now: at };
        self.firmware.sample(at, &mut pdi);
        self.sampling = Sampling(self.firmware.sample_again(&pdi));
        self.core.rescheduled = true;
    }

    // ---- a frame, piece by piece ----

    /// A good frame with datagrams for it begins to enter the processing unit.
    #[inline]
    pub(crate) fn begin(&mut self, at: Instant, number: u64) {
        self.core.begin(at, number);
    }

    /// Executes a datagram of it, and says what to add to the working counter.
    #[inline]
    pub(crate) fn execute(&mut self, header: &Header, data: &mut [u8]) -> u16 {
        header.command.map_or(0, |command| self.core.execute(command, header, data))
    }

    /// The frame ends at `end`. Says whether registers may have changed, or what is sampled.
    pub(crate) fn end(&mut self, end: Instant) -> bool {
        let irq = self.core.irq;
        let writes = !self.core.shadow.is_empty() || (self.samples && self.core.passing.wrote);
        self.core.settle(end, true);
        self.passed();
        writes || irq != self.core.irq
    }

    /// A frame has passed: what it set going is due at its time.
    pub(super) fn passed(&mut self) {
        if std::mem::take(&mut self.core.passing.wrote) {
            self.sampling.renew();
        }
        if std::mem::take(&mut self.core.rescheduled) {
            self.reschedule();
        }
    }

    /// A short read without effect of whose answer only the OR with that of others counts.
    #[inline]
    pub(crate) fn peek(&self, read: &PlainRead, gathered: &mut u64) -> Answer {
        read.peek(&self.core, gathered)
    }

    /// A read without effect.
    #[inline]
    pub(crate) fn read_plainly(&self, read: &PlainRead, out: &mut [u8], ors: bool) -> Answer {
        read.read(&self.core, out, ors)
    }
}
