//! Registers that protect, reset, identify; RAM that must be unlocked first.

use linesman_proto::command::Command;
use linesman_proto::port::Port;
use linesman_proto::register::{EscInformation, PortType};
use linesman_proto::time::Span;

use super::rig::{Bench, STATION, at, hardware, sii};
use crate::controller::{LOAD_TIME, STARTUP_DELAY};
use crate::device::NoFirmware;
use crate::hardware::PortKind;

// proves: ESC-02 partial, ESC-10 partial
#[test]
fn it_says_what_it_is() {
    let mut small = hardware();
    (small.ports.0[2], small.ports.0[3]) = (PortKind::Absent, PortKind::Absent);
    let mut bench = Bench::with(small, sii(false), Box::new(NoFirmware));
    let bytes = bench.read(0x0000, EscInformation::LEN).unwrap();
    let information = EscInformation::from_bytes(bytes.try_into().unwrap());
    assert_eq!((information.controller.0, information.build), (0x11, 2));
    assert_eq!((information.fmmus, information.sync_managers, information.ram_kb), (8, 8, 8));
    assert_eq!(information.features.0, 0x008C);
    let ports = Port::ALL.map(|port| information.ports.port(port));
    use PortType::{Ebus, Mii, NotImplemented};
    assert_eq!(ports, [Mii, Ebus, NotImplemented, NotImplemented]);
}

// proves: ESC-10 partial
#[test]
fn process_data_ram_opens_when_the_sii_is_loaded() {
    let mut bench = Bench::new();
    bench.controller.power_on(bench.now);
    assert_eq!(bench.read(0x1000, 4), None);
    assert_eq!(bench.write(0x1000, &[1; 4]), 0);
    assert_eq!(bench.word(0x0010), 0, "the station address is gone");
    assert_eq!(bench.write(0x0F80, &[1]), 1, "user RAM is open");
    assert_eq!(bench.word(0x0110) & 1, 0);
    bench.wait(STARTUP_DELAY + LOAD_TIME);
    assert_eq!(bench.word(0x0110) & 1, 1);
    assert_eq!(bench.read(0x1000, 4).unwrap(), [0; 4]);
    assert_eq!(bench.write(0x1000, &[1; 4]), 1);
}

#[test]
fn power_clears_what_was_written() {
    let mut bench = Bench::new();
    bench.write(0x0420, &[1, 0]);
    bench.write(0x0F80, &[7]);
    bench.controller.power_off(bench.now);
    bench.wait(Span::ms(10));
    bench.controller.power_on(bench.now);
    assert_eq!(bench.word(0x0010), 0);
    assert_eq!(bench.word(0x0420), 0x03E8);
    assert_eq!(bench.word(0x0400), 0x09C2);
    assert_eq!(bench.word(0x0120), 1);
    assert_eq!(bench.word(0x0130), 1);
    assert_eq!(bench.read(0x0100, 4).unwrap(), [0x01, 0x00, 0x07, 0x00]);
    assert_eq!(bench.read(0x0204, 4).unwrap(), [0x0F, 0xFF, 0xFF, 0x00]);
    assert_eq!(bench.read(0x0930, 6), None, "the time loop waits for the SII");
    bench.wait(STARTUP_DELAY + LOAD_TIME);
    assert_eq!(bench.read(0x0930, 6).unwrap(), [0x00, 0x10, 0, 0, 4, 12]);
}

#[test]
fn protected_registers_open_with_the_key_in_the_same_frame() {
    let mut bench = Bench::new();
    bench.write(0x0021, &[1]);
    assert_eq!(bench.write(0x0200, &[4, 0]), 0);
    assert_eq!(bench.write(0x0F00, &[4]), 0, "digital outputs are registers, too");
    assert_eq!(bench.write(0x0F80, &[4]), 1, "RAM is open");
    assert_eq!(bench.write(0x1000, &[4]), 1);
    assert_eq!(bench.word(0x0200), 0);
    let key = (Command::Bwr, at(0, 0x0020), &[0xAA][..]);
    let mask = (Command::Bwr, at(0, 0x0200), &[4, 0][..]);
    let answers = bench.send(&[mask, key, mask]);
    assert_eq!(answers.iter().map(|answer| answer.1).collect::<Vec<_>>(), [0, 1, 1]);
    assert_eq!(bench.word(0x0200), 4);
    assert_eq!(bench.write(0x0200, &[0, 0]), 0, "the key was for that frame");
    assert_eq!(bench.byte(0x0020), 0);
    assert_eq!(bench.write(0x0021, &[0]), 0, "nor can the lock be opened without it");
    let unlock = (Command::Bwr, at(0, 0x0021), &[0][..]);
    bench.send(&[key, unlock]);
    assert_eq!(bench.write(0x0200, &[0, 0]), 1);
}

#[test]
fn a_protected_controller_takes_nothing_without_its_key() {
    let mut bench = Bench::new();
    bench.write(0x0031, &[1]);
    for ado in [0x0010, 0x0200, 0x0F00, 0x0F80, 0x1000] {
        assert_eq!(bench.write(ado, &[4]), 0, "0x{ado:04X}");
    }
    assert!(bench.read(0x1000, 4).is_some());
    let key = (Command::Bwr, at(0, 0x0030), &[1][..]);
    for ado in [0x0200, 0x0F80, 0x1000] {
        let answers = bench.send(&[key, (Command::Bwr, at(0, ado), &[4])]);
        assert_eq!(answers[1].1, 1, "0x{ado:04X}");
    }
    assert_eq!(bench.byte(0x1000), 4);
}

#[test]
fn three_letters_in_three_frames_reset_it() {
    let mut bench = Bench::new();
    bench.link(Port::A, true);
    let write = |bench: &mut Bench, letters: &[u8]| {
        let letters: Vec<_> = letters.iter().map(|letter| [*letter]).collect();
        let datagrams: Vec<_> =
            letters.iter().map(|letter| (Command::Bwr, at(0, 0x0040), &letter[..])).collect();
        bench.send(&datagrams);
        bench.byte(0x0040)
    };
    assert_eq!(write(&mut bench, b"R"), 1);
    assert_eq!(write(&mut bench, b"X"), 0, "a wrong letter begins anew");
    assert_eq!(write(&mut bench, b"RES"), 0, "not in one frame");
    assert_eq!(write(&mut bench, b"R"), 1);
    assert_eq!(write(&mut bench, b"R"), 1);
    assert_eq!(write(&mut bench, b"E"), 2);
    assert_eq!(bench.word(0x0010), STATION);
    bench.write(0x0040, b"S");
    assert_eq!(bench.byte(0x0040), 0);
    assert_eq!(bench.word(0x0010), 0, "everything begins anew");
    assert_eq!(bench.open(), [true, false, false, false], "links are still there");
    assert_eq!(bench.read(0x1000, 1), None);
    bench.wait(STARTUP_DELAY + LOAD_TIME);
    assert_eq!(bench.word(0x0012), 0xABCD);
}
