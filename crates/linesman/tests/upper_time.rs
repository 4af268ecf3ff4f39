//! Programs that tell a network the time of an upper one, in which it begins.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use linesman::prelude::*;
use linesman::segment_file::SegmentClock;
use linesman::{DcTime, Instant, StartTime, TaskTimes};
use linesman_config::project::{ClockChoice, Project, TimeChoice};

const CYCLE: u64 = 1_000_000;
/// Head start of the upper network, in cycles.
const HEAD_START: u32 = 5_000;

/// A line whose coupler is so many ppm fast, and its plan, with clocks.
fn network(ppm: f64, time: Option<TimeChoice>) -> (Segment, Plan) {
    let devices = [("K1", "EK1100"), ("O1", "EL4102"), ("I1", "EL3102")];
    let mut file = SegmentFile::in_a_row("network", 3, &devices);
    for (device, ppm) in file.devices.iter_mut().zip([ppm, 25.0, 10.0]) {
        device.clock_ppm = Some(ppm);
        device.clock = Some(SegmentClock {
            ramp_ppm_per_s: Some(0.0),
            jitter_ns: Some(0),
            ..SegmentClock::default()
        });
    }
    let mut segment = Segment::simulated(&file).unwrap();
    let mut project = Project::from_inventory("network", segment.scan().unwrap().inventory());
    project.network.time_source = time;
    let leads = ClockChoice { assign_activate: Some(0), reference: true, ..ClockChoice::default() };
    let clocks = [leads, ClockChoice::default(), ClockChoice::default()];
    for (device, clock) in project.devices.iter_mut().zip(clocks) {
        device.clock = Some(clock);
    }
    let thread = std::thread::current().id();
    let name = format!("linesman-{}-{thread:?}-{ppm}.toml", std::process::id());
    let path = std::env::temp_dir().join(name);
    std::fs::write(&path, project.to_toml()).unwrap();
    let plan = segment.load(&path);
    std::fs::remove_file(&path).unwrap();
    (segment, plan.unwrap())
}

/// Time outside that a program knows: so many ppm off the time of the run, far from that of this computer.
fn outside(at: Instant) -> DcTime {
    let nanos = at.as_nanos();
    DcTime(850_000_000_000_123_456 + nanos + nanos / 1_000_000 * 30)
}

/// Distances of a network from the time outside in many cycles.
#[derive(Default)]
struct Apart {
    cycles: u32,
    /// Those in which its time was 500 ns off or more, or the begin of its cycle 5 µs from a multiple of the cycle time. A
    /// cyclic frame that waits behind another one on the wire brings a time that is so much later.
    off: u32,
}

impl Apart {
    fn note(&mut self, times: &TaskTimes, outside: u64) {
        let ahead = times.now.0.wrapping_sub(outside) as i64;
        let past = times.task_start.0 % CYCLE;
        self.cycles += 1;
        self.off += u32::from(ahead.abs() >= 500 || past.min(CYCLE - past) >= 5_000);
    }

    #[track_caller]
    fn check(&self) {
        let Self { cycles, off } = *self;
        assert!(cycles > 9_000 && off * 100 < cycles, "off in {off} of {cycles} cycles");
    }
}

/// An application that knows the time outside some time after the start.
struct Clocked {
    asked: u32,
    cycles: u32,
    /// The last 10 s.
    apart: Apart,
}

impl Application for Clocked {
    fn start_time(&mut self, now: Instant) -> StartTime {
        self.asked += 1;
        if self.asked < 500 { StartTime::Awaited } else { StartTime::Told(outside(now)) }
    }

    fn cycle(&mut self, io: &mut Io<'_>) -> Next {
        io.tell_outside_time(outside(io.now()));
        io.outputs_mut();
        self.cycles += 1;
        let times = io.times();
        if self.cycles > 60_000 {
            self.apart.note(&times, outside(io.now()).0);
        }
        if self.cycles < 70_000 { Next::Continue } else { Next::Stop }
    }
}

// proves: DC-18
#[test]
fn application_that_knows_the_time_later_has_the_network_begin_in_it() {
    let (mut segment, plan) = network(-40.0, Some(TimeChoice::Program));
    let mut clocked = Clocked { asked: 0, cycles: 0, apart: Apart::default() };
    let report = segment.run_application(plan, RunOptions::us(1_000), &mut clocked).unwrap();
    assert!(report.settled && clocked.asked == 500, "asked {} times", clocked.asked);
    clocked.apart.check();
}

/// An application that never knows it.
struct Clueless;

impl Application for Clueless {
    fn start_time(&mut self, _: Instant) -> StartTime {
        StartTime::Awaited
    }

    fn cycle(&mut self, _: &mut Io<'_>) -> Next {
        Next::Continue
    }
}

#[test]
fn network_whose_application_never_tells_the_time_is_not_started() {
    let (mut segment, plan) = network(-40.0, Some(TimeChoice::Program));
    let failed = segment.run_application(plan, RunOptions::us(1_000), &mut Clueless).unwrap_err();
    let told = failed.to_string();
    assert!(told.contains("the program has told no time for 60 s"), "{told}");
}

// proves: DC-18
#[test]
fn caller_of_each_cycle_tells_a_network_the_time_of_an_upper_one_before_its_start() {
    let (mut upper, upper_plan) = network(20.0, None);
    let (mut local, local_plan) = network(-40.0, Some(TimeChoice::Program));
    let mut upper = upper.start(upper_plan, RunOptions::us(1_000)).unwrap();
    for _ in 0..HEAD_START {
        upper.cycle().unwrap();
    }
    let local_zero = local.simulation().unwrap().now().as_nanos();
    let mut local = local.start(local_plan, RunOptions::us(1_000)).unwrap();
    // The times of the two runs have their own zero, as those of two computers.
    let read = |run: &mut linesman::SteppedRun<'_>| {
        let io = run.cycle().unwrap();
        (io.now().as_nanos(), io.times().now.0)
    };
    let (zero, time) = read(&mut upper);
    local.tell_outside_time(DcTime(time));
    let mut apart = Apart::default();
    for number in 0..70_000 {
        let (at, time) = read(&mut upper);
        let mut io = local.cycle().unwrap();
        // What the upper network shows when this cycle of the local one begins.
        let later = (io.now().as_nanos() - local_zero).wrapping_sub(at - zero);
        let time = time.wrapping_add(later);
        io.tell_outside_time(DcTime(time));
        let times = io.times();
        if number > 60_000 {
            apart.note(&times, time);
        }
    }
    apart.check();
}
