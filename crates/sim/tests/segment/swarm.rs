//! Random plants with random faults: what holds whatever happens.

use linesman_config::attachment::Attachment;
use linesman_config::fault::FaultName;
use linesman_proto::address::Path;
use linesman_proto::command::Command;
use linesman_proto::time::Span;
use linesman_sim::device::library::{self, LibraryType};
use linesman_sim::fault::{KINDS, Kind, PlaceRule};
use linesman_sim::seed::{Seed, Stream};
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::{FaultEntry, PlantOptions, SegmentFile, plant};
use proptest::prelude::*;

use super::rig::{Bench, PLANT, answer, at, frame};

/// A random fault of any kind that can come and go.
pub(crate) fn any_fault(file: &SegmentFile, stream: &mut Stream) -> FaultEntry {
    let is_ring = file.ring.is_some();
    let fits = |kind: &&Kind| {
        let needs_more = matches!(kind.place, PlaceRule::Feed | PlaceRule::Pair);
        !kind.is_built_in() && !needs_more && (is_ring || kind.place != PlaceRule::RingLink)
    };
    let kinds: Vec<_> = KINDS.iter().filter(fits).collect();
    let kind = stream.pick(&kinds).unwrap();
    let needs_software = matches!(kind.place, PlaceRule::Processor | PlaceRule::Mailbox);
    let has_software = |name: &str| library::find(name).is_some_and(LibraryType::has_mailbox);
    let fit = file.devices.iter().filter(|one| !needs_software || has_software(&one.type_name));
    let fit: Vec<_> = fit.collect();
    let Some(device) = stream.pick(&fit) else { return any_fault(file, stream) };
    let (near, far) = (device.on.to_string(), format!("{}.A", device.name));
    let entry = FaultEntry::new(kind.name);
    match kind.place {
        PlaceRule::Link | PlaceRule::Directions | PlaceRule::ManyDirections => {
            entry.at(format!("{near}-{far}"))
        }
        PlaceRule::Direction if stream.chance(0.5) => entry.at(format!("{near}>{far}")),
        PlaceRule::Direction => entry.at(format!("{far}>{near}")),
        PlaceRule::Device
        | PlaceRule::Devices
        | PlaceRule::Feed
        | PlaceRule::Pair
        | PlaceRule::Processor
        | PlaceRule::Mailbox
        | PlaceRule::DeviceOrCard => entry.device(&device.name),
        PlaceRule::Card | PlaceRule::RingLink | PlaceRule::Entrance => entry,
    }
}

// proves: ESC-07
#[test]
fn no_counter_moves_without_a_cause_and_what_is_healed_is_whole_again() {
    let options = PlantOptions { max_devices: 30, ..PlantOptions::default() };
    let (mut kinds, mut effective) = (std::collections::BTreeSet::new(), 0);
    for seed in 0..60 {
        let file = plant(Seed(seed), &options);
        let mut stream = Seed(seed).stream("test");
        let mut bench = Bench::of(&file);
        let all = bench.segment.tree().len() as u16;
        assert_eq!(bench.count(), Some(all), "seed {seed}");
        let mut faults = Vec::new();
        for _ in 0..stream.between(1, 3) {
            let entry = any_fault(&file, &mut stream);
            kinds.insert(entry.kind.clone());
            faults.push(bench.inject(&entry));
            for _ in 0..100 {
                let command = if stream.chance(0.5) { Command::Brd } else { Command::Bwr };
                let len = stream.between(2, 1_000) as usize;
                bench.send_by(Path::A, &frame(command, at(0, 0x1000), &vec![0x5A; len]));
                bench.wait(Span::us(stream.between(0, 2_000)));
            }
            assert_eq!(bench.segment.audit(), [], "seed {seed}: {entry:?}");
        }
        for fault in &faults {
            bench.heal(*fault);
        }
        bench.wait(Span::s(5));
        assert_eq!(bench.segment.audit(), [], "seed {seed}");
        let before = bench.counters();
        for _ in 0..20 {
            assert_eq!(
                bench.count(),
                Some(all),
                "seed {seed}: {:?}",
                bench.segment.truth().faults()
            );
        }
        assert_eq!(bench.counters(), before, "seed {seed}: healed");
        let truth = bench.segment.truth();
        assert_eq!(truth.active().count(), 0, "seed {seed}");
        effective += usize::from(truth.faults().iter().any(|fault| fault.first_effect.is_some()));
    }
    assert!(kinds.len() >= 10, "{kinds:?}");
    assert!(effective >= 45, "{effective} of 60");
}

