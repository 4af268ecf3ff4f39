//! Two cards, one ring: every frame goes out by both, and a cut is survived.

use crate::bench::Bench;
use linesman_config::plan::{Plan, PlanOptions};
use linesman_maindevice::{Event, Options};
use linesman_proto::address::{Path, RegisterAddress};
use linesman_proto::frame::FrameView;
use linesman_proto::port::Port;
use linesman_proto::register::STATION_ADDRESS;
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

/// The working counters of a frame.
fn counters(frame: &[u8]) -> Vec<u16> {
    let view = FrameView::parse(frame).unwrap();
    view.datagrams().map(|datagram| datagram.unwrap().wkc().value()).collect()
}

// proves: RED-02, RED-03
#[test]
fn each_frame_leaves_by_both_cards_and_only_the_copy_of_card_a_is_counted() {
    let mut bench = bench();
    bench.scan();
    bench.start(AlState::Op);
    bench.crossed = Some(Vec::new());
    bench.run_for(Span::ms(50));
    let crossed = bench.crossed.take().unwrap();
    let of = |card: Path, came_back: bool| -> Vec<&[u8]> {
        let wanted = crossed.iter().filter(|(path, back, _)| (*path, *back) == (card, came_back));
        wanted.map(|(.., frame)| frame.as_slice()).collect()
    };
    let (sent_a, sent_b) = (of(Path::A, false), of(Path::B, false));
    assert!(sent_a.len() > 20 && sent_a.len() == sent_b.len(), "{}", sent_a.len());
    for (one, other) in sent_a.iter().zip(&sent_b) {
        assert_ne!(one[6..12], other[6..12], "told apart by their source address");
        assert_eq!(one[12..], other[12..], "and by nothing else");
    }
    // Each card takes the copy of the other; a controller marks what its processing unit has passed.
    let source = |frame: &[u8]| -> [u8; 6] { frame[6..12].try_into().unwrap() };
    let marked = |address: [u8; 6]| {
        [address[0] | 0x02, address[1], address[2], address[3], address[4], address[5]]
    };
    let (back_a, back_b) = (of(Path::A, true), of(Path::B, true));
    assert_eq!((back_a.len(), back_b.len()), (sent_a.len(), sent_b.len()));
    for frame in back_b {
        assert_eq!(source(frame), marked(source(sent_a[0])));
        assert!(counters(frame).iter().any(|counter| *counter > 0), "{:?}", counters(frame));
    }
    for frame in back_a {
        assert_eq!(source(frame), source(sent_b[0]), "passed no processing unit");
        assert!(counters(frame).iter().all(|counter| *counter == 0), "{:?}", counters(frame));
    }
}

/// TwinCAT's `SlaveCount` and `SlaveCount2`.
// proves: RED-15
#[test]
fn each_card_counts_those_whom_its_received_frames_have_met() {
    let mut bench = bench();
    bench.start(AlState::Op);
    let counts =
        |bench: &Bench| bench.device.responding_by_card().map(|both| both.map(|one| one.0));
    bench.run_for(Span::ms(10));
    assert_eq!(counts(&bench), Some([0, 4]), "whole: the second card counts every SubDevice");
    for (cut, halves) in [
        ("maindevice-B1.A", [0, 4]),
        ("B1.B-B2.A", [1, 3]),
        ("B2.B-B3.A", [2, 2]),
        ("B3.B-B4.A", [3, 1]),
        ("B4.B-maindevice.B", [4, 0]),
    ] {
        let entry = FaultEntry::new("link-open".parse().unwrap()).at(cut);
        let fault = bench.segment.inject(bench.now, &entry).unwrap();
        bench.run_for(Span::ms(50));
        assert_eq!(counts(&bench), Some(halves), "{cut}");
        bench.segment.heal(bench.now, fault);
        bench.run_for(Span::s(5));
        assert_eq!(counts(&bench), Some([0, 4]), "{cut} is mended");
    }
    bench
        .segment
        .inject(bench.now, &FaultEntry::new("device-off".parse().unwrap()).device("B2"))
        .unwrap();
    bench.run_for(Span::s(1));
    assert_eq!(counts(&bench), Some([1, 2]), "B2 has no power");
}

