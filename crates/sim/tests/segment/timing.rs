//! Faults of clocks and deadlines, and what they leave.

use linesman_config::fault::FaultName;
use linesman_proto::address::Path;
use linesman_proto::command::Command;
use linesman_proto::time::{Instant, Span};
use linesman_sim::segment_file::{FaultEntry, SegmentFile};
use linesman_sim::truth::{Effect, Entry};

use super::clocks::{Clocks, drifting};
use super::rig::{Bench, at, frame};

const CYCLE: Span = Span::ms(1);

/// Difference of a device, as 0x092C has it, without its sign.
fn difference(clocks: &mut Clocks, node: usize) -> u32 {
    u32::from_le_bytes(clocks.read(node, 0x092C).unwrap()) & 0x7FFF_FFFF
}

fn aligned() -> (Clocks, usize, Vec<usize>) {
    let mut clocks = Clocks::of(&drifting(0.0));
    let reference = clocks.set_up();
    clocks.distribute(reference, 15_000, Span::us(50));
    clocks.distribute(reference, 1_000, CYCLE);
    assert!(clocks.window() < 0x80, "{:#X}", clocks.window());
    let nodes = clocks.clocked();
    (clocks, reference, nodes)
}

fn has_effect(bench: &Bench, wanted: impl Fn(&Effect) -> bool) -> bool {
    bench.segment.truth().entries().iter().any(
        |entry| matches!(entry, Entry::Effect { fault: Some(_), effect, .. } if wanted(effect)),
    )
}

#[test]
fn a_quartz_out_of_reach_leaves_the_window_and_no_other_does() {
    let (mut clocks, reference, nodes) = aligned();
    let name = clocks.bench.segment.name(clocks.devices[nodes[4]]).to_owned();
    let entry = FaultEntry::new(FaultName::ClockDrift).device(&name).with("ppm", 1_200.0);
    let fault = clocks.bench.inject(&entry);
    clocks.distribute(reference, 8_000, CYCLE);
    for node in nodes.clone() {
        let off = difference(&mut clocks, node);
        if node == nodes[4] {
            assert!(off > 100_000, "{off} ns");
        } else {
            assert!(off < 200, "{node}: {off} ns");
        }
    }
    // The speed counter of the bad one stands at its limit: 0x1000 - 0x7F.
    let diff = i16::from_le_bytes(clocks.read(nodes[4], 0x0932).unwrap());
    assert!(diff < -3_500, "{diff}");
    assert!(has_effect(&clocks.bench, |effect| *effect == Effect::ClockDrifts { ppb: 1_200_000 }));
    clocks.bench.heal(fault);
    clocks.distribute(reference, 1_000, CYCLE);
    assert!(has_effect(&clocks.bench, |effect| *effect == Effect::ClockRestored));
    clocks.bench.assert_audit();
}

#[test]
fn a_quartz_within_reach_is_held() {
    let (mut clocks, reference, nodes) = aligned();
    let name = clocks.bench.segment.name(clocks.devices[nodes[3]]).to_owned();
    clocks.bench.inject(&FaultEntry::new(FaultName::ClockDrift).device(&name).with("ppm", -55.0));
    clocks.distribute(reference, 20_000, CYCLE);
    assert!(difference(&mut clocks, nodes[3]) < 100);
}

#[test]
fn a_reference_that_is_lost_leads_all_others_astray() {
    for how in ["stands", "starts-anew"] {
        let (mut clocks, reference, nodes) = aligned();
        let name = clocks.bench.segment.name(clocks.devices[reference]).to_owned();
        let entry = FaultEntry::new(FaultName::ReferenceClockLost).device(&name).with("how", how);
        clocks.bench.inject(&entry);
        clocks.distribute(reference, 200, CYCLE);
        for node in nodes.clone() {
            let off = difference(&mut clocks, node);
            assert_eq!(off > 10_000, node != reference, "{how}: {node} {off} ns");
        }
        assert!(clocks.window() > 0xFFFF);
        let effect = if how == "stands" { Effect::ClockStopped } else { Effect::ClockRestarted };
        assert!(has_effect(&clocks.bench, |found| *found == effect));
        clocks.bench.assert_audit();
    }
}

