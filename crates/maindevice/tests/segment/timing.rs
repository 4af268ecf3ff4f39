//! What the timing of a plan says beforehand, against a line that runs: SubDevices in step with SYNC0, and a computer
//! that sends late.

use std::cell::Cell;

use linesman_config::fault::FaultName;
use linesman_config::plan::layout::TaskOptions;
use linesman_config::plan::timing::{TimingOptions, TimingVerdict};
use linesman_config::plan::{
    ClockSettings, IoAt, Plan, PlanOptions, ProcessAccess, ShiftReference,
};
use linesman_config::profile::{DirectionTimes, SyncTimes};
use linesman_maindevice::{Event, ProbeRequest, Target};
use linesman_proto::address::{DeviceId, StationAddress};
use linesman_proto::command::Addressing;
use linesman_proto::frame::FrameView;
use linesman_proto::register;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use linesman_sim::segment_file::FaultEntry;

use crate::bench::Bench;
use crate::clocks::start;
use crate::mailbox::{put, upload};

pub(crate) const PLANT: &str = r#"
name = "timing"
seed = 11
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "O1"
type = "EL4102"
on = "K1.B"
[[device]]
name = "I1"
type = "EL3102"
on = "O1.B"
"#;
pub(crate) const CYCLE: Span = Span::ms(1);
const OUTPUTS: u16 = 0x1C32;
pub(crate) const INPUTS: u16 = 0x1C33;
/// A long time, in cycles.
const CYCLES: u32 = 4_000;

/// A plan for this task, with SYNC0 for the SubDevices whose types `clocked` picks.
pub(crate) fn plan(bench: &mut Bench, task: TaskOptions, clocked: impl Fn(&str) -> bool) -> Plan {
    let inventory = bench.scan();
    let mut planned = inventory.planned(AlState::Op);
    for device in planned.iter_mut().filter(|device| clocked(&device.profile.type_name)) {
        device.settings.clock = Some(ClockSettings {
            assign_activate: 0x0300,
            sync0_cycle: task.cycle,
            ..ClockSettings::default()
        });
        device.settings.access = ProcessAccess::Separate;
    }
    let options =
        PlanOptions { tasks: vec![task], clock_datagrams: true, ..PlanOptions::default() };
    Plan::build(&planned, inventory.tree().clone(), &options).expect("a plan")
}

fn terminals(kind: &str) -> bool {
    kind.starts_with("EL")
}

pub(crate) fn number(bench: &mut Bench, name: &str, index: u16, subindex: u8) -> u64 {
    let bytes = upload(bench, name, index, subindex).unwrap_or_default();
    bytes.iter().rev().fold(0, |value, byte| value << 8 | u64::from(*byte))
}

/// The times that the SubDevices measure of themselves, once they run.
pub(crate) fn measured() -> Vec<SyncTimes> {
    let mut bench = Bench::new(PLANT);
    let plan = plan(&mut bench, TaskOptions::new("cyclic", CYCLE), terminals);
    let devices = plan.devices.len();
    start(&mut bench, plan);
    let mut all = vec![SyncTimes::default(); devices];
    for (no, name) in [(1, "O1"), (2, "I1")] {
        let index = if name == "O1" { OUTPUTS } else { INPUTS };
        assert_eq!(put(&mut bench, name, index, 8, &[1, 0]), Ok(()));
        bench.run_for(Span::ms(50));
        let mut known = |subindex| u32::try_from(number(&mut bench, name, index, subindex)).ok();
        let times =
            DirectionTimes { min_cycle_ns: known(5), calc_and_copy_ns: known(6), shift_ns: None };
        match index {
            OUTPUTS => all[no].outputs = times,
            _ => all[no].inputs = times,
        }
    }
    assert_eq!(all[1].outputs.calc_and_copy(), Some(Span::us(12)));
    all
}

