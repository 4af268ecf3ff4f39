//! Plants, faults, healing: in the end all is as it was.

use crate::bench::Bench;
use linesman_config::plan::{Plan, PlanOptions};
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

/// A coupler, digital inputs, a drive stage with a mailbox, outputs with a watchdog; behind them a
/// second group: what the soak breaks and heals.
fn inputs() -> String {
    const KINDS: [&str; 5] = ["EK1100", "EL1008", "EL1008", "EL7041", "EL2008"];
    let mut text = "name = \"soak\"\n".to_owned();
    let mut on = "maindevice".to_owned();
    for number in 0..10 {
        let kind = KINDS[number % 5];
        if number == 5 {
            on = "D0.C".to_owned();
        }
        text += &format!("[[device]]\nname = \"D{number}\"\ntype = \"{kind}\"\non = \"{on}\"\n");
        on = format!("D{number}.B");
    }
    text
}

/// Where a kind of fault is put.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Where {
    Link,
    AnyDevice,
    WithMailbox,
    WithOutputs,
    Host,
}

/// A kind of fault, its place and its parameters.
type Break = (&'static str, Where, &'static [(&'static str, f64)]);

/// What breaks and can heal.
const BREAKS: [Break; 14] = [
    ("link-open", Where::Link, &[]),
    ("link-flapping", Where::Link, &[]),
    ("emc-noise", Where::Link, &[]),
    ("cable-degraded", Where::Link, &[]),
    ("device-off", Where::AnyDevice, &[]),
    ("brown-out", Where::AnyDevice, &[]),
    ("init-refused", Where::AnyDevice, &[]),
    ("mailbox-slow", Where::WithMailbox, &[("by_ms", 300.0)]),
    ("mailbox-stuck", Where::WithMailbox, &[]),
    ("firmware-fault", Where::WithMailbox, &[]),
    ("watchdog-starved", Where::WithOutputs, &[("watchdog_ms", 3.0)]),
    ("host-drops", Where::Host, &[]),
    ("host-jitter", Where::Host, &[]),
    ("late-frames", Where::Host, &[]),
];

/// A soak: what was broken and what was seen.
#[derive(Default, Debug)]
struct Soaked {
    faults: u64,
    cycles: u64,
    shown: u64,
    withheld: u64,
    longest: Span,
}

/// Random faults for `length` of virtual time: what is shown as fresh is fresh, and whoever has healed
/// comes back to OP. `told` hears of each hour that has passed.
fn soak(seed: u64, length: Span, mut told: impl FnMut(u64, &Soaked)) -> Soaked {
    // Ten milliseconds: a fault lasts hundreds of them, and the hours pass ten times as fast.
    const CYCLE: Span = Span::ms(10);
    let file = linesman_sim::segment_file::SegmentFile::parse(&inputs()).unwrap();
    let mut bench = Bench::of(&file, Options::default());
    let inventory = bench.scan();
    let options = PlanOptions { cycle: CYCLE, ..PlanOptions::default() };
    let planned = inventory.planned(AlState::Op);
    let plan = Plan::build(&planned, inventory.tree().clone(), &options).unwrap();
    bench.device.start(bench.now, plan.clone());
    assert!(bench.run_until(Span::s(30), |event| matches!(event, Event::AllReached)));
    let mut stream = Seed(seed).stream("hours");
    let begin = bench.now;
    let mut soaked = Soaked::default();
    let mut hours = 0;
    let judged: Vec<_> =
        plan.devices.iter().filter(|device| device.name.contains("EL1008")).cloned().collect();
    assert_eq!(judged.len(), 4);
    while bench.now < begin + length {
        let (kind, place, parameters) = BREAKS[stream.between(0, BREAKS.len() as u64 - 1) as usize];
        let number = match place {
            Where::Link | Where::AnyDevice | Where::Host => stream.between(0, 9),
            Where::WithMailbox => 3 + 5 * stream.between(0, 1),
            Where::WithOutputs => 4 + 5 * stream.between(0, 1),
        };
        let name = format!("D{number}");
        let entry = FaultEntry::new(kind.parse().unwrap());
        let entry = match place {
            Where::Link => entry.at(link_above(&file, &name)),
            Where::Host => entry,
            Where::AnyDevice | Where::WithMailbox | Where::WithOutputs => entry.device(&name),
        };
        let entry = parameters.iter().fold(entry, |entry, (key, value)| entry.with(key, *value));
        bench.events.clear();
        let fault = bench
            .segment
            .inject(bench.now, &entry)
            .unwrap_or_else(|error| panic!("{kind} at {name}: {error}"));
        soaked.faults += 1;
        for _ in 0..stream.between(3, 30) {
            // A pattern that changes each time; two cycles later it is in the image, or it is not fresh.
            let pattern = stream.between(0, 255) as i32;
            for id in plan.devices.iter().map(|device| device.id) {
                for (bit, signal) in bench.segment.inputs(id).to_vec().into_iter().enumerate() {
                    bench.segment.signals_mut().set(signal, pattern >> (bit & 7) & 1);
                }
            }
            bench.run_for(CYCLE * stream.between(4, 20));
            for device in &judged {
                let quality = bench.device.quality(device.id);
                let fresh = quality.age(bench.now).is_some_and(|age| age <= CYCLE * 2);
                if !(quality.valid && fresh) {
                    soaked.withheld += 1;
                    continue;
                }
                let image = bench.device.inputs()[device.inputs.start];
                let name = &device.name;
                let now = bench.now;
                assert_eq!(i32::from(image), pattern, "{name} at {now} during {kind} at {number}");
                soaked.shown += 1;
            }
        }
        bench.segment.heal(bench.now, fault);
        let healed = bench.now;
        while !bench.device.is_settled() && bench.now < healed + Span::s(60) {
            bench.run_for(Span::ms(100));
        }
        let events: Vec<_> = bench.events.iter().rev().take(20).collect();
        let now = bench.now;
        assert!(bench.device.is_settled(), "not back after {kind} at {name} at {now}: {events:#?}");
        soaked.longest = soaked.longest.max(now.since(healed));
        bench.run_for(Span::s(stream.between(1, 20)));
        // Whatever the MainDevice believes, the devices themselves must be there.
        for number in 0..10 {
            let name = format!("D{number}");
            assert_eq!(bench.state(&name), "OP", "{name} after {kind} at {}", bench.now);
        }
        soaked.cycles = bench.device.statistics().cycles;
        while bench.now.since(begin).as_nanos() / 3_600_000_000_000 > hours {
            hours += 1;
            told(hours, &soaked);
        }
    }
    assert_eq!(bench.segment.audit(), []);
    soaked
}

/// A slice of the soak for every day.
#[test]
fn half_a_minute_of_random_faults() {
    let soaked = soak(1, Span::s(30), |_, _| ());
    assert!(soaked.faults >= 2 && soaked.shown > 50, "{soaked:?}");
}

/// Hours of it: `LINESMAN_SOAK="SEED HOURS" cargo test -p linesman-maindevice --release --test segment
/// hours -- --ignored --nocapture`
#[test]
#[ignore = "hours of virtual time take minutes"]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    reason = "its length is chosen from outside, and the memory of the process is looked at"
)]
fn hours_of_random_faults() {
    let choice = std::env::var("LINESMAN_SOAK").unwrap_or_else(|_| "1 1".to_owned());
    let mut numbers = choice.split_whitespace().map(|word| word.parse::<u64>().expect("a number"));
    let (seed, hours) = (numbers.next().unwrap_or(1), numbers.next().unwrap_or(1));
    let resident_mb = || {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let line = status.lines().find(|line| line.starts_with("VmRSS:")).unwrap_or_default();
        line.split_whitespace().nth(1).and_then(|kb| kb.parse::<u64>().ok()).unwrap_or(0) / 1024
    };
    let soaked = soak(seed, Span::s(hours * 3_600), |hour, soaked| {
        println!("hour {hour}: {soaked:?}, {} MB resident", resident_mb());
    });
    println!("seed {seed}, {hours} h: {soaked:?}, {} MB resident", resident_mb());
}
