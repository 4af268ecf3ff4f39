//! Drives: the automaton and the axis of CiA 402, the telegrams of SoE.

use linesman_proto::mailbox::Message;
use linesman_proto::mailbox::coe::Message as CoeMessage;
use linesman_proto::time::Span;

use super::Device;

/// What the drive tells.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Told {
    status: u16,
    mode: i8,
    position: i32,
    velocity: i32,
    error: u16,
}

fn bytes(control: u16, mode: i8, position: i32, velocity: i32) -> Vec<u8> {
    let mut bytes = control.to_le_bytes().to_vec();
    bytes.extend([mode as u8, 0]);
    bytes.extend(position.to_le_bytes());
    bytes.extend(velocity.to_le_bytes());
    bytes
}

/// One exchange in a cycle of a millisecond.
fn cycle(device: &mut Device, control: u16, mode: i8, position: i32, velocity: i32) -> Told {
    let (inputs, wkc) = device.exchange(&bytes(control, mode, position, velocity));
    assert_eq!(wkc, 3);
    device.bench.wait(Span::us(1_000));
    let word = |at: usize| u16::from_le_bytes([inputs[at], inputs[at + 1]]);
    let double = |at: usize| i32::from_le_bytes(inputs[at..at + 4].try_into().unwrap());
    Told {
        status: word(0),
        mode: inputs[2] as i8,
        position: double(4),
        velocity: double(8),
        error: word(12),
    }
}

fn cycles(
    device: &mut Device,
    count: u32,
    control: u16,
    mode: i8,
    position: i32,
    velocity: i32,
) -> Told {
    let mut told = cycle(device, control, mode, position, velocity);
    for _ in 1..count {
        told = cycle(device, control, mode, position, velocity);
    }
    told
}

/// In OP, and through the automaton up to "operation enabled".
fn enabled(mode: i8) -> Device {
    let mut device = Device::of("CiA402");
    device.bring_up();
    for (control, state) in [(0x00, 0x40), (0x06, 0x21), (0x07, 0x23), (0x0F, 0x27)] {
        let told = cycles(&mut device, 3, control, mode, 0, 0);
        assert_eq!(told.status & 0x6F, state, "{control:#X}: {told:?}");
        assert_eq!(told.status & 0x0210, 0x0210, "voltage, and it listens");
    }
    device
}

#[test]
fn cyclic_positions_are_followed() {
    let mut device = enabled(8);
    let mut told = cycle(&mut device, 0x0F, 8, 0, 0);
    for at in 1..=500 {
        told = cycle(&mut device, 0x0F, 8, at * 100, 0);
    }
    assert_eq!((told.mode, told.error), (8, 0));
    assert!((told.velocity - 100_000).abs() < 2_000, "{told:?}");
    assert!((told.position - 49_900).abs() < 300, "{told:?}");
    let told = cycles(&mut device, 50, 0x0F, 8, 50_000, 0);
    assert_eq!((told.position, told.velocity), (50_000, 0));
    assert_eq!(told.status & 0x1000, 0x1000, "it follows");
    let [position] = device.built.outputs[..] else { panic!() };
    assert_eq!(device.bench.signals.value(position), 50_000);
}

#[test]
fn a_velocity_is_reached_with_the_acceleration_of_the_profile() {
    let mut device = enabled(3);
    // 10,000,000 inc/s² by default: 1,000,000 inc/s after 100 ms.
    let told = cycles(&mut device, 50, 0x0F, 3, 0, 1_000_000);
    assert!((450_000..=510_000).contains(&told.velocity), "{told:?}");
    let told = cycles(&mut device, 80, 0x0F, 3, 0, 1_000_000);
    assert_eq!((told.velocity, told.status & 0x0400), (1_000_000, 0x0400), "{told:?}");
    // The positive limit switch stops it, the negative direction is free.
    let limit = device.built.inputs[2];
    device.bench.signals.set(limit, 1);
    let told = cycles(&mut device, 150, 0x0F, 3, 0, 1_000_000);
    assert_eq!((told.velocity, told.status & 0x0800), (0, 0x0800), "{told:?}");
    let told = cycles(&mut device, 50, 0x0F, 3, 0, -1_000_000);
    assert!(told.velocity < -400_000, "{told:?}");
}

#[test]
fn a_set_point_is_taken_acknowledged_and_reached() {
    let mut device = enabled(1);
    let told = cycles(&mut device, 5, 0x0F, 1, 200_000, 0);
    assert_eq!((told.position, told.status & 0x1000), (0, 0), "not asked to go");
    let told = cycles(&mut device, 5, 0x1F, 1, 200_000, 0);
    assert_eq!(told.status & 0x1400, 0x1000, "taken, not there: {told:?}");
    let told = cycles(&mut device, 350, 0x0F, 1, 200_000, 0);
    assert_eq!((told.position, told.velocity), (200_000, 0));
    assert_eq!(told.status & 0x1400, 0x0400, "there, ready for another: {told:?}");
    // Back by 50,000 from there.
    cycles(&mut device, 5, 0x5F, 1, -50_000, 0);
    let told = cycles(&mut device, 350, 0x4F, 1, -50_000, 0);
    assert_eq!(told.position, 150_000);
    // Halt on the way.
    cycles(&mut device, 60, 0x1F, 1, 1_000_000, 0);
    let told = cycles(&mut device, 150, 0x11F, 1, 1_000_000, 0);
    assert!(told.velocity == 0 && told.position < 900_000, "{told:?}");
}