/// What a run of a plan shows: missed and late cycles of both SubDevices, and whether one of them left OP.
fn run(bench: &mut Bench, plan: Plan, late_us: u64) -> (u64, bool) {
    start(bench, plan);
    bench.run_for(Span::s(2));
    let before = counted(bench);
    let mut jitter = FaultEntry::new(FaultName::HostJitter)
        .with("hits", CYCLES / 8)
        .with("delay_us", late_us as f64);
    let ms = |at: linesman_proto::time::Instant| at.as_nanos() as f64 / 1e6;
    jitter = jitter.from_to(ms(bench.now), Some(ms(bench.now + CYCLE * u64::from(CYCLES))));
    bench.segment.inject(bench.now, &jitter).expect("a fault");
    bench.events.clear();
    bench.run_for(CYCLE * u64::from(CYCLES));
    let fell = bench.events.iter().any(|(_, event)| matches!(event, Event::AbnormalState { .. }));
    (counted(bench) - before, fell)
}

/// Cycles that both SubDevices missed, or in which they were late, as they count them.
fn counted(bench: &mut Bench) -> u64 {
    let mut sum = 0;
    for (name, index) in [("O1", OUTPUTS), ("I1", INPUTS)] {
        sum += [0x0B, 0x0C, 0x0D].map(|at| number(bench, name, index, at)).iter().sum::<u64>();
    }
    sum
}

fn options(late_us: u64) -> TimingOptions {
    TimingOptions {
        jitter: Some(Span::us(late_us)),
        cable_m: Some(100),
        ..TimingOptions::default()
    }
}

// proves: SYN-06 (S), SYN-27 (S)
#[test]
fn plan_that_passes_runs_without_sync_errors_and_one_that_fails_the_first_rule_shows_them() {
    let times = measured();
    for (late_us, shift_us, expected) in [
        (20, None, TimingVerdict::Pass),
        (200, None, TimingVerdict::Pass),
        (200, Some(100), TimingVerdict::Fail),
        (60, Some(50), TimingVerdict::Fail),
        (20, Some(80), TimingVerdict::Pass),
    ] {
        let mut bench = Bench::new(PLANT);
        let mut plan = plan(&mut bench, TaskOptions::new("cyclic", CYCLE), terminals);
        for (device, times) in plan.devices.iter_mut().zip(&times) {
            device.sync_times = *times;
        }
        plan.outputs_shift = shift_us.map(Span::us);
        plan.inputs_shift_ns = Some(-300_000);
        let timing = plan.timing(&options(late_us));
        let case = format!("{late_us} µs late, shift {shift_us:?}: {timing:#?}");
        assert_eq!(timing.verdict(), expected, "{case}");
        let references: Vec<_> = timing.devices.iter().map(|device| device.reference).collect();
        assert_eq!(references, [ShiftReference::Outputs, ShiftReference::Inputs]);
        if expected == TimingVerdict::Fail {
            assert_eq!(timing.devices[0].after_frames.verdict, TimingVerdict::Fail, "{case}");
        }
        let (errors, fell) = run(&mut bench, plan.clone(), late_us);
        assert_eq!(errors > 0 || fell, expected == TimingVerdict::Fail, "{errors} {fell} {case}");
        // The shift that is proposed mends it.
        let Some(proposed) = timing.outputs_shift else { continue };
        plan.outputs_shift = Some(proposed);
        assert_eq!(plan.timing(&options(late_us)).verdict(), TimingVerdict::Pass);
        let mut bench = Bench::new(PLANT);
        assert_eq!(run(&mut bench, plan, late_us), (0, false), "{proposed}: {case}");
    }
}

/// When the output of O1 takes new values, in ns after a multiple of the cycle by the clock of a SubDevice.
fn output_times(bench: &mut Bench, plan: &Plan, clock: DeviceId, cycle: Span) -> Vec<u64> {
    let id = bench.id("O1");
    let range = plan.devices[id.index()].outputs.clone();
    let signal = bench.segment.outputs(id)[0];
    (1..=20_u8)
        .map(|value| {
            bench.device.outputs_mut()[range.clone()][0] = value;
            for _ in 0..20_000 {
                bench.run_for(Span::us(1));
                if bench.segment.signals().value(signal) == i32::from(value) {
                    let controller = bench.segment.controller(clock).expect("a controller");
                    // The low half, which is all that some clocks have; it lasts for 4.29 s.
                    assert!(bench.now.as_nanos() < u64::from(u32::MAX));
                    let time = controller.system_time(bench.now) as u32;
                    return u64::from(time) % cycle.as_nanos();
                }
            }
            panic!("the output does not take the value {value}");
        })
        .collect()
}

