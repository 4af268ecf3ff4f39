//! Looking and scanning, over a virtual segment.

use crate::bench::{Bench, Fate};
use linesman_config::fault::FaultName;
use linesman_config::plan::{Plan, PlanOptions};
use linesman_maindevice::{Event, Phase};
use linesman_proto::port::Port;
use linesman_proto::register::ErrorCounter;
use linesman_proto::sii::Image;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use linesman_proto::topology::End;
use linesman_sim::segment_file::FaultEntry;

/// A coupler with four terminals, a box on its second Ethernet port, and a coupler behind that.
const PLANT: &str = r#"
name = "plant"
seed = 3
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "T1"
type = "EL1008"
on = "K1.B"
[[device]]
name = "T2"
type = "EL2004"
on = "T1.B"
[[device]]
name = "T3"
type = "EL3102"
on = "T2.B"
[[device]]
name = "K2"
type = "EK1100"
on = "K1.C"
[[device]]
name = "T4"
type = "EL2008"
on = "K2.B"
"#;

#[test]
fn a_scan_finds_names_identities_and_wiring() {
    let mut bench = Bench::new(PLANT);
    let inventory = bench.scan();
    let types: Vec<&str> =
        inventory.devices.iter().map(|device| device.profile.type_name.as_str()).collect();
    assert_eq!(types, ["EK1100", "EL1008", "EL2004", "EL3102", "EK1100", "EL2008"]);
    let stations: Vec<u16> = inventory.devices.iter().map(|device| device.station.0).collect();
    assert_eq!(stations, [0x1001, 0x1002, 0x1003, 0x1004, 0x1005, 0x1006]);
    let tree = inventory.tree();
    assert_eq!(tree.upstream(1), Some(End::Controller(0, Port::B)));
    assert_eq!(tree.upstream(2), Some(End::Controller(1, Port::B)));
    assert_eq!(tree.upstream(4), Some(End::Controller(0, Port::C)));
    assert_eq!(tree.upstream(5), Some(End::Controller(4, Port::B)));
    assert!(inventory.wiring.errors.is_empty());
    assert!(inventory.devices.iter().all(|device| device.sii_trouble.is_none()));
    assert_eq!(inventory.devices[0].identity.unwrap().vendor_id, 2);
    // A second scan finds the same, and leaves the addresses as they are.
    let again = bench.scan();
    let again: Vec<u16> = again.devices.iter().map(|device| device.station.0).collect();
    assert_eq!(again, stations);
}

#[test]
fn a_look_writes_nothing_and_reads_the_counters() {
    let mut bench = Bench::new(PLANT);
    let device = bench.id("T2");
    bench.segment.set_counter(device, ErrorCounter::InvalidFrame(Port::A), 17);
    bench.device.read_only_scan(bench.now);
    assert!(bench.run_until(Span::s(1), |event| matches!(event, Event::ReadOnlyScanned(_))));
    let Some((_, Event::ReadOnlyScanned(look))) = bench.events.pop() else { panic!() };
    assert_eq!(look.devices.len(), 6);
    let counters = look.devices[2].counters.unwrap();
    assert_eq!(counters.value(ErrorCounter::InvalidFrame(Port::A)), Some(17));
    assert!(look.devices.iter().all(|device| device.station.unwrap().0 == 0));
    for id in bench.segment.devices() {
        assert_eq!(bench.segment.controller(id).unwrap().station_address().0, 0);
    }
}

// proves: FRM-21 partial: lost frames; bad working counters are in executor::tests
#[test]
fn three_of_a_hundred_frames_lost_are_repeated() {
    let mut bench = Bench::new(PLANT);
    // A fixed pattern of its own: every 33rd frame, and now and then two in a row.
    bench.tamper = Some(Box::new(|number| {
        if number % 33 == 0 || number % 100 == 34 { Fate::Lost } else { Fate::Arrives }
    }));
    let inventory = bench.scan();
    assert_eq!(inventory.devices.len(), 6);
    assert!(inventory.devices.iter().all(|device| device.sii_trouble.is_none()));
    assert!(bench.device.statistics().frames_lost > 3);
    assert!(bench.device.statistics().repeats > 3);
}

