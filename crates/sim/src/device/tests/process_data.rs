//! Process data between frames and signals.

use linesman_proto::time::Span;

use super::Device;

#[test]
fn analogue_outputs_follow_in_op_and_fall_back_with_the_watchdog() {
    let mut device = Device::of("EL4102");
    let [first, second] = device.built.outputs[..] else { panic!() };
    device.enter_preop();
    assert_eq!(device.download(0x8010, 0x13, &0x0100i16.to_le_bytes()), Ok(()));
    device.enter_safeop();
    device.exchange(&[0x34, 0x12, 0xFF, 0x7F]);
    assert_eq!(device.bench.signals.value(first), 0, "not in SAFEOP");
    assert_eq!(device.request(8), (8, 0));
    device.exchange(&[0x34, 0x12, 0xFF, 0x7F]);
    let values =
        |device: &Device| (device.bench.signals.value(first), device.bench.signals.value(second));
    assert_eq!(values(&device), (0x1234, 0x7FFF));
    // It works for 100 µs; what comes earlier waits.
    device.exchange(&[0xFF, 0xFF, 0, 0]);
    assert_eq!(values(&device), (0x1234, 0x7FFF));
    device.bench.wait(Span::us(100));
    assert_eq!(values(&device), (0, 0), "0 to 10 V has no sign");
    device.bench.wait(Span::us(100));
    device.exchange(&[0x34, 0x12, 0xFF, 0x7F]);
    device.bench.wait(Span::ms(99));
    assert_eq!(device.status(), (8, 0));
    device.bench.wait(Span::ms(2));
    assert_eq!(device.status(), (0x14, 0x001B));
    assert_eq!(values(&device), (0, 0x0100), "the default of channel 2 was set");
    let (_, wkc) = device.exchange(&[0x34, 0x12]);
    assert_eq!(wkc, 0, "locked until the error is acknowledged");
    assert_eq!(values(&device), (0, 0x0100));
    assert_eq!(device.request(0x14), (4, 0));
    let (_, wkc) = device.exchange(&[0x34, 0x12]);
    assert_eq!((wkc, values(&device)), (2, (0, 0x0100)));
    assert_eq!(device.request(8), (8, 0));
    assert_eq!(values(&device), (0x1234, 0));
    device.bench.controller.power_off(device.bench.now);
    device.bench.wait(Span::us(1));
    assert_eq!(values(&device), (0, 0));
}

#[test]
fn analogue_inputs_bring_status_and_value() {
    let mut device = Device::of("EL3104");
    let inputs = device.built.inputs.clone();
    device.enter_preop();
    // Channel 3: limit 1 is watched, at 1000. Channel 4: half the gain, and 10 more.
    assert_eq!(device.download(0x8020, 0x07, &[1]), Ok(()));
    assert_eq!(device.download(0x8020, 0x13, &1_000i16.to_le_bytes()), Ok(()));
    assert_eq!(device.download(0x8030, 0x01, &[1]), Ok(()));
    assert_eq!(device.download(0x8030, 0x12, &0x8000u32.to_le_bytes()), Ok(()));
    assert_eq!(device.download(0x8030, 0x11, &10i16.to_le_bytes()), Ok(()));
    for (signal, value) in inputs.iter().zip([-0x1234, 0x8000, 1_001, -400]) {
        device.bench.signals.set(*signal, value);
    }
    device.enter_safeop();
    device.exchange(&[]);
    assert_eq!(device.request(8), (8, 0));
    let (bytes, wkc) = device.exchange(&[]);
    assert_eq!(wkc, 1);
    let words: Vec<u16> =
        bytes.chunks(2).map(|word| u16::from_le_bytes([word[0], word[1]])).collect();
    const TOGGLE: u16 = 0x8000;
    assert_eq!(words[0] & !TOGGLE, 0);
    assert_eq!(words[1] as i16, -0x1234);
    assert_eq!(words[2] & !TOGGLE, 0x0042, "overrange and error");
    assert_eq!(words[3], 0x7FFF);
    assert_eq!(words[4] & !TOGGLE, 0x0008, "above limit 1");
    assert_eq!(words[5], 1_001);
    assert_eq!(words[7] as i16, -190);
    device.bench.wait(Span::us(600));
    let (later, _) = device.exchange(&[]);
    assert_ne!(later[1] & 0x80, bytes[1] & 0x80, "a new value toggles");
}