// proves: SYN-05, SYN-09
#[test]
fn outputs_are_shifted_against_the_frame_at_the_reference_clock_in_both_ways_of_synchronisation() {
    // With its SyncManager, without any setting: when the frame is over, which is there when the cycle begins.
    let mut bench = Bench::new(PLANT);
    let planned = plan(&mut bench, TaskOptions::new("cyclic", CYCLE), |kind| kind == "EL3102");
    start(&mut bench, planned.clone());
    bench.run_for(Span::s(2));
    let clock = planned.reference_clock().expect("a reference clock");
    let frames: u64 = planned.tasks[0].frames.iter().map(|one| one.wire_time().as_nanos()).sum();
    for at in output_times(&mut bench, &planned, clock, CYCLE) {
        assert!((2_000..frames + 5_000).contains(&at), "{at} ns, a frame takes {frames} ns");
    }
    // With its clock: the shift of the outputs after that.
    let mut bench = Bench::new(PLANT);
    let planned = plan(&mut bench, TaskOptions::new("cyclic", CYCLE), terminals);
    start(&mut bench, planned.clone());
    bench.run_for(Span::s(2));
    let clock = planned.reference_clock().expect("a reference clock");
    for at in output_times(&mut bench, &planned, clock, CYCLE) {
        assert!((300_000..304_000).contains(&at), "{at} ns after the frame");
    }
}

#[test]
fn outputs_come_their_shift_after_their_frame_where_inputs_are_fetched_earlier() {
    let cycle = Span::ms(2);
    let mut bench = Bench::new(PLANT);
    let task =
        TaskOptions { separate_inputs: Some(Span::us(700)), ..TaskOptions::new("ahead", cycle) };
    let planned = plan(&mut bench, task, terminals);
    assert_eq!(planned.tasks[0].frames.len(), 2);
    start(&mut bench, planned.clone());
    bench.run_for(Span::s(2));
    let clock = planned.reference_clock().expect("a reference clock");
    for at in output_times(&mut bench, &planned, clock, cycle) {
        assert!((1_300_000..1_304_000).contains(&at), "{at} ns after the frame with inputs");
    }
}

/// The third of these has outputs and inputs.
pub(crate) const THREE_TASKS: &str = r#"
name = "three tasks"
seed = 11
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "O1"
type = "EL4102"
on = "K1.B"
[[device]]
name = "I1"
type = "EL3102"
on = "O1.B"
[[device]]
name = "B1"
type = "EL7041"
on = "I1.B"
"#;
pub(crate) const TASKS: [(&str, u64); 3] = [("IoTask", 16), ("PlcTask", 120), ("PlcTask3", 184)];
pub(crate) const SLOW: Span = Span::ms(2);

/// Three tasks of 2 ms that exchange at their end, with one SubDevice in step with SYNC0 each.
pub(crate) fn three_tasks(bench: &mut Bench, times: &[SyncTimes]) -> Plan {
    let inventory = bench.scan();
    let mut planned = inventory.planned(AlState::Op);
    for (device, (task, _)) in planned.iter_mut().skip(1).zip(TASKS) {
        device.settings.task = Some(task.to_owned());
        device.settings.clock = Some(ClockSettings {
            assign_activate: 0x0300,
            sync0_cycle: SLOW,
            ..ClockSettings::default()
        });
    }
    let task = |(name, _)| TaskOptions { io_at: IoAt::TaskEnd, ..TaskOptions::new(name, SLOW) };
    let tasks = TASKS.map(task).to_vec();
    let options = PlanOptions { tasks, clock_datagrams: true, ..PlanOptions::default() };
    let plan = Plan::build(&planned, inventory.tree().clone(), &options);
    let mut plan = plan.expect("a plan");
    for (device, times) in plan.devices.iter_mut().zip(times) {
        device.sync_times = *times;
    }
    plan
}

/// The task of a cyclic frame, from 1, by its logical addresses.
fn task_of(frame: &[u8]) -> Option<usize> {
    let view = FrameView::parse(frame).ok()?;
    let logical = view.datagrams().map_while(Result::ok).find_map(|datagram| {
        let is_logical = datagram.command()?.addressing() == Addressing::Logical;
        is_logical.then(|| datagram.logical().0)
    });
    Some((logical? >> 24) as usize).filter(|task| (1..=TASKS.len()).contains(task))
}

