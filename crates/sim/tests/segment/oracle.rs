//! The literal walk as an oracle: a segment that lets every frame walk port by port, and one that
//! spares frames the walk where it can, are told the same and must show the same, byte by byte.
//!
//! `LINESMAN_ORACLE_SEEDS` says how many seeds instead of 10,000; `LINESMAN_ORACLE_FIRST` is the
//! first.

use std::fmt::Write as _;

use linesman_proto::address::{LogicalAddress, Path, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::ethernet::MacAddress;
use linesman_proto::frame::FrameBuilder;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::register::FmmuConfig;
use linesman_proto::time::{Instant, Span};
use linesman_sim::device::SignalId;
use linesman_sim::fault::PlaceRule;
use linesman_sim::seed::{Seed, Stream};
use linesman_sim::segment::{Arrival, Segment};
use linesman_sim::segment_file::{PlantOptions, SegmentFile, plant};
use linesman_sim::truth::FaultId;

use super::swarm::any_fault;

/// Both segments, told the same.
struct Pair {
    /// Every frame walks.
    literal: Segment,
    direct: Segment,
    now: Instant,
    seed: u64,
}

type Arrivals = Vec<(Arrival, Vec<u8>)>;

fn arrivals(segment: &mut Segment) -> Arrivals {
    let mut buffer = Vec::new();
    std::iter::from_fn(|| segment.poll_arrival(&mut buffer).map(|came| (came, buffer.clone())))
        .collect()
}

impl Pair {
    fn new(file: &SegmentFile, seed: u64) -> Self {
        let mut literal = Segment::build(file).unwrap();
        let direct = Segment::build(file).unwrap();
        literal.set_walks_always(true);
        Self { literal, direct, now: Instant::ZERO, seed }
    }

    fn both(&mut self) -> [&mut Segment; 2] {
        [&mut self.literal, &mut self.direct]
    }

    fn send(&mut self, path: Path, frame: &[u8]) {
        let now = self.now;
        for segment in self.both() {
            segment.handle_frame(now, path, frame);
        }
    }

    fn wait(&mut self, span: Span) {
        self.now += span;
        let now = self.now;
        let [literal, direct] = self.both().map(|segment| {
            segment.advance(now);
            arrivals(segment)
        });
        assert_eq!(literal, direct, "seed {} at {now}: what came back", self.seed);
    }

    /// Everything that can be seen is the same.
    fn compare(&self) {
        let (one, other) = (&self.literal, &self.direct);
        let seed = self.seed;
        for id in one.devices() {
            let (left, right) = (one.controller(id).unwrap(), other.controller(id).unwrap());
            let name = one.name(id);
            if left.registers() != right.registers() || left.ram() != right.ram() {
                let differ = (0..=u16::MAX).map(RegisterAddress);
                let differ = differ.filter(|at| left.register(*at) != right.register(*at));
                let mut text = String::new();
                for at in differ.take(20) {
                    let (left, right) = (left.register(at), right.register(at));
                    let _ = write!(text, " {at}: {left:02X}/{right:02X}");
                }
                panic!("seed {seed} at {}: {name} (literal/direct):{text}", self.now);
            }
            assert_eq!(left.next_event(), right.next_event(), "seed {seed}: {name}, next event");
        }
        assert_eq!(one.truth().entries(), other.truth().entries(), "seed {seed}: truth");
        assert_eq!(one.truth().faults(), other.truth().faults(), "seed {seed}: faults");
        assert_eq!(one.signals(), other.signals(), "seed {seed}: signals");
        for path in Path::ALL {
            assert_eq!(one.host(path), other.host(path), "seed {seed}: card {path}");
        }
    }
}

fn frame(datagrams: &[(Command, DatagramAddress, Vec<u8>)]) -> Vec<u8> {
    let mut bytes = vec![0; 1_514];
    let mut builder = FrameBuilder::new(&mut bytes, MacAddress([0, 1, 2, 3, 4, 5]));
    for (command, address, data) in datagrams {
        if let Ok(slot) = builder.push(*command, 0, *address, data.len()) {
            slot.copy_from_slice(data);
        }
    }
    let len = builder.finish();
    bytes.truncate(len);
    bytes
}

const REGISTERS: &[u16] = &[
    0x0000, 0x0010, 0x0012, 0x0040, 0x0100, 0x0101, 0x0103, 0x0110, 0x0120, 0x0130, 0x0134, 0x0140,
    0x0200, 0x0204, 0x0210, 0x0220, 0x0300, 0x0308, 0x030C, 0x0310, 0x0400, 0x0420, 0x0440, 0x0442,
    0x0500, 0x0502, 0x0508, 0x0600, 0x0610, 0x0800, 0x0805, 0x0808, 0x080D, 0x0818, 0x0900, 0x0910,
    0x0918, 0x0920, 0x0928, 0x0930, 0x0980, 0x0F00, 0x0F80, 0x1000, 0x1001, 0x1080, 0x1100,
];

const COMMANDS: &[Command] = &[
    Command::Nop,
    Command::Aprd,
    Command::Apwr,
    Command::Aprw,
    Command::Fprd,
    Command::Fpwr,
    Command::Fprw,
    Command::Brd,
    Command::Bwr,
    Command::Brw,
    Command::Lrd,
    Command::Lwr,
    Command::Lrw,
    Command::Armw,
    Command::Frmw,
];

/// Mostly reads, as on a line in operation; now and then anything.
fn any_datagram(stream: &mut Stream, devices: u64) -> (Command, DatagramAddress, Vec<u8>) {
    const USUAL: &[Command] =
        &[Command::Brd, Command::Brd, Command::Fprd, Command::Aprd, Command::Lrw, Command::Lrd];
    let commands = if stream.chance(0.6) { USUAL } else { COMMANDS };
    let command = *stream.pick(commands).unwrap();
    let len = if stream.chance(0.8) { stream.between(1, 8) } else { stream.below(120) };
    let data = match stream.below(3) {
        0 => vec![0; len as usize],
        1 => (0..len).map(|_| [0, 1, 2, 4, 8][stream.below(5) as usize]).collect(),
        _ => (0..len).map(|_| stream.number() as u8).collect(),
    };
    if matches!(command, Command::Lrd | Command::Lwr | Command::Lrw) {
        let at = 0x1_0000 + stream.below(devices * 8 + 4) as u32;
        return (command, DatagramAddress::Logical(LogicalAddress(at)), data);
    }
    let mut ado = *stream.pick(REGISTERS).unwrap();
    if stream.chance(0.05) {
        ado = stream.number() as u16;
    }
    // What closes loops or resets comes seldom: a line that is cut off says little.
    if matches!(ado, 0x0040 | 0x0100..=0x0103) && !stream.chance(0.1) {
        ado = 0x0130;
    }
    let adp = match stream.below(10) {
        0 => stream.number() as u16,
        1 => 0,
        2..6 => 0u16.wrapping_sub(stream.below(devices + 1) as u16),
        _ => 0x1001 + stream.below(devices + 1) as u16,
    };
    (command, DatagramAddress::Physical(adp, RegisterAddress(ado)), data)
}

/// Addresses, SyncManagers, FMMUs and states, as a MainDevice would set them up, more or less.
fn set_up(pair: &mut Pair, stream: &mut Stream, devices: u16) {
    let at = |adp, ado| DatagramAddress::Physical(adp, RegisterAddress(ado));
    for no in 0..devices {
        let station = 0x1001 + no;
        let position = at(0u16.wrapping_sub(no), 0x0010);
        pair.send(Path::A, &frame(&[(Command::Apwr, position, station.to_le_bytes().to_vec())]));
        let mut datagrams = Vec::new();
        for index in 0..stream.between(0, 4) as u16 {
            let start = *stream.pick(&[0x1000u16, 0x1080, 0x1100, 0x0F00]).unwrap();
            let length = *stream.pick(&[0u16, 1, 2, 4, 32]).unwrap();
            let control = *stream.pick(&[0x00, 0x04, 0x20, 0x24, 0x64, 0x44, 0x26, 0x22]).unwrap();
            let [low, high] = start.to_le_bytes();
            let record = vec![low, high, length as u8, 0, control, 0, 1, 0];
            datagrams.push((Command::Fpwr, at(station, 0x0800 + 8 * index), record));
        }
        for index in 0..stream.between(0, 3) as u16 {
            let logical = LogicalAddress(0x1_0000 + stream.below(u64::from(devices) * 8) as u32);
            let physical = *stream.pick(&[0x1000u16, 0x1080, 0x1100, 0x0F00, 0x080D]).unwrap();
            let len = stream.between(1, 4) as u16;
            let mut config = FmmuConfig::inputs(logical, len, RegisterAddress(physical));
            config.writes = stream.chance(0.5) && physical != 0x080D;
            config.reads = !config.writes || stream.chance(0.2);
            if stream.chance(0.3) {
                config.logical_stop_bit = stream.below(8) as u8;
                config.physical_start_bit = stream.below(8) as u8;
            }
            let record = config.to_bytes().to_vec();
            datagrams.push((Command::Fpwr, at(station, 0x0600 + 16 * index), record));
        }
        if stream.chance(0.2) {
            datagrams.push((Command::Fpwr, at(station, 0x0200), vec![0xFF, 0x07]));
        }
        pair.send(Path::A, &frame(&datagrams));
        pair.wait(Span::us(stream.between(50, 300)));
    }
    for state in [2, 4, 8] {
        pair.send(Path::A, &frame(&[(Command::Bwr, at(0, 0x0120), vec![state, 0])]));
        pair.wait(Span::ms(stream.between(1, 40)));
    }
}

/// A line from a seed, its faults, and what is asked of it. Says how many frames needed no walk.
fn run(seed: u64) -> (u64, u64) {
    let mut stream = Seed(seed).stream("oracle");
    let options = PlantOptions {
        min_devices: 1,
        max_devices: 8,
        junction: stream.chance(0.2),
        ring: stream.chance(0.2),
        all_types: stream.chance(0.5),
    };
    let file = plant(Seed(seed), &options);
    let mut pair = Pair::new(&file, seed);
    let devices = pair.direct.tree().len() as u64;
    pair.wait(Span::us(1));
    if stream.chance(0.7) {
        set_up(&mut pair, &mut stream, devices as u16);
    }
    let mut running: Vec<FaultId> = Vec::new();
    for _ in 0..stream.between(5, 40) {
        match stream.below(30) {
            0 => inject(&mut pair, &mut stream, &file, &mut running),
            1 => {
                if let Some(fault) = running.pop() {
                    let now = pair.now;
                    for segment in pair.both() {
                        segment.heal(now, fault);
                    }
                }
            }
            2 | 3 => {
                let count = pair.direct.signals().len() as u64;
                let (signal, value) = (stream.below(count.max(1)) as u32, stream.below(3) as i32);
                for segment in pair.both() {
                    segment.signals_mut().set(SignalId(signal), value);
                }
            }
            _ => {}
        }
        let count = stream.between(1, 4);
        let datagrams: Vec<_> = (0..count).map(|_| any_datagram(&mut stream, devices)).collect();
        let mut bytes = frame(&datagrams);
        if stream.chance(0.02) {
            bytes.truncate(stream.between(20, 60) as usize);
        }
        let path = if options.ring && stream.chance(0.3) { Path::B } else { Path::A };
        pair.send(path, &bytes);
        // Sometimes the next one follows at its heels.
        if stream.chance(0.9) {
            let span = match stream.below(20) {
                0 => Span::ms(stream.between(1, 150)),
                1 => Span::ns(stream.below(2_000)),
                _ => Span::us(stream.between(5, 400)),
            };
            pair.wait(span);
        } else {
            pair.now += Span::ns(stream.between(5_760, 40_000));
        }
        if stream.chance(0.05) {
            pair.wait(Span::ZERO);
            pair.compare();
        }
    }
    pair.wait(Span::ms(stream.between(1, 300)));
    pair.compare();
    assert_eq!(pair.literal.audit(), pair.direct.audit(), "seed {seed}");
    assert_eq!(pair.literal.frames_without_walk(), 0);
    (pair.direct.frames_without_walk(), pair.direct.host(Path::A).tx_frames)
}

fn inject(pair: &mut Pair, stream: &mut Stream, file: &SegmentFile, running: &mut Vec<FaultId>) {
    let mut entry = any_fault(file, stream);
    let kinds = linesman_sim::fault::KINDS.iter();
    let noisy = kinds.filter(|kind| kind.name.name() == entry.kind);
    if noisy.into_iter().any(|kind| kind.place != PlaceRule::Device) && stream.chance(0.3) {
        let from = pair.now.as_nanos() as f64 / 1e6 + stream.fraction() * 5.0;
        entry = entry.from_to(from, Some(from + stream.fraction() * 50.0));
    }
    let now = pair.now;
    let [literal, direct] = pair.both().map(|segment| segment.inject(now, &entry).ok());
    assert_eq!(literal, direct);
    running.extend(direct);
}

// proves: ESC-07 partial: the way that is not walked shows what the walk does
#[test]
#[allow(clippy::disallowed_methods, reason = "how many seeds is for whoever runs it to say")]
fn fast_path_equals_the_walk() {
    let number = |name: &str| std::env::var(name).ok().and_then(|text| text.parse().ok());
    let first = number("LINESMAN_ORACLE_FIRST").unwrap_or(0);
    let seeds = number("LINESMAN_ORACLE_SEEDS").unwrap_or(10_000);
    let (mut direct, mut sent) = (0, 0);
    for seed in first..first + seeds {
        let (without_walk, frames) = run(seed);
        direct += without_walk;
        sent += frames;
    }
    assert!(seeds < 100 || direct * 3 > sent, "{direct} of {sent} frames needed no walk");
}
