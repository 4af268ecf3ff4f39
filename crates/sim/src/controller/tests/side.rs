//! The other side: what the SubDevice's processor reads and writes, LEDs, and an SII it plays.

use linesman_proto::address::RegisterAddress;
use linesman_proto::port::Port;
use linesman_proto::register::{AlEvents, AlStatus, SiiCommand, SiiControl};
use linesman_proto::state::{AlState, AlStatusCode};
use linesman_proto::time::Span;

use super::rig::{Bench, hardware, sii};
use crate::controller::{CountKind, PortEvent};
use crate::device::{EMULATION_TIME, EmulatedSii, NoFirmware};
use crate::hardware::Hardware;

/// An IP core of version 4.0.
fn ip_core() -> Hardware {
    let mut hardware = hardware();
    (hardware.controller_type, hardware.revision, hardware.build) = (0x04, 4, 0);
    hardware
}

fn bench(hardware: Hardware) -> Bench {
    Bench::with(hardware, sii(false), Box::new(NoFirmware))
}

fn pdi_writes(bench: &mut Bench, address: u16, data: &[u8]) -> bool {
    bench.pdi(|pdi| pdi.write_register(RegisterAddress(address), data))
}

// S2 chapter 2, column "PDI".
#[test]
fn each_side_has_its_rights() {
    let mut bench = bench(ip_core());
    for address in [0x0000, 0x0010, 0x0021, 0x0100, 0x0110, 0x0120, 0x0300, 0x0420, 0x0600, 0x0800]
    {
        assert!(!pdi_writes(&mut bench, address, &[1]), "0x{address:04X} is the MainDevice's");
    }
    assert!(pdi_writes(&mut bench, 0x0012, &[0x34, 0x12]));
    assert_eq!(bench.word(0x0012), 0x1234);
    assert_eq!(bench.write(0x0012, &[1, 1]), 0, "the alias is the SubDevice's");
    assert!(pdi_writes(&mut bench, 0x0204, &[0xFF, 0, 0, 0]));
    assert_eq!(bench.read(0x0204, 4).unwrap(), [0xFF, 0, 0, 0]);
    assert_eq!(bench.write(0x0204, &[0]), 0);
    assert!(pdi_writes(&mut bench, 0x0134, &[0x1B, 0]));
    assert!(pdi_writes(&mut bench, 0x0130, &[0x14, 0]));
    assert_eq!(bench.word(0x0130), 0x14);
    assert!(!pdi_writes(&mut bench, 0x0FFE, &[0, 0, 0]), "process data RAM is no register");
    assert!(pdi_writes(&mut bench, 0x0817, &[1]), "a lock of SyncManager 2");
    assert_eq!(bench.byte(0x0817), 1);
}

// S2 2.3.6.
#[test]
fn the_processor_resets_its_controller_with_three_letters() {
    let mut bench = bench(ip_core());
    for letter in *b"RE" {
        assert!(pdi_writes(&mut bench, 0x0041, &[letter]));
    }
    assert_eq!(bench.byte(0x0041), 2);
    assert!(pdi_writes(&mut bench, 0x0041, b"X"));
    assert_eq!(bench.byte(0x0041), 0, "from the beginning");
    assert_eq!(bench.write(0x0041, b"R"), 0);
    for letter in *b"RES" {
        assert!(pdi_writes(&mut bench, 0x0041, &[letter]));
    }
    bench.wait(Span::us(1));
    assert_eq!(bench.word(0x0010), 0, "the station address is gone");
    let mut old = Bench::new();
    assert!(!pdi_writes(&mut old, 0x0041, b"R"), "an ET1100 has no such register");
}