/// What comes back while `looks` says how often somebody looks at the segment in between.
fn run(seed: u64, looks: u64) -> (Vec<Vec<u8>>, Vec<String>) {
    let options = PlantOptions { max_devices: 20, ..PlantOptions::default() };
    let mut file = plant(Seed(seed), &options);
    let mut stream = Seed(seed).stream("faults");
    for _ in 0..3 {
        file.faults.push(any_fault(&file, &mut stream).from_to(20.0, Some(120.0)));
    }
    let mut bench = Bench::of(&file);
    let mut all = Vec::new();
    for number in 0..300u32 {
        let command = if number % 3 == 0 { Command::Bwr } else { Command::Brd };
        let probe = frame(command, at(0, 0x1000), &[number as u8; 40]);
        bench.segment.handle_frame(bench.now, Path::A, &probe);
        for _ in 0..=looks {
            let arrived = bench.wait(Span::ns(600_000 / (looks + 1)));
            all.extend(arrived.into_iter().map(|(_, bytes)| bytes));
        }
    }
    (all, bench.counters())
}

#[test]
fn looking_changes_nothing() {
    for seed in 0..10 {
        let seldom = run(seed, 0);
        assert!(!seldom.0.is_empty());
        assert_eq!(seldom, run(seed, 99), "seed {seed}");
    }
}

#[test]
fn two_segments_in_one_process_know_nothing_of_each_other() {
    let mut one = Bench::plant();
    let mut other = Bench::plant();
    one.inject(&FaultEntry::new(FaultName::LinkOpen).at("maindevice-K1.A"));
    one.wait(Span::ms(5));
    other.wait(Span::ms(5));
    assert_eq!((one.count(), other.count()), (None, Some(8)));
}

#[test]
fn devices_may_be_written_in_any_order() {
    let file = SegmentFile::parse(PLANT).unwrap();
    let mut reversed = file.clone();
    reversed.devices.reverse();
    let mut bench = Bench::of(&reversed);
    assert_eq!(bench.count(), Some(8));
    assert_eq!(bench.segment.name(linesman_proto::address::DeviceId(0)), "K8");
    let on = Attachment::MainDevice(Path::A);
    assert_eq!(reversed.devices.last().map(|device| &device.on), Some(&on));
}

#[test]
fn frames_of_any_bytes_come_back_or_not() {
    let mut bench = Bench::plant();
    let mut stream = Seed(3).stream("bytes");
    for _ in 0..2_000 {
        let len = stream.below(1_600) as usize;
        let mut bytes: Vec<u8> = (0..len).map(|_| stream.number() as u8).collect();
        if stream.chance(0.7)
            && let Some(kind) = bytes.get_mut(12..14)
        {
            kind.copy_from_slice(&[0x88, 0xA4]);
        }
        bench.send_by(Path::A, &bytes);
    }
    // Some of them have closed loops by hand, written AL control, and so on; the audit holds.
    bench.assert_audit();
}

proptest! {
    #[test]
    fn any_text_is_a_segment_or_a_clear_error(
        line in 0usize..60,
        text in "[a-zA-Z0-9_.\"=\\[\\] ><-]{0,40}",
    ) {
        let lines = PLANT.lines().enumerate();
        let changed: Vec<&str> =
            lines.map(|(number, old)| if number == line { text.as_str() } else { old }).collect();
        match SegmentFile::parse(&changed.join("\n")) {
            Ok(file) => {
                let mut segment = Segment::build(&file).unwrap();
                segment.handle_frame(
                    linesman_proto::time::Instant::ZERO,
                    Path::A,
                    &frame(Command::Brd, at(0, 0), &[0]),
                );
                segment.advance(linesman_proto::time::Instant::from_nanos(1_000_000));
                let mut buffer = Vec::new();
                if segment.poll_arrival(&mut buffer).is_some() {
                    prop_assert_eq!(usize::from(answer(&buffer).1), segment.tree().len());
                }
            }
            Err(error) => prop_assert!(!error.to_string().is_empty()),
        }
    }
}
