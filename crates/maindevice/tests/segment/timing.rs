//! What the timing of a plan says beforehand, against a line that runs: SubDevices in step with SYNC0, and a computer
//! that sends late.

use linesman_config::fault::FaultName;
use linesman_config::plan::layout::TaskOptions;
use linesman_config::plan::timing::{TimingOptions, TimingVerdict};
use linesman_config::plan::{ClockSettings, Plan, PlanOptions, ProcessAccess, ShiftReference};
use linesman_config::profile::{DirectionTimes, SyncTimes};
use linesman_maindevice::Event;
use linesman_proto::address::DeviceId;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use linesman_sim::segment_file::FaultEntry;

use crate::bench::Bench;
use crate::clocks::start;
use crate::mailbox::{put, upload};

const PLANT: &str = r#"
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
const CYCLE: Span = Span::ms(1);
const OUTPUTS: u16 = 0x1C32;
const INPUTS: u16 = 0x1C33;
/// A long time, in cycles.
const CYCLES: u32 = 4_000;

/// A plan for this task, with SYNC0 for the SubDevices whose types `clocked` picks.
fn plan(bench: &mut Bench, task: TaskOptions, clocked: impl Fn(&str) -> bool) -> Plan {
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

fn number(bench: &mut Bench, name: &str, index: u16, subindex: u8) -> u64 {
    let bytes = upload(bench, name, index, subindex).unwrap_or_default();
    bytes.iter().rev().fold(0, |value, byte| value << 8 | u64::from(*byte))
}

/// The times that the SubDevices measure of themselves, once they run.
fn measured() -> Vec<SyncTimes> {
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
