use std::ops::Range;

use linesman_proto::address::{DeviceId, LogicalAddress, Path};
use linesman_proto::command::Command;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::port::{Port, PortMap};
use linesman_proto::register::SYSTEM_TIME;
use linesman_proto::sii::{Direction, PortKind};
use linesman_proto::topology::{End, Tree, Wired};
use proptest::prelude::*;

use super::*;
use crate::plan::{
    ClockSettings, DatagramPlan, FramePlan, IoAt, Ownership, Role, ShiftReference, SyncUnit, Task,
};
use crate::profile::{DirectionTimes, SyncTimes};

const MII: PortMap<PortKind> =
    PortMap([PortKind::Mii, PortKind::Mii, PortKind::None, PortKind::None]);
const EBUS: PortMap<PortKind> =
    PortMap([PortKind::EBus, PortKind::EBus, PortKind::None, PortKind::None]);

/// A line of SubDevices with these ports, one behind the other, each with outputs and inputs or one of them.
struct Line {
    plan: Plan,
}

fn times(cycle_ns: u32, copy_ns: u32) -> SyncTimes {
    let of = DirectionTimes {
        min_cycle_ns: Some(cycle_ns),
        calc_and_copy_ns: Some(copy_ns),
        shift_ns: None,
    };
    SyncTimes { outputs: of, inputs: of }
}

impl Line {
    fn new(ports: &[PortMap<PortKind>]) -> Self {
        let wiring: Vec<Wired> = (0..ports.len())
            .map(|node| match node {
                0 => Wired { on: End::MainDevice(Path::A), entry: Port::A },
                _ => Wired { on: End::Controller(node - 1, Port::B), entry: Port::A },
            })
            .collect();
        let tree = Tree::from_wiring(&wiring, None).expect("a line");
        let mut plan = Plan::empty(tree);
        for (no, ports) in (0..).zip(ports) {
            let device = DevicePlan { ports: Some(*ports), ..DevicePlan::bare(DeviceId(no)) };
            plan.devices.push(device);
        }
        Self { plan }
    }

    /// Gives a SubDevice SYNC0 in each cycle of a task, and process data.
    fn clock(&mut self, no: usize, cycle: Span, outputs: bool, inputs: bool) {
        let device = &mut self.plan.devices[no];
        device.settings.clock = Some(ClockSettings {
            assign_activate: 0x0300,
            sync0_cycle: cycle,
            ..ClockSettings::default()
        });
        let len = |has| if has { 0..2 } else { 0..0 };
        (device.outputs, device.inputs) = (len(outputs), len(inputs));
        device.sync_times = times(100_000, 12_000);
    }

    /// Adds a task whose frame has the data of these SubDevices; the first brings the time of the reference clock.
    fn task(&mut self, name: &str, cycle: Span, io_at: IoAt, devices: &[u32]) {
        let ids: Vec<DeviceId> = devices.iter().map(|no| DeviceId(*no)).collect();
        let frame = FramePlan::new(vec![self.data(&ids, Command::Lrw)]);
        let mut frames = vec![frame];
        if self.plan.tasks.is_empty() {
            frames[0].datagrams.insert(0, time());
        }
        let unit = SyncUnit { name: "unit".to_owned(), devices: ids };
        let name = name.to_owned();
        self.plan.tasks.push(Task { name, cycle, io_at, sync_units: vec![unit], frames });
    }

    fn data(&self, ids: &[DeviceId], command: Command) -> DatagramPlan {
        let ways = |id: &DeviceId| {
            let device = &self.plan.devices[id.index()];
            let own = |direction, range: &Range<usize>| Ownership {
                device: *id,
                direction,
                range: 0..range.len(),
                image_at: 0,
                masks: Ownership::WHOLE,
            };
            let writes = command != Command::Lrd && !device.outputs.is_empty();
            let reads = command != Command::Lwr && !device.inputs.is_empty();
            let outputs = writes.then(|| own(Direction::Outputs, &device.outputs));
            outputs.into_iter().chain(reads.then(|| own(Direction::Inputs, &device.inputs)))
        };
        DatagramPlan {
            command,
            address: DatagramAddress::Logical(LogicalAddress(0x0100_0000)),
            len: 16,
            role: Role::ProcessData,
            sync_unit: Some(0),
            ownership: ids.iter().flat_map(ways).collect(),
        }
    }
}

