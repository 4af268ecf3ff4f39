//! Plans that are drawn, held against what the segment does: those that the timing of a plan passes never lose sync,
//! those that fail its first rule do. `cargo bench -p linesman-maindevice --bench timing_of_plans` draws 500.
//!
//! The second rule, inputs ready before the next frame fetches them, costs no sync when it is broken: inputs are a cycle
//! late. Plans that fail by that rule alone are counted by themselves.

use linesman_config::fault::FaultName;
use linesman_config::plan::layout::TaskOptions;
use linesman_config::plan::timing::{PlanTiming, TimingOptions, TimingVerdict};
use linesman_config::plan::{ClockSettings, Plan, PlanOptions, ProcessAccess};
use linesman_config::profile::{DirectionTimes, SyncTimes};
use linesman_maindevice::Event;
use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};
use linesman_sim::seed::{Seed, Stream};
use linesman_sim::segment_file::FaultEntry;

use crate::bench::Bench;

/// A plan that fails by less may run all the same: what the line takes is reckoned a little higher than it is.
const NARROW_NS: i64 = -5_000;
/// Frames that leave late, of so many.
const CYCLES: u64 = 1_000;
const LATE: u32 = 125;

/// What drawn plans came to.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub(crate) struct PlansAndRuns {
    /// Those whose verdict was wrong.
    pub(crate) wrong: Vec<String>,
    /// Passed, and kept sync.
    pub(crate) passed: u32,
    /// Passed, but lost sync: the verdict was wrong.
    pub(crate) passed_and_lost: u32,
    /// Failed the first rule, and lost sync.
    pub(crate) failed: u32,
    /// Failed the first rule, but kept sync: the verdict was wrong.
    pub(crate) failed_and_kept: u32,
    /// Failed the first rule by less than 5 µs, and kept sync.
    pub(crate) narrow: u32,
    /// Failed the second rule alone, and kept sync.
    pub(crate) second: u32,
    /// Failed the second rule alone, and lost sync.
    pub(crate) second_and_lost: u32,
}

impl PlansAndRuns {
    /// Draws so many plans and runs each.
    pub(crate) fn draw(seed: u64, count: u32) -> Self {
        let mut all = Self::default();
        let mut stream = Seed(seed).stream("timing of plans");
        for _ in 0..count {
            let drawn = DrawnPlan::new(&mut stream);
            let (timing, loses) = drawn.run();
            let first = timing.devices.iter().map(|device| device.after_frames.margin_ns).min();
            let fails_first = timing
                .devices
                .iter()
                .any(|device| device.after_frames.verdict == TimingVerdict::Fail);
            let is_narrow = first.flatten().is_some_and(|margin| margin > NARROW_NS);
            if loses != (timing.verdict() == TimingVerdict::Fail) && !is_narrow {
                all.wrong.push(format!("{first:?} ns, loses: {loses}: {drawn:?}"));
            }
            let counted = match (timing.verdict(), fails_first, loses) {
                (TimingVerdict::Pass, _, false) => &mut all.passed,
                (TimingVerdict::Pass, _, true) => &mut all.passed_and_lost,
                (_, true, true) => &mut all.failed,
                (_, true, false) if is_narrow => &mut all.narrow,
                (_, true, false) => &mut all.failed_and_kept,
                (_, false, false) => &mut all.second,
                (_, false, true) => &mut all.second_and_lost,
            };
            *counted += 1;
        }
        all
    }
}

/// A line, its cycle and shift, and a computer that sends late.
#[derive(Debug)]
struct DrawnPlan {
    text: String,
    cable_m: u32,
    cycle: Span,
    shift: Span,
    late: Span,
}

impl DrawnPlan {
    fn new(stream: &mut Stream) -> Self {
        let mut text = format!("name = \"drawn\"\nseed = {}\n", stream.between(1, 1_000_000));
        let mut cable_m = 0;
        for coupler in 0..stream.between(1, 4) {
            let on = match coupler {
                0 => "maindevice".to_owned(),
                _ => format!("K{}.C", coupler - 1),
            };
            let metres = stream.between(1, 100) as u32;
            cable_m += if coupler == 0 { 0 } else { metres };
            text += &format!(
                "[[device]]\nname = \"K{coupler}\"\ntype = \"EK1100\"\non = \"{on}\"\ncable_m = {metres}.0\n"
            );
            for terminal in 0..stream.between(1, 4) {
                let kind = stream.pick(&["EL4102", "EL3102"]).copied().unwrap_or("EL4102");
                let on = match terminal {
                    0 => format!("K{coupler}.B"),
                    _ => format!("T{coupler}_{}.B", terminal - 1),
                };
                text += &format!(
                    "[[device]]\nname = \"T{coupler}_{terminal}\"\ntype = \"{kind}\"\non = \"{on}\"\n"
                );
            }
        }
        let cycle = stream.pick(&[500, 1_000, 2_000]).copied().unwrap_or(1_000_u64);
        let part = |percent: u64| Span::us(cycle * percent / 100);
        let (shift, late) = (part(stream.between(2, 60)), part(stream.between(1, 40)));
        Self { text, cable_m, cycle: Span::us(cycle), shift, late }
    }

