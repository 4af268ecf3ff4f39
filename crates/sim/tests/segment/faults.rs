//! Effects of each fault on frames and counters.

use linesman_config::fault::FaultName;
use linesman_proto::address::{Path, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::port::Port;
use linesman_proto::register::ErrorCounter;
use linesman_proto::time::Span;
use linesman_sim::controller::WatchdogKind;
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::{FaultEntry, OneOrMany, SegmentFile};
use linesman_sim::truth::{Effect, Entry};

use super::rig::{Bench, PLANT, at, frame};

/// Sends a broadcast each millisecond; gives how many came back whole.
fn cycles(bench: &mut Bench, count: usize) -> usize {
    let probe = frame(Command::Brd, at(0, 0x0000), &[0; 4]);
    let mut whole = 0;
    for _ in 0..count {
        let mut arrived = bench.send_by(Path::A, &probe);
        arrived.extend(bench.wait(Span::us(500)));
        whole += arrived.iter().filter(|(arrival, _)| arrival.intact).count();
    }
    whole
}

// proves: ESC-05 partial, JCT-05
#[test]
fn an_open_link_cuts_off_what_is_behind_it() {
    let mut bench = Bench::plant();
    assert_eq!(bench.count(), Some(8));
    let fault = bench.inject(&FaultEntry::new(FaultName::LinkOpen).at("K1.C-K6.A"));
    bench.wait(Span::ms(1));
    assert_eq!(bench.count(), Some(5), "the loop has closed");
    assert_eq!(bench.counters(), ["K1.C lost 1", "K6.A lost 1"]);
    bench.heal(fault);
    bench.wait(Span::ms(10));
    assert_eq!(bench.count(), Some(5), "the link is not up yet");
    bench.wait(Span::s(3));
    assert_eq!(bench.count(), Some(8));
    assert_eq!(bench.counters(), ["K1.C lost 1", "K6.A lost 1"]);
    bench.assert_audit();
    let record = bench.segment.truth().fault(fault).unwrap();
    assert_eq!((record.links_lost, record.frames_lost), (2, 0));
    assert!(!record.is_active());
}

// proves: JCT-05 partial, JCT-08 partial, RED-04 partial
#[test]
fn a_cut_costs_the_frames_before_the_loop_closes_and_no_more() {
    // A contact of the E-bus: loops close 2 µs later. Frames of 60 bytes follow one another every
    // 6.72 µs, so at most two can be sent into the open end or be cut.
    let text =
        format!("{PLANT}\n[[fault]]\nkind = \"link-open\"\nat = \"T3.B-T4.A\"\nfrom_ms = 1.0\n");
    let mut bench = Bench::new(&text);
    let probe = frame(Command::Brd, at(0, 0x0000), &[0; 4]);
    let mut arrived = Vec::new();
    for _ in 0..300 {
        bench.segment.handle_frame(bench.now, Path::A, &probe);
        arrived.extend(bench.wait(Span::ns(6_720)));
    }
    arrived.extend(bench.wait(Span::ms(1)));
    let whole = arrived.iter().filter(|(arrival, _)| arrival.intact);
    let wkcs: Vec<u16> = whole.map(|(_, bytes)| super::rig::answer(bytes).1).collect();
    assert!((1..=2).contains(&(300 - wkcs.len())), "{} came back", wkcs.len());
    let before = wkcs.iter().take_while(|wkc| **wkc == 8).count();
    assert!((140..160).contains(&before), "{before}");
    let rest = &wkcs[before..];
    assert!(rest.iter().all(|wkc| *wkc == 6), "T4 and T5 are gone: {rest:?}");
    bench.assert_audit();
    let counters = bench.counters();
    assert!(counters.contains(&"T3.B lost 1".to_owned()), "{counters:?}");
    assert!(counters.contains(&"T4.A lost 1".to_owned()), "{counters:?}");
}

#[test]
fn a_cut_in_the_middle_of_a_frame_leaves_a_fragment() {
    // The frame is 1,514 bytes long, 122 µs on the wire, and cut 60 µs behind its start.
    let text =
        format!("{PLANT}\n[[fault]]\nkind = \"link-open\"\nat = \"K1.C-K6.A\"\nfrom_ms = 1.06\n");
    let mut bench = Bench::new(&text);
    bench.wait(Span::ms(1));
    let mut data = vec![0x5A; 1_400];
    data[0] = 0x11;
    let arrived = bench.send_by(Path::A, &frame(Command::Bwr, at(0, 0x1000), &data));
    // What had gone out came back cut off, or not at all.
    assert!(arrived.iter().all(|(arrival, _)| !arrival.intact), "{arrived:?}");
    let counters = bench.counters();
    assert!(counters.contains(&"K6.A frame 1".to_owned()), "{counters:?}");
    assert!(counters.contains(&"K6 unit 1".to_owned()), "{counters:?}");
    assert!(!counters.iter().any(|counter| counter.starts_with("K1 unit")), "{counters:?}");
    assert_eq!(bench.count(), Some(5));
    bench.assert_audit();
    let record = &bench.segment.truth().faults()[0];
    assert!(record.frames_lost >= 1, "{record:?}");
}

/// Exactly `hits` frame hits on a line, at a frame each millisecond.
fn hit(place: &str, hits: u32) -> Bench {
    let mut bench = Bench::plant();
    let entry = FaultEntry::new(FaultName::TransmitterDamaged)
        .at(place)
        .from_to(1.0, Some(2.0 * f64::from(hits) + 1.0))
        .with("hits", hits);
    bench.inject(&entry);
    let sent = 2 * hits as usize + 20;
    let whole = cycles(&mut bench, sent);
    assert_eq!(sent - whole, hits as usize, "{place}");
    let record = &bench.segment.truth().faults()[0];
    let counted = (record.frames_spoiled, record.symbol_errors);
    assert_eq!(counted, (u64::from(hits), u64::from(hits)), "{place}");
    let host = bench.segment.host(Path::A);
    assert_eq!(host.rx_crc_errors, u64::from(hits), "{place}");
    bench.assert_audit();
    bench
}

// proves: HW-18 partial, HW-28
#[test]
fn a_hit_on_the_way_out_is_found_next_and_forwarded_by_all_others() {
    let bench = hit("K1.B>T2.A", 3);
    let expected = [
        // Coupler and terminals: the receiver found it, the rest were told. K1 passes it on from B
        // to C, and takes it from C again.
        "K1.B forwarded 3",
        "K1.C forwarded 3",
        "T2.A frame 3",
        "T2.A physical 3",
        "T2.B forwarded 3",
        "T2 unit 3",
        "T3.A forwarded 3",
        "T3.B forwarded 3",
        "T3 unit 3",
        "T4.A forwarded 3",
        "T4.B forwarded 3",
        "T4 unit 3",
        "T5.A forwarded 3",
        "T5 unit 3",
        "K6.A forwarded 3",
        "K6.B forwarded 3",
        "K6.C forwarded 3",
        "K6 unit 3",
        "T7.A forwarded 3",
        "T7 unit 3",
        "K8.A forwarded 3",
        "K8 unit 3",
    ];
    let mut counters = bench.counters();
    counters.sort();
    let mut expected = expected.map(str::to_owned).to_vec();
    expected.sort();
    assert_eq!(counters, expected);
}

// proves: HW-18 partial, HW-28 partial
#[test]
fn a_hit_on_the_way_back_is_seen_by_no_unit_behind() {
    let bench = hit("K8.A>K6.C", 5);
    let mut counters = bench.counters();
    counters.sort();
    let mut expected = ["K6.C frame 5", "K6.C physical 5", "K1.C forwarded 5"];
    expected.sort();
    assert_eq!(counters, expected, "all units had executed it");
}

// proves: HW-30 partial
#[test]
fn the_last_hop_is_counted_by_the_card_alone() {
    let bench = hit("K1.A>maindevice", 4);
    assert_eq!(bench.counters(), [""; 0]);
}

// proves: HW-13 partial
#[test]
fn one_ten_and_a_thousand_hits_are_as_many() {
    for hits in [1, 10, 1_000] {
        let bench = hit("K6.A>K1.C", hits);
        let expected = hits.min(255);
        let counters = [format!("K1.C frame {expected}"), format!("K1.C physical {expected}")];
        assert_eq!(bench.counters(), counters, "counters stop at 255");
    }
}

#[test]
fn noise_between_frames_moves_only_the_physical_layer_counter() {
    let mut bench = Bench::plant();
    let entry = FaultEntry::new(FaultName::EmcNoise).at("K1.C>K6.A").with("hits_per_s", 50.0);
    bench.inject(&entry);
    bench.wait(Span::s(2));
    let physical = bench.physical("K6", Port::A);
    // Bursts of 5 ms, ten a second: the number of bursts itself is chance.
    assert!((40..=180).contains(&physical), "{physical}");
    assert_eq!(bench.counters(), [format!("K6.A physical {physical}")]);
    bench.assert_audit();
    let record = &bench.segment.truth().faults()[0];
    assert_eq!((record.symbol_errors, record.frames_spoiled), (u64::from(physical), 0));
}

#[test]
fn bursts_are_shared_by_all_links() {
    let places = vec!["K1.C>K6.A".to_owned(), "K6.C>K8.A".to_owned()];
    let entry =
        FaultEntry { at: Some(OneOrMany::Many(places)), ..FaultEntry::new(FaultName::EmcNoise) };
    let mut bench = Bench::plant();
    bench.inject(&entry.with("hits_per_s", 200.0).with("bursts_per_s", 1.0).with("burst_ms", 1.0));
    // Whatever rises rises together: a millisecond in which only one of them rises by much is none.
    let mut before = (0, 0);
    let (mut together, mut alone) = (0, 0);
    for _ in 0..400 {
        bench.wait(Span::ms(10));
        let now = (bench.physical("K6", Port::A), bench.physical("K8", Port::A));
        match (now.0 > before.0, now.1 > before.1) {
            (true, true) => together += 1,
            (true, false) | (false, true) if now.0.max(now.1) < 255 => alone += 1,
            _ => {}
        }
        before = now;
    }
    assert!(together >= 1 && alone == 0, "{together} together, {alone} alone");
}

#[test]
fn a_damaged_transmitter_shows_at_its_neighbour_only() {
    let mut bench = Bench::plant();
    let entry = FaultEntry::new(FaultName::TransmitterDamaged);
    bench.inject(&entry.at("K6.A>K1.C").with("hits_per_s", 100.0));
    bench.wait(Span::s(1));
    let physical = bench.physical("K1", Port::C);
    assert!((60..=150).contains(&physical), "{physical}");
    assert_eq!(bench.counters(), [format!("K1.C physical {physical}")]);
}

#[test]
fn a_degraded_cable_suffers_both_ways() {
    let mut bench = Bench::plant();
    let entry = FaultEntry::new(FaultName::CableDegraded);
    bench.inject(&entry.at("K6.C-K8.A").with("hits_per_s", 100.0).with("movement_ms", 100.0));
    bench.wait(Span::s(1));
    let (near, far) = (bench.physical("K6", Port::C), bench.physical("K8", Port::A));
    assert!((60..=150).contains(&near) && (60..=150).contains(&far), "{near} {far}");
}

#[test]
fn a_fault_inside_a_device_leaves_symbols_clean() {
    let mut bench = Bench::plant();
    let entry = FaultEntry::new(FaultName::DeviceInternal).device("T5");
    bench.inject(&entry.from_to(1.0, Some(21.0)).with("hits", 7));
    let whole = cycles(&mut bench, 60);
    assert_eq!(whole, 53);
    let counters = bench.counters();
    assert!(counters.contains(&"T4.B frame 7".to_owned()), "{counters:?}");
    assert!(!counters.iter().any(|counter| counter.contains("physical")), "{counters:?}");
    assert!(!counters.iter().any(|counter| counter.starts_with("T5")), "{counters:?}");
    bench.assert_audit();
}

#[test]
fn a_device_that_is_off_takes_all_behind_it_along() {
    let mut bench = Bench::plant();
    let fault = bench.inject(&FaultEntry::new(FaultName::DeviceOff).device("T3"));
    bench.wait(Span::ms(1));
    assert_eq!(bench.count(), Some(5), "K1, T2, K6, T7, K8");
    assert_eq!(bench.counters(), ["T2.B lost 1", "T4.A lost 1"]);
    bench.heal(fault);
    bench.wait(Span::s(1));
    assert_eq!(bench.count(), Some(8));
    bench.assert_audit();
}

#[test]
fn a_supply_takes_several_devices_off_together() {
    let mut bench = Bench::plant();
    let devices = Some(vec!["K6".to_owned(), "T7".to_owned(), "K8".to_owned()]);
    bench.inject(&FaultEntry { devices, ..FaultEntry::new(FaultName::SupplyOff) });
    bench.wait(Span::ms(5));
    assert_eq!(bench.count(), Some(5));
    assert_eq!(bench.counters(), ["K1.C lost 1"]);
    assert_eq!(bench.segment.truth().faults()[0].supplies_lost, 3);
}

#[test]
fn a_brown_out_forgets_address_and_counters() {
    let mut bench = Bench::plant();
    for position in 0..8u16 {
        let adp = 0u16.wrapping_sub(position);
        let station = (0x1001 + position).to_le_bytes();
        bench.send(Command::Apwr, at(adp, 0x0010), &station);
    }
    let id = bench.id("T4");
    bench.segment.set_counter(id, ErrorCounter::InvalidFrame(Port::A), 9);
    bench.inject(&FaultEntry::new(FaultName::BrownOut).device("T4").with("dip_ms", 30.0));
    bench.wait(Span::ms(20));
    assert_eq!(bench.count(), Some(6));
    bench.wait(Span::s(1));
    assert_eq!(bench.count(), Some(8));
    let controller = bench.segment.controller(id).unwrap();
    assert_eq!(controller.station_address().0, 0);
    assert_eq!(bench.counters(), ["T3.B lost 1", "T5.A lost 1"]);
    assert_eq!(bench.segment.controller(bench.id("T5")).unwrap().station_address().0, 0x1005);
    bench.assert_audit();
}

#[test]
fn brown_out_of_a_coupler_restarts_its_terminals() {
    let mut bench = Bench::plant();
    bench.send(Command::Bwr, at(0, 0x0010), &[1, 0x10]);
    bench.inject(&FaultEntry::new(FaultName::BrownOut).device("K6"));
    bench.wait(Span::s(4));
    assert_eq!(bench.count(), Some(8));
    let forgot = ["K1", "T2", "T5", "K6", "T7", "K8"]
        .map(|name| bench.segment.controller(bench.id(name)).unwrap().station_address().0 == 0);
    assert_eq!(forgot, [false, false, false, true, true, false]);
    // A terminal feeds nobody: its contacts pass the supply on.
    bench.inject(&FaultEntry::new(FaultName::SupplyOff).device("T3"));
    bench.wait(Span::ms(5));
    assert_eq!(bench.segment.truth().faults()[1].supplies_lost, 1);
    assert_eq!(bench.segment.truth().faults()[0].supplies_lost, 2);
}

#[test]
fn a_flapping_contact_loses_links_again_and_again() {
    let mut bench = Bench::plant();
    let entry = FaultEntry::new(FaultName::LinkFlapping).at("T4.B-T5.A");
    bench.inject(&entry.with("openings_per_s", 20.0).with("open_ms", 5.0));
    bench.wait(Span::s(1));
    let lost = bench.counter("T4", ErrorCounter::LostLink(Port::B));
    assert!((8..=35).contains(&lost), "{lost}");
    bench.assert_audit();
}

#[test]
fn openings_too_short_to_be_noticed_cost_frames_but_no_link() {
    let mut bench = Bench::plant();
    // 15 µs until an MII port notices; openings of 1 to some 5 µs.
    let entry = FaultEntry::new(FaultName::LinkFlapping).at("K1.C-K6.A");
    bench.inject(&entry.with("openings_per_s", 2_000.0).with("open_ms", 0.001));
    let whole = cycles(&mut bench, 1_000);
    assert!((850..1_000).contains(&whole), "{whole}");
    let lost = bench.counter("K1", ErrorCounter::LostLink(Port::C));
    assert_eq!(lost, 0);
    bench.assert_audit();
}

#[test]
fn a_missing_device_lets_the_next_move_up() {
    let text = format!("{PLANT}\n[[fault]]\nkind = \"device-missing\"\ndevice = \"T3\"\n");
    let mut bench = Bench::new(&text);
    assert_eq!(bench.count(), Some(7));
    let names: Vec<&str> = bench.segment.devices().map(|id| bench.segment.name(id)).collect();
    assert_eq!(names, ["K1", "T2", "T4", "T5", "K6", "T7", "K8"]);
    assert_eq!(bench.id("T4").no(), 4, "numbers are those of the plan");
    assert!(bench.segment.controller(bench.id("T3")).is_none());

    // A coupler takes its terminals along; the cable goes on to the next station.
    let text = format!("{PLANT}\n[[fault]]\nkind = \"device-missing\"\ndevice = \"K6\"\n");
    let mut bench = Bench::new(&text);
    let names: Vec<&str> = bench.segment.devices().map(|id| bench.segment.name(id)).collect();
    assert_eq!(names, ["K1", "T2", "T3", "T4", "T5", "K8"]);
    assert_eq!(bench.count(), Some(6));
}

#[test]
fn a_wrong_device_tells_its_own_identity() {
    let text = format!(
        "{PLANT}\n[[fault]]\nkind = \"device-wrong\"\ndevice = \"T2\"\ntype = \"EL2004\"\n\
         [[fault]]\nkind = \"device-wrong\"\ndevice = \"T4\"\nrevision = 0x00420000\n"
    );
    let mut bench = Bench::new(&text);
    assert_eq!(bench.count(), Some(8));
    let identity = |name: &str| {
        let sii = bench.segment.controller(bench.id(name)).unwrap().sii();
        let double = |word: usize| u32::from_le_bytes(sii[word * 2..][..4].try_into().unwrap());
        (double(0x0A) >> 16, double(0x0C))
    };
    assert_eq!(identity("T2").0, 2004);
    assert_eq!(identity("T4"), (2008, 0x0042_0000));
    let project = SegmentFile::parse(&text).unwrap().project().unwrap();
    assert_eq!(project.devices[1].product_code.unwrap() >> 16, 1008, "the plan is as it was");
}

#[test]
fn a_refused_state_is_refused_until_healed() {
    let mut bench = Bench::plant();
    let entry = FaultEntry::new(FaultName::InitRefused).device("T7");
    let fault = bench.inject(&entry.with("to", "PREOP").with("code", 0x001D));
    bench.wait(Span::ms(1));
    bench.send(Command::Bwr, at(0, 0x0120), &[2, 0]).unwrap();
    bench.wait(Span::ms(50));
    let shown = |bench: &Bench, name: &str| {
        let controller = bench.segment.controller(bench.id(name)).unwrap();
        (controller.al_status().0, controller.al_code().0)
    };
    assert_eq!(shown(&bench, "T7"), (0x11, 0x001D));
    assert_eq!(shown(&bench, "K6").0, 2);
    bench.heal(fault);
    bench.wait(Span::ms(1));
    bench.send(Command::Bwr, at(0, 0x0120), &[0x11, 0]).unwrap();
    bench.wait(Span::ms(50));
    bench.send(Command::Bwr, at(0, 0x0120), &[2, 0]).unwrap();
    bench.wait(Span::ms(50));
    assert_eq!(shown(&bench, "T7").0, 2);
}

#[test]
fn a_damaged_card_spoils_what_it_receives_or_sends() {
    let spoil = |part: &str| {
        let mut bench = Bench::plant();
        let entry = FaultEntry::new(FaultName::NicDamaged).from_to(1.0, Some(11.0));
        bench.inject(&entry.with("part", part).with("hits", 5));
        assert_eq!(cycles(&mut bench, 30), 25);
        assert_eq!(bench.segment.host(Path::A).rx_crc_errors, 5);
        bench.assert_audit();
        bench.counters()
    };
    assert_eq!(spoil("receiver"), [""; 0], "no controller sees it");
    let counters = spoil("transmitter");
    assert!(counters.contains(&"K1.A frame 5".to_owned()), "{counters:?}");
    assert!(counters.contains(&"K1.A physical 5".to_owned()), "{counters:?}");
}

#[test]
fn a_card_without_a_signal_loses_its_carrier() {
    let mut bench = Bench::plant();
    let fault = bench.inject(&FaultEntry::new(FaultName::LinkOpen).at("maindevice-K1.A"));
    bench.wait(Span::ms(5));
    assert!(!bench.segment.host(Path::A).carrier);
    assert_eq!(bench.count(), None);
    assert_eq!(bench.segment.host(Path::A).tx_dropped, 1);
    bench.heal(fault);
    bench.wait(Span::s(3));
    assert!(bench.segment.host(Path::A).carrier);
    assert_eq!(bench.count(), Some(8));
}

// proves: RED-01 partial
#[test]
fn a_ring_survives_a_cut() {
    let mut bench = Bench::new(&format!("{PLANT}\n[ring]\ncloses_at = \"K8.C\"\n"));
    bench.inject(&FaultEntry::new(FaultName::LinkOpen).at("K1.C-K6.A"));
    bench.wait(Span::ms(1));
    let probe = frame(Command::Brd, at(0, 0), &[0]);
    let near = bench.send_by(Path::A, &probe);
    assert_eq!((near[0].0.path, super::rig::answer(&near[0].1).1), (Path::A, 5));
    let far = bench.send_by(Path::B, &probe);
    assert_eq!((far[0].0.path, super::rig::answer(&far[0].1).1), (Path::B, 3));
    bench.assert_audit();
}

#[test]
fn faults_of_a_file_come_and_go_at_their_times() {
    let text = format!(
        "{PLANT}\n[[fault]]\nkind = \"device-off\"\ndevice = \"K8\"\nfrom_ms = 100\nto_ms = 200\n"
    );
    let mut bench = Bench::new(&text);
    bench.wait(Span::ms(99));
    assert_eq!(bench.count(), Some(8));
    bench.wait(Span::ms(5));
    assert_eq!(bench.count(), Some(7));
    bench.wait(Span::s(3));
    assert_eq!(bench.count(), Some(8));
    let record = &bench.segment.truth().faults()[0];
    let times = [record.began, record.ended].map(|at| at.unwrap().as_nanos());
    assert_eq!(times, [100_000_000, 200_000_000]);
}

#[test]
fn a_schedule_lets_a_fault_come_again_and_again() {
    let text = format!(
        "{PLANT}\n[[fault]]\nkind = \"device-off\"\ndevice = \"T5\"\nfrom_ms = 100\nto_ms = 10000\n\
         every_ms = 2000\nfor_ms = 500\ntimes = 3\n"
    );
    let mut bench = Bench::new(&text);
    let mut seen = Vec::new();
    for _ in 0..12 {
        bench.wait(Span::ms(550));
        seen.push(bench.count());
        assert_eq!(bench.segment.audit(), []);
    }
    // Gone from 100, 2,100 and 4,100 ms for half a second each.
    let gone: Vec<usize> =
        seen.iter().enumerate().filter(|(_, count)| **count == Some(7)).map(|(at, _)| at).collect();
    assert_eq!(gone, [0, 3, 7], "{seen:?}");
    let record = &bench.segment.truth().faults()[0];
    assert_eq!((record.times, record.supplies_lost, record.is_active()), (3, 3, false));
}

#[test]
fn healed_fault_does_not_come_again() {
    let mut bench = Bench::plant();
    let mut entry = FaultEntry::new(FaultName::LinkOpen).at("T4.B-T5.A");
    entry.schedule.every_ms = Some(100.0);
    entry.schedule.for_ms = Some(10.0);
    let fault = bench.inject(&entry);
    bench.wait(Span::ms(250));
    assert_eq!(bench.segment.truth().faults()[0].times, 3);
    bench.heal(fault);
    bench.wait(Span::s(2));
    assert_eq!(bench.segment.truth().faults()[0].times, 3);
    assert_eq!(bench.count(), Some(8));
}

#[test]
fn entries_that_cannot_be_are_refused_with_a_way_out() {
    let entry = |text: &str| format!("{PLANT}\n[[fault]]\n{text}\n");
    let table = [
        ("kind = \"link_open\"", "no fault is called `link_open` (did you mean `link-open`?)"),
        ("kind = \"one-sided-recording\"", "a segment cannot have the fault `one-sided-recording`"),
        ("kind = \"link-open\"", "no place is given; expected `at = \"K1.C>B3.A\"`"),
        ("kind = \"early-link\"\nat = \"K1.C>K6.A\"", "is one direction"),
        ("kind = \"ring-open\"", "this line is no ring"),
        ("kind = \"ports-swapped\"\ndevice = \"T3\"", "is not entered by a cable"),
        ("kind = \"supply-off\"\nsupply = \"PS9\"", "no supply is called `PS9`"),
        ("kind = \"link-open\"\nat = \"K1.C-K8.A\"", "K1.C is wired to K6.A"),
        ("kind = \"link-open\"\nat = \"K9.C-K6.A\"", "no device is called `K9`"),
        ("kind = \"link-open\"\nat = \"T5.B\"", "no link is plugged in at `T5.B`"),
        ("kind = \"link-open\"\ndevice = \"K1\"", "unknown key `device`"),
        ("kind = \"device-off\"\ndevice = \"K9\"", "no device is called `K9`"),
        ("kind = \"device-off\"", "no device is given"),
        (
            "kind = \"emc-noise\"\nat = \"K1.C\"\nhits_per_sec = 4",
            "unknown key `hits_per_sec` (did you mean `hits_per_s`?)",
        ),
        ("kind = \"emc-noise\"\nat = \"K1.C\"\nhits_per_s = -1", "a number from 0 to 1000000"),
        ("kind = \"emc-noise\"\nat = \"K1.C\"\nhits = 2.5", "a whole number from 1"),
        ("kind = \"init-refused\"\ndevice = \"T2\"\nto = \"OPP\"", "one of SAFEOP, PREOP, OP"),
        ("kind = \"device-off\"\ndevice = \"T2\"\nfrom_ms = 5\nto_ms = 4", "later than its begin"),
        ("kind = \"device-off\"\ndevice = \"T2\"\nfrom_ms = -5", "`from_ms` is -5"),
        ("kind = \"device-wrong\"\ndevice = \"T2\"", "give the `type` or the `revision`"),
        ("kind = \"device-wrong\"\ndevice = \"T2\"\ntype = \"EK1100\"", "does not fit"),
        ("kind = \"brown-out\"\ndevice = \"T2\"\ndip_ms = 9\nevery_ms = 3", "longer than `dip_ms`"),
    ];
    for (text, expected) in table {
        let file = SegmentFile::parse(&entry(text)).unwrap();
        let error = Segment::build(&file).expect_err(text).to_string();
        assert!(error.contains(expected), "{text}: {error}");
        assert!(error.starts_with("fault 1"), "{text}: {error}");
    }
}

#[test]
fn old_counters_are_no_fault() {
    let mut bench = Bench::new(&PLANT.replace("seed = 7", "seed = 7\nold_counters = true"));
    assert!(!bench.counters().is_empty());
    assert_eq!(cycles(&mut bench, 10), 10);
    bench.assert_audit();
    let text = PLANT.replace("cable_m = 10.0", "counters = { \"A.physical\" = 3, pdi = 1 }");
    let bench = Bench::new(&text);
    assert_eq!(bench.counters(), ["K1.A physical 3", "K1 pdi 1"]);
}

#[test]
fn a_link_that_negotiates_while_one_pair_breaks_comes_up_again() {
    // The negotiation of both ends is cut short by one end that loses its signal; the other goes on
    // alone, whoever is healed first.
    for place in ["maindevice-K1.A", "maindevice>K1.A", "K1.A>maindevice", "K1.C-K6.A", "K6.A>K1.C"]
    {
        let link = if place.contains("K6") { "K1.C-K6.A" } else { "maindevice-K1.A" };
        for (pause, far) in [(100, "without-link"), (100, "with-link"), (5_000, "without-link")] {
            let mut bench = Bench::plant();
            let open = bench.inject(&FaultEntry::new(FaultName::LinkOpen).at(link));
            bench.wait(Span::ms(500));
            bench.heal(open);
            bench.wait(Span::ms(100));
            let entry = FaultEntry::new(FaultName::FalseLink).at(place).with("far", far);
            let hole = bench.inject(&entry);
            bench.wait(Span::ms(pause));
            bench.heal(hole);
            bench.wait(Span::s(15));
            assert_eq!(bench.count(), Some(8), "{place}, {pause} ms, {far}");
            bench.assert_audit();
        }
    }
}

/// Outputs that stop coming let a watchdog run out: its counter moves with an entry of the log.
#[test]
fn a_watchdog_that_runs_out_is_in_the_log() {
    let mut bench = Bench::plant();
    let output = at(0u16.wrapping_sub(2), 0x0F00);
    // SyncManager 0 of T3: one byte of outputs, watched.
    let guard = [0x00, 0x0F, 1, 0, 0x44, 0, 1, 0];
    bench.send(Command::Apwr, at(0u16.wrapping_sub(2), 0x0800), &guard).unwrap();
    bench.send(Command::Apwr, output, &[1]).unwrap();
    bench.wait(Span::ms(300));
    let count = |bench: &Bench| {
        let controller = bench.segment.controller(bench.id("T3")).unwrap();
        controller.register(RegisterAddress(0x0442))
    };
    assert_eq!(count(&bench), 1);
    bench.assert_audit();
    let expired = bench.segment.truth().entries().iter().find_map(|entry| match entry {
        Entry::Effect {
            fault: None, effect: Effect::WatchdogExpired { kind, silence }, ..
        } => Some((*kind, *silence)),
        Entry::Effect { .. } | Entry::Begin { .. } | Entry::End { .. } => None,
    });
    let (kind, silence) = expired.expect("an entry");
    assert_eq!(kind, WatchdogKind::ProcessData);
    assert!((Span::ms(100)..Span::ms(101)).contains(&silence), "{silence}");
    bench.send(Command::Apwr, output, &[1]).unwrap();
    bench.wait(Span::ms(300));
    assert_eq!(count(&bench), 2);
    bench.assert_audit();
}