#[test]
fn a_quick_stop_ends_where_its_option_says() {
    for (option, end) in [(2i16, 0x40), (6, 0x07)] {
        let mut device = Device::of("CiA402");
        device.enter_preop();
        assert_eq!(device.download(0x605A, 0, &option.to_le_bytes()), Ok(()));
        device.enter_safeop();
        device.exchange(&[]);
        assert_eq!(device.request(8), (8, 0));
        for control in [0x06, 0x07, 0x0F] {
            cycles(&mut device, 3, control, 9, 0, 0);
        }
        let told = cycles(&mut device, 100, 0x0F, 9, 0, 5_000_000);
        assert_eq!(told.velocity, 5_000_000);
        // 100,000,000 inc/s²: 50 ms.
        let told = cycles(&mut device, 20, 0x0B, 9, 0, 5_000_000);
        assert_eq!(told.status & 0x6F, 0x07, "{told:?}");
        assert!((2_500_000..=3_500_000).contains(&told.velocity), "{told:?}");
        let told = cycles(&mut device, 60, 0x0B, 9, 0, 5_000_000);
        assert_eq!((told.velocity, told.status & 0x6F), (0, end), "option {option}");
    }
}

#[test]
fn an_axis_that_is_held_is_a_fault_with_code_and_emergency() {
    let mut device = enabled(8);
    let held = device.built.inputs[3];
    device.bench.signals.set(held, 1);
    let mut at = 0;
    let mut told = cycle(&mut device, 0x0F, 8, 0, 0);
    for _ in 0..100 {
        at += 5_000;
        told = cycle(&mut device, 0x0F, 8, at, 0);
    }
    // 100,000 increments after 20 ms, and 10 ms more: then a fault.
    assert_eq!((told.status & 0x4F, told.error), (0x08, 0x8611), "{told:?}");
    assert_eq!(told.position, 0);
    assert_eq!(told.status & 0x2000, 0x2000, "following error");
    let message = device.fetch().expect("an emergency");
    let message = Message::parse(&message).unwrap();
    let CoeMessage::Emergency(emergency) = CoeMessage::parse(message.data).unwrap() else {
        panic!("{message:?}");
    };
    assert_eq!((emergency.code, emergency.register.0), (0x8611, 0x21));
    assert_eq!(device.upload(0x603F, 0), Ok(vec![0x11, 0x86]));
    assert_eq!(device.upload(0x1001, 0), Ok(vec![0x21]));
    // Nothing but a rising edge of bit 7 ends it.
    device.bench.signals.set(held, 0);
    let told = cycles(&mut device, 3, 0x0F, 8, 0, 0);
    assert_eq!(told.status & 0x4F, 0x08);
    let told = cycles(&mut device, 3, 0x80, 8, 0, 0);
    assert_eq!((told.status & 0x4F, told.error), (0x40, 0));
    let message = device.fetch_soon().expect("the error is gone");
    let message = Message::parse(&message).unwrap();
    let CoeMessage::Emergency(gone) = CoeMessage::parse(message.data).unwrap() else {
        panic!("{message:?}");
    };
    assert_eq!((gone.code, gone.register.0), (0, 0));
    for control in [0x06, 0x07, 0x0F] {
        cycles(&mut device, 3, control, 8, 0, 0);
    }
    let told = cycles(&mut device, 10, 0x0F, 8, 0, 0);
    assert_eq!(told.status & 0x6F, 0x27);
}

#[test]
fn an_axis_that_loses_its_outputs_stops_and_says_why() {
    let mut device = enabled(3);
    cycles(&mut device, 150, 0x0F, 3, 0, 1_000_000);
    let [position] = device.built.outputs[..] else { panic!() };
    device.bench.wait(Span::ms(150));
    assert_eq!(device.status(), (0x14, 0x001B), "the watchdog");
    device.exchange(&[]);
    let stopped = device.bench.signals.value(position);
    device.bench.wait(Span::ms(100));
    device.exchange(&[]);
    assert_eq!(device.request(0x14), (4, 0));
    device.exchange(&[]);
    assert_eq!(device.request(8), (8, 0));
    let told = cycles(&mut device, 3, 0x0F, 3, 0, 1_000_000);
    assert_eq!((told.status & 0x4F, told.error, told.velocity), (0x08, 0x7500, 0), "{told:?}");
    assert!((told.position - stopped).abs() < 100_000, "{told:?}, stopped at {stopped}");
}

