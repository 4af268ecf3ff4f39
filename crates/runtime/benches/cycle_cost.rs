//! What one cycle costs the MainDevice, as `linesman run` ships it: working counters judged, frames
//! tallied, shown to the diagnosis, the application watched.
//!
//! Without arguments: a table of ns per cycle for lines of 10, 100 and 1,000 SubDevices and for one
//! LRW of 64 and of 1,400 bytes. `count KIND CYCLES` runs so many cycles of one kind, for counting
//! instructions: the difference of two runs is that of the cycles between.
//! `scripted` is the same loop without a MainDevice: what the harness itself costs.

#![allow(clippy::type_complexity, reason = "tables of a bench")]

use std::hint::black_box;
use std::time::Instant as HostInstant;

use linesman_config::plan::{Plan, PlanOptions, Role};
use linesman_diagnosis::{Direction, FrameSeen};
use linesman_maindevice::{Event, MainDevice, Options};
use linesman_proto::address::{Network, Path};
use linesman_proto::frame::{DATAGRAM_HEADER_LEN, DATAGRAM_OVERHEAD};
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};
use linesman_runtime::run::tap::{Tap, tap};
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::SegmentFile;

const CYCLE: Span = Span::ms(1);
/// Nothing but the cycle: watching the SubDevices in between is measured by itself.
const NEVER: Span = Span::s(1_000_000);

/// Terminals behind a coupler, so many of each type.
fn file(counts: &[(&str, usize)]) -> SegmentFile {
    let mut text = "name = \"cost\"\nseed = 1\n[[device]]\nname = \"K\"\ntype = \"EK1100\"\n\
                    on = \"maindevice\"\n"
        .to_owned();
    let (mut before, mut number) = ("K".to_owned(), 0);
    for (kind, count) in counts {
        for _ in 0..*count {
            number += 1;
            let name = format!("T{number}");
            text +=
                &format!("[[device]]\nname = \"{name}\"\ntype = \"{kind}\"\non = \"{before}.B\"\n");
            before = name;
        }
    }
    SegmentFile::parse(&text).expect("a segment file")
}

/// A running MainDevice, and what makes an answer of one of its frames.
struct Cycle {
    main: MainDevice,
    now: Instant,
    tap: Tap,
    /// Offset and value of each working counter by frame length, and of the AL states.
    answers: Vec<(usize, Vec<(usize, [u8; 2])>)>,
    buffer: Vec<u8>,
    frames: u64,
    bytes: usize,
}

impl Cycle {
    fn new(counts: &[(&str, usize)], monitor: bool) -> Self {
        let file = file(counts);
        let mut segment = Segment::build(&file).expect("a segment");
        let options = Options {
            watch_interval: NEVER,
            mailbox_interval: NEVER,
            allowed_misses: Some(0),
            ..Options::default()
        };
        let mut main = MainDevice::new(Network(0), options);
        let mut now = Instant::ZERO;
        main.scan(now);
        let scanned =
            run(&mut main, &mut segment, &mut now, |event| matches!(event, Event::Scanned(_)));
        let Event::Scanned(inventory) = scanned else { panic!("{scanned:?}") };
        let options = PlanOptions { cycle: CYCLE, ..PlanOptions::default() };
        let planned = inventory.planned(AlState::Op);
        let mut plan = Plan::build(&planned, inventory.tree().clone(), &options).expect("a plan");
        if !monitor {
            for frame in &mut plan.tasks[0].frames {
                frame.datagrams.retain(|datagram| datagram.role != Role::Presence);
            }
            plan.tasks[0].frames.retain(|frame| !frame.datagrams.is_empty());
        }
        let answers = answers(&plan);
        let bytes = plan
            .datagrams()
            .map(|(_, _, one)| one.ownership.iter().map(|own| own.range.len()).sum::<usize>())
            .sum();
        main.start(now, plan);
        run(&mut main, &mut segment, &mut now, |event| matches!(event, Event::AllReached));
        let (tap, listener) = tap(false);
        std::thread::spawn(move || {
            let mut done = None;
            while let Some(log) = listener.next(done.take()) {
                done = Some(log);
            }
        });
        let mut cycle = Self { main, now, tap, answers, buffer: vec![0; 1514], frames: 0, bytes };
        // What is still on its way through the segment is given up.
        for _ in 0..50 {
            cycle.turn();
        }
        cycle
    }

    /// One cycle: outputs in, frames out and back, inputs out.
    #[inline(never)]
    fn turn(&mut self) {
        self.now = self.main.poll_timeout().unwrap_or(self.now).max(self.now);
        self.main.handle_timeout(self.now);
        if let Some(first) = self.main.outputs_mut().first_mut() {
            *first = first.wrapping_add(1);
        }
        while let Some(transmit) = self.main.poll_transmit(self.now, &mut self.buffer) {
            let frame = &mut self.buffer[..transmit.len];
            self.frames += 1;
            self.tap.frame(&seen(self.frames, Direction::Sent, self.now, frame));
            scripted(&self.answers, frame);
            let at = self.now + Span::us(20);
            self.frames += 1;
            self.tap.frame(&seen(self.frames, Direction::Received, at, frame));
            self.main.handle_frame(at, Path::A, frame);
        }
        black_box(self.main.inputs().first());
        while let Some(event) = self.main.poll_event() {
            black_box(event);
        }
        self.tap.turn(self.now);
    }
}