#[test]
fn an_input_that_nothing_drives_sees_a_slow_wave() {
    let mut device = Device::of("EL3154");
    device.bring_up();
    let mut values = Vec::new();
    for _ in 0..40 {
        let (bytes, _) = device.exchange(&[]);
        values.push(i16::from_le_bytes([bytes[2], bytes[3]]));
        device.bench.wait(Span::ms(100));
    }
    let (least, greatest) = (*values.iter().min().unwrap(), *values.iter().max().unwrap());
    assert!((0x1FFF..0x2800).contains(&least), "{least}");
    assert!((0x5800..=0x6000).contains(&greatest), "{greatest}");
}

#[test]
fn an_assignment_changes_what_is_exchanged() {
    let mut device = Device::of("EL3104");
    device.enter_preop();
    // The values alone, of channels 2 and 1.
    for (subindex, value) in [(0, &[0][..]), (1, &[0x03, 0x1A]), (2, &[0x01, 0x1A]), (0, &[2])] {
        assert_eq!(device.download(0x1C13, subindex, value), Ok(()));
    }
    device.bench.signals.set(device.built.inputs[0], 0x0102);
    device.bench.signals.set(device.built.inputs[1], 0x0304);
    device.set_up_process_data();
    assert_eq!(device.request(4), (0x12, 0x001E), "16 bytes do not fit any more");
    device.bench.write(0x081E, &[0]);
    for manager in &mut device.profile.process {
        manager.len = manager.len.min(4);
    }
    device.set_up_process_data();
    assert_eq!(device.request(0x14), (4, 0));
    let (bytes, _) = device.exchange(&[]);
    assert_eq!(bytes, [0x04, 0x03, 0x02, 0x01]);
}

#[test]
fn a_diagnosed_output_switches() {
    let mut device = Device::of("EL2014");
    device.bring_up();
    device.exchange(&[0b0101]);
    let high: Vec<bool> =
        device.built.outputs.iter().map(|signal| device.bench.signals.is_high(*signal)).collect();
    assert_eq!(high, [true, false, true, false]);
}

#[test]
fn an_axis_moves_as_it_is_told() {
    let mut device = Device::of("EL7041");
    device.bring_up();
    let [position] = device.built.outputs[..] else { panic!() };
    // Half the velocity; not enabled, then enabled.
    let velocity = 0x4000u16.to_le_bytes();
    let control = |enable: u8| [0, 0, 0, 0, enable, 0, velocity[0], velocity[1]];
    for enable in [0, 1] {
        for _ in 0..20 {
            device.exchange(&control(enable));
            device.bench.wait(Span::us(49_992));
        }
        let steps = device.bench.signals.value(position);
        if enable == 0 {
            assert_eq!(steps, 0);
        } else {
            // 32,000 microsteps per second; the last 50 ms are not shown yet.
            assert!((30_000..=32_100).contains(&steps), "{steps}");
        }
    }
    let (inputs, _) = device.exchange(&control(1));
    let counter = u16::from_le_bytes([inputs[2], inputs[3]]);
    assert!(counter > 31_000, "{counter}");
    assert_eq!(inputs[6] & 0b0001_0011, 0b0001_0011, "ready, moving forward");
    // The counter is set to 500, and the axis stands.
    device.exchange(&[4, 0, 0xF4, 0x01, 0, 0, 0, 0]);
    device.bench.wait(Span::ms(1));
    let (inputs, _) = device.exchange(&[0; 8]);
    assert_eq!(u16::from_le_bytes([inputs[2], inputs[3]]), 500);
}
