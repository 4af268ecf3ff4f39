//! Every command, addressed and not, on registers and RAM: data, memory, working counter, address.

use linesman_proto::address::{LogicalAddress, RegisterAddress};
use linesman_proto::command::{Addressing, Command};
use linesman_proto::frame::FrameView;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::register::{Features, FmmuConfig};

use super::rig::{Bench, STATION, at, frame, hardware, logical, sii};
use crate::device::NoFirmware;

/// Where the table below reads and writes: a register of two bytes that just holds what was
/// written, and RAM.
const PLACES: [u16; 2] = [0x0200, 0x1200];
const OLD: [u8; 2] = [0x0F, 0xA0];
const SENT: [u8; 2] = [0x35, 0x0C];

/// What comes of a command.
struct Row {
    command: Command,
    adp: u16,
    data: [u8; 2],
    memory: [u8; 2],
    wkc: u16,
}

fn rows() -> Vec<Row> {
    use Command::*;
    let row = |command, adp, data, memory, wkc| Row { command, adp, data, memory, wkc };
    let ored = [OLD[0] | SENT[0], OLD[1] | SENT[1]];
    vec![
        row(Nop, 0, SENT, OLD, 0),
        row(Aprd, 0, OLD, OLD, 1),
        row(Aprd, 1, SENT, OLD, 0),
        row(Apwr, 0, SENT, SENT, 1),
        row(Apwr, 0xFFFF, SENT, OLD, 0),
        row(Aprw, 0, OLD, SENT, 3),
        row(Aprw, 1, SENT, OLD, 0),
        row(Fprd, STATION, OLD, OLD, 1),
        row(Fprd, 0x1002, SENT, OLD, 0),
        row(Fpwr, STATION, SENT, SENT, 1),
        row(Fpwr, 0, SENT, OLD, 0),
        row(Fprw, STATION, OLD, SENT, 3),
        row(Fprw, 0xABCD, SENT, OLD, 0),
        row(Brd, 0, ored, OLD, 1),
        row(Brd, 0x1234, ored, OLD, 1),
        row(Bwr, 7, SENT, SENT, 1),
        row(Brw, 7, ored, SENT, 3),
        row(Armw, 0, OLD, OLD, 1),
        row(Armw, 1, SENT, SENT, 1),
        row(Frmw, STATION, OLD, OLD, 1),
        row(Frmw, 0x1002, SENT, SENT, 1),
    ]
}

// proves: FRM-02 partial, FRM-03, FRM-05 partial, FRM-15 partial, ESC-07 partial
#[test]
fn every_command_does_what_its_row_says() {
    for place in PLACES {
        for Row { command, adp, data, memory, wkc } in rows() {
            let mut bench = Bench::new();
            assert_eq!(bench.write(place, &OLD), 1);
            let mut frame = frame(&[(command, at(adp, place), &SENT)]);
            let _ = bench.pass(&mut frame);
            let view = FrameView::parse(&frame.bytes).unwrap();
            let datagram = view.datagrams().next().unwrap().unwrap();
            let case = format!("{command} to {adp:04X} at {place:04X}");
            assert_eq!(datagram.data(), data, "{case}: data");
            assert_eq!(datagram.wkc().value(), wkc, "{case}: working counter");
            let moved = match command.addressing() {
                Addressing::Position | Addressing::Broadcast => adp.wrapping_add(1),
                Addressing::None | Addressing::Station | Addressing::Logical => adp,
            };
            assert_eq!((datagram.adp(), datagram.index()), (moved, 0), "{case}: header");
            assert_eq!(bench.read(place, 2).unwrap(), memory, "{case}: memory");
        }
    }
}

#[test]
fn reserved_commands_pass_untouched() {
    let mut bench = Bench::new();
    for code in [15, 16, 0x7F, 0xFF] {
        let mut frame = frame(&[(Command::Brd, at(0, 0x0000), &[0; 4])]);
        frame.bytes[16] = code;
        let mut sent = frame.clone();
        let _ = bench.pass(&mut frame);
        // All but the mark in the source address.
        sent.bytes[6] |= 0x02;
        assert_eq!(frame.bytes, sent.bytes, "code {code}");
    }
}

