//! Time that a frame takes in process: from `handle_frame` to the bytes that `poll_arrival` gives.
//!
//! ```text
//! cargo bench -p linesman-sim --bench frames             the table
//! cargo bench -p linesman-sim --bench frames -- growth   lines of 10 to 65,535 controllers
//! cargo bench -p linesman-sim --bench frames -- count BRD 100 1000 [HITS_PER_S]
//!                       so many frames and nothing else, to be counted by valgrind or perf
//! ```
//!
//! Plants are of many types of devices, in OP. "Hits" are a schedule of so many destroyed symbols a
//! second on the first cable; "walk" lets every frame walk port by port.

#![allow(clippy::disallowed_types, clippy::disallowed_methods, reason = "this measures time")]
#![allow(clippy::print_stdout, clippy::disallowed_macros, reason = "this prints a table")]

use std::hint::black_box;
use std::time::{Duration, Instant as Clock};

use linesman_config::fault::FaultName;
use linesman_proto::address::{LogicalAddress, Path, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::ethernet::MacAddress;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::frame::{FrameBuilder, FrameView};
use linesman_proto::register::{self as r, FmmuConfig};
use linesman_proto::time::{Instant, Span};
use linesman_sim::seed::Seed;
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::{FaultEntry, PlantOptions, SegmentFile, plant};

/// What the best open emulator needs per frame, in ns, at 1, 8, 32 and 100 devices.
const PEER: [(&str, [f64; 4]); 3] = [
    ("BRD", [45.0, 170.0, 563.0, 1_692.0]),
    ("LRW, nothing mapped", [50.0, 220.0, 772.0, 2_380.0]),
    ("FPRD", [38.0, 103.0, 343.0, 990.0]),
];
const SIZES: [usize; 4] = [1, 8, 32, 100];
const STATION: u16 = 0x1001;
const MAPPED: u32 = 0x1_0000;

fn frame(command: Command, address: DatagramAddress, data: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0; 1_514];
    let mut builder = FrameBuilder::new(&mut bytes, MacAddress::default());
    builder.push(command, 0, address, data.len()).expect("the data fit").copy_from_slice(data);
    let len = builder.finish();
    bytes.truncate(len);
    bytes
}

fn physical(adp: u16, register: RegisterAddress) -> DatagramAddress {
    DatagramAddress::Physical(adp, register)
}

/// A segment and its clock.
struct Bench {
    segment: Segment,
    now: Instant,
    buffer: Vec<u8>,
    /// From frame to frame: longer than one is on its way.
    cycle: Span,
}

impl Bench {
    fn new(file: &SegmentFile) -> Self {
        let segment = Segment::build(file).expect("it can be built");
        let cycle = Span::us(100) + Span::ns(segment.tree().len() as u64 * 1_500);
        Self { segment, now: Instant::from_nanos(1_000_000), buffer: Vec::new(), cycle }
    }

    #[inline]
    fn send(&mut self, frame: &[u8]) -> bool {
        self.segment.handle_frame(self.now, Path::A, frame);
        self.now += self.cycle;
        self.segment.advance(self.now);
        black_box(self.segment.poll_arrival(&mut self.buffer)).is_some()
    }

    fn counted(&mut self, frame: &[u8]) -> u16 {
        assert!(self.send(frame), "it comes back");
        let view = FrameView::parse(&self.buffer).expect("a frame");
        view.datagrams().next().expect("a datagram").expect("whole").wkc().0
    }

    /// Station addresses, one byte of RAM of each mapped, all in OP.
    fn set_up(&mut self) {
        for no in 0..self.segment.tree().len() as u16 {
            let station = STATION.wrapping_add(no);
            let position = physical(0u16.wrapping_sub(no), r::STATION_ADDRESS.address);
            self.send(&frame(Command::Apwr, position, &station.to_le_bytes()));
            let at = LogicalAddress(MAPPED + u32::from(no));
            let config = FmmuConfig::inputs(at, 1, RegisterAddress(0x1000));
            let third = RegisterAddress(r::FMMU.address.0 + 2 * 16);
            self.send(&frame(Command::Fpwr, physical(station, third), &config.to_bytes()));
        }
        for state in [2, 4, 8] {
            self.send(&frame(Command::Bwr, physical(0, r::AL_CONTROL.address), &[state, 0]));
            self.now += Span::ms(100);
        }
    }
}

