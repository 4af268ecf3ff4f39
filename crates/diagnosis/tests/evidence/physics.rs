//! Faults in the wires of a virtual segment, judged by the frames that come back and nothing else.

#![allow(clippy::wildcard_enum_match_arm, reason = "a test that meets another one fails")]

use crate::support::watcher::Watcher;
use linesman_config::fault::FaultName;
use linesman_diagnosis::Diagnosis;
use linesman_diagnosis::report::{DirectionReport, EndReport, FindingReport, PlaceReport, Verdict};
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::{End, Tree};
use linesman_sim::seed::Seed;
use linesman_sim::segment_file::{FaultEntry, PlantOptions, SegmentFile, plant};

fn at(ms: u64) -> Instant {
    Instant::ZERO + Span::ms(ms)
}

/// Every kind of way: line, fork, a coupler's second socket, types with and without forwarded counters.
fn bench() -> SegmentFile {
    let devices = [
        ("K1", "EK1100", "maindevice"),
        ("E2", "EL1008", "K1.B"),
        ("J3", "EK1122", "E2.B"),
        ("E4", "EL2004", "J3.C"),
        ("K5", "EK1100", "J3.D"),
        ("E6", "EL2008", "K5.B"),
        ("K7", "EK1100", "K1.C"),
        ("E8", "EL3104", "K7.B"),
    ];
    let mut text = String::from("name = \"bench\"\n");
    for (name, kind, on) in devices {
        text += &format!("[[device]]\nname = \"{name}\"\ntype = \"{kind}\"\non = \"{on}\"\n");
    }
    SegmentFile::parse(&text).unwrap()
}

fn tree(file: &SegmentFile) -> Tree {
    file.project().unwrap().tree().unwrap()
}

fn name(file: &SegmentFile, end: End) -> String {
    let project = file.project().unwrap();
    match end {
        End::MainDevice(Path::A) => "maindevice".to_owned(),
        End::MainDevice(Path::B) => "maindevice.B".to_owned(),
        End::Controller(node, port) => format!("{}.{port}", project.devices[node].name),
    }
}

fn run(file: &SegmentFile, fault: &FaultEntry, end_ms: u64, host: bool) -> Diagnosis {
    let mut file = file.clone();
    file.faults.push(fault.clone());
    let mut watcher = Watcher::new(&file, host);
    watcher.run_until(at(end_ms));
    assert_eq!(watcher.segment.audit(), []);
    watcher.engine.finish(watcher.now, true);
    watcher.engine.diagnosis()
}

fn end(report: EndReport) -> (u32, char) {
    (report.no, report.port)
}

fn wanted(end: End) -> (u32, char) {
    match end {
        End::MainDevice(path) => (0, if path == Path::A { 'A' } else { 'B' }),
        End::Controller(node, port) => (DeviceId(node as u32).no(), port.letter()),
    }
}

fn is_at(place: &PlaceReport, tree: &Tree, link: usize, direction: DirectionReport) -> bool {
    let wired = tree.links()[link];
    match *place {
        PlaceReport::Link { a, b: Some(b), direction: Some(found), .. } => {
            (end(a), end(b)) == (wanted(wired.upstream), wanted(wired.downstream))
                && found == direction
        }
        _ => false,
    }
}

fn only(diagnosis: &Diagnosis, case: &str) -> FindingReport {
    assert_eq!(diagnosis.findings.len(), 1, "{case}: {:#?}", diagnosis.findings);
    diagnosis.findings[0].clone()
}

// proves: HW-18, HW-23 partial: the place, HW-28 partial: the place, HW-29 partial: located; no "--" is shown yet
#[test]
fn every_link_and_direction_is_named_with_1_10_and_1000_hits() {
    let file = bench();
    let tree = tree(&file);
    for link in 0..tree.links().len() {
        for (hits, to_ms) in [(1, 300), (10, 400), (1_000, 2_300)] {
            for direction in [DirectionReport::AToB, DirectionReport::BToA] {
                if hits == 1_000 && link % 3 != 0 {
                    continue;
                }
                let wired = tree.links()[link];
                let (from, to) = match direction {
                    DirectionReport::BToA => (wired.downstream, wired.upstream),
                    _ => (wired.upstream, wired.downstream),
                };
                let model = format!("{}>{}", name(&file, from), name(&file, to));
                let case = format!("{model}, {hits} hits");
                let fault = FaultEntry::new(FaultName::CableDegraded)
                    .at(model)
                    .from_to(150.0, Some(to_ms as f64))
                    .with("hits", hits);
                let diagnosis = run(&file, &fault, to_ms + 200, true);
                let finding = only(&diagnosis, &case);
                assert_eq!(diagnosis.verdict, Verdict::Faulty, "{case}");
                assert!(is_at(&finding.place, &tree, link, direction), "{case}: {finding:#?}");
                let causes = finding.alternatives.iter().map(|other| other.cause);
                assert!(
                    causes.chain([finding.cause]).any(|cause| cause == FaultName::CableDegraded),
                    "{case}: {finding:#?}"
                );
            }
        }
    }
}

