//! Hot connect groups that come and go while the line runs, and SubDevices that are told apart by their
//! numbers.

use linesman_config::plan::{
    HotConnectGroup, IdentificationCheck, IdentificationSource, Plan, PlanOptions,
};
use linesman_config::profile::DeviceProfile;
use linesman_maindevice::{Event, GroupPlace, Options};
use linesman_proto::address::{DeviceId, WorkingCounter};
use linesman_proto::port::Port;
use linesman_proto::sii::Identification;
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::{End, Tree};
use linesman_sim::segment_file::FaultEntry;

use crate::bench::Bench;

/// A line of three couplers with a terminal each, and two tools: couplers with a coding switch and terminals
/// of their own.
pub(crate) const PLANT: &str = r#"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "T1"
type = "EL2008"
on = "K1.B"
[[device]]
name = "J1"
type = "EK1122"
on = "T1.B"
[[device]]
name = "X"
type = "EK1101"
on = "J1.D"
id = 5
[[device]]
name = "X1"
type = "EL1008"
on = "X.B"
[[device]]
name = "X2"
type = "EL3104"
on = "X1.B"
[[device]]
name = "Y"
type = "EK1101"
on = "J1.B"
id = 6
[[device]]
name = "Y1"
type = "EL1008"
on = "Y.B"
[[device]]
name = "K2"
type = "EK1100"
on = "K1.C"
[[device]]
name = "T2"
type = "EL1008"
on = "K2.B"
"#;

/// What happened, without what was read.
pub(crate) fn story(bench: &Bench) -> String {
    let is_read = |event: &Event| matches!(event, Event::Counters { .. } | Event::Links { .. });
    let events = bench.events.iter().filter(|(_, event)| !is_read(event));
    events.map(|(at, event)| format!("{at:?} {event:?}\n")).collect()
}

/// How a selector is read, as the SII says.
pub(crate) fn source(profile: &DeviceProfile) -> IdentificationSource {
    match profile.identification {
        Identification::AlStatus => IdentificationSource::AlStatus,
        Identification::Memory(at) => IdentificationSource::Memory(at),
        Identification::None => IdentificationSource::Alias,
    }
}

/// What a plan says beside what a scan finds.
#[derive(Default)]
pub(crate) struct Wanted<'a> {
    /// Group: first SubDevice, how many it has.
    groups: &'a [(&'a str, u32)],
    /// SubDevices with their numbers.
    numbers: &'a [(&'a str, u32)],
    places: Vec<End>,
    /// A wrong number is told only.
    only_told: bool,
}

/// The plan of a plant that is complete, and its tree.
pub(crate) fn plan(toml: &str, wanted: &Wanted<'_>) -> Plan {
    let mut bench = Bench::with_options(toml, options(toml));
    let inventory = bench.scan();
    let mut planned = inventory.planned(AlState::Op);
    for (name, value) in wanted.numbers {
        let device = &mut planned[bench.id(name).index()];
        device.identity.serial_number = 0;
        let (source, compulsory) = (source(&device.profile), !wanted.only_told);
        device.settings.identification =
            Some(IdentificationCheck { source, value: *value, compulsory });
    }
    let group = |(name, count): &(&str, u32)| {
        let first = bench.id(name).0;
        HotConnectGroup {
            name: (*name).to_owned(),
            members: (first..first + count).map(DeviceId).collect(),
            optional: true,
            places: wanted.places.clone(),
        }
    };
    let groups = wanted.groups.iter().map(group).collect();
    let options = PlanOptions { groups, ..PlanOptions::default() };
    let tree: Tree = inventory.tree().clone();
    Plan::build(&planned, tree, &options).unwrap()
}

pub(crate) const TOOLS: Wanted<'_> = Wanted {
    groups: &[("X", 3), ("Y", 2)],
    numbers: &[("X", 5), ("Y", 6)],
    places: Vec::new(),
    only_told: false,
};

pub(crate) fn options(toml: &str) -> Options {
    Options { ring: toml.contains("[ring]"), ..Options::default() }
}

