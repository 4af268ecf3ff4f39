//! SyncManagers from both sides: procedures, denials, buffers, events.

use linesman_proto::command::Command;
use linesman_proto::register::{AlEvents, SmControl, SmStatus};

use super::rig::{Bench, at, logical};
use linesman_proto::address::{LogicalAddress, RegisterAddress};
use linesman_proto::register::FmmuConfig;

const OUT: u16 = 0x1000;
const IN: u16 = 0x1080;

fn status(bench: &mut Bench, index: u16) -> SmStatus {
    SmStatus(bench.byte(0x0805 + 8 * index))
}

fn events(bench: &mut Bench) -> AlEvents {
    bench.pdi(|pdi| pdi.events())
}

fn take(bench: &mut Bench, index: u8) -> Option<Vec<u8>> {
    bench.pdi(|pdi| {
        let mut buffer = [0; 64];
        pdi.read_sync_manager(index, &mut buffer).map(|len| buffer[..len].to_vec())
    })
}

fn give(bench: &mut Bench, index: u8, data: &[u8]) -> bool {
    bench.pdi(|pdi| pdi.write_sync_manager(index, data))
}

#[test]
fn a_mailbox_out_is_written_and_read_in_turn() {
    let mut bench = Bench::new();
    bench.guard(0, OUT, 8, SmControl::MAILBOX_OUT);
    assert_eq!(take(&mut bench, 0), None, "empty");
    assert_eq!(bench.write(OUT, &[1; 8]), 1);
    assert!(status(&mut bench, 0).mailbox_full() && status(&mut bench, 0).written());
    assert!(events(&mut bench).contains(AlEvents::sync_manager(0)));
    assert_eq!(bench.write(OUT, &[2; 8]), 0, "still full");
    assert_eq!(bench.read(OUT, 8), None, "not for the MainDevice to read");
    assert_eq!(take(&mut bench, 0), Some(vec![1; 8]));
    assert!(!status(&mut bench, 0).mailbox_full() && status(&mut bench, 0).read());
    assert!(!events(&mut bench).contains(AlEvents::sync_manager(0)));
    assert_eq!(take(&mut bench, 0), None);
    assert_eq!(bench.write(OUT, &[3; 8]), 1);
    assert_eq!(take(&mut bench, 0), Some(vec![3; 8]));
}

#[test]
fn a_mailbox_in_is_read_only_when_full() {
    let mut bench = Bench::new();
    bench.guard(1, IN, 8, SmControl::MAILBOX_IN);
    assert_eq!(bench.read(IN, 8), None, "empty");
    assert!(give(&mut bench, 1, &[1, 2, 3]));
    assert!(!give(&mut bench, 1, &[9]), "full");
    assert!(bench.pdi(|pdi| pdi.mailbox_full(1)));
    assert_eq!(bench.write(IN, &[7; 8]), 0, "not for the MainDevice to write");
    assert_eq!(bench.read(IN, 8).unwrap(), [1, 2, 3, 0, 0, 0, 0, 0]);
    assert!(events(&mut bench).contains(AlEvents::sync_manager(1)), "it may write again");
    assert_eq!(bench.read(IN, 8), None);
    assert!(!give(&mut bench, 1, &[0; 9]), "too much");
    assert!(give(&mut bench, 1, &[4; 8]));
    assert!(!events(&mut bench).contains(AlEvents::sync_manager(1)));
    assert_eq!(bench.read(IN, 8).unwrap(), [4; 8]);
}

#[test]
fn an_access_begins_at_the_start_and_ends_at_the_end() {
    let mut bench = Bench::new();
    bench.guard(0, OUT, 8, SmControl::MAILBOX_OUT);
    assert_eq!(bench.write(OUT + 1, &[1; 7]), 0, "not at the start");
    assert_eq!(bench.write(OUT + 7, &[1]), 0);
    assert_eq!(bench.write(OUT, &[1, 2]), 1, "begun");
    assert!(status(&mut bench, 0).write_open() && !status(&mut bench, 0).mailbox_full());
    assert_eq!(take(&mut bench, 0), None);
    assert_eq!(bench.write(OUT + 2, &[3]), 1, "in several strokes");
    assert_eq!(bench.write(OUT, &[9]), 1, "even the start again");
    assert_eq!(bench.write(OUT + 7, &[8]), 1, "ended");
    assert!(!status(&mut bench, 0).write_open());
    assert_eq!(take(&mut bench, 0), Some(vec![9, 2, 3, 0, 0, 0, 0, 8]));

    // A read from before the buffer runs into it, byte by byte.
    bench.guard(1, IN, 4, SmControl::MAILBOX_IN);
    assert!(give(&mut bench, 1, &[1, 2, 3, 4]));
    bench.write(IN - 1, &[0xEE]);
    assert_eq!(bench.read(IN - 1, 6).unwrap(), [0xEE, 1, 2, 3, 4, 0]);
    let (data, wkc) = bench.exchange(Command::Brd, at(0, IN - 1), &[0; 6]);
    assert_eq!((data, wkc), (vec![0xEE, 0, 0, 0, 0, 0], 1), "now empty: only what is around it");
}

