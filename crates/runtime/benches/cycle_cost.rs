//! Cost of one cycle for the MainDevice, as `linesman run` ships it: working counters judged,
//! frames tallied, shown to the diagnosis, the application watched.
//!
//! Without arguments: a table of ns per cycle for lines of 10, 100 and 1,000 SubDevices and for one
//! LRW of 64 and of 1,400 bytes. `count KIND CYCLES` runs so many cycles of one kind, for counting
//! instructions: the difference of two runs is that of the cycles between.
//! `count scripted BYTES CYCLES` is what the harness itself costs: the far end, which makes an answer of
//! each frame of so many bytes, and the card, which puts it where it is to be received.
//!
//! As in `run`, a frame that is sent is built in the log of the tap, and one that comes back is received
//! there. The thread that takes the logs is there; nothing is left out.

#![allow(clippy::type_complexity, reason = "tables of a bench")]

mod steady;

use std::hint::black_box;
use std::time::Instant as HostInstant;

use linesman_diagnosis::Direction;
use linesman_maindevice::MainDevice;
use linesman_proto::address::Path;
use linesman_proto::time::{Instant, Span};
use linesman_runtime::run::tap::{Tap, tap};
use linesman_session::frame::FrameSummary;

use steady::{Answer, Running, answers, received, running, scripted};

const CYCLE: Span = Span::ms(1);
/// A running MainDevice, and what makes an answer of one of its frames.
struct Cycle {
    main: MainDevice,
    now: Instant,
    tap: Tap,
    answers: Vec<Answer>,
    frames: u64,
    bytes: usize,
}

impl Cycle {
    fn new(counts: &[(&str, usize)], monitor: bool) -> Self {
        let Running { main, now, plan } = running(counts, monitor, CYCLE);
        let answers = answers(&plan);
        let bytes = plan
            .datagrams()
            .map(|(_, _, one)| one.ownership.iter().map(|own| own.range.len()).sum::<usize>())
            .sum();
        // It waits where the other thread is behind, so that the work of keeping frames is counted.
        let (tap, listener) = tap(true);
        std::thread::spawn(move || {
            let mut done = None;
            while let Some(log) = listener.next(done.take()) {
                done = Some(log);
            }
        });
        let mut cycle = Self { main, now, tap, answers, frames: 0, bytes };
        // What is still on its way through the segment is given up.
        for _ in 0..50 {
            cycle.turn();
        }
        cycle
    }

    /// One cycle: outputs in, frames out and back, inputs out.
    #[inline(never)]
    fn turn(&mut self) {
        let Self { main, tap, answers, .. } = self;
        let now = main.poll_timeout().unwrap_or(self.now).max(self.now);
        let mut number = self.frames;
        main.handle_timeout(now);
        if let Some(first) = main.outputs_mut().first_mut() {
            *first = first.wrapping_add(1);
        }
        while main.may_transmit(now) {
            let room = tap.room(now);
            let Some(transmit) = main.poll_transmit(now, room) else { break };
            let answer = scripted(answers, &room[..transmit.len]);
            number += 1;
            let (path, truncated) = (Some(transmit.path), false);
            let direction = Direction::Sent;
            tap.keep(&FrameSummary { time: now, number, path, direction, truncated }, transmit.len);
            let at = now + Span::us(20);
            let room = tap.room(at);
            let len = received(answer, room);
            main.handle_frame(at, Path::A, &room[..len]);
            number += 1;
            let (path, direction) = (Some(Path::A), Direction::Received);
            tap.keep(&FrameSummary { time: at, number, path, direction, truncated }, len);
        }
        black_box(main.inputs().first());
        while let Some(event) = main.poll_event() {
            black_box(event);
        }
        tap.turn(now);
        (self.now, self.frames) = (now, number);
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
        ["count", "scripted", bytes, cycles] => {
            let len = 26 + bytes.parse::<usize>().expect("a number") + 2;
            let (frame, mut room) = (vec![0; len], [0; 1_536]);
            let mut answers = [Answer { bytes: frame.clone(), indices: vec![17] }];
            for _ in 0..cycles.parse::<u64>().expect("a number") {
                let answer = scripted(black_box(&mut answers), black_box(&frame));
                black_box(received(answer, black_box(&mut room)));
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
            assert_eq!(cycle.tap.left_out(), 0);
            assert_eq!(cycle.main.inputs().last(), Some(&0x5A));
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
