//! Devices in step with their clock, and out of it.

use linesman_proto::time::{Instant, Span};

use super::Device;

const CYCLE: Span = Span::ms(1);
const EVENT_MISSED: u8 = 0x0B;
const CYCLE_EXCEEDED: u8 = 0x0C;
const SHIFT_TOO_SHORT: u8 = 0x0D;
const SYNC_ERROR: u8 = 0x20;

/// A device whose clock is the time of the run.
struct InStep {
    device: Device,
    /// The object that leads: of the outputs, if there are any.
    index: u16,
}

impl InStep {
    /// In PREOP.
    fn new(name: &str) -> Self {
        let mut device = Device::of(name);
        device.enter_preop();
        let index = if device.built.outputs.is_empty() { 0x1C33 } else { 0x1C32 };
        Self { device, index }
    }

    /// In SAFEOP, with SYNC0 each millisecond.
    fn set_up(name: &str) -> Self {
        let mut new = Self::new(name);
        new.start_sync(CYCLE, 0, 0x03);
        new.device.enter_safeop();
        new
    }

    /// In OP.
    fn up(name: &str) -> Self {
        let mut new = Self::set_up(name);
        assert_eq!(new.request_op(700), (8, 0), "{name}");
        new
    }

    /// SYNC0 at each whole cycle of the run.
    fn start_sync(&mut self, cycle: Span, sync1: u32, activation: u8) {
        let bench = &mut self.device.bench;
        let start = (bench.now + Span::ms(2)).as_nanos().next_multiple_of(cycle.as_nanos().max(1));
        bench.write(0x0990, &start.to_le_bytes());
        bench.write(0x09A0, &(cycle.as_nanos() as u32).to_le_bytes());
        bench.write(0x09A4, &sync1.to_le_bytes());
        bench.write(0x0980, &[0x00, activation]);
    }

    /// Waits for the next time `phase` µs behind a SYNC0.
    fn wait_for(&mut self, phase: u64) {
        let cycle = CYCLE.as_nanos();
        let mut at = self.device.bench.now.as_nanos() / cycle * cycle + phase * 1_000;
        if at <= self.device.bench.now.as_nanos() {
            at += cycle;
        }
        let rest = Instant::from_nanos(at).since(self.device.bench.now);
        self.device.bench.wait(rest);
    }

    /// Cycles with an exchange, `phase` µs behind SYNC0.
    fn run(&mut self, cycles: usize, phase: u64) {
        for _ in 0..cycles {
            self.wait_for(phase);
            self.device.exchange(&[]);
        }
    }

    fn request_op(&mut self, phase: u64) -> (u16, u16) {
        self.device.bench.write(0x0120, &[8, 0]);
        self.run(60, phase);
        self.device.status()
    }

    fn shown(&mut self, subindex: u8) -> u32 {
        let bytes = self.device.upload(self.index, subindex).unwrap();
        bytes.iter().rev().fold(0, |value, byte| value << 8 | u32::from(*byte))
    }
}

// proves: SYN-04 partial: outputs and inputs of a terminal
#[test]
fn outputs_are_valid_with_sync_whenever_their_frame_came() {
    for phase in [100, 500, 900] {
        let mut outputs = InStep::up("EL4102");
        let signal = outputs.device.built.outputs[0];
        outputs.wait_for(phase);
        outputs.device.exchange(&[0x34, 0x12, 0, 0]);
        outputs.wait_for(999);
        assert_eq!(outputs.device.bench.signals.value(signal), 0, "{phase} µs");
        outputs.device.bench.wait(Span::us(1) + Span::ns(1_400));
        assert_eq!(outputs.device.bench.signals.value(signal), 0, "the delay of the terminal");
        outputs.device.bench.wait(Span::ns(200));
        assert_eq!(outputs.device.bench.signals.value(signal), 0x1234, "{phase} µs");
    }
}

// proves: SYN-03 partial: what an output does when its frame comes earlier or later
#[test]
fn with_frames_the_jitter_of_the_frames_passes_through() {
    let mut device = Device::of("EL4102");
    device.bring_up();
    let signal = device.built.outputs[0];
    for (wait, value) in [(1_000, 0x11), (700, 0x22), (1_300, 0x33)] {
        device.bench.wait(Span::us(wait));
        device.exchange(&[value, 0, 0, 0]);
        assert_eq!(device.bench.signals.value(signal), i32::from(value), "at once");
    }
}

