//! Plans that are drawn, judged beforehand by their timing, and run: the verdict beside what the segment does.
//!
//! ```text
//! cargo bench -p linesman-maindevice --bench timing_of_plans            500 plans, seed 1
//! cargo bench -p linesman-maindevice --bench timing_of_plans -- 100 7   so many, another seed
//! ```
//!
//! Time is virtual. It fails when a plan that passes loses sync, or one that clearly fails the first rule does not.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a measurement that fails may panic")]
#![allow(clippy::print_stdout, clippy::disallowed_macros, reason = "this prints a table")]

#[allow(dead_code, reason = "shared with the tests")]
#[path = "../tests/segment/bench.rs"]
mod bench;
#[allow(dead_code, reason = "shared with the tests")]
#[path = "../tests/segment/timing_drawn.rs"]
mod timing_drawn;

use timing_drawn::PlansAndRuns;

fn main() {
    let numbers: Vec<u64> = std::env::args().filter_map(|word| word.parse().ok()).collect();
    let (count, seed) = match numbers.as_slice() {
        [count, seed] => (*count, *seed),
        [count] => (*count, 1),
        _ => (500, 1),
    };
    let all = PlansAndRuns::draw(seed, u32::try_from(count).unwrap());
    println!("verdict beforehand                          kept sync  lost sync");
    for (verdict, kept, lost) in [
        ("passes", all.passed, all.passed_and_lost),
        ("fails the first rule", all.failed_and_kept, all.failed),
        ("fails it by less than 5 µs, and kept sync", all.narrow, 0),
        ("fails the second rule alone", all.second, all.second_and_lost),
    ] {
        println!("{verdict:42}  {kept:9}  {lost:9}");
    }
    assert_eq!((all.passed_and_lost, all.failed_and_kept), (0, 0), "see above");
}
