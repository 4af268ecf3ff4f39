//! Outputs that play several samples in each cycle, and inputs that take several.
//!
//! Read first: ETG.2000, attribute `OSFac`. A buffer holds a count of cycles and the samples behind
//! it, bit behind bit. A new buffer of outputs is played from its first sample on, one with each
//! SYNC0; without SYNC0, evenly over the time since the buffer before. Between samples, and after the
//! last, an output stays as it is. Inputs are taken with each SYNC0; SYNC1, which ends a cycle, puts
//! what has come together into a buffer. Without SYNC1 that is done once the buffer is full; without
//! SYNC0 there is one sample with each frame.

use std::collections::VecDeque;

use linesman_proto::address::RegisterAddress;
use linesman_proto::time::{Instant, Span};

use crate::controller::{Pdi, SyncSignal};
use crate::device::application_layer::{ApplicationLayer, Refusal};
use crate::device::firmware::Firmware;
use crate::device::signal::{SignalId, Signals};

/// SYNC activation: bit 0 is the unit, bit 1 SYNC0, bit 2 SYNC1.
const ACTIVATION: RegisterAddress = RegisterAddress(0x0981);
const SYNC0: u8 = 0b011;
const SYNC1: u8 = 0b101;
/// Cycle time of SYNC0 in ns, 4 bytes.
const SYNC0_CYCLE: RegisterAddress = RegisterAddress(0x09A0);
/// The longest buffer that is served, in bytes: more samples in a cycle has no device.
const LONGEST: usize = 512;
/// Bits of the count of cycles, where there is one.
const COUNT_BITS: usize = 16;

/// One value of the samples of a buffer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Sampled {
    /// The signal that it drives or takes.
    pub signal: SignalId,
    /// Its place in the first sample, in bits from the beginning of the buffer.
    pub at: usize,
    /// Its bits, 1 to 32; more than one are a signed number.
    pub bits: usize,
}

/// A buffer with samples.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct SampleBuffer {
    /// The SyncManager that guards it.
    pub sync_manager: u8,
    /// From one sample to the next, in bits.
    pub stride: usize,
    /// Where the first sample begins, in bits: behind the count of cycles.
    pub first: usize,
    /// What each sample consists of.
    pub values: Vec<Sampled>,
}

impl SampleBuffer {
    /// A buffer of outputs or inputs of 16 bits behind a count of cycles.
    #[must_use]
    pub fn of_words(sync_manager: u8, signal: SignalId) -> Self {
        let value = Sampled { signal, at: COUNT_BITS, bits: 16 };
        Self { sync_manager, stride: 16, first: COUNT_BITS, values: vec![value] }
    }

    /// How many samples fit into a buffer of so many bytes.
    fn samples(&self, bytes: usize) -> usize {
        (8 * bytes).saturating_sub(self.first) / self.stride.max(1)
    }
}

/// All outputs and inputs of a device.
#[derive(Clone, Debug)]
pub struct Oversampling {
    outputs: Vec<Playing>,
    inputs: Vec<Taking>,
    application_layer: ApplicationLayer,
    buffer: Vec<u8>,
}

#[derive(Clone, Debug)]
struct Playing {
    buffer: SampleBuffer,
    began: Instant,
    /// What is played.
    bytes: Vec<u8>,
    /// When each sample is due, and which it is.
    queue: VecDeque<(Instant, usize)>,
}

#[derive(Clone, Debug)]
struct Taking {
    buffer: SampleBuffer,
    /// Cycles so far.
    count: u16,
    /// What has come together.
    bytes: Vec<u8>,
    taken: usize,
}

impl Oversampling {
    /// A device with these buffers.
    #[must_use]
    pub fn new(outputs: Vec<SampleBuffer>, inputs: Vec<SampleBuffer>) -> Self {
        let playing = |buffer| Playing {
            buffer,
            began: Instant::ZERO,
            bytes: Vec::new(),
            queue: VecDeque::new(),
        };
        let taking = |buffer| Taking { buffer, count: 0, bytes: Vec::new(), taken: 0 };
        Self {
            outputs: outputs.into_iter().map(playing).collect(),
            inputs: inputs.into_iter().map(taking).collect(),
            application_layer: ApplicationLayer::default(),
            buffer: Vec::new(),
        }
    }
}

