//! Ports whose link was lost stay closed until the MainDevice orders them to open.

use linesman_config::plan::{Plan, PlanOptions};
use linesman_maindevice::Event;
use linesman_proto::address::{DeviceId, RegisterAddress};
use linesman_proto::port::Port;
use linesman_proto::register::{DlControl, LoopMode};
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};
use linesman_sim::segment_file::FaultEntry;

use crate::bench::Bench;

/// Two couplers, a cable between them; a terminal each.
const PLANT: &str = r#"
name = "two couplers"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "T2"
type = "EL2008"
on = "K1.B"
[[device]]
name = "K3"
type = "EK1100"
on = "K1.C"
[[device]]
name = "T4"
type = "EL1008"
on = "K3.B"
"#;

fn started(by_order: bool) -> Bench {
    let mut bench = Bench::new(PLANT);
    let inventory = bench.scan();
    let options = PlanOptions { ports_open_by_order: by_order, ..PlanOptions::default() };
    let plan = Plan::build(&inventory.planned(AlState::Op), inventory.tree().clone(), &options);
    bench.device.start(bench.now, plan.unwrap());
    assert!(bench.run_until(Span::s(30), |event| matches!(event, Event::AllReached)));
    bench.run_for(Span::ms(200));
    bench.events.clear();
    bench
}

fn break_link(bench: &mut Bench, kind: &str, at: &str, lasts: Span) {
    let entry = FaultEntry::new(kind.parse().unwrap()).at(at);
    let fault = bench.segment.inject(bench.now, &entry).unwrap();
    bench.run_for(lasts);
    bench.segment.heal(bench.now, fault);
}

/// When this first happened.
fn first(bench: &Bench, is: impl Fn(&Event) -> bool) -> Option<Instant> {
    bench.events.iter().find(|(_, event)| is(event)).map(|(at, _)| *at)
}

fn is_open(bench: &Bench, name: &str, port: Port) -> bool {
    bench.segment.controller(bench.id(name)).unwrap().is_open(port)
}

/// The loop modes of a controller's ports, A to D.
fn modes(bench: &Bench, name: &str) -> [LoopMode; 4] {
    let controller = bench.segment.controller(bench.id(name)).unwrap();
    let byte = |at: u16| controller.register(RegisterAddress(0x0100 + at));
    let control = DlControl::from_bytes([0, 1, 2, 3].map(byte));
    Port::ALL.map(|port| control.loop_mode(port))
}

// proves: JCT-12, ESC-06
#[test]
fn the_port_reports_the_section_is_prepared_then_the_port_is_ordered_to_open() {
    let mut bench = started(true);
    let (k1, k3, t4) = (bench.id("K1"), bench.id("K3"), bench.id("T4"));
    break_link(&mut bench, "link-open", "K1.C-K3.A", Span::s(1));
    let healed = bench.now;
    let lost_before = bench.device.statistics().frames_lost;
    bench.run_for(Span::s(10));

    let of_c = |event: &Event| {
        let Event::Links { id, status } = event else { return None };
        (*id == k1).then(|| status.port_state(Port::C))
    };
    let lost = |id: DeviceId| move |event: &Event| matches!(event, Event::DeviceLost { id: of } if *of == id);
    let back = |id: DeviceId| move |event: &Event| matches!(event, Event::DeviceBack { id: of, .. } if *of == id);
    // The section is taken for lost, ...
    let prepared = first(&bench, lost(k3)).max(first(&bench, lost(t4))).unwrap();
    // ... its port reports the link, and stays closed, ...
    let reported = first(&bench, |event| of_c(event).is_some_and(|c| c.link && c.closed)).unwrap();
    // ... and is ordered to open; only then do those behind answer.
    let is_order =
        |event: &Event| matches!(event, Event::PortOpened { id, port: Port::C } if *id == k1);
    let ordered = first(&bench, is_order).unwrap();
    let answered = first(&bench, back(k3)).min(first(&bench, back(t4))).unwrap();
    assert!(prepared < reported && healed < reported, "{:#?}", bench.events);
    assert!(reported + Span::ms(100) <= ordered && ordered < answered, "{:#?}", bench.events);
    assert!(is_open(&bench, "K1", Port::C));
    for name in ["K1", "T2", "K3", "T4"] {
        assert_eq!(bench.state(name), "OP", "{name}");
    }
    // All other traffic went on.
    assert_eq!(bench.device.statistics().frames_lost, lost_before);
}

// proves: JCT-12 partial
#[test]
fn a_port_without_order_opens_with_its_link() {
    let mut bench = started(false);
    break_link(&mut bench, "link-open", "K1.C-K3.A", Span::s(1));
    bench.run_for(Span::s(10));
    assert_eq!(first(&bench, |event| matches!(event, Event::PortOpened { .. })), None);
    assert_eq!(modes(&bench, "K1"), [LoopMode::Auto; 4]);
    assert_eq!(bench.state("T4"), "OP");
}

#[test]
fn a_contact_that_flaps_costs_frames_once_and_not_each_time() {
    let lost = |by_order: bool| {
        let mut bench = started(by_order);
        let before = bench.device.statistics().frames_lost;
        let entry = FaultEntry::new("link-flapping".parse().unwrap())
            .at("K1.B-T2.A")
            .with("openings_per_s", 40.0)
            .with("open_ms", 2.0);
        let fault = bench.segment.inject(bench.now, &entry).unwrap();
        bench.run_for(Span::s(5));
        let lost = bench.device.statistics().frames_lost - before;
        bench.segment.heal(bench.now, fault);
        bench.run_for(Span::s(3));
        assert_eq!(bench.state("T2"), "OP", "{by_order}");
        lost
    };
    let (by_order, by_itself) = (lost(true), lost(false));
    assert!(by_order * 4 < by_itself, "{by_order} and {by_itself} frames");
}

#[test]
fn ports_open_by_themselves_again_when_the_line_is_left() {
    let mut bench = started(true);
    // Of the first coupler B and C lead on; A leads to the MainDevice, and nothing hangs on D.
    let (auto, ordered) = (LoopMode::Auto, LoopMode::AutoClose);
    assert_eq!(modes(&bench, "K1"), [auto, ordered, ordered, auto]);
    bench.device.stop(bench.now, AlState::Init);
    assert!(bench.run_until(Span::s(10), |event| matches!(event, Event::Stopped)));
    assert_eq!(modes(&bench, "K1"), [auto; 4]);
    assert_eq!(bench.state("K1"), "INIT");
}