#[test]
fn a_mailbox_is_not_taken_twice_in_one_frame() {
    let mut bench = Bench::new();
    bench.guard(0, OUT, 4, SmControl::MAILBOX_OUT);
    let write = |byte: &'static [u8; 4]| (Command::Bwr, at(0, OUT), &byte[..]);
    let answers = bench.send(&[write(&[1; 4]), write(&[2; 4])]);
    assert_eq!((answers[0].1, answers[1].1), (1, 0));
    assert_eq!(take(&mut bench, 0), Some(vec![1; 4]));
    bench.guard(1, IN, 4, SmControl::MAILBOX_IN);
    assert!(give(&mut bench, 1, &[5; 4]));
    let read = (Command::Brd, at(0, IN), &[0; 4][..]);
    let answers = bench.send(&[read, read]);
    assert_eq!((answers[0].1, answers[1].1), (1, 0));
}

#[test]
fn buffers_always_give_the_newest_whole_data() {
    let mut bench = Bench::new();
    bench.guard(2, OUT, 4, SmControl::OUTPUTS);
    assert_eq!(take(&mut bench, 2), None, "never written");
    assert_eq!(status(&mut bench, 2).last_buffer(), None);
    assert_eq!(bench.write(OUT, &[1; 4]), 1);
    assert_eq!(status(&mut bench, 2).last_buffer(), Some(0));
    assert_eq!(bench.write(OUT, &[2; 4]), 1);
    assert_eq!(bench.write(OUT, &[3, 3]), 1, "begun, not ended");
    assert_eq!(take(&mut bench, 2), Some(vec![2; 4]));
    assert_eq!(bench.write(OUT + 2, &[3, 3]), 1);
    assert_eq!(take(&mut bench, 2), Some(vec![3; 4]));
    assert_eq!(take(&mut bench, 2), Some(vec![3; 4]), "it can be read again");
    assert_eq!(bench.read(OUT, 4), None, "the wrong direction");
    // The three buffers lie side by side.
    assert_eq!(bench.pdi(|pdi| pdi.ram(OUT..OUT + 12).to_vec()), [[3; 4], [2; 4], [0; 4]].concat());
}

#[test]
fn inputs_are_whole_however_often_they_change() {
    let mut bench = Bench::new();
    bench.guard(3, IN, 4, SmControl::INPUTS);
    assert_eq!(bench.read(IN, 4), None, "never written");
    assert!(give(&mut bench, 3, &[1; 4]));
    assert_eq!(bench.read(IN, 2).unwrap(), [1; 2], "begun");
    for value in 2..9 {
        assert!(give(&mut bench, 3, &[value; 4]));
    }
    assert_eq!(bench.read(IN + 2, 2).unwrap(), [1; 2], "and ended in the same buffer");
    assert_eq!(bench.read(IN, 4).unwrap(), [8; 4]);
    assert_eq!(bench.read(IN, 4).unwrap(), [8; 4]);
    assert_eq!(bench.read(IN + 1, 3), None, "not at the start");
    assert_eq!(bench.write(IN, &[0; 4]), 0, "the wrong direction");
}

#[test]
fn the_end_address_is_touched_once_a_frame() {
    let mut bench = Bench::new();
    bench.guard(3, IN, 4, SmControl::INPUTS);
    assert!(give(&mut bench, 3, &[1, 2, 3, 4]));
    let read = (Command::Bwr, at(0, 0x0F80), &[0][..]);
    let whole = (Command::Brd, at(0, IN), &[0; 4][..]);
    let answers = bench.send(&[whole, read, whole, (Command::Brd, at(0, IN + 3), &[0])]);
    assert_eq!(answers[0], (vec![1, 2, 3, 4], 1));
    assert_eq!(answers[2], (vec![1, 2, 3, 0], 1));
    assert_eq!(answers[3].1, 0);
    assert_eq!(bench.read(IN, 4).unwrap(), [1, 2, 3, 4]);
}

