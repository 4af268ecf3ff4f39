//! Two cards, one ring: every frame goes out by both, and a cut is survived.

use crate::bench::Bench;
use linesman_maindevice::{Event, Options};
use linesman_proto::address::Path;
use linesman_proto::port::Port;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use linesman_proto::topology::End;
use linesman_sim::segment_file::FaultEntry;

const RING: &str = r#"
name = "ring"
[[device]]
name = "B1"
type = "EP1008-0001"
on = "maindevice"
[[device]]
name = "B2"
type = "EP2308-0001"
on = "B1.B"
[[device]]
name = "B3"
type = "EP4174-0002"
on = "B2.B"
[[device]]
name = "B4"
type = "EP2308-0001"
on = "B3.B"
[ring]
closes_at = "B4.B"
"#;

fn bench() -> Bench {
    Bench::with_options(RING, Options { ring: true, ..Options::default() })
}

// proves: RED-02, RED-03
#[test]
fn an_intact_ring_is_scanned_and_run() {
    let mut bench = bench();
    let inventory = bench.scan();
    assert_eq!(inventory.devices.len(), 4);
    assert_eq!(inventory.tree().closes_at(), Some((3, Port::B)));
    bench.start(AlState::Op);
    let before = bench.device.statistics();
    bench.run_for(Span::ms(200));
    let after = bench.device.statistics();
    assert_eq!(after.frames_lost, before.frames_lost);
    assert_eq!(after.working_counter_errors, before.working_counter_errors);
}

// proves: RED-05, RED-06, RED-01 partial: in the virtual segment only
#[test]
fn a_cut_ring_keeps_all_subdevices() {
    let mut bench = bench();
    let plan = bench.start(AlState::Op);
    bench.events.clear();
    let entry = FaultEntry::new("link-open".parse().unwrap()).at("B2.B-B3.A");
    let cut = bench.segment.inject(bench.now, &entry).unwrap();
    bench.run_for(Span::s(1));
    let opened = |event: &Event| matches!(event, Event::Ring { intact: false });
    assert_eq!(bench.events.iter().filter(|(_, event)| opened(event)).count(), 1);
    let lost = |event: &Event| matches!(event, Event::DeviceLost { .. });
    assert!(!bench.events.iter().any(|(_, event)| lost(event)), "{:#?}", bench.events);
    for name in ["B1", "B2", "B3", "B4"] {
        assert_eq!(bench.state(name), "OP", "{name}");
    }
    // Process data still go both ways on either side of the cut.
    for name in ["B2", "B4"] {
        let id = bench.id(name);
        let outputs = plan.device(id).unwrap().outputs.clone();
        bench.device.outputs_mut()[outputs.start] = 0x02;
        bench.run_for(Span::ms(5));
        let signal = bench.segment.outputs(id)[1];
        assert_eq!(bench.segment.signals().value(signal), 1, "{name}");
    }
    bench.segment.heal(bench.now, cut);
    bench.run_for(Span::s(5));
    assert!(!bench.events.iter().any(|(_, event)| lost(event)), "{:#?}", bench.events);
    let before = bench.device.statistics().working_counter_errors;
    bench.run_for(Span::ms(200));
    assert_eq!(bench.device.statistics().working_counter_errors, before);
    assert_eq!(bench.state("B4"), "OP");
}

/// The line is switched on with a break: it is scanned and started all the same.
// proves: RED-11 partial: the break is told by one event and by the wiring
#[test]
fn a_ring_that_is_broken_from_the_start_is_scanned_and_run() {
    for cut in ["B2.B-B3.A", "B1.B-B2.A", "maindevice-B1.A"] {
        let mut bench = bench();
        let entry = FaultEntry::new("link-open".parse().unwrap()).at(cut);
        bench.segment.inject(bench.now, &entry).unwrap();
        bench.run_for(Span::ms(100));
        let inventory = bench.scan();
        let types: Vec<&str> =
            inventory.devices.iter().map(|device| device.profile.type_name.as_str()).collect();
        assert_eq!(types, ["EP1008-0001", "EP2308-0001", "EP4174-0002", "EP2308-0001"], "{cut}");
        assert!(inventory.wiring.errors.is_empty(), "{cut}: {:?}", inventory.wiring.errors);
        let last = inventory.tree().upstream(3);
        assert_eq!(last, Some(End::MainDevice(Path::B)), "{cut}");
        bench.start(AlState::Op);
        assert_eq!((bench.state("B1"), bench.state("B4")), ("OP".to_owned(), "OP".to_owned()));
    }
}

#[test]
fn behind_a_break_a_device_without_power_comes_back() {
    let mut bench = bench();
    bench.start(AlState::Op);
    let entry = FaultEntry::new("link-open".parse().unwrap()).at("B1.B-B2.A");
    bench.segment.inject(bench.now, &entry).unwrap();
    bench.run_for(Span::ms(500));
    let off = FaultEntry::new("device-off".parse().unwrap()).device("B2");
    let off = bench.segment.inject(bench.now, &off).unwrap();
    bench.run_for(Span::ms(500));
    bench.segment.heal(bench.now, off);
    bench.run_for(Span::s(10));
    assert!(bench.device.is_settled(), "{:#?}", bench.events);
    assert_eq!(bench.state("B2"), "OP");
}
