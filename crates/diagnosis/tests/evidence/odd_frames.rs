//! Frames of somebody who tries what a line bears, sent into a virtual segment beside a MainDevice that drives it: they may
//! harm the line, and must not make the diagnosis invent one.

use crate::support::script::{Datagram, brd, fprd, frame_of};
use crate::support::text;
use linesman_diagnosis::coverage::InputKind;
use linesman_diagnosis::{Direction, Engine, FrameSeen, Setup};
use linesman_proto::address::{Network, Path, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::ethernet::MacAddress;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::time::{Instant, Span};
use linesman_sim::seed::{Seed, Stream};
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::SegmentFile;

const LINE: &str = "name = \"line\"\nseed = 1\n\
    [[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
    [[device]]\nname = \"I1\"\ntype = \"EL1008\"\non = \"K1.B\"\n\
    [[device]]\nname = \"O1\"\ntype = \"EL2008\"\non = \"I1.B\"\n\
    [[device]]\nname = \"A1\"\ntype = \"EL3104\"\non = \"O1.B\"\n";
const DEVICES: u16 = 4;
const MAINDEVICE: MacAddress = MacAddress([0x01; 6]);
const STRANGER: MacAddress = MacAddress([0x66; 6]);

struct Bench {
    segment: Segment,
    engine: Engine,
    now: Instant,
    number: u64,
}

impl Bench {
    fn new() -> Self {
        let file = SegmentFile::parse(LINE).unwrap();
        let setup = Setup { input: InputKind::Listened, ..Setup::default() };
        let (segment, engine) = (Segment::build(&file).unwrap(), Engine::new(setup));
        Self { segment, engine, now: Instant::from_nanos(1_000_000), number: 0 }
    }

    fn show(&mut self, direction: Direction, time: Instant, bytes: &[u8]) {
        self.number += 1;
        let (network, number) = (Network(0), self.number);
        let (path, fcs, truncated) = (None, None, false);
        let seen = FrameSeen {
            network,
            path,
            direction,
            time,
            number,
            fcs,
            truncated,
            probe: None,
            bytes,
        };
        self.engine.handle_frame(&seen);
    }

    fn send(&mut self, bytes: &[u8]) {
        self.show(Direction::Sent, self.now, bytes);
        self.segment.handle_frame(self.now, Path::A, bytes);
        self.now += Span::us(500);
        self.segment.advance(self.now);
        let mut arrived = Vec::new();
        while let Some(arrival) = self.segment.poll_arrival(&mut arrived) {
            let back = std::mem::take(&mut arrived);
            self.show(Direction::Received, arrival.at, &back);
        }
        self.engine.handle_timeout(self.now);
    }

    /// A round of the MainDevice: all counted, and the state of each read.
    fn round(&mut self, index: u8) {
        let address = |station| DatagramAddress::Physical(station, RegisterAddress(0x0130));
        let state = |station| Datagram { address: address(station), ..fprd(0, 0x0130, &[0; 6]) };
        let all = (0x1001..0x1001 + DEVICES).map(state);
        let request: Vec<Datagram> = std::iter::once(brd(0x0130, &[0; 2], 0))
            .chain(all)
            .map(|datagram| datagram.wkc(0))
            .collect();
        self.send(&frame_of(MAINDEVICE, &request, index, false));
    }

    fn give_addresses(&mut self) {
        for position in 0..DEVICES {
            let station = (0x1001 + position).to_le_bytes();
            let adp = 0_u16.wrapping_sub(position);
            let write = Datagram {
                command: Command::Apwr,
                address: DatagramAddress::Physical(adp, RegisterAddress(0x0010)),
                sent: station.to_vec(),
                ..fprd(0, 0x0010, &[0; 2]).wkc(0)
            };
            self.send(&frame_of(MAINDEVICE, &[write], position as u8, false));
        }
    }
}

/// A read of the MainDevice with some bytes behind its Ethernet header set at random; never a write, which would harm the
/// line itself.
fn mutated(stream: &mut Stream) -> Vec<u8> {
    const READS: [u8; 4] = [1, 4, 7, 10];
    let mut bytes = frame_of(STRANGER, &[brd(0x0130, &[0; 2], 0).wkc(0)], 0, false);
    for _ in 0..stream.between(1, 4) {
        let at = stream.between(17, bytes.len() as u64 - 1) as usize;
        bytes[at] = stream.below(256) as u8;
    }
    bytes[16] = *stream.pick(&READS).unwrap();
    bytes
}

#[test]
fn ten_thousand_odd_frames_are_a_second_maindevice_and_nothing_else() {
    let mut bench = Bench::new();
    bench.give_addresses();
    let mut stream = Seed(7).stream("odd");
    for index in 0..=255 {
        bench.round(index);
        for _ in 0..40 {
            let odd = mutated(&mut stream);
            bench.send(&odd);
        }
    }
    bench.engine.finish(bench.now, true);
    let report = bench.engine.diagnosis();
    assert_eq!(report.network.devices.0, u64::from(DEVICES), "{}", text(&report));
    let codes: Vec<_> = report.findings.iter().map(|finding| finding.code.as_str()).collect();
    assert_eq!(codes, ["C330"], "{}", text(&report));
}