#[test]
fn homing_gives_the_axis_a_new_zero() {
    let mut device = Device::of("CiA402");
    device.enter_preop();
    assert_eq!(device.download(0x607C, 0, &1_234i32.to_le_bytes()), Ok(()));
    device.enter_safeop();
    device.exchange(&[]);
    assert_eq!(device.request(8), (8, 0));
    for control in [0x06, 0x07, 0x0F] {
        cycles(&mut device, 3, control, 3, 0, 0);
    }
    cycles(&mut device, 100, 0x0F, 3, 0, 1_000_000);
    cycles(&mut device, 150, 0x0F, 3, 0, 0);
    let told = cycles(&mut device, 3, 0x0F, 6, 0, 0);
    assert_eq!((told.mode, told.status & 0x3000), (6, 0));
    let told = cycles(&mut device, 3, 0x1F, 6, 0, 0);
    assert_eq!((told.position, told.status & 0x3000), (1_234, 0x1000), "{told:?}");
    // Method 1 is not done: an error of homing.
    assert_eq!(device.download(0x6098, 0, &[1]), Ok(()));
    cycles(&mut device, 3, 0x0F, 6, 0, 0);
    let told = cycles(&mut device, 3, 0x1F, 6, 0, 0);
    assert_eq!(told.status & 0x2000, 0x2000, "{told:?}");
}

#[test]
fn a_mapping_can_be_changed_before_safeop() {
    let mut device = Device::of("CiA402");
    device.enter_preop();
    let entry = |index: u32, bits: u32| (index << 16 | bits).to_le_bytes();
    assert!(device.download(0x1600, 1, &entry(0x6040, 16)).is_err(), "not while it is closed");
    for (subindex, value) in [
        (0, vec![0]),
        (1, entry(0x6040, 16).to_vec()),
        (2, entry(0x60FF, 32).to_vec()),
        (0, vec![2]),
    ] {
        assert_eq!(device.download(0x1600, subindex, &value), Ok(()), "{subindex}");
    }
    for manager in &mut device.profile.process {
        if manager.index == 2 {
            manager.len = 6;
        }
    }
    assert_eq!(device.download(0x6060, 0, &[9]), Ok(()));
    device.enter_safeop();
    device.exchange(&[]);
    assert_eq!(device.request(8), (8, 0));
    for control in [0x06u16, 0x07, 0x0F, 0x0F] {
        for _ in 0..20 {
            let mut outputs = control.to_le_bytes().to_vec();
            outputs.extend(2_000i32.to_le_bytes());
            device.exchange(&outputs);
            device.bench.wait(Span::ms(1));
        }
    }
    let (inputs, _) = device.exchange(&[0x0F, 0, 0xD0, 0x07, 0, 0]);
    assert_eq!(i32::from_le_bytes(inputs[8..12].try_into().unwrap()), 2_000);
}

#[test]
fn a_drive_of_soe_moves_by_its_telegrams_and_shows_its_idns() {
    let mut device = Device::of("AX5103");
    device.bring_up();
    let mut told = Vec::new();
    for control in [0x0000u16, 0x8000, 0xE000] {
        for _ in 0..200 {
            let mut outputs = control.to_le_bytes().to_vec();
            outputs.extend(262_144i32.to_le_bytes());
            (told, _) = device.exchange(&outputs);
            device.bench.wait(Span::ms(1));
        }
        let status = u16::from_le_bytes([told[0], told[1]]) >> 14;
        let expected = [(0x0000, 1), (0x8000, 2), (0xE000, 3)];
        assert!(expected.contains(&(control, status)), "{control:#X}: {status}");
    }
    // One turn per second, for 200 ms.
    let position = i32::from_le_bytes(told[2..6].try_into().unwrap());
    assert!((200_000..=212_000).contains(&position), "{position}");
    // What the application has is read by SoE: both words, position, velocity.
    let mut value = |idn: u8| idn_value(&mut device, idn);
    let now = i32::from_le_bytes(value(51).try_into().unwrap());
    assert!((position..position + 10_000).contains(&now), "{position} {now}");
    assert_eq!((value(134), value(135)), (vec![0x00, 0xE0], vec![0x00, 0xC0]));
    assert_eq!((value(36), value(40)), (262_144_u32.to_le_bytes().to_vec(), value(36)));
    // A velocity limit of a quarter of it.
    device.post(&[8, 0, 0, 0, 0, 0x05, 0x03, 0x40, 91, 0, 0, 0, 1, 0]);
    assert_eq!(device.fetch_soon().unwrap()[6..10], [0x04, 0x40, 91, 0]);
    for _ in 0..200 {
        let outputs = [&[0x00, 0xE0][..], &262_144i32.to_le_bytes()].concat();
        device.exchange(&outputs);
        device.bench.wait(Span::ms(1));
    }
    assert_eq!(idn_value(&mut device, 40), 65_536_u32.to_le_bytes());
}

/// The value of an S parameter of the drive.
fn idn_value(device: &mut Device, idn: u8) -> Vec<u8> {
    device.post(&[4, 0, 0, 0, 0, 0x05, 0x01, 0x40, idn, 0]);
    let answer = device.fetch_soon().expect("an answer");
    let message = Message::parse(&answer).unwrap();
    assert_eq!(message.data[..4], [0x02, 0x40, idn, 0]);
    message.data[4..].to_vec()
}
