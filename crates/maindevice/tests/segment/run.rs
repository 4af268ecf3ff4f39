//! Running a plant: to OP, process data both ways, faults and what becomes of them.

use crate::bench::{Bench, Fate};
use linesman_config::fault::FaultName;
use linesman_config::plan::{self, Plan};
use linesman_maindevice::{Event, Options, ProbeRequest, Target};
use linesman_proto::port::Port;
use linesman_proto::register::{DL_STATUS, PortState};
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use linesman_sim::seed::Seed;
use linesman_sim::segment_file::{FaultEntry, PlantOptions, plant};

/// Outputs of T2 wired to nothing, inputs of T1 driven by nobody; smart devices at the end.
const PLANT: &str = r#"
name = "plant"
seed = 5
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
name = "T4"
type = "EL4102"
on = "T3.B"
[[device]]
name = "K2"
type = "EK1100"
on = "K1.C"
[[device]]
name = "T5"
type = "EL2008"
on = "K2.B"
[[device]]
name = "T6"
type = "EL1004"
on = "T5.B"
[[device]]
name = "T7"
type = "EL7041"
on = "T6.B"
[[device]]
name = "T8"
type = "EL2014"
on = "T7.B"
"#;

fn fault(kind: &str) -> FaultEntry {
    let name: FaultName = toml_name(kind);
    FaultEntry::new(name)
}

fn toml_name(kind: &str) -> FaultName {
    kind.parse().expect("a fault name")
}

fn count(bench: &Bench, which: impl Fn(&Event) -> bool) -> usize {
    bench.events.iter().filter(|(_, event)| which(event)).count()
}

// proves: FRM-16 partial: against full controllers
#[test]
fn a_plant_of_ten_comes_to_op_and_stays_there() {
    let mut bench = Bench::new(PLANT);
    bench.start(AlState::Op);
    for name in ["K1", "T1", "T2", "T3", "T4", "K2", "T5", "T6", "T7", "T8"] {
        assert_eq!(bench.state(name), "OP", "{name}");
    }
    bench.events.clear();
    let before = bench.device.statistics();
    bench.run_for(Span::s(2));
    let after = bench.device.statistics();
    assert_eq!(after.cycles - before.cycles, 2000);
    assert_eq!(after.working_counter_errors, before.working_counter_errors);
    assert_eq!(after.frames_lost, before.frames_lost);
    assert!(bench.device.is_settled());
    let trouble =
        count(&bench, |event| !matches!(event, Event::Links { .. } | Event::Counters { .. }));
    assert_eq!(trouble, 0, "{:#?}", bench.events);
}

// proves: FRM-15 partial: on LRW
#[test]
fn process_data_go_both_ways() {
    let mut bench = Bench::new(PLANT);
    let plan = bench.start(AlState::Op);
    let id = bench.id("T2");
    let outputs = plan.device(id).unwrap().outputs.clone();
    assert_eq!(outputs.len(), 1);
    bench.device.outputs_mut()[outputs.start] = 0b0101;
    let inputs = plan.device(bench.id("T1")).unwrap().inputs.clone();
    assert_eq!(bench.device.inputs()[inputs.start], 0);
    let signals = bench.segment.inputs(bench.id("T1")).to_vec();
    bench.segment.signals_mut().set(signals[3], 1);
    bench.run_for(Span::ms(5));
    let driven: Vec<i32> = bench
        .segment
        .outputs(id)
        .iter()
        .map(|signal| bench.segment.signals().value(*signal))
        .collect();
    assert_eq!(driven, [1, 0, 1, 0]);
    assert_eq!(bench.device.inputs()[inputs.start], 0b1000);
}

