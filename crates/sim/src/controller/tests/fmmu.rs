//! Logical commands through FMMUs.

use linesman_proto::address::{LogicalAddress, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::register::{Features, FmmuConfig, SmControl};
use proptest::prelude::*;

use super::rig::{Bench, hardware, logical, sii};
use crate::device::NoFirmware;

fn inputs(logical: u32, length: u16, physical: u16) -> FmmuConfig {
    FmmuConfig::inputs(LogicalAddress(logical), length, RegisterAddress(physical))
}

fn outputs(logical: u32, length: u16, physical: u16) -> FmmuConfig {
    FmmuConfig::outputs(LogicalAddress(logical), length, RegisterAddress(physical))
}

// proves: FRM-04 partial, FRM-15 partial
#[test]
fn bytes_are_mapped_and_counted_once_a_direction() {
    let mut bench = Bench::new();
    bench.map(0, &inputs(0x1000_0004, 2, 0x1000));
    bench.map(1, &inputs(0x1000_0000, 2, 0x1010));
    bench.map(2, &outputs(0x1000_0002, 2, 0x1020));
    bench.write(0x1000, &[0x11, 0x22]);
    bench.write(0x1010, &[0x33, 0x44]);
    let sent = [1, 2, 3, 4, 5, 6, 7, 8];
    let read = [0x33, 0x44, 3, 4, 0x11, 0x22, 7, 8];
    let at = logical(0x1000_0000);
    assert_eq!(bench.exchange(Command::Lrd, at, &sent), (read.to_vec(), 1));
    assert_eq!(bench.read(0x1020, 2).unwrap(), [0, 0]);
    assert_eq!(bench.exchange(Command::Lwr, at, &sent), (sent.to_vec(), 1));
    assert_eq!(bench.read(0x1020, 2).unwrap(), [3, 4]);
    let sent = [9, 9, 8, 8, 9, 9, 9, 9];
    let read = [0x33, 0x44, 8, 8, 0x11, 0x22, 9, 9];
    assert_eq!(bench.exchange(Command::Lrw, at, &sent), (read.to_vec(), 3));
    assert_eq!(bench.read(0x1020, 2).unwrap(), [8, 8]);
}

// proves: FRM-15 partial
#[test]
fn only_what_is_hit_counts() {
    let mut bench = Bench::new();
    bench.map(0, &inputs(0x100, 4, 0x1000));
    bench.map(1, &outputs(0x104, 4, 0x1010));
    // start, length, LRD, LWR, LRW
    let table = [
        (0x0FF, 1, 0, 0, 0),
        (0x0FF, 2, 1, 0, 1),
        (0x103, 1, 1, 0, 1),
        (0x103, 2, 1, 1, 3),
        (0x104, 1, 0, 1, 2),
        (0x107, 9, 0, 1, 2),
        (0x108, 4, 0, 0, 0),
    ];
    for (start, len, lrd, lwr, lrw) in table {
        for (command, wkc) in [(Command::Lrd, lrd), (Command::Lwr, lwr), (Command::Lrw, lrw)] {
            let answer = bench.exchange(command, logical(start), &vec![0; len]);
            assert_eq!(answer.1, wkc, "{command} of {len} bytes at 0x{start:X}");
        }
    }
}

/// S1's example: logical 0x00010011.3 to 0x00010013.0, 14 bits, physical 0x0F01.1.
#[test]
fn the_example_of_the_data_sheet() {
    let mut config = outputs(0x0001_0011, 3, 0x0F01);
    (config.logical_start_bit, config.logical_stop_bit) = (3, 0);
    config.physical_start_bit = 1;
    assert_eq!(config.bit_len(), 14);
    let mut bench = Bench::new();
    bench.map(0, &config);
    bench.write(0x0F00, &[0xFF; 4]);
    let answer = bench.exchange(Command::Lwr, logical(0x0001_0010), &[0; 8]);
    assert_eq!(answer, (vec![0; 8], 1));
    assert_eq!(bench.read(0x0F00, 4).unwrap(), [0xFF, 0x01, 0x80, 0xFF], "14 bits are 0");
    bench.write(0x0F00, &[0; 4]);
    bench.exchange(Command::Lwr, logical(0x0001_0010), &[0xFF; 8]);
    assert_eq!(bench.read(0x0F00, 4).unwrap(), [0x00, 0xFE, 0x7F, 0x00], "14 bits are 1");
    // One bit: logical 0x00010012.0 is the sixth mapped one, physical 0x0F01.6.
    bench.write(0x0F00, &[0; 4]);
    bench.exchange(Command::Lwr, logical(0x0001_0012), &[0x01]);
    assert_eq!(bench.read(0x0F00, 4).unwrap(), [0x00, 0x40, 0x00, 0x00]);

    (config.reads, config.writes) = (true, false);
    bench.map(0, &config);
    bench.write(0x0F00, &[0xFF; 4]);
    let answer = bench.exchange(Command::Lrd, logical(0x0001_0010), &[0; 5]);
    assert_eq!(answer, (vec![0x00, 0xF8, 0xFF, 0x01, 0x00], 1), "no other bit is touched");
}

#[test]
fn the_lowest_fmmu_of_a_direction_wins() {
    let mut bench = Bench::new();
    bench.map(0, &inputs(0x101, 1, 0x1000));
    bench.map(1, &inputs(0x100, 3, 0x1010));
    bench.map(2, &outputs(0x101, 1, 0x1020));
    bench.map(3, &outputs(0x100, 3, 0x1030));
    bench.write(0x1000, &[0xA0]);
    bench.write(0x1010, &[1, 2, 3]);
    let answer = bench.exchange(Command::Lrw, logical(0x100), &[7, 8, 9]);
    assert_eq!(answer, (vec![1, 0xA0, 3], 3));
    assert_eq!(bench.byte(0x1020), 8);
    assert_eq!(bench.read(0x1030, 3).unwrap(), [7, 0, 9]);
}

// proves: FRM-15 partial
#[test]
fn what_is_read_goes_out_and_what_came_in_is_written() {
    let mut bench = Bench::new();
    // One FMMU for both directions, and two that share their logical bytes.
    let both = FmmuConfig { writes: true, ..inputs(0x100, 2, 0x1000) };
    bench.map(0, &both);
    bench.map(1, &inputs(0x200, 2, 0x1010));
    bench.map(2, &outputs(0x200, 2, 0x1020));
    bench.write(0x1000, &[1, 2]);
    bench.write(0x1010, &[3, 4]);
    assert_eq!(bench.exchange(Command::Lrw, logical(0x100), &[8, 9]), (vec![1, 2], 3));
    assert_eq!(bench.read(0x1000, 2).unwrap(), [8, 9]);
    assert_eq!(bench.exchange(Command::Lrw, logical(0x200), &[6, 7]), (vec![3, 4], 3));
    assert_eq!(bench.read(0x1020, 2).unwrap(), [6, 7]);
}

#[test]
fn the_mailbox_bit_is_mapped_from_its_status() {
    let mut bench = Bench::new();
    bench.guard(1, 0x1080, 16, SmControl::MAILBOX_IN);
    bench.map(2, &FmmuConfig::mailbox_full(LogicalAddress(0x0900_0000), 5, 1).unwrap());
    let lrd = |bench: &mut Bench| bench.exchange(Command::Lrd, logical(0x0900_0000), &[0x81, 0xFF]);
    assert_eq!(lrd(&mut bench), (vec![0x81, 0xFF], 1));
    assert!(bench.pdi(|pdi| pdi.write_sync_manager(1, &[1, 2, 3])));
    assert_eq!(lrd(&mut bench), (vec![0xA1, 0xFF], 1));
}

#[test]
fn an_fmmu_takes_effect_with_its_activation_and_not_in_its_frame() {
    let mut bench = Bench::new();
    let mut config = inputs(0x100, 4, 0x1000);
    config.active = false;
    bench.map(0, &config);
    assert_eq!(bench.exchange(Command::Lrd, logical(0x100), &[0; 4]).1, 0);
    let on = (Command::Bwr, super::rig::at(0, 0x060C), &[1][..]);
    let read = (Command::Lrd, logical(0x100), &[0; 4][..]);
    assert_eq!(bench.send(&[on, read])[1].1, 0);
    assert_eq!(bench.send(&[read])[0].1, 1);
}

#[test]
fn a_bytewise_controller_maps_whole_bytes() {
    let mut hardware = hardware();
    hardware.features = Features(hardware.features).with_bytewise_fmmus(true).0;
    let mut bench = Bench::with(hardware, sii(false), Box::new(NoFirmware));
    let mut config = inputs(0x100, 1, 0x1000);
    (config.logical_start_bit, config.logical_stop_bit) = (2, 3);
    bench.map(0, &config);
    bench.write(0x1000, &[0xFF]);
    assert_eq!(bench.exchange(Command::Lrd, logical(0x100), &[0]), (vec![0xFF], 1));
}

#[test]
fn mappings_end_with_the_address_spaces() {
    let mut bench = Bench::new();
    bench.map(0, &inputs(0xFFFF_FFFE, 8, 0x1000));
    bench.map(1, &inputs(0x100, 8, 0xFFFC));
    bench.write(0x1000, &[1, 2, 3, 4]);
    let answer = bench.exchange(Command::Lrd, logical(0xFFFF_FFFC), &[0; 4]);
    assert_eq!(answer, (vec![0, 0, 1, 2], 1));
    assert_eq!(bench.exchange(Command::Lrd, logical(0x100), &[0; 8]).1, 0);
    let bits = FmmuConfig { physical_start_bit: 3, ..inputs(0x100, 8, 0xFFFC) };
    bench.map(1, &bits);
    assert_eq!(bench.exchange(Command::Lrd, logical(0x100), &[0; 8]).1, 0);
}

fn any_fmmu() -> impl Strategy<Value = FmmuConfig> {
    let bits = (0u8..8, 0u8..8, 0u8..8);
    (0u32..24, 1u16..6, bits, 0u16..24, 1u8..4).prop_map(|(start, len, bits, physical, kind)| {
        FmmuConfig {
            logical_start: LogicalAddress(0x100 + start),
            length: len,
            logical_start_bit: bits.0,
            logical_stop_bit: bits.1,
            physical_start: RegisterAddress(0x1000 + physical),
            physical_start_bit: bits.2,
            reads: kind & 1 != 0,
            writes: kind & 2 != 0,
            active: true,
        }
    })
}

/// What the definition says about a read, bit by bit: the lowest reading FMMU that spans the byte
/// decides about it.
fn model(fmmus: &[FmmuConfig], ram: &[u8], start: u32, data: &[u8]) -> (Vec<u8>, bool) {
    let mut out = data.to_vec();
    let mut any = false;
    for (offset, byte) in out.iter_mut().enumerate() {
        let at = LogicalAddress(start + offset as u32);
        let spans = |fmmu: &&FmmuConfig| fmmu.reads && fmmu.overlap(at, 1).is_some();
        let Some(fmmu) = fmmus.iter().find(spans) else { continue };
        for bit in 0..8 {
            if let Some((physical, physical_bit)) = fmmu.locate_bit(at, bit) {
                let value = ram[usize::from(physical.0) - 0x1000] >> physical_bit & 1;
                *byte = *byte & !(1 << bit) | value << bit;
                any = true;
            }
        }
    }
    (out, any)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]
    #[test]
    fn any_mapping_reads_as_defined(
        fmmus in prop::collection::vec(any_fmmu(), 1..5),
        ram in prop::collection::vec(any::<u8>(), 64),
        start in 0x0F8u32..0x118,
        data in prop::collection::vec(any::<u8>(), 1..24),
    ) {
        let mut bench = Bench::new();
        bench.write(0x1000, &ram);
        for (index, fmmu) in fmmus.iter().enumerate() {
            bench.map(index as u16, fmmu);
        }
        let (expected, any) = model(&fmmus, &ram, start, &data);
        let answer = bench.exchange(Command::Lrd, logical(start), &data);
        prop_assert_eq!(answer, (expected, u16::from(any)));
        prop_assert_eq!(bench.read(0x1000, 64).unwrap(), ram);
    }
}