fn is_on(pdi: &Pdi<'_>, bits: u8) -> bool {
    pdi.register(ACTIVATION) & bits == bits
}

/// Time between two SYNC0, if there are any.
fn sync0_cycle(pdi: &Pdi<'_>) -> Option<Span> {
    let low = pdi.register_u16(SYNC0_CYCLE);
    let high = pdi.register_u16(RegisterAddress(SYNC0_CYCLE.0 + 2));
    let cycle = u64::from(high) << 16 | u64::from(low);
    (is_on(pdi, SYNC0) && cycle > 0).then(|| Span::ns(cycle))
}

/// The bits from `at` on as a number, lowest first; a signed one, unless it is a single bit.
fn number(bytes: &[u8], at: usize, bits: usize) -> i32 {
    let bit = |offset: usize| {
        bytes.get((at + offset) / 8).is_some_and(|byte| byte >> ((at + offset) % 8) & 1 != 0)
    };
    let value =
        (0..bits.min(32)).fold(0u32, |value, offset| value | u32::from(bit(offset)) << offset);
    match 32usize.saturating_sub(bits) {
        0 | 31 => value as i32,
        unused => (value << unused) as i32 >> unused,
    }
}

/// Puts the lowest bits of a number where they belong, as far as there is room.
fn put_number(bytes: &mut [u8], at: usize, bits: usize, value: i32) {
    for offset in 0..bits.min(32) {
        if let Some(byte) = bytes.get_mut((at + offset) / 8) {
            let mask = 1 << ((at + offset) % 8);
            let is_one = value as u32 >> offset & 1 != 0;
            *byte = if is_one { *byte | mask } else { *byte & !mask };
        }
    }
}

/// Status of SyncManager 0: bit 0 is set when a buffer was written, until it is read (S2 2.7).
const STATUS: u16 = 0x0805;

/// Whether a buffer came since the last one was read.
fn has_come(sync_manager: u8, pdi: &Pdi<'_>) -> bool {
    pdi.register(RegisterAddress(STATUS + 8 * u16::from(sync_manager & 0x0F))) & 1 != 0
}

/// How long the buffer of a SyncManager is, as far as it is served.
fn buffer_len(sync_manager: u8, pdi: &Pdi<'_>) -> usize {
    let manager = pdi.sync_manager(sync_manager);
    manager.map_or(0, |manager| usize::from(manager.length).min(LONGEST))
}

impl Playing {
    /// Takes a new buffer, if one came.
    fn take(&mut self, now: Instant, bytes: &mut Vec<u8>, pdi: &mut Pdi<'_>) {
        if !has_come(self.buffer.sync_manager, pdi) {
            return;
        }
        bytes.clear();
        bytes.resize(buffer_len(self.buffer.sync_manager, pdi), 0);
        if pdi.read_sync_manager(self.buffer.sync_manager, bytes).is_none() {
            return;
        }
        let samples = self.buffer.samples(bytes.len());
        let even = now.since(self.began).as_nanos() / (samples.max(1) as u64);
        let between = sync0_cycle(pdi).unwrap_or(Span::ns(even));
        self.began = now;
        std::mem::swap(&mut self.bytes, bytes);
        self.queue.clear();
        let mut at = now;
        for sample in 0..samples {
            self.queue.push_back((at, sample));
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
            for value in &self.buffer.values {
                let place = value.at + sample * self.buffer.stride;
                signals.set(value.signal, number(&self.bytes, place, value.bits));
            }
        }
        None
    }

    fn make_safe(&mut self, signals: &mut Signals) {
        self.queue.clear();
        for value in &self.buffer.values {
            signals.set(value.signal, 0);
        }
    }
}

impl Taking {
    fn forget(&mut self) {
        self.bytes.clear();
        self.taken = 0;
    }

