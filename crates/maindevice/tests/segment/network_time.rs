//! Time of the network: whom the cycle follows, and what programs are told of it.

use linesman_config::plan::{ClockSettings, Plan, TimeSource};
use linesman_config::project::{ClockChoice, Project, SyncLeader, TimeChoice, TimeStampForm};
use linesman_maindevice::{NetworkGroup, Options};
use linesman_proto::address::DeviceId;
use linesman_proto::time::{DcTime, Span};
use linesman_sim::segment::BridgedSides;

use crate::bench::Bench;
use crate::clocks::{plan, start};
use crate::mailbox::upload;

/// A coupler as reference clock, 40 ppm slow, and two terminals.
const PLANT: &str = r#"
name = "network time"
seed = 3
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
clock_ppm = -40.0
clock = { ramp_ppm_per_s = 0.0, jitter_ns = 0 }
[[device]]
name = "O1"
type = "EL4102"
on = "K1.B"
clock_ppm = 25.0
clock = { ramp_ppm_per_s = 0.0, jitter_ns = 0 }
[[device]]
name = "I1"
type = "EL3102"
on = "O1.B"
clock_ppm = 10.0
clock = { ramp_ppm_per_s = 0.0, jitter_ns = 0 }
"#;
const CYCLE: u64 = 1_000_000;
const EPOCH: DcTime = DcTime(850_000_000_123_456_789);
const REFERENCE: DeviceId = DeviceId(0);

/// A line that runs, its terminals with SYNC0.
fn running() -> (Bench, Plan) {
    let options = Options { clock_epoch: EPOCH, ..Options::default() };
    let mut bench = Bench::with_options(PLANT, options);
    let mut plan = plan(&mut bench, |kind| kind.starts_with("EL"));
    plan.devices[0].settings.clock =
        Some(ClockSettings { reference: true, ..ClockSettings::default() });
    plan.base_tick = Span::us(250);
    start(&mut bench, plan.clone());
    bench.run_for(Span::s(3));
    (bench, plan)
}

/// What the reference clock shows now.
fn reference_time(bench: &Bench) -> u64 {
    bench.segment.controller(REFERENCE).unwrap().system_time(bench.now)
}

// proves: DC-04
#[test]
fn unless_set_otherwise_the_cycle_of_the_maindevice_follows_the_reference_clock() {
    let (mut bench, _) = running();
    let began = bench.now;
    let (mut least, mut most) = (i64::MAX, i64::MIN);
    for _ in 0..2_000 {
        let next = bench.device.next_cycle(0).unwrap();
        bench.run_for(next.since(bench.now));
        let phase = reference_time(&bench).rem_euclid(CYCLE) as i64;
        let phase = if phase > CYCLE as i64 / 2 { phase - CYCLE as i64 } else { phase };
        (least, most) = (least.min(phase), most.max(phase));
        bench.run_for(Span::us(10));
    }
    // By its own clock the cycle would have slipped by 40 ns in each of them, 80 µs altogether.
    assert!(bench.now.since(began) >= Span::ms(1_990));
    assert!(most - least < 500, "begins {least} to {most} ns after a multiple of the cycle");
    assert!(least > -2_000 && most < 2_000, "{least} to {most} ns");
}

// proves: DC-08 (S)
#[test]
fn task_start_last_base_tick_and_now_rise_and_are_times_of_the_reference_clock() {
    let (mut bench, _) = running();
    let mut before = bench.device.task_times(0, bench.now).now;
    for step in 0..4_000_u64 {
        bench.run_for(Span::us(17 + step % 90));
        let times = bench.device.task_times(0, bench.now);
        assert!(before < times.now, "{before:?} {times:?}");
        assert!(times.task_start <= times.base_tick && times.base_tick <= times.now, "{times:?}");
        assert!(times.now.0 - times.base_tick.0 < 250_000, "{times:?}");
        // Ticks are of this computer: 40 ppm longer than those of the reference clock.
        let ticks = times.base_tick.0 - times.task_start.0;
        assert!((ticks + 100) % 250_000 < 200, "{times:?}");
        assert!(times.now.0 - times.task_start.0 <= CYCLE + 100, "{times:?}");
        // A frame that leaves now is at the reference clock about 1 µs later.
        let off = reference_time(&bench).wrapping_sub(times.now.0) as i64;
        assert!(off.abs() < 2_000, "{off} ns off");
        let phase = (times.task_start.0 + CYCLE / 2) % CYCLE;
        assert!(phase.abs_diff(CYCLE / 2) < 200, "{times:?}");
        before = times.now;
    }
}

