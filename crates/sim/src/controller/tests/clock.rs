//! Receive times and system time.

use linesman_proto::address::{DeviceId, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::port::Port;
use linesman_proto::register::Features;
use linesman_proto::time::{Instant, Span};

use super::rig::{Bench, at, frame, hardware, sii};
use crate::controller::{Controller, LocalClock};
use crate::device::{NoFirmware, Signals};
use crate::frame::WireFrame;

fn u32_at(bench: &mut Bench, ado: u16) -> u32 {
    u32::from_le_bytes(bench.read(ado, 4).unwrap().try_into().unwrap())
}

fn u64_at(bench: &mut Bench, ado: u16) -> u64 {
    u64::from_le_bytes(bench.read(ado, 8).unwrap().try_into().unwrap())
}

/// A frame goes in by port A, out and back by B and C.
fn go_round(bench: &mut Bench, command: Command, number: u64) -> (Instant, WireFrame) {
    let mut probe = frame(&[(command, at(0, 0x0900), &[0; 4])]);
    probe.number = number;
    let start = bench.now;
    bench.controller.enters(start, Port::A, &probe);
    let _ = bench.controller.process(start + Span::ns(50), &mut probe, &mut bench.signals);
    bench.controller.enters(start + Span::ns(1_000), Port::B, &probe);
    bench.controller.enters(start + Span::ns(3_000), Port::C, &probe);
    bench.wait(Span::us(20));
    (start, probe)
}

// proves: ESC-12 partial
#[test]
fn a_frame_is_timed_at_each_port_it_enters() {
    let mut bench = Bench::new();
    for port in [Port::A, Port::B, Port::C] {
        bench.link(port, true);
    }
    bench.wait(Span::us(100));
    let (start, _) = go_round(&mut bench, Command::Bwr, 1_000);
    let local = bench.controller.local_time(start);
    assert_eq!(u32_at(&mut bench, 0x0900), local as u32);
    assert_eq!(u32_at(&mut bench, 0x0904), local as u32 + 1_000);
    assert_eq!(u32_at(&mut bench, 0x0908), local as u32 + 3_000);
    let left = u32::from_le_bytes(*b"left");
    assert_eq!(u32_at(&mut bench, 0x090C), left, "port D: what was left there");
    assert_eq!(u64_at(&mut bench, 0x0918), local + 50);
    // Frames that latch nothing change nothing; nor do ports that the next one does not pass.
    go_round(&mut bench, Command::Brd, 1_001);
    assert_eq!(u32_at(&mut bench, 0x0904), local as u32 + 1_000);
    let mut short = frame(&[(Command::Bwr, at(0, 0x0900), &[0; 4])]);
    let now = bench.now;
    let _ = bench.pass(&mut short);
    assert_eq!(u32_at(&mut bench, 0x0900), bench.controller.local_time(now) as u32);
    assert_eq!(u32_at(&mut bench, 0x0904), local as u32 + 1_000);
}

#[test]
fn a_port_entered_before_the_unit_is_timed_too() {
    // The MainDevice is plugged into port B: A is closed, the frame comes to the unit behind it.
    let mut bench = Bench::new();
    bench.link(Port::B, true);
    let mut probe = frame(&[(Command::Bwr, at(0, 0x0900), &[0; 4])]);
    probe.number = 77;
    let start = bench.now;
    bench.controller.enters(start, Port::B, &probe);
    let _ = bench.controller.process(start + Span::ns(300), &mut probe, &mut bench.signals);
    bench.wait(Span::us(10));
    let local = bench.controller.local_time(start);
    assert_eq!(u32_at(&mut bench, 0x0904), local as u32);
    assert_eq!(u64_at(&mut bench, 0x0918), local + 300);
}

/// The first generation knows no frames: ports behind take what comes next.
#[test]
fn on_a_busy_line_some_controllers_take_another_frame() {
    for (kind, next_frame) in [(0x02, true), (0x12, true), (0x11, false)] {
        let mut hardware = hardware();
        hardware.controller_type = kind;
        let mut bench = Bench::with(hardware, sii(false), Box::new(NoFirmware));
        bench.link(Port::B, true);
        let left = u32_at(&mut bench, 0x0904);
        // One frame is still out when the one that latches comes.
        let mut early = frame(&[(Command::Brd, at(0, 0), &[0])]);
        early.number = 1_000;
        let mut latch = frame(&[(Command::Bwr, at(0, 0x0900), &[0; 4])]);
        latch.number = 1_001;
        let start = bench.now;
        for (frame, after) in [(&mut early, 0), (&mut latch, 20_000)] {
            let when = start + Span::ns(after);
            bench.controller.enters(when, Port::A, frame);
            let _ = bench.controller.process(when, frame, &mut bench.signals);
        }
        bench.controller.enters(start + Span::us(30), Port::B, &early);
        let local = bench.controller.local_time(start) as u32;
        let expected = if next_frame { local + 30_000 } else { left };
        let shown = |bench: &Bench, address: u16| {
            let byte = |offset| bench.controller.register(RegisterAddress(address + offset));
            u32::from_le_bytes([byte(0), byte(1), byte(2), byte(3)])
        };
        assert_eq!(shown(&bench, 0x0904), expected, "type 0x{kind:02X}");
        bench.controller.enters(start + Span::us(50), Port::B, &latch);
        let expected = if next_frame { local + 30_000 } else { local + 50_000 };
        assert_eq!(shown(&bench, 0x0904), expected, "type 0x{kind:02X}");
        assert_eq!(shown(&bench, 0x0900), local + 20_000);
    }
}

// S2 2.15.1, 0x0904: the time of a frame "containing a BWR or FPWR to Register 0x0900".
#[test]
fn a_port_keeps_the_time_of_a_latching_frame_that_passes_unprocessed() {
    let mut bench = Bench::with(hardware(), sii(false), Box::new(NoFirmware));
    bench.link(Port::B, true);
    bench.wait(Span::us(100));
    let start = bench.now;
    let shown = |bench: &Bench, address: u16| {
        let byte = |offset| bench.controller.register(RegisterAddress(address + offset));
        u32::from_le_bytes([byte(0), byte(1), byte(2), byte(3)])
    };
    let (unit, entry) = (shown(&bench, 0x0918), shown(&bench, 0x0900));
    let mut number = 70;
    let mut enters = |bench: &mut Bench, after: Span, command: Command| {
        let mut passing = frame(&[(command, at(0, 0x0900), &[0; 4])]);
        number += 1;
        passing.number = number;
        bench.controller.enters(start + after, Port::B, &passing);
    };
    enters(&mut bench, Span::us(10), Command::Bwr);
    let local = bench.controller.local_time(start) as u32;
    assert_eq!(shown(&bench, 0x0904), local + 10_000);
    // One that only reads, and one for another station.
    for command in [Command::Brd, Command::Fpwr] {
        enters(&mut bench, Span::us(50), command);
        assert_eq!(shown(&bench, 0x0904), local + 10_000, "{command}");
    }
    assert_eq!((shown(&bench, 0x0918), shown(&bench, 0x0900)), (unit, entry));
}

#[test]
fn an_et1200_entered_from_behind_takes_the_frame_before() {
    let mut hardware = hardware();
    hardware.controller_type = 0x12;
    let mut bench = Bench::with(hardware, sii(false), Box::new(NoFirmware));
    bench.link(Port::B, true);
    bench.write(0x0936, &[1]);
    let start = bench.now;
    let mut probe = frame(&[(Command::Bwr, at(0, 0x0900), &[0; 4])]);
    probe.number = 77;
    // It passes on its way out, and is processed when it comes back.
    bench.controller.enters(start, Port::B, &probe);
    bench.controller.enters(start + Span::us(3), Port::A, &probe);
    let _ = bench.controller.process(start + Span::us(3), &mut probe, &mut bench.signals);
    bench.wait(Span::us(30));
    let local = bench.controller.local_time(start) as u32;
    assert_eq!((u32_at(&mut bench, 0x0904), u32_at(&mut bench, 0x0900)), (local, local + 3_000));
}

#[test]
fn only_some_commands_latch() {
    let table = [
        (Command::Bwr, true),
        (Command::Fpwr, true),
        (Command::Apwr, false),
        (Command::Frmw, false),
        (Command::Brw, false),
    ];
    for (command, latches) in table {
        let mut bench = Bench::new();
        bench.wait(Span::us(100));
        let adp = if command == Command::Fpwr { super::rig::STATION } else { 0 };
        let (_, wkc) = bench.exchange(command, at(adp, 0x0900), &[0xFF; 4]);
        assert_ne!(wkc, 0, "{command}");
        assert_eq!(u64_at(&mut bench, 0x0918) != 0, latches, "{command}");
        assert_ne!(u32_at(&mut bench, 0x0900), u32::MAX, "{command}: data are not stored");
    }
    // A write that does not touch the first byte.
    let mut bench = Bench::new();
    bench.wait(Span::us(100));
    bench.exchange(Command::Bwr, at(0, 0x0904), &[0; 4]);
    assert_eq!(u64_at(&mut bench, 0x0918), 0);
}

#[test]
fn system_time_is_local_time_and_offset() {
    let mut bench = Bench::new();
    bench.wait(Span::us(100));
    let local = bench.controller.local_time(bench.now);
    assert_eq!(u64_at(&mut bench, 0x0910), local);
    bench.write(0x0920, &1_000_000_000_000u64.to_le_bytes());
    bench.write(0x0928, &250u32.to_le_bytes());
    let local = bench.controller.local_time(bench.now);
    assert_eq!(u64_at(&mut bench, 0x0910), local + 1_000_000_000_000, "the delay is not in it");
    assert_eq!(u32_at(&mut bench, 0x0928), 250);
    bench.write(0x0920, &(-1_000i64).to_le_bytes());
    let local = bench.controller.local_time(bench.now);
    assert_eq!(u64_at(&mut bench, 0x0910), local - 1_000);
    // What a MainDevice writes is compared, not taken.
    assert_eq!(bench.write(0x0910, &[0; 4]), 1);
    let local = bench.controller.local_time(bench.now);
    assert_eq!(u64_at(&mut bench, 0x0910), local - 1_000);
}

#[test]
fn frmw_carries_the_time_of_one_to_all() {
    let mut bench = Bench::new();
    bench.wait(Span::us(500));
    let local = bench.controller.local_time(bench.now);
    let station = super::rig::STATION;
    let (data, wkc) = bench.exchange(Command::Frmw, at(station, 0x0910), &[0; 8]);
    assert_eq!((data, wkc), (local.to_le_bytes().to_vec(), 1));
    let (data, wkc) = bench.exchange(Command::Frmw, at(0x2222, 0x0910), &[9; 8]);
    assert_eq!((data, wkc), (vec![9; 8], 1), "the others take it");
}

#[test]
fn quartzes_differ() {
    let mut signals = Signals::default();
    let clock = LocalClock::with_ppm(5, 25.0);
    let mut controller =
        Controller::new(DeviceId(0), hardware(), clock, Box::new(NoFirmware), sii(false));
    controller.power_on_before(Instant::from_nanos(1_000), &mut signals);
    let second = Instant::from_nanos(1_000_001_000);
    assert_eq!(controller.local_time(second), 5 + 1_000_025_000);
    controller.set_drift(second, -25_000, 0, Span::ZERO);
    assert_eq!(controller.local_time(second + Span::s(1)), 5 + 2_000_000_000);
    // With a new supply it begins at 0.
    controller.power_off(second);
    controller.power_on(second + Span::ms(1));
    assert_eq!(controller.local_time(second + Span::ms(1)), 0);
}

/// As an EL1004 shows it: clocks are there, the time loop is switched off to save power.
#[test]
fn the_time_loop_is_on_when_the_sii_wants_it() {
    // 0x0141, A5 (word 5), type of controller, whether the time loop is there
    let table = [
        (0x01, 0x0000, 0x11, false),
        (0x05, 0x0000, 0x11, true),
        (0x08, 0x0000, 0x12, true),
        (0x00, 0x0100, 0x11, true),
        (0x00, 0x0000, 0x04, true),
    ];
    for (a0, a5, controller_type, there) in table {
        let mut hardware = hardware();
        hardware.controller_type = controller_type;
        let mut image = sii(false);
        image[1] = a0;
        image[10..12].copy_from_slice(&u16::to_le_bytes(a5));
        let mut bench = Bench::with(hardware, image, Box::new(NoFirmware));
        for ado in [0x0910, 0x0918, 0x0920, 0x0928, 0x0930] {
            assert_eq!(bench.read(ado, 2).is_some(), there, "0x{ado:04X}, A0 0x{a0:02X}");
        }
        assert!(bench.read(0x090C, 4).is_some(), "receive times are always there");
        assert_eq!(bench.exchange(Command::Bwr, at(0, 0x0900), &[0; 4]).1, 1);
    }
}

#[test]
fn without_clocks_there_are_no_registers() {
    let mut plain = hardware();
    plain.features = Features(plain.features).with_distributed_clocks(false).0;
    let mut bench = Bench::with(plain, sii(false), Box::new(NoFirmware));
    assert_eq!(bench.read(0x0900, 16), None);
    assert_eq!(bench.exchange(Command::Bwr, at(0, 0x0900), &[0; 4]).1, 0);
    assert_eq!(bench.read(0x0910, 8), None);

    let mut narrow = hardware();
    narrow.features = Features(narrow.features).with_clock_64_bit(false).0;
    let mut bench = Bench::with(narrow, sii(false), Box::new(NoFirmware));
    bench.write(0x0920, &[0xFF; 8]);
    assert_eq!(bench.read(0x0924, 4), None);
    bench.wait(Span::s(5));
    let local = bench.controller.local_time(bench.now);
    assert_eq!(u64_at(&mut bench, 0x0910), u64::from(local as u32 - 1));
}
