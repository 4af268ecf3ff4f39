//! Analogue outputs that play several samples in each cycle.
//!
//! A buffer holds a count of cycles and the samples. A new buffer is played from its first sample on,
//! one with each SYNC0; without SYNC0, evenly over the time since the buffer before. Between samples,
//! and after the last, an output stays as it is.

use std::collections::VecDeque;

use linesman_proto::address::RegisterAddress;
use linesman_proto::time::{Instant, Span};

use crate::controller::Pdi;
use crate::device::application_layer::{ApplicationLayer, Refusal};
use crate::device::firmware::Firmware;
use crate::device::signal::{SignalId, Signals};

/// SYNC0 activation, bits 0 and 1: unit and SYNC0 are on.
const ACTIVATION: RegisterAddress = RegisterAddress(0x0981);
/// Cycle time of SYNC0 in ns, 4 bytes.
const SYNC0_CYCLE: RegisterAddress = RegisterAddress(0x09A0);
/// Samples that a buffer holds at most.
const MOST: usize = 100;

/// One output.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SampledOutput {
    /// The SyncManager that its samples come by.
    pub sync_manager: u8,
    /// The signal it drives.
    pub signal: SignalId,
}

/// All outputs of a device.
#[derive(Clone, Debug)]
pub struct Oversampling {
    channels: Vec<Playing>,
    application_layer: ApplicationLayer,
    buffer: Vec<u8>,
}

#[derive(Clone, Debug)]
struct Playing {
    output: SampledOutput,
    began: Instant,
    queue: VecDeque<(Instant, i16)>,
}

impl Oversampling {
    /// A device with these outputs.
    #[must_use]
    pub fn new(outputs: Vec<SampledOutput>) -> Self {
        let playing = |output| Playing { output, began: Instant::ZERO, queue: VecDeque::new() };
        Self {
            channels: outputs.into_iter().map(playing).collect(),
            application_layer: ApplicationLayer::default(),
            buffer: Vec::new(),
        }
    }
}

/// Time between two SYNC0, if there are any.
fn sync0_cycle(pdi: &Pdi<'_>) -> Option<Span> {
    let low = pdi.register_u16(SYNC0_CYCLE);
    let high = pdi.register_u16(RegisterAddress(SYNC0_CYCLE.0 + 2));
    let cycle = u64::from(high) << 16 | u64::from(low);
    (pdi.register(ACTIVATION) & 0b11 == 0b11 && cycle > 0).then(|| Span::ns(cycle))
}

impl Playing {
    /// Takes a new buffer, if one came.
    fn take(&mut self, now: Instant, buffer: &mut Vec<u8>, pdi: &mut Pdi<'_>) {
        let Some(manager) = pdi.sync_manager(self.output.sync_manager) else { return };
        buffer.clear();
        buffer.resize(usize::from(manager.length).min(2 + 2 * MOST), 0);
        if pdi.read_sync_manager(self.output.sync_manager, buffer).is_none() {
            return;
        }
        let (words, _) = buffer.as_chunks::<2>();
        // The first word counts cycles; nothing depends on it.
        let Some((_, samples)) = words.split_first() else { return };
        let even = now.since(self.began).as_nanos() / (samples.len().max(1) as u64);
        let between = sync0_cycle(pdi).unwrap_or(Span::ns(even));
        self.began = now;
        self.queue.clear();
        let mut at = now;
        for sample in samples {
            self.queue.push_back((at, i16::from_le_bytes(*sample)));
            at += between;
        }
    }

    /// Plays what is due, and says when there is more.
    fn play(&mut self, now: Instant, signals: &mut Signals) -> Option<Instant> {
        while let Some((at, sample)) = self.queue.front().copied() {
            if at > now {
                return Some(at);
            }
            self.queue.pop_front();
            signals.set(self.output.signal, i32::from(sample));
        }
        None
    }

    fn make_safe(&mut self, signals: &mut Signals) {
        self.queue.clear();
        signals.set(self.output.signal, 0);
    }
}

impl Firmware for Oversampling {
    fn start(&mut self, now: Instant, pdi: &mut Pdi<'_>) {
        for channel in &mut self.channels {
            channel.began = now;
            channel.make_safe(pdi.signals_mut());
        }
    }

    fn run(&mut self, now: Instant, pdi: &mut Pdi<'_>) -> Option<Instant> {
        if self.application_layer.refuses() && !pdi.emulates_device() {
            self.application_layer.serve_unchecked(pdi);
        }
        let driven = ApplicationLayer::is_operational(pdi) && !pdi.watchdog_expired();
        let mut next = None;
        for channel in &mut self.channels {
            if driven {
                channel.take(now, &mut self.buffer, pdi);
                let more = channel.play(now, pdi.signals_mut());
                next = [next, more].into_iter().flatten().min();
            } else {
                channel.make_safe(pdi.signals_mut());
            }
        }
        next
    }

    fn refuse(&mut self, refusal: Option<Refusal>) {
        self.application_layer.refuse(refusal);
    }

    fn stop(&mut self, signals: &mut Signals) {
        for channel in &mut self.channels {
            channel.make_safe(signals);
        }
    }
}