#[test]
fn one_byte_passes_both_ways_and_is_noticed() {
    let mut bench = Bench::new();
    bench.guard(0, 0x0F00, 1, SmControl(0x64));
    assert_eq!(bench.write(0x0F00, &[0xA5]), 1);
    assert_eq!(bench.byte(0x0F00), 0xA5, "read back");
    assert!(events(&mut bench).contains(AlEvents::sync_manager(0)));
    assert_eq!(take(&mut bench, 0), Some(vec![0xA5]));
    assert_eq!(bench.pdi(|pdi| pdi.digital_outputs()), 0xA5);
    assert!(!events(&mut bench).contains(AlEvents::sync_manager(0)));
    bench.guard(1, 0x1000, 1, SmControl(0x00));
    assert!(give(&mut bench, 1, &[7]));
    assert_eq!(bench.byte(0x1000), 7);
    assert_eq!(bench.write(0x1000, &[9]), 1);
    assert_eq!(bench.byte(0x1000), 9);
}

#[test]
fn off_and_empty_guard_nothing() {
    let mut bench = Bench::new();
    bench.guard(2, OUT, 0, SmControl::OUTPUTS);
    assert_eq!(bench.write(OUT + 1, &[1]), 1);
    bench.write(0x0816, &[0]);
    bench.guard(2, OUT, 4, SmControl::OUTPUTS);
    assert_eq!(bench.write(OUT + 1, &[1]), 0);
    bench.write(0x0816, &[0]);
    assert_eq!(bench.write(OUT + 1, &[1]), 1);
    assert_eq!(bench.write(OUT + 4, &[1]), 1);
}

#[test]
fn settings_are_for_switched_off_ones() {
    let mut bench = Bench::new();
    bench.guard(2, OUT, 4, SmControl::OUTPUTS);
    assert_eq!(bench.write(0x0810, &[0, 0x11, 8, 0, 0x24]), 0, "only the settings");
    assert_eq!(bench.write(0x0810, &[0, 0x11, 8, 0, 0x24, 0, 1, 0]), 1, "activate is written");
    assert_eq!(bench.read(0x0810, 5).unwrap(), [0x00, 0x10, 4, 0, 0x64]);
    bench.write(OUT, &[1; 4]);
    assert_eq!(bench.write(0x0816, &[1]), 1);
    assert_eq!(take(&mut bench, 2), Some(vec![1; 4]), "the same again changes nothing");
    bench.write(0x0816, &[0]);
    assert_eq!(bench.write(0x0810, &[0, 0x11, 8, 0, 0x24, 0xFF, 1, 0xFF]), 1);
    assert_eq!(bench.read(0x0810, 8).unwrap(), [0x00, 0x11, 8, 0, 0x24, 0x30, 1, 0]);
    assert_eq!(take(&mut bench, 2), None, "switched on means begun anew");
}

#[test]
fn switching_is_told_to_the_device() {
    let mut bench = Bench::new();
    assert!(!bench.pdi(|pdi| pdi.take_activation_event()));
    bench.guard(2, OUT, 4, SmControl::OUTPUTS);
    assert!(bench.pdi(|pdi| pdi.take_activation_event()));
    bench.write(0x0816, &[1]);
    assert!(!bench.pdi(|pdi| pdi.take_activation_event()), "nothing changed");
    bench.write(0x0816, &[0]);
    assert!(bench.pdi(|pdi| pdi.take_activation_event()));
}

#[test]
fn the_device_locks_a_buffer() {
    let mut bench = Bench::new();
    bench.guard(2, OUT, 4, SmControl::OUTPUTS);
    bench.write(OUT, &[1; 4]);
    bench.pdi(|pdi| pdi.deactivate_sync_manager(2, true));
    assert_eq!(bench.byte(0x0817), 1);
    assert_eq!(bench.write(OUT, &[2; 4]), 0);
    assert!(!events(&mut bench).contains(AlEvents::sync_manager(2)), "its events are gone");
    assert_eq!(take(&mut bench, 2), None);
    bench.pdi(|pdi| pdi.deactivate_sync_manager(2, false));
    assert_eq!(take(&mut bench, 2), None, "it must be written first");
    assert_eq!(bench.write(OUT, &[3; 4]), 1);
    assert_eq!(take(&mut bench, 2), Some(vec![3; 4]));
}

