//! The order in which ports check a frame, step by step on the tree of fifteen SubDevices.

use linesman_config::fault::FaultName;
use linesman_proto::address::Path;
use linesman_proto::command::Command;
use linesman_proto::port::Port;
use linesman_proto::time::Span;
use linesman_sim::segment_file::FaultEntry;

use super::rig::{Bench, at, frame};

/// Where each SubDevice hangs: number, from 1, and port of the one before. The second branch of 9 is at B or C.
fn wiring(branch: Port) -> Vec<(usize, Port)> {
    let mut on = vec![(0, Port::A)];
    on.extend((1..9).map(|no| (no, Port::B)));
    on.extend([
        (9, Port::D),
        (9, branch),
        (11, Port::B),
        (12, Port::B),
        (6, Port::C),
        (1, Port::C),
    ]);
    on
}

/// SubDevice and port of each check, as the sources list them.
fn listed(branch: Port) -> Vec<(usize, Port)> {
    use Port::{A, B, C, D};
    let mut steps: Vec<(usize, Port)> = (1..=10).map(|no| (no, A)).collect();
    steps.extend([(9, D), (11, A), (12, A), (13, A), (12, B), (11, B), (9, branch)]);
    steps.extend([(8, B), (7, B), (6, B), (14, A), (6, C)]);
    steps.extend([(5, B), (4, B), (3, B), (2, B), (1, B), (15, A), (1, C)]);
    steps
}

fn bench(on: &[(usize, Port)]) -> Bench {
    let mut text = "name = \"fifteen\"\n".to_owned();
    for (index, (no, port)) in on.iter().enumerate() {
        let place = if *no == 0 { "maindevice".to_owned() } else { format!("D{no}.{port}") };
        text += &format!(
            "[[device]]\nname = \"D{}\"\ntype = \"CU1124\"\non = \"{place}\"\n",
            index + 1
        );
    }
    Bench::new(&text)
}

/// The last step of the way to a port, as a fault names it.
fn way_to(on: &[(usize, Port)], no: usize, port: Port) -> String {
    if port == Port::A {
        let (before, its) = on[no - 1];
        let from = if before == 0 { "maindevice".to_owned() } else { format!("D{before}.{its}") };
        return format!("{from}>D{no}.A");
    }
    let behind = on.iter().position(|place| *place == (no, port)).unwrap() + 1;
    format!("D{behind}.A>D{no}.{port}")
}

// S0 L2030-2061, S1 L684-713, with either legal port for the second branch of 9.
// proves: HW-22
#[test]
fn frame_spoiled_before_each_of_the_29_checks_is_counted_there_first() {
    for branch in [Port::B, Port::C] {
        let on = wiring(branch);
        let steps = listed(branch);
        assert_eq!(steps.len(), 29);
        let mut forwarded_before = usize::MAX;
        for (no, port) in steps {
            let mut bench = bench(&on);
            let place = way_to(&on, no, port);
            let entry = FaultEntry::new(FaultName::TransmitterDamaged)
                .at(&place)
                .from_to(1.0, Some(3.0))
                .with("hits", 1);
            bench.inject(&entry);
            for _ in 0..10 {
                bench.send_by(Path::A, &frame(Command::Brd, at(0, 0x0000), &[0; 4]));
                bench.wait(Span::us(500));
            }
            let counters = bench.counters();
            let found: Vec<&String> =
                counters.iter().filter(|one| one.contains(" frame ")).collect();
            assert_eq!(found, [&format!("D{no}.{port} frame 1")], "{place}");
            // All that check it later were told, and they are fewer with each step.
            let forwarded = counters.iter().filter(|one| one.contains(" forwarded ")).count();
            assert!(forwarded < forwarded_before, "{place}: {forwarded} after {forwarded_before}");
            forwarded_before = forwarded;
        }
        assert_eq!(forwarded_before, 0, "nobody checks it after the last step");
    }
}
