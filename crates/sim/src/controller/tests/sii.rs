//! The SII interface: ownership, read, write, reload, and what happens when the EEPROM is blank,
//! missing or busy.

use linesman_proto::command::Command;
use linesman_proto::register::{SiiCommand, SiiControl};
use linesman_proto::time::Span;

use super::rig::{Bench, STATION, at, hardware, sii};
use crate::controller::{LOAD_TIME, PROGRAMMING_TIME, READ_TIME, STARTUP_DELAY, WRITE_TIME};
use crate::device::NoFirmware;
use crate::hardware::Hardware;

fn bench(hardware: Hardware, image: Vec<u8>) -> Bench {
    Bench::with(hardware, image, Box::new(NoFirmware))
}

fn control(bench: &mut Bench) -> SiiControl {
    SiiControl(bench.word(0x0502))
}

/// Control and address in one datagram of six bytes.
fn start(bench: &mut Bench, command: SiiCommand, word: u32) -> u16 {
    let mut bytes = SiiControl::start(command).to_bytes().to_vec();
    bytes.extend(word.to_le_bytes());
    bench.exchange(Command::Fpwr, at(STATION, 0x0502), &bytes).1
}

fn read(bench: &mut Bench, word: u32) -> Vec<u8> {
    assert_eq!(start(bench, SiiCommand::Read, word), 1);
    bench.wait(Span::ms(1));
    assert!(!control(bench).busy());
    bench.read(0x0508, 8).unwrap()
}

fn write(bench: &mut Bench, word: u32, value: u16) {
    let mut bytes = SiiControl::start(SiiCommand::Write).to_bytes().to_vec();
    bytes.extend(word.to_le_bytes());
    bytes.extend(value.to_le_bytes());
    assert_eq!(bench.write(0x0502, &bytes), 1);
}

#[test]
fn reading_takes_its_time_and_brings_four_words() {
    let mut bench = bench(hardware(), sii(false));
    assert_eq!(control(&mut bench), SiiControl(0x0040));
    assert_eq!(start(&mut bench, SiiCommand::Read, 8), 1);
    assert_eq!(control(&mut bench), SiiControl(0x8140));
    assert_eq!(start(&mut bench, SiiCommand::Read, 0), 0, "busy");
    assert_eq!(bench.write(0x0508, &[1, 2]), 0);
    bench.wait(READ_TIME);
    assert_eq!(control(&mut bench), SiiControl(0x0040));
    assert_eq!(bench.read(0x0508, 8).unwrap(), [8, 0, 9, 0, 10, 0, 11, 0]);
    assert_eq!(bench.read(0x0504, 4).unwrap(), [8, 0, 0, 0]);
}

#[test]
fn some_controllers_bring_two_words() {
    let mut hardware = hardware();
    hardware.controller_type = 0x04;
    let mut bench = bench(hardware, sii(false));
    assert!(!control(&mut bench).reads_eight_bytes());
    assert_eq!(read(&mut bench, 10), [10, 0, 11, 0, 0, 0, 0, 0]);
}

#[test]
fn address_and_command_may_come_apart() {
    let mut bench = bench(hardware(), sii(false));
    assert_eq!(bench.write(0x0504, &[12, 0]), 1);
    assert_eq!(bench.write(0x0503, &[1]), 1);
    bench.wait(Span::ms(1));
    assert_eq!(bench.read(0x0508, 4).unwrap(), [12, 0, 13, 0]);
}

#[test]
fn behind_the_image_the_eeprom_is_blank() {
    let mut bench = bench(hardware(), sii(false));
    assert_eq!(read(&mut bench, 14), [14, 0, 15, 0, 0xFF, 0xFF, 0xFF, 0xFF]);
}