// S2 2.11.1, 2.11.2.
#[test]
fn the_processor_uses_an_sii_it_was_offered() {
    let mut bench = bench(ip_core());
    assert!(!pdi_writes(&mut bench, 0x0501, &[1]), "not offered");
    assert_eq!(bench.write(0x0500, &[1]), 1);
    assert!(pdi_writes(&mut bench, 0x0501, &[1]));
    assert!(pdi_writes(&mut bench, 0x0504, &[8, 0, 0, 0]));
    assert!(pdi_writes(&mut bench, 0x0502, &[0, 1]));
    assert!(!pdi_writes(&mut bench, 0x0504, &[9]), "busy");
    bench.wait(Span::ms(1));
    assert_eq!(bench.read(0x0508, 4).unwrap(), [8, 0, 9, 0]);
    assert_eq!(bench.write(0x0504, &[0]), 0, "the MainDevice has given it away");
    assert_eq!(bench.write(0x0500, &[2]), 1);
    assert_eq!(bench.byte(0x0501), 0, "taken back");
    assert!(!pdi_writes(&mut bench, 0x0504, &[9]));
}

// S2 2.5.4, 2.5.5; facts 4.2.
#[test]
fn leds_show_the_state_unless_they_are_taken_over() {
    let mut bench = bench(ip_core());
    let leds = |bench: &mut Bench| (bench.byte(0x0138), bench.byte(0x0139));
    let show = |bench: &mut Bench, status: AlStatus, code: AlStatusCode| {
        bench.pdi(|pdi| {
            pdi.set_al_code(code);
            pdi.set_al_status(status);
        });
        leds(bench)
    };
    let none = AlStatusCode::NO_ERROR;
    let rows =
        [(AlState::PreOp, 0xD), (AlState::SafeOp, 1), (AlState::Op, 0xF), (AlState::Boot, 0xE)];
    for (state, run) in rows {
        assert_eq!(show(&mut bench, AlStatus::new(state), none), (run, 0), "{state}");
    }
    let failed = AlStatus::new(AlState::SafeOp).with_error(true);
    assert_eq!(show(&mut bench, failed, AlStatusCode::SYNC_MANAGER_WATCHDOG), (1, 2));
    assert_eq!(bench.write(0x0138, &[0x15]), 1, "flash 5x, by hand");
    assert_eq!(show(&mut bench, AlStatus::new(AlState::Op), none), (0x15, 0));
    assert_eq!(bench.write(0x0138, &[0x05]), 1, "by itself again");
    assert_eq!(bench.byte(0x0138), 0xF);
    assert_eq!(Bench::new().read(0x0138, 1), None, "an ET1100 has none");
}

// S1 11.2.4, S2 2.11.3.
#[test]
fn a_processor_plays_the_eeprom() {
    let image = sii(false);
    let device = EmulatedSii::new(Box::new(NoFirmware), image.clone());
    let mut bench = Bench::with(ip_core(), image, Box::new(device));
    assert_eq!(SiiControl(bench.word(0x0502)), SiiControl(0).with_emulated(true));
    assert_eq!(bench.word(0x0012), 0xABCD, "the alias, set by the processor");
    let start = |bench: &mut Bench, command: SiiCommand, word: u32, value: u16| {
        let mut bytes = SiiControl::start(command).to_bytes().to_vec();
        bytes.extend(word.to_le_bytes());
        bytes.extend(value.to_le_bytes());
        assert_eq!(bench.write(0x0502, &bytes), 1);
    };
    start(&mut bench, SiiCommand::Read, 8, 0);
    assert!(SiiControl(bench.word(0x0502)).busy());
    let events = AlEvents::from_bytes(bench.read(0x0220, 4).unwrap().try_into().unwrap());
    assert!(events.contains(AlEvents::EEPROM_EMULATION));
    bench.wait(EMULATION_TIME);
    assert_eq!(bench.word(0x0502), 0x0020);
    assert_eq!(bench.read(0x0508, 4).unwrap(), [8, 0, 9, 0]);
    start(&mut bench, SiiCommand::Write, 4, 0xBEEF);
    bench.wait(Span::us(100));
    start(&mut bench, SiiCommand::Write, 1_000_000, 1);
    bench.wait(Span::us(100));
    assert!(SiiControl(bench.word(0x0502)).acknowledge_error(), "behind its memory");
    start(&mut bench, SiiCommand::Reload, 0, 0);
    bench.wait(Span::us(100));
    assert_eq!(bench.word(0x0012), 0xBEEF, "the alias comes with a reload");
    start(&mut bench, SiiCommand::Read, 4, 0);
    bench.wait(Span::us(100));
    assert_eq!(bench.word(0x0508), 0xBEEF);
}