/// How long the frame of a task waits until the programs before it, and its own, are done: the first one's end is where
/// the cycle begins. In every third cycle they take their longest, else nothing.
fn waits_for_programs() -> impl Fn(&[u8]) -> Span {
    let cycle = Cell::new(0_u64);
    move |frame| {
        let Some(task) = task_of(frame) else { return Span::ZERO };
        if task == 1 {
            cycle.set(cycle.get() + 1);
        }
        match cycle.get().is_multiple_of(3) {
            true => Span::us(TASKS[1..task].iter().map(|(_, takes)| takes).sum()),
            false => Span::ZERO,
        }
    }
}

/// Programs of the three tasks take their times exactly, over no cable.
fn timing_of_tasks() -> TimingOptions {
    TimingOptions {
        execution: TASKS.map(|(name, us)| (name.to_owned(), Span::us(us))).to_vec(),
        jitter: Some(Span::ZERO),
        task_jitter: Some(Span::ZERO),
        cable_m: Some(0),
        ..TimingOptions::default()
    }
}

// S0 L656-688.
// proves: SYN-28 (S)
#[test]
fn of_three_tasks_the_verdict_by_the_last_frame_agrees_with_what_the_subdevices_count() {
    let mut times = measured();
    let both = times[1].outputs;
    times.push(SyncTimes { outputs: both, inputs: both });
    for (shift_us, expected) in [
        (None, TimingVerdict::Pass),
        (Some(400), TimingVerdict::Pass),
        (Some(250), TimingVerdict::Fail),
    ] {
        let mut bench = Bench::new(THREE_TASKS);
        let mut plan = three_tasks(&mut bench, &times);
        plan.outputs_shift = shift_us.map(Span::us);
        let timing = plan.timing(&timing_of_tasks());
        let case = format!("shift {shift_us:?}: {timing:#?}");
        assert_eq!(timing.verdict(), expected, "{case}");
        for device in &timing.devices {
            assert_eq!(device.after_frames.frame, Some(2), "the last frame decides: {case}");
            assert_eq!(device.before_next.frame, Some(0), "the first frame decides: {case}");
        }
        bench.leaves_after = Some(Box::new(waits_for_programs()));
        bench.device.start(bench.now, plan);
        bench.run_for(Span::s(8));
        let count = |bench: &mut Bench, name: &str| -> u64 {
            [0x0B, 0x0C, 0x0D].map(|at| number(bench, name, OUTPUTS, at)).iter().sum()
        };
        let before = ["O1", "B1"].map(|name| count(&mut bench, name));
        let all_up = ["O1", "I1", "B1"].map(|name| bench.state(name) == "OP");
        bench.run_for(Span::s(4));
        let after = ["O1", "B1"].map(|name| count(&mut bench, name));
        match expected {
            TimingVerdict::Pass => {
                assert_eq!(all_up, [true; 3], "{case}");
                assert_eq!(after, before, "nobody missed an event: {case}");
            }
            // Who is served by the last frame gets its outputs behind SYNC0.
            TimingVerdict::Fail | TimingVerdict::NotJudged => {
                let suffers = !all_up[2] || after[1] > before[1];
                assert!(suffers, "{all_up:?} {before:?} {after:?} {case}");
            }
        }
    }
}

/// How many whole cycles pass at the most until inputs of I1 that were set in the middle of a cycle are there, over some
/// cycles in which programs take their longest or nothing; `None` when I1 is not in OP afterwards.
fn cycles_until_inputs_are_there(bench: &mut Bench, plan: &Plan) -> Option<u64> {
    let id = bench.id("I1");
    let signal = bench.segment.inputs(id)[0];
    let range = plan.devices[id.index()].inputs.clone();
    let middle = SLOW.as_nanos() as i64 / 2;
    let mut most = 0;
    for round in 1..=6_u32 {
        // Rounds begin in each of the three cycles in turn.
        bench.run_for(SLOW * u64::from(round));
        let to_middle = (middle - phase(bench, plan, SLOW)).rem_euclid(2 * middle);
        bench.run_for(Span::ns(to_middle.unsigned_abs()));
        bench.segment.signals_mut().set(signal, round as i32 * 1_000);
        let (set, before) = (bench.now, bench.device.inputs()[range.clone()].to_vec());
        let mut left = 200;
        while bench.device.inputs()[range.clone()] == before[..] {
            left -= 1;
            assert!(left > 0, "the inputs do not change");
            bench.run_for(Span::us(50));
        }
        most = most.max(bench.now.since(set).as_nanos() / SLOW.as_nanos());
    }
    (bench.state("I1") == "OP").then_some(most)
}

