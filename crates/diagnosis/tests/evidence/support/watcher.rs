//! A small MainDevice on a virtual segment, watched by the engine: it gives station addresses and then
//! reads link status, state and error counters of one SubDevice after the other.

use linesman_diagnosis::{Direction, Engine, FrameSeen, HostEvent, HostObservation, Setup};
use linesman_proto::address::{Network, Path, Position, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::ethernet::MacAddress;
use linesman_proto::frame::FrameBuilder;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::time::{Instant, Span};
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::SegmentFile;

/// Between two frames.
pub const CYCLE: Span = Span::ms(1);

pub struct Watcher {
    pub segment: Segment,
    pub engine: Engine,
    pub now: Instant,
    devices: u16,
    frames: u64,
    host: Option<(u64, u64)>,
}

impl Watcher {
    /// Watches a segment that is as described; `host` is whether the card's own counters are known.
    pub fn new(file: &SegmentFile, host: bool) -> Self {
        let segment = Segment::build(file).unwrap();
        let project = file.project().unwrap();
        let devices = project.devices.len() as u16;
        let setup = Setup { project: Some(project), host_counters: host, ..Setup::default() };
        let mut watcher = Self {
            segment,
            engine: Engine::new(setup),
            now: Instant::ZERO,
            devices,
            frames: 0,
            host: host.then_some((0, 0)),
        };
        watcher.frame(|frame| {
            let everybody = DatagramAddress::Physical(0, RegisterAddress(0));
            frame.push(Command::Brd, 0, everybody, 1).unwrap();
        });
        for position in 0..devices {
            watcher.frame(|frame| {
                let adp = Position(position).auto_increment();
                let address = DatagramAddress::Physical(adp, RegisterAddress(0x0010));
                let data = frame.push(Command::Apwr, 0, address, 2).unwrap();
                data.copy_from_slice(&(0x1001 + position).to_le_bytes());
            });
        }
        watcher
    }

    fn frame(&mut self, fill: impl FnOnce(&mut FrameBuilder<'_>)) {
        let mut buffer = [0; 1514];
        let mut builder = FrameBuilder::new(&mut buffer, MacAddress([0x10, 0, 0, 0, 0, 1]));
        fill(&mut builder);
        let len = builder.finish();
        // All datagrams of a frame bear the index by which it is known again.
        let index = self.frames as u8;
        let mut at = 16;
        loop {
            buffer[at + 1] = index;
            let word = u16::from_le_bytes([buffer[at + 6], buffer[at + 7]]);
            at += 12 + usize::from(word & 0x7FF);
            if word & 0x8000 == 0 {
                break;
            }
        }
        self.frames += 1;
        self.show(Direction::Sent, self.now, &buffer[..len]);
        self.segment.handle_frame(self.now, Path::A, &buffer[..len]);
        self.now += CYCLE;
        self.segment.advance(self.now);
        let mut arrived = Vec::new();
        while let Some(arrival) = self.segment.poll_arrival(&mut arrived) {
            if arrival.intact {
                self.show(Direction::Received, arrival.at, &arrived);
            }
        }
        self.engine.handle_timeout(self.now);
    }

    fn show(&mut self, direction: Direction, time: Instant, bytes: &[u8]) {
        self.engine.handle_frame(&FrameSeen {
            network: Network(0),
            path: Some(Path::A),
            direction,
            time,
            number: self.frames,
            fcs: None,
            truncated: false,
            probe: None,
            bytes,
        });
    }

    fn observe_host(&mut self) {
        let port = self.segment.host(Path::A);
        let Some((crc, other)) = self.host else { return };
        self.host = Some((port.rx_crc_errors, port.rx_length_errors));
        for what in [
            HostEvent::Carrier(port.carrier),
            HostEvent::CardErrors {
                crc: port.rx_crc_errors - crc,
                other: port.rx_length_errors - other,
            },
        ] {
            let (network, path, time) = (Network(0), Path::A, self.now);
            self.engine.handle_host(&HostObservation { network, path, time, what });
        }
    }

    /// Reads one SubDevice after the other until then.
    pub fn run_until(&mut self, end: Instant) {
        while self.now < end {
            for no in 0..self.devices {
                let station = 0x1001 + no;
                self.frame(|frame| {
                    let everybody = DatagramAddress::Physical(0, RegisterAddress(0x0130));
                    frame.push(Command::Brd, 0, everybody, 2).unwrap();
                    for (register, len) in [(0x0110, 2), (0x0130, 6), (0x0300, 20)] {
                        let address = DatagramAddress::Physical(station, RegisterAddress(register));
                        frame.push(Command::Fprd, 0, address, len).unwrap();
                    }
                });
            }
            self.observe_host();
        }
    }
}