#[test]
fn a_write_needs_its_enable_in_the_same_frame() {
    let mut bench = bench(hardware(), sii(false));
    let without = [0, 2, 9, 0, 0, 0, 0x34, 0x12];
    bench.write(0x0502, &without);
    assert!(control(&mut bench).write_enable_error() && !control(&mut bench).busy());
    bench.write(0x0502, &[0, 0]);
    assert_eq!(control(&mut bench), SiiControl(0x0040), "cleared");
    bench.write(0x0502, &[1]);
    bench.write(0x0502, &without);
    assert!(control(&mut bench).write_enable_error(), "it was another frame");

    write(&mut bench, 9, 0x1234);
    assert!(control(&mut bench).busy() && !control(&mut bench).write_enable_error());
    bench.wait(WRITE_TIME + PROGRAMMING_TIME);
    assert_eq!(read(&mut bench, 8)[..4], [8, 0, 0x34, 0x12]);
    assert_eq!(bench.controller.sii()[18..20], [0x34, 0x12]);

    let enable = (Command::Bwr, at(0, 0x0502), &[1][..]);
    bench.send(&[enable, (Command::Bwr, at(0, 0x0503), &[2])]);
    assert!(control(&mut bench).busy(), "two datagrams of one frame");
}

#[test]
fn a_busy_eeprom_does_not_answer() {
    let mut bench = bench(hardware(), sii(false));
    write(&mut bench, 9, 1);
    bench.wait(Span::ms(1));
    assert!(!control(&mut bench).busy());
    write(&mut bench, 10, 2);
    bench.wait(Span::ms(1));
    assert!(control(&mut bench).acknowledge_error());
    bench.wait(PROGRAMMING_TIME);
    write(&mut bench, 10, 2);
    assert!(!control(&mut bench).acknowledge_error(), "a valid command clears it");
    bench.wait(Span::ms(10));
    assert_eq!(read(&mut bench, 9)[..4], [1, 0, 2, 0]);
}

#[test]
fn commands_that_are_none_are_refused() {
    let mut bench = bench(hardware(), sii(false));
    for command in [3, 5, 6, 7] {
        bench.write(0x0502, &[0, command]);
        assert_eq!(control(&mut bench), SiiControl(0x2040));
        bench.write(0x0502, &[0, 0]);
        assert_eq!(control(&mut bench), SiiControl(0x0040));
    }
}

#[test]
fn the_side_that_has_it_uses_it() {
    let mut bench = bench(hardware(), sii(false));
    bench.write(0x0500, &[1]);
    assert!(bench.pdi(|pdi| pdi.sii_offered()));
    assert_eq!(start(&mut bench, SiiCommand::Read, 8), 0);
    assert!(bench.read(0x0502, 2).is_some(), "it can be looked at");
    bench.write(0x0500, &[2]);
    bench.write(0x0500, &[0]);
    assert!(!bench.pdi(|pdi| pdi.sii_offered()));
    assert_eq!(read(&mut bench, 8)[0], 8);
}

#[test]
fn the_configuration_area_goes_to_its_registers() {
    let mut image = sii(true);
    image[..14].copy_from_slice(&[
        0x08, 0x01, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88, 0x99, 0xAA, 0xBB, 0, 0,
    ]);
    let mut hardware = hardware();
    hardware.features |= 0x0060;
    let mut bench = bench(hardware, image);
    assert_eq!(bench.read(0x0140, 2).unwrap(), [0x08, 0x01]);
    assert_eq!(bench.read(0x0150, 4).unwrap(), [0x22, 0x33, 0x66, 0x77]);
    assert_eq!(bench.word(0x0012), 0x9988);
    assert_eq!(bench.word(0x0142), 0xBBAA);

    // Reloaded, the alias and link detection stay as they were.
    write(&mut bench, 4, 0x1111);
    bench.wait(Span::ms(10));
    write(&mut bench, 0, 0xFF05);
    bench.wait(Span::ms(10));
    assert_eq!(start(&mut bench, SiiCommand::Reload, 0), 1);
    assert!(bench.read(0x1000, 1).is_some(), "RAM stays open");
    bench.wait(LOAD_TIME);
    assert_eq!(bench.read(0x0140, 2).unwrap(), [0x05, 0x0D]);
    assert_eq!(bench.word(0x0012), 0x9988);
    bench.controller.power_on(bench.now);
    bench.wait(STARTUP_DELAY + LOAD_TIME);
    assert_eq!(bench.read(0x0140, 2).unwrap(), [0x05, 0xFF]);
    assert_eq!(bench.word(0x0012), 0x1111);
    assert_eq!(bench.word(0x0110) & 4, 4, "enhanced link detection is on");
}

