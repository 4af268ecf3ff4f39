//! A segment on the bench.

use linesman_proto::address::{DeviceId, Path, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::ethernet::MacAddress;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::frame::{FrameBuilder, FrameView};
use linesman_proto::port::Port;
use linesman_proto::register::ErrorCounter;
use linesman_proto::time::{Instant, Span};
use linesman_sim::segment::{Arrival, Segment};
use linesman_sim::segment_file::{FaultEntry, SegmentFile};
use linesman_sim::truth::FaultId;

/// A line of one coupler with four terminals and two more stations behind it.
///
/// Numbers: K1 1, T2..T5 2..5, K6 6, T7 7, K8 8.
pub(crate) const PLANT: &str = r#"
name = "plant"
seed = 7

[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
cable_m = 10.0

[[device]]
name = "T2"
type = "EL1008"
on = "K1.B"

[[device]]
name = "T3"
type = "EL2008"
on = "T2.B"

[[device]]
name = "T4"
type = "EL2008"
on = "T3.B"

[[device]]
name = "T5"
type = "EL1008"
on = "T4.B"

[[device]]
name = "K6"
type = "EK1100"
on = "K1.C"
cable_m = 20.0

[[device]]
name = "T7"
type = "EL1008"
on = "K6.B"

[[device]]
name = "K8"
type = "EK1100"
on = "K6.C"
"#;

/// A segment, its clock, and what came back.
#[derive(Debug)]
pub(crate) struct Bench {
    pub(crate) segment: Segment,
    pub(crate) now: Instant,
    buffer: Vec<u8>,
}

impl Bench {
    pub(crate) fn new(text: &str) -> Self {
        let file = SegmentFile::parse(text).unwrap_or_else(|error| panic!("{error}"));
        Self::of(&file)
    }

    pub(crate) fn of(file: &SegmentFile) -> Self {
        let segment = Segment::build(file).unwrap_or_else(|error| panic!("{error}"));
        Self { segment, now: Instant::ZERO, buffer: Vec::new() }
    }

    pub(crate) fn plant() -> Self {
        Self::new(PLANT)
    }

    /// Time passes; what arrives is given.
    pub(crate) fn wait(&mut self, span: Span) -> Vec<(Arrival, Vec<u8>)> {
        self.now += span;
        self.segment.advance(self.now);
        let mut arrived = Vec::new();
        while let Some(arrival) = self.segment.poll_arrival(&mut self.buffer) {
            arrived.push((arrival, self.buffer.clone()));
        }
        arrived
    }

    /// Sends a frame by a card and waits for half a millisecond.
    pub(crate) fn send_by(&mut self, path: Path, frame: &[u8]) -> Vec<(Arrival, Vec<u8>)> {
        self.segment.handle_frame(self.now, path, frame);
        self.wait(Span::us(500))
    }

    /// Sends a datagram and gives data and working counter of the intact frame that came back.
    pub(crate) fn send(
        &mut self,
        command: Command,
        address: DatagramAddress,
        data: &[u8],
    ) -> Option<(Vec<u8>, u16)> {
        let arrived = self.send_by(Path::A, &frame(command, address, data));
        let (_, bytes) = arrived.into_iter().find(|(arrival, _)| arrival.intact)?;
        Some(answer(&bytes))
    }

    /// Broadcast read of a register: ORed data and working counter.
    pub(crate) fn broadcast(&mut self, ado: u16, len: usize) -> Option<(Vec<u8>, u16)> {
        self.send(Command::Brd, at(0, ado), &vec![0; len])
    }

    /// How many controllers answer a broadcast; `None` when nothing comes back.
    pub(crate) fn count(&mut self) -> Option<u16> {
        self.broadcast(0x0000, 1).map(|(_, wkc)| wkc)
    }

    pub(crate) fn id(&self, name: &str) -> DeviceId {
        let ids = (0..1_000).map(DeviceId);
        ids.into_iter()
            .find(|id| self.segment.name(*id) == name)
            .unwrap_or_else(|| panic!("{name}"))
    }

    /// All counters that are not 0 of controllers that have power, as `K1.C frame 3`, in order.
    pub(crate) fn counters(&self) -> Vec<String> {
        let mut shown = Vec::new();
        for id in self.segment.devices() {
            let controller = self.segment.controller(id).unwrap();
            if !controller.is_powered() {
                continue;
            }
            let counters = controller.error_counters();
            let name = self.segment.name(id);
            for (counter, value) in counters.iter().filter(|(_, value)| *value != 0) {
                let text = match counter {
                    ErrorCounter::InvalidFrame(port) => format!("{name}.{port} frame {value}"),
                    ErrorCounter::PhysicalLayer(port) => format!("{name}.{port} physical {value}"),
                    ErrorCounter::Forwarded(port) => format!("{name}.{port} forwarded {value}"),
                    ErrorCounter::LostLink(port) => format!("{name}.{port} lost {value}"),
                    ErrorCounter::ProcessingUnit => format!("{name} unit {value}"),
                    ErrorCounter::Pdi => format!("{name} pdi {value}"),
                };
                shown.push(text);
            }
        }
        shown
    }

    pub(crate) fn counter(&self, name: &str, counter: ErrorCounter) -> u8 {
        let controller = self.segment.controller(self.id(name)).unwrap();
        controller.error_counters().value(counter).unwrap()
    }

    pub(crate) fn physical(&self, name: &str, port: Port) -> u8 {
        self.counter(name, ErrorCounter::PhysicalLayer(port))
    }

    pub(crate) fn inject(&mut self, entry: &FaultEntry) -> FaultId {
        self.segment.inject(self.now, entry).unwrap_or_else(|error| panic!("{error}"))
    }

    pub(crate) fn heal(&mut self, fault: FaultId) {
        self.segment.heal(self.now, fault);
    }

    pub(crate) fn assert_audit(&mut self) {
        assert_eq!(self.segment.audit(), []);
    }
}

/// Shorthand for an address by station or position.
pub(crate) fn at(adp: u16, ado: u16) -> DatagramAddress {
    DatagramAddress::Physical(adp, RegisterAddress(ado))
}

/// A frame with one datagram.
pub(crate) fn frame(command: Command, address: DatagramAddress, data: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0; 1_514];
    let mut builder = FrameBuilder::new(&mut bytes, MacAddress([0, 1, 2, 3, 4, 5]));
    builder.push(command, 0, address, data.len()).unwrap().copy_from_slice(data);
    let len = builder.finish();
    bytes.truncate(len);
    bytes
}

/// Data and working counter of the first datagram.
pub(crate) fn answer(bytes: &[u8]) -> (Vec<u8>, u16) {
    let view = FrameView::parse(bytes).unwrap();
    let datagram = view.datagrams().next().unwrap().unwrap();
    (datagram.data().to_vec(), datagram.wkc().value())
}
