//! Plants, faults, healing: in the end all is as it was.

use crate::bench::Bench;
use linesman_maindevice::{Event, Options};
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use linesman_sim::seed::Seed;
use linesman_sim::segment_file::{FaultEntry, PlantOptions, plant};

/// Every kind of fault that can be healed, at a random place of a random plant.
#[test]
fn whatever_breaks_and_heals_comes_back() {
    for seed in 0..5 {
        let options = PlantOptions { min_devices: 3, max_devices: 25, ..PlantOptions::default() };
        let file = plant(Seed(1000 + seed), &options);
        let mut bench = Bench::of(&file, Options::default());
        bench.start(AlState::Op);
        let mut stream = Seed(seed).stream("soak");
        for round in 0..3 {
            let names: Vec<_> = bench.segment.devices().collect();
            let device = names[stream.between(0, names.len() as u64 - 1) as usize];
            let name = bench.segment.name(device).to_owned();
            let kind = match stream.between(0, 4) {
                0 => "link-open",
                1 => "device-off",
                2 => "brown-out",
                3 => "link-flapping",
                _ => "emc-noise",
            };
            let entry = FaultEntry::new(kind.parse().unwrap());
            let entry = match kind {
                "device-off" | "brown-out" => entry.device(&name),
                _ => entry.at(link_above(&file, &name)),
            };
            bench.events.clear();
            let fault = bench
                .segment
                .inject(bench.now, &entry)
                .unwrap_or_else(|error| panic!("{kind} at {name}: {error}"));
            bench.run_for(Span::ms(700));
            bench.segment.heal(bench.now, fault);
            let until = bench.now + Span::s(45);
            while !(bench.device.is_settled()) && bench.now < until {
                bench.run_for(Span::ms(100));
            }
            bench.run_for(Span::s(2));
            assert!(
                bench.device.is_settled(),
                "seed {seed} round {round} {kind} at {name} ({} devices): {:#?}",
                names.len(),
                bench
                    .events
                    .iter()
                    .filter(|(_, e)| !matches!(e, Event::Counters { .. } | Event::Links { .. }))
                    .rev()
                    .take(30)
                    .collect::<Vec<_>>()
            );
        }
    }
}

/// The link by which a device is reached, as a place for faults.
fn link_above(file: &linesman_sim::segment_file::SegmentFile, name: &str) -> String {
    let found = file.devices.iter().find(|device| device.name == name);
    let found = found.or_else(|| file.devices.iter().find(|device| name.starts_with(&device.name)));
    let found = found.unwrap_or_else(|| panic!("no {name}"));
    format!("{}-{}.{}", found.on, found.name, found.entry.as_deref().unwrap_or("A"))
}
