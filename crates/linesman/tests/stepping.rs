//! Runs whose caller takes the cycles one by one.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use linesman::prelude::*;
use linesman::{FaultEntry, FaultName, FindingChange};
use linesman_config::project::Project;

const DEVICES: [(&str, &str); 3] = [("K1", "EK1100"), ("Buttons", "EL1008"), ("Lamps", "EL2008")];

fn machine() -> (Segment, Plan) {
    let file = SegmentFile::in_a_row("machine", 1, &DEVICES);
    let mut segment = Segment::simulated(&file).unwrap();
    let plan = segment.scan().unwrap().plan().unwrap();
    (segment, plan)
}

/// InputsOf and time of each of the first cycles, with outputs that count.
fn stepped(options: RunOptions) -> Vec<(u64, Vec<u8>)> {
    let (mut segment, plan) = machine();
    let mut run = segment.start(plan, options).unwrap();
    let mut seen = Vec::new();
    while let Some(mut io) = run.cycle() {
        seen.push((io.now().as_nanos(), io.inputs().to_vec()));
        io.outputs_mut().fill(seen.len() as u8);
        if seen.len() == 500 {
            break;
        }
    }
    run.stop().unwrap();
    seen
}

fn called(options: RunOptions) -> Vec<(u64, Vec<u8>)> {
    let (mut segment, plan) = machine();
    let mut seen = Vec::new();
    let run = segment.run(plan, options, |io| {
        seen.push((io.now().as_nanos(), io.inputs().to_vec()));
        io.outputs_mut().fill(seen.len() as u8);
        if seen.len() < 500 { Next::Continue } else { Next::Stop }
    });
    run.unwrap();
    seen
}

#[test]
fn stepped_run_sees_the_same_bytes_at_the_same_times_as_one_that_is_called() {
    for options in [RunOptions::us(1_000), RunOptions::us(1_000).exchange_at_end()] {
        let (stepped, called) = (stepped(options), called(options));
        assert!(stepped.iter().any(|(_, inputs)| inputs.iter().any(|byte| *byte != 0)));
        assert_eq!(stepped, called, "{options:?}");
    }
}

#[test]
fn times_of_each_cycle_rise_and_follow_those_of_the_cycle_before() {
    for options in [RunOptions::us(1_000), RunOptions::us(1_000).exchange_at_end()] {
        let (mut segment, plan) = machine();
        let mut run = segment.start(plan, options).unwrap();
        let mut before = None;
        for _ in 0..500 {
            let times = run.cycle().unwrap().times();
            assert!(
                times.task_start <= times.base_tick && times.base_tick <= times.now,
                "{times:?}"
            );
            assert!(times.now.0 - times.task_start.0 < 1_000_000, "{times:?}");
            if let Some(before) = before.replace(times) {
                assert!(
                    before.now < times.now && before.task_start < times.task_start,
                    "{times:?}"
                );
            }
        }
        run.stop().unwrap();
    }
}

#[test]
fn fault_that_is_injected_between_two_cycles_opens_and_closes_a_finding() {
    let (mut segment, plan) = machine();
    let simulation = segment.simulation().unwrap();
    let mut run = segment.start(plan, RunOptions::us(1_000).diagnosed()).unwrap();
    let (mut fault, mut changes) = (None, Vec::new());
    for cycle in 0..6_000 {
        assert!(run.cycle().is_some());
        if cycle == 1_000 {
            let cut = FaultEntry::new(FaultName::LinkOpen).at("Buttons.B-Lamps.A");
            fault = Some(simulation.inject(&cut).unwrap());
        }
        if cycle == 3_000 {
            simulation.heal(fault.take().unwrap());
        }
        changes.extend(run.findings().map(|event| (event.kind, event.finding.cause)));
    }
    let report = run.stop().unwrap();
    assert!(report.diagnosis.is_some());
    for change in [FindingChange::Opened, FindingChange::Closed] {
        assert!(changes.contains(&(change, FaultName::LinkOpen)), "{changes:?}");
    }
}

#[test]
fn run_that_is_dropped_leaves_the_line_for_the_next_one() {
    let (mut segment, plan) = machine();
    let mut run = segment.start(plan.clone(), RunOptions::us(1_000)).unwrap();
    for _ in 0..200 {
        run.cycle();
    }
    drop(run);
    let mut run = segment.start(plan, RunOptions::us(1_000)).unwrap();
    let mut settled = false;
    for _ in 0..1_000 {
        settled |= run.cycle().is_some_and(|io| io.is_settled());
    }
    assert!(settled);
    assert_eq!(run.stop().unwrap().counts.working_counter_errors, 0);
}

