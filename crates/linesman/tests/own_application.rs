//! Fault tests of an application, as its author writes them.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use linesman::prelude::*;
use linesman::{FaultEntry, FaultName};

#[allow(dead_code, unreachable_pub, reason = "it is a program of its own, too")]
#[path = "../examples/blink.rs"]
mod blink;

use blink::blink;

// region: fault-test
#[test]
fn lamp_program_stops_when_the_buttons_are_cut_off() {
    let devices = [("K1", "EK1100"), ("Lamps", "EL2008"), ("Buttons", "EL1008")];
    let mut segment = Segment::simulated(&SegmentFile::in_a_row("test", 1, &devices)).unwrap();
    let cut = FaultEntry::new(FaultName::LinkOpen).at("Lamps.B-Buttons.A");
    segment.inject(&cut.from_to(1_000.0, None)).unwrap();
    let report = blink(&mut segment).unwrap();
    let devices: Vec<bool> = report.devices.iter().map(|device| device.valid).collect();
    assert_eq!(devices, [true, true, false], "the buttons are gone");
    let ran_ms = report.time_ns / 1_000_000;
    assert!((900..1_100).contains(&ran_ms), "it stopped ten cycles later, not after {ran_ms} ms");
}
// endregion
