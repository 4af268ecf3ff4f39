//! A device without a processor: digital inputs and outputs that the controller drives itself.
//!
//! Read first: S1 and the ET1100 data sheet, section III, digital I/O interface. AL status follows
//! AL control (device emulation); outputs follow their bytes at the end of each frame while the
//! device is in OP and the process data watchdog has not expired; inputs are taken when a frame
//! begins.

use linesman_proto::address::RegisterAddress;
use linesman_proto::register::{DIGITAL_OUTPUT, SyncManagerConfig};
use linesman_proto::time::Instant;

use super::application::time_stamp::TimeStamps;
use super::application_layer::{ApplicationLayer, Refusal};
use super::firmware::{Firmware, SampleAgain};
use super::signal::{SignalId, Signals};
use crate::controller::Pdi;

/// A run of digital channels: where their bits lie and which signals they are.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct DigitalArea {
    /// The SyncManager that guards the bytes.
    pub sync_manager: u8,
    /// The first byte: 0x0F00 to 0x0F03 for output registers, or process-data RAM.
    pub at: RegisterAddress,
    /// The signal of each channel, from bit 0 of the first byte up.
    pub signals: Vec<SignalId>,
}

impl DigitalArea {
    fn len(&self) -> usize {
        self.signals.len().div_ceil(8)
    }
}

/// A word that is taken as a whole, such as a coding switch.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct WordArea {
    /// The SyncManager that guards it.
    pub sync_manager: u8,
    /// Where it lies in process-data RAM, two bytes.
    pub at: RegisterAddress,
    /// Its value: the low 16 bits of the signal.
    pub signal: SignalId,
}

/// A device without a processor.
#[derive(Clone, Default, Debug)]
pub struct Emulated {
    outputs: Vec<DigitalArea>,
    inputs: Vec<DigitalArea>,
    words: Vec<WordArea>,
    time_stamps: TimeStamps,
    /// The word of them that tells its identification.
    coding_switch: Option<SignalId>,
    application_layer: ApplicationLayer,
    /// The bytes of one area, kept for its memory.
    bytes: Vec<u8>,
}

impl Emulated {
    /// A device with these channels.
    #[must_use]
    pub fn new(outputs: Vec<DigitalArea>, inputs: Vec<DigitalArea>) -> Self {
        let longest = outputs.iter().chain(&inputs).map(DigitalArea::len).max().unwrap_or(0);
        Self { outputs, inputs, bytes: vec![0; longest], ..Self::default() }
    }

    /// The same device with words that it takes.
    #[must_use]
    pub fn with_words(self, words: Vec<WordArea>) -> Self {
        Self { words, ..self }
    }

    /// The same device with edges that get a time.
    #[must_use]
    pub fn with_time_stamps(self, time_stamps: TimeStamps) -> Self {
        Self { time_stamps, ..self }
    }

    /// The same device with a switch that sets its identification: one of its words.
    #[must_use]
    pub fn with_coding_switch(self, word: SignalId) -> Self {
        Self { coding_switch: Some(word), ..self }
    }

    fn drive_outputs(&mut self, pdi: &mut Pdi<'_>) {
        let expired = pdi.watchdog_expired();
        let operational = ApplicationLayer::is_operational(pdi);
        for area in &self.outputs {
            let bytes = &mut self.bytes[..area.len()];
            let guard = pdi.sync_manager(area.sync_manager);
            let watched = guard.is_some_and(|guard| guard.control.watchdog());
            let driven = operational && !(watched && expired) && fetch(area, guard, bytes, pdi);
            for (channel, signal) in area.signals.iter().enumerate() {
                let high = driven && bytes[channel / 8] >> (channel % 8) & 1 != 0;
                pdi.signals_mut().set(*signal, i32::from(high));
            }
        }
    }
}

impl Firmware for Emulated {
    fn start(&mut self, _now: Instant, pdi: &mut Pdi<'_>) {
        self.drive_outputs(pdi);
    }

    fn run(&mut self, _now: Instant, pdi: &mut Pdi<'_>) -> Option<Instant> {
        if self.application_layer.refuses() && !pdi.emulates_device() {
            self.application_layer.serve_unchecked(pdi);
        }
        self.drive_outputs(pdi);
        None
    }

    fn refuse(&mut self, refusal: Option<Refusal>) {
        self.application_layer.refuse(refusal);
    }

    fn samples(&self) -> bool {
        !self.inputs.is_empty() || !self.words.is_empty()
    }

    fn sample(&mut self, now: Instant, pdi: &mut Pdi<'_>) {
        self.time_stamps.sample(now, pdi);
        for area in &self.inputs {
            let bytes = &mut self.bytes[..area.len()];
            bytes.fill(0);
            for (channel, signal) in area.signals.iter().enumerate() {
                bytes[channel / 8] |= u8::from(pdi.signals().is_high(*signal)) << (channel % 8);
            }
            put(area.sync_manager, area.at, bytes, pdi);
        }
        for word in &self.words {
            let value = pdi.signals().value(word.signal) as u16;
            put(word.sync_manager, word.at, &value.to_le_bytes(), pdi);
        }
    }

