//! MainDevice of one's own against a virtual segment: its frames go in as bytes and come back as bytes, and the
//! diagnosis watches them.
//!
//! `cargo run --example own_maindevice`. Here the MainDevice is one frame: a broadcast read of the AL status, which
//! counts who is there.

use linesman::{
    Diagnosis, FaultEntry, FaultName, RegisterAddress, SegmentFile, Span, VirtualWire, register,
};

/// Ethernet: broadcast, a local source, the EtherCAT type. EtherCAT (ETG.1000.4, 5.3): length and type of the
/// frame, then one datagram: command, index, address, length, interrupt, data, working counter.
const DESTINATION: [u8; 6] = [0xFF; 6];
const SOURCE: [u8; 6] = [2, 0, 0, 0, 0, 1];
const ETHERTYPE: [u8; 2] = [0x88, 0xA4];
const HEADER: usize = 16;
const BRD: u8 = 7;
const COUNTER_AT: usize = HEADER + 10 + 2;

fn broadcast_read(register: RegisterAddress, index: u8) -> Vec<u8> {
    let mut frame = [&DESTINATION[..], &SOURCE, &ETHERTYPE].concat();
    let datagram_len = 10 + 2 + 2_u16;
    frame.extend((datagram_len | 1 << 12).to_le_bytes());
    frame.extend([BRD, index, 0, 0]);
    frame.extend(register.0.to_le_bytes());
    frame.extend([2, 0, 0, 0]);
    frame.resize(60, 0); // the shortest frame of Ethernet, without check sequence
    frame
}

// region: own
/// Polls a segment, of which a device is switched off on the way. Gives each count of SubDevices.
pub fn poll(file: &SegmentFile) -> Result<(Vec<u16>, Diagnosis), linesman::Error> {
    let mut wire = VirtualWire::new(file)?;
    let off = FaultEntry::new(FaultName::DeviceOff).device("Lamps").from_to(500.0, None);
    wire.simulation().inject(&off)?;
    let mut counts = Vec::new();
    for index in 0..100 {
        let frame = broadcast_read(register::AL_STATUS.address, index);
        if let Some(back) = wire.exchange(&frame, Span::ms(1))? {
            let counter = [back[COUNTER_AT], back[COUNTER_AT + 1]];
            counts.push(u16::from_le_bytes(counter));
        }
        wire.wait(Span::ms(10))?;
    }
    Ok((counts, wire.diagnosis()))
}
// endregion

/// Polls a virtual segment.
pub fn main() -> Result<(), linesman::Error> {
    let devices = [("K1", "EK1100"), ("Buttons", "EL1008"), ("Lamps", "EL2008")];
    let (counts, diagnosis) = poll(&SegmentFile::in_a_row("machine", 1, &devices))?;
    println!("{counts:?}");
    for finding in &diagnosis.findings {
        println!("{} {}: {} at {}", finding.code, finding.name, finding.cause, finding.place);
    }
    Ok(())
}
