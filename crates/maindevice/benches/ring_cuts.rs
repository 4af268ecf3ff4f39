//! Cycles that a ring loses when its cables are cut and mended at many moments of the cycle, and inputs that are shown as
//! fresh although they are not: at cuts, two cuts, starts with a cable open, SubDevices that are off.
//!
//! ```text
//! cargo bench -p linesman-maindevice --bench ring_cuts              50 SubDevices, 100 phases
//! cargo bench -p linesman-maindevice --bench ring_cuts -- 50 1000   more phases
//! ```
//!
//! Time is virtual. It fails when an event costs more than one cycle, or anything stale is shown as fresh.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a measurement that fails may panic")]
#![allow(clippy::print_stdout, clippy::disallowed_macros, reason = "this prints a table")]

#[allow(dead_code, reason = "shared with the tests")]
#[path = "../tests/segment/bench.rs"]
mod bench;
#[allow(dead_code, reason = "shared with the tests")]
#[path = "../tests/segment/ring_cuts.rs"]
mod ring_cuts;

use ring_cuts::RingOfBoxes;

fn main() {
    let numbers: Vec<u32> = std::env::args().filter_map(|word| word.parse().ok()).collect();
    let (devices, phases) = match numbers.as_slice() {
        [devices, phases] => (*devices, *phases),
        _ => (50, 100),
    };
    let ring = RingOfBoxes::new(devices as usize);
    let (when_cut, when_mended) = ring.lost_cycles(phases);
    println!("SubDevices  phases  event   cycles lost: 0     1  more");
    for (event, [none, one, more]) in [("cut", when_cut), ("mended", when_mended)] {
        println!("{devices:10}  {phases:6}  {event:6}  {none:14}  {one:4}  {more:4}");
    }
    let pairs = (devices * (devices + 1) / 2 / 100).max(1) as usize;
    let mut all_stale = 0;
    println!("\nevent                            times  stale inputs shown as fresh");
    for (event, (times, stale)) in [
        ("started with a cable open", ring.started_open()),
        ("two cables cut, then mended", ring.two_cuts(pairs)),
        ("a SubDevice off, then on", ring.one_off()),
    ] {
        println!("{event:31}  {times:5}  {stale:5}");
        all_stale += stale;
    }
    assert_eq!((when_cut[2], when_mended[2], all_stale), (0, 0, 0), "see above");
}