    fn plan(&self, bench: &mut Bench) -> Plan {
        let inventory = bench.scan();
        let mut planned = inventory.planned(AlState::Op);
        for device in planned.iter_mut().filter(|one| one.profile.type_name.starts_with("EL")) {
            device.settings.clock = Some(ClockSettings {
                assign_activate: 0x0300,
                sync0_cycle: self.cycle,
                ..ClockSettings::default()
            });
            device.settings.access = ProcessAccess::Separate;
        }
        let tasks = vec![TaskOptions::new("cyclic", self.cycle)];
        let options = PlanOptions { tasks, clock_datagrams: true, ..PlanOptions::default() };
        let plan = Plan::build(&planned, inventory.tree().clone(), &options);
        let mut plan = plan.expect("a plan");
        for device in &mut plan.devices {
            // As these types measure them of themselves.
            let times = DirectionTimes {
                min_cycle_ns: Some(100_000),
                calc_and_copy_ns: Some(12_000),
                shift_ns: None,
            };
            let is_known = device.settings.clock.is_some();
            let of =
                |is_used: bool| if is_used && is_known { times } else { DirectionTimes::default() };
            device.sync_times = SyncTimes {
                outputs: of(!device.outputs.is_empty()),
                inputs: of(!device.inputs.is_empty()),
            };
        }
        plan.outputs_shift = Some(self.shift);
        plan.inputs_shift_ns = Some(self.shift.as_nanos() as i64);
        plan
    }

    /// What the timing of the plan says, and whether a SubDevice loses sync when it runs.
    fn run(&self) -> (PlanTiming, bool) {
        let mut bench = Bench::new(&self.text);
        let plan = self.plan(&mut bench);
        let options = TimingOptions {
            jitter: Some(self.late),
            cable_m: Some(self.cable_m),
            // What clocks and the cycle are off.
            margin: Span::us(2),
            ..TimingOptions::default()
        };
        let timing = plan.timing(&options);
        bench.device.start(bench.now, plan.clone());
        let all = bench.run_until(Span::s(20), |event| matches!(event, Event::AllReached));
        assert!(all, "not all reach OP in time without late frames: {self:?}");
        bench.run_for(Span::s(1));
        let span = self.cycle * CYCLES;
        let ms = |at: Instant| at.as_nanos() as f64 / 1e6;
        let jitter = FaultEntry::new(FaultName::HostJitter)
            .with("hits", LATE)
            .with("delay_us", self.late.as_nanos() as f64 / 1e3)
            .from_to(ms(bench.now), Some(ms(bench.now + span)));
        bench.segment.inject(bench.now, &jitter).expect("a fault");
        let before = missed(&mut bench, &plan);
        let seen = bench.events.len();
        bench.run_for(span);
        let fell = |(_, event): &(Instant, Event)| matches!(event, Event::AbnormalState { .. });
        let fell = bench.events[seen..].iter().any(fell);
        (timing, fell || missed(&mut bench, &plan) != before)
    }
}

/// Cycles that SubDevices missed or were late in, as they count them; of one that has left OP `None`.
fn missed(bench: &mut Bench, plan: &Plan) -> Vec<Option<Vec<u8>>> {
    let clocked = plan.devices.iter().filter(|device| device.settings.clock.is_some());
    let mut counts = Vec::new();
    for device in clocked {
        let index = if device.outputs.is_empty() { 0x1C33 } else { 0x1C32 };
        for subindex in [0x0B, 0x0C, 0x0D] {
            let object = ObjectAddress::new(index, subindex);
            bench.device.sdo_upload(bench.now, device.id, object, false);
            let mut read = None;
            bench.run_until(Span::s(1), |event| {
                let Event::SdoUploaded { result, .. } = event else { return false };
                read = result.as_ref().ok().cloned();
                true
            });
            counts.push(read);
        }
    }
    counts
}

#[test]
fn of_drawn_plans_those_that_pass_keep_sync_and_those_that_fail_the_first_rule_lose_it() {
    let all = PlansAndRuns::draw(1, 24);
    assert_eq!((all.passed_and_lost, all.failed_and_kept), (0, 0), "{all:?}");
    assert!(all.passed >= 4 && all.failed >= 4, "{all:?}");
}