fn time() -> DatagramPlan {
    DatagramPlan {
        command: Command::Armw,
        address: DatagramAddress::Physical(0, SYSTEM_TIME.address),
        len: 4,
        role: Role::ReferenceClock,
        sync_unit: None,
        ownership: Vec::new(),
    }
}

/// Nothing is assumed: neither jitter nor cables.
fn exact() -> TimingOptions {
    TimingOptions {
        jitter: Some(Span::ZERO),
        task_jitter: Some(Span::ZERO),
        cable_m: Some(0),
        ..TimingOptions::default()
    }
}

fn jitter(us: u64) -> TimingOptions {
    TimingOptions { jitter: Some(Span::us(us)), ..exact() }
}

/// A coupler and a terminal with outputs and inputs in a task of 1 ms.
fn one(outputs: bool, inputs: bool) -> Line {
    let mut line = Line::new(&[MII, EBUS]);
    line.clock(1, Span::ms(1), outputs, inputs);
    line.task("cyclic", Span::ms(1), IoAt::TaskBegin, &[1]);
    line
}

// S0 L401-423.
// proves: SYN-17
#[test]
fn twenty_cabled_and_thirty_on_the_e_bus_with_100_m_need_30_06_us_before_jitter() {
    let ports: Vec<_> = (0..50).map(|no| if no < 20 { MII } else { EBUS }).collect();
    let mut line = Line::new(&ports);
    line.clock(0, Span::ms(1), true, true);
    line.clock(49, Span::ms(1), true, true);
    line.task("first", Span::ms(1), IoAt::TaskEnd, &[0]);
    line.task("second", Span::ms(1), IoAt::TaskEnd, &[49]);
    let options = TimingOptions { cable_m: Some(100), ..exact() };
    let estimate = line.plan.timing(&options).outputs;
    assert_eq!((estimate.cabled, estimate.terminals), (20, 30));
    assert_eq!((estimate.devices, estimate.cables), (Span::us(29), Span::ns(1_060)));
    assert_eq!(estimate.line(), Span::ns(30_060));
    assert_eq!(estimate.total(), Span::ns(30_060));
    // Each part on top of it.
    let execution = vec![("first".to_owned(), Span::us(50)), ("second".to_owned(), Span::us(7))];
    let options = TimingOptions {
        jitter: Some(Span::us(20)),
        task_jitter: Some(Span::us(5)),
        execution,
        cable_m: Some(100),
        margin: Span::us(10),
    };
    let total = |line: &Line| line.plan.timing(&options).outputs.total();
    assert_eq!(total(&line), Span::ns(30_060 + 20_000 + 5_000 + 7_000 + 10_000));
    // At the begin of the task its end does not matter, and what it takes comes before the second frame.
    line.plan.tasks[0].io_at = IoAt::TaskBegin;
    assert_eq!(total(&line), Span::ns(30_060 + 20_000 + 50_000 + 7_000 + 10_000));
    // What is before the reference clock does not count.
    line.plan.devices[0].settings.clock = None;
    line.clock(10, Span::ms(1), true, true);
    let estimate = line.plan.timing(&exact()).outputs;
    assert_eq!((estimate.cabled, estimate.terminals), (10, 30));
}

