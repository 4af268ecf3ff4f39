//! Cost of a cycle on a card, as a share of bare sending and receiving: the same frame, the same
//! far end, on one CPU, in turns in the same run.
//!
//! The far end is a thread that answers each frame as a line in OP does. The floor sends that frame
//! from a buffer and waits for its answer with plain `send` and `recv`. Twice:
//!
//! * **round trips**, one after the other as fast as they go, through `MainDevice` and `RawSocket`,
//!   with working counters keeping and both directions kept for the diagnosis;
//! * **CPU time of a cycle** of `Driver`, which `run` uses, with the time from cycle to cycle slept.
//!
//! `cargo bench -p linesman-runtime --bench round_trips`, as root: it makes a network namespace of its
//! own. It prints a table, with `--json` one object.

#![allow(clippy::unwrap_used, reason = "a benchmark that cannot go on may panic")]

mod own_namespace;
mod steady;

use std::hint::black_box;
use std::process::ExitCode;
use std::thread;

use linesman_diagnosis::{Direction, FrameSeen, HostObservation};
use linesman_link::clock::{HostClock, tighten_timers};
use linesman_link::real_time::pin_to_cpu;
use linesman_link::socket::{RawSocket, SocketOptions};
use linesman_maindevice::{Event, MainDevice, Options};
use linesman_proto::address::Path;
use linesman_proto::time::{Instant, Span};
use linesman_runtime::drive::Driver;
use linesman_runtime::run::tap::{Tap, tap};
use linesman_runtime::stop::Stop;
use linesman_runtime::transport::Cards;
use linesman_session::SessionHooks;
use linesman_session::frame::FrameSummary;

use own_namespace::{FAR, NEAR};
use steady::{Running, answers, running, scripted};

/// One LRW of 64 bytes.
const LINE: &[(&str, usize)] = &[("EL4102", 8), ("EL3102", 4)];
const ROUNDS: usize = 12;
const TRIPS: u64 = 5_000;
/// Ends the far end.
const LAST: [u8; 60] = {
    let mut frame = [0; 60];
    (frame[12], frame[13]) = (0x88, 0xA4);
    frame
};
const CYCLES: u64 = 2_000;
const CYCLE: Span = Span::us(250);
/// The same for all: they share it.
const CPU: usize = 1;

fn main() -> ExitCode {
    own_namespace::run(inside)
}

fn inside() -> ExitCode {
    tighten_timers();
    if pin_to_cpu(CPU).is_err() {
        println!("not on one CPU: the figures tell little");
    }
    let (mut floor, mut ours) = (Best::default(), Best::default());
    let (mut sleeping, mut driven, mut keeping) =
        (Best::default(), Best::default(), Best::default());
    for _ in 0..ROUNDS {
        floor.add(far_end(bare_trips));
        ours.add(far_end(engine_trips));
        sleeping.add(far_end(bare_cycles));
        driven.add(far_end(|_| driver_cycles(false)));
        keeping.add(far_end(|_| driver_cycles(true)));
    }
    if ours.trip_ns.is_infinite() || driven.cpu_ns.is_infinite() || keeping.cpu_ns.is_infinite() {
        println!("FAILED: other programs disturbed every round");
        return ExitCode::FAILURE;
    }
    let rate = floor.trip_ns / ours.trip_ns;
    let cpu = ours.cpu_ns / floor.cpu_ns;
    if std::env::args().any(|word| word == "--json") {
        println!(
            "{{\"floor_trip_ns\":{:.0},\"trip_ns\":{:.0},\"share_of_floor\":{rate:.3},\
             \"floor_cpu_ns\":{:.0},\"cpu_ns\":{:.0},\"cpu_of_floor\":{cpu:.3},\
             \"floor_cycle_cpu_ns\":{:.0},\"cycle_cpu_ns\":{:.0},\"cycle_cpu_of_floor\":{:.3},\
             \"kept_cycle_cpu_ns\":{:.0}}}",
            floor.trip_ns,
            ours.trip_ns,
            floor.cpu_ns,
            ours.cpu_ns,
            sleeping.cpu_ns,
            driven.cpu_ns,
            driven.cpu_ns / sleeping.cpu_ns,
            keeping.cpu_ns,
        );
        return ExitCode::SUCCESS;
    }
    println!("best of {ROUNDS} rounds; CPU time is that of the sending thread");
    let line = |name: &str, one: &Best, base: &Best| {
        println!(
            "{name:<34} {:>7.2} µs  {:>5.3} of the floor   CPU {:>6.2} µs  {:>5.3} x the floor's",
            one.trip_ns / 1e3,
            base.trip_ns / one.trip_ns,
            one.cpu_ns / 1e3,
            one.cpu_ns / base.cpu_ns
        );
    };
    line("round trip: send and recv", &floor, &floor);
    line("round trip: MainDevice, RawSocket", &ours, &floor);
    line("cycle: send, recv, sleep", &sleeping, &sleeping);
    line("cycle: Driver", &driven, &sleeping);
    line("cycle: Driver, frames kept", &keeping, &sleeping);
    ExitCode::SUCCESS
}