// proves: FRM-29
#[test]
fn a_cut_loses_what_is_behind_it_and_healing_brings_it_back() {
    let mut bench = Bench::new(PLANT);
    bench.start(AlState::Op);
    bench.events.clear();
    let entry = fault("link-open").at("K1.C-K2.A");
    let cut = bench.segment.inject(bench.now, &entry).unwrap();
    bench.run_for(Span::s(1));
    let behind = ["K2", "T5", "T6", "T7", "T8"].map(|name| bench.id(name));
    for id in behind {
        let lost =
            count(&bench, |event| matches!(event, Event::DeviceLost { id: lost } if *lost == id));
        assert_eq!(lost, 1, "{id}");
    }
    assert_eq!(count(&bench, |event| matches!(event, Event::DeviceLost { .. })), 5);
    assert_eq!(bench.state("T2"), "OP");
    // The port towards the cut is closed.
    let closed = |event: &Event| {
        matches!(event, Event::Links { id, status }
            if id.no() == 1 && status.port_state(Port::C) == PortState::UNUSED)
    };
    assert_eq!(count(&bench, closed), 1);
    // The working counter was short until it was clear who is missing.
    let short = |event: &Event| matches!(event, Event::WorkingCounter { expected, received, .. } if received < expected);
    assert!(count(&bench, short) > 0);
    assert!(count(&bench, |event| matches!(event, Event::WorkingCounterGood { .. })) > 0);
    let before = bench.device.statistics().working_counter_errors;
    assert!(before < 50, "{before} cycles until it was clear");
    bench.run_for(Span::ms(100));
    assert_eq!(bench.device.statistics().working_counter_errors, before);
    bench.events.clear();
    bench.segment.heal(bench.now, cut);
    bench.run_for(Span::s(6));
    assert!(bench.device.is_settled(), "{:#?}", bench.events);
    for name in ["K2", "T5", "T6", "T7", "T8"] {
        assert_eq!(bench.state(name), "OP", "{name}");
    }
    assert_eq!(
        count(&bench, |event| matches!(event, Event::DeviceBack { restarted: false, .. })),
        5
    );
    let before = bench.device.statistics().working_counter_errors;
    bench.run_for(Span::ms(500));
    assert_eq!(bench.device.statistics().working_counter_errors, before);
}

#[test]
fn the_first_cable_cut_and_healed() {
    let mut bench = Bench::new(PLANT);
    bench.start(AlState::Op);
    let cut = bench.segment.inject(bench.now, &fault("link-open").at("maindevice-K1.A")).unwrap();
    bench.run_for(Span::s(1));
    assert_eq!(count(&bench, |event| matches!(event, Event::DeviceLost { .. })), 10);
    assert_eq!(count(&bench, |event| matches!(event, Event::CyclicFramesLost { .. })), 1);
    bench.segment.heal(bench.now, cut);
    bench.run_for(Span::s(8));
    assert!(
        bench.device.is_settled(),
        "{:#?}",
        bench.events.iter().rev().take(40).collect::<Vec<_>>()
    );
    assert_eq!(bench.state("T8"), "OP");
}

#[test]
fn a_device_that_was_without_power_is_addressed_and_set_up_anew() {
    let mut bench = Bench::new(PLANT);
    bench.start(AlState::Op);
    bench.events.clear();
    let off = bench.segment.inject(bench.now, &fault("device-off").device("T8")).unwrap();
    bench.run_for(Span::s(1));
    let id = bench.id("T8");
    assert_eq!(
        count(&bench, |event| matches!(event, Event::DeviceLost { id: lost } if *lost == id)),
        1
    );
    bench.segment.heal(bench.now, off);
    bench.run_for(Span::s(8));
    assert_eq!(
        count(&bench, |event| matches!(event, Event::DeviceBack { restarted: true, .. })),
        1
    );
    assert_eq!(bench.state("T8"), "OP", "{:#?}", bench.events);
    assert!(bench.device.is_settled());
}

#[test]
fn a_brown_out_is_noticed_and_made_good() {
    let mut bench = Bench::new(PLANT);
    bench.start(AlState::Op);
    bench.events.clear();
    bench.segment.inject(bench.now, &fault("brown-out").device("T7")).unwrap();
    bench.run_for(Span::s(10));
    assert!(count(&bench, |event| matches!(event, Event::DeviceLost { .. })) > 0);
    for name in ["T6", "T7", "T8"] {
        assert_eq!(bench.state(name), "OP", "{name} {:#?}", bench.events);
    }
    assert!(bench.device.is_settled());
}

#[test]
fn a_refusal_is_reported_and_tried_again_more_and_more_seldom() {
    let mut bench = Bench::new(PLANT);
    let entry = fault("init-refused").device("T3");
    let refused = bench.segment.inject(bench.now, &entry).unwrap();
    let inventory = bench.scan();
    let tree = inventory.tree().clone();
    let plan = Plan::build(&inventory.planned(AlState::Op), tree, &plan::PlanOptions::default());
    bench.device.start(bench.now, plan.unwrap());
    bench.run_for(Span::s(12));
    let id = bench.id("T3");
    let refusals: Vec<_> = bench
        .events
        .iter()
        .filter(|(_, event)| matches!(event, Event::Refused { id: which, .. } if *which == id))
        .map(|(at, _)| *at)
        .collect();
    assert!((3..=6).contains(&refusals.len()), "{refusals:?}");
    assert_eq!(bench.state("T8"), "OP");
    assert!(!bench.device.is_settled());
    assert_eq!(count(&bench, |event| matches!(event, Event::AllReached)), 0);
    bench.segment.heal(bench.now, refused);
    bench.run_for(Span::s(25));
    assert_eq!(bench.state("T3"), "OP");
    assert_eq!(count(&bench, |event| matches!(event, Event::AllReached)), 1);
}