// S0 L429-445.
// proves: SYN-18
#[test]
fn inputs_shift_needs_jitter_the_largest_shortest_cycle_the_earlier_fetch_and_a_margin() {
    let mut line = Line::new(&[EBUS, EBUS, EBUS]);
    for no in 0..3 {
        line.clock(no, Span::ms(2), no == 0, true);
    }
    // The first has outputs: its shortest cycle does not count here.
    for (no, ns) in [(0, 900_000), (1, 150_000), (2, 40_000)] {
        line.plan.devices[no].sync_times.inputs.min_cycle_ns = Some(ns);
    }
    line.task("cyclic", Span::ms(2), IoAt::TaskEnd, &[0, 1, 2]);
    line.plan.tasks[0].frames[0].ahead = Span::us(300);
    let options = TimingOptions {
        jitter: Some(Span::us(20)),
        task_jitter: Some(Span::us(5)),
        margin: Span::us(10),
        ..exact()
    };
    let estimate = line.plan.timing(&options).inputs.expect("two with inputs only");
    assert_eq!(estimate.total(), Span::us(20 + 150 + 300 + 5 + 10));
    assert!(estimate.unknown.is_empty());
    line.plan.tasks[0].io_at = IoAt::TaskBegin;
    line.plan.devices[1].sync_times = SyncTimes::default();
    let estimate = line.plan.timing(&options).inputs.expect("two with inputs only");
    assert_eq!(estimate.total(), Span::us(20 + 40 + 300 + 10));
    assert_eq!(estimate.unknown, [DeviceId(1)]);
    line.plan.devices[1].settings.clock = None;
    line.plan.devices[2].settings.clock = None;
    assert_eq!(line.plan.timing(&options).inputs, None);
}

// proves: SYN-06 (U), SYN-27 (U)
#[test]
fn subdevice_passes_and_fails_by_both_rules_with_the_margin_that_is_left_or_missing() {
    let mut line = one(true, true);
    // The frame ends 6,720 ns after it begins, and is at the reference clock: nothing delays it.
    let wire = line.plan.tasks[0].frames[0].wire_time().as_nanos() as i64;
    let of = |line: &Line, options| line.plan.timing(&options).devices[0].clone();
    let timing = of(&line, jitter(20));
    assert_eq!(timing.verdict, TimingVerdict::Pass);
    assert_eq!(timing.after_frames.margin_ns, Some(300_000 - wire - 20_000 - 12_000));
    assert_eq!(timing.before_next.margin_ns, Some(1_000_000 - 20_000 - 300_000 - 12_000));
    // SYNC0 comes while a late frame is not over yet.
    line.plan.outputs_shift = Some(Span::us(20));
    let timing = of(&line, jitter(20));
    assert_eq!(timing.after_frames.verdict, TimingVerdict::Fail);
    assert_eq!(timing.after_frames.margin_ns, Some(20_000 - wire - 20_000 - 12_000));
    assert_eq!(timing.before_next.verdict, TimingVerdict::Pass);
    assert_eq!(timing.verdict, TimingVerdict::Fail);
    // SYNC0 comes so late that the work is not over when an early frame comes.
    line.plan.outputs_shift = Some(Span::us(975));
    let timing = of(&line, jitter(20));
    assert_eq!(timing.after_frames.verdict, TimingVerdict::Pass);
    assert_eq!(timing.before_next.margin_ns, Some(1_000_000 - 20_000 - 975_000 - 12_000));
    assert_eq!(timing.before_next.verdict, TimingVerdict::Fail);
    // A margin that is asked for counts.
    line.plan.outputs_shift = Some(Span::us(60));
    assert_eq!(of(&line, jitter(20)).verdict, TimingVerdict::Pass);
    let wide = TimingOptions { margin: Span::us(40), ..jitter(20) };
    assert_eq!(of(&line, wide).verdict, TimingVerdict::Fail);
}

// proves: SYN-06 (U)
#[test]
fn every_subdevice_on_the_way_and_every_metre_takes_from_the_margin() {
    let margin = |terminals: usize, metres| {
        let mut ports = vec![EBUS; terminals + 2];
        ports[1] = MII;
        ports[0] = MII;
        let mut line = Line::new(&ports);
        line.clock(0, Span::ms(1), true, true);
        line.clock(terminals + 1, Span::ms(1), true, true);
        line.task("cyclic", Span::ms(1), IoAt::TaskBegin, &[0, terminals as u32 + 1]);
        let options = TimingOptions { cable_m: metres, ..exact() };
        let timing = line.plan.timing(&options);
        (timing.devices[1].after_frames.margin_ns.unwrap(), timing.assumed.len())
    };
    let (short, told) = margin(1, Some(0));
    assert_eq!(told, 0);
    assert_eq!(margin(11, Some(0)).0, short - 10 * 300);
    assert_eq!(margin(1, Some(100)).0, short - 1_060);
    // The longest cable is assumed where no length is given, and told.
    assert_eq!(margin(1, None), (short - 1_060, 1));
}

