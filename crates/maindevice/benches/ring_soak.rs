//! A thousand joins and leaves of groups at random ports of a ring with clocks, while its cables break and are mended: cycles that
//! others lose by it, how long a group takes to OP, how far clocks are apart, and the memory of the process.
//!
//! ```text
//! cargo bench -p linesman-maindevice --bench ring_soak               1,000 joins, seed 11
//! cargo bench -p linesman-maindevice --bench ring_soak -- 5000 3     more, and another seed
//! ```
//!
//! Time is virtual. It fails when a cycle of SubDevices that stay is lost without a break and without a pull, or more than one by each.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a measurement that fails may panic")]
#![allow(
    clippy::print_stdout,
    clippy::disallowed_macros,
    clippy::disallowed_methods,
    reason = "this prints a table, and looks at the memory of its process"
)]

#[allow(dead_code, reason = "shared with the tests")]
#[path = "../tests/segment/bench.rs"]
mod bench;
#[allow(dead_code, unused_imports, reason = "shared with the tests")]
#[path = "../tests/segment/hot_connect.rs"]
mod hot_connect;
#[allow(dead_code, reason = "shared with the tests")]
#[path = "../tests/segment/ring_cuts.rs"]
mod ring_cuts;
#[allow(dead_code, reason = "shared with the tests")]
#[path = "../tests/segment/ring_soak.rs"]
mod ring_soak;

use ring_soak::soak;

fn main() {
    let numbers: Vec<u64> = std::env::args().filter_map(|word| word.parse().ok()).collect();
    let (joins, seed) = match numbers.as_slice() {
        [joins, seed] => (*joins as u32, *seed),
        _ => (1_000, 11),
    };
    let observed = soak(seed, joins, |joined| {
        println!("{joined:5} joins, {} KB resident", resident_kb());
    });
    let [usual, fast] = observed.joins;
    println!("\n{} cycles, {usual} joins at usual ports and {fast} at fast ones", observed.cycles);
    println!("{} leaves, {} cuts, {} mended", observed.leaves, observed.cuts, observed.mends);
    let [slowest, slowest_fast] = observed.slowest;
    println!("slowest to OP: {slowest} at a usual port, {slowest_fast} at a fast one");
    println!(
        "cycles of others lost: {} by cuts and mendings, {} by pulling, {} else",
        observed.lost_by_break, observed.lost_by_pull, observed.lost_else
    );
    println!(
        "clocks: {} ns apart at most, above 100 ns in {} of {} samples; {} ns that of a newcomer",
        observed.worst_ns, observed.apart, observed.samples, observed.newcomer_ns
    );
    assert_eq!(observed.lost_else, 0, "see above");
    assert!(observed.lost_by_break <= observed.cuts + observed.mends, "see above");
    assert!(observed.lost_by_pull <= observed.leaves, "see above");
}

fn resident_kb() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("VmRSS:")).unwrap_or_default();
    line.split_whitespace().nth(1).and_then(|kb| kb.parse().ok()).unwrap_or(0)
}