#[test]
fn before_the_clocks_are_set_the_times_are_those_of_the_host() {
    let options = Options { clock_epoch: EPOCH, ..Options::default() };
    let bench = Bench::with_options(PLANT, options);
    let times = bench.device.task_times(0, bench.now);
    assert_eq!([times.task_start, times.base_tick, times.now], [EPOCH; 3]);
}

/// A time outside that runs so many ppm fast and is 0.7 s ahead at the start of the run.
fn outside_time(bench: &Bench, ppm: u64) -> u64 {
    let run = bench.now.as_nanos();
    EPOCH.0 + 700_000_000 + run + run / 1_000 * ppm / 1_000
}

/// What the clock of a SubDevice shows now.
fn shown(bench: &Bench, id: DeviceId) -> u64 {
    bench.segment.controller(id).unwrap().system_time(bench.now)
}

/// Tells a bridge or a clock terminal how far the time outside is ahead.
fn tell_ahead(bench: &mut Bench, id: DeviceId, outside: u64) {
    let ahead = outside.wrapping_sub(shown(bench, id)) as i64;
    let signal = *bench.segment.inputs(id).last().expect("a signal for the time outside");
    bench.segment.signals_mut().set(signal, i32::try_from(ahead).expect("within 2 s"));
}

/// A plan of what is there by a project with these choices; every terminal but those that tell a time has SYNC0.
fn by_project(bench: &mut Bench, choose: impl FnOnce(&mut Project)) -> Plan {
    let inventory = bench.scan();
    let mut project = Project::from_inventory("network", &inventory);
    project.devices[0].clock =
        Some(ClockChoice { assign_activate: Some(0), reference: true, ..ClockChoice::default() });
    for device in &mut project.devices {
        if device.type_name.starts_with("EL3") || device.type_name.starts_with("EL4") {
            device.clock = Some(ClockChoice::default());
        }
    }
    choose(&mut project);
    let project = Project::parse(&project.to_toml()).expect("a project");
    project.plan(&mut |_| Ok(None)).expect("a plan")
}

/// A coupler, 40 ppm slow, an analogue terminal, and a terminal of this type.
fn plant(type_name: &str) -> String {
    PLANT.replace("EL3102", type_name)
}

fn bench_of(plant: &str) -> Bench {
    Bench::with_options(plant, Options { clock_epoch: EPOCH, ..Options::default() })
}

/// By how many ns a time gains on this computer's in 10 s.
fn gained(bench: &mut Bench, mut step: impl FnMut(&mut Bench)) -> i64 {
    let before = reference_time(bench).wrapping_sub(bench.now.as_nanos());
    for _ in 0..10_000 {
        step(bench);
    }
    let after = reference_time(bench).wrapping_sub(bench.now.as_nanos());
    after.wrapping_sub(before) as i64
}

const CLOCK_TERMINAL: DeviceId = DeviceId(2);
const OUTSIDE_PPM: u64 = 15;

fn step_outside(bench: &mut Bench) {
    bench.run_for(Span::ms(1));
    let outside = outside_time(bench, OUTSIDE_PPM);
    tell_ahead(bench, CLOCK_TERMINAL, outside);
}

// proves: DC-10
#[test]
fn network_time_is_left_to_itself_led_by_the_host_or_led_by_a_device() {
    // 40 ppm slow, as the host, 15 ppm fast: in 10 s.
    for (source, expected) in [
        (TimeChoice::ReferenceClock, -400_000),
        (TimeChoice::Host, 0),
        (TimeChoice::Device, 150_000),
    ] {
        let mut bench = bench_of(&plant("EL6688"));
        let plan = by_project(&mut bench, |project| project.network.time_source = Some(source));
        start(&mut bench, plan);
        for _ in 0..50_000 {
            step_outside(&mut bench);
        }
        let gained = gained(&mut bench, step_outside);
        assert!((gained - expected).abs() < 300, "{source:?}: {gained} ns in 10 s");
        let follows = bench.device.outside_time().is_some();
        assert_eq!(follows, source == TimeChoice::Device, "{source:?}");
        // All others follow, and nobody has left OP.
        let off = shown(&bench, DeviceId(1)).abs_diff(reference_time(&bench));
        assert!(off < 100, "{source:?}: {off} ns apart");
        assert_eq!(bench.state("O1"), "OP", "{source:?}");
    }
}

