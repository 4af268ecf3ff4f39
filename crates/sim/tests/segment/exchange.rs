//! Deviations from the plan, addresses that two share, currents that are not supplied.

use linesman_config::fault::FaultName;
use linesman_proto::address::DeviceId;
use linesman_proto::command::Command;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::register as r;
use linesman_proto::time::Span;
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::{FaultEntry, SegmentFile};

use super::rig::{Bench, PLANT, at};

fn plant(faults: &str) -> SegmentFile {
    SegmentFile::parse(&format!("{PLANT}\n{faults}")).unwrap_or_else(|error| panic!("{error}"))
}

fn refused(faults: &str) -> String {
    Segment::build(&plant(faults)).map(|_| ()).unwrap_err().to_string()
}

fn pair(kind: FaultName, one: &str, other: &str) -> FaultEntry {
    let devices = Some(vec![one.to_owned(), other.to_owned()]);
    FaultEntry { devices, ..FaultEntry::new(kind) }
}

/// Product code in the EEPROM of a controller: words 0x0A and 0x0B.
fn product(bench: &Bench, id: u32) -> u32 {
    let sii = bench.segment.controller(DeviceId(id)).unwrap().sii();
    u32::from_le_bytes(sii[0x14..0x18].try_into().unwrap())
}

fn serial(bench: &Bench, id: u32) -> u32 {
    let sii = bench.segment.controller(DeviceId(id)).unwrap().sii();
    u32::from_le_bytes(sii[0x1C..0x20].try_into().unwrap())
}

#[test]
fn devices_of_different_type_change_places() {
    let bench =
        Bench::of(&plant("[[fault]]\nkind = \"devices-swapped\"\ndevices = [\"T2\", \"T4\"]"));
    assert_eq!((product(&bench, 1), product(&bench, 3)), (0x07D8_3052, 0x03F0_3052));
    assert_eq!((serial(&bench, 1), serial(&bench, 3)), (4, 2), "with all that is its own");
    assert_eq!(bench.segment.truth().faults().len(), 1);
    let why = refused("[[fault]]\nkind = \"devices-swapped\"\ndevices = [\"T3\", \"T4\"]");
    assert!(why.contains("twins-swapped"), "{why}");
    let why = refused("[[fault]]\nkind = \"devices-swapped\"\ndevices = [\"T2\", \"K6\"]");
    assert!(why.contains("does not fit") && why.contains("port A"), "{why}");
    let why = refused("[[fault]]\nkind = \"devices-swapped\"\ndevices = [\"T2\"]");
    assert!(why.contains("1 devices"), "{why}");
}

#[test]
fn twins_change_places_with_their_wiring() {
    let before = Bench::plant();
    let bench =
        Bench::of(&plant("[[fault]]\nkind = \"twins-swapped\"\ndevices = [\"T3\", \"T4\"]"));
    assert_eq!(product(&bench, 2), product(&before, 2));
    assert_eq!((serial(&bench, 2), serial(&bench, 3)), (4, 3));
    let wired = |bench: &Bench, id| bench.segment.outputs(DeviceId(id)).to_vec();
    assert_eq!(wired(&bench, 2), wired(&before, 3));
    assert_eq!(wired(&bench, 3), wired(&before, 2));
    let why = refused("[[fault]]\nkind = \"twins-swapped\"\ndevices = [\"T2\", \"T3\"]");
    assert!(why.contains("devices-swapped"), "{why}");
}

#[test]
fn a_device_too_many_comes_in_between() {
    let extra =
        "[[fault]]\nkind = \"device-extra\"\ndevice = \"X\"\ntype = \"EL2004\"\non = \"T3.B\"";
    let mut bench = Bench::of(&plant(extra));
    assert_eq!(bench.count(), Some(9));
    // It answers at its position; its number is behind all that were planned.
    assert_eq!(bench.segment.name(DeviceId(8)), "X");
    assert_eq!(product(&bench, 8), 0x07D4_3052);
    let position = 0u16.wrapping_sub(3);
    bench.send(Command::Apwr, at(position, 0x0010), &[0x34, 0x12]).unwrap();
    let station = |id| bench.segment.controller(DeviceId(id)).unwrap().station_address().0;
    assert_eq!((station(8), station(3)), (0x1234, 0));
    // At the end of the line nothing moves.
    let end =
        "[[fault]]\nkind = \"device-extra\"\ndevice = \"X\"\ntype = \"EP1008\"\non = \"K8.C\"";
    assert_eq!(Bench::of(&plant(end)).count(), Some(9));
    for (faults, why) in [
        ("type = \"EL2004\"", "give `on`"),
        ("type = \"EL2004\"\non = \"K9.B\"", "K9"),
        ("type = \"EL9999\"\non = \"T3.B\"", "EL9999"),
        ("type = \"CU1128\"\non = \"K1.C\"", "several controllers"),
    ] {
        let text = format!("[[fault]]\nkind = \"device-extra\"\ndevice = \"X\"\n{faults}");
        let said = refused(&text);
        assert!(said.contains(why), "{faults}: {said}");
    }
}