/// A ring through a box, a coupler and a junction, from which a branch leads away.
const BRANCHED: &str = r#"
name = "ring with a branch"
[[device]]
name = "B1"
type = "EP1008-0001"
on = "maindevice"
[[device]]
name = "K1"
type = "EK1100"
on = "B1.B"
[[device]]
name = "J1"
type = "EK1122"
on = "K1.B"
[[device]]
name = "X"
type = "EK1100"
on = "J1.D"
[[device]]
name = "K2"
type = "EK1100"
on = "K1.C"
[ring]
closes_at = "K2.C"
"#;

/// TwinCAT's `State`: 0x0200 link error, 0x0400 missing link, 0x0800 unexpected link, 0x1000 to 0x8000 port A to D.
// proves: RED-16 (S)
#[test]
fn the_state_words_name_slave_and_port_at_the_place_of_a_break() {
    let ring = || Options { ring: true, ..Options::default() };
    let planned = |absent: &[&str], by_order: bool| {
        let mut bench = Bench::with_options(BRANCHED, ring());
        for name in absent {
            bench.segment.unplug(bench.now, name).unwrap();
        }
        bench.run_for(Span::ms(100));
        let inventory = bench.scan();
        let options = PlanOptions { ports_open_by_order: by_order, ..PlanOptions::default() };
        let tree = inventory.tree().clone();
        let plan = Plan::build(&inventory.planned(AlState::Op), tree, &options).unwrap();
        bench.device.start(bench.now, plan);
        assert!(bench.run_until(Span::s(30), |event| matches!(event, Event::AllReached)));
        bench.run_for(Span::s(2));
        bench
    };
    // Who is not in OP with all links as planned, by station addresses, which count from 0x1001.
    let odd = |bench: &Bench| -> Vec<(u16, u16)> {
        let status = bench.device.network_status().unwrap();
        let words = status.devices().iter().map(|one| (one.id().no() as u16, one.state().0));
        words.filter(|(_, word)| *word != 0x0008).collect()
    };
    let open = |bench: &mut Bench, place: &str| {
        let entry = FaultEntry::new("link-open".parse().unwrap()).at(place);
        bench.segment.inject(bench.now, &entry).unwrap()
    };
    let mut bench = planned(&[], false);
    assert_eq!(odd(&bench), [], "whole");
    let [b1, k1, j1, x, k2] = ["B1", "K1", "J1", "X", "K2"].map(|name| bench.id(name).no() as u16);
    for (cut, words) in [
        ("maindevice-B1.A", vec![(b1, 0x1408)]),
        ("B1.B-K1.A", vec![(b1, 0x2408), (k1, 0x1408)]),
        ("K1.C-K2.A", vec![(k1, 0x4408), (k2, 0x1408)]),
        ("K2.C-maindevice.B", vec![(k2, 0x4408)]),
        ("J1.D-X.A", vec![(j1, 0x8408), (x, 0x0101)]),
    ] {
        let fault = open(&mut bench, cut);
        bench.run_for(Span::s(2));
        assert_eq!(odd(&bench), words, "{cut}");
        bench.segment.heal(bench.now, fault);
        bench.run_for(Span::s(8));
        assert_eq!(odd(&bench), [], "{cut} is mended");
    }
    // A link that is up again, and a port that waits for its order.
    let mut bench = planned(&[], true);
    let fault = open(&mut bench, "J1.D-X.A");
    bench.run_for(Span::s(2));
    bench.segment.heal(bench.now, fault);
    let mut seen = Vec::new();
    for _ in 0..800 {
        bench.run_for(Span::ms(10));
        seen.extend(odd(&bench));
    }
    seen.dedup();
    assert!(seen.contains(&(j1, 0x8208)), "{seen:04X?}");
    assert_eq!(odd(&bench), []);
    // Somebody is plugged in who is not in the plan.
    let mut bench = planned(&["X"], false);
    bench.segment.plug(bench.now, "X", None).unwrap();
    bench.run_for(Span::s(4));
    assert_eq!(odd(&bench), [(j1, 0x8808)]);
}

