//! Propagation delays after frames have begun to travel otherwise: a group in the midst of the line.

use linesman_config::plan::{
    ClockSettings, HotConnectGroup, IdentificationCheck, Plan, PlanOptions,
};
use linesman_maindevice::Event;
use linesman_proto::address::{DeviceId, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::frame::FrameView;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;

use crate::bench::Bench;
use crate::clocks::{spread, start};
use crate::hot_connect::{options, source, story};
use crate::ring_cuts::cut;

/// The source address of frames of the second card.
const SECOND_CARD: [u8; 6] = [0x00, 0x00, 0x5E, 0x00, 0x53, 0x0B];

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

/// The same as a ring.
fn with_tool_in_a_ring() -> String {
    with_tool() + "[ring]\ncloses_at = \"K5.C\"\n"
}

/// The tool may be absent, and couplers have clocks that are used.
fn plan(text: &str) -> Plan {
    let mut bench = Bench::with_options(text, options(text));
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

/// Delay that each coupler was told (0x0928), in ns.
fn told(bench: &Bench) -> Vec<u32> {
    let delay = |number: usize| {
        let controller = bench.segment.controller(bench.id(&format!("K{number}"))).unwrap();
        let byte = |at: u16| controller.register(RegisterAddress(0x0928 + at));
        u32::from_le_bytes([byte(0), byte(1), byte(2), byte(3)])
    };
    (0..6).map(delay).collect()
}

/// True if delays are the right ones, but for the steps of 10 ns in which clocks are read: each hop is off by a few of them.
fn is_near(told: &[u32], right: &[u32]) -> bool {
    told.iter().zip(right).all(|(told, right)| told.abs_diff(*right) <= 60)
}

/// A bench of the ring in OP, with clocks in step; the tool is plugged in or not.
fn ring_in_step(text: &str, plan: &Plan, is_in: bool) -> Bench {
    let mut bench = Bench::with_options(text, options(text));
    if !is_in {
        bench.segment.unplug(bench.now, "X").unwrap();
    }
    bench.run_for(Span::ms(10));
    start(&mut bench, plan.clone());
    bench.run_for(Span::s(20));
    assert!(worst(&mut bench, plan, Span::ms(100)) <= 100);
    bench
}

#[test]
fn delays_of_a_whole_ring_are_those_of_the_line_and_it_is_not_opened_for_them() {
    let (line, ring) = (with_tool(), with_tool_in_a_ring());
    let mut bench = Bench::new(&line);
    start(&mut bench, plan(&line));
    let of_line = told(&bench);
    let mut bench = Bench::with_options(&ring, options(&ring));
    start(&mut bench, plan(&ring));
    let of_ring = told(&bench);
    assert!(is_near(&of_line, &of_ring), "{of_line:?} {of_ring:?}");
    let is_open = |event: &Event| matches!(event, Event::Ring { intact: false });
    assert!(!bench.events.iter().any(|(_, event)| is_open(event)), "{}", story(&bench));
}

/// A bench on which what card B sends of broadcast writes to 0x0900 never leaves it in time.
fn without_times_of_card_b(text: &str) -> Bench {
    let mut bench = Bench::with_options(text, options(text));
    bench.leaves_after = Some(Box::new(|frame| {
        let is_latch = FrameView::parse(frame).is_ok_and(|view| {
            let mut datagrams = view.datagrams().map_while(Result::ok);
            let second = view.source().0 == SECOND_CARD;
            second && datagrams.any(|it| it.command() == Some(Command::Bwr) && it.ado().0 == 0x0900)
        });
        if is_latch { Span::s(3600) } else { Span::ZERO }
    }));
    bench
}

#[test]
fn a_ring_is_opened_to_measure_delays_when_frames_of_the_second_card_leave_no_times() {
    let ring = with_tool_in_a_ring();
    let plan = plan(&ring);
    let mut bench = without_times_of_card_b(&ring);
    start(&mut bench, plan.clone());
    let is_open = |event: &Event| matches!(event, Event::Ring { intact: false });
    assert!(bench.events.iter().any(|(_, event)| is_open(event)), "{}", story(&bench));
    bench.run_for(Span::s(20));
    assert_eq!(bench.device.ring_intact(), Some(true));
    assert!(worst(&mut bench, &plan, Span::ms(100)) <= 100);
}

#[test]
fn clocks_behind_a_group_in_a_ring_are_told_their_delays_after_joins_breaks_and_mendings() {
    let ring = with_tool_in_a_ring();
    let plan = plan(&ring);
    let without = told(&ring_in_step(&ring, &plan, false));
    let with = told(&ring_in_step(&ring, &plan, true));
    // Behind the tool the frame comes later by all of its way.
    assert!((1..6).all(|at| with[at] > without[at] + 300), "{with:?} {without:?}");
    // It joins and leaves while the ring is whole, while it is open behind the tool, and while it is open in front of it.
    for cable in [None, Some("K2.C-K3.A"), Some("maindevice-K0.A")] {
        let mut bench = ring_in_step(&ring, &plan, false);
        let fault = cable.map(|cable| cut(&mut bench, cable));
        let mut at_once = worst(&mut bench, &plan, Span::s(2));
        bench.segment.plug(bench.now, "X", None).unwrap();
        let joined = |event: &Event| matches!(event, Event::GroupJoined { .. });
        while !bench.run_until(Span::ms(1), joined) {
            at_once = at_once.max(spread(&bench, &plan));
        }
        at_once = at_once.max(worst(&mut bench, &plan, Span::s(5)));
        let mut settled = worst(&mut bench, &plan, Span::s(2));
        if let Some(fault) = fault {
            bench.segment.heal(bench.now, fault);
            let whole = |event: &Event| matches!(event, Event::Ring { intact: true });
            assert!(bench.run_until(Span::s(10), whole), "{cable:?}");
            at_once = at_once.max(worst(&mut bench, &plan, Span::s(5)));
            settled = settled.max(worst(&mut bench, &plan, Span::s(2)));
        }
        assert!(is_near(&told(&bench), &with), "{cable:?}: {:?} {with:?}", told(&bench));
        bench.segment.unplug(bench.now, "X").unwrap();
        at_once = at_once.max(worst(&mut bench, &plan, Span::s(5)));
        settled = settled.max(worst(&mut bench, &plan, Span::s(2)));
        assert!(is_near(&told(&bench), &without), "{cable:?}: {:?} {without:?}", told(&bench));
        assert!(settled <= 100 && at_once <= 300, "{cable:?}: {at_once}, {settled} ns");
    }
}

#[test]
fn a_ring_is_opened_again_to_measure_delays_after_a_group_has_joined_and_a_cable_was_mended() {
    let ring = with_tool_in_a_ring();
    let plan = plan(&ring);
    let without = told(&ring_in_step(&ring, &plan, false));
    let with = told(&ring_in_step(&ring, &plan, true));
    let mut bench = without_times_of_card_b(&ring);
    bench.segment.unplug(bench.now, "X").unwrap();
    bench.run_for(Span::ms(10));
    start(&mut bench, plan.clone());
    bench.run_for(Span::s(20));
    assert!(is_near(&told(&bench), &without), "{:?} {without:?}", told(&bench));
    bench.segment.plug(bench.now, "X", None).unwrap();
    let joined = |event: &Event| matches!(event, Event::GroupJoined { .. });
    assert!(bench.run_until(Span::s(10), joined), "{}", story(&bench));
    bench.run_for(Span::s(2));
    assert!(is_near(&told(&bench), &with), "{:?} {with:?}", told(&bench));
    let fault = cut(&mut bench, "K2.C-K3.A");
    bench.run_for(Span::s(1));
    bench.segment.unplug(bench.now, "X").unwrap();
    bench.run_for(Span::s(1));
    bench.segment.heal(bench.now, fault);
    let whole = |event: &Event| matches!(event, Event::Ring { intact: true });
    assert!(bench.run_until(Span::s(10), whole), "{}", story(&bench));
    bench.run_for(Span::s(2));
    assert!(is_near(&told(&bench), &without), "{:?} {without:?}", told(&bench));
    assert_eq!(bench.device.ring_intact(), Some(true));
    assert!(worst(&mut bench, &plan, Span::ms(100)) <= 100);
}