/// A bench that runs a plan; these are not plugged in.
pub(crate) fn running(toml: &str, plan: &Plan, absent: &[&str]) -> Bench {
    let mut bench = Bench::with_options(toml, options(toml));
    for name in absent {
        bench.segment.unplug(bench.now, name).unwrap();
    }
    bench.run_for(Span::ms(10));
    bench.device.start(bench.now, plan.clone());
    let all = bench.run_until(Span::s(20), |event| matches!(event, Event::AllReached));
    assert!(all, "{}", story(&bench));
    bench.run_for(Span::ms(200));
    bench
}

pub(crate) fn plug(bench: &mut Bench, name: &str, on: Option<&str>) {
    let on = on.map(|on| on.parse().unwrap());
    bench.segment.plug(bench.now, name, on.as_ref()).unwrap();
}

pub(crate) fn joined(group: usize) -> impl FnMut(&Event) -> bool {
    move |event| matches!(event, Event::GroupJoined { group: at, .. } if *at == group)
}

pub(crate) fn place(bench: &Bench, group: usize) -> Option<GroupPlace> {
    bench.device.network_status().unwrap().groups()[group].place()
}

/// Frames that were lost so far, and events of working counters of others than groups.
fn disturbances(bench: &Bench, plan: &Plan) -> (u64, usize) {
    let is_of_group = |task: usize, frame: usize, datagram: usize| {
        let datagram = &plan.tasks[task].frames[frame].datagrams[datagram];
        datagram.ownership.iter().all(|one| plan.group_of(one.device).is_some())
    };
    let of_others = |event: &Event| {
        matches!(event, Event::WorkingCounter { task, frame, datagram, .. }
            if !is_of_group(*task, *frame, *datagram))
    };
    let events = bench.events.iter().filter(|(_, event)| of_others(event)).count();
    (bench.device.statistics().frames_lost, events)
}

// proves: HC-01 (S)
#[test]
fn a_group_joins_and_leaves_and_the_others_lose_no_frame_by_it() {
    let plan = plan(PLANT, &TOOLS);
    let mut bench = running(PLANT, &plan, &["X", "Y"]);
    let is_lost = |event: &Event| matches!(event, Event::DeviceLost { .. });
    assert!(!bench.events.iter().any(|(_, event)| is_lost(event)), "absence is no error");
    bench.judged = Some(bench.id("T2"));
    let before = disturbances(&bench, &plan);
    let x1 = bench.id("X1");
    for _ in 0..3 {
        assert!(!bench.device.quality(x1).valid);
        plug(&mut bench, "X", None);
        assert!(bench.run_until(Span::s(10), joined(0)), "{}", story(&bench));
        for name in ["X", "X1", "X2"] {
            assert_eq!(bench.state(name), "OP", "{name}");
        }
        assert_eq!(place(&bench, 0), Some((bench.id("J1"), Port::D)));
        bench.run_for(Span::ms(50));
        assert!(bench.device.quality(x1).valid);
        bench.segment.unplug(bench.now, "X").unwrap();
        let left = |event: &Event| matches!(event, Event::GroupLeft { group: 0 });
        assert!(bench.run_until(Span::s(1), left), "{}", story(&bench));
        assert_eq!(place(&bench, 0), None);
        bench.run_for(Span::ms(300));
    }
    assert!(bench.cycles > 5_000, "{}", bench.cycles);
    assert_eq!(bench.bad_cycles, 0);
    assert_eq!(disturbances(&bench, &plan), before, "{}", story(&bench));
}

// proves: HC-02 (S)
#[test]
fn the_same_group_joins_at_two_places_and_two_groups_at_once() {
    let plan = plan(PLANT, &TOOLS);
    let mut bench = running(PLANT, &plan, &["X", "Y"]);
    bench.judged = Some(bench.id("T1"));
    for (on, above, port) in [("J1.D", "J1", Port::D), ("K2.C", "K2", Port::C)] {
        plug(&mut bench, "X", Some(on));
        assert!(bench.run_until(Span::s(10), joined(0)), "{on}: {}", story(&bench));
        assert_eq!(place(&bench, 0), Some((bench.id(above), port)));
        assert_eq!(bench.state("X2"), "OP");
        bench.segment.unplug(bench.now, "X").unwrap();
        bench.run_for(Span::ms(300));
    }
    // Each where the other one was planned.
    plug(&mut bench, "Y", Some("J1.D"));
    plug(&mut bench, "X", Some("K2.C"));
    bench.run_for(Span::s(6));
    assert_eq!(place(&bench, 0), Some((bench.id("K2"), Port::C)));
    assert_eq!(place(&bench, 1), Some((bench.id("J1"), Port::D)));
    for name in ["X", "X1", "X2", "Y", "Y1"] {
        assert_eq!(bench.state(name), "OP", "{name}: {}", story(&bench));
    }
    let status = bench.device.network_status().unwrap();
    assert_eq!(status.hot_connect_counts(), (5, 5));
    assert_eq!(bench.bad_cycles, 0);
}