// S0 L656-688: 3 tasks of 2 ms that take 16, 120 and 184 µs, with outputs, with inputs, with both.
// proves: SYN-28 (U)
#[test]
fn of_three_tasks_the_last_frame_decides_the_first_rule_and_the_first_frame_the_second() {
    let mut line = Line::new(&[MII, EBUS, EBUS, EBUS]);
    for (no, outputs, inputs) in [(1, true, false), (2, false, true), (3, true, true)] {
        line.clock(no, Span::ms(2), outputs, inputs);
    }
    for (no, name) in [(1, "IoTask"), (2, "PlcTask"), (3, "PlcTask3")] {
        line.task(name, Span::ms(2), IoAt::TaskEnd, &[no]);
    }
    line.plan.outputs_shift = Some(Span::ns(613_700));
    let takes = |name: &str, us| (name.to_owned(), Span::us(us));
    let execution = vec![takes("IoTask", 16), takes("PlcTask", 120), takes("PlcTask3", 184)];
    let options = TimingOptions { execution, ..exact() };
    let timing = line.plan.timing(&options);
    assert_eq!(timing.verdict(), TimingVerdict::Pass);
    let wire = line.plan.tasks[2].frames[0].wire_time().as_nanos() as i64;
    let last = 304_000 + wire;
    for (at, reference, sync0) in [
        (0, ShiftReference::Outputs, 613_700),
        (1, ShiftReference::Inputs, 1_800_000),
        (2, ShiftReference::Outputs, 613_700),
    ] {
        let device = &timing.devices[at];
        assert_eq!(device.reference, reference);
        assert_eq!(device.times.as_ref().unwrap().sync0_ns, sync0);
        let delay = 300 * at as i64;
        let first = device.after_frames.margin_ns.unwrap();
        let copy = if at == 1 { 0 } else { 12_000 };
        assert_eq!((device.after_frames.frame, first), (Some(2), sync0 - copy - last - delay));
        let second = device.before_next.margin_ns.unwrap();
        assert_eq!((device.before_next.frame, second), (Some(0), 2_000_000 - sync0 - 12_000));
    }
    // What the tasks take at their longest comes before SYNC0 no more.
    line.plan.outputs_shift = Some(Span::us(300));
    let timing = line.plan.timing(&options);
    assert_eq!(timing.devices[0].after_frames.verdict, TimingVerdict::Fail);
    assert_eq!(timing.devices[0].after_frames.frame, Some(2));
    assert!(timing.outputs_shift.is_some());
}

// proves: SYN-25 partial: told by the plan
#[test]
fn cycle_below_the_shortest_of_a_subdevice_fails_with_a_slower_task_as_advice() {
    let mut line = one(true, true);
    line.plan.devices[1].sync_times.inputs.min_cycle_ns = Some(1_500_000);
    let timing = line.plan.timing(&exact());
    let device = &timing.devices[0];
    assert_eq!((device.verdict, device.too_fast), (TimingVerdict::Fail, Some(Span::us(1_500))));
    assert_eq!(device.slower, Some(SlowerTask { cycle: Span::ms(2), task: None }));
    line.task("slow", Span::ms(4), IoAt::TaskBegin, &[]);
    let timing = line.plan.timing(&exact());
    let slower = SlowerTask { cycle: Span::ms(2), task: Some("slow".to_owned()) };
    assert_eq!(timing.devices[0].slower, Some(slower));
    line.plan.devices[1].sync_times.inputs.min_cycle_ns = Some(1_000_000);
    assert_eq!(line.plan.timing(&exact()).devices[0].slower, None);
}

