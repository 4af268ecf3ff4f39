//! A ring in which much happens: groups join and leave while cables break.

use linesman_config::plan::{
    ClockSettings, DevicePlan, HotConnectGroup, IdentificationCheck, Plan, PlanOptions,
};
use linesman_maindevice::{Event, Options};
use linesman_proto::address::DeviceId;
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};
use linesman_sim::seed::Seed;

use crate::bench::Bench;
use crate::hot_connect::source;
use crate::ring_cuts::cut;

/// Couplers in a ring, each with a terminal, and two junctions for two tools behind the last one. All clocks come before the
/// tools: in a ring, who is behind one that joins gets the time later than it was measured.
fn with_tools() -> (String, Vec<String>, [String; 4]) {
    let mut text = "name = \"ring with tools\"\nseed = 3\n".to_owned();
    let mut cables = Vec::new();
    let places = ["J0.D", "J0.B", "J1.D", "J1.B"].map(str::to_owned);
    let mut on = "maindevice".to_owned();
    for number in 0..6 {
        let ppm = (number * 37 % 101) as f64 - 50.0;
        text += &format!(
            "[[device]]\nname = \"K{number}\"\ntype = \"EK1100\"\non = \"{on}\"\ncable_m = 20.0\nclock_ppm = {ppm:.1}\n\
             [[device]]\nname = \"T{number}\"\ntype = \"EL2008\"\non = \"K{number}.B\"\n"
        );
        if number == 5 {
            // In processing order, as the plan counts them: of a junction the contact behind it comes last.
            let tool = |number: u32, on: &str| {
                format!(
                    "[[device]]\nname = \"X{number}\"\ntype = \"EK1101-0080\"\non = \"{on}\"\nid = {}\n\
                     [[device]]\nname = \"Y{number}\"\ntype = \"EL3102\"\non = \"X{number}.B\"\n",
                    5 + number
                )
            };
            let junction = |name: &str, on: &str| {
                format!("[[device]]\nname = \"{name}\"\ntype = \"EK1122-0080\"\non = \"{on}\"\n")
            };
            text += &junction("J0", "T5.B");
            text += &tool(0, "J0.D");
            text += &tool(1, "J0.B");
            text += &junction("J1", "J0.C");
        }
        cables.push(format!("{on}-K{number}.A"));
        on = format!("K{number}.C");
    }
    cables.push(format!("{on}-maindevice.B"));
    (text + &format!("[ring]\ncloses_at = \"{on}\"\n"), cables, places)
}

/// Its plan: the tools may be absent, and the couplers have clocks that are used.
fn plan_with_tools(text: &str) -> Plan {
    let mut bench = Bench::with_options(text, Options { ring: true, ..Options::default() });
    let inventory = bench.scan();
    let mut planned = inventory.planned(AlState::Op);
    let mut groups = Vec::new();
    for (tool, value) in [5, 6].into_iter().enumerate() {
        let first = bench.id(&format!("X{tool}"));
        let device = &mut planned[first.index()];
        let source = source(&device.profile);
        device.settings.identification =
            Some(IdentificationCheck { source, value, compulsory: true });
        groups.push(HotConnectGroup {
            name: format!("tool {tool}"),
            members: vec![first, DeviceId(first.0 + 1)],
            optional: true,
            places: Vec::new(),
        });
    }
    for device in planned
        .iter_mut()
        .filter(|one| ["EK1100", "EL3102"].contains(&one.profile.type_name.as_str()))
    {
        device.settings.clock = Some(ClockSettings::default());
    }
    let options = PlanOptions { groups, clock_datagrams: true, ..PlanOptions::default() };
    Plan::build(&planned, inventory.tree().clone(), &options).unwrap()
}

/// How far the clocks of these are apart, in ns.
fn spread(bench: &Bench, devices: &[DeviceId]) -> i64 {
    let time = |id: &DeviceId| bench.segment.controller(*id).unwrap().system_time(bench.now);
    let times: Vec<u64> = devices.iter().map(time).collect();
    let off = times.iter().map(|time| i64::from(time.wrapping_sub(times[0]) as u32 as i32));
    off.clone().max().unwrap() - off.min().unwrap()
}

/// What is observed while much happens.
#[derive(Default, Debug)]
struct Observed {
    joins: u32,
    leaves: u32,
    cuts: u32,
    mends: u32,
    slowest_join: Span,
    worst_spread_ns: i64,
    /// How far the clock of one that had just joined was off that of the first SubDevice.
    newcomer_ns: i64,
    /// When it was first above 100 ns.
    apart_at: Option<Instant>,
    /// When tools were pulled.
    pulled: Vec<Instant>,
    /// When cables were cut, and when the ring was found open or whole.
    disturbed: Vec<Instant>,
}

impl Observed {
    /// Goes on for a while; the first event of this kind ends it.
    fn watch(
        &mut self,
        bench: &mut Bench,
        clocks: &[DeviceId],
        span: Span,
        until: impl Fn(&Event) -> bool,
    ) -> bool {
        let end = bench.now + span;
        let mut done = false;
        while !done && bench.now < end {
            done = bench.run_until(Span::ms(5), &until);
            self.worst_spread_ns = self.worst_spread_ns.max(spread(bench, clocks));
            if self.worst_spread_ns > 100 {
                self.apart_at.get_or_insert(bench.now);
            }
            let changed =
                bench.events.iter().filter(|(_, event)| matches!(event, Event::Ring { .. }));
            self.disturbed.extend(changed.map(|(at, _)| *at));
            bench.events.clear();
        }
        done
    }
}