/// A controller with device emulation shows its refusal, too; and what the others give goes on.
#[test]
fn a_stuck_device_does_not_stop_the_inputs_of_the_others() {
    let mut bench = Bench::new(PLANT);
    let inventory = bench.scan();
    let tree = inventory.tree().clone();
    let plan = Plan::build(&inventory.planned(AlState::Op), tree, &plan::PlanOptions::default());
    let plan = plan.unwrap();
    for (name, to) in [("T2", "SAFEOP"), ("T4", "OP")] {
        let entry = fault("init-refused").device(name).with("to", to);
        bench.segment.inject(bench.now, &entry).unwrap();
    }
    bench.device.start(bench.now, plan.clone());
    bench.run_for(Span::s(3));
    for name in ["T2", "T4"] {
        let id = bench.id(name);
        let refused = |event: &Event| matches!(event, Event::Refused { id: it, .. } if *it == id);
        assert!(count(&bench, refused) > 0, "{name}");
    }
    assert_eq!(bench.state("T1"), "OP");
    let inputs = plan.device(bench.id("T1")).unwrap().inputs.clone();
    let signals = bench.segment.inputs(bench.id("T1")).to_vec();
    bench.segment.signals_mut().set(signals[0], 1);
    bench.run_for(Span::ms(5));
    assert_eq!(bench.device.inputs()[inputs.start], 1);
    assert_eq!(count(&bench, |event| matches!(event, Event::WorkingCounter { .. })), 0);
}

#[test]
fn one_of_thirty_frames_lost_does_not_stop_a_start() {
    let mut bench = Bench::new(PLANT);
    bench.tamper =
        Some(Box::new(|number| if number % 31 == 0 { Fate::Lost } else { Fate::Arrives }));
    bench.start(AlState::Op);
    assert_eq!(count(&bench, |event| matches!(event, Event::DeviceLost { .. })), 0);
    assert!(bench.device.statistics().frames_lost > 10);
}

#[test]
fn stopping_leaves_all_in_the_state_that_was_asked_for() {
    let mut bench = Bench::new(PLANT);
    bench.start(AlState::Op);
    bench.device.stop(bench.now, AlState::Init);
    assert!(bench.run_until(Span::s(6), |event| matches!(event, Event::Stopped)));
    for name in ["K1", "T3", "T8"] {
        assert_eq!(bench.state(name), "INIT", "{name}");
    }
}

/// A plan made of the healthy line, started on a line where something is otherwise.
fn started_on(other: &str) -> Bench {
    let mut healthy = Bench::new(PLANT);
    let inventory = healthy.scan();
    let tree = inventory.tree().clone();
    let plan = Plan::build(&inventory.planned(AlState::Op), tree, &plan::PlanOptions::default())
        .expect("a plan");
    let mut bench = Bench::new(&format!("{PLANT}{other}"));
    bench.device.start(bench.now, plan);
    bench.run_for(Span::s(3));
    bench
}

#[test]
fn a_missing_device_is_named_and_the_others_run() {
    let bench = started_on("[[fault]]\nkind = \"device-missing\"\ndevice = \"T3\"\n");
    let lost: Vec<_> = (bench.events.iter())
        .filter_map(
            |(_, event)| if let Event::DeviceLost { id } = event { Some(id.no()) } else { None },
        )
        .collect();
    assert_eq!(lost, [4]);
    let reached = count(&bench, |event| matches!(event, Event::TargetReached { .. }));
    assert_eq!(reached, 9);
    for name in ["T2", "T4", "T8"] {
        assert_eq!(bench.state(name), "OP", "{name}");
    }
}

#[test]
fn an_extra_device_is_told_once_and_left_alone() {
    let bench = started_on(
        "[[fault]]\nkind = \"device-missing\"\ndevice = \"T5\"\n\
         [[device]]\nname = \"X\"\ntype = \"EL3004\"\non = \"T8.B\"\n\
         [[device]]\nname = \"Y\"\ntype = \"EL1018\"\non = \"X.B\"\n",
    );
    let extra = count(&bench, |event| matches!(event, Event::UnplannedDevice { .. }));
    assert_eq!(extra, 2, "{:#?}", bench.events);
    assert_eq!((bench.state("X"), bench.state("T8")), ("INIT".to_owned(), "OP".to_owned()));
}

// proves: HC-03 partial: by position, without serial
#[test]
fn a_wrong_device_is_told_from_the_planned_one_and_not_driven() {
    let bench =
        started_on("[[fault]]\nkind = \"device-wrong\"\ndevice = \"T3\"\ntype = \"EL3104\"\n");
    let wrong: Vec<_> = (bench.events.iter())
        .filter_map(|(_, event)| {
            let Event::WrongDevice { id, mismatch, .. } = event else { return None };
            Some((id.no(), *mismatch))
        })
        .collect();
    assert!(wrong.contains(&(4, linesman_config::identity::Mismatch::Product)), "{wrong:?}");
    assert_eq!(bench.state("T3"), "INIT");
    assert_eq!(bench.state("T8"), "OP");
}