#[test]
fn what_is_not_known_is_not_judged_and_what_is_assumed_is_told() {
    let mut line = one(true, true);
    let all = line.plan.timing(&TimingOptions::default());
    assert_eq!(all.jitter, Span::us(100));
    assert!(all.assumed.iter().any(|told| told.contains("jitter")), "{:?}", all.assumed);
    line.plan.devices[1].sync_times = SyncTimes::default();
    let device = line.plan.timing(&exact()).devices[0].clone();
    assert_eq!(device.after_frames.verdict, TimingVerdict::Pass);
    assert_eq!(device.before_next.verdict, TimingVerdict::NotJudged);
    assert_eq!(device.verdict, TimingVerdict::NotJudged);
    assert!(device.before_next.lacks.contains("0x1C33"), "{}", device.before_next.lacks);
    assert_eq!(device.assumed.len(), 2, "{:?}", device.assumed);
    // Nothing ties frames to SYNC0.
    line.plan.tasks[0].frames[0].datagrams.remove(0);
    let timing = line.plan.timing(&exact());
    assert_eq!(timing.verdict(), TimingVerdict::NotJudged);
    assert!(timing.devices[0].after_frames.lacks.contains("reference clock"));
    assert_eq!(
        Plan::empty(line.plan.tree.clone()).timing(&exact()).verdict(),
        TimingVerdict::NotJudged
    );
}

// proves: SYN-29 partial: where the plot has it from
#[test]
fn frame_that_fetches_inputs_earlier_is_where_it_is() {
    let mut line = one(true, true);
    let ids = [DeviceId(1)];
    let (fetch, put) = (line.data(&ids, Command::Lrd), line.data(&ids, Command::Lwr));
    let early = FramePlan { ahead: Span::us(300), ..FramePlan::new(vec![time(), fetch]) };
    line.plan.tasks[0].frames = vec![early, FramePlan::new(vec![put])];
    let timing = line.plan.timing(&jitter(20));
    let times = timing.devices[0].times.as_ref().unwrap();
    let frames: Vec<_> =
        times.frames.iter().map(|one| (one.due_ns, one.earliest_ns, one.fetches)).collect();
    assert_eq!(frames, [(-300_000, -320_000, true), (0, -20_000, false)]);
    assert_eq!(times.sync0_ns, 300_000);
    // Inputs are fetched so much sooner after SYNC0.
    let left = 1_000_000 - 300_000 - 20_000 - 300_000 - 12_000;
    assert_eq!(timing.devices[0].before_next.margin_ns, Some(left));
    assert_eq!(timing.devices[0].before_next.frame, Some(0));
    assert_eq!(timing.devices[0].after_frames.frame, Some(1));
}

#[test]
fn frames_of_a_slower_task_may_come_in_any_cycle_of_the_one_that_brings_the_time() {
    let mut line = Line::new(&[MII, EBUS, EBUS]);
    line.clock(1, Span::ms(1), true, true);
    line.clock(2, Span::ms(4), true, true);
    line.task("fast", Span::ms(1), IoAt::TaskBegin, &[1]);
    line.task("slow", Span::ms(4), IoAt::TaskBegin, &[2]);
    let timing = line.plan.timing(&exact());
    let slow = timing.devices[1].times.as_ref().unwrap();
    assert_eq!((slow.cycle, slow.period), (Span::ms(4), Span::ms(1)));
    assert_eq!(slow.sync0_ns, 200_000, "1.2 ms, by the cycle of the other");
    assert_eq!(timing.verdict(), TimingVerdict::Pass);
    // SYNC0 in every fourth cycle only leaves time for the work up to the next but three.
    line.plan.devices[1].settings.clock.as_mut().unwrap().sync0_cycle = Span::ms(4);
    line.plan.devices[1].sync_times = times(2_000_000, 2_000_000);
    line.plan.outputs_shift = Some(Span::us(300));
    let timing = line.plan.timing(&exact());
    assert_eq!(timing.devices[0].before_next.margin_ns, Some(4_000_000 - 300_000 - 2_000_000));
}

#[test]
fn no_shift_mends_a_cycle_that_is_too_short_for_the_work() {
    let mut line = one(true, true);
    line.plan.devices[1].sync_times = times(900_000, 600_000);
    let timing = line.plan.timing(&exact());
    let device = &timing.devices[0];
    assert_eq!((device.verdict, device.own_shift_ns), (TimingVerdict::Fail, None));
    assert_eq!(device.slower, Some(SlowerTask { cycle: Span::ms(2), task: None }));
    assert_eq!(timing.outputs_shift, None);
}

