//! Time that a virtual segment takes to answer over a virtual cable, beside a bare reflector: a
//! thread that sends back each frame as it came, with the same sockets, on the same cable, in turns
//! in the same run. The client sleeps until its answer comes, as MainDevices do.
//!
//! `cargo bench -p linesman-runtime --bench answer_over_veth`, as root: it makes a network namespace
//! of its own. Exit status 1 when the segment of one SubDevice needs more than 1.5 times as long.

#![allow(clippy::unwrap_used, reason = "a benchmark that cannot go on may panic")]

mod own_namespace;

use std::process::ExitCode;
use std::thread;

use linesman_link::clock::{HostClock, tighten_timers};
use linesman_link::real_time::sched_fifo;
use linesman_link::socket::{Batch, RawSocket, SocketOptions, Waitable, Waker, wait_any};
use linesman_proto::address::Path;
use linesman_proto::time::{Instant, Span};
use linesman_runtime::serve::{ServeControls, Server};
use linesman_runtime::stop::Stop;
use linesman_runtime::wiring::Wiring;
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::SegmentFile;

use own_namespace::{FAR, NEAR};

/// What the segment may need, of what the reflector needs.
const BAR: f64 = 1.5;
const ROUNDS: usize = 10;
const FRAMES: usize = 1_000;
const LINES: [usize; 3] = [1, 8, 30];
/// Not below the priority of the segment's thread.
const PRIORITY: u8 = 10;

fn main() -> ExitCode {
    own_namespace::run(inside)
}

fn inside() -> ExitCode {
    tighten_timers();
    if sched_fifo(PRIORITY).is_err() {
        println!("without real-time priority: other programs are measured too");
    }
    let mut reflector = Times::default();
    let mut lines = LINES.map(|_| Times::default());
    for _ in 0..ROUNDS {
        reflector.add(reflected());
        for (count, times) in LINES.into_iter().zip(&mut lines) {
            times.add(answered(count));
        }
    }
    println!("answer over veth, BRD in 60 bytes, {} frames each", ROUNDS * FRAMES);
    let base = reflector.median();
    println!("{:<18} {reflector}", "bare reflector");
    let mut first = f64::NAN;
    for (count, times) in LINES.into_iter().zip(&lines) {
        let ratio = times.median() / base;
        if count == 1 {
            first = ratio;
        }
        let own = on_the_wire(count).as_nanos() as f64 / 1e3;
        println!(
            "{:<18} {times}  {ratio:.2} of the reflector; the line itself takes {own:.1} µs",
            format!("{count} SubDevice{}", if count == 1 { "" } else { "s" })
        );
    }
    if first <= BAR {
        ExitCode::SUCCESS
    } else {
        println!("FAILED: {first:.2} of the reflector, expected at most {BAR}");
        ExitCode::FAILURE
    }
}

/// Round trips of one kind, in µs: the medians of each round, and all of them.
#[derive(Default)]
struct Times {
    medians: Vec<f64>,
    all: Vec<f64>,
}

impl Times {
    fn add(&mut self, mut round: Vec<f64>) {
        self.medians.push(share(&mut round, 0.5));
        self.all.append(&mut round);
    }

    /// The best half of the rounds counts: other programs disturb whole rounds.
    fn median(&self) -> f64 {
        share(&mut self.medians.clone(), 0.25)
    }
}

impl std::fmt::Display for Times {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let p99 = share(&mut self.all.clone(), 0.99);
        write!(f, "{:6.1} µs (99 %: {p99:.1} µs)", self.median())
    }
}

fn share(times: &mut [f64], share: f64) -> f64 {
    times.sort_by(f64::total_cmp);
    times[((times.len() - 1) as f64 * share) as usize]
}

/// A broadcast read of the AL status.
fn frame() -> [u8; 60] {
    let mut frame = [0; 60];
    frame[..6].fill(0xFF);
    frame[6..12].copy_from_slice(&[2, 0, 0, 0, 0, 1]);
    let rest = [0x88, 0xA4, 14, 0x10, 7, 0, 0, 0, 0x30, 0x01, 2, 0, 0, 0];
    frame[12..12 + rest.len()].copy_from_slice(&rest);
    frame
}

/// Sends frame after frame and waits for each; the times in µs.
fn client() -> Vec<f64> {
    let clock = HostClock::start();
    let mut card = RawSocket::open(NEAR, &SocketOptions::default()).unwrap();
    let mut batch = Batch::new(4);
    let frame = frame();
    let mut times = Vec::with_capacity(FRAMES);
    let mut lost = 0;
    while times.len() < FRAMES {
        let sent = clock.now();
        let _ = card.send_batch([&frame[..]]).unwrap();
        let patience = sent + Span::ms(100);
        loop {
            let _ = card.wait(&clock, patience).unwrap();
            if card.recv_batch(&mut batch, &clock).unwrap() > 0 {
                times.push(clock.now().since(sent).as_nanos() as f64 / 1e3);
                break;
            }
            if clock.now() >= patience {
                lost += 1;
                assert!(lost < 100, "nobody answers");
                break;
            }
        }
    }
    times
}

/// Against a thread that sends back what comes.
fn reflected() -> Vec<f64> {
    let clock = HostClock::start();
    let (waker, stop) = (Waker::new().unwrap(), Stop::default());
    stop.wakes(&waker.wake_handle()).unwrap();
    let mut card = RawSocket::open(FAR, &SocketOptions::default()).unwrap();
    thread::scope(|scope| {
        let ended = stop.clone();
        scope.spawn(move || {
            let mut batch = Batch::new(64);
            while !ended.is_set() {
                let _ = wait_any([&card as &dyn Waitable, &waker], &clock, Instant::MAX).unwrap();
                if card.recv_batch(&mut batch, &clock).unwrap() > 0 {
                    let _ = card.send_batch(batch.iter().map(|frame| frame.bytes)).unwrap();
                }
            }
        });
        let times = client();
        stop.set();
        times
    })
}

/// Against a segment.
fn answered(count: usize) -> Vec<f64> {
    let stop = Stop::default();
    let mut server = Server::open(line(count), Wiring::default(), &[FAR.to_owned()]).unwrap();
    stop.wakes(&server.wake_handle()).unwrap();
    thread::scope(|scope| {
        let ended = stop.clone();
        scope.spawn(move || {
            server.run(Instant::MAX, &ended, &mut ServeControls::default()).unwrap()
        });
        let times = client();
        stop.set();
        times
    })
}

/// A line of box modules.
fn line(count: usize) -> Segment {
    let mut text = String::new();
    for no in 1..=count {
        let on = if no == 1 { "maindevice".to_owned() } else { format!("P{}.B", no - 1) };
        text += &format!("[[device]]\nname = \"P{no}\"\ntype = \"EP1008-0001\"\non = \"{on}\"\n");
    }
    Segment::build(&SegmentFile::parse(&text).unwrap()).unwrap()
}

/// How long the frame takes in the model: what no host can be faster than, without lying.
fn on_the_wire(count: usize) -> Span {
    let mut segment = line(count);
    let start = Instant::ZERO + Span::s(1);
    segment.handle_frame(start, Path::A, &frame());
    segment.poll_timeout().unwrap().since(start)
}