    /// Bytes that are simply put in place are there until a signal changes; a buffer that is written
    /// takes turns each time.
    fn sample_again(&self, pdi: &Pdi<'_>) -> SampleAgain {
        let areas = self.inputs.iter().map(|area| area.sync_manager);
        let mut guards = areas.chain(self.words.iter().map(|word| word.sync_manager));
        let buffered = |index| pdi.sync_manager(index).is_some_and(|guard| is_buffered(&guard));
        if guards.any(buffered) { SampleAgain::NextFrame } else { SampleAgain::OnceSignalsChange }
    }

    fn listens_to(&self) -> Vec<SignalId> {
        let inputs = self.inputs.iter().flat_map(|area| &area.signals).copied();
        let stamped = self.time_stamps.signals();
        inputs.chain(self.words.iter().map(|word| word.signal)).chain(stamped).collect()
    }

    fn identify(&mut self, id: u16, signals: &mut Signals) -> bool {
        if let Some(signal) = self.coding_switch {
            signals.set(signal, i32::from(id));
        }
        self.coding_switch.is_some()
    }

    fn stop(&mut self, signals: &mut Signals) {
        for signal in self.outputs.iter().flat_map(|area| &area.signals) {
            signals.set(*signal, 0);
        }
    }
}

/// Whether accesses go through buffers: not for a SyncManager that is off, or of one byte.
fn is_buffered(guard: &SyncManagerConfig) -> bool {
    guard.is_active() && guard.length > 1
}

/// Puts input bytes where they belong.
fn put(sync_manager: u8, at: RegisterAddress, bytes: &[u8], pdi: &mut Pdi<'_>) {
    let guard = pdi.sync_manager(sync_manager);
    if guard.is_some_and(|guard| is_buffered(&guard)) {
        // Less than a whole buffer is a set-up that does not fit the device.
        pdi.write_sync_manager(sync_manager, bytes);
    } else {
        pdi.put_ram(at, bytes);
    }
}

