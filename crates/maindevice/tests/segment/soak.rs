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

/// A coupler and eight digital inputs, behind them a second group: what the soak breaks and heals.
fn inputs() -> String {
    let mut text = "name = \"soak\"\n".to_owned();
    let mut on = "maindevice".to_owned();
    for number in 0..10 {
        let kind = if number % 5 == 0 { "EK1100" } else { "EL1008" };
        if number == 5 {
            on = "D0.C".to_owned();
        }
        text += &format!("[[device]]\nname = \"D{number}\"\ntype = \"{kind}\"\non = \"{on}\"\n");
        on = format!("D{number}.B");
    }
    text
}

/// Random faults for so many hours of virtual time: what is shown as fresh is fresh, and whoever has
/// healed comes back to OP. Run it in slices with other seeds:
/// `LINESMAN_SOAK="SEED HOURS" cargo test -p linesman-maindevice --release --test segment hours -- --ignored`
#[test]
#[ignore = "hours of virtual time take minutes"]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    reason = "its length is chosen from outside"
)]
fn hours_of_random_faults() {
    let choice = std::env::var("LINESMAN_SOAK").unwrap_or_else(|_| "1 1".to_owned());
    let mut numbers = choice.split_whitespace().map(|word| word.parse::<u64>().expect("a number"));
    let (seed, hours) = (numbers.next().unwrap_or(1), numbers.next().unwrap_or(1));
    let text = inputs();
    let file = linesman_sim::segment_file::SegmentFile::parse(&text).unwrap();
    let mut bench = Bench::of(&file, Options::default());
    let plan = bench.start(AlState::Op);
    let mut stream = Seed(seed).stream("hours");
    let end = bench.now + Span::s(hours * 3_600);
    let (mut faults, mut shown, mut withheld) = (0_u64, 0_u64, 0_u64);
    while bench.now < end {
        let name = format!("D{}", stream.between(0, 9));
        let kind = ["link-open", "device-off", "brown-out", "link-flapping", "emc-noise"]
            [stream.between(0, 4) as usize];
        let entry = FaultEntry::new(kind.parse().unwrap());
        let entry = match kind {
            "device-off" | "brown-out" => entry.device(&name),
            _ => entry.at(link_above(&file, &name)),
        };
        bench.events.clear();
        let fault = bench.segment.inject(bench.now, &entry).unwrap();
        faults += 1;
        for step in 0..stream.between(3, 30) {
            // A pattern that changes each time; two cycles later it is in the image, or it is not fresh.
            let pattern = (step * 37 + 11) as i32 & 0xFF;
            for id in plan.devices.iter().map(|device| device.id) {
                for (bit, signal) in bench.segment.inputs(id).to_vec().into_iter().enumerate() {
                    bench.segment.signals_mut().set(signal, pattern >> bit & 1);
                }
            }
            bench.run_for(Span::ms(stream.between(10, 100)));
            for device in plan.devices.iter().filter(|device| !device.inputs.is_empty()) {
                let quality = bench.device.quality(device.id);
                let fresh = quality.age(bench.now).is_some_and(|age| age <= Span::ms(2));
                if !(quality.valid && fresh) {
                    withheld += 1;
                    continue;
                }
                let image = bench.device.inputs()[device.inputs.start];
                assert_eq!(
                    i32::from(image),
                    pattern,
                    "{} at {} during {kind} at {name}",
                    device.name,
                    bench.now
                );
                shown += 1;
            }
        }
        bench.segment.heal(bench.now, fault);
        let until = bench.now + Span::s(60);
        while !bench.device.is_settled() && bench.now < until {
            bench.run_for(Span::ms(100));
        }
        assert!(bench.device.is_settled(), "not back after {kind} at {name} at {}", bench.now);
        bench.run_for(Span::s(stream.between(1, 20)));
    }
    println!(
        "seed {seed}: {hours} h, {faults} faults; {shown} images fresh and right, {withheld} not fresh"
    );
}
