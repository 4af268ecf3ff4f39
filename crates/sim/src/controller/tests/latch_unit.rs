//! LATCH0 and LATCH1.

use linesman_proto::time::{Instant, Span};

use super::rig::{Bench, hardware, sii};
use crate::controller::{LatchInput, Pdi};
use crate::device::{Firmware, Refusal, SignalId};

/// A device that wires two signals to the inputs of the unit.
#[derive(Debug)]
struct Wired;

impl Firmware for Wired {
    fn start(&mut self, _now: Instant, _pdi: &mut Pdi<'_>) {}

    fn run(&mut self, _now: Instant, _pdi: &mut Pdi<'_>) -> Option<Instant> {
        None
    }

    fn refuse(&mut self, _refusal: Option<Refusal>) {}

    fn samples(&self) -> bool {
        true
    }

    fn sample(&mut self, now: Instant, pdi: &mut Pdi<'_>) {
        for (input, signal) in LatchInput::ALL.into_iter().zip([SignalId(0), SignalId(1)]) {
            let high = pdi.signals().is_high(signal);
            pdi.set_latch_input(input, high, now);
        }
    }
}

fn bench() -> Bench {
    let mut image = sii(false);
    image[1] |= 0x0C;
    Bench::with(hardware(), image, Box::new(Wired))
}

fn u64_at(bench: &mut Bench, ado: u16) -> u64 {
    u64::from_le_bytes(bench.read(ado, 8).unwrap().try_into().unwrap())
}

/// Sets the first input and gives the system time of the edge.
fn edge(bench: &mut Bench, high: bool) -> u64 {
    bench.signals.set(SignalId(0), i32::from(high));
    let time = bench.controller.local_time(bench.now);
    bench.byte(0x0000);
    bench.wait(Span::us(100));
    time
}

#[test]
fn every_edge_in_continuous_mode() {
    let mut bench = bench();
    for _ in 0..3 {
        let rises = edge(&mut bench, true);
        assert_eq!(bench.byte(0x09AE), 0x04, "the level, no event");
        assert_eq!(u64_at(&mut bench, 0x09B0), rises);
        let falls = edge(&mut bench, false);
        assert_eq!(bench.byte(0x09AE), 0x00);
        assert_eq!((u64_at(&mut bench, 0x09B0), u64_at(&mut bench, 0x09B8)), (rises, falls));
    }
    assert_eq!(u64_at(&mut bench, 0x09C0), 0, "the other input");
}

#[test]
fn the_first_edge_in_single_mode_until_it_is_read() {
    let mut bench = bench();
    bench.write(0x09A8, &[0x03]);
    let first = edge(&mut bench, true);
    edge(&mut bench, false);
    edge(&mut bench, true);
    assert_eq!(bench.byte(0x09AE), 0x07);
    assert_eq!(bench.word(0x0210) & 1, 1);
    assert_eq!(u64_at(&mut bench, 0x09B0), first);
    assert_eq!(bench.byte(0x09AE), 0x06, "the falling edge was not read yet");
    assert_eq!(bench.word(0x0210) & 1, 1);
    u64_at(&mut bench, 0x09B8);
    assert_eq!((bench.byte(0x09AE), bench.word(0x0210) & 1), (0x04, 0));
    edge(&mut bench, false);
    let again = edge(&mut bench, true);
    assert_eq!(u64_at(&mut bench, 0x09B0), again);
}

#[test]
fn frame_does_not_clear_what_the_processor_owns() {
    let mut bench = bench();
    bench.write(0x09A8, &[0x01]);
    bench.write(0x0980, &[0x10]);
    edge(&mut bench, true);
    assert_eq!((bench.byte(0x0220) & 2, bench.word(0x0210) & 1), (2, 0));
    u64_at(&mut bench, 0x09B0);
    assert_eq!((bench.byte(0x09AE), bench.byte(0x0220) & 2), (0x05, 2));
}