/// What was measured: the time of a round trip and the CPU time of the thread for it, in ns.
#[derive(Clone, Copy)]
struct Best {
    trip_ns: f64,
    cpu_ns: f64,
}

impl Default for Best {
    fn default() -> Self {
        Self { trip_ns: f64::INFINITY, cpu_ns: f64::INFINITY }
    }
}

impl Best {
    /// Other programs disturb whole rounds: the best one counts.
    fn add(&mut self, one: Self) {
        self.trip_ns = self.trip_ns.min(one.trip_ns);
        self.cpu_ns = self.cpu_ns.min(one.cpu_ns);
    }
}

/// Runs `near` while a thread on the same CPU answers.
fn far_end(near: impl FnOnce(Running) -> Best) -> Best {
    let running = running(LINE, false, CYCLE);
    let mut script = answers(&running.plan);
    let mut card = RawSocket::open(FAR, &SocketOptions::default()).unwrap();
    card.set_waiting(true).unwrap();
    let far = thread::spawn(move || {
        let mut buffer = [0; 1_536];
        loop {
            let Some(len) = card.recv_one(&mut buffer).unwrap() else { continue };
            if len <= LAST.len() {
                return;
            }
            // A frame beside the cycle, because the host slept and answers were late, gets none.
            let answer = scripted(&mut script, &buffer[..len]);
            if !answer.is_empty() {
                let _ = card.send_one(answer).unwrap();
            }
        }
    });
    let best = near(running);
    let mut card = RawSocket::open(NEAR, &SocketOptions::default()).unwrap();
    let _ = card.send_one(&LAST).unwrap();
    far.join().unwrap();
    best
}

/// CPU time of this thread so far, in ns.
fn cpu_time() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap();
    text.split_whitespace().next().unwrap().parse().unwrap()
}

/// The time that each of so many takes.
fn timed(count: u64, work: impl FnOnce()) -> Best {
    let clock = HostClock::start();
    let (cpu, begun) = (cpu_time(), clock.now());
    work();
    let took = clock.now().since(begun).as_nanos() as f64;
    Best { trip_ns: took / count as f64, cpu_ns: (cpu_time() - cpu) / count as f64 }
}

/// A cyclic frame as it is sent, and a card that waits for what comes.
fn bare(running: &Running) -> (Vec<u8>, RawSocket) {
    let mut frame = answers(&running.plan).remove(0).bytes;
    frame[6] &= !linesman_proto::ethernet::SOURCE_MARK;
    let mut card = RawSocket::open(NEAR, &SocketOptions::default()).unwrap();
    card.set_waiting(true).unwrap();
    (frame, card)
}

/// The floor: send, recv.
fn bare_trips(running: Running) -> Best {
    let (frame, mut card) = bare(&running);
    let mut buffer = [0; 1_536];
    timed(TRIPS, || {
        for _ in 0..TRIPS {
            let _ = card.send_one(&frame).unwrap();
            card.recv_one(&mut buffer).unwrap();
        }
    })
}

/// The floor with a cycle: send, recv, sleep.
fn bare_cycles(running: Running) -> Best {
    let (frame, mut card) = bare(&running);
    let mut buffer = [0; 1_536];
    let clock = HostClock::start();
    timed(CYCLES, || {
        let begun = clock.now();
        for cycle in 1..=CYCLES {
            let _ = card.send_one(&frame).unwrap();
            card.recv_one(&mut buffer).unwrap();
            clock.sleep_until(begun + CYCLE * cycle);
        }
    })
}