fn of_size(devices: usize, hits_per_s: f64) -> Bench {
    let options =
        PlantOptions { min_devices: devices, max_devices: devices, ..PlantOptions::default() };
    let mut file = plant(Seed(1), &options);
    if hits_per_s > 0.0 {
        let link = format!("maindevice-{}.A", file.devices[0].name);
        let noise = FaultEntry::new(FaultName::EmcNoise).at(link);
        file.faults.push(noise.with("hits_per_s", hits_per_s));
    }
    let mut bench = Bench::new(&file);
    bench.set_up();
    bench
}

fn frame_of(name: &str, devices: usize) -> Vec<u8> {
    let logical = |at| DatagramAddress::Logical(LogicalAddress(at));
    match name {
        "BRD" => frame(Command::Brd, physical(0, r::AL_STATUS.address), &[0; 2]),
        "FPRD" => {
            let last = STATION + devices as u16 - 1;
            frame(Command::Fprd, physical(last, r::AL_STATUS.address), &[0; 2])
        }
        "APRD" => {
            let last = 0u16.wrapping_sub(devices as u16 - 1);
            frame(Command::Aprd, physical(last, r::AL_STATUS.address), &[0; 2])
        }
        "LRW, 4 bytes mapped" => frame(Command::Lrw, logical(MAPPED), &[0; 4]),
        "LRW, all mapped" => frame(Command::Lrw, logical(MAPPED), &vec![0; devices]),
        _ => frame(Command::Lrw, logical(0x8_0000), &[0; 16]),
    }
}

/// Nanoseconds a frame on a processor, over so many that hits come as often as they should: the best
/// of short rounds would be one without any.
fn measure_on_processor(bench: &mut Bench, frame: &[u8]) -> f64 {
    const FRAMES: u32 = 40_000;
    // What Linux counts for this thread, in ns; elsewhere time that passes.
    let begin = Clock::now();
    let counted = || {
        let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
        text.split(' ').next()?.parse::<u64>().ok()
    };
    let nanos =
        || counted().map_or_else(|| begin.elapsed().as_nanos() as f64, |nanos| nanos as f64);
    let round = |bench: &mut Bench| {
        let before = nanos();
        for _ in 0..FRAMES {
            bench.send(frame);
        }
        (nanos() - before) / f64::from(FRAMES)
    };
    (0..3).map(|_| round(bench)).fold(f64::MAX, f64::min)
}

/// Nanoseconds a frame, the best of many short rounds: on a machine that others use, too, some of
/// them are not interrupted.
fn measure(bench: &mut Bench, frame: &[u8]) -> f64 {
    const ROUNDS: u32 = 60;
    const ROUND: Duration = Duration::from_micros(400);
    let round = |bench: &mut Bench, frames: u32| {
        let begin = Clock::now();
        for _ in 0..frames {
            bench.send(frame);
        }
        begin.elapsed() / frames
    };
    let about = (0..5).map(|_| round(bench, 20)).min().unwrap_or_default();
    let frames = (ROUND.as_nanos() / about.as_nanos().max(1)).clamp(1, 5_000) as u32;
    let best = (0..ROUNDS).map(|_| round(bench, frames)).min();
    best.unwrap_or_default().as_nanos() as f64
}

