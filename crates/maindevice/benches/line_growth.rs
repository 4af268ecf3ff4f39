//! A line is scanned and brought to OP: how that grows from 10 to 65,535 SubDevices.
//!
//! ```text
//! cargo bench -p linesman-maindevice --bench line_growth            up to 10,000
//! cargo bench -p linesman-maindevice --bench line_growth -- 65535   one length
//! ```
//!
//! A coupler and terminals, half of them inputs, half outputs; time is virtual, and so are the
//! waits. What is measured is the time on a processor that the program needs for all of it, segment
//! included: other programs on the machine do not count.

#![allow(clippy::disallowed_types, clippy::disallowed_methods, reason = "this measures time")]
#![allow(clippy::print_stdout, clippy::disallowed_macros, reason = "this prints a table")]

use std::time::Instant as Clock;

use linesman_config::inventory::Inventory;
use linesman_config::plan::{Plan, PlanOptions};
use linesman_maindevice::{Event, MainDevice, Options};
use linesman_proto::address::Network;
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::SegmentFile;

/// Time of this thread on a processor, in s, as Linux counts it; elsewhere time that passes.
fn on_processor(begin: Clock) -> f64 {
    let counted = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanos: Option<f64> = counted.and_then(|text| text.split(' ').next()?.parse().ok());
    nanos.map_or_else(|| begin.elapsed().as_secs_f64(), |nanos| nanos / 1e9)
}

fn line(devices: usize) -> SegmentFile {
    let (inputs, outputs) = ((devices - 1) / 2, devices - 1 - (devices - 1) / 2);
    let text = format!(
        "name = \"line\"\n[[device]]\nname = \"K\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
         [[device]]\nname = \"I\"\ntype = \"EL1008\"\non = \"K.B\"\nrepeat = {inputs}\n\
         [[device]]\nname = \"O\"\ntype = \"EL2008\"\non = \"I[{inputs}].B\"\nrepeat = {outputs}\n"
    );
    SegmentFile::parse(&text).expect("a line")
}

struct Bench {
    now: Instant,
    segment: Segment,
    main: MainDevice,
    frames: u64,
    transmit: Vec<u8>,
    arrival: Vec<u8>,
}

impl Bench {
    /// Lets time pass until an event for which `done` gives something.
    fn until<T>(&mut self, mut done: impl FnMut(Event) -> Option<T>) -> T {
        let limit = self.now + Span::s(100_000);
        loop {
            while let Some(sent) = self.main.poll_transmit(self.now, &mut self.transmit) {
                self.frames += 1;
                self.segment.handle_frame(sent.at, sent.path, &self.transmit[..sent.len]);
            }
            while let Some(event) = self.main.poll_event() {
                if let Some(result) = done(event) {
                    return result;
                }
            }
            let due = [self.main.poll_timeout(), self.segment.poll_timeout()];
            let next = due.into_iter().flatten().min().expect("something is due");
            assert!(next < limit, "it takes too long");
            self.now = self.now.max(next);
            self.segment.advance(self.now);
            while let Some(came) = self.segment.poll_arrival(&mut self.arrival) {
                self.main.handle_frame(self.now, came.path, &self.arrival);
            }
            if self.main.poll_timeout().is_some_and(|at| at <= self.now) {
                self.main.handle_timeout(self.now);
            }
        }
    }
}

fn run(devices: usize) {
    let begin = Clock::now();
    let before = on_processor(begin);
    let segment = Segment::build(&line(devices)).expect("it can be built");
    let built = on_processor(begin) - before;
    // A long line needs patience, and many frames that are out at once.
    let options = Options {
        patience: Span::s(2),
        frames_at_once: 64,
        watch_interval: Span::s(30),
        ..Options::default()
    };
    let mut bench = Bench {
        now: Instant::ZERO,
        segment,
        main: MainDevice::new(Network(0), options),
        frames: 0,
        transmit: vec![0; 1_514],
        arrival: Vec::new(),
    };
    let before = on_processor(begin);
    bench.main.scan(bench.now);
    let inventory: Inventory = bench.until(|event| {
        if let Event::ScanFailed(error) = &event {
            panic!("{error}");
        }
        if let Event::Scanned(inventory) = event { Some(*inventory) } else { None }
    });
    let scanned = on_processor(begin) - before;
    assert_eq!(inventory.devices.len(), devices);
    let before = on_processor(begin);
    let plan = PlanOptions { cycle: Span::ms(50), ..PlanOptions::default() };
    let plan = Plan::build(&inventory.planned(AlState::Op), inventory.tree().clone(), &plan);
    let plan = plan.expect("a plan");
    let planned = on_processor(begin) - before;
    let before = on_processor(begin);
    bench.main.start(bench.now, plan);
    bench.until(|event| matches!(event, Event::AllReached).then_some(()));
    let up = on_processor(begin) - before;
    let in_op = bench.segment.devices().filter(|id| {
        let controller = bench.segment.controller(*id);
        controller.is_some_and(|known| known.al_status().state().state() == Some(AlState::Op))
    });
    println!(
        "{devices:>8}{:>10.2} s{:>10.2} s{:>10.2} s{:>10.2} s{:>10.1} s{:>12}{:>9.1} %{:>9}",
        built,
        scanned,
        planned,
        up,
        bench.now.as_nanos() as f64 / 1e9,
        bench.frames,
        100.0 * bench.segment.frames_without_walk() as f64 / bench.frames as f64,
        in_op.count(),
    );
}

fn main() {
    println!(
        "{:>8}{:>12}{:>12}{:>12}{:>12}{:>12}{:>12}{:>11}{:>9}",
        "devices", "build", "scan", "plan", "to OP", "virtual", "frames", "no walk", "in OP"
    );
    let sizes: Vec<usize> =
        std::env::args().skip(1).filter_map(|argument| argument.parse().ok()).collect();
    let usual = [10, 100, 1_000, 10_000];
    for devices in if sizes.is_empty() { usual.to_vec() } else { sizes } {
        run(devices);
    }
}
