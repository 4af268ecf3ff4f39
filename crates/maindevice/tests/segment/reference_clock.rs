//! The reference clock goes, and comes back: those who stay are not led astray by what frames carry then.
//!
//! The reference hangs on a branch of its own, before the others in the order of processing. Frames go on
//! reaching those behind it when that branch is gone.

use linesman_config::plan::{ClockSettings, Plan, PlanOptions, Role};
use linesman_maindevice::Options;
use linesman_proto::address::RegisterAddress;
use linesman_proto::command::Command;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::register::{SYSTEM_TIME, SYSTEM_TIME_DIFFERENCE, SystemTimeDifference};
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use linesman_sim::segment_file::FaultEntry;

use crate::bench::Bench;

const CYCLE: Span = Span::ms(1);
const FOLLOWERS: [&str; 3] = ["F", "T1", "T2"];
/// Clocks in step are no further apart, in ns. What a frame with time 0 does to 0x092C is a thousand times that.
const IN_STEP: u64 = 1_000;
/// How far apart clocks may be, in ns, that had nobody to follow for 1.5 s: by 3 parts per million, for what
/// a loop has learnt of its quartz in seconds is not all.
const LEFT_ALONE: u64 = 4_500;

const PLANT: &str = r#"
name = "branches"
seed = 3
[[device]]
name = "K"
type = "EK1100"
on = "maindevice"
clock_ppm = 20.0
[[device]]
name = "J"
type = "EK1122"
on = "K.B"
clock_ppm = -15.0
[[device]]
name = "R"
type = "EK1100"
on = "J.D"
clock_ppm = 30.0
[[device]]
name = "F"
type = "EK1100"
on = "J.B"
clock_ppm = -40.0
[[device]]
name = "T1"
type = "EL3102"
on = "F.B"
clock_ppm = 45.0
[[device]]
name = "T2"
type = "EL4102"
on = "T1.B"
clock_ppm = -10.0
"#;

/// How frames name the reference.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Named {
    /// ARMW: after a cut somebody else is in its place.
    ByPosition,
    /// FRMW: after a cut nobody has its address.
    ByStation,
}

fn plan(bench: &mut Bench, named: Named) -> Plan {
    let reference = bench.id("R");
    let inventory = bench.scan();
    let tree = inventory.tree().clone();
    let mut planned = inventory.planned(AlState::Op);
    for (at, device) in planned.iter_mut().enumerate() {
        let beats = device.profile.type_name.starts_with("EL");
        device.settings.clock = Some(ClockSettings {
            assign_activate: if beats { 0x0300 } else { 0 },
            sync0_cycle: CYCLE,
            sync0_shift_ns: 300_000,
            reference: at == reference.index(),
            ..ClockSettings::default()
        });
    }
    let options = PlanOptions { clock_datagrams: true, ..PlanOptions::default() };
    let mut plan = Plan::build(&planned, tree, &options).expect("a plan");
    let station = plan.devices[reference.index()].station;
    let datagrams = plan.tasks.iter_mut().flat_map(|task| &mut task.frames);
    for one in datagrams.flat_map(|frame| &mut frame.datagrams) {
        if one.role == Role::ReferenceClock && named == Named::ByStation {
            one.command = Command::Frmw;
            one.address = DatagramAddress::Physical(station.0, SYSTEM_TIME.address);
        }
    }
    plan
}

fn running(named: Named) -> Bench {
    let mut bench = Bench::with_options(PLANT, Options::default());
    let plan = plan(&mut bench, named);
    crate::clocks::start(&mut bench, plan);
    bench.run_for(Span::s(4));
    bench
}

/// 0x092C of one, without its sign.
fn difference(bench: &Bench, name: &str) -> u64 {
    let controller = bench.segment.controller(bench.id(name)).unwrap();
    let start = SYSTEM_TIME_DIFFERENCE.address.0;
    let bytes: [u8; 4] =
        std::array::from_fn(|at| controller.register(RegisterAddress(start + at as u16)));
    SystemTimeDifference::from(bytes).magnitude().as_nanos()
}