    /// Takes a sample, if there is room for it.
    fn sample(&mut self, pdi: &Pdi<'_>) {
        let len = buffer_len(self.buffer.sync_manager, pdi);
        self.bytes.resize(len, 0);
        if self.taken >= self.buffer.samples(len) {
            return;
        }
        for value in &self.buffer.values {
            let place = value.at + self.taken * self.buffer.stride;
            let taken = pdi.signals().value(value.signal);
            // A switch is on whatever its signal is, unless that is 0.
            let taken = if value.bits == 1 { i32::from(taken != 0) } else { taken };
            put_number(&mut self.bytes, place, value.bits, taken);
        }
        self.taken += 1;
    }

    fn is_full(&self) -> bool {
        self.taken > 0 && self.taken >= self.buffer.samples(self.bytes.len())
    }

    /// Hands over what has come together, with the next count.
    fn finish(&mut self, pdi: &mut Pdi<'_>) {
        if self.taken == 0 {
            return;
        }
        self.count = self.count.wrapping_add(1);
        if self.buffer.first >= COUNT_BITS {
            put_number(&mut self.bytes, 0, COUNT_BITS, i32::from(self.count));
        }
        // Less than a whole buffer is a set-up that does not fit the device.
        pdi.write_sync_manager(self.buffer.sync_manager, &self.bytes);
        self.forget();
    }
}

impl Firmware for Oversampling {
    fn start(&mut self, now: Instant, pdi: &mut Pdi<'_>) {
        for output in &mut self.outputs {
            output.began = now;
            output.make_safe(pdi.signals_mut());
        }
        for input in &mut self.inputs {
            input.count = 0;
            input.forget();
        }
    }

    fn run(&mut self, now: Instant, pdi: &mut Pdi<'_>) -> Option<Instant> {
        if self.application_layer.refuses() && !pdi.emulates_device() {
            self.application_layer.serve_unchecked(pdi);
        }
        let driven = ApplicationLayer::is_operational(pdi) && !pdi.watchdog_expired();
        let mut next = None;
        for output in &mut self.outputs {
            if driven {
                output.take(now, &mut self.buffer, pdi);
                let more = output.play(now, pdi.signals_mut());
                next = [next, more].into_iter().flatten().min();
            } else {
                output.make_safe(pdi.signals_mut());
            }
        }
        next
    }

    fn samples(&self) -> bool {
        !self.inputs.is_empty()
    }

    fn sample(&mut self, _now: Instant, pdi: &mut Pdi<'_>) {
        if is_on(pdi, SYNC0) {
            return;
        }
        for input in &mut self.inputs {
            input.forget();
            input.sample(pdi);
            input.finish(pdi);
        }
    }

    fn synchronises(&self) -> bool {
        !self.inputs.is_empty()
    }

    fn sync(&mut self, signal: SyncSignal, _now: Instant, pdi: &mut Pdi<'_>) -> Option<Instant> {
        pdi.acknowledge_sync(signal);
        let ends_with_sync1 = is_on(pdi, SYNC1);
        for input in &mut self.inputs {
            match signal {
                SyncSignal::Sync0 => {
                    input.sample(pdi);
                    if !ends_with_sync1 && input.is_full() {
                        input.finish(pdi);
                    }
                }
                SyncSignal::Sync1 => input.finish(pdi),
            }
        }
        None
    }

    fn refuse(&mut self, refusal: Option<Refusal>) {
        self.application_layer.refuse(refusal);
    }