#[test]
fn duplicates_and_late_frames_are_told_from_lost_ones() {
    let mut bench = Bench::new(PLANT);
    bench.tamper = Some(Box::new(|number| match number % 50 {
        7 => Fate::Doubled,
        20 => Fate::Late(Span::ms(15)),
        _ => Fate::Arrives,
    }));
    let inventory = bench.scan();
    bench.run_for(Span::ms(50));
    assert_eq!(inventory.devices.len(), 6);
    let statistics = bench.device.statistics();
    assert!(statistics.frames_duplicate >= 2, "{statistics:?}");
    assert!(statistics.frames_late >= 2, "{statistics:?}");
    assert_eq!(statistics.frames_lost, statistics.frames_late);
    assert_eq!(statistics.frames_foreign, 0);
}

#[test]
fn a_silent_line_is_an_error_that_says_what_to_check() {
    let mut bench = Bench::new(PLANT);
    bench.tamper = Some(Box::new(|_| Fate::Lost));
    bench.device.scan(bench.now);
    assert!(bench.run_until(Span::s(1), |event| matches!(event, Event::ScanFailed(_))));
    let Some((_, Event::ScanFailed(error))) = bench.events.pop() else { panic!() };
    let text = error.to_string();
    assert!(text.contains("BRD 0x0130") && text.contains("check carrier"), "{text}");
}

/// How long identifying takes when the plan of a scan starts after `pause`, during which this device is
/// without power if one is named.
fn identifying(pause: Span, without_power: Option<&str>) -> Span {
    let mut bench = Bench::new(PLANT);
    let inventory = bench.scan();
    let tree = inventory.tree().clone();
    let plan = Plan::build(&inventory.planned(AlState::Op), tree, &PlanOptions::default()).unwrap();
    if let Some(name) = without_power {
        let entry = FaultEntry::new(FaultName::BrownOut).device(name);
        bench.segment.inject(bench.now, &entry).unwrap();
    }
    bench.run_for(pause);
    bench.events.clear();
    bench.device.start(bench.now, plan);
    let all = bench.run_until(Span::s(20), |event| matches!(event, Event::AllReached));
    assert!(all, "{:?}", bench.events);
    let known = |(_, event): &&(_, Event)| matches!(event, Event::Identified { .. });
    assert_eq!(bench.events.iter().filter(known).count(), 6, "each is told");
    let times = bench.device.bring_up_times().unwrap();
    let its = times.network.iter().filter(|(phase, _)| *phase == Phase::Identify);
    its.map(|(_, span)| *span).max().unwrap()
}

/// Two reads of an EEPROM by its controller, one after the other, are not done sooner.
const ASKED: Span = Span::us(1_360);

#[test]
fn recently_scanned_subdevice_is_not_asked_again() {
    let at_once = identifying(Span::ms(1), None);
    assert!(at_once < ASKED, "{at_once}");
}

#[test]
fn subdevice_scanned_long_ago_or_without_address_is_asked_again() {
    let later = identifying(Span::s(2), None);
    assert!(later >= ASKED, "{later}");
    let without_power = identifying(Span::ms(800), Some("T3"));
    assert!(without_power >= ASKED, "{without_power}");
}

#[test]
fn a_scan_reads_of_an_eeprom_what_a_plan_needs() {
    let behind = PLANT.find("[[device]]\nname = \"T2\"").unwrap();
    let mut bench = Bench::new(&PLANT[..behind]);
    let began = bench.now;
    let inventory = bench.scan();
    let took = bench.now.since(began);
    // What the longest EEPROM of the plant takes to be read from its begin to its end, at 0.68 ms for each
    // eight bytes, and some for getting there.
    let longest = (inventory.devices.iter())
        .map(|device| {
            let id = bench.segment.devices().nth(device.id.index()).unwrap();
            let image = Image::parse(bench.segment.controller(id).unwrap().sii()).unwrap();
            image.build().unwrap().len()
        })
        .max()
        .unwrap();
    let whole = Span::us(680) * (longest as u64).div_ceil(8);
    assert!(took < whole, "{took} for {longest} bytes, expected less than {whole}");
    assert!(inventory.devices.iter().all(|device| device.sii_trouble.is_none()));
}