#[test]
fn a_running_line_counts_the_subdevices_of_groups_that_are_there() {
    let plan = plan(PLANT, &TOOLS);
    let mut bench = running(PLANT, &plan, &["X", "Y"]);
    let names = |bench: &Bench| -> Vec<String> {
        let order = bench.device.network_status().unwrap().topology_order();
        order.into_iter().map(|id| bench.segment.name(id).to_owned()).collect()
    };
    let expected = ["K1", "T1", "J1", "K2", "T2", "X", "X1", "X2", "Y", "Y1"];
    assert_eq!(names(&bench), expected);
    let counts = |bench: &Bench| bench.device.network_status().unwrap().hot_connect_counts();
    assert_eq!(counts(&bench), (5, 0));
    plug(&mut bench, "Y", None);
    assert!(bench.run_until(Span::s(10), joined(1)));
    assert_eq!(counts(&bench), (5, 2));
    assert_eq!(names(&bench), expected);
}

// S0 L2609-2616, S1 L1225-1257.
// proves: PLC-10 (S)
#[test]
fn topology_list_of_a_running_line_has_neighbours_and_says_which_group_is_there() {
    let plan = plan(PLANT, &TOOLS);
    let mut bench = running(PLANT, &plan, &["X", "Y"]);
    let word = |bytes: &[u8; 64], at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
    let entries = |bench: &Bench| -> Vec<(String, [u8; 64])> {
        let list = bench.device.network_status().unwrap().topology(&plan);
        let name = |id| bench.segment.name(id).to_owned();
        list.iter().map(|entry| (name(entry.id), entry.to_bytes())).collect()
    };
    let of = |bench: &Bench, name: &str| {
        entries(bench).into_iter().find(|(of, _)| of == name).expect("it is planned").1
    };
    assert_eq!(entries(&bench).len(), 10);
    let station = |name: &str, bench: &Bench| plan.device(bench.id(name)).unwrap().station.0;
    let (k1, k2) = (of(&bench, "K1"), of(&bench, "K2"));
    assert_eq!(word(&k1, 0), station("K1", &bench), "its own station address");
    // Ports A to D: the MainDevice, the terminals, the other coupler, none.
    let neighbours = [0, station("T1", &bench), station("K2", &bench), 0];
    assert_eq!([4, 6, 8, 10].map(|at| word(&k1, at)), neighbours);
    assert_eq!(word(&k2, 4), station("K1", &bench), "the other end of that cable");
    // There, in a group, first of one; and how many of groups are planned and there.
    let state = |bench: &Bench, name: &str| {
        let bytes = of(bench, name);
        (bytes[36] & 0b1_1100, word(&bytes, 40), word(&bytes, 42))
    };
    assert_eq!(state(&bench, "T1"), (4, 5, 0));
    assert_eq!(state(&bench, "Y"), (8 | 16, 5, 0), "planned, not there");
    plug(&mut bench, "Y", None);
    assert!(bench.run_until(Span::s(10), joined(1)));
    bench.run_for(Span::s(1));
    assert_eq!(state(&bench, "Y"), (4 | 8 | 16, 5, 2));
    assert_eq!(state(&bench, "Y1"), (4 | 16, 5, 2));
    assert_eq!(state(&bench, "X"), (8 | 16, 5, 2));
    bench.segment.unplug(bench.now, "Y").unwrap();
    bench.run_for(Span::ms(500));
    assert_eq!(state(&bench, "Y"), (8 | 16, 5, 0), "{}", story(&bench));
}

/// The events of a plant that is started with all plugged in, whose numbers are otherwise than planned.
fn started_otherwise(plan: &Plan, toml: &str) -> Bench {
    let mut bench = Bench::new(toml);
    bench.device.start(bench.now, plan.clone());
    bench.run_for(Span::s(8));
    bench
}