/// One terminal in OP, in step with SYNC0 each millisecond; its clock is the time of the run.
struct InStep {
    bench: Bench,
}

const TERMINAL: &str = r#"
name = "in step"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
clock_ppm = 0.0
clock = { ramp_ppm_per_s = 0.0, jitter_ns = 0, start_ns = 0 }
[[device]]
name = "T2"
type = "EL4102"
on = "K1.B"
clock_ppm = 0.0
clock = { ramp_ppm_per_s = 0.0, jitter_ns = 0, start_ns = 0 }
"#;

impl InStep {
    fn new() -> Self {
        let mut bench = Bench::of(&SegmentFile::parse(TERMINAL).unwrap());
        let mut write = |ado: u16, data: &[u8]| {
            let address = at(1u16.wrapping_neg(), ado);
            assert_eq!(bench.send(Command::Apwr, address, data).unwrap().1, 1, "0x{ado:04X}");
        };
        // Mailbox, outputs, as the SII has them.
        write(0x0800, &[0x00, 0x10, 0x80, 0x00, 0x26, 0x00, 0x01, 0x00]);
        write(0x0808, &[0x80, 0x10, 0x80, 0x00, 0x22, 0x00, 0x01, 0x00]);
        write(0x0120, &[2, 0]);
        let mut new = Self { bench };
        new.bench.wait(Span::ms(40));
        assert_eq!(new.status(), (2, 0));
        let mut write = |ado: u16, data: &[u8]| {
            let address = at(1u16.wrapping_neg(), ado);
            assert_eq!(new.bench.send(Command::Apwr, address, data).unwrap().1, 1, "0x{ado:04X}");
        };
        write(0x0810, &[0x00, 0x11, 0x04, 0x00, 0x64, 0x00, 0x01, 0x00]);
        write(0x09A0, &1_000_000u32.to_le_bytes());
        write(0x0990, &100_000_000u64.to_le_bytes());
        write(0x0980, &[0x00, 0x03]);
        write(0x0120, &[4, 0]);
        new.bench.wait(Span::ms(40));
        assert_eq!(new.status(), (4, 0));
        new.go_operational();
        new
    }

    fn go_operational(&mut self) {
        self.bench.send(Command::Apwr, at(1u16.wrapping_neg(), 0x0120), &[8, 0]).unwrap();
        self.run(120, 500);
        assert_eq!(self.status(), (8, 0));
    }

    fn status(&mut self) -> (u8, u16) {
        let address = at(1u16.wrapping_neg(), 0x0130);
        let data = self.bench.send(Command::Aprd, address, &[0; 6]).unwrap().0;
        (data[0], u16::from_le_bytes([data[4], data[5]]))
    }

    /// Cycles with outputs, sent `phase` µs behind each SYNC0.
    fn run(&mut self, cycles: usize, phase: u64) {
        let outputs = frame(Command::Apwr, at(1u16.wrapping_neg(), 0x1100), &[1, 0, 2, 0]);
        for _ in 0..cycles {
            let cycle = CYCLE.as_nanos();
            let now = self.bench.now.as_nanos();
            let mut next = now / cycle * cycle + phase * 1_000;
            if next <= now {
                next += cycle;
            }
            let next = Instant::from_nanos(next);
            let rest = next.since(self.bench.now);
            self.bench.wait(rest);
            self.bench.segment.handle_frame(next, Path::A, &outputs);
        }
        self.bench.wait(Span::us(50));
    }

    fn inject_for(&mut self, entry: &FaultEntry, cycles: usize) {
        let fault = self.bench.inject(entry);
        self.run(cycles, 500);
        self.bench.heal(fault);
        self.run(3, 500);
    }