/// The wiring that a scan derives is the one that there is, and all of it comes to OP.
#[test]
fn random_plants_are_scanned_right_and_run() {
    for seed in 0..6 {
        let options = PlantOptions { min_devices: 3, max_devices: 40, ..PlantOptions::default() };
        let file = plant(Seed(seed), &options);
        let mut bench = Bench::of(&file, Options::default());
        let inventory = bench.scan();
        let really = bench.segment.tree();
        assert_eq!(inventory.devices.len(), really.len(), "seed {seed}");
        for (node, place) in really.order().iter().enumerate() {
            let upstream = really.upstream(*place).map(|end| end.map(|at| really.position(at)));
            let found = inventory.tree().upstream(node).map(|end| end.map(Some));
            assert_eq!(found, upstream, "seed {seed}, position {node}");
        }
        bench.start(AlState::Op);
    }
}

#[test]
fn a_probe_reads_beside_the_cycle() {
    let mut bench = Bench::new(PLANT);
    let plan = bench.start(AlState::Op);
    let station = plan.device(bench.id("T2")).unwrap().station;
    let target = Target::Station(station);
    let request = ProbeRequest { target, register: DL_STATUS.address, len: 2, write: None };
    bench.device.probe(bench.now, request.clone());
    assert!(bench.run_until(Span::ms(10), |event| matches!(event, Event::Probed { .. })));
    let Some((_, Event::Probed { request: asked, result })) = bench.events.pop() else { panic!() };
    assert_eq!(asked, request);
    let status = bench.segment.controller(bench.id("T2")).unwrap().dl_status();
    assert_eq!(result.unwrap().word(0), status.value());
}

#[test]
fn a_plan_can_be_started_over_and_over() {
    let mut bench = Bench::new(PLANT);
    let plan = bench.start(AlState::Op);
    for _ in 0..3 {
        // In the middle of a cycle, with a frame out.
        bench.run_for(Span::us(10_020));
        bench.events.clear();
        bench.device.start(bench.now, plan.clone());
        assert!(bench.run_until(Span::s(10), |event| matches!(event, Event::AllReached)));
        assert_eq!(count(&bench, |event| matches!(event, Event::WorkingCounter { .. })), 0);
    }
    assert_eq!(bench.state("T8"), "OP");
}

// S0 L108-113, S3 L17: behind the registers lies memory for process data and mailboxes, which MainDevice and
// SubDevice both read and write.
// proves: ESC-10
#[test]
fn process_data_and_mailboxes_lie_behind_the_registers_and_both_sides_use_them() {
    let device = |name: &str, kind: &str, on: &str| {
        format!("[[device]]\nname = \"{name}\"\ntype = \"{kind}\"\non = \"{on}\"\n")
    };
    let plant = device("K1", "EK1100", "maindevice")
        + &device("A1", "EL3102", "K1.B")
        + &device("O1", "EL4102", "A1.B");
    let mut bench = Bench::new(&plant);
    let plan = bench.start(AlState::Op);
    for name in ["A1", "O1"] {
        let device = plan.device(bench.id(name)).unwrap();
        let managers = device.sync_managers.iter().map(|(_, manager)| manager.start.0);
        let areas = device.mailbox.as_ref().unwrap().areas;
        let mailboxes = [areas.receive.offset.0, areas.send.offset.0];
        let starts: Vec<u16> = managers.chain(mailboxes).collect();
        assert!(starts.len() >= 3 && starts.iter().all(|start| *start >= 0x1000), "{starts:04X?}");
    }
    // What the SubDevice puts there the MainDevice reads.
    let (inputs, outputs) = (bench.id("A1"), bench.id("O1"));
    let place = plan.device(inputs).unwrap().inputs.clone();
    let seen = |bench: &Bench| bench.device.inputs()[place.clone()].to_vec();
    let before = seen(&bench);
    let signal = bench.segment.inputs(inputs)[0];
    bench.segment.signals_mut().set(signal, 0x1234);
    bench.run_for(Span::ms(50));
    assert_ne!(seen(&bench), before);
    // What the MainDevice puts there the SubDevice reads.
    let place = plan.device(outputs).unwrap().outputs.clone();
    let signal = bench.segment.outputs(outputs)[0];
    let driven = |bench: &Bench| bench.segment.signals().value(signal);
    assert_eq!(driven(&bench), 0);
    bench.device.outputs_mut()[place].fill(0x11);
    bench.run_for(Span::ms(50));
    assert_eq!(driven(&bench), 0x1111);
}
