//! Propagation delays after frames have begun to travel otherwise: a group in the midst of the line.

use linesman_config::plan::{
    ClockSettings, HotConnectGroup, IdentificationCheck, Plan, PlanOptions,
};
use linesman_maindevice::Event;
use linesman_proto::address::DeviceId;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;

use crate::bench::Bench;
use crate::clocks::{spread, start};
use crate::hot_connect::{source, story};

/// A tool with two terminals in the midst of a line; couplers with clocks before it and behind it.
fn with_tool() -> String {
    let mut text = "name = \"delays\"\nseed = 9\n".to_owned();
    let coupler = |number: usize, on: &str| {
        let ppm = (number * 37 % 101) as f64 - 50.0;
        format!(
            "[[device]]\nname = \"K{number}\"\ntype = \"EK1100\"\non = \"{on}\"\ncable_m = 20.0\nclock_ppm = {ppm:.1}\n"
        )
    };
    text += &coupler(0, "maindevice");
    text += "[[device]]\nname = \"J\"\ntype = \"EK1122\"\non = \"K0.B\"\n\
             [[device]]\nname = \"X\"\ntype = \"EK1101\"\non = \"J.D\"\nid = 5\ncable_m = 10.0\n";
    for number in 0..2 {
        let on = if number == 0 { "X.B".to_owned() } else { format!("Y{}.B", number - 1) };
        text += &format!("[[device]]\nname = \"Y{number}\"\ntype = \"EL2008\"\non = \"{on}\"\n");
    }
    for number in 1..6 {
        text += &coupler(number, &format!("K{}.C", number - 1));
    }
    text
}

/// The tool may be absent, and couplers have clocks that are used.
fn plan(text: &str) -> Plan {
    let mut bench = Bench::new(text);
    let inventory = bench.scan();
    let mut planned = inventory.planned(AlState::Op);
    let first = bench.id("X");
    let device = &mut planned[first.index()];
    let source = source(&device.profile);
    device.settings.identification =
        Some(IdentificationCheck { source, value: 5, compulsory: true });
    for device in planned.iter_mut().filter(|one| one.profile.type_name == "EK1100") {
        device.settings.clock = Some(ClockSettings::default());
    }
    let group = HotConnectGroup {
        name: "tool".to_owned(),
        members: (first.0..first.0 + 3).map(DeviceId).collect(),
        optional: true,
        places: Vec::new(),
    };
    let options =
        PlanOptions { groups: vec![group], clock_datagrams: true, ..PlanOptions::default() };
    Plan::build(&planned, inventory.tree().clone(), &options).unwrap()
}

/// The greatest deviation of all clocks in a while.
fn worst(bench: &mut Bench, plan: &Plan, span: Span) -> i64 {
    let steps = span.as_nanos() / 1_000_000;
    (0..steps).fold(0, |worst, _| {
        bench.run_for(Span::ms(1));
        worst.max(spread(bench, plan))
    })
}

#[test]
fn clocks_behind_a_group_that_joins_and_leaves_are_told_their_new_delays() {
    let text = with_tool();
    let plan = plan(&text);
    let mut bench = Bench::new(&text);
    bench.segment.unplug(bench.now, "X").unwrap();
    bench.run_for(Span::ms(10));
    start(&mut bench, plan.clone());
    bench.run_for(Span::s(20));
    assert!(worst(&mut bench, &plan, Span::ms(100)) <= 100);
    for _ in 0..2 {
        bench.segment.plug(bench.now, "X", None).unwrap();
        let joined = |event: &Event| matches!(event, Event::GroupJoined { .. });
        let mut with_tool = 0;
        while !bench.run_until(Span::ms(1), joined) {
            with_tool = with_tool.max(spread(&bench, &plan));
        }
        with_tool = with_tool.max(worst(&mut bench, &plan, Span::s(5)));
        let settled = worst(&mut bench, &plan, Span::s(5));
        bench.segment.unplug(bench.now, "X").unwrap();
        let without = worst(&mut bench, &plan, Span::s(5));
        let after = worst(&mut bench, &plan, Span::s(5));
        let told = format!("{with_tool}, {settled}, {without}, {after} ns");
        // One frame is compared with the old delay.
        assert!(with_tool.max(without) <= 200, "{told} {}", story(&bench));
        assert!(settled.max(after) <= 100, "{told} {}", story(&bench));
    }
}