// S0 L656-688: the second rule by the first relevant frame; the first rule is proven by the test above. SYNC0 of I1, which has inputs only, comes so long before
// the next cycle; calculating and copying take 12 µs from there.
// proves: SYN-28 (S)
#[test]
fn of_three_tasks_inputs_are_a_cycle_older_where_the_plan_fails_the_second_rule_alone() {
    let mut times = measured();
    let both = times[1].outputs;
    times.push(SyncTimes { outputs: both, inputs: both });
    let options = timing_of_tasks();
    let mut compared = [0; 3];
    for before_us in [100, 40, 20, 16, 14, 10, 8, 6, 4, 3, 2, 1] {
        let mut bench = Bench::new(THREE_TASKS);
        let mut plan = three_tasks(&mut bench, &times);
        plan.inputs_shift_ns = Some(-before_us * 1_000);
        let timing = plan.timing(&options);
        let device = timing.devices.iter().find(|one| one.device == DeviceId(2)).expect("I1");
        let case = format!("{before_us} µs before the cycle: {device:#?}");
        assert_eq!(device.after_frames.verdict, TimingVerdict::Pass, "{case}");
        let margin = device.before_next.margin_ns.expect("a margin");
        assert_eq!(device.before_next.frame, Some(0), "the first frame decides: {case}");
        // The frame that fetches them follows the first one at once when no program takes any time.
        let later = plan.tasks[0].frames[0].wire_time().as_nanos() as i64;
        assert!((1..12_000).contains(&later), "{later} ns: {case}");

        bench.leaves_after = Some(Box::new(waits_for_programs()));
        bench.device.start(bench.now, plan.clone());
        bench.run_for(Span::s(8));
        let found = cycles_until_inputs_are_there(&mut bench, &plan);
        let found = found.unwrap_or_else(|| panic!("I1 left OP: {case}"));
        let verdict = if margin >= 0 { TimingVerdict::Pass } else { TimingVerdict::Fail };
        assert_eq!(device.verdict, verdict, "{case}");
        // Clock, servo and wire are known to some 100 ns.
        match margin + later {
            left if left > 800 => assert_eq!(found, 0, "they come with the next frame: {case}"),
            left if left < -800 => assert_eq!(found, 1, "a cycle older: {case}"),
            _ => continue,
        }
        // By the first frame the plan fails a little sooner than inputs are old, and never later.
        assert!(verdict == TimingVerdict::Fail || found == 0, "{case}");
        compared[usize::from(verdict == TimingVerdict::Fail) + found as usize] += 1;
    }
    let [pass, sooner, old] = compared;
    assert!(pass >= 5 && sooner >= 2 && old >= 4, "{compared:?}");
}

/// Time within the cycle by the reference clock, in ns.
pub(crate) fn phase(bench: &Bench, plan: &Plan, cycle: Span) -> i64 {
    let reference = plan.reference_clock().expect("a reference clock");
    let clock = bench.segment.controller(reference).expect("it is there");
    (clock.system_time(bench.now) % cycle.as_nanos()) as i64
}

/// Runs until what `seen` shows changes; when that was within the cycle.
fn when_changed<T: PartialEq>(bench: &mut Bench, plan: &Plan, seen: impl Fn(&Bench) -> T) -> i64 {
    let before = seen(bench);
    for _ in 0..20_000 {
        bench.run_for(Span::us(1));
        if seen(bench) != before {
            return phase(bench, plan, CYCLE);
        }
    }
    panic!("nothing changes");
}

/// The three buffers of a SyncManager, as they lie in the memory of its controller.
pub(crate) fn buffers(bench: &Bench, plan: &Plan, id: DeviceId, manager: u8) -> Vec<u8> {
    let planned = &plan.devices[id.index()].sync_managers;
    let (_, config) = planned.iter().find(|(number, _)| *number == manager).expect("it has one");
    let (start, len) = (usize::from(config.start.0) - 0x1000, usize::from(config.length));
    bench.segment.controller(id).expect("a controller").ram()[start..start + 3 * len].to_vec()
}