// proves: SYN-02 partial: outputs of a terminal
#[test]
fn in_free_run_the_own_timer_decides() {
    let mut device = Device::of("EL4102");
    device.enter_preop();
    assert_eq!(device.download(0x1C32, 1, &[0, 0]), Ok(()));
    assert_eq!(device.download(0x1C32, 2, &2_000_000u32.to_le_bytes()), Ok(()));
    device.enter_safeop();
    device.exchange(&[]);
    assert_eq!(device.request(8), (8, 0));
    let signal = device.built.outputs[0];
    let timer = 2_000_000;
    let rest = timer - device.bench.now.as_nanos() % timer;
    device.bench.wait(Span::ns(rest + 300_000));
    device.exchange(&[0x55, 0, 0, 0]);
    device.bench.wait(Span::us(1_600));
    assert_eq!(device.bench.signals.value(signal), 0);
    device.bench.wait(Span::us(150));
    assert_eq!(device.bench.signals.value(signal), 0x55, "2 ms of its own clock");
}

// proves: SYN-23 partial: the device's side
#[test]
fn the_shift_moves_outputs() {
    let mut outputs = InStep::up("EL4102");
    let signal = outputs.device.built.outputs[0];
    assert_eq!(outputs.device.download(0x1C32, 3, &200_000u32.to_le_bytes()), Ok(()));
    outputs.run(3, 700);
    outputs.wait_for(700);
    outputs.device.exchange(&[0x34, 0x12, 0, 0]);
    outputs.wait_for(195);
    assert_eq!(outputs.device.bench.signals.value(signal), 0);
    outputs.wait_for(205);
    assert_eq!(outputs.device.bench.signals.value(signal), 0x1234);
}

#[test]
fn inputs_are_taken_with_sync() {
    let mut inputs = InStep::up("EL3102");
    let signal = inputs.device.built.inputs[0];
    inputs.wait_for(400);
    inputs.device.bench.signals.set(signal, 0x1111);
    inputs.wait_for(500);
    let before = inputs.device.exchange(&[]).0;
    inputs.wait_for(500);
    let behind = inputs.device.exchange(&[]).0;
    let holds = |bytes: &[u8]| bytes.windows(2).any(|word| word == [0x11, 0x11]);
    assert!(!holds(&before), "not before the next SYNC0: {before:02X?}");
    assert!(holds(&behind), "{behind:02X?}");
}

// proves: SYN-32 partial, DIA-05 partial: the device's side of the chain
#[test]
fn outputs_that_do_not_come_are_counted_and_end_in_safeop() {
    let mut outputs = InStep::up("EL4102");
    outputs.run(20, 700);
    assert_eq!((outputs.shown(EVENT_MISSED), outputs.shown(SYNC_ERROR)), (0, 0));
    // Two in a row are borne; the mailbox takes its time, so good cycles follow.
    outputs.wait_for(100);
    outputs.wait_for(100);
    outputs.wait_for(100);
    outputs.run(1, 700);
    let missed = outputs.shown(EVENT_MISSED);
    assert!((2..=3).contains(&missed), "{missed}");
    assert_eq!(outputs.device.status(), (8, 0));
    outputs.run(50, 700);
    for _ in 0..8 {
        outputs.wait_for(100);
    }
    assert_eq!(outputs.device.status(), (0x14, 0x001A));
    let (_, wkc) = outputs.device.exchange(&[]);
    assert_eq!(wkc, 0, "outputs are locked");
    assert!((5..=9).contains(&outputs.shown(EVENT_MISSED)));
    // Acknowledged, it comes back.
    assert_eq!(outputs.device.request(0x14), (4, 0));
    assert_eq!(outputs.request_op(700), (8, 0));
}

/// True if a frame `phase` µs behind SYNC0 fetches what was set before that SYNC0.
fn fetches_new_inputs(inputs: &mut InStep, phase: u64, value: i32) -> bool {
    let signal = inputs.device.built.inputs[0];
    inputs.wait_for(900);
    inputs.device.bench.signals.set(signal, value);
    inputs.wait_for(phase);
    let fetched = inputs.device.exchange(&[]).0;
    fetched.windows(2).any(|word| word == (value as u16).to_le_bytes())
}

