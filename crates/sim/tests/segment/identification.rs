//! Explicit identification: one key of the file, three ways to read it.

use linesman_proto::command::Command;
use linesman_proto::sii::{General, Identification, Image};
use linesman_proto::time::Span;

use super::rig::{Bench, at};

fn line(id: &str) -> Bench {
    Bench::new(&format!(
        r#"
        [[device]]
        name = "K1"
        type = "EK1101"
        on = "maindevice"
        {id}
        [[device]]
        name = "A1"
        type = "EL3104"
        on = "K1.B"
        {id}
        [[device]]
        name = "T1"
        type = "EL1008"
        on = "A1.B"
        {id}
        "#
    ))
}

fn read(bench: &mut Bench, position: u16, ado: u16) -> u16 {
    let (data, wkc) =
        bench.send(Command::Aprd, at(0u16.wrapping_sub(position), ado), &[0; 2]).unwrap();
    assert_eq!(wkc, 1, "0x{ado:04X}");
    u16::from_le_bytes([data[0], data[1]])
}

fn request(bench: &mut Bench, position: u16, control: u16) -> (u16, u16) {
    let address = at(0u16.wrapping_sub(position), 0x0120);
    let (_, wkc) = bench.send(Command::Apwr, address, &control.to_le_bytes()).unwrap();
    assert_eq!(wkc, 1);
    bench.wait(Span::ms(20));
    (read(bench, position, 0x0130), read(bench, position, 0x0134))
}

fn way(bench: &Bench, name: &str) -> Identification {
    let controller = bench.segment.controller(bench.id(name)).unwrap();
    let image = Image::parse(controller.sii()).unwrap();
    image.general().map_or(Identification::None, General::identification)
}

// proves: HC-04 partial: a virtual device tells it; nobody compares it yet
#[test]
fn a_number_of_the_file_is_read_in_each_of_three_ways() {
    let mut bench = line("id = 300");
    // A coding switch: a word in memory.
    let Identification::Memory(switch) = way(&bench, "K1") else { panic!() };
    assert_eq!(read(&mut bench, 0, switch.0), 300);
    // Bit 5 of AL control, in INIT already; the code is back when the bit is taken away.
    assert_eq!(way(&bench, "A1"), Identification::AlStatus);
    assert_eq!(request(&mut bench, 1, 0x0021), (0x0021, 300));
    assert_eq!(request(&mut bench, 1, 0x0001), (0x0001, 0));
    // Not while there is an error to tell of.
    assert_eq!(request(&mut bench, 1, 0x0028), (0x0011, 0x0011));
    assert_eq!(request(&mut bench, 1, 0x0021), (0x0021, 300), "INIT is heard, and acknowledges");
    // The alias, which needs no more than the SII.
    assert_eq!(way(&bench, "T1"), Identification::None);
    assert_eq!(read(&mut bench, 2, 0x0012), 300);
    bench.send(Command::Bwr, at(0, 0x0103), &[1]);
    let (_, wkc) = bench.send(Command::Fprd, at(300, 0x0000), &[0; 2]).unwrap();
    assert_eq!(wkc, 1, "it answers to the alias once that is allowed");
}

#[test]
fn without_a_number_it_is_zero() {
    let mut bench = line("");
    let Identification::Memory(switch) = way(&bench, "K1") else { panic!() };
    assert_eq!(read(&mut bench, 0, switch.0), 0);
    assert_eq!(request(&mut bench, 1, 0x0021), (0x0021, 0));
    assert_eq!(read(&mut bench, 2, 0x0012), 0);
}