#[test]
fn a_lost_mailbox_message_is_asked_for_again() {
    let mut bench = Bench::new();
    bench.guard(1, IN, 8, SmControl::MAILBOX_IN);
    assert!(give(&mut bench, 1, &[5]));
    bench.read(IN, 8);
    assert!(!bench.pdi(|pdi| pdi.repeat_requested(1)));
    bench.pdi(|pdi| pdi.take_activation_event());
    bench.write(0x080E, &[0x03]);
    assert!(bench.pdi(|pdi| pdi.take_activation_event() && pdi.repeat_requested(1)));
    assert_eq!(bench.byte(0x080F) & 2, 0, "not yet");
    assert!(give(&mut bench, 1, &[5]));
    bench.pdi(|pdi| pdi.acknowledge_repeat(1));
    assert_eq!(bench.byte(0x080F) & 2, 2);
    assert_eq!(bench.read(IN, 8).unwrap()[0], 5);
}

#[test]
fn the_main_device_hears_of_buffers_if_it_wants() {
    let mut bench = Bench::new();
    bench.word(0x0110);
    bench.guard(1, IN, 4, SmControl::MAILBOX_IN.with_ecat_event(true));
    bench.guard(0, OUT, 4, SmControl::MAILBOX_OUT.with_ecat_event(true));
    assert_eq!(bench.word(0x0210), 0);
    assert!(give(&mut bench, 1, &[1]));
    assert_eq!(bench.word(0x0210), 1 << 5, "something to read");
    bench.read(IN, 4);
    assert_eq!(bench.word(0x0210), 0);
    bench.write(OUT, &[1; 4]);
    assert_eq!(bench.word(0x0210), 0);
    take(&mut bench, 0);
    assert_eq!(bench.word(0x0210), 1 << 4, "it was read");
}

#[test]
fn settings_that_make_no_sense_refuse_all() {
    let mut bench = Bench::new();
    // Reserved mode, reserved direction, buffers beyond the RAM.
    for (start, length, control) in [(OUT, 4, 0x05), (OUT, 4, 0x08), (0x2FF8, 4, 0x04)] {
        bench.guard(2, start, length, SmControl(control));
        assert_eq!(bench.write(start, &[1; 4]), 0, "0x{start:04X}, control 0x{control:02X}");
        assert_eq!(bench.read(start, 4), None);
        assert!(!give(&mut bench, 2, &[0]) && take(&mut bench, 2).is_none());
        bench.write(0x0816, &[0]);
    }
}

#[test]
fn sync_managers_guard_mapped_accesses_too() {
    let mut bench = Bench::new();
    bench.guard(2, OUT, 4, SmControl::OUTPUTS);
    bench.guard(3, IN, 4, SmControl::INPUTS);
    bench.map(0, &FmmuConfig::outputs(LogicalAddress(0x100), 4, RegisterAddress(OUT)));
    bench.map(1, &FmmuConfig::inputs(LogicalAddress(0x104), 4, RegisterAddress(IN)));
    let lrw =
        |bench: &mut Bench, data: &[u8; 8]| bench.exchange(Command::Lrw, logical(0x100), data);
    assert_eq!(lrw(&mut bench, &[1; 8]).1, 2, "no inputs yet");
    assert_eq!(take(&mut bench, 2), Some(vec![1; 4]));
    assert!(give(&mut bench, 3, &[7, 8, 9, 10]));
    assert_eq!(lrw(&mut bench, &[2; 8]), (vec![2, 2, 2, 2, 7, 8, 9, 10], 3));
    bench.pdi(|pdi| pdi.deactivate_sync_manager(2, true));
    assert_eq!(lrw(&mut bench, &[3; 8]).1, 1, "the device has locked its outputs");
    // Two datagrams for one buffer: the frames of two sync units.
    bench.pdi(|pdi| pdi.deactivate_sync_manager(2, false));
    let half = |start| (Command::Lwr, logical(start), &[4; 2][..]);
    let answers = bench.send(&[half(0x100), half(0x102)]);
    assert_eq!((answers[0].1, answers[1].1), (1, 1));
    assert_eq!(take(&mut bench, 2), Some(vec![4; 4]));
}