// 0x1C33:06 is 12 µs, which the type states; ETG.1020: from the latch to where the frame can fetch them.
#[test]
fn inputs_can_be_fetched_when_they_are_copied_and_those_of_the_cycle_before_until_then() {
    for (latch_us, phase, expected) in
        [(0, 5, false), (0, 11, false), (0, 13, true), (100, 111, false), (100, 113, true)]
    {
        let mut inputs = InStep::new("EL3102");
        let shift = (latch_us * 1_000_u32).to_le_bytes();
        assert_eq!(inputs.device.download(0x1C33, 3, &shift), Ok(()));
        inputs.start_sync(CYCLE, 0, 0x03);
        inputs.device.enter_safeop();
        assert_eq!(inputs.request_op(700), (8, 0));
        for value in [0x1111, 0x2222, 0x3333] {
            let new = fetches_new_inputs(&mut inputs, phase, value);
            assert_eq!(new, expected, "latch {latch_us} µs, frame at {phase} µs, {value:04X}");
        }
        // A frame that always comes in between fetches what is a cycle older, and nobody counts an error.
        inputs.run(200, phase);
        assert_eq!(inputs.device.status(), (8, 0), "{latch_us} {phase}");
        assert_eq!(inputs.shown(EVENT_MISSED), 0, "{latch_us} {phase}");
    }
}

#[test]
fn frames_that_do_not_come_are_missed_also_where_they_came_before_the_inputs_were_copied() {
    let mut inputs = InStep::up("EL3102");
    inputs.run(50, 5);
    // The frame of this cycle was there before the next SYNC0, and none before that after it.
    for _ in 0..3 {
        inputs.wait_for(100);
    }
    assert_eq!(inputs.shown(EVENT_MISSED), 1);
}

#[test]
fn inputs_that_are_not_fetched_are_missed_as_well() {
    let mut inputs = InStep::up("EL3102");
    for _ in 0..10 {
        inputs.wait_for(100);
    }
    assert_eq!(inputs.device.status(), (0x14, 0x001A));
    assert!(inputs.shown(EVENT_MISSED) >= 5);
}

#[test]
fn frames_that_come_shortly_before_sync_are_counted() {
    let mut outputs = InStep::up("EL4102");
    // The frame itself takes 7 µs, copying 12.
    outputs.run(2, 985);
    assert!((1..=2).contains(&outputs.shown(SHIFT_TOO_SHORT)));
    outputs.run(20, 700);
    assert_eq!(outputs.device.status(), (8, 0));
    outputs.run(20, 985);
    assert_eq!(outputs.device.status(), (0x14, 0x001A));
    assert!(outputs.shown(SHIFT_TOO_SHORT) >= 5);
}

#[test]
fn work_that_takes_longer_than_the_cycle_is_counted() {
    let mut outputs = InStep::up("EL4102");
    outputs.device.bench.controller.slow_down(Some(Span::us(1_200)));
    outputs.run(12, 700);
    assert_eq!(outputs.device.status(), (0x14, 0x001A));
    assert!(outputs.shown(CYCLE_EXCEEDED) >= 3);
    outputs.device.bench.controller.slow_down(None);
    assert_eq!(outputs.device.request(0x14), (4, 0));
    assert_eq!(outputs.request_op(700), (8, 0));
}

#[test]
fn a_silent_clock_ends_in_safeop() {
    let mut outputs = InStep::up("EL4102");
    outputs.device.bench.write(0x0981, &[0x00]);
    outputs.run(2, 700);
    assert_eq!(outputs.device.status(), (8, 0));
    outputs.run(3, 700);
    assert_eq!(outputs.device.status(), (0x14, 0x002C));
}

#[test]
fn a_broken_line_to_the_processor_does_the_same() {
    let mut outputs = InStep::up("EL4102");
    outputs.device.bench.controller.cut_sync(true);
    outputs.run(8, 700);
    assert_eq!(outputs.device.status(), (0x14, 0x002C));
    outputs.device.bench.controller.cut_sync(false);
    assert_eq!(outputs.device.request(0x14), (4, 0));
    assert_eq!(outputs.request_op(700), (8, 0), "it comes back");
}

#[test]
fn a_line_to_the_processor_that_bounces_has_a_code_of_its_own() {
    let mut outputs = InStep::up("EL4102");
    outputs.device.bench.controller.bounce_sync(true);
    outputs.run(3, 700);
    assert_eq!(outputs.device.status(), (8, 0), "a few are borne");
    outputs.run(8, 700);
    assert_eq!(outputs.device.status(), (0x14, 0x0033));
    assert_eq!((outputs.shown(EVENT_MISSED), outputs.shown(CYCLE_EXCEEDED)), (0, 0));
    // It does not get to OP while that lasts.
    assert_eq!(outputs.device.request(0x14), (4, 0));
    outputs.device.bench.write(0x0120, &[8, 0]);
    outputs.run(1_200, 700);
    assert_eq!(outputs.device.status(), (0x14, 0x0033));
    outputs.device.bench.controller.bounce_sync(false);
    assert_eq!(outputs.device.request(0x14), (4, 0));
    outputs.run(20, 700);
    assert_eq!(outputs.request_op(700), (8, 0), "it comes back");
}