pub(crate) fn first<'a, T>(bench: &'a Bench, is: impl Fn(&'a Event) -> Option<T>) -> Option<T> {
    bench.events.iter().find_map(|(_, event)| is(event))
}

#[test]
fn a_group_with_a_wrong_or_missing_number_is_named_and_stays_in_init() {
    let plan = plan(PLANT, &TOOLS);
    for (id, found) in [("id = 9", 9), ("", 0)] {
        let bench = started_otherwise(&plan, &PLANT.replace("id = 5", id));
        let told = first(&bench, |event| {
            let Event::WrongIdentification { id, check, found, .. } = event else { return None };
            Some((*id, check.value, *found))
        });
        assert_eq!(told, Some((bench.id("X"), 5, Some(found))), "{}", story(&bench));
        for (name, state) in [("X", "INIT"), ("X1", "INIT"), ("Y1", "OP"), ("T2", "OP")] {
            assert_eq!(bench.state(name), state, "{name}");
        }
    }
}

#[test]
fn of_two_groups_with_one_number_none_that_is_new_is_taken() {
    let plan = plan(PLANT, &TOOLS);
    let doubled = PLANT.replace("id = 6", "id = 5");
    let shared = |bench: &Bench| {
        first(bench, |event| {
            let Event::IdentificationShared { id, count, .. } = event else { return None };
            Some((*id, *count))
        })
    };
    let bench = started_otherwise(&plan, &doubled);
    assert_eq!(shared(&bench), Some((bench.id("X"), 2)), "{}", story(&bench));
    for (name, state) in [("X", "INIT"), ("X1", "INIT"), ("Y", "INIT"), ("T2", "OP")] {
        assert_eq!(bench.state(name), state, "{name}");
    }
    // One is there already: it goes on.
    let mut bench = running(&doubled, &plan, &["Y"]);
    assert_eq!(bench.state("X1"), "OP");
    plug(&mut bench, "Y", None);
    bench.run_for(Span::s(6));
    assert_eq!(shared(&bench), Some((bench.id("X"), 2)));
    for (name, state) in [("X1", "OP"), ("Y", "INIT"), ("Y1", "INIT"), ("T2", "OP")] {
        assert_eq!(bench.state(name), state, "{name}");
    }
}

#[test]
fn a_group_at_a_port_where_it_may_not_be_is_named_and_stays_in_init() {
    let wanted = Wanted { places: vec![End::Controller(2, Port::D)], ..TOOLS };
    let plan = plan(PLANT, &wanted);
    let mut bench = running(PLANT, &plan, &["X", "Y"]);
    plug(&mut bench, "X", Some("K2.C"));
    bench.run_for(Span::s(6));
    let told = first(&bench, |event| {
        let Event::GroupMisplaced { group, place } = event else { return None };
        Some((*group, *place))
    });
    assert_eq!(told, Some((0, Some((bench.id("K2"), Port::C)))), "{}", story(&bench));
    assert_eq!(bench.state("X1"), "INIT");
    bench.segment.unplug(bench.now, "X").unwrap();
    bench.run_for(Span::s(1));
    plug(&mut bench, "X", Some("J1.D"));
    assert!(bench.run_until(Span::s(10), joined(0)), "{}", story(&bench));
}

// proves: HC-05 (S)
#[test]
fn the_number_holds_through_new_addresses_another_place_and_loss_of_power() {
    let with_off = format!(
        "{PLANT}[[fault]]\nkind = \"device-off\"\ndevice = \"X\"\nfrom_ms = 20000\nto_ms = 21000\n"
    );
    let plan = plan(PLANT, &TOOLS);
    let mut bench = running(&with_off, &plan, &["Y"]);
    bench.segment.unplug(bench.now, "X").unwrap();
    bench.run_for(Span::s(1));
    plug(&mut bench, "X", Some("K2.C"));
    assert!(bench.run_until(Span::s(10), joined(0)), "{}", story(&bench));
    let off = Instant::ZERO + Span::ms(20_500);
    bench.run_for(off.since(bench.now));
    assert!(!bench.device.quality(bench.id("X1")).valid);
    assert!(bench.run_until(Span::s(10), joined(0)), "{}", story(&bench));
    assert_eq!(place(&bench, 0), Some((bench.id("K2"), Port::C)));
    assert_eq!(bench.state("X2"), "OP");
}