// S2 2.9.7, 2.9.8, table 12.
#[test]
fn the_first_error_leaves_its_reason() {
    let mut bench = bench(ip_core());
    let error = |bench: &mut Bench, kind| {
        bench.controller.post(bench.now, PortEvent::Count { port: Port::B, kind });
        bench.wait(Span::ZERO);
    };
    error(&mut bench, CountKind::SymbolError);
    assert_eq!(bench.byte(0x0303), 0, "the port is closed");
    assert_eq!((bench.byte(0x0315), bench.word(0x0322)), (1, 0x30), "an idle symbol");
    error(&mut bench, CountKind::InvalidFrame);
    assert_eq!((bench.byte(0x0315), bench.word(0x0322)), (2, 0x30), "the first one stays");
    assert_eq!(bench.write(0x0300, &[0]), 1);
    assert_eq!((bench.byte(0x0315), bench.word(0x0322)), (0, 0));
    error(&mut bench, CountKind::ForwardedError);
    assert_eq!((bench.byte(0x0315), bench.word(0x0322)), (1, 0x61));
    assert_eq!(Bench::new().read(0x0314, 1), None, "an ET1100 has none");
}

// S2 2.9.4, 2.9.5.
#[test]
fn pdi_errors_keep_their_reason() {
    let mut bench = bench(ip_core());
    bench.pdi(|pdi| pdi.count_pdi_error_because(0x0402));
    assert_eq!((bench.byte(0x030D), bench.word(0x030E)), (1, 0x0402));
    assert_eq!(bench.write(0x030D, &[0]), 1);
    assert_eq!((bench.byte(0x030D), bench.word(0x030E)), (0, 0));
}

// S2 2.14.4, bit 7; 0x0008 bit 12.
#[test]
fn in_sequential_mode_a_buffer_is_written_in_order() {
    let mut hardware = ip_core();
    hardware.features |= 1 << 12;
    let mut bench = bench(hardware);
    let control = linesman_proto::register::SmControl::OUTPUTS.with_sequential(true);
    bench.guard(2, 0x1000, 6, control);
    let status = |bench: &mut Bench| bench.byte(0x0815);
    assert_eq!(bench.write(0x1000, &[1, 2]), 1);
    assert_eq!(bench.write(0x1004, &[5, 6]), 0, "bytes 2 and 3 are missing");
    assert_eq!(status(&mut bench) & 4, 4, "a violation");
    assert_eq!(bench.write(0x1002, &[3, 4]), 1);
    assert_eq!(bench.write(0x1004, &[5, 6]), 1);
    assert_eq!(bench.write(0x1000, &[1; 6]), 1);
    assert_eq!(status(&mut bench) & 4, 0);
    // Without the feature the bit means nothing.
    let mut plain = Bench::new();
    plain.guard(2, 0x1000, 6, control);
    assert_eq!(plain.write(0x1000, &[1, 2]), 1);
    assert_eq!(plain.write(0x1004, &[5, 6]), 1);
}

// S2 2.4.3 bit 2; 0x0141 bits 1 and 4 to 7; 0x0008 bits 5 and 6.
#[test]
fn enhanced_link_detection_is_wanted_by_the_sii_and_there_by_the_features() {
    for (wanted, features, shown) in [
        (0x02, 0x00FC, true),
        (0x10, 0x00FC, true),
        (0x20, 0x0040, false),
        (0x20, 0x0020, true),
        (0x02, 0x0004, false),
        (0x00, 0x00FC, false),
    ] {
        let mut image = sii(false);
        image[1] = wanted;
        let mut hardware = hardware();
        hardware.features = features;
        let mut bench = Bench::with(hardware, image, Box::new(NoFirmware));
        assert_eq!(bench.word(0x0110) & 4 != 0, shown, "0x{wanted:02X}, 0x{features:04X}");
    }
}
