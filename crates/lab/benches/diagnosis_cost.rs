//! Cost of the diagnosis beside a running MainDevice: a line of 100 SubDevices, a cycle of 1 ms.
//!
//! The line runs in virtual time, with the MainDevice's own reads and the probes of a diagnosis; all that
//! passes is kept. Then a fresh engine takes it in, as the thread beside a real cycle does, and the time on
//! a processor is measured per second of the line: healthy, with error counters that move, those of
//! several links, and after a cut.
//!
//! `cargo bench -p linesman-lab --bench diagnosis_cost` prints it as a share of a core. For instructions,
//! which are steadier: `valgrind --tool=callgrind BENCH count CASE SECONDS` for two lengths; the difference
//! is the engine's, since the line is always played to its end.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a measurement that fails may panic")]
#![allow(clippy::disallowed_methods, clippy::disallowed_macros, reason = "it measures and prints")]
#![allow(clippy::disallowed_types, reason = "it measures")]

use std::fmt::Write as _;
use std::sync::{Arc, Mutex};

use linesman_config::project::Project;
use linesman_diagnosis::observe::{Direction, FrameSeen};
use linesman_diagnosis::{Engine, InputKind, Setup};
use linesman_lab::lab::Lab;
use linesman_lab::options::LabOptions;
use linesman_proto::address::{Network, Path};
use linesman_proto::time::{Instant, Span};
use linesman_sim::segment_file::SegmentFile;

const DEVICES: usize = 100;
const CYCLE: Span = Span::ms(1);
/// So long the line is watched after it is up.
const SECONDS: u64 = 4;
/// More is too much (DIA: at most 5 % of a core).
const MOST_PERCENT: f64 = 5.0;

/// What is put in, half a second after the line is up.
const CASES: [(&str, &str); 4] = [
    ("healthy", ""),
    ("counters", "kind = 'cable-degraded'\nat = 'D16.C-D32.A'\nhits_per_s = 200\nmovement_ms = 50"),
    // On several links at once: then their counters are read closely.
    (
        "interference",
        "kind = 'emc-noise'\nat = ['D0.C-D16.A', 'D16.C-D32.A', 'D32.C-D48.A', 'D64.C-D80.A']\n\
         hits_per_s = 200\nbursts_per_s = 20",
    ),
    ("cut", "kind = 'device-off'\ndevice = 'D70'"),
];

struct Frame {
    direction: Direction,
    time: Instant,
    bytes: Vec<u8>,
}

/// A line as it ran, from its bring-up on.
struct Recorded {
    project: Project,
    /// When it was up.
    up: Instant,
    frames: Vec<Frame>,
}

fn line() -> String {
    let mut text = "name = \"plant\"\nseed = 7\n".to_owned();
    for number in 0..DEVICES {
        // Couplers with fifteen terminals each: more would be too much for their E-bus.
        let kind = match number {
            _ if number % 16 == 0 => "EK1100",
            _ if number % 4 == 0 => "EL3102",
            _ if number % 2 == 0 => "EL2008",
            _ => "EL1008",
        };
        let on = match number {
            0 => "maindevice".to_owned(),
            _ if number % 16 == 0 => format!("D{}.C", number - 16),
            _ => format!("D{}.B", number - 1),
        };
        writeln!(text, "[[device]]\nname = \"D{number}\"\ntype = \"{kind}\"\non = \"{on}\"")
            .unwrap();
    }
    text
}

fn record(fault: &str) -> Recorded {
    let file = SegmentFile::parse(&line()).unwrap();
    let mut lab = Lab::new(&file, LabOptions { cycle: CYCLE, ..LabOptions::default() }).unwrap();
    let frames: Arc<Mutex<Vec<Frame>>> = Arc::default();
    let keep = Arc::clone(&frames);
    lab.set_tap(Box::new(move |seen| {
        let (direction, time) = (seen.direction, seen.time);
        keep.lock().unwrap().push(Frame { direction, time, bytes: seen.bytes.to_vec() });
    }));
    lab.wait_up(Span::s(60)).unwrap();
    let up = lab.now();
    lab.run_until(up + Span::ms(500)).unwrap();
    if !fault.is_empty() {
        let with = SegmentFile::parse(&format!("{}[[fault]]\n{fault}", line())).unwrap();
        lab.inject(&with.faults[0]).unwrap();
    }
    lab.run_until(up + Span::s(SECONDS)).unwrap();
    let project = lab.project().clone();
    drop(lab);
    let frames = Arc::into_inner(frames).unwrap().into_inner().unwrap();
    Recorded { project, up, frames }
}

/// Time of this thread on a processor, in ns.
fn cpu_ns() -> u64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    now.tv_sec.unsigned_abs() * 1_000_000_000 + now.tv_nsec.unsigned_abs()
}

/// Lets a fresh engine take it in for so long; gives ns on a processor per second of the line, from when it
/// is up.
fn play(recorded: &Recorded, seconds: u64) -> (f64, Engine) {
    let setup = Setup {
        input: InputKind::Driven,
        project: Some(recorded.project.clone()),
        host_counters: true,
        probes: true,
        ..Setup::default()
    };
    let mut engine = Engine::new(setup);
    let mut began = None;
    let until = recorded.up + Span::s(seconds);
    for (frame, number) in recorded.frames.iter().zip(1..) {
        if frame.time >= until {
            break;
        }
        if began.is_none() && frame.time >= recorded.up {
            began = Some(cpu_ns());
        }
        while let Some(due) = engine.poll_timeout().filter(|due| *due <= frame.time) {
            engine.handle_timeout(due);
        }
        engine.handle_frame(&FrameSeen {
            network: Network(0),
            path: Some(Path::A),
            direction: frame.direction,
            time: frame.time,
            number,
            fcs: None,
            truncated: false,
            probe: None,
            bytes: &frame.bytes,
        });
        while engine.poll_probe().is_some() {}
        while engine.poll_event().is_some() {}
    }
    let spent = cpu_ns() - began.expect("the line was up");
    (spent as f64 / seconds as f64, engine)
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [count, case, seconds] = arguments.as_slice()
        && count == "count"
    {
        let fault = CASES.iter().find(|(name, _)| name == case).expect("a case").1;
        play(&record(fault), seconds.parse().unwrap());
        return;
    }
    let mut worst = 0.0_f64;
    for (name, fault) in CASES {
        let recorded = record(fault);
        let in_a_second = recorded.frames.iter().filter(|frame| frame.time >= recorded.up).count()
            / SECONDS as usize;
        let mut best = f64::MAX;
        for _ in 0..5 {
            let (spent, engine) = play(&recorded, SECONDS);
            let told = engine.diagnosis();
            let found: Vec<_> = told.findings.iter().map(|one| one.code.as_str()).collect();
            assert_eq!(found.is_empty(), fault.is_empty(), "{name}: {found:?}");
            best = best.min(spent);
        }
        let percent = best / 1e7;
        worst = worst.max(percent);
        println!(
            "{name}: {percent:.2} % of a core, {DEVICES} SubDevices at 1 kHz, {in_a_second} frames/s out and back"
        );
    }
    assert!(worst <= MOST_PERCENT, "{worst:.2} % of a core is more than {MOST_PERCENT} %");
}