/// Two equal drives in a row, told apart in one of three ways.
fn drives(first: u16, second: u16) -> String {
    let drive = |name: &str, on: &str, id: u16| {
        format!(
            "[[device]]\nname = \"{name}\"\ntype = \"CiA402-Drive\"\non = \"{on}\"\nid = {id}\n"
        )
    };
    format!(
        "[[device]]\nname = \"K\"\ntype = \"EK1100\"\non = \"maindevice\"\n{}{}",
        drive("A", "K.C", first),
        drive("B", "A.B", second)
    )
}

// proves: HC-04 (S), HC-14 (S)
#[test]
fn two_equal_drives_that_were_exchanged_are_found_out_and_neither_moves() {
    let wanted = Wanted { numbers: &[("A", 11), ("B", 12)], ..Wanted::default() };
    let plan = plan(&drives(11, 12), &wanted);
    let bench = started_otherwise(&plan, &drives(11, 12));
    assert_eq!(["A", "B"].map(|name| bench.state(name)), ["OP"; 2].map(str::to_owned));
    let bench = started_otherwise(&plan, &drives(12, 11));
    let told: Vec<_> = (bench.events.iter())
        .filter_map(|(_, event)| {
            let Event::WrongIdentification { id, found, belongs_to, .. } = event else {
                return None;
            };
            Some((*id, *found, *belongs_to))
        })
        .collect();
    let (a, b) = (bench.id("A"), bench.id("B"));
    assert_eq!(told, [(a, Some(12), Some(b)), (b, Some(11), Some(a))], "{}", story(&bench));
    assert_eq!(["A", "B"].map(|name| bench.state(name)), ["INIT"; 2].map(str::to_owned));
    let names = |id: DeviceId| bench.segment.name(id).to_owned();
    let said: Vec<String> =
        bench.events.iter().flat_map(|(_, event)| event.state_lines(names)).collect();
    let said = said.iter().find(|line| line.starts_with("A: its ")).unwrap();
    assert!(said.contains("must be 11, found 12, that of B: they may be exchanged"), "{said}");
}

#[test]
fn a_number_that_is_not_compulsory_is_told_and_the_subdevice_driven_all_the_same() {
    let numbers = &[("A", 11), ("B", 12)];
    let wanted = Wanted { numbers, only_told: true, ..Wanted::default() };
    let plan = plan(&drives(11, 12), &wanted);
    let bench = started_otherwise(&plan, &drives(12, 11));
    let is_told = |event: &Event| matches!(event, Event::WrongIdentification { .. });
    assert_eq!(bench.events.iter().filter(|(_, event)| is_told(event)).count(), 2);
    assert_eq!(["A", "B"].map(|name| bench.state(name)), ["OP"; 2].map(str::to_owned));
}

// proves: HC-06 (S)
#[test]
fn a_selector_is_read_in_three_ways_of_which_the_description_chooses() {
    for (kind, is_expected) in [
        ("EK1101", (|source| matches!(source, IdentificationSource::Memory(_))) as fn(_) -> bool),
        ("EL3104", |source| source == IdentificationSource::AlStatus),
        ("EL1008", |source| source == IdentificationSource::Alias),
    ] {
        let line = |id: u16| {
            let on = if kind == "EK1101" { "K.C" } else { "K.B" };
            format!(
                "[[device]]\nname = \"K\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
                 [[device]]\nname = \"A\"\ntype = \"{kind}\"\non = \"{on}\"\nid = {id}\n"
            )
        };
        let wanted = Wanted { numbers: &[("A", 300)], ..Wanted::default() };
        let plan = plan(&line(300), &wanted);
        let check = plan.devices[1].settings.identification.unwrap();
        assert!(is_expected(check.source), "{kind}: {}", check.source);
        assert_eq!(started_otherwise(&plan, &line(300)).state("A"), "OP", "{kind}");
        assert_eq!(started_otherwise(&plan, &line(301)).state("A"), "INIT", "{kind}");
    }
}