    fn stop(&mut self, signals: &mut Signals) {
        for output in &mut self.outputs {
            output.make_safe(signals);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::controller::tests::rig::{Bench, hardware, sii};
    use linesman_proto::register::SmControl;

    const SIGNAL: SignalId = SignalId(0);

    #[test]
    fn numbers_lie_bit_behind_bit() {
        let mut bytes = [0u8; 6];
        put_number(&mut bytes, 3, 12, -2);
        assert_eq!(number(&bytes, 3, 12), -2);
        assert_eq!(bytes, [0b1111_0000, 0b0111_1111, 0, 0, 0, 0]);
        put_number(&mut bytes, 40, 32, i32::MIN + 5);
        assert_eq!(bytes[5], 5, "as far as there is room");
        assert_eq!((number(&[1], 0, 1), number(&[1], 1, 1), number(&[], 0, 16)), (1, 0, 0));
        assert_eq!(number(&[0xFF; 4], 0, 32), -1);
    }

    /// Samples of one bit behind a count, in OP, SYNC0 every 100 µs and SYNC1 every 500 µs.
    fn inputs(activation: u8) -> Bench {
        let value = Sampled { signal: SIGNAL, at: 16, bits: 1 };
        let buffer = SampleBuffer { sync_manager: 0, stride: 1, first: 16, values: vec![value] };
        let device = Oversampling::new(Vec::new(), vec![buffer]);
        let mut bench = Bench::with(hardware(), sii(true), Box::new(device));
        bench.guard(0, 0x1000, 4, SmControl::INPUTS);
        bench.write(0x0990, &1_000_000u64.to_le_bytes());
        bench.write(0x09A0, &100_000u32.to_le_bytes());
        bench.write(0x09A4, &400_000u32.to_le_bytes());
        bench.write(0x0980, &[0, activation]);
        for state in [2, 4, 8] {
            bench.write(0x0120, &[state, 0]);
        }
        bench
    }

    fn wait_until_us(bench: &mut Bench, us: u64) {
        let rest = Instant::from_nanos(us * 1_000).since(bench.now);
        bench.wait(rest);
    }

    #[test]
    fn a_cycle_of_inputs_ends_with_sync1() {
        let mut bench = inputs(0x07);
        // SYNC0 at each 100 µs, SYNC1 400 µs behind every fifth: 2,400 µs, 2,900 µs.
        for (us, high) in [(2_050, 1), (2_350, 0), (2_480, 0)] {
            wait_until_us(&mut bench, us);
            bench.signals.set(SIGNAL, high);
        }
        let first = bench.read(0x1000, 4).unwrap();
        wait_until_us(&mut bench, 2_980);
        let next = bench.read(0x1000, 4).unwrap();
        let words = |bytes: &[u8]| {
            let (words, _) = bytes.as_chunks::<2>();
            (u16::from_le_bytes(words[0]), u16::from_le_bytes(words[1]))
        };
        let ((count, bits), (next_count, next_bits)) = (words(&first), words(&next));
        assert_eq!((next_count, next_bits), (count + 1, 0));
        assert_eq!(bits.count_ones(), 3, "{bits:b}");
        assert!(bits < 1 << 5, "no more than five samples: {bits:b}");
    }

    #[test]
    fn without_sync_there_is_one_sample_with_each_frame() {
        let mut bench = inputs(0x00);
        bench.signals.set(SIGNAL, 7);
        let one = bench.read(0x1000, 4).unwrap();
        let two = bench.read(0x1000, 4).unwrap();
        assert_eq!((one[2], two[2]), (1, 1));
        assert_eq!(two[0], one[0] + 1);
    }

    #[test]
    fn outputs_play_a_sample_with_each_sync0() {
        let device = Oversampling::new(vec![SampleBuffer::of_words(0, SIGNAL)], Vec::new());
        let mut bench = Bench::with(hardware(), sii(true), Box::new(device));
        bench.guard(0, 0x1000, 8, SmControl::OUTPUTS);
        bench.write(0x09A0, &100_000u32.to_le_bytes());
        bench.write(0x0980, &[0, 0x03]);
        for state in [2, 4, 8] {
            bench.write(0x0120, &[state, 0]);
        }
        let samples = [0i16, 100, -200, 300];
        let bytes: Vec<u8> = samples.iter().flat_map(|one| one.to_le_bytes()).collect();
        bench.write(0x1000, &bytes);
        let came = bench.now;
        for (after_us, value) in [(50, 100), (150, -200), (250, 300), (900, 300)] {
            let at = came + Span::us(after_us);
            bench.wait(at.since(bench.now));
            assert_eq!(bench.signals.value(SIGNAL), value, "after {after_us} µs");
        }
        bench.write(0x0120, &[4, 0]);
        assert_eq!(bench.signals.value(SIGNAL), 0, "safe");
    }
}