#[test]
fn two_devices_answer_to_one_station_address() {
    let mut bench = Bench::plant();
    for position in 0..8u16 {
        let address = (0x1001 + position).to_le_bytes();
        bench.send(Command::Apwr, at(0u16.wrapping_sub(position), 0x0010), &address).unwrap();
    }
    let ask = |bench: &mut Bench, station: u16| {
        let address = DatagramAddress::Physical(station, r::AL_STATUS.address);
        bench.send(Command::Fprd, address, &[0, 0]).unwrap()
    };
    assert_eq!(ask(&mut bench, 0x1004), (vec![1, 0], 1));
    let fault = bench.inject(&pair(FaultName::DuplicateAddress, "T3", "T4"));
    bench.wait(Span::ms(1));
    assert_eq!(ask(&mut bench, 0x1003).1, 2, "both answer");
    assert_eq!(ask(&mut bench, 0x1004).1, 0, "nobody does");
    bench.heal(fault);
    bench.wait(Span::ms(1));
    assert_eq!((ask(&mut bench, 0x1003).1, ask(&mut bench, 0x1004).1), (1, 1));
    assert_eq!(bench.segment.audit(), []);
}

#[test]
fn two_devices_have_one_alias() {
    let entry = "[[fault]]\nkind = \"duplicate-address\"\ndevices = [\"T3\", \"K8\"]\n\
                 which = \"alias\"\nalias = 77";
    let mut bench = Bench::of(&plant(entry));
    // DL control, bit 24: the alias can be used as an address.
    bench.send(Command::Bwr, at(0, 0x0100), &[0x01, 0, 0, 0x01]).unwrap();
    let address = DatagramAddress::Physical(77, r::AL_STATUS.address);
    assert_eq!(bench.send(Command::Fprd, address, &[0, 0]).unwrap().1, 2);
    let sii = bench.segment.controller(DeviceId(2)).unwrap().sii();
    assert_eq!(&sii[8..10], &[77, 0]);
}

#[test]
fn terminals_behind_the_sum_of_currents_fall_off_and_come_back() {
    // EL1008 90, EL2008 110, EL2008 110, EL1008 90: the last two are beyond 250 mA.
    let entry = FaultEntry::new(FaultName::EbusOverload)
        .device("K1")
        .with("supply_ma", 250.0)
        .with("off_ms", 20.0)
        .with("on_ms", 30.0);
    let mut bench = Bench::plant();
    let fault = bench.inject(&entry);
    let mut seen = std::collections::BTreeSet::new();
    for _ in 0..120 {
        bench.wait(Span::ms(1));
        seen.insert(bench.count());
    }
    // A frame that is on its way when they fall off is lost.
    seen.remove(&None);
    assert_eq!(seen, [Some(6), Some(8)].into(), "again and again, and no others");
    bench.heal(fault);
    bench.wait(Span::ms(50));
    assert_eq!(bench.count(), Some(8));
    assert_eq!(bench.segment.audit(), []);
    let refused = |entry: &FaultEntry| {
        let now = bench.now;
        let mut segment = Segment::build(&plant("")).unwrap();
        segment.inject(now, entry).unwrap_err().to_string()
    };
    let healthy = refused(&FaultEntry::new(FaultName::EbusOverload).device("K1"));
    assert!(healthy.contains("2000 mA") && healthy.contains("400 mA"), "{healthy}");
    let terminal = refused(&FaultEntry::new(FaultName::EbusOverload).device("T2"));
    assert!(terminal.contains("feeds no E-bus"), "{terminal}");
    // A defect draws more than all: those before the last still live.
    let defect = entry.with("supply_ma", 2_000.0).with("extra_ma", 1_700.0);
    let mut bench = Bench::plant();
    bench.inject(&defect);
    bench.wait(Span::ms(1));
    assert_eq!(bench.count(), Some(7));
}