/// The worst that any of these shows within a time, and by how much their system times are apart at most.
fn worst(bench: &mut Bench, span: Span, names: &[&str]) -> (u64, u64) {
    let (mut shown, mut apart) = (0, 0);
    for _ in 0..span.as_nanos() / Span::us(250).as_nanos() {
        bench.run_for(Span::us(250));
        for name in names {
            shown = shown.max(difference(bench, name));
        }
        let time =
            |name: &&str| bench.segment.controller(bench.id(name)).unwrap().system_time(bench.now);
        // Some clocks have 32 bits.
        let first = time(&names[0]);
        let off = names.iter().map(|name| i64::from(time(name).wrapping_sub(first) as u32 as i32));
        apart = apart.max(off.clone().max().unwrap().abs_diff(off.min().unwrap()));
    }
    (shown, apart)
}

/// Frames that find no reference, on their way when its link opens and after that, disturb nobody; when the
/// link is closed again its time is handed round as before.
#[test]
fn those_who_stay_keep_their_time_when_the_reference_is_cut_off() {
    for named in [Named::ByStation, Named::ByPosition] {
        let mut bench = running(named);
        let (shown, apart) = worst(&mut bench, Span::ms(200), &FOLLOWERS);
        assert!(shown < IN_STEP && apart < IN_STEP, "{named:?} before: {shown}, {apart} ns");
        for round in 0..4 {
            // Each time at another place in the cycle, and when loops have learnt their quartzes again.
            bench.run_for(Span::s(12) + Span::us(237));
            let entry = FaultEntry::new("link-open".parse().unwrap()).at("J.D-R.A");
            let cut = bench.segment.inject(bench.now, &entry).unwrap();
            // Short ones nobody but the cycle notices; long ones the SubDevice counts as lost.
            let span = if round % 2 == 0 { Span::ms(1_500) } else { Span::ms(7) };
            let (shown, apart) = worst(&mut bench, span, &FOLLOWERS);
            assert!(shown < IN_STEP && apart < LEFT_ALONE, "{named:?} cut: {shown}, {apart} ns");
            for name in FOLLOWERS {
                assert_eq!(bench.state(name), "OP", "{named:?}");
            }
            bench.segment.heal(bench.now, cut);
            let (shown, apart) = worst(&mut bench, Span::s(2), &FOLLOWERS);
            assert!(
                shown < LEFT_ALONE && apart < LEFT_ALONE,
                "{named:?} back: {shown}, {apart} ns"
            );
        }
        let all = ["R", "F", "T1", "T2"];
        bench.run_for(Span::s(12));
        // The reference follows nobody: its register keeps what it showed while another one gave the time.
        let (shown, _) = worst(&mut bench, Span::ms(100), &FOLLOWERS);
        let (_, apart) = worst(&mut bench, Span::ms(100), &all);
        assert!(shown < IN_STEP && apart < IN_STEP, "{named:?} after: {shown}, {apart} ns");
        for name in all {
            assert_eq!(bench.state(name), "OP", "{named:?}");
        }
    }
}

/// A reference that was without power starts at zero. It is given the time of those who ran on, not that of the
/// MainDevice, from which all have drifted away by then; what it shows before that is not handed round.
#[test]
fn a_reference_that_starts_anew_is_set_to_the_time_of_those_who_stayed() {
    for named in [Named::ByStation, Named::ByPosition] {
        let mut bench = running(named);
        bench.run_for(Span::s(10));
        let ahead = bench.segment.controller(bench.id("R")).unwrap().system_time(bench.now);
        let ahead = ahead.abs_diff(bench.now.as_nanos());
        assert!(ahead > 100_000, "the MainDevice's clock shows another time: {ahead} ns");
        let entry = FaultEntry::new("device-off".parse().unwrap()).device("R");
        let off = bench.segment.inject(bench.now, &entry).unwrap();
        let (shown, apart) = worst(&mut bench, Span::s(1), &FOLLOWERS);
        assert!(shown < IN_STEP && apart < LEFT_ALONE, "{named:?} off: {shown}, {apart} ns");
        bench.segment.heal(bench.now, off);
        let (shown, apart) = worst(&mut bench, Span::s(4), &FOLLOWERS);
        let most = 2 * LEFT_ALONE;
        assert!(shown < most && apart < LEFT_ALONE, "{named:?} on: {shown}, {apart} ns");
        bench.run_for(Span::s(30));
        let all = ["R", "F", "T1", "T2"];
        let (shown, _) = worst(&mut bench, Span::ms(100), &FOLLOWERS);
        let (_, apart) = worst(&mut bench, Span::ms(100), &all);
        assert!(shown < IN_STEP && apart < IN_STEP, "{named:?} after: {shown}, {apart} ns");
        for name in all {
            assert_eq!(bench.state(name), "OP", "{named:?}");
        }
    }
}