proptest! {
    #[test]
    fn shift_that_is_proposed_passes(
        cycle in 100_u64..4_000,
        shift in 0_u64..4_000,
        inputs_shift in -4_000_i64..4_000,
        own in -1_000_000_i64..1_000_000,
        jitter_us in 0_u64..200,
        copy in 0_u32..400_000,
        kinds in prop::collection::vec((any::<bool>(), any::<bool>()), 1..5),
    ) {
        let cycle = Span::us(cycle);
        let mut line = Line::new(&vec![EBUS; kinds.len()]);
        let all: Vec<u32> = (0..kinds.len() as u32).collect();
        for (no, (outputs, moved)) in kinds.iter().enumerate() {
            line.clock(no, cycle, *outputs, true);
            line.plan.devices[no].sync_times = times(1, copy);
            if *moved {
                line.plan.devices[no].settings.clock.as_mut().unwrap().sync0_shift_ns = own;
            }
        }
        line.task("cyclic", cycle, IoAt::TaskBegin, &all);
        line.plan.outputs_shift = Some(Span::us(shift));
        line.plan.inputs_shift_ns = Some(inputs_shift * 1_000);
        let options = jitter(jitter_us);
        let before = line.plan.timing(&options);
        let mut each = line.plan.clone();
        for device in &before.devices {
            if let Some(own) = device.own_shift_ns {
                let planned = &mut each.devices[device.device.index()];
                planned.settings.clock.as_mut().unwrap().sync0_shift_ns = own;
            }
        }
        let after = each.timing(&options);
        for (before, after) in before.devices.iter().zip(&after.devices) {
            let is_mended = before.own_shift_ns.is_some() || before.verdict == TimingVerdict::Pass;
            prop_assert_eq!(is_mended, after.verdict == TimingVerdict::Pass);
            // Where no shift mends it, none of all does.
            if before.slower.is_some() {
                let period = cycle.as_nanos() as i64;
                let times = before.times.as_ref().unwrap();
                for at in (0..period).step_by(997) {
                    let margins = times.margins(at);
                    prop_assert!(margins.first.0 < 0 || margins.second.0 < 0, "{}", at);
                }
            }
        }
        for (reference, moved) in [
            (ShiftReference::Outputs, before.outputs_shift.is_some()),
            (ShiftReference::Inputs, before.inputs_shift_ns.is_some()),
        ] {
            if !moved {
                continue;
            }
            let mut all = line.plan.clone();
            all.outputs_shift = before.outputs_shift.or(all.outputs_shift);
            all.inputs_shift_ns = before.inputs_shift_ns.or(all.inputs_shift_ns);
            let after = all.timing(&options);
            let mine = after.devices.iter().filter(|device| device.reference == reference);
            for device in mine {
                prop_assert_eq!(device.verdict, TimingVerdict::Pass);
            }
        }
    }

    #[test]
    fn more_jitter_never_raises_a_margin(
        shift in 0_u64..2_000,
        less in 0_u64..300,
        more in 0_u64..300,
        task_jitter in 0_u64..50,
        metres in 0_u32..1_000,
    ) {
        let mut line = one(true, true);
        line.plan.tasks[0].io_at = IoAt::TaskEnd;
        line.plan.outputs_shift = Some(Span::us(shift));
        let margins = |jitter_us, task_us, metres| {
            let options = TimingOptions {
                task_jitter: Some(Span::us(task_us)),
                cable_m: Some(metres),
                ..jitter(jitter_us)
            };
            let device = line.plan.timing(&options).devices[0].clone();
            [device.after_frames.margin_ns.unwrap(), device.before_next.margin_ns.unwrap()]
        };
        let first = margins(less, 0, 0);
        for worse in [margins(less + more, 0, 0), margins(less, task_jitter, 0), margins(less, 0, metres)] {
            prop_assert!(worse[0] <= first[0] && worse[1] <= first[1], "{:?} {:?}", first, worse);
        }
    }
}
