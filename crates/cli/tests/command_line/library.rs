//! The library as a program uses it: projects are loaded and run on virtual segments.

use std::collections::BTreeSet;
use std::fs;

use crate::support::linesman;
use linesman::prelude::*;
use tempfile::TempDir;

/// Two input terminals whose data share a datagram; the second is cut off after 1.5 s.
const LINE: &str = r#"
name = "line"
seed = 11
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "I1"
type = "EL1008"
on = "K1.B"
[[device]]
name = "O1"
type = "EL2008"
on = "I1.B"
[[device]]
name = "I2"
type = "EL1008"
on = "O1.B"
"#;
const CUT: &str = "[[fault]]\nkind = \"link-open\"\nat = \"O1.B-I2.A\"\nfrom_ms = 1500\n";

struct Place {
    folder: TempDir,
    line: String,
}

impl Place {
    /// A segment, and the project that a scan of it saves, as `change` makes it.
    fn new(segment: &str, change: impl Fn(String) -> String) -> Self {
        let folder = TempDir::new().expect("a temporary directory");
        let (plant, project) =
            (folder.path().join("line.toml"), folder.path().join("machine.toml"));
        fs::write(&plant, segment).unwrap();
        let line = format!("sim:{}", plant.display());
        let run = linesman(["scan", &line, "--save", &project.display().to_string()]);
        assert_eq!(run.status, 0, "{}", run.all());
        fs::write(&project, change(fs::read_to_string(&project).unwrap())).unwrap();
        Self { folder, line }
    }

    fn run(&self, cycle: RunOptions, application: impl FnMut(&mut Io<'_>) -> Next) -> RunReport {
        let mut segment = linesman::open(&self.line).unwrap();
        let plan = segment.load(self.folder.path().join("machine.toml")).unwrap();
        segment.run(plan, cycle, application).unwrap()
    }
}

/// What the inputs of I1 were in the cycles in which their datagram was not good, once they had been
/// all on: they come from the outputs of O1.
fn while_bad_as(change: impl Fn(String) -> String) -> BTreeSet<u8> {
    let place = Place::new(&format!("{LINE}{CUT}"), change);
    let (mut calls, mut was_on, mut seen) = (0, false, BTreeSet::new());
    place.run(RunOptions::us(1_000), |io| {
        calls += 1;
        io.outputs_mut().fill(0xFF);
        let place = io.plan().unwrap().devices[1].inputs.start;
        let value = io.inputs()[place];
        if io.quality(io.devices().nth(1).unwrap()).valid {
            was_on |= value == 0xFF;
        } else if was_on {
            seen.insert(value);
        }
        if calls < 3_000 { Next::Continue } else { Next::Stop }
    });
    assert!(was_on, "the inputs never came");
    seen
}

fn while_bad(network: &str) -> BTreeSet<u8> {
    while_bad_as(|project| project + network)
}

// proves: FRM-17 partial: the old ones stay, as a program sees it
// proves: FRM-18
#[test]
fn a_wrong_counter_keeps_or_clears_the_inputs_of_the_whole_network_or_of_one() {
    assert_eq!(while_bad(""), [0xFF].into());
    assert_eq!(while_bad("\n[network]\non_wrong_counter = \"keep\"\n"), [0xFF].into());
    assert_eq!(while_bad("\n[network]\non_wrong_counter = \"clear\"\n"), [0].into());
    let one = "type = \"EL1008\"\non_wrong_counter = \"clear\"\n";
    assert_eq!(while_bad_as(|project| project.replacen("type = \"EL1008\"\n", one, 1)), [0].into());
}

// S0 L1386-1396: inputs are handed on when the counter is right, and discarded when it is not: the old ones
// stay, though the frames go on bringing others.
// proves: FRM-17
#[test]
fn inputs_come_with_a_right_counter_only_and_the_old_ones_stay_till_then() {
    let cut = "[[fault]]\nkind = \"link-open\"\nat = \"O1.B-I2.A\"\nfrom_ms = 1500\nto_ms = 2500\n";
    let place = Place::new(&format!("{LINE}{cut}"), |project| project);
    // What is set changes with every cycle, and comes back with the next frames.
    let (mut calls, mut set) = (0, 0_u8);
    let (mut last, mut changes, mut bad, mut kept, mut after) = (None, 0, 0, 0, 0);
    let report = place.run(RunOptions::us(250), |io| {
        calls += 1;
        let value = io.inputs()[io.plan().unwrap().devices[1].inputs.start];
        if io.quality(io.devices().nth(1).unwrap()).valid {
            changes += u32::from(last.replace(value) != Some(value));
            after += u32::from(bad > 0);
        } else if last.is_some() {
            bad += 1;
            kept += u32::from(last == Some(value));
        }
        set = set.wrapping_add(1);
        io.outputs_mut().fill(set);
        if calls < 16_000 { Next::Continue } else { Next::Stop }
    });
    // Once when it is cut, and once when the others are back.
    assert!(bad >= 2, "{bad} cycles with a wrong counter");
    assert_eq!(kept, bad, "not one of the values that came meanwhile");
    assert!(changes > 10_000 && after > 5_000, "{changes} values, {after} after it");
    assert!(report.counts.working_counter_errors >= u64::from(bad));
}

// proves: FRM-30 partial: two tasks in one network as a program runs them
#[test]
fn tasks_have_cycle_times_of_their_own() {
    let tasks = "\n[[task]]\nname = \"fast\"\ncycle_us = 2000\n\n\
                 [[task]]\nname = \"slow\"\ncycle_us = 5000\n";
    let slow = |project: String| {
        project.replacen("type = \"EL2008\"\n", "type = \"EL2008\"\ntask = \"slow\"\n", 1) + tasks
    };
    let place = Place::new(LINE, slow);
    let (mut calls, mut was_on) = (0_u64, false);
    let report = place.run(RunOptions::us(2_000), |io| {
        calls += 1;
        io.outputs_mut().fill(0xFF);
        let plan = io.plan().unwrap();
        assert_eq!(plan.tasks.len(), 2);
        // Beside its process data it has the count of all SubDevices.
        let datagrams = plan.tasks[1].frames.iter().flat_map(|frame| &frame.datagrams);
        assert_eq!(datagrams.filter(|datagram| !datagram.ownership.is_empty()).count(), 1);
        was_on |= io.inputs()[plan.devices[1].inputs.start] == 0xFF;
        if calls < 1_000 { Next::Continue } else { Next::Stop }
    });
    // Both of them count: five cycles of the fast one are two of the slow one.
    let expected = calls * 7 / 5;
    assert!(report.counts.cycles.abs_diff(expected) < 10, "{} of {expected}", report.counts.cycles);
    assert!(was_on, "outputs of one task come back as inputs of the other");
    assert_eq!(report.counts.working_counter_errors, 0);
    assert_eq!(report.counts.cyclic_lost, 0);
}