// proves: RED-04
#[test]
fn a_break_costs_at_most_one_frame_and_both_neighbours_close_their_port() {
    for (cut, ends) in [
        ("B1.B-B2.A", [("B1", Port::B), ("B2", Port::A)]),
        ("B2.B-B3.A", [("B2", Port::B), ("B3", Port::A)]),
        ("B3.B-B4.A", [("B3", Port::B), ("B4", Port::A)]),
    ] {
        // At another moment of the cycle each time, amid frames that cross the break too.
        for offset in 0..25 {
            let mut bench = bench();
            bench.start(AlState::Op);
            bench.run_for(Span::us(20_000 + 40 * offset));
            let before = bench.device.statistics();
            let entry = FaultEntry::new("link-open".parse().unwrap()).at(cut);
            bench.segment.inject(bench.now, &entry).unwrap();
            bench.run_for(Span::ms(200));
            let after = bench.device.statistics();
            let lost = after.frames_lost - before.frames_lost;
            let short = after.working_counter_errors - before.working_counter_errors;
            assert!(lost + short <= 1, "{cut}, {offset}: {lost} lost, {short} incomplete");
            for (name, port) in ends {
                let id = bench.id(name);
                let status = bench.segment.controller(id).unwrap().dl_status();
                assert!(status.port_state(port).closed, "{cut}: {name}.{port}");
            }
            for name in ["B1", "B2", "B3", "B4"] {
                assert_eq!(bench.state(name), "OP", "{cut}, {offset}: {name}");
            }
        }
    }
}

// proves: RED-01, RED-05, RED-06
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

// proves: RED-10
#[test]
fn what_lies_between_two_breaks_is_out_of_reach_until_they_are_mended() {
    let mut bench = bench();
    bench.start(AlState::Op);
    bench.events.clear();
    let cut = |bench: &mut Bench, place: &str| {
        let entry = FaultEntry::new("link-open".parse().unwrap()).at(place);
        bench.segment.inject(bench.now, &entry).unwrap()
    };
    let first = cut(&mut bench, "B1.B-B2.A");
    bench.run_for(Span::ms(500));
    let lost = |bench: &Bench| -> Vec<u32> {
        let lost = bench.events.iter().filter_map(|(_, event)| {
            if let Event::DeviceLost { id } = event { Some(id.no()) } else { None }
        });
        lost.collect()
    };
    assert_eq!(lost(&bench), Vec::<u32>::new(), "one break costs nobody");
    let second = cut(&mut bench, "B3.B-B4.A");
    bench.run_for(Span::s(1));
    let mut between = lost(&bench);
    between.sort_unstable();
    assert_eq!(between, [2, 3], "those between the breaks, and no others");
    assert_eq!((bench.state("B1"), bench.state("B4")), ("OP".to_owned(), "OP".to_owned()));
    bench.segment.heal(bench.now, second);
    bench.segment.heal(bench.now, first);
    bench.events.clear();
    bench.run_for(Span::s(10));
    for name in ["B1", "B2", "B3", "B4"] {
        assert_eq!(bench.state(name), "OP", "{name}");
    }
    let whole = |(_, event): &(_, Event)| matches!(event, Event::Ring { intact: true });
    assert!(bench.events.iter().any(whole), "the ring is whole again: {:#?}", bench.events);
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

/// Of two equal ones without power the second is back first, by the other card: it must not be taken for the first, whose outputs it would get.
#[test]
fn of_equal_devices_in_a_ring_the_one_that_comes_back_first_gets_its_own_address() {
    let text = RING.replace("EP4174-0002", "EP2308-0001");
    let mut bench = Bench::with_options(&text, Options { ring: true, ..Options::default() });
    let inventory = bench.scan();
    let mut planned = inventory.planned(AlState::Op);
    for device in &mut planned {
        device.identity.serial_number = 0;
    }
    let options = PlanOptions::default();
    let plan = Plan::build(&planned, inventory.tree().clone(), &options).unwrap();
    bench.device.start(bench.now, plan);
    assert!(bench.run_until(Span::s(20), |event| matches!(event, Event::AllReached)));
    let station = |bench: &Bench, name: &str| {
        let controller = bench.segment.controller(bench.id(name)).unwrap();
        [0, 1].map(|at| controller.register(RegisterAddress(STATION_ADDRESS.address.0 + at)))
    };
    let names = ["B2", "B3"];
    let planned = names.map(|name| station(&bench, name));
    let mut off = names.map(|name| {
        let entry = FaultEntry::new("device-off".parse().unwrap()).device(name);
        Some(bench.segment.inject(bench.now, &entry).unwrap())
    });
    bench.run_for(Span::s(1));
    for (back, are_back) in [(1, &[1][..]), (0, &[0, 1])] {
        bench.segment.heal(bench.now, off[back].take().unwrap());
        bench.run_for(Span::s(10));
        for at in are_back.iter().copied() {
            let name = names[at];
            assert_eq!(station(&bench, name), planned[at], "{name}: {:#?}", bench.events);
            assert_eq!(bench.state(name), "OP", "{name}");
        }
    }
}