/// A log of frames, and a thread that takes it.
fn kept() -> Tap {
    let (tap, listener) = tap(false);
    thread::spawn(move || {
        let mut done = None;
        while let Some(log) = listener.next(done.take()) {
            done = Some(log);
        }
    });
    tap
}

/// The engine and a socket, one cycle after the other.
fn engine_trips(running: Running) -> Best {
    let Running { mut main, mut now, .. } = running;
    let mut card = RawSocket::open(NEAR, &SocketOptions::default()).unwrap();
    let (mut tap, mut number) = (kept(), 0);
    let clock = HostClock::start();
    let before = main.statistics();
    let best = timed(TRIPS, || {
        for _ in 0..TRIPS {
            // The time of the engine goes from cycle to cycle; reading the clock is part of the work.
            black_box(clock.now());
            now = main.poll_timeout().unwrap_or(now).max(now);
            main.handle_timeout(now);
            main.outputs_mut()[0] = 1;
            let room = tap.room(now);
            let Some(sent) = main.poll_transmit(now, room) else { continue };
            let _ = card.send_one(&room[..sent.len]).unwrap();
            number += 1;
            let (path, direction) = (Some(sent.path), Direction::Sent);
            tap.keep(
                &FrameSummary { time: now, number, path, direction, truncated: false },
                sent.len,
            );
            let _ = card.wait(&clock, Instant::MAX).unwrap();
            let at = now + Span::ns(black_box(clock.now()).as_nanos() & 0xFF);
            let room = tap.room(at);
            let len = card.recv_one(room).unwrap().unwrap();
            number += 1;
            main.handle_frame(at, Path::A, &room[..len]);
            let direction = Direction::Received;
            tap.keep(&FrameSummary { time: at, number, path, direction, truncated: false }, len);
            while main.poll_event().is_some() {}
            tap.turn(now);
        }
    });
    let after = main.statistics();
    assert_eq!(after.working_counter_errors, before.working_counter_errors);
    assert!(after.cycles - before.cycles >= TRIPS * 9 / 10, "{after:?}");
    best
}

/// The driver of `run`, in a cycle.
fn driver_cycles(keeps: bool) -> Best {
    let running = running(LINE, false, CYCLE);
    let clock = HostClock::start();
    let hooks = Keeping { tap: keeps.then(kept) };
    let line = Cards::open(&[NEAR.to_owned()], clock).unwrap();
    let mut driver = Driver::new(line, Options::default(), hooks);
    clock.sleep_until(running.now + CYCLE);
    *driver.session_mut().main_mut() = running.main;
    let stop = Stop::default();
    let now = driver.now();
    driver.run(now + CYCLE * 100, &stop).unwrap();
    let before = driver.session().main().statistics();
    let now = driver.now();
    let best = timed(CYCLES, || {
        driver.run(now + CYCLE * CYCLES, &stop).unwrap();
    });
    let after = driver.session().main().statistics();
    if after.working_counter_errors != before.working_counter_errors {
        // The host slept so long that SubDevices were taken for lost: this round tells nothing.
        return Best::default();
    }
    // Cycles that the host slept through cost nothing.
    let share = (after.cycles - before.cycles) as f64 / CYCLES as f64;
    Best { trip_ns: best.trip_ns / share, cpu_ns: best.cpu_ns / share }
}

/// Gives outputs in each cycle and keeps the frames, as an operator does.
struct Keeping {
    tap: Option<Tap>,
}

impl SessionHooks for Keeping {
    fn frame(&mut self, frame: &FrameSeen<'_>) {
        if let Some(tap) = &mut self.tap {
            tap.frame(frame);
        }
    }

    fn room(&mut self, now: Instant) -> Option<&mut [u8]> {
        self.tap.as_mut().map(|tap| &mut tap.room(now)[..])
    }

    fn keep(&mut self, sent: &FrameSummary, len: usize) {
        if let Some(tap) = &mut self.tap {
            tap.keep(sent, len);
        }
    }

    fn host(&mut self, _: &HostObservation) {}

    fn event(&mut self, _: Instant, _: Event, _: &mut MainDevice) {}

    fn turn(&mut self, now: Instant, main: &mut MainDevice) -> bool {
        main.outputs_mut();
        if let Some(tap) = &mut self.tap {
            tap.turn(now);
        }
        true
    }
}