// proves: DC-11, DC-19
#[test]
fn clock_terminal_sets_the_mode_its_speed_is_taken_over_and_its_offset_told_and_left() {
    let mut bench = bench_of(&plant("EL6688"));
    let plan = by_project(&mut bench, |_| {});
    assert_eq!(plan.time_source, Some(TimeSource::Device(CLOCK_TERMINAL)), "nobody chose it");
    start(&mut bench, plan);
    assert_eq!(bench.device.outside_time(), None, "nothing is connected yet");
    (0..50_000).for_each(|_| step_outside(&mut bench));
    let ahead = |bench: &Bench| {
        outside_time(bench, OUTSIDE_PPM).wrapping_sub(shown(bench, CLOCK_TERMINAL)) as i64
    };
    let (mut least, mut most) = (i64::MAX, i64::MIN);
    for _ in 0..10_000 {
        step_outside(&mut bench);
        (least, most) = (least.min(ahead(&bench)), most.max(ahead(&bench)));
        let told = bench.device.outside_time().expect("it is told");
        assert!(told.in_step, "{told:?}");
        assert!((told.ahead_ns - ahead(&bench)).abs() < 200, "{told:?}, {}", ahead(&bench));
    }
    assert!(most - least < 500, "the speeds agree: {least} to {most} ns ahead in 10 s");
    // What it was ahead at the start it still is: 0.7 s and what the reference clock, 40 ppm slow, lost until then.
    assert!((690_000_000..701_000_000).contains(&least), "{least} ns");
    // By hand it is applied.
    let told = bench.device.outside_time().expect("it is told");
    let by_hand = bench.device.network_time(bench.now).0.wrapping_add_signed(told.ahead_ns);
    let off = by_hand.wrapping_sub(outside_time(&bench, OUTSIDE_PPM)) as i64;
    assert!(off.abs() < 2_000, "{off} ns");
}

// proves: DC-12
#[test]
fn of_two_networks_of_a_process_the_first_leads_and_the_other_follows_without_a_setting() {
    let group = NetworkGroup::new();
    let started = |ppm: &str| {
        let options =
            Options { clock_epoch: EPOCH, group: Some(group.clone()), ..Options::default() };
        let mut bench = Bench::with_options(&PLANT.replace("-40.0", ppm), options);
        let plan = by_project(&mut bench, |_| {});
        assert_eq!(plan.time_source, None, "nobody chose anything");
        start(&mut bench, plan);
        bench
    };
    let (mut first, mut second) = (started("-40.0"), started("35.0"));
    assert!(first.device.leads_group() && !second.device.leads_group());
    let from = first.now.max(second.now);
    for bench in [&mut first, &mut second] {
        bench.run_for(from.since(bench.now));
    }
    let mut step = || {
        first.run_for(Span::ms(1));
        second.run_for(Span::ms(1));
        assert_eq!(first.now, second.now);
        reference_time(&second).wrapping_sub(reference_time(&first)) as i64
    };
    for _ in 0..40_000 {
        step();
    }
    let apart: Vec<i64> = (0..10_000).map(|_| step()).collect();
    let (least, most) = (apart.iter().min().unwrap(), apart.iter().max().unwrap());
    assert!(least.abs() < 500 && most.abs() < 500, "{least} to {most} ns apart");
    // The first is untouched.
    let gained = gained(&mut first, |bench| bench.run_for(Span::ms(1)));
    assert!((gained + 400_000).abs() < 300, "{gained} ns in 10 s");
    // Who comes when the first is gone leads.
    drop(first);
    assert!(!group.is_led());
}

/// The two sides of a bridge, in a network each.
struct BridgedNetworks {
    primary: Bench,
    secondary: Bench,
    bridge: BridgedSides,
}

impl BridgedNetworks {
    fn step(&mut self) {
        for side in [&mut self.primary, &mut self.secondary] {
            side.run_for(Span::ms(1));
        }
        self.bridge.exchange(&mut self.primary.segment, &mut self.secondary.segment);
    }

    /// How far the time of the secondary network is ahead of that of the primary one.
    fn apart(&self) -> i64 {
        reference_time(&self.secondary).wrapping_sub(reference_time(&self.primary)) as i64
    }
}

