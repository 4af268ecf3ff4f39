//! How many frames of a capture the engine takes in a second.
//!
//! The frames are those of a line in OP: process data and a poll of AL status, out and back, without
//! reading a file. `cargo bench -p linesman-diagnosis`.

#![allow(clippy::unwrap_used, reason = "a measurement that fails may panic")]
#![allow(clippy::disallowed_methods, clippy::disallowed_macros, reason = "it measures and prints")]
#![allow(clippy::disallowed_types, reason = "it measures")]

#[path = "../tests/evidence/support/mod.rs"]
mod support;

use std::time::Instant as Clock;

use linesman_diagnosis::{Direction, FrameSeen};
use linesman_proto::address::Network;
use linesman_proto::time::Instant;
use support::script::{Script, fprd, frame, lrw};

const FRAMES: u64 = 2_000_000;

fn main() {
    for (name, devices, len) in
        [("3 devices, 16 bytes", 3, 16), ("50 devices, 1000 bytes", 50, 1000)]
    {
        let mut script = Script::scanned(devices);
        // As many different indices as a MainDevice has.
        let cycle: Vec<_> = (0..=255_u8)
            .flat_map(|index| {
                let station = 0x1001 + u16::from(index) % devices;
                let datagrams = [lrw(0x0100_0000, len, 3), fprd(station, 0x0130, &[8, 0])];
                [frame(&datagrams, index, false), frame(&datagrams, index, true)]
            })
            .collect();
        let begin = Clock::now();
        for number in 0..FRAMES {
            script.engine.handle_frame(&FrameSeen {
                network: Network(0),
                path: None,
                direction: Direction::Unknown,
                time: Instant::from_nanos(script.now + number * 50_000),
                number,
                fcs: None,
                truncated: false,
                probe: None,
                bytes: &cycle[number as usize % cycle.len()],
            });
        }
        let seconds = begin.elapsed().as_secs_f64();
        script.engine.finish(Instant::from_nanos(script.now), true);
        let report = script.engine.diagnosis();
        assert_eq!(report.network.unanswered.0, 0);
        println!("{name}: {:.2} million frames/s", FRAMES as f64 / seconds / 1e6);
    }
}
