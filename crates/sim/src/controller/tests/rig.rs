//! A controller on the bench: frames in, frames out, and a hand on the other side.

use linesman_proto::address::{DeviceId, LogicalAddress, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::ethernet::MacAddress;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::frame::{FrameBuilder, FrameView};
use linesman_proto::port::{Port, PortMap};
use linesman_proto::register::{FmmuConfig, SmControl, SyncManagerConfig};
use linesman_proto::time::{Instant, Span};

use crate::controller::{Controller, Forwarding, LocalClock, Pdi, PortEvent};
use crate::device::{Firmware, NoFirmware, Signals};
use crate::frame::{Damage, WireFrame};
use crate::hardware::{CountingProfile, Hardware, PortKind, Timing};

/// Its station address on the bench.
pub(crate) const STATION: u16 = 0x1001;

/// A controller like an ET1100 with four ports and forwarded counters.
pub(crate) fn hardware() -> Hardware {
    Hardware {
        controller_type: 0x11,
        revision: 0,
        build: 2,
        fmmus: 8,
        sync_managers: 8,
        ram_kib: 8,
        // Distributed clocks of 64 bits, separate forwarded errors.
        features: 0x008C,
        ports: PortMap([PortKind::Mii, PortKind::Ebus, PortKind::Mii, PortKind::Ebus]),
        counting: CountingProfile {
            forwarded: true,
            remakes_symbol_errors: false,
            counts_when_closed: false,
            counts_missing_start: true,
        },
        timing: Timing {
            forward: Span::ns(130),
            process: Span::ns(150),
            ebus_crossing: Span::ns(20),
            mii_crossing: Span::ns(400),
            ebus_loss_detection: Span::us(2),
            mii_loss_detection: Span::us(15),
            ebus_link_up: Span::us(500),
            mii_link_up: Span::ms(1_500),
        },
    }
}

/// An SII with a configuration area that is not checked, and words 8 to 15 that count up. The SYNC
/// unit is on, and with it the time loop.
pub(crate) fn sii(device_emulation: bool) -> Vec<u8> {
    let mut image = vec![0x05, 0x04 | u8::from(device_emulation), 0, 0, 0, 0, 0, 0];
    image.extend([0xCD, 0xAB, 0, 0, 0, 0, 0xA4, 0x88]);
    image.extend((8u16..16).flat_map(u16::to_le_bytes));
    image
}

/// Shorthand for an address by station or position.
pub(crate) fn at(adp: u16, ado: u16) -> DatagramAddress {
    DatagramAddress::Physical(adp, RegisterAddress(ado))
}

/// Shorthand for a logical address.
pub(crate) fn logical(address: u32) -> DatagramAddress {
    DatagramAddress::Logical(LogicalAddress(address))
}

/// One datagram to send.
pub(crate) type Datagram<'a> = (Command, DatagramAddress, &'a [u8]);

