//! The swarm's invariants, on two hundred seeds.

use linesman_lab::swarm::{SeedSum, SwarmOptions, SwarmReport, run_physics_seed, run_seed};
use linesman_sim::fault::{KINDS, Kind};

/// Seeds of this test: two hundred, unless `SEEDS=A..B` says others.
fn seeds() -> std::ops::Range<u64> {
    #[expect(clippy::disallowed_methods, reason = "a choice for whoever works on one seed")]
    let chosen = std::env::var("SEEDS").ok();
    let chosen = chosen.as_deref().and_then(|text| text.split_once(".."));
    let chosen = chosen.and_then(|(from, to)| Some(from.parse().ok()?..to.parse().ok()?));
    chosen.unwrap_or(1..201)
}

#[test]
fn the_first_seeds_are_green() {
    let options = SwarmOptions::default();
    let sums = seeds().map(|seed| SeedSum::from(&run_seed(seed, &options)));
    let report = SwarmReport { seeds: sums.collect() };
    let failed: Vec<&str> = report.failed().map(|seed| seed.words.as_str()).collect();
    assert!(failed.is_empty(), "{}", failed.join("\n"));
    let (effective, all) = (report.with_effect(), report.seeds.len());
    assert!(effective * 2 > all, "{effective} of {all} seeds had a fault with an effect");
    let checked: u64 = report.seeds.iter().map(|seed| seed.counters_checked).sum();
    assert!(checked > 1_000, "only {checked} working counters were checked");
}

/// Seeds of the physics swarm: three hundred, unless `SEEDS=A..B` says others.
fn physics_seeds() -> std::ops::Range<u64> {
    let chosen = seeds();
    if chosen == (1..201) { 0..300 } else { chosen }
}

#[test]
fn the_segment_is_sound_whatever_breaks() {
    let reports: Vec<_> = physics_seeds().map(run_physics_seed).collect();
    let failed: Vec<String> =
        reports.iter().filter(|seed| !seed.is_green()).map(ToString::to_string).collect();
    assert!(failed.is_empty(), "{}", failed.join("\n"));
    if reports.len() < 300 {
        return;
    }
    // Every kind of the catalogue was drawn, and most of what was drawn did something.
    let drawn = |kind: &Kind| {
        let name = kind.name.name();
        reports.iter().flat_map(|seed| &seed.faults).any(|fault| fault.starts_with(name))
    };
    // What is built in is drawn seldom, and may not fit a small plant.
    let due = |kind: &&Kind| !kind.is_built_in() || reports.len() >= 1_000;
    let never: Vec<_> =
        KINDS.iter().filter(due).filter(|kind| !drawn(kind)).map(|kind| kind.name).collect();
    assert!(never.is_empty(), "never drawn: {never:?}");
    let effective: usize = reports.iter().map(|seed| seed.effective).sum();
    let all: usize = reports.iter().map(|seed| seed.faults.len()).sum();
    assert!(effective * 2 > all, "{effective} of {all} faults had an effect");
}