/// Fetches the output bytes; false when none have come yet.
fn fetch(
    area: &DigitalArea,
    guard: Option<SyncManagerConfig>,
    bytes: &mut [u8],
    pdi: &mut Pdi<'_>,
) -> bool {
    if guard.is_some_and(|guard| is_buffered(&guard)) {
        return pdi.read_sync_manager(area.sync_manager, bytes).is_some();
    }
    if let Some(offset) = area.at.0.checked_sub(DIGITAL_OUTPUT.address.0)
        && offset < DIGITAL_OUTPUT.len
    {
        let outputs = pdi.digital_outputs().to_le_bytes();
        let outputs = &outputs[usize::from(offset)..];
        let len = bytes.len().min(outputs.len());
        bytes[..len].copy_from_slice(&outputs[..len]);
        return true;
    }
    let end = area.at.0.saturating_add(bytes.len() as u16);
    let ram = pdi.ram(area.at.0..end);
    bytes[..ram.len()].copy_from_slice(ram);
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::controller::tests::rig::{Bench, hardware, sii};
    use linesman_proto::register::SmControl;
    use linesman_proto::state::{AlState, AlStatusCode};
    use linesman_proto::time::Span;

    fn area(sync_manager: u8, at: u16, first: u32, count: u32) -> DigitalArea {
        let signals = (first..first + count).map(SignalId).collect();
        DigitalArea { sync_manager, at: RegisterAddress(at), signals }
    }

    fn bench(outputs: Vec<DigitalArea>, inputs: Vec<DigitalArea>) -> Bench {
        Bench::with(hardware(), sii(true), Box::new(Emulated::new(outputs, inputs)))
    }

    fn high(bench: &Bench) -> u16 {
        (0..16).fold(0, |bits, signal| {
            bits | u16::from(bench.signals.is_high(SignalId(signal))) << signal
        })
    }

    #[test]
    fn eight_outputs_follow_their_register_in_op() {
        let mut bench = bench(vec![area(0, 0x0F00, 0, 8)], vec![]);
        bench.guard(0, 0x0F00, 1, SmControl::OUTPUTS_WITHOUT_EVENT);
        bench.write(0x0F00, &[0xA5]);
        assert_eq!(high(&bench), 0, "not in INIT");
        for state in [2, 4] {
            bench.write(0x0120, &[state, 0]);
            assert_eq!(high(&bench), 0);
        }
        bench.write(0x0120, &[8, 0]);
        assert_eq!(high(&bench), 0xA5);
        bench.write(0x0F00, &[0x0F]);
        assert_eq!(high(&bench), 0x0F);
        bench.wait(Span::ms(101));
        assert_eq!(high(&bench), 0, "the watchdog");
        bench.write(0x0F00, &[0x33]);
        assert_eq!(high(&bench), 0x33);
        bench.write(0x0120, &[4, 0]);
        assert_eq!(high(&bench), 0);
        bench.write(0x0120, &[8, 0]);
        assert_eq!(high(&bench), 0x33);
        bench.controller.power_off(bench.now);
        bench.wait(Span::us(1));
        assert_eq!(high(&bench), 0, "no supply");
    }

    #[test]
    fn sixteen_outputs_come_through_two_registers_or_a_buffer() {
        let two = vec![area(0, 0x0F00, 0, 8), area(1, 0x0F01, 8, 8)];
        let mut split = bench(two, vec![]);
        split.guard(0, 0x0F00, 1, SmControl::OUTPUTS_WITHOUT_EVENT);
        split.guard(1, 0x0F01, 1, SmControl::OUTPUTS_WITHOUT_EVENT);
        split.write(0x0120, &[8, 0]);
        split.write(0x0F00, &[0x34, 0x12]);
        assert_eq!(high(&split), 0x1234);

        let mut buffered = bench(vec![area(0, 0x1000, 0, 16)], vec![]);
        buffered.guard(0, 0x1000, 2, SmControl::OUTPUTS);
        buffered.write(0x0120, &[8, 0]);
        assert_eq!(high(&buffered), 0, "nothing came yet");
        buffered.write(0x1000, &[0x34]);
        assert_eq!(high(&buffered), 0, "half of it");
        buffered.write(0x1001, &[0x12]);
        assert_eq!(high(&buffered), 0x1234);
    }

    #[test]
    fn inputs_are_taken_when_a_frame_begins() {
        let inputs = vec![area(0, 0x1000, 0, 4), area(1, 0x1010, 4, 12)];
        let mut bench = bench(vec![], inputs);
        bench.guard(0, 0x1000, 1, SmControl::INPUTS_WITHOUT_EVENT);
        bench.guard(1, 0x1010, 2, SmControl::INPUTS_WITHOUT_EVENT);
        for (signal, value) in [(0, 1), (2, -7), (4, 1), (15, 1)] {
            bench.signals.set(SignalId(signal), value);
        }
        assert_eq!(bench.byte(0x1000), 0b0101);
        assert_eq!(bench.word(0x1010), 1 | 1 << 11);
        bench.signals.set(SignalId(0), 0);
        assert_eq!(bench.byte(0x1000), 0b0100);
        // Before anything is set up the bits lie in the RAM all the same.
        bench.write(0x0806, &[0]);
        assert_eq!(bench.byte(0x1000), 0b0100);
    }

    #[test]
    fn told_to_refuse_a_step_it_answers_as_a_device_with_a_processor() {
        let mut bench = bench(vec![area(0, 0x0F00, 0, 8)], vec![]);
        bench.write(0x0120, &[2, 0]);
        let refusal = Refusal {
            transition_to: AlState::SafeOp,
            code: AlStatusCode::INVALID_SYNC_MANAGER,
            times: None,
        };
        bench.controller.refuse(bench.now, Some(refusal));
        bench.write(0x0120, &[4, 0]);
        assert_eq!((bench.word(0x0130), bench.word(0x0134)), (0x12, 0x0017));
        assert_eq!(bench.byte(0x0141) & 1, 1, "it says that it emulates the device all the same");
        bench.write(0x0120, &[4, 0]);
        assert_eq!(bench.word(0x0130), 0x12, "not heard without acknowledgement");
        bench.write(0x0120, &[0x12, 0]);
        assert_eq!((bench.word(0x0130), bench.word(0x0134)), (2, 0));
        bench.write(0x0120, &[4, 0]);
        bench.write(0x0120, &[1, 0]);
        assert_eq!(bench.word(0x0130), 1, "INIT is always heard");
        bench.controller.refuse(bench.now, None);
        for state in [2, 4, 8] {
            bench.write(0x0120, &[state, 0]);
            assert_eq!(bench.word(0x0130), u16::from(state));
        }
    }

    #[test]
    fn a_coding_switch_is_a_word_in_the_ram() {
        let word = WordArea { sync_manager: 0, at: RegisterAddress(0x1000), signal: SignalId(3) };
        let emulated = Emulated::default().with_words(vec![word]);
        let mut bench = Bench::with(hardware(), sii(true), Box::new(emulated));
        bench.signals.set(SignalId(3), 0x1234);
        assert_eq!(bench.word(0x1000), 0x1234);
    }

    #[test]
    fn a_set_up_that_does_not_fit_breaks_nothing() {
        let mut bench = bench(vec![area(0, 0x0F03, 0, 16)], vec![area(1, 0xFFFF, 0, 16)]);
        bench.guard(0, 0x1000, 1, SmControl::OUTPUTS);
        bench.guard(1, 0x1000, 1, SmControl::INPUTS);
        bench.write(0x0120, &[8, 0]);
        bench.write(0x0F03, &[0xFF]);
        bench.write(0x1000, &[0xFF]);
        assert_eq!(high(&bench), 0x00FF, "the bits there are");
    }
}