/// Both networks, with a bridge of this type and these choices, in OP at the same time.
fn bridged(type_name: &str, choose: [&dyn Fn(&mut Project); 2]) -> BridgedNetworks {
    let side = |type_name: &str, ppm: &str, epoch: u64, choose: &dyn Fn(&mut Project)| {
        let mut text = plant(type_name).replace("-40.0", ppm);
        if type_name.ends_with("-0002") {
            text = text.replace("on = \"O1.B\"", "on = \"K1.C\"");
        }
        let options = Options { clock_epoch: DcTime(epoch), ..Options::default() };
        let mut bench = Bench::with_options(&text, options);
        let plan = by_project(&mut bench, |project| {
            project.devices[2].clock =
                Some(ClockChoice { assign_activate: Some(0x0320), ..ClockChoice::default() });
            choose(project);
        });
        start(&mut bench, plan);
        bench
    };
    let [first, second] = choose;
    let mut primary = side(type_name, "30.0", EPOCH.0, first);
    let secondary_type = format!("{type_name}-0002");
    let mut secondary = side(&secondary_type, "-20.0", EPOCH.0 + 250_000_000, second);
    let from = primary.now.max(secondary.now);
    for bench in [&mut primary, &mut secondary] {
        bench.run_for(from.since(bench.now));
    }
    let bridge = BridgedSides {
        primary: CLOCK_TERMINAL,
        secondary: CLOCK_TERMINAL,
        fetches_direction: type_name == "EL6692",
    };
    BridgedNetworks { primary, secondary, bridge }
}

fn by_device(project: &mut Project) {
    project.network.time_source = Some(TimeChoice::Device);
}

fn by_itself(project: &mut Project) {
    project.network.time_source = Some(TimeChoice::ReferenceClock);
    project.devices[2].time_stamps = Some(TimeStampForm::Bits64);
}

// The bridge takes both times itself; of its sides one sits on the E-bus, the other on a cable.
// proves: DC-15
// proves: DC-17
#[test]
fn bridge_keeps_two_networks_in_step_in_the_direction_that_both_maindevices_set() {
    type Choice = fn(&mut Project);
    // In 10 s: the primary network is 30 ppm fast, the secondary 20 ppm slow.
    for (choose, expected) in
        [([by_itself as Choice, by_device], 300_000), ([by_device, by_itself], -200_000)]
    {
        let [first, second] = &choose;
        let mut networks = bridged("EL6695", [first, second]);
        (0..50_000).for_each(|_| networks.step());
        let began = networks.apart();
        let (mut least, mut most) = (began, began);
        for _ in 0..10_000 {
            networks.step();
            let apart = networks.apart();
            (least, most) = (least.min(apart), most.max(apart));
        }
        assert!(most - least < 500, "{least} to {most} ns apart within 10 s");
        assert!((200_000_000..300_000_000).contains(&least), "the distance is left: {least} ns");
        let sides = [&networks.primary, &networks.secondary];
        let follows = sides.map(|side| side.device.outside_time().is_some_and(|one| one.in_step));
        assert_eq!(follows, [expected < 0, expected > 0]);
        for side in sides {
            assert_eq!(side.state("I1"), "OP");
        }
        let gained = gained(&mut networks.primary, |bench| bench.run_for(Span::ms(1)));
        if expected > 0 {
            assert!((gained - expected).abs() < 300, "untouched: {gained} ns in 10 s");
        }
    }
}

// proves: DC-16
#[test]
fn side_of_a_bridge_that_leads_is_set_in_it_and_the_form_of_time_stamps_selects_its_process_data() {
    for (leader, follows) in
        [(SyncLeader::Primary, [false, true]), (SyncLeader::Secondary, [true, false])]
    {
        // Both would follow: the bridge says who does. It is told on its primary side only.
        let choose = |project: &mut Project| {
            by_device(project);
            project.devices[2].sync_leader = Some(leader);
        };
        let mut networks = bridged("EL6692", [&choose, &by_device]);
        (0..3_000).for_each(|_| networks.step());
        let sides = [&networks.primary, &networks.secondary];
        assert_eq!(sides.map(|side| side.device.outside_time().is_some()), follows, "{leader:?}");
    }
    for (form, pdo, len) in [
        (TimeStampForm::None, 0x1A01_u16, 2),
        (TimeStampForm::Bits64, 0x1A02, 22),
        (TimeStampForm::Bits32, 0x1A03, 14),
    ] {
        let mut bench = bench_of(&plant("EL6692"));
        let plan = by_project(&mut bench, |project| project.devices[2].time_stamps = Some(form));
        assert_eq!(plan.devices[2].inputs.len(), len, "{form:?}");
        start(&mut bench, plan);
        let assigned = upload(&mut bench, "I1", 0x1C13, 1).expect("its assignment");
        assert_eq!(assigned, pdo.to_le_bytes(), "{form:?}");
        assert_eq!(bench.state("I1"), "OP");
    }
}