fn table() {
    println!("ns per frame (in brackets: million controllers a second)");
    println!("{:32}{:>16}{:>16}{:>16}{:>16}", "", 1, 8, 32, 100);
    let row = |name: &str, cells: &[f64]| {
        let cells = cells.iter().zip(SIZES);
        let cells = cells.map(|(ns, size)| format!("{ns:.0} ({:.0})", size as f64 * 1e3 / ns));
        let cells: String = cells.map(|cell| format!("{cell:>16}")).collect();
        println!("{name:32}{cells}");
    };
    let names =
        ["BRD", "LRW, nothing mapped", "LRW, 4 bytes mapped", "LRW, all mapped", "FPRD", "APRD"];
    for name in names {
        if let Some((_, peer)) = PEER.iter().find(|(peer, _)| *peer == name) {
            row(&format!("{name}: best other"), peer);
        }
        for (kind, hits_per_s, walks) in [
            ("quiet", 0.0, false),
            ("100 hits/s", 100.0, false),
            ("1000 hits/s", 1_000.0, false),
            ("walk", 0.0, true),
        ] {
            let cells = SIZES.map(|size| {
                let mut bench = of_size(size, hits_per_s);
                bench.segment.set_walks_always(walks);
                let frame = frame_of(name, size);
                let hits = hits_per_s > 0.0;
                let measure = if hits { measure_on_processor } else { measure };
                measure(&mut bench, &frame)
            });
            row(&format!("{name}: {kind}"), &cells);
        }
    }
}

/// A coupler and terminals, half of them inputs, half outputs.
fn line(devices: usize) -> SegmentFile {
    let (inputs, outputs) = ((devices - 1) / 2, devices - 1 - (devices - 1) / 2);
    let text = format!(
        "name = \"line\"\n[[device]]\nname = \"K\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
         [[device]]\nname = \"I\"\ntype = \"EL1008\"\non = \"K.B\"\nrepeat = {inputs}\n\
         [[device]]\nname = \"O\"\ntype = \"EL2008\"\non = \"I[{inputs}].B\"\nrepeat = {outputs}\n"
    );
    SegmentFile::parse(&text).expect("a line")
}

fn growth() {
    println!(
        "{:>8}{:>12}{:>14}{:>8}{:>12}{:>12}{:>12}{:>12}",
        "devices", "build", "bytes/device", "WKC", "BRD", "ns/device", "FPRD", "LRW 4 bytes"
    );
    for devices in [10, 100, 1_000, 10_000, 65_535] {
        let file = line(devices);
        let begin = Clock::now();
        let mut built = None;
        let memory = allocation_counter::measure(|| built = Some(Bench::new(&file)));
        let build = begin.elapsed();
        let Some(mut bench) = built else { return };
        let brd = frame_of("BRD", devices);
        let wkc = bench.counted(&brd);
        bench.set_up();
        let last = STATION.wrapping_add(devices as u16 - 1);
        let fprd = frame(Command::Fprd, physical(last, r::AL_STATUS.address), &[0; 2]);
        let brd = measure(&mut bench, &brd);
        let fprd = measure(&mut bench, &fprd);
        let lrw = measure(&mut bench, &frame_of("LRW, 4 bytes mapped", devices));
        println!(
            "{devices:>8}{:>9.0} ms{:>14}{wkc:>8}{:>9.1} us{:>12.1}{fprd:>9.0} ns{lrw:>9.0} ns",
            build.as_secs_f64() * 1e3,
            memory.bytes_current / devices as i64,
            brd / 1e3,
            brd / devices as f64,
        );
    }
}

/// So many frames, for whoever counts instructions from outside.
fn count(arguments: &[String]) {
    let [name, devices, frames, kind @ ..] = arguments else { return };
    let hits_per_s = kind.first().and_then(|rate| rate.parse().ok()).unwrap_or(0.0);
    let (devices, frames) = (devices.parse().unwrap_or(100), frames.parse().unwrap_or(1_000u32));
    let mut bench = of_size(devices, hits_per_s);
    let frame = frame_of(name, devices);
    for _ in 0..frames {
        bench.send(&frame);
    }
    println!("{frames} frames, {} without a walk", bench.segment.frames_without_walk());
}

fn main() {
    let arguments: Vec<String> =
        std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    match arguments.first().map(String::as_str) {
        Some("growth") => growth(),
        Some("count") => count(&arguments[1..]),
        _ => table(),
    }
}