// fires: H112
#[test]
fn without_the_cards_counters_the_last_hop_is_in_the_set() {
    let file = bench();
    let fault = FaultEntry::new(FaultName::CableDegraded)
        .at("K1.A>maindevice")
        .from_to(150.0, Some(400.0))
        .with("hits", 10);
    let diagnosis = run(&file, &fault, 700, false);
    let finding = only(&diagnosis, "last hop");
    assert_eq!(finding.code, "H112");
    assert!(is_at(&finding.place, &tree(&file), 0, DirectionReport::BToA), "{finding:#?}");
    assert!(finding.alternatives.iter().any(|other| other.place == Some(PlaceReport::Host)));
}

// proves: HW-27 partial
#[test]
fn a_device_that_spoils_frames_inside_is_named() {
    let file = bench();
    for (no, device) in (1..).zip(["K1", "E2", "J3", "E4", "K5", "E6", "K7", "E8"]) {
        for hits in [1, 10] {
            let fault = FaultEntry::new(FaultName::DeviceInternal)
                .device(device)
                .from_to(150.0, Some(400.0))
                .with("hits", hits);
            let diagnosis = run(&file, &fault, 600, true);
            let finding = only(&diagnosis, device);
            let here = PlaceReport::Device { network: 0, no };
            let places = finding.alternatives.iter().filter_map(|other| other.place.as_ref());
            assert!(
                places.chain([&finding.place]).any(|place| *place == here),
                "{device}, {hits}: {finding:#?}"
            );
        }
    }
}

#[test]
fn old_counters_and_noise_at_power_on_are_healthy() {
    for host in [false, true] {
        let mut file = bench();
        file.old_counters = true;
        let mut watcher = Watcher::new(&file, host);
        watcher.run_until(at(600));
        watcher.engine.finish(watcher.now, true);
        let diagnosis = watcher.engine.diagnosis();
        assert_ne!(diagnosis.verdict, Verdict::Faulty, "{:#?}", diagnosis.findings);
        assert_eq!(diagnosis.findings, []);
    }
}

// proves: JCT-11 partial
#[test]
fn each_cut_is_one_finding_at_its_link() {
    let file = bench();
    let tree = tree(&file);
    for link in 1..tree.links().len() {
        let wired = tree.links()[link];
        let model = format!("{}-{}", name(&file, wired.upstream), name(&file, wired.downstream));
        let fault = FaultEntry::new(FaultName::LinkOpen).at(model.clone()).from_to(200.0, None);
        let diagnosis = run(&file, &fault, 600, true);
        let finding = only(&diagnosis, &model);
        assert!(is_at(&finding.place, &tree, link, DirectionReport::Both), "{model}: {finding:#?}");
        assert_eq!(finding.cause, FaultName::LinkOpen);
        assert!(finding.confirmed_ns.is_some());
        let End::Controller(node, _) = wired.downstream else { panic!() };
        assert_eq!(finding.consequences.len(), tree.subtree(node).len(), "{model}: {finding:#?}");
    }
}

#[test]
fn noise_on_random_plants_is_found_where_it_is() {
    for seed in 0..12 {
        let seed = Seed(seed);
        let options = PlantOptions { min_devices: 5, max_devices: 25, ..PlantOptions::default() };
        let file = plant(seed, &options);
        let tree = tree(&file);
        let mut chance = seed.stream("test");
        let link = chance.below(tree.links().len() as u64) as usize;
        let wired = tree.links()[link];
        let model = format!("{}>{}", name(&file, wired.upstream), name(&file, wired.downstream));
        let fault = FaultEntry::new(FaultName::TransmitterDamaged)
            .at(model.clone())
            .from_to(200.0, Some(1_200.0))
            .with("hits_per_s", 300.0);
        let diagnosis = run(&file, &fault, 1_500, true);
        let finding = only(&diagnosis, &model);
        let is_host = link == 0 && finding.place == PlaceReport::Host;
        assert!(
            is_host || is_at(&finding.place, &tree, link, DirectionReport::AToB),
            "{seed:?}, {model}: {finding:#?}"
        );
    }
}

#[test]
fn interference_on_several_links_is_one_finding() {
    let file = bench();
    let mut fault = FaultEntry::new(FaultName::EmcNoise)
        .from_to(200.0, Some(1_800.0))
        .with("hits_per_s", 200.0);
    fault.at = Some(linesman_sim::segment_file::OneOrMany::Many(vec![
        "J3.D-K5.A".to_owned(),
        "K1.C-K7.A".to_owned(),
    ]));
    let diagnosis = run(&file, &fault, 2_000, true);
    let finding = only(&diagnosis, "two links");
    assert_eq!(finding.cause, FaultName::EmcNoise);
    assert_eq!(finding.consequences.len(), 1);
}