#[test]
fn wish_to_stop_ends_the_cycles() {
    let (mut segment, plan) = machine();
    let stopper = segment.stopper();
    let mut run = segment.start(plan, RunOptions::us(1_000)).unwrap();
    assert!(run.cycle().is_some());
    stopper.set();
    let more = (0..10).take_while(|_| run.cycle().is_some()).count();
    assert!(more <= 1, "{more}");
    assert!(run.stop().is_ok());
}

#[test]
fn outputs_that_are_called_old_are_withheld() {
    let (mut segment, plan) = machine();
    let mut run = segment.start(plan, RunOptions::us(1_000).allow_misses(3)).unwrap();
    let mut withheld = 0;
    for cycle in 0..2_000 {
        let mut io = run.cycle().unwrap();
        if cycle > 1_000 {
            io.outputs_are_old();
        }
        withheld += u32::from(io.is_withheld());
    }
    assert!(withheld > 900, "{withheld}");
    run.stop().unwrap();
}

/// A coupler behind a coupler, the second one as it should be, or plugged in by its OUT port.
fn press(is_reversed: bool) -> Segment {
    let device = |name, kind, on| {
        format!("[[device]]\nname = \"{name}\"\ntype = \"{kind}\"\non = \"{on}\"\n")
    };
    let mut text = [
        "name = \"press\"\n".to_owned(),
        device("K1", "EK1100", "maindevice"),
        device("T1", "EL2008", "K1.B"),
        device("K2", "EK1100", "K1.C"),
        device("T2", "EL1008", "K2.B"),
    ]
    .concat();
    if is_reversed {
        text += "[[fault]]\nkind = \"ports-swapped\"\ndevice = \"K2\"\n";
    }
    Segment::simulated(&SegmentFile::parse(&text).unwrap()).unwrap()
}

/// Findings, with their places, of a line that is run by the project in a text.
fn found_by(project: &str, segment: &mut Segment) -> Vec<(String, String)> {
    let path = std::env::temp_dir().join(format!(
        "linesman-{}-{:?}.toml",
        std::process::id(),
        std::thread::current().id()
    ));
    std::fs::write(&path, project).unwrap();
    let plan = segment.load(&path);
    std::fs::remove_file(&path).unwrap();
    let mut run = segment.start(plan.unwrap(), RunOptions::us(1_000).diagnosed()).unwrap();
    for _ in 0..3_000 {
        run.cycle();
    }
    let diagnosis = run.stop().unwrap().diagnosis.unwrap();
    let told = |one: &linesman::FindingReport| (one.code.clone(), one.place.to_string());
    diagnosis.findings.iter().map(told).collect()
}

/// The project of the line as it should be; with `choices` one SubDevice is to stay in PREOP, so that the plan is made of
/// the project alone.
fn press_project(choices: bool) -> String {
    let scan = press(false).scan().unwrap();
    let mut project = Project::from_inventory("press", scan.inventory());
    if choices {
        project.devices[3].state = Some("PREOP".to_owned());
    }
    assert_eq!(project.chooses(), choices);
    project.to_toml()
}

#[test]
fn line_wired_otherwise_than_the_loaded_project_is_reported() {
    for choices in [false, true] {
        let project = press_project(choices);
        assert_eq!(found_by(&project, &mut press(false)), []);
        let reversed = [("C304".to_owned(), "SubDevice 3".to_owned())];
        assert_eq!(found_by(&project, &mut press(true)), reversed, "choices: {choices}");
    }
}

#[test]
fn other_device_than_a_project_with_choices_has_is_reported() {
    let file = SegmentFile::in_a_row("press", 1, &[("K1", "EK1100"), ("T1", "EL1008")]);
    let scan = Segment::simulated(&file).unwrap().scan().unwrap();
    let mut project = Project::from_inventory("press", scan.inventory());
    project.devices[0].state = Some("PREOP".to_owned());
    let other = SegmentFile::in_a_row("press", 1, &[("K1", "EK1100"), ("T1", "EL2008")]);
    let found = found_by(&project.to_toml(), &mut Segment::simulated(&other).unwrap());
    assert!(found.iter().any(|(_, place)| place == "SubDevice 2"), "{found:?}");
}
