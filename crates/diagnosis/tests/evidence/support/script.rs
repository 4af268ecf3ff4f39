//! Captures made by hand: what a MainDevice sends and what a line would answer, frame by frame.

use linesman_diagnosis::{Direction, Engine, FrameSeen, Setup};
use linesman_proto::address::{LogicalAddress, Network, Path, Position, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::ethernet::MacAddress;
use linesman_proto::frame::FrameBuilder;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::time::Instant;

const SENDER: MacAddress = MacAddress([0x10; 6]);

/// One datagram, out and back.
#[derive(Clone, Debug)]
pub struct Datagram {
    pub command: Command,
    pub address: DatagramAddress,
    pub sent: Vec<u8>,
    pub back: Vec<u8>,
    pub wkc: u16,
    /// What the controllers added to ADP.
    pub passed: u16,
    /// The event field, as controllers have left it.
    pub events: u16,
}

/// A broadcast read that `count` controllers answer.
pub fn brd(register: u16, back: &[u8], count: u16) -> Datagram {
    let address = DatagramAddress::Physical(0, RegisterAddress(register));
    Datagram {
        command: Command::Brd,
        address,
        sent: vec![0; back.len()],
        back: back.to_vec(),
        wkc: count,
        passed: count,
        events: 0,
    }
}

/// A read of one station.
pub fn fprd(station: u16, register: u16, back: &[u8]) -> Datagram {
    let address = DatagramAddress::Physical(station, RegisterAddress(register));
    Datagram {
        command: Command::Fprd,
        address,
        sent: vec![0; back.len()],
        back: back.to_vec(),
        wkc: 1,
        passed: 0,
        events: 0,
    }
}

/// A write to one station.
pub fn fpwr(station: u16, register: u16, data: &[u8]) -> Datagram {
    let address = DatagramAddress::Physical(station, RegisterAddress(register));
    Datagram {
        command: Command::Fpwr,
        address,
        sent: data.to_vec(),
        back: data.to_vec(),
        wkc: 1,
        passed: 0,
        events: 0,
    }
}

/// A write to a position of a line of `count` controllers.
pub fn apwr(position: u16, register: u16, data: &[u8], count: u16) -> Datagram {
    let adp = Position(position).auto_increment();
    let address = DatagramAddress::Physical(adp, RegisterAddress(register));
    Datagram {
        command: Command::Apwr,
        address,
        sent: data.to_vec(),
        back: data.to_vec(),
        wkc: 1,
        passed: count,
        events: 0,
    }
}

/// Process data.
pub fn lrw(start: u32, len: usize, wkc: u16) -> Datagram {
    Datagram {
        command: Command::Lrw,
        address: DatagramAddress::Logical(LogicalAddress(start)),
        sent: vec![0; len],
        back: vec![0; len],
        wkc,
        passed: 0,
        events: 0,
    }
}

impl Datagram {
    /// The same, with another working counter.
    pub fn wkc(mut self, wkc: u16) -> Self {
        self.wkc = wkc;
        if wkc == 0 {
            self.back.clone_from(&self.sent);
        }
        self
    }

    /// The same, with events of controllers.
    pub fn events(mut self, events: u16) -> Self {
        self.events = events;
        self
    }

    /// The same, with other data on its way back.
    pub fn back(mut self, data: &[u8]) -> Self {
        self.back = data.to_vec();
        self
    }
}

/// A frame with these datagrams, on its way out or back.
pub fn frame(datagrams: &[Datagram], index: u8, is_back: bool) -> Vec<u8> {
    frame_of(SENDER, datagrams, index, is_back)
}

/// The same of another sender.
pub fn frame_of(sender: MacAddress, datagrams: &[Datagram], index: u8, is_back: bool) -> Vec<u8> {
    let source = if is_back { sender.marked() } else { sender };
    let mut buffer = vec![0; 1514];
    let mut builder = FrameBuilder::new(&mut buffer, source);
    let mut at = 16;
    let mut counters = Vec::new();
    for (offset, datagram) in datagrams.iter().enumerate() {
        let address = match (datagram.address, is_back) {
            (DatagramAddress::Physical(adp, ado), true) => {
                DatagramAddress::Physical(adp.wrapping_add(datagram.passed), ado)
            }
            (address, _) => address,
        };
        let data = if is_back { &datagram.back } else { &datagram.sent };
        let index = index.wrapping_add(offset as u8);
        builder.push(datagram.command, index, address, data.len()).unwrap().copy_from_slice(data);
        at += 10 + data.len();
        counters.push((at, datagram));
        at += 2;
    }
    let len = builder.finish();
    if is_back {
        for (at, datagram) in counters {
            buffer[at..at + 2].copy_from_slice(&datagram.wkc.to_le_bytes());
            let events = at - datagram.sent.len() - 2;
            buffer[events..events + 2].copy_from_slice(&datagram.events.to_le_bytes());
        }
    }
    buffer.truncate(len);
    buffer
}

/// Drives an engine with frames, 100 µs from one to the next.
pub struct Script {
    pub engine: Engine,
    pub now: u64,
    pub number: u64,
    pub index: u8,
    /// Whether the directions are told, as a live socket does.
    pub is_live: bool,
    pub path: Option<Path>,
    /// The source address of the MainDevice.
    pub sender: MacAddress,
}

impl Script {
    pub fn new() -> Self {
        Self::with(Setup::default())
    }

    pub fn with(setup: Setup) -> Self {
        let engine = Engine::new(setup);
        Self {
            engine,
            now: 1_000_000,
            number: 0,
            index: 0,
            is_live: false,
            path: None,
            sender: SENDER,
        }
    }

    /// A line of `count` devices, scanned: station addresses 0x1001 and up, all in PREOP.
    pub fn scanned(count: u16) -> Self {
        let mut script = Self::new();
        script.scan(count);
        script
    }

    pub fn scan(&mut self, count: u16) {
        self.exchange(&[brd(0x0000, &[0x11, 0], count)]);
        for position in 0..count {
            let station = (0x1001 + position).to_le_bytes();
            self.exchange(&[apwr(position, 0x0010, &station, count)]);
        }
        for position in 0..count {
            let is_last = position + 1 == count;
            let dl: u16 = if is_last { 0x5611 | 0x06 } else { 0x5A33 | 0x04 };
            self.exchange(&[
                fprd(0x1001 + position, 0x0110, &dl.to_le_bytes()),
                fprd(0x1001 + position, 0x0130, &[2, 0, 0, 0, 0, 0]),
                fprd(0x1001 + position, 0x0300, &[0; 20]),
            ]);
        }
    }

    /// A request and its return.
    pub fn exchange(&mut self, datagrams: &[Datagram]) {
        self.send(datagrams);
        self.give_back(datagrams);
        self.index = self.index.wrapping_add(datagrams.len() as u8);
    }

    /// Only the request.
    pub fn vanish(&mut self, datagrams: &[Datagram]) {
        self.send(datagrams);
        self.index = self.index.wrapping_add(datagrams.len() as u8);
    }

    pub fn send(&mut self, datagrams: &[Datagram]) {
        let direction = if self.is_live { Direction::Sent } else { Direction::Unknown };
        self.feed(&frame_of(self.sender, datagrams, self.index, false), direction, 80_000);
    }

    pub fn give_back(&mut self, datagrams: &[Datagram]) {
        let direction = if self.is_live { Direction::Received } else { Direction::Unknown };
        self.feed(&frame_of(self.sender, datagrams, self.index, true), direction, 20_000);
    }

    pub fn feed(&mut self, bytes: &[u8], direction: Direction, after: u64) {
        self.now += after;
        self.number += 1;
        let seen = FrameSeen {
            network: Network(0),
            path: self.path,
            direction,
            time: Instant::from_nanos(self.now),
            number: self.number,
            fcs: None,
            truncated: false,
            probe: None,
            bytes,
        };
        self.engine.handle_frame(&seen);
    }

    pub fn finish(&mut self) {
        self.engine.finish(Instant::from_nanos(self.now), true);
    }
}