/// A frame with these datagrams.
pub(crate) fn frame(datagrams: &[Datagram<'_>]) -> WireFrame {
    let mut bytes = vec![0; 1_514];
    let source = MacAddress([0, 1, 2, 3, 4, 5]);
    let mut builder = FrameBuilder::new(&mut bytes, source);
    for (index, (command, address, data)) in datagrams.iter().enumerate() {
        let slot = builder.push(*command, index as u8, *address, data.len()).unwrap();
        slot.copy_from_slice(data);
    }
    let len = builder.finish();
    bytes.truncate(len);
    WireFrame { bytes, damage: Damage::default(), number: 0 }
}

/// Data and working counter of each datagram of a frame.
pub(crate) fn answers(frame: &WireFrame) -> Vec<(Vec<u8>, u16)> {
    let view = FrameView::parse(&frame.bytes).unwrap();
    let datagrams = view.datagrams().map(Result::unwrap);
    datagrams.map(|datagram| (datagram.data().to_vec(), datagram.wkc().value())).collect()
}

/// A controller with power, its clock, and its surroundings.
#[derive(Debug)]
pub(crate) struct Bench {
    pub(crate) controller: Controller,
    pub(crate) signals: Signals,
    pub(crate) now: Instant,
    frames: u64,
}

impl Bench {
    /// A controller whose SII is loaded, with [`STATION`], without links, before a hand-driven
    /// device: AL control is answered by nobody.
    pub(crate) fn new() -> Self {
        Self::with(hardware(), sii(false), Box::new(NoFirmware))
    }

    pub(crate) fn with(hardware: Hardware, sii: Vec<u8>, firmware: Box<dyn Firmware>) -> Self {
        let clock = LocalClock::default();
        let mut signals = Signals::new(16);
        let mut controller = Controller::new(DeviceId(0), hardware, clock, firmware, sii);
        controller.power_on_before(Instant::ZERO, &mut signals);
        let mut bench = Self { controller, signals, now: Instant::ZERO, frames: 0 };
        bench.write(0x0010, &STATION.to_le_bytes());
        bench
    }

    /// Time passes.
    pub(crate) fn wait(&mut self, span: Span) {
        self.now += span;
        self.controller.advance(self.now, &mut self.signals);
    }

    /// A frame comes in by port A and passes the processing unit.
    pub(crate) fn pass(&mut self, frame: &mut WireFrame) -> Forwarding {
        self.frames += 1;
        frame.number = self.frames;
        let at = self.now;
        self.controller.advance(at, &mut self.signals);
        self.controller.enters(at, Port::A, frame);
        let verdict = self.controller.process(at, frame, &mut self.signals);
        self.wait(frame.duration() + Span::ns(960));
        verdict
    }

    /// Sends datagrams in one frame and gives data and working counter of each.
    pub(crate) fn send(&mut self, datagrams: &[Datagram<'_>]) -> Vec<(Vec<u8>, u16)> {
        let mut frame = frame(datagrams);
        assert_eq!(self.pass(&mut frame), Forwarding::Forward);
        answers(&frame)
    }

    /// Sends one datagram.
    pub(crate) fn exchange(
        &mut self,
        command: Command,
        address: DatagramAddress,
        data: &[u8],
    ) -> (Vec<u8>, u16) {
        self.send(&[(command, address, data)]).remove(0)
    }

    /// Reads by position; `None` when nothing answered.
    pub(crate) fn read(&mut self, ado: u16, len: usize) -> Option<Vec<u8>> {
        let (data, wkc) = self.exchange(Command::Aprd, at(0, ado), &vec![0; len]);
        (wkc == 1).then_some(data)
    }

    /// Reads one byte that must be there.
    pub(crate) fn byte(&mut self, ado: u16) -> u8 {
        self.read(ado, 1).unwrap_or_else(|| panic!("0x{ado:04X} did not answer"))[0]
    }

    /// Reads two bytes that must be there.
    pub(crate) fn word(&mut self, ado: u16) -> u16 {
        let bytes = self.read(ado, 2).unwrap_or_else(|| panic!("0x{ado:04X} did not answer"));
        u16::from_le_bytes([bytes[0], bytes[1]])
    }

    /// Writes by position and gives the working counter.
    pub(crate) fn write(&mut self, ado: u16, data: &[u8]) -> u16 {
        self.exchange(Command::Apwr, at(0, ado), data).1
    }

    /// Sets up a SyncManager.
    pub(crate) fn guard(&mut self, index: u16, start: u16, length: u16, control: SmControl) {
        let config = SyncManagerConfig::enabled(RegisterAddress(start), length, control);
        assert_eq!(self.write(0x0800 + 8 * index, &config.to_bytes()), 1);
    }

    /// Sets up an FMMU.
    pub(crate) fn map(&mut self, index: u16, config: &FmmuConfig) {
        assert_eq!(self.write(0x0600 + 16 * index, &config.to_bytes()), 1);
    }

    /// Does something from the device's side.
    pub(crate) fn pdi<T>(&mut self, act: impl FnOnce(&mut Pdi<'_>) -> T) -> T {
        let core = &mut self.controller.core;
        let result = act(&mut Pdi { core, signals: &mut self.signals, now: self.now });
        self.controller.reschedule();
        result
    }

    /// A link comes or goes now.
    pub(crate) fn link(&mut self, port: Port, up: bool) {
        self.controller.post(self.now, PortEvent::Link { port, up });
        self.wait(Span::ZERO);
    }

    /// Which loops are open.
    pub(crate) fn open(&self) -> [bool; 4] {
        Port::ALL.map(|port| self.controller.is_open(port))
    }
}