// proves: SYN-30 partial: the codes a device gives
#[test]
fn a_start_time_in_the_past_is_no_sync() {
    let mut outputs = InStep::new("EL4102");
    let bench = &mut outputs.device.bench;
    bench.wait(Span::ms(20));
    let past = bench.now.as_nanos() - 1_000_000;
    bench.write(0x0990, &past.to_le_bytes());
    bench.write(0x09A0, &1_000_000u32.to_le_bytes());
    bench.write(0x0980, &[0, 3]);
    outputs.device.enter_safeop();
    outputs.device.bench.write(0x0120, &[8, 0]);
    outputs.run(900, 700);
    assert_eq!(outputs.device.status(), (4, 0), "it waits for a second");
    outputs.run(200, 700);
    assert_eq!(outputs.device.status(), (0x14, 0x002D));
}

#[test]
fn what_is_switched_on_must_suit_the_device() {
    // type, cycle in µs, SYNC1 in ns, activation, 0x1C32:01 or 0x1C33:01, code at SAFEOP
    let table = [
        ("EL4102", 1_000, 0, 0x03, None, 0),
        ("EL4102", 1_000, 0, 0x01, None, 0x0030),
        ("EL4102", 1_000, 0, 0x05, None, 0x0030),
        ("EL4102", 0, 0, 0x03, None, 0x0035),
        ("EL4102", 50, 0, 0x03, None, 0x0036),
        ("EL4102", 1_000, 0, 0x00, Some(2), 0x0030),
        ("EL4102", 1_000, 1_000_000, 0x07, Some(3), 0),
        ("EL4102", 20, 30_000, 0x07, Some(3), 0x0037),
        ("EL2014", 1_000, 0, 0x03, None, 0x0030),
        ("EL3102", 1_000, 0, 0x03, Some(2), 0),
    ];
    for (name, cycle, sync1, activation, mode, code) in table {
        let mut device = InStep::new(name);
        if let Some(mode) = mode {
            assert_eq!(device.device.download(device.index, 1, &[mode, 0]), Ok(()), "{name}");
        }
        device.start_sync(Span::us(cycle), sync1, activation);
        device.device.set_up_process_data();
        let expected = if code == 0 { (4, 0) } else { (0x12, code) };
        let found = device.device.request(4);
        assert_eq!(found, expected, "{name} {cycle} µs, 0x0981 {activation:02X}, {mode:?}");
    }
}

// proves: SYN-24 partial: the device's side; SYN-22 partial: bit 14
#[test]
fn times_are_measured_on_demand() {
    let mut outputs = InStep::up("EL4102");
    assert_eq!(outputs.shown(0x04) & 0x4007, 0x4007);
    assert_eq!((outputs.shown(0x05), outputs.shown(0x06), outputs.shown(0x09)), (0, 0, 0));
    assert_eq!(outputs.device.download(0x1C32, 8, &[1, 0]), Ok(()));
    outputs.run(3, 700);
    assert_eq!(outputs.shown(0x08), 0, "done");
    assert_eq!((outputs.shown(0x05), outputs.shown(0x06)), (100_000, 12_000));
    assert_eq!(outputs.shown(0x09), 1_500);
    // One that has become slow says so.
    outputs.device.bench.controller.slow_down(Some(Span::us(400)));
    assert_eq!(outputs.device.download(0x1C32, 8, &[1, 0]), Ok(()));
    outputs.run(3, 700);
    assert_eq!(outputs.shown(0x05), 400_000);
}

// proves: SYN-21 partial: the objects are there, and what they show
#[test]
fn the_objects_show_mode_and_cycle() {
    let mut outputs = InStep::up("EL4102");
    assert_eq!(
        (outputs.shown(1), outputs.shown(2), outputs.shown(0x0A)),
        (2, 1_000_000, 1_000_000)
    );
    assert_eq!(outputs.device.upload(0x1C33, 1).unwrap(), [2, 0]);
}

#[test]
fn edges_get_the_time_of_the_signal_and_not_of_the_frame() {
    let mut device = Device::of("EL1252");
    let signal = device.built.inputs[1];
    device.bench.wait(Span::ms(3));
    let edge = device.bench.now + Span::us(123);
    device.bench.signals.at(edge).set(signal, 1);
    device.bench.wait(Span::ms(5));
    device.bench.byte(0x0000);
    let time = device.bench.controller.system_time(edge);
    let shown = device.bench.read(0x09C0, 8).unwrap();
    assert_eq!(u64::from_le_bytes(shown.try_into().unwrap()), time);
    assert_eq!(device.bench.read(0x09AE, 2).unwrap(), [0, 4], "the second input is high");
}
