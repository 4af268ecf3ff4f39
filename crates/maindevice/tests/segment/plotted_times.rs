//! Times of the plots of the ways to exchange: of a device of inputs and outputs the frames, SYNC0, reading and writing
//! are where the segment has them.

use linesman_config::plan::layout::TaskOptions;
use linesman_config::plan::timing::{CycleTimes, TimingOptions};
use linesman_config::plan::{IoAt, Plan};
use linesman_config::profile::{DirectionTimes, SyncTimes};
use linesman_proto::address::DeviceId;
use linesman_proto::time::Span;

use crate::bench::Bench;
use crate::timing::{CYCLE, buffers, next_sync0, phase, plan};

/// A coupler, and a stepper with outputs and inputs: its position and the toggle of its inputs change in every cycle.
const PLANT: &str = r#"
name = "plotted"
seed = 11
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "M1"
type = "EL7041"
on = "K1.B"
"#;
const STEPPER: DeviceId = DeviceId(1);
/// Times that are looked at once a µs are seen up to so much late; clocks and cycle are in step within some 100 ns, and the begin
/// of the frame is that far off in any case.
const EARLY_NS: i64 = 700;
const LATE_NS: i64 = 1_500;

/// A stepper that runs in one of the ways to exchange.
struct PlottedRun {
    bench: Bench,
    plan: Plan,
    times: CycleTimes,
    /// Time at which the cycle of the plot begins, by the reference clock.
    begins_ns: i64,
}

impl PlottedRun {
    fn new(task: TaskOptions) -> Self {
        let mut bench = Bench::new(PLANT);
        let mut plan = plan(&mut bench, task, |kind| kind == "EL7041");
        let known = DirectionTimes {
            min_cycle_ns: Some(100_000),
            calc_and_copy_ns: Some(12_000),
            shift_ns: None,
        };
        plan.devices[STEPPER.index()].sync_times = SyncTimes { outputs: known, inputs: known };
        let zero = Some(Span::ZERO);
        let options = TimingOptions {
            jitter: zero,
            task_jitter: zero,
            cable_m: Some(10),
            ..TimingOptions::default()
        };
        let timing = plan.timing(&options);
        let times = timing.devices[0].times.clone().expect("reckoned");
        let begins_ns = plan.cycle_begin_ns(&plan.tasks[0]);
        bench.device.start(bench.now, plan.clone());
        bench.run_for(Span::s(8));
        assert_eq!(bench.state("M1"), "OP");
        Self { bench, plan, times, begins_ns }
    }

    /// Runs until what `seen` shows changes; when that was within the cycle of the plot.
    fn when_changed(&mut self, seen: impl Fn(&Bench, &Plan) -> Vec<u8>) -> i64 {
        let before = seen(&self.bench, &self.plan);
        for _ in 0..20_000 {
            self.bench.run_for(Span::us(1));
            if seen(&self.bench, &self.plan) != before {
                return phase(&self.bench, &self.plan, CYCLE) - self.begins_ns;
            }
        }
        panic!("nothing changes");
    }
}

/// Distance of a time from the span that the plot has, in ns: 0 within; both may be cycles apart.
fn outside(at: i64, from: i64, to: i64) -> i64 {
    let cycle = CYCLE.as_nanos() as i64;
    let middle = i64::midpoint(from, to);
    let at = middle + (at - middle + cycle / 2).rem_euclid(cycle) - cycle / 2;
    if at < from { at - from } else { (at - to).max(0) }
}

// S0 L447-475, L611-637: diagrams 2, 3 and 5.
// proves: SYN-19 (S)
#[test]
fn times_of_the_three_plots_are_those_of_the_segment() {
    let way = |io_at, separate_inputs| TaskOptions {
        io_at,
        separate_inputs,
        ..TaskOptions::new("cyclic", CYCLE)
    };
    // How far each is outside of what is plotted.
    let mut off = Vec::new();
    for (name, task, frames) in [
        ("task end", way(IoAt::TaskEnd, None), 1),
        ("separate input", way(IoAt::TaskEnd, Some(Span::us(300))), 2),
        ("task begin", way(IoAt::TaskBegin, None), 1),
    ] {
        let mut run = PlottedRun::new(task);
        let times = run.times.clone();
        let separate = times.frames.iter().any(|one| one.own && !one.fetches);
        let with_inputs = *times.frames.iter().find(|one| one.fetches).expect("inputs");
        let with_outputs = match separate {
            true => *times.frames.iter().find(|one| one.own && !one.fetches).expect("outputs"),
            false => with_inputs,
        };
        let mut check = |what: &str, at: i64, from: i64, to: i64| {
            off.push((
                format!("{name}, {what}: {at}, plotted {from} to {to}"),
                outside(at, from, to),
            ));
        };
        if frames == 2 {
            assert_eq!(with_outputs.due_ns - with_inputs.due_ns, 300_000, "{times:#?}");
        }
        for round in 1..=4_u8 {
            let outputs = run.plan.devices[STEPPER.index()].outputs.clone();
            // Enabled; another velocity in each round.
            let data = [0, 0, 0, 0, 1, 0, round, 0x20];
            run.bench.device.outputs_mut()[outputs].copy_from_slice(&data);
            let frame = run.when_changed(|bench, plan| buffers(bench, plan, STEPPER, 2));
            check("outputs", frame, with_outputs.earliest_ns, with_outputs.latest_ns);
            let sync0 = next_sync0(&mut run.bench, &run.plan, run.plan.devices[1].station, CYCLE);
            let sync0 = sync0 - run.begins_ns;
            check("SYNC0", sync0, times.sync0_ns, times.sync0_ns);
            let position = |bench: &Bench, _: &Plan| {
                let signal = bench.segment.outputs(STEPPER)[0];
                bench.segment.signals().value(signal).to_le_bytes().to_vec()
            };
            let read = run.when_changed(position);
            let latest = times.sync0_ns + times.outputs_read.expect("known").as_nanos() as i64;
            check("outputs read", read, times.sync0_ns, latest);
            let written = run.when_changed(|bench, plan| buffers(bench, plan, STEPPER, 3));
            let latest = times.sync0_ns + times.inputs_written.expect("known").as_nanos() as i64;
            check("inputs written", written, times.sync0_ns, latest);
            let inputs = run.plan.devices[STEPPER.index()].inputs.clone();
            let fetched =
                run.when_changed(|bench, _| bench.device.inputs()[inputs.clone()].to_vec());
            // It is seen when it is back.
            check("inputs", fetched, with_inputs.earliest_ns, with_inputs.latest_ns + 5_000);
        }
    }
    let is_right = |(_, off): &(String, i64)| (-EARLY_NS..=LATE_NS).contains(off);
    assert!(off.iter().all(is_right), "{off:#?}");
}