#[test]
fn a_wrong_checksum_leaves_the_ram_closed() {
    let mut image = sii(false);
    image[14..16].copy_from_slice(&[0x12, 0x00]);
    for image in [image, vec![0xFF; 64]] {
        let mut bench = bench(hardware(), image);
        let control = control(&mut bench);
        assert!(control.checksum_error() && control.not_loaded() && !control.busy());
        assert!(!bench.pdi(|pdi| pdi.sii_load_ok()));
        assert_eq!(bench.read(0x1000, 1), None);
        assert_eq!(bench.word(0x0110) & 1, 0);
        assert_eq!(bench.word(0x0012), 0);
        // Repaired over EtherCAT and reloaded, it works.
        write(&mut bench, 7, 0x88A4);
        bench.wait(Span::ms(10));
        start(&mut bench, SiiCommand::Reload, 0);
        bench.wait(Span::ms(2));
        assert_eq!(super::sii::control(&mut bench), SiiControl(0x0040));
        assert!(bench.read(0x1000, 1).is_some());
    }
}

#[test]
fn a_failed_reload_keeps_what_was_loaded() {
    let mut bench = bench(hardware(), sii(false));
    write(&mut bench, 7, 0x0000);
    bench.wait(Span::ms(10));
    start(&mut bench, SiiCommand::Reload, 0);
    bench.wait(LOAD_TIME + LOAD_TIME);
    let control = control(&mut bench);
    assert!(control.checksum_error() && !control.not_loaded());
    assert_eq!(bench.word(0x0110) & 1, 1);
    assert!(bench.read(0x1000, 1).is_some());
}

#[test]
fn a_missing_eeprom_acknowledges_nothing() {
    let mut bench = bench(hardware(), Vec::new());
    let state = control(&mut bench);
    assert!(state.acknowledge_error() && state.not_loaded() && !state.checksum_error());
    start(&mut bench, SiiCommand::Read, 0);
    bench.wait(Span::ms(1));
    assert!(control(&mut bench).acknowledge_error());
}

#[test]
fn loading_after_power_on_is_tried_twice() {
    let mut bench = bench(hardware(), vec![0; 16]);
    bench.controller.power_on(bench.now);
    assert!(control(&mut bench).busy() && control(&mut bench).not_loaded());
    bench.wait(STARTUP_DELAY + LOAD_TIME);
    assert!(control(&mut bench).busy(), "the second try");
    bench.wait(LOAD_TIME);
    assert!(!control(&mut bench).busy() && control(&mut bench).checksum_error());
}

/// Images of real devices load and read back through the interface.
#[test]
#[allow(clippy::disallowed_methods, clippy::disallowed_macros)]
fn images_of_real_devices() {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    let data = std::env::var("LINESMAN_DATA").unwrap_or(format!("{root}/../shared/data"));
    let mut seen = 0;
    for name in ["ec-EK1100", "ec-EL2004", "ec-EL2828", "dls-NI9144-rev1"] {
        let Ok(image) = std::fs::read(format!("{data}/sii/{name}.bin")) else { continue };
        seen += 1;
        let mut bench = bench(hardware(), image.clone());
        assert!(!control(&mut bench).not_loaded(), "{name}");
        assert_eq!(bench.read(0x0140, 2).unwrap(), image[..2], "{name}");
        for word in (0..image.len() / 2).step_by(4).take(64) {
            let expected: Vec<u8> =
                (0..8).map(|byte| *image.get(word * 2 + byte).unwrap_or(&0xFF)).collect();
            assert_eq!(read(&mut bench, word as u32), expected, "{name}, word {word}");
        }
    }
    if seen == 0 {
        eprintln!("SKIPPED: no SII images in {data}/sii; set LINESMAN_DATA");
    }
}
