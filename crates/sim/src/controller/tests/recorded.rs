//! Scans of real devices, recorded by others: the same frames go through controllers of ours, and
//! every working counter must be the one that came back from the real line.

use linesman_proto::address::DeviceId;
use linesman_proto::ethernet::SOURCE_MARK;
use linesman_proto::frame::{Datagram, FrameView};
use linesman_proto::port::{Port, PortMap};
use linesman_proto::register::STATION_ADDRESS;
use linesman_proto::time::Instant;

use super::rig::{hardware, sii};
use crate::controller::{Controller, LocalClock, PortEvent};
use crate::device::{NoFirmware, Signals};
use crate::frame::WireFrame;
use crate::hardware::PortKind;

/// Packets of a pcapng file: time in ns since its first packet, bytes.
pub(crate) fn packets(file: &[u8]) -> Vec<(u64, Vec<u8>)> {
    let u32_at = |at: usize| -> u32 {
        file.get(at..at + 4).map_or(0, |bytes| u32::from_le_bytes(bytes.try_into().unwrap()))
    };
    let mut packets = Vec::new();
    let (mut at, mut tick_ns) = (0, 1_000);
    while at + 12 <= file.len() {
        let len = u32_at(at + 4) as usize;
        match u32_at(at) {
            // Interface description: option 9 is the resolution, a power of ten.
            1 => {
                let mut option = at + 16;
                while option + 4 < at + len - 4 && u32_at(option) != 0 {
                    if u32_at(option) & 0xFFFF == 9 {
                        tick_ns = 10u64.pow(9 - u32::from(file[option + 4]));
                    }
                    option += 4 + (u32_at(option) >> 16).next_multiple_of(4) as usize;
                }
            }
            6 => {
                let time = u64::from(u32_at(at + 12)) << 32 | u64::from(u32_at(at + 16));
                let captured = u32_at(at + 20) as usize;
                packets.push((time * tick_ns, file[at + 28..at + 28 + captured].to_vec()));
            }
            _ => {}
        }
        at += len.max(12);
    }
    let first = packets.first().map_or(0, |packet| packet.0);
    packets.iter_mut().for_each(|packet| packet.0 = packet.0.saturating_sub(first));
    packets
}

/// A terminal of a recorded line.
struct Terminal {
    ports: [PortKind; 4],
    /// Registers 0x0000, 0x0004 and 0x0005: type, FMMUs, SyncManagers.
    size: (u8, u8, u8),
    /// Registers 0x0140 and 0x0141.
    configuration: [u8; 2],
    /// Its station address, where the recording begins behind the scan.
    station: u16,
}

/// The terminals of a line, nearest first, linked to each other.
fn line(terminals: &[Terminal], signals: &mut Signals) -> Vec<Controller> {
    let last = terminals.len() - 1;
    let build = |(index, terminal): (usize, &Terminal)| {
        let mut hardware = hardware();
        hardware.ports = PortMap(terminal.ports);
        (hardware.controller_type, hardware.fmmus, hardware.sync_managers) = terminal.size;
        hardware.counting.forwarded = false;
        hardware.features = 0x00FC;
        let mut image = sii(true);
        image[..2].copy_from_slice(&terminal.configuration);
        let (id, clock) = (DeviceId(index as u32), LocalClock::default());
        let mut controller = Controller::new(id, hardware, clock, Box::new(NoFirmware), image);
        controller.power_on_before(Instant::ZERO, signals);
        controller.core.memory.set_u16(&STATION_ADDRESS, terminal.station);
        controller.post(Instant::ZERO, PortEvent::Link { port: Port::A, up: true });
        let up = index < last;
        controller.post(Instant::ZERO, PortEvent::Link { port: Port::B, up });
        controller
    };
    terminals.iter().enumerate().map(build).collect()
}

/// What a datagram says, without what only the real device can know.
fn outline(datagram: &Datagram<'_>) -> (u8, u8, u16, u16, u16) {
    let (code, index) = (datagram.code(), datagram.index());
    (code, index, datagram.adp(), datagram.ado().value(), datagram.wkc().value())
}