/// A junction with fast connecting ports, and one with usual ones; a tool at each.
const FAST: &str = r#"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "J1"
type = "EK1122-0080"
on = "K1.B"
[[device]]
name = "X"
type = "EK1101-0080"
on = "J1.D"
id = 5
[[device]]
name = "X1"
type = "EL1008"
on = "X.B"
[[device]]
name = "Y"
type = "EK1101"
on = "K1.C"
id = 6
[[device]]
name = "Y1"
type = "EL1008"
on = "Y.B"
"#;

// proves: HC-12 (S)
#[test]
fn a_group_at_a_fast_port_is_in_op_before_a_usual_link_is_up() {
    let wanted = Wanted {
        groups: &[("X", 2), ("Y", 2)],
        numbers: &[("X", 5), ("Y", 6)],
        ..Wanted::default()
    };
    let plan = plan(FAST, &wanted);
    let mut bench = running(FAST, &plan, &["X", "Y"]);
    let took = |bench: &mut Bench, name: &str, group: usize| {
        let plugged = bench.now;
        plug(bench, name, None);
        let answers = |event: &Event| matches!(event, Event::Responding { .. });
        assert!(bench.run_until(Span::s(10), answers), "{}", story(bench));
        let connected = bench.now.since(plugged);
        assert!(bench.run_until(Span::s(10), joined(group)), "{}", story(bench));
        (connected, bench.now.since(plugged))
    };
    let ((link, fast), (usual_link, usual)) = (took(&mut bench, "X", 0), took(&mut bench, "Y", 1));
    assert!(link < Span::ms(20) && usual_link > Span::ms(500), "{link}, {usual_link}");
    assert!(fast < Span::ms(300), "{fast}");
    assert!(usual > Span::s(1), "{usual}");
}

// proves: HC-11 (S)
#[test]
fn a_branch_in_a_sync_unit_of_its_own_is_removed_and_the_rest_runs() {
    let mut bench = Bench::new(PLANT);
    let inventory = bench.scan();
    let mut planned = inventory.planned(AlState::Op);
    for name in ["X", "X1", "X2"] {
        planned[bench.id(name).index()].settings.sync_unit = Some("RemovableBranch".to_owned());
    }
    let plan = Plan::build(&planned, inventory.tree().clone(), &PlanOptions::default()).unwrap();
    let mut bench = running(PLANT, &plan, &[]);
    bench.judged = Some(bench.id("T2"));
    bench.segment.unplug(bench.now, "X").unwrap();
    bench.run_for(Span::s(1));
    assert!(!bench.device.quality(bench.id("X1")).valid);
    plug(&mut bench, "X", None);
    bench.run_for(Span::s(6));
    assert!(bench.device.quality(bench.id("X1")).valid);
    assert_eq!((bench.bad_cycles, bench.cycles > 6_000), (0, true));
    let count = bench.device.network_status().unwrap().responding();
    assert_eq!(count, Some(WorkingCounter(10)));
}

// proves: RED-13 (S)
#[test]
fn a_group_joins_and_leaves_while_the_ring_is_open_and_when_it_is_closed_again() {
    let ring = format!("[ring]\ncloses_at = \"K2.C\"\n{PLANT}");
    let plan = plan(&ring, &TOOLS);
    let mut bench = running(&ring, &plan, &["X", "Y"]);
    bench.judged = Some(bench.id("T2"));
    let cut = FaultEntry::new("link-open".parse().unwrap()).at("K1.C-K2.A");
    let fault = bench.segment.inject(bench.now, &cut).unwrap();
    bench.run_for(Span::s(1));
    // The cut itself may cost one cycle.
    assert!(bench.bad_cycles <= 1, "{}", bench.bad_cycles);
    let before = bench.bad_cycles;
    for is_open in [true, false] {
        if !is_open {
            bench.segment.heal(bench.now, fault);
            bench.run_for(Span::s(4));
        }
        let mended = bench.bad_cycles;
        assert!(mended <= before + 1, "{mended}");
        plug(&mut bench, "X", None);
        assert!(bench.run_until(Span::s(10), joined(0)), "{is_open}: {}", story(&bench));
        assert_eq!(["X", "X2", "T2"].map(|name| bench.state(name)), ["OP"; 3].map(str::to_owned));
        bench.segment.unplug(bench.now, "X").unwrap();
        bench.run_for(Span::ms(500));
        assert_eq!(bench.bad_cycles, mended, "{is_open}: {}", story(&bench));
    }
}
