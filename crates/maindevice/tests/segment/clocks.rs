//! Distributed clocks as our MainDevice sets them up.

use std::collections::BTreeSet;

use crate::bench::Bench;
use linesman_config::fault::FaultName;
use linesman_config::plan::{ClockSettings, DatagramPlan, FramePlan, Plan, PlanOptions, Role};
use linesman_maindevice::{Event, Options};
use linesman_proto::address::{DeviceId, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::register;
use linesman_proto::state::AlState;
use linesman_proto::time::{DcTime, Span};
use linesman_sim::segment_file::FaultEntry;

const CYCLE: Span = Span::ms(1);
const SHIFT_NS: i64 = 300_000;

/// Couplers and terminals with quartzes as bad as they come, 20 m of cable in between.
fn plant() -> String {
    let mut text = "name = \"clocks\"\nseed = 5\n".to_owned();
    let mut on = "maindevice".to_owned();
    for number in 0..12 {
        let (kind, cable) = match number {
            0 | 6 => ("EK1100", "cable_m = 20.0\n"),
            _ if number % 2 == 0 => ("EL4102", ""),
            _ => ("EL3102", ""),
        };
        if number == 6 {
            on = "D0.C".to_owned();
        }
        let ppm = (number * 37 % 101) as f64 - 50.0;
        text += &format!(
            "[[device]]\nname = \"D{number}\"\ntype = \"{kind}\"\non = \"{on}\"\n{cable}\
             clock_ppm = {ppm:.1}\nclock = {{ ramp_ppm_per_s = 0.02, ramp_s = 600.0, jitter_ns = 5 }}\n"
        );
        on = format!("D{number}.B");
    }
    text
}

/// A plan in which every second terminal beats with SYNC0, and the first clock is spread.
pub(crate) fn plan(bench: &mut Bench, clocked: impl Fn(&str) -> bool) -> Plan {
    let inventory = bench.scan();
    let tree = inventory.tree().clone();
    let mut planned = inventory.planned(AlState::Op);
    for device in planned.iter_mut().filter(|device| clocked(&device.profile.type_name)) {
        device.settings.clock = Some(ClockSettings {
            assign_activate: 0x0300,
            sync0_cycle: CYCLE,
            sync0_shift_ns: SHIFT_NS,
            ..ClockSettings::default()
        });
    }
    let mut plan = Plan::build(&planned, tree, &PlanOptions::default()).expect("a plan");
    if plan.datagrams().all(|(.., one)| one.role != Role::ReferenceClock) {
        let reference = plan.devices[0].station;
        let time = DatagramPlan {
            command: Command::Frmw,
            address: DatagramAddress::Physical(reference.0, RegisterAddress(0x0910)),
            len: 4,
            role: Role::ReferenceClock,
            sync_unit: None,
            ownership: Vec::new(),
        };
        let frames: &mut Vec<FramePlan> = &mut plan.tasks[0].frames;
        frames[0].datagrams.insert(0, time);
    }
    plan
}

pub(crate) fn start(bench: &mut Bench, plan: Plan) {
    bench.device.start(bench.now, plan);
    let all = bench.run_until(Span::s(20), |event| matches!(event, Event::AllReached));
    let name = |id: DeviceId| format!("SubDevice {}", id.no());
    let lines: Vec<_> =
        bench.events.iter().flat_map(|(_, event)| event.state_lines(name)).collect();
    assert!(all, "{lines:#?}");
}

/// How far the system times are apart at this moment, seen from outside.
pub(crate) fn spread(bench: &Bench, plan: &Plan) -> i64 {
    let times: Vec<u64> = (plan.devices.iter())
        .filter(|device| device.settings.clock.is_some() || device.id == DeviceId(0))
        .map(|device| bench.segment.controller(device.id).unwrap().system_time(bench.now))
        .collect();
    let off = times.iter().map(|time| i64::from(time.wrapping_sub(times[0]) as u32 as i32));
    off.clone().max().unwrap() - off.min().unwrap()
}

fn is_terminal(kind: &str) -> bool {
    kind.starts_with("EL")
}

/// Devices of two makers with three types of controllers, with quartzes as bad as they come.
fn several_makes() -> String {
    let devices = [
        ("EK1100", "maindevice"),
        ("EL3102", "D0.B"),
        ("CiA402-Drive", "D0.C"),
        ("EP4174-0002", "D2.B"),
        ("AX5103-0012", "D3.B"),
    ];
    let device = |(number, (kind, on)): (usize, (&str, &str))| {
        let ppm = if number.is_multiple_of(2) { 48.0 } else { -47.0 };
        format!(
            "[[device]]\nname = \"D{number}\"\ntype = \"{kind}\"\non = \"{on}\"\nclock_ppm = {ppm:.1}\n"
        )
    };
    devices.into_iter().enumerate().map(device).collect()
}

// The MainDevice has set offsets and delays once, and passes round the time of the first; how each clock follows it is what its
// controller does. That delays measured on real lines come out the same is in the tests of the segment.
// proves: ESC-12
#[test]
fn devices_of_several_makes_share_one_system_time() {
    let mut bench = Bench::new(&several_makes());
    let mut plan = plan(&mut bench, |kind| kind == "EL3102");
    for device in &mut plan.devices {
        device.settings.clock.get_or_insert_default();
    }
    let makers: BTreeSet<u32> = plan.devices.iter().map(|one| one.identity.vendor_id).collect();
    assert!(makers.len() > 1, "{makers:?}");
    let controller = |id: DeviceId| bench.segment.controller(id).expect("it is there");
    let types: BTreeSet<u8> = plan
        .devices
        .iter()
        .map(|one| controller(one.id).register(register::ESC_TYPE.address))
        .collect();
    assert!(types.len() > 1, "{types:?}");
    start(&mut bench, plan.clone());
    bench.run_for(Span::s(8));
    let mut worst = 0;
    for _ in 0..1_000 {
        bench.run_for(Span::us(1_007));
        let time = |id| bench.segment.controller(id).unwrap().system_time(bench.now) as u32;
        let first = time(DeviceId(0));
        for device in &plan.devices {
            let off = time(device.id).wrapping_sub(first) as i32;
            worst = worst.max(off.abs());
        }
    }
    assert!(worst <= 100, "{worst} ns apart");
}

// proves: DC-01, DC-03 partial, DC-04 partial, DC-07
#[test]
fn clocks_are_aligned_to_100_ns_and_stay_so() {
    let epoch = DcTime(850_000_000_123_456_789);
    let mut bench =
        Bench::with_options(&plant(), Options { clock_epoch: epoch, ..Options::default() });
    let plan = plan(&mut bench, is_terminal);
    start(&mut bench, plan.clone());
    let time = bench.segment.controller(DeviceId(0)).unwrap().system_time(bench.now);
    let off = time.abs_diff(epoch.0 + bench.now.as_nanos());
    assert!(off < 200_000, "the reference shows the MainDevice's time: {off} ns off");
    let times = bench.device.bring_up_times().unwrap();
    assert!(times.took().unwrap() < Span::s(2), "{}", times.took().unwrap());
    // How far they are apart at first is chance: 30 to 160 ns after two seconds, by when the latch came. The
    // loops of the controllers take the rest away.
    bench.run_for(Span::s(6));
    let mut worst = 0;
    for _ in 0..100 {
        bench.run_for(Span::us(10_007));
        worst = worst.max(spread(&bench, &plan));
    }
    assert!(worst <= 100, "{worst} ns apart");
    // The MainDevice follows, too: frames are at the reference when its cycle begins.
    let before = bench.device.statistics();
    bench.events.clear();
    bench.run_for(Span::s(10));
    let after = bench.device.statistics();
    assert_eq!(after.working_counter_errors, before.working_counter_errors);
    assert_eq!(after.cyclic_lost, before.cyclic_lost);
    let fell =
        bench.events.iter().filter(|(_, event)| matches!(event, Event::AbnormalState { .. }));
    assert_eq!(fell.count(), 0);
    for device in plan.devices.iter().filter(|device| device.settings.clock.is_some()) {
        assert_eq!(bench.state(&format!("D{}", device.id.index())), "OP");
    }
}

/// Terminals whose controllers take the next frame at a port for the one that latches receive times (ET1200), with up to a
/// hundred SubDevices behind, so that frames ahead of that one are still under way there.
fn behind_an_et1200() -> String {
    let device = |number: usize| {
        let (kind, on) = match number {
            0 => ("EK1100", "maindevice".to_owned()),
            1 => ("EL2008", "D0.B".to_owned()),
            2 => ("EK1110", "D1.B".to_owned()),
            3 => ("EK1100", "D2.B".to_owned()),
            _ if number % 20 == 3 => ("EL4102", format!("D{}.B", number - 1)),
            _ => ("EL2008", format!("D{}.B", number - 1)),
        };
        format!("[[device]]\nname = \"D{number}\"\ntype = \"{kind}\"\non = \"{on}\"\n")
    };
    (0..104).map(device).collect()
}

// proves: DC-01 partial: behind ports that take the next frame
#[test]
fn frames_ahead_of_the_one_that_latches_spoil_no_delay() {
    let mut bench = Bench::new(&behind_an_et1200());
    let plan = plan(&mut bench, |kind| kind == "EL4102");
    start(&mut bench, plan.clone());
    bench.run_for(Span::s(6));
    assert!(spread(&bench, &plan) <= 100, "{} ns apart", spread(&bench, &plan));
    // A terminal at the end goes and comes again: the delays are measured beside all that brings it up.
    let last = plan.devices.last().unwrap();
    let entry = FaultEntry::new(FaultName::DeviceOff).device(format!("D{}", last.id.index()));
    let fault = bench.segment.inject(bench.now, &entry).unwrap();
    bench.run_for(Span::s(1));
    bench.segment.heal(bench.now, fault);
    let others: Vec<_> = plan.devices.iter().filter(|one| one.id != last.id).cloned().collect();
    for _ in 0..100 {
        bench.run_for(Span::ms(20));
        let others = Plan { devices: others.clone(), ..plan.clone() };
        assert!(spread(&bench, &others) <= 100, "{} ns apart", spread(&bench, &others));
    }
}

#[test]
fn a_subdevice_that_comes_back_gets_its_clock_anew() {
    let mut bench = Bench::new(&plant());
    let plan = plan(&mut bench, is_terminal);
    start(&mut bench, plan.clone());
    let entry = FaultEntry::new(FaultName::DeviceOff).device("D8");
    let fault = bench.segment.inject(bench.now, &entry).unwrap();
    bench.run_for(Span::s(1));
    bench.segment.heal(bench.now, fault);
    // Its quartz has to be learnt anew by the cyclic frames alone: four times 4,096 of them.
    bench.run_for(Span::s(40));
    assert_eq!(bench.state("D8"), "OP");
    assert!(spread(&bench, &plan) <= 150, "{} ns apart", spread(&bench, &plan));
}

#[test]
fn without_a_clock_there_is_no_reference() {
    let text = "name = \"plain\"\n[[device]]\nname = \"K\"\ntype = \"EP2308-0001\"\n\
                on = \"maindevice\"\n";
    let mut bench = Bench::new(text);
    let plan = plan(&mut bench, is_terminal);
    bench.device.start(bench.now, plan);
    bench.run_for(Span::s(2));
    let told = bench
        .events
        .iter()
        .any(|(_, event)| matches!(event, Event::ClocksNotSet { .. } | Event::ClocksSet { .. }));
    assert!(told, "{:#?}", bench.events);
}

const RING: &str = r#"
name = "ring"
[[device]]
name = "B1"
type = "EK1100"
on = "maindevice"
clock_ppm = 12.0
[[device]]
name = "B2"
type = "EK1100"
on = "B1.C"
cable_m = 50.0
clock_ppm = -30.0
[[device]]
name = "B3"
type = "EK1100"
on = "B2.C"
cable_m = 10.0
clock_ppm = 40.0
[ring]
closes_at = "B3.C"
"#;

// proves: DC-01 partial: in a closed ring
#[test]
fn clocks_of_a_whole_ring_are_in_step_and_it_is_not_opened_for_them() {
    let mut bench = Bench::with_options(RING, Options { ring: true, ..Options::default() });
    let mut plan = plan(&mut bench, |_| false);
    for device in &mut plan.devices {
        // Followers without SyncSignals.
        device.settings.clock = Some(ClockSettings::default());
    }
    start(&mut bench, plan.clone());
    let set = bench.events.iter().any(|(_, event)| matches!(event, Event::ClocksSet { .. }));
    assert!(set, "{:#?}", bench.events);
    bench.run_for(Span::s(10));
    assert!(spread(&bench, &plan) <= 100, "{} ns apart", spread(&bench, &plan));
    let ring: Vec<bool> = (bench.events.iter())
        .filter_map(
            |(_, event)| if let Event::Ring { intact } = event { Some(*intact) } else { None },
        )
        .collect();
    assert_eq!(ring, [true], "it stays whole");
}

/// A ring through terminals whose controllers take the next frame at a port for the one that latches (ET1200).
fn ring_through_terminals() -> String {
    let device = |number: usize| {
        let (kind, on) = match number {
            0 => ("EK1100", "maindevice".to_owned()),
            5 => ("EK1110", "D4.B".to_owned()),
            6 => ("EK1100", "D5.B".to_owned()),
            _ => ("EL4102", format!("D{}.B", number - 1)),
        };
        format!("[[device]]\nname = \"D{number}\"\ntype = \"{kind}\"\non = \"{on}\"\n")
    };
    (0..9).map(device).collect::<String>() + "[ring]\ncloses_at = \"D6.C\"\n"
}

// proves: DC-01 partial: in a closed ring
#[test]
fn ring_whose_ports_keep_the_next_frame_is_opened_to_be_measured() {
    let options = Options { ring: true, ..Options::default() };
    let mut bench = Bench::with_options(&ring_through_terminals(), options);
    let plan = plan(&mut bench, is_terminal);
    start(&mut bench, plan.clone());
    bench.run_for(Span::s(6));
    assert!(spread(&bench, &plan) <= 100, "{} ns apart", spread(&bench, &plan));
    assert_eq!(bench.device.ring_intact(), Some(true), "it is whole again");
}

/// Couplers in a ring, 40 m of cable between any two.
fn long_ring(couplers: usize) -> String {
    let mut text = "name = \"ring\"\nseed = 7\n".to_owned();
    let mut on = "maindevice".to_owned();
    for number in 0..couplers {
        let ppm = (number * 37 % 101) as f64 - 50.0;
        text += &format!(
            "[[device]]\nname = \"B{number}\"\ntype = \"EK1100\"\non = \"{on}\"\n\
             cable_m = 40.0\nclock_ppm = {ppm:.1}\n"
        );
        on = format!("B{number}.C");
    }
    text + &format!("[ring]\ncloses_at = \"{on}\"\n")
}

/// The time comes the other way round behind the break: without knowing that, clocks there would be pulled tens of µs
/// away, and back when the ring is mended.
// proves: DC-01 partial: in an open ring
#[test]
fn clocks_of_both_halves_of_an_open_ring_stay_in_step() {
    const COUPLERS: usize = 24;
    let mut bench =
        Bench::with_options(&long_ring(COUPLERS), Options { ring: true, ..Options::default() });
    let mut plan = plan(&mut bench, |_| false);
    for device in &mut plan.devices {
        device.settings.clock = Some(ClockSettings::default());
    }
    start(&mut bench, plan.clone());
    bench.run_for(Span::s(20));
    let worst = |bench: &mut Bench, span: Span| {
        let steps = span.as_nanos() / 500_000;
        (0..steps).fold(0, |worst, _| {
            bench.run_for(Span::us(500));
            worst.max(spread(bench, &plan))
        })
    };
    assert!(worst(&mut bench, Span::ms(100)) <= 100);
    for link in ["maindevice-B0.A", "B0.C-B1.A", "B5.C-B6.A", "B17.C-B18.A", "B22.C-B23.A"] {
        let entry = FaultEntry::new("link-open".parse().unwrap()).at(link);
        let cut = bench.segment.inject(bench.now, &entry).unwrap();
        let at_once = worst(&mut bench, Span::s(1));
        let open = worst(&mut bench, Span::s(10));
        bench.segment.heal(bench.now, cut);
        let mended = worst(&mut bench, Span::s(10));
        assert!(
            at_once <= 100 && open <= 100 && mended <= 100,
            "{link}: {at_once}, {open}, {mended} ns"
        );
    }
}

// The segment's terminals measure their times: before they ran 0x1C32:05 is 0 (S0 L554-589).
#[test]
fn a_subdevice_that_does_not_know_its_times_yet_refuses_a_short_cycle_itself() {
    let mut bench = Bench::new(&plant());
    let mut plan = plan(&mut bench, is_terminal);
    let short = DeviceId(2);
    plan.devices[short.index()].settings.clock.as_mut().unwrap().sync0_cycle = Span::us(50);
    bench.device.start(bench.now, plan);
    let refused = bench.run_until(
        Span::s(4),
        |event| matches!(event, Event::Refused { id, code, .. } if *id == short && code.0 == 0x0036),
    );
    assert!(refused, "{:?}", bench.events.last());
    let guarded = |(_, event): &(_, Event)| matches!(event, Event::CycleTooShort { .. });
    assert!(!bench.events.iter().any(guarded));
}