/// Replays a capture. Gives how many datagrams agreed, and a line for each that did not.
fn replay(file: &[u8], terminals: &[Terminal]) -> (usize, Vec<String>) {
    let mut signals = Signals::default();
    let mut controllers = line(terminals, &mut signals);
    let packets = packets(file);
    let (mut agreed, mut differing) = (0, Vec::new());
    for (number, (time, sent)) in packets.iter().enumerate() {
        if sent[6] & SOURCE_MARK != 0 || FrameView::parse(sent).is_err() {
            continue;
        }
        let mut bytes = sent.clone();
        bytes.resize(bytes.len().max(60), 0);
        let mut frame = WireFrame { bytes, number: number as u64, ..WireFrame::default() };
        for controller in &mut controllers {
            let _ = controller.process(Instant::from_nanos(*time), &mut frame, &mut signals);
        }
        let Some(back) = answer_to(sent, &packets[number + 1..]) else { continue };
        let datagrams = FrameView::parse(&frame.bytes).unwrap().datagrams();
        let recorded = FrameView::parse(back).unwrap().datagrams();
        for (ours, real) in datagrams.zip(recorded) {
            let (ours, real) = (outline(&ours.unwrap()), outline(&real.unwrap()));
            if ours == real {
                agreed += 1;
            } else {
                differing.push(format!("frame {number}: ours {ours:04X?}, real {real:04X?}"));
            }
        }
    }
    (agreed, differing)
}

/// The frame that came back for one that went out: the next one with the same first datagram.
fn answer_to<'a>(sent: &[u8], later: &'a [(u64, Vec<u8>)]) -> Option<&'a Vec<u8>> {
    let first = |frame: &[u8]| {
        let datagram = FrameView::parse(frame).ok()?.datagrams().next()?.ok()?;
        Some((datagram.code(), datagram.index(), datagram.ado(), datagram.data_len()))
    };
    let frames = later.iter().take(8).map(|(_, frame)| frame);
    frames.into_iter().find(|frame| frame[6] & SOURCE_MARK != 0 && first(frame) == first(sent))
}

use PortKind::{Absent, Ebus, Mii};
const EK1100: Terminal = Terminal {
    ports: [Mii, Ebus, Mii, Absent],
    size: (0x11, 8, 8),
    configuration: [0x00, 0x0D],
    station: 0,
};
/// EL1004, EL2828.
const DIGITAL: Terminal = Terminal {
    ports: [Ebus, Ebus, Absent, Absent],
    size: (0x12, 3, 4),
    configuration: [0x04, 0x01],
    station: 0,
};
/// The same with its time loop on.
const EL2889: Terminal = Terminal { configuration: [0x04, 0x0D], ..DIGITAL };

// proves: FRM-02 partial, FRM-03 partial, FRM-15 partial
#[test]
#[allow(clippy::disallowed_methods, clippy::disallowed_macros)]
fn scans_of_real_lines_count_the_same() {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    let data = std::env::var("LINESMAN_DATA").unwrap_or(format!("{root}/../shared/data"));
    let known = |terminal: Terminal, station| Terminal { station, ..terminal };
    let table: [(&str, &[Terminal]); 6] = [
        ("ec-soem-sdinfo-ek1100-only", &[EK1100]),
        ("ec-soem-sdinfo-ek1100-el1004", &[EK1100, DIGITAL]),
        ("ec-twincat-run-ek1100-el1004", &[known(EK1100, 0x03E9), known(DIGITAL, 0x03EA)]),
        ("ec-rs-detect-slaves-ek1100-el1004", &[EK1100, DIGITAL]),
        ("ec-replay-ek1100-el2828-el2889", &[EK1100, DIGITAL, EL2889]),
        ("echist-no-reborrow-202307", &[EK1100, DIGITAL, EL2889]),
    ];
    for (name, terminals) in table {
        let Ok(file) = std::fs::read(format!("{data}/pcap/{name}.pcapng")) else {
            eprintln!("SKIPPED: no {name}.pcapng in {data}/pcap; set LINESMAN_DATA");
            continue;
        };
        let (agreed, differing) = replay(&file, terminals);
        assert_eq!(differing, Vec::<String>::new(), "{name}");
        assert!(agreed > 0, "{name}: nothing was compared");
    }
}