/// An upper network, 20 ppm fast and at another time than this computer, whose interface in this computer is its SubDevice
/// 2, and a local one that follows the time that a program tells. The program reads the interface `told_before` the start, or
/// only in the cycles. How far the local network is ahead of the upper one in ten seconds after a minute, in ns and rising
/// order, and its bench.
fn below_an_upper_network(told_before: bool) -> (Vec<i64>, Bench, Plan) {
    let clock_epoch = DcTime(EPOCH.0 + 250_000_000);
    let options = Options { clock_epoch, ..Options::default() };
    let mut upper = Bench::with_options(&PLANT.replace("-40.0", "20.0"), options);
    let plan = by_project(&mut upper, |_| {});
    start(&mut upper, plan);
    upper.run_for(Span::s(5));
    let mut local = bench_of(PLANT);
    let plan = by_project(&mut local, |project| {
        project.network.time_source = Some(TimeChoice::Program);
    });
    if told_before {
        // The two benches have times of their own, as two computers have.
        local.run_for(upper.now.since(local.now));
        local.device.tell_outside_time(local.now, DcTime(shown(&upper, DeviceId(1))));
    }
    start(&mut local, plan.clone());
    let from = upper.now.max(local.now);
    for bench in [&mut upper, &mut local] {
        bench.run_for(from.since(bench.now));
    }
    let mut step = || {
        upper.run_for(Span::ms(1));
        local.run_for(Span::ms(1));
        let time = DcTime(shown(&upper, DeviceId(1)));
        local.device.tell_outside_time(local.now, time);
        reference_time(&local).wrapping_sub(time.0) as i64
    };
    for _ in 0..60_000 {
        step();
    }
    let mut apart: Vec<i64> = (0..10_000).map(|_| step()).collect();
    apart.sort_unstable();
    assert!(local.device.outside_time().is_some_and(|one| one.in_step));
    (apart, local, plan)
}

#[test]
fn local_network_takes_the_speed_of_an_upper_one_that_a_program_tells() {
    let (apart, ..) = below_an_upper_network(false);
    let (least, most) = (apart[0], apart[apart.len() - 1]);
    assert!(most - least < 500, "{least} to {most} ns apart within 10 s");
    assert!(most < -1_000_000, "its time is another one: {least} to {most} ns");
}

// S0 L909-943: the local network is in the time of the upper one, and its cycle in its phase.
// proves: DC-18
#[test]
fn local_network_takes_the_time_and_the_phase_of_an_upper_one_that_is_told_before_its_start() {
    let (apart, mut local, _) = below_an_upper_network(true);
    let (least, most) = (apart[0], apart[apart.len() - 1]);
    // A cyclic frame that waits behind another one brings its time later: that leads the clock a little astray.
    assert!(least > -1_000 && most < 1_000, "{least} to {most} ns ahead of the upper network");
    let near = apart.iter().filter(|ahead| ahead.abs() < 500).count();
    assert!(near * 100 >= apart.len() * 99, "{near} of {} within 500 ns", apart.len());
    // Its frames are there at multiples of the cycle, by the time that is that of the upper one.
    for _ in 0..1_000 {
        let next = local.device.next_cycle(0).unwrap();
        local.run_for(next.since(local.now));
        let phase = reference_time(&local).rem_euclid(CYCLE) as i64;
        let phase = if phase > CYCLE as i64 / 2 { phase - CYCLE as i64 } else { phase };
        assert!(phase.abs() < 5_000, "{phase} ns after a multiple of the cycle");
        local.run_for(Span::us(10));
    }
    assert_eq!(local.state("O1"), "OP");
}

/// A network behind a port multiplier, whose clock is 23 ppm fast in all of them.
fn behind_multiplier(own_ppm: f64) -> String {
    behind("M1", 23.0, own_ppm)
}