    /// Its counters of missed events, exceeded cycles, short shifts, as upload shows them.
    fn counters(&mut self) -> [u16; 3] {
        // A counter that was used before would be a repetition.
        [(1u8, 0x0B), (2, 0x0C), (3, 0x0D)].map(|(counter, subindex)| {
            let kind = 0x03 | counter << 4;
            let mut request = [0; 128];
            request[..16].copy_from_slice(&[
                0x0A, 0, 0, 0, 0, kind, 0x00, 0x20, 0x40, 0x32, 0x1C, subindex, 0, 0, 0, 0,
            ]);
            let slave = 1u16.wrapping_neg();
            assert_eq!(self.bench.send(Command::Apwr, at(slave, 0x1000), &request).unwrap().1, 1);
            self.bench.wait(Span::ms(5));
            let answer = self.bench.send(Command::Aprd, at(slave, 0x1080), &[0; 128]).unwrap();
            assert_eq!(answer.1, 1, "no answer");
            u16::from_le_bytes([answer.0[12], answer.0[13]])
        })
    }
}

#[test]
fn sync_that_does_not_arrive_ends_op() {
    let mut line = InStep::new();
    line.inject_for(&FaultEntry::new(FaultName::SyncLost).device("T2"), 10);
    assert_eq!(line.status(), (0x14, 0x002C));
    assert!(has_effect(&line.bench, |effect| *effect == Effect::SyncCut));
    assert!(has_effect(&line.bench, |effect| *effect == Effect::SyncBack));
    line.bench.send(Command::Apwr, at(1u16.wrapping_neg(), 0x0120), &[0x14, 0]).unwrap();
    line.bench.wait(Span::ms(5));
    line.go_operational();
    line.bench.assert_audit();
}

// proves: SYN-32 partial: late frame, counter, SAFEOP, locked outputs
#[test]
fn late_frames_miss_their_sync_and_end_op() {
    let mut line = InStep::new();
    let late = FaultEntry::new(FaultName::LateFrames);
    // In time all the same: 400 µs behind 500 there are 100 left.
    line.inject_for(&late.clone().with("late_us", 300.0), 50);
    assert_eq!(line.status(), (8, 0));
    // Behind the next SYNC0 or the one after it, now and then: some cycles get none, others two.
    let now_and_then = late.with("late_us", 2_500.0).with("least_us", 600.0).with("share", 60.0);
    line.inject_for(&now_and_then, 60);
    assert_eq!(line.status(), (0x14, 0x001A));
    let [missed, exceeded, _] = line.counters();
    assert!((5..60).contains(&missed) && exceeded == 0, "{missed} missed, {exceeded} exceeded");
    assert!(has_effect(&line.bench, |effect| matches!(effect, Effect::FrameHeldBack { .. })));
    line.bench.assert_audit();
}

#[test]
fn no_frame_overtakes_another() {
    let mut bench = Bench::plant();
    bench.inject(&FaultEntry::new(FaultName::LateFrames).with("late_us", 5_000.0));
    bench.wait(Span::ms(1));
    let mut arrived = Vec::new();
    for number in 0..200u32 {
        let bytes = frame(Command::Brd, at(0, 0x0F80), &number.to_le_bytes());
        bench.segment.handle_frame(bench.now, Path::A, &bytes);
        arrived.extend(bench.wait(Span::us(100)));
    }
    arrived.extend(bench.wait(Span::ms(20)));
    assert_eq!(arrived.len(), 200, "none is lost");
    let numbers: Vec<u8> =
        arrived.iter().map(|(_, bytes)| super::rig::answer(bytes).0[0]).collect();
    assert!(numbers.is_sorted(), "{numbers:?}");
    bench.assert_audit();
}

#[test]
fn a_device_that_needs_longer_than_the_cycle_says_so() {
    let mut line = InStep::new();
    line.inject_for(&FaultEntry::new(FaultName::CycleTooFast).device("T2"), 20);
    assert_eq!(line.status(), (0x14, 0x001A));
    let [_, exceeded, _] = line.counters();
    assert!(exceeded >= 3, "{exceeded}");
    line.bench.assert_audit();
}
