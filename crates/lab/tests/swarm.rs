//! The swarm's invariants, on two hundred seeds.

use linesman_lab::swarm::{SwarmOptions, swarm};

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
    let report = swarm(seeds(), &SwarmOptions::default(), |_| {});
    let failed: Vec<String> = report.failed().map(ToString::to_string).collect();
    assert!(failed.is_empty(), "{}", failed.join("\n"));
    let (effective, all) = (report.with_effect(), report.seeds.len());
    assert!(effective * 2 > all, "{effective} of {all} seeds had a fault with an effect");
    let checked: u64 = report.seeds.iter().map(|seed| seed.counters_checked).sum();
    assert!(checked > 1_000, "only {checked} working counters were checked");
}
