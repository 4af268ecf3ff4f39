//! The same plant, fault and seed give the same findings, whoever runs the line: the lab (`diagnose sim:`, `lab run`,
//! `lab score`) and a run on a virtual segment (`run --on sim:`).

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::sync::mpsc::sync_channel;

use linesman_config::fault::FaultName;
use linesman_diagnosis::report::{Diagnosis, FindingReport};
use linesman_diagnosis::{InputKind, Setup};
use linesman_lab::choice::LineOutline;
use linesman_lab::lab::Lab;
use linesman_lab::options::LabOptions;
use linesman_lab::score::ScoreOptions;
use linesman_lab::score::case::Case;
use linesman_lab::score::draw::{Offer, When, draw, when};
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};
use linesman_runtime::run::{Idle, NOTES, PlanChoices, RunControls, SessionOptions, run};
use linesman_runtime::stop::Stop;
use linesman_runtime::transport::{Pace, SegmentTransport};
use linesman_runtime::wiring::Wiring;
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::SegmentFile;

/// Seeds that each test compares; the tests run beside one another.
const SEEDS: u64 = 30;
/// Faults come after bring-up, and the line is looked at for some time behind them.
const FAULT_AT_MS: f64 = 2_500.0;
const LASTS: Span = Span::s(7);
/// All is over before the end: a run goes on to be heard while it leaves the line.
const LONGEST_MS: f64 = 1_500.0;

/// A plant with a fault of this seed.
fn plant(seed: u64) -> Option<(SegmentFile, Option<FaultName>, Span)> {
    let attempts = 0..40;
    attempts
        .into_iter()
        .find_map(|attempt| with_fault(&Case::draw(seed, attempt, &ScoreOptions::default())))
}

fn with_fault(case: &Case) -> Option<(SegmentFile, Option<FaultName>, Span)> {
    let Some(name) = case.faults.first().copied() else {
        return Some((case.file.clone(), None, case.cycle));
    };
    let at = when(name, case.from_start);
    let project = case.file.project().ok()?;
    let tree = project.tree().ok()?;
    let names: Vec<String> = project.devices.iter().map(|device| device.name.clone()).collect();
    let cabled = vec![true; tree.links().len()];
    let outline = LineOutline { tree: &tree, names: &names, cabled: &cabled };
    let offer =
        Offer { outline: &outline, file: &case.file, clocked: &[], reference: None, when: at };
    let drawn = draw(name, &offer, &mut case.seed.stream("same findings"))?;
    let lasts_ms = (drawn.choice.lasts.as_nanos() as f64 / 1e6).min(LONGEST_MS);
    let entry = match at {
        When::FromStart => drawn.choice.entry,
        When::Running => {
            drawn.choice.entry.from_to(FAULT_AT_MS, Some(FAULT_AT_MS + lasts_ms.max(1.0)))
        }
    };
    let mut file = SegmentFile { faults: vec![entry], ..case.file.clone() };
    for link_up in file.devices.iter_mut().filter_map(|device| device.link_up_ms.as_mut()) {
        *link_up = link_up.min(LONGEST_MS);
    }
    Segment::build(&file).ok()?;
    Some((file, Some(name), case.cycle))
}

/// What was said of each finding: code, cause, place, how bad, how sure, since when, and what else it may be.
fn said(diagnosis: &Diagnosis) -> Vec<String> {
    let one = |finding: &FindingReport| {
        let FindingReport { code, cause, place, severity, confidence, opened_ns, .. } = finding;
        let others: Vec<FaultName> = finding.alternatives.iter().map(|one| one.cause).collect();
        format!(
            "{code} {} {severity:?} at {place:?}, {confidence}, since {opened_ns:?}, or {others:?}",
            cause.name()
        )
    };
    diagnosis.findings.iter().map(one).collect()
}

fn in_lab(file: &SegmentFile, cycle: Span, active: bool, recorded: bool) -> Diagnosis {
    let options = LabOptions { cycle, active, ..LabOptions::default() };
    let mut lab = Lab::new(file, options).unwrap();
    if recorded {
        lab.set_recorder(Box::new(|_| {}));
    }
    lab.run_until(Instant::ZERO + LASTS).unwrap();
    lab.finish()
}

fn in_run(file: &SegmentFile, cycle: Span, active: bool) -> Option<Diagnosis> {
    let project = file.project().unwrap();
    let segment = Segment::build(file).unwrap();
    let wiring = Wiring::of(&segment, &project);
    let line = SegmentTransport::new(segment, wiring, file.ring.is_some(), Pace::Free).unwrap();
    let setup = Setup {
        project: Some(project.clone()),
        input: InputKind::Driven,
        host_counters: true,
        probes: true,
        active,
        ..Setup::default()
    };
    let options = SessionOptions {
        on: "plant".to_owned(),
        leave: AlState::Init,
        lasts: Some(LASTS),
        real_time: None,
        allowed_misses: None,
        hold: false,
        diagnose: Some(setup),
        group: None,
    };
    let (notes, _told) = sync_channel(NOTES);
    let stop = Stop::default();
    let beside = RunControls::new(&stop, notes);
    let choices = PlanChoices { cycle: Some(cycle), ..PlanChoices::default() };
    run(line, choices.as_found(), Idle, &options, beside).ok()?.report.diagnosis
}

/// Compares this many seeds after the ones before.
fn compare(part: u64) {
    let (mut compared, mut faulty, mut not_run) = (0, 0, 0);
    let mut wrong = Vec::new();
    let seeds = part * SEEDS + 1..=(part + 1) * SEEDS;
    for seed in seeds.clone() {
        let Some((file, name, cycle)) = plant(seed) else { continue };
        let active = seed % 2 == 0;
        let lab = in_lab(&file, cycle, active, false);
        if seed % 10 == 0 {
            let recorded = in_lab(&file, cycle, active, true);
            assert_eq!(said(&lab), said(&recorded), "seed {seed}: who records changes nothing");
        }
        // A run of a line that cannot be brought up ends with the reason.
        let Some(run) = in_run(&file, cycle, active) else {
            not_run += 1;
            continue;
        };
        compared += 1;
        faulty += usize::from(!said(&lab).is_empty());
        if said(&lab) != said(&run) {
            wrong.push(format!(
                "seed {seed} {}: {:#?}\n--- run\n{:#?}",
                name.map_or("no fault", FaultName::name),
                said(&lab),
                said(&run)
            ));
        }
    }
    println!(
        "seeds {seeds:?}: {compared} compared, {faulty} with findings, {not_run} not run, {} differ",
        wrong.len()
    );
    assert!(wrong.is_empty(), "{} of {compared}:\n{}", wrong.len(), wrong.join("\n"));
    assert!(compared >= 26 && faulty >= 18, "{compared} compared, {faulty} with findings");
}

#[test]
fn lab_and_run_say_the_same_of_the_same_line() {
    compare(0);
}

#[test]
fn lab_and_run_say_the_same_of_more_lines() {
    compare(1);
}

#[test]
fn lab_and_run_say_the_same_of_yet_more_lines() {
    compare(2);
}

#[test]
fn lab_and_run_say_the_same_of_the_last_lines() {
    compare(3);
}