/// Turns a frame into its answer.
#[inline(never)]
fn scripted(answers: &[(usize, Vec<(usize, [u8; 2])>)], frame: &mut [u8]) {
    frame[6] |= 2;
    let Some((_, changes)) = answers.iter().find(|(len, _)| *len == frame.len()) else { return };
    for (at, word) in changes {
        frame[*at..*at + 2].copy_from_slice(word);
    }
}

fn answers(plan: &Plan) -> Vec<(usize, Vec<(usize, [u8; 2])>)> {
    use linesman_config::plan::expect::{PathView, Presence, expect};
    let all = Presence::full(plan.devices.len());
    let frame = |frame: &linesman_config::plan::FramePlan| {
        let (mut at, mut changes) = (16, Vec::new());
        for datagram in &frame.datagrams {
            let wkc = expect(datagram, &all, PathView::Merged).0;
            let data_at = at + DATAGRAM_HEADER_LEN;
            if datagram.role == Role::Presence {
                changes.push((data_at, [8, 0]));
            }
            changes.push((data_at + datagram.len, wkc.to_le_bytes()));
            at += datagram.len + DATAGRAM_OVERHEAD;
        }
        (frame.size().max(60), changes)
    };
    plan.tasks[0].frames.iter().map(frame).collect()
}

fn seen(number: u64, direction: Direction, time: Instant, bytes: &[u8]) -> FrameSeen<'_> {
    FrameSeen {
        network: Network(0),
        path: Some(Path::A),
        direction,
        time,
        number,
        fcs: None,
        truncated: false,
        bytes,
    }
}

/// Runs both in virtual time until an event.
fn run(
    main: &mut MainDevice,
    segment: &mut Segment,
    now: &mut Instant,
    done: impl Fn(&Event) -> bool,
) -> Event {
    let (mut buffer, mut arrival) = (vec![0; 1514], Vec::new());
    let end = *now + Span::s(60);
    loop {
        while let Some(transmit) = main.poll_transmit(*now, &mut buffer) {
            segment.handle_frame(*now, transmit.path, &buffer[..transmit.len]);
        }
        while let Some(event) = main.poll_event() {
            if done(&event) {
                return event;
            }
        }
        let due = [main.poll_timeout(), segment.poll_timeout()].into_iter().flatten().min();
        *now = due.unwrap_or(end).max(*now);
        assert!(*now < end, "it takes too long");
        segment.advance(*now);
        while let Some(came) = segment.poll_arrival(&mut arrival) {
            main.handle_frame(came.at.max(*now), came.path, &arrival);
        }
        main.handle_timeout(*now);
    }
}

/// What is measured: its name, the line, whether the broadcast read is in the frame.
const LINES: &[(&str, &[(&str, usize)], bool)] = &[
    ("64", &[("EL4102", 8), ("EL3102", 4)], false),
    ("1400", &[("EL4102", 175), ("EL3102", 87), ("EL1008", 4)], false),
    ("64+monitor", &[("EL4102", 8), ("EL3102", 4)], true),
    ("10", &[("EL1008", 5), ("EL2008", 4)], true),
    ("100", &[("EL1008", 50), ("EL2008", 49)], true),
    ("1000", &[("EL1008", 500), ("EL2008", 499)], true),
];

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|one| one != "--bench").collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments[..] {
        ["count", "scripted", cycles] => {
            let mut frame = vec![0; 92];
            let answers = [(92, vec![(90, [3, 0])])];
            for _ in 0..cycles.parse::<u64>().expect("a number") {
                scripted(black_box(&answers), black_box(&mut frame));
            }
        }
        ["count", kind, cycles] => {
            let line = LINES.iter().find(|line| line.0 == kind).expect("a kind");
            let mut cycle = Cycle::new(line.1, line.2);
            let before = cycle.main.statistics();
            for _ in 0..cycles.parse::<u64>().expect("a number") {
                cycle.turn();
            }
            let after = cycle.main.statistics();
            assert_eq!(after.working_counter_errors, before.working_counter_errors);
            assert_eq!(after.frames_lost, before.frames_lost);
            println!("{kind}: {} bytes of process data", cycle.bytes);
        }
        _ => table(),
    }
}

fn table() {
    println!("{:>12} {:>8} {:>8} {:>10}", "line", "bytes", "frames", "ns/cycle");
    for (name, counts, monitor) in LINES {
        let mut cycle = Cycle::new(counts, *monitor);
        let mut best = f64::INFINITY;
        for _ in 0..7 {
            let (cycles, begin) = (20_000, HostInstant::now());
            for _ in 0..cycles {
                cycle.turn();
            }
            best = best.min(begin.elapsed().as_nanos() as f64 / f64::from(cycles));
        }
        let statistics = cycle.main.statistics();
        assert_eq!(statistics.cyclic_unsent, 0);
        let frames = cycle.answers.len();
        println!("{name:>12} {:>8} {frames:>8} {best:>10.0}", cycle.bytes);
    }
}