/// When SYNC0 of a SubDevice comes next, within the cycle.
pub(crate) fn next_sync0(
    bench: &mut Bench,
    plan: &Plan,
    station: StationAddress,
    cycle: Span,
) -> i64 {
    let (target, register) = (Target::Station(station), register::START_TIME.address);
    bench.device.probe(bench.now, ProbeRequest { target, register, len: 8, write: None });
    let mut found = None;
    bench.run_until(Span::ms(20), |event| {
        let Event::Probed { result: Ok(reply), .. } = event else { return false };
        found = Some(u64::from_le_bytes(reply.bytes(0)));
        true
    });
    // Some clocks have the low half only.
    let reference = plan.reference_clock().expect("a reference clock");
    let now = bench.segment.controller(reference).expect("it is there").system_time(bench.now);
    let ahead = (found.expect("an answer") as u32).wrapping_sub(now as u32) as i32;
    (now.wrapping_add_signed(ahead.into()) % cycle.as_nanos()) as i64
}

// The plot is drawn from these numbers (`plan --timing --svg`).
// proves: SYN-26
#[test]
fn frames_sync_reading_and_writing_of_each_clocked_subdevice_are_where_the_plot_has_them() {
    let times = measured();
    let mut bench = Bench::new(PLANT);
    let mut plan = plan(&mut bench, TaskOptions::new("cyclic", CYCLE), terminals);
    for (device, times) in plan.devices.iter_mut().zip(&times) {
        device.sync_times = *times;
    }
    let timing = plan.timing(&options(1));
    start(&mut bench, plan.clone());
    bench.run_for(Span::s(4));
    let [outputs, inputs] = timing.devices.as_slice() else { panic!("{timing:#?}") };
    // What is looked at once a µs is seen up to 1 µs late; clocks and cycle are in step within some 100 ns.
    let is_within = |what: &str, at: i64, from: i64, to: i64| {
        let cycle = CYCLE.as_nanos() as i64;
        let at = if at > to + cycle / 2 { at - cycle } else { at };
        assert!((from - 500..=to + 1_500).contains(&at), "{what}: {at} ns, {from} to {to} ns");
    };
    for round in 1..=5_u8 {
        let (id, planned) = (DeviceId(1), outputs.times.as_ref().expect("times"));
        let signal = bench.segment.outputs(id)[0];
        let range = plan.devices[1].outputs.clone();
        bench.device.outputs_mut()[range][0] = round;
        let frame = when_changed(&mut bench, &plan, |bench| buffers(bench, &plan, id, 2));
        let arrival = planned.frames.iter().find(|frame| frame.own).expect("its frame");
        is_within("frame with outputs", frame, arrival.earliest_ns, arrival.latest_ns);
        let read = when_changed(&mut bench, &plan, |bench| bench.segment.signals().value(signal));
        let latest = planned.sync0_ns + planned.outputs_read.expect("known").as_nanos() as i64;
        is_within("outputs", read, planned.sync0_ns, latest);
        let sync0 = next_sync0(&mut bench, &plan, plan.devices[1].station, CYCLE);
        is_within("SYNC0", sync0, planned.sync0_ns, planned.sync0_ns);

        let (id, planned) = (DeviceId(2), inputs.times.as_ref().expect("times"));
        let signal = bench.segment.inputs(id)[0];
        bench.segment.signals_mut().set(signal, i32::from(round) * 1_000);
        let written = when_changed(&mut bench, &plan, |bench| buffers(bench, &plan, id, 3));
        let latest = planned.sync0_ns + planned.inputs_written.expect("known").as_nanos() as i64;
        is_within("inputs", written, planned.sync0_ns, latest);
        let sync0 = next_sync0(&mut bench, &plan, plan.devices[2].station, CYCLE);
        is_within("SYNC0", sync0, planned.sync0_ns, planned.sync0_ns);
        // The frame that fetches them is that of the next cycle.
        let range = plan.devices[2].inputs.clone();
        let fetched =
            when_changed(&mut bench, &plan, |bench| bench.device.inputs()[range.clone()].to_vec());
        let arrival = planned.frames.iter().find(|frame| frame.fetches).expect("its frame");
        // It is seen when it is back.
        is_within("frame with inputs", fetched, arrival.earliest_ns, arrival.latest_ns + 5_000);
    }
}