// proves: FRM-15 partial
#[test]
fn what_cannot_be_read_or_written_counts_nothing() {
    let mut bench = Bench::new();
    // address, length, readable, writable
    let table = [
        (0x0000, 1, true, false),  // type
        (0x000A, 2, false, false), // reserved
        (0x0008, 4, true, false),  // features and reserved
        (0x0010, 2, true, true),   // station address
        (0x0012, 2, true, false),  // alias
        (0x000E, 4, true, true),   // reserved and station address
        (0x0110, 2, true, false),  // DL status
        (0x0130, 6, true, false),  // AL status and code
        (0x0518, 4, false, false), // PHY port status
        (0x092C, 4, true, false),  // system time difference
        (0x0984, 1, false, false), // activation status, of other types
        (0x0E00, 8, false, false), // power-on values
        (0x0F80, 4, true, true),   // user RAM
        (0x0F04, 4, false, false), // behind the digital outputs
        (0x1000, 4, true, true),   // RAM
        (0x2FFF, 2, true, true),   // last byte of RAM and the one behind
        (0x3000, 4, false, false), // behind the RAM
        (0xFFFF, 8, false, false), // end of the address space
    ];
    for (ado, len, readable, writable) in table {
        let read = bench.exchange(Command::Brd, at(0, ado), &vec![0; len]).1;
        assert_eq!(read, u16::from(readable), "read of 0x{ado:04X}");
        // The station address stays what it is.
        let data = STATION.to_le_bytes().repeat(4);
        let write = bench.exchange(Command::Bwr, at(0, ado), &data[..len]).1;
        assert_eq!(write, u16::from(writable), "write of 0x{ado:04X}");
        let both = bench.exchange(Command::Brw, at(0, ado), &data[..len]).1;
        assert_eq!(both, u16::from(readable) + 2 * u16::from(writable), "BRW of 0x{ado:04X}");
        bench.write(0x0010, &STATION.to_le_bytes());
    }
}

#[test]
fn unimplemented_bytes_beside_others_read_as_zero_and_alone_not_at_all() {
    let mut bench = Bench::new();
    let (data, wkc) = bench.exchange(Command::Fprd, at(STATION, 0x0008), &[0xEE; 4]);
    assert_eq!((data.as_slice(), wkc), (&[0x8C, 0x00, 0x00, 0x00][..], 1));
    let (data, wkc) = bench.exchange(Command::Fprd, at(STATION, 0x000A), &[0xEE; 4]);
    assert_eq!((data.as_slice(), wkc), (&[0xEE; 4][..], 0));
}

// proves: FRM-04 partial
#[test]
fn the_alias_is_an_address_once_it_is_enabled() {
    let mut bench = Bench::new();
    assert_eq!(bench.word(0x0012), 0xABCD);
    assert_eq!(bench.exchange(Command::Fprd, at(0xABCD, 0x0000), &[0]).1, 0);
    bench.write(0x0103, &[1]);
    assert_eq!(bench.exchange(Command::Fprd, at(0xABCD, 0x0000), &[0]), (vec![0x11], 1));
    assert_eq!(bench.exchange(Command::Fprd, at(STATION, 0x0000), &[0]).1, 1);
}

#[test]
fn combined_commands_write_at_an_offset() {
    let mut bench = Bench::new();
    bench.write(0x1000, &[1, 2]);
    bench.write(0x0108, &0x0100u16.to_le_bytes());
    for (command, adp) in [(Command::Aprw, 0), (Command::Fprw, STATION)] {
        bench.write(0x1100, &[0, 0]);
        assert_eq!(bench.exchange(command, at(adp, 0x1000), &[8, 9]), (vec![1, 2], 3));
        assert_eq!(bench.read(0x1000, 2).unwrap(), [1, 2]);
        assert_eq!(bench.read(0x1100, 2).unwrap(), [8, 9]);
    }
    // Reading here, writing where nothing can be written.
    bench.write(0x0108, &0x0F00u16.to_le_bytes());
    assert_eq!(bench.exchange(Command::Brw, at(0, 0x0010), &[0, 0]), (vec![0x01, 0x10], 1));
}

#[test]
fn controllers_without_combined_commands_let_them_pass() {
    let mut hardware = hardware();
    hardware.features = Features(hardware.features).with_no_lrw(true).with_no_read_write(true).0;
    let mut bench = Bench::with(hardware, sii(false), Box::new(NoFirmware));
    let mut inputs = FmmuConfig::inputs(LogicalAddress(0), 4, RegisterAddress(0x1000));
    inputs.writes = true;
    bench.map(0, &inputs);
    let table: [(Command, DatagramAddress, u16); 7] = [
        (Command::Aprw, at(0, 0x1000), 0),
        (Command::Fprw, at(STATION, 0x1000), 0),
        (Command::Brw, at(0, 0x1000), 0),
        (Command::Lrw, logical(0), 0),
        (Command::Lrd, logical(0), 1),
        (Command::Lwr, logical(0), 1),
        (Command::Brd, at(0, 0x1000), 1),
    ];
    for (command, address, wkc) in table {
        assert_eq!(bench.exchange(command, address, &[0; 4]).1, wkc, "{command}");
    }
}

// proves: FRM-03 partial
#[test]
fn many_datagrams_of_a_frame_are_executed_in_turn() {
    let mut bench = Bench::new();
    let answers = bench.send(&[
        (Command::Bwr, at(0, 0x1000), &[1, 2, 3]),
        (Command::Brd, at(0, 0x1000), &[0, 0, 0]),
        (Command::Bwr, at(0, 0x0200), &[0x55, 0x00]),
        (Command::Brd, at(0, 0x0200), &[0, 0]),
        (Command::Nop, at(0, 0x0900), &[9; 4]),
    ]);
    assert_eq!(answers[1], (vec![1, 2, 3], 1), "RAM is written at once");
    assert_eq!(answers[3], (vec![0, 0], 1), "registers at the end of the frame");
    assert_eq!(answers[4], (vec![9; 4], 0));
    assert_eq!(bench.word(0x0200), 0x0055);
}