/// Tools with fast connecting ports join and leave at random free ports; meanwhile cables of the ring break and are
/// mended, one at a time.
#[test]
fn tools_join_and_leave_a_ring_with_clocks_while_its_cables_break() {
    const STEPS: u32 = 240;
    let (text, cables, places) = with_tools();
    let plan = plan_with_tools(&text);
    let mut bench = Bench::with_options(&text, Options { ring: true, ..Options::default() });
    for tool in ["X0", "X1"] {
        bench.segment.unplug(bench.now, tool).unwrap();
    }
    bench.run_for(Span::ms(10));
    bench.device.start(bench.now, plan.clone());
    let all = bench.run_until(Span::s(20), |event| matches!(event, Event::AllReached));
    assert!(all, "{}", crate::hot_connect::story(&bench));
    bench.run_for(Span::s(10));
    let fixed = plan.devices.iter().filter(|device| plan.group_of(device.id).is_none());
    bench.judged_too = fixed.map(|device| device.id).collect();
    bench.judged = bench.judged_too.first().copied();
    // Of the tools, too, they are used; but only of those that stay they are compared all the time.
    let is_fixed = |device: &&DevicePlan| plan.group_of(device.id).is_none();
    let clocked = plan.devices.iter().filter(|device| device.settings.clock.is_some());
    let clocks: Vec<DeviceId> = clocked.filter(is_fixed).map(|device| device.id).collect();
    let mut stream = Seed(11).stream("ring soak");
    let mut observed = Observed::default();
    // Where the tools are, or were last: J0.D and J0.B at first.
    let (mut is_in, mut last) = ([false; 2], [0, 1]);
    let mut broken = None;
    for step in 0..STEPS {
        let tool = stream.between(0, 1) as usize;
        let name = format!("X{tool}");
        let joins = !is_in[tool];
        is_in[tool] = joins;
        if joins {
            // The segment keeps the port of one that is out for it.
            let free: Vec<usize> = (0..places.len()).filter(|one| last[1 - tool] != *one).collect();
            let place = free[stream.between(0, free.len() as u64 - 1) as usize];
            let on = (place != last[tool]).then(|| places[place].parse().unwrap());
            bench.segment.plug(bench.now, &name, on.as_ref()).unwrap();
            last[tool] = place;
        } else {
            bench.run_for(Span::us(stream.between(0, 1_000)));
            bench.segment.unplug(bench.now, &name).unwrap();
            observed.pulled.push(bench.now);
            observed.leaves += 1;
        }
        if step % 4 == 1 {
            // In the midst of that.
            observed.watch(&mut bench, &clocks, Span::us(stream.between(0, 200_000)), |_| false);
            match broken.take() {
                Some(fault) => {
                    bench.segment.heal(bench.now, fault);
                    observed.mends += 1;
                }
                // A second break would take SubDevices out of reach: the link has to be up again.
                None if bench.device.ring_intact() != Some(true) => {}
                None => {
                    let cable = &cables[stream.between(0, cables.len() as u64 - 1) as usize];
                    observed.disturbed.push(bench.now);
                    broken = Some(cut(&mut bench, cable));
                    observed.cuts += 1;
                }
            }
        }
        if joins {
            let plugged = bench.now;
            let is_here =
                |event: &Event| matches!(event, Event::GroupJoined { group, .. } if *group == tool);
            let has_joined =
                |bench: &Bench| bench.device.network_status().unwrap().groups()[tool].has_joined();
            let done =
                has_joined(&bench) || observed.watch(&mut bench, &clocks, Span::s(8), is_here);
            assert!(done, "{name} does not join, step {step}: {observed:?}");
            let newcomer = bench.id(&format!("Y{tool}"));
            observed.newcomer_ns = observed.newcomer_ns.max(spread(&bench, &[clocks[0], newcomer]));
            observed.joins += 1;
            observed.slowest_join = observed.slowest_join.max(bench.now.since(plugged));
        } else {
            let span = Span::ms(stream.between(150, 400));
            observed.watch(&mut bench, &clocks, span, |_| false);
        }
    }
    let near = |times: &[Instant], bad: &Instant| {
        times.iter().any(|at| bad.as_nanos().abs_diff(at.as_nanos()) < 3_000_000)
    };
    let (by_break, rest): (Vec<Instant>, Vec<Instant>) =
        bench.bad_at.iter().partition(|bad| near(&observed.disturbed, bad));
    // A frame that is in the branch at the moment in which its cable is pulled is lost.
    let (by_pull, rest): (Vec<Instant>, Vec<Instant>) =
        rest.iter().partition(|bad| near(&observed.pulled, bad));
    let Observed {
        joins,
        leaves,
        cuts,
        mends,
        slowest_join,
        worst_spread_ns,
        apart_at,
        newcomer_ns,
        ..
    } = observed;
    println!(
        "{} cycles, {joins} joins, {leaves} leaves, {cuts} cuts, {mends} mended; cycles lost by cuts and mends: {}, by \
         pulling: {}, else: {}; slowest join {slowest_join}, clocks {worst_spread_ns} ns apart at most, {newcomer_ns} ns that of a newcomer",
        bench.cycles,
        by_break.len(),
        by_pull.len(),
        rest.len()
    );
    assert!(rest.is_empty(), "lost without a break: {rest:?}");
    assert!(by_break.len() as u32 <= cuts + mends && by_pull.len() as u32 <= leaves / 10);
    assert!(worst_spread_ns <= 100, "{worst_spread_ns} ns, first at {apart_at:?}");
    // It has just begun to learn its speed.
    assert!(newcomer_ns <= 5_000, "{newcomer_ns} ns");
    assert!(joins + leaves == STEPS && cuts >= 12, "{cuts}");
}