/// A network behind a port multiplier that is so many ppm fast.
fn behind(multiplier: &str, ppm: f64, own_ppm: f64) -> String {
    let device = |name: &str, kind: &str, on: &str, ppm: f64| {
        format!(
            "[[device]]\nname = \"{name}\"\ntype = \"{kind}\"\non = \"{on}\"\nclock_ppm = {ppm:.1}\n\
             clock = {{ ramp_ppm_per_s = 0.0, jitter_ns = 0 }}\n"
        )
    };
    [
        "name = \"behind a port multiplier\"\nseed = 3\n".to_owned(),
        device(multiplier, "CU2508", "maindevice", ppm),
        device("K1", "EK1100", &format!("{multiplier}.B"), own_ppm),
        device("O1", "EL4102", "K1.B", -own_ppm),
    ]
    .concat()
}

// A device has the quartz of its seed and name wherever it sits: that of the port multiplier is one in all its networks.
// proves: DC-13
#[test]
fn port_multiplier_is_the_reference_clock_of_each_network_behind_it() {
    let mut networks = [-30.0, 45.0].map(|ppm| {
        let mut bench = bench_of(&behind_multiplier(ppm));
        let plan = by_project(&mut bench, |_| {});
        assert_eq!(plan.reference_clock(), Some(REFERENCE));
        assert_eq!(plan.devices[0].type_name, "CU2508");
        start(&mut bench, plan);
        bench
    });
    let from = networks[0].now.max(networks[1].now);
    for bench in &mut networks {
        bench.run_for(from.since(bench.now) + Span::s(10));
    }
    let mut step = || {
        networks.iter_mut().for_each(|bench| bench.run_for(Span::ms(1)));
        // What follows it in one network against what follows it in the other.
        let [one, other] = &networks;
        let quartz =
            |bench: &Bench| bench.segment.controller(REFERENCE).unwrap().local_time(bench.now);
        assert_eq!(quartz(one), quartz(other), "it has one clock");
        shown(one, DeviceId(2)).wrapping_sub(shown(other, DeviceId(2))) as i64
    };
    let apart: Vec<i64> = (0..10_000).map(|_| step()).collect();
    let (least, most) = (apart.iter().min().unwrap(), apart.iter().max().unwrap());
    assert!(most - least < 100, "{least} to {most} ns apart within 10 s");
    for bench in &mut networks {
        let gained = gained(bench, |bench| bench.run_for(Span::ms(1)));
        assert!((gained - 230_000).abs() < 300, "as the port multiplier: {gained} ns in 10 s");
    }
}

// S0 L826-838. On one computer the network of the first leads the other, without a setting. On two both are led by the
// clocks of their computers, which PTP keeps within 100 ns here.
// proves: DC-14
#[test]
fn two_port_multipliers_keep_one_time_on_one_host_and_on_two() {
    for hosts in [1, 2] {
        let group = NetworkGroup::new();
        let mut networks = [("M1", 23.0, 0), ("M2", -31.0, 100)].map(|(name, ppm, off)| {
            let (epoch, group) = match hosts {
                1 => (EPOCH, Some(group.clone())),
                _ => (DcTime(EPOCH.0 + off), None),
            };
            let options = Options { clock_epoch: epoch, group, ..Options::default() };
            let mut bench = Bench::with_options(&behind(name, ppm, -30.0), options);
            let plan = by_project(&mut bench, |project| {
                project.network.time_source = (hosts == 2).then_some(TimeChoice::Host);
            });
            assert_eq!(plan.reference_clock(), Some(REFERENCE));
            start(&mut bench, plan);
            bench
        });
        let from = networks[0].now.max(networks[1].now);
        for bench in &mut networks {
            bench.run_for(from.since(bench.now) + Span::s(60));
        }
        let mut step = || {
            networks.iter_mut().for_each(|bench| bench.run_for(Span::ms(1)));
            let [one, other] = &networks;
            // The multipliers themselves, and what is behind them.
            let apart = |id| shown(one, id).wrapping_sub(shown(other, id)) as i64;
            apart(REFERENCE).abs().max(apart(DeviceId(2)).abs())
        };
        let most = (0..10_000).map(|_| step()).max().unwrap();
        assert!(most < 500, "{hosts} hosts: {most} ns apart");
    }
}