#[test]
fn a_supply_terminal_without_a_controller_begins_a_new_sum() {
    let cabinet = r#"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"

[[device]]
name = "T1"
type = "EL2008"
on = "K1.B"

[[device]]
name = "P1"
type = "EL9400"
on = "T1.B"

[[device]]
name = "T2"
type = "EL2008"
on = "P1.B"

[[device]]
name = "END"
type = "EL9011"
on = "T2.B"
"#;
    let file = SegmentFile::parse(cabinet).unwrap();
    assert_eq!(file.project().unwrap().devices.len(), 3, "no frame knows of P1 and END");
    let mut bench = Bench::of(&file);
    assert_eq!(bench.count(), Some(3));
    // The coupler's supply is that of T1, and not that of T2.
    bench.inject(&FaultEntry::new(FaultName::SupplyOff).device("K1").from_to(0.0, None));
    bench.wait(Span::ms(1));
    let powered = |id| bench.segment.controller(DeviceId(id)).unwrap().is_powered();
    assert_eq!([powered(0), powered(1), powered(2)], [false, false, true]);
    for (text, why) in [
        ("name = \"T3\"\ntype = \"EL1008\"\non = \"END.B\"", "nothing can be put behind an EL9011"),
        ("name = \"T3\"\ntype = \"EL1008\"\non = \"P1.C\"", "port B only"),
        ("name = \"T3\"\ntype = \"EL9400\"\non = \"K1.C\"", "an E-bus contact"),
    ] {
        let error = SegmentFile::parse(&format!("{cabinet}\n[[device]]\n{text}\n")).unwrap_err();
        assert!(error.to_string().contains(why), "{text}: {error}");
    }
}

#[test]
fn a_group_can_be_named_as_a_place() {
    let grouped = PLANT.replace("name = \"T7\"\n", "name = \"T7\"\ngroup = \"A\"\n");
    let grouped = grouped.replace("name = \"T5\"\n", "name = \"T5\"\ngroup = \"A\"\n");
    let mut bench = Bench::new(&grouped);
    bench.inject(&FaultEntry::new(FaultName::SupplyOff).device("group:A"));
    bench.wait(Span::ms(1));
    assert_eq!(bench.count(), Some(6));
}

#[test]
fn a_fast_link_is_there_before_an_ordinary_one_has_begun() {
    let line = r#"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"

[[device]]
name = "J1"
type = "EK1122-0080"
on = "K1.B"

[[device]]
name = "K2"
type = "EK1101-0080"
on = "J1.D"

[[device]]
name = "K3"
type = "EK1100"
on = "K1.C"
"#;
    // How long after the contact is made again frames get through.
    let back = |link: &str| {
        let mut bench = Bench::new(line);
        let fault = bench.inject(&FaultEntry::new(FaultName::LinkOpen).at(link));
        bench.wait(Span::ms(100));
        assert_eq!(bench.count(), Some(3));
        bench.heal(fault);
        let healed = bench.now;
        while bench.count() != Some(4) {
            bench.wait(Span::ms(1));
        }
        bench.now.since(healed)
    };
    let (fast, ordinary) = (back("J1.D-K2.A"), back("K1.C-K3.A"));
    assert!(fast < Span::ms(500), "{fast}");
    assert!((Span::s(1)..=Span::s(3)).contains(&ordinary), "{ordinary}");
    let mixed = line.replace("on = \"J1.D\"", "on = \"K1.C\"").replace("on = \"K1.C\"\n\"#", "");
    let error = SegmentFile::parse(&mixed.replacen(
        "name = \"K3\"\ntype = \"EK1100\"\non = \"K1.C\"\n",
        "name = \"K3\"\ntype = \"EL1008\"\non = \"J1.C\"\n",
        1,
    ))
    .unwrap_err();
    assert!(error.to_string().contains("Fast Hot Connect"), "{error}");
}
