//! SYNC0 and SYNC1, as registers, events and the device behind see them.

use std::sync::{Arc, Mutex};

use linesman_proto::command::Command;
use linesman_proto::register::Features;
use linesman_proto::time::{Instant, Span};

use super::rig::{Bench, at, hardware, sii};
use crate::controller::{Pdi, SyncSignal};
use crate::device::{Firmware, NoFirmware, Refusal};

/// Signals and when they came.
type Heard = Arc<Mutex<Vec<(SyncSignal, Instant)>>>;

/// A device that writes down when it hears a signal.
#[derive(Debug, Default)]
struct Listener {
    heard: Heard,
    acknowledges: bool,
}

impl Firmware for Listener {
    fn start(&mut self, _now: Instant, _pdi: &mut Pdi<'_>) {}

    fn run(&mut self, _now: Instant, _pdi: &mut Pdi<'_>) -> Option<Instant> {
        None
    }

    fn refuse(&mut self, _refusal: Option<Refusal>) {}

    fn synchronises(&self) -> bool {
        true
    }

    fn sync(&mut self, signal: SyncSignal, now: Instant, pdi: &mut Pdi<'_>) -> Option<Instant> {
        if self.acknowledges {
            pdi.acknowledge_sync(signal);
        }
        self.heard.lock().unwrap().push((signal, now));
        None
    }
}

/// Pulses of 10 µs, both signals mapped to AL events when `mapped`.
fn image(pulse: u16, mapped: bool) -> Vec<u8> {
    let mut image = sii(false);
    image[1] |= 0x0C;
    image[3] = if mapped { 0x88 } else { 0 };
    image[4..6].copy_from_slice(&pulse.to_le_bytes());
    image[14..16].copy_from_slice(&[0xA4, 0x88]);
    image
}

fn plain(pulse: u16) -> Bench {
    Bench::with(hardware(), image(pulse, false), Box::new(NoFirmware))
}

fn u64_at(bench: &mut Bench, ado: u16) -> u64 {
    u64::from_le_bytes(bench.read(ado, 8).unwrap().try_into().unwrap())
}

fn now(bench: &Bench) -> u64 {
    bench.controller.local_time(bench.now)
}

/// Sets the unit going: SYNC0 first `ahead` from now, cycles in ns.
fn start(bench: &mut Bench, ahead: u64, sync0: u32, sync1: u32, activation: u8) -> u64 {
    let start = now(bench) + ahead;
    bench.write(0x0990, &start.to_le_bytes());
    bench.write(0x09A0, &sync0.to_le_bytes());
    bench.write(0x09A4, &sync1.to_le_bytes());
    assert_eq!(bench.write(0x0981, &[activation]), 1);
    start
}

#[test]
fn the_next_pulse_is_shown() {
    let mut bench = plain(1_000);
    let first = start(&mut bench, 1_000_000, 500_000, 0, 0x03);
    assert_eq!(u64_at(&mut bench, 0x0990), first);
    bench.wait(Span::us(900));
    assert_eq!(u64_at(&mut bench, 0x0990), first, "not yet");
    bench.wait(Span::us(150));
    assert_eq!(u64_at(&mut bench, 0x0990), first + 500_000);
    bench.wait(Span::ms(10));
    assert_eq!(u64_at(&mut bench, 0x0990), first + 21 * 500_000);
    assert_eq!(bench.byte(0x098E), 0, "nothing to acknowledge in pulse mode");
    bench.write(0x0981, &[0]);
    bench.wait(Span::ms(10));
    assert_eq!(u64_at(&mut bench, 0x0990), first + 21 * 500_000, "it has stopped");
}

#[test]
fn a_start_in_the_past_never_comes() {
    let mut bench = plain(1_000);
    bench.wait(Span::ms(10));
    let past = now(&bench) - 1_000;
    bench.write(0x0990, &past.to_le_bytes());
    bench.write(0x09A0, &1_000_000u32.to_le_bytes());
    bench.write(0x0981, &[0x03]);
    bench.wait(Span::s(20));
    assert_eq!(u64_at(&mut bench, 0x0990), past);
}

#[test]
fn a_start_in_the_past_comes_with_the_wrap_of_32_bits() {
    let mut narrow = hardware();
    narrow.features = Features(narrow.features).with_clock_64_bit(false).0;
    let mut bench = Bench::with(narrow, image(1_000, false), Box::new(NoFirmware));
    bench.wait(Span::ms(10));
    let past = now(&bench) as u32 - 1_000_000;
    bench.write(0x0990, &past.to_le_bytes());
    bench.write(0x09A0, &1_000_000u32.to_le_bytes());
    bench.write(0x0981, &[0x03]);
    let next =
        |bench: &mut Bench| u32::from_le_bytes(bench.read(0x0990, 4).unwrap().try_into().unwrap());
    bench.wait(Span::s(4));
    assert_eq!(next(&mut bench), past);
    bench.wait(Span::ms(300));
    assert_ne!(next(&mut bench), past, "4.295 s later");
    assert_eq!(bench.read(0x0994, 4), None);
}

fn listen(pulse: u16, acknowledges: bool) -> (Bench, Heard) {
    let listener = Listener { acknowledges, ..Listener::default() };
    let heard = Arc::clone(&listener.heard);
    (Bench::with(hardware(), image(pulse, false), Box::new(listener)), heard)
}

/// When a signal came, as local time behind `zero`, in ns.
fn times(heard: &Heard, bench: &Bench, which: SyncSignal, zero: u64) -> Vec<u64> {
    let heard = heard.lock().unwrap();
    let mine = heard.iter().filter(|(signal, _)| *signal == which);
    mine.map(|(_, at)| bench.controller.local_time(*at) - zero).collect()
}

// proves: SYN-20 partial: SYNC0 and SYNC1 come at the system times that were set
#[test]
fn pulses_come_at_their_system_times() {
    // SYNC1 cycle, and when SYNC1 comes in units of the SYNC0 cycle (100 µs) and 20 µs.
    let table: [(u32, &[u64]); 5] = [
        (0, &[0, 100, 200, 300, 400, 500]),
        (20, &[20, 120, 220, 320, 420, 520]),
        (100, &[100, 300, 500]),
        (150, &[150, 350]),
        (220, &[220, 520]),
    ];
    for (sync1, expected) in table {
        let (mut bench, heard) = listen(1_000, false);
        bench.controller.set_drift(bench.now, 33_333, 0, Span::ZERO);
        let zero = start(&mut bench, 200_000, 100_000, sync1 * 1_000, 0x07);
        bench.wait(Span::us(700));
        let sync0 = times(&heard, &bench, SyncSignal::Sync0, zero);
        let expected0: Vec<u64> = (0..6).map(|n| n * 100_000).collect();
        assert_eq!(sync0.len(), 6, "{sync0:?}");
        assert!(sync0.iter().zip(&expected0).all(|(at, due)| at.abs_diff(*due) < 10), "{sync0:?}");
        let sync1_times = times(&heard, &bench, SyncSignal::Sync1, zero);
        let expected: Vec<u64> = expected.iter().map(|us| us * 1_000).collect();
        assert_eq!(sync1_times.len(), expected.len(), "cycle {sync1} µs: {sync1_times:?}");
        for (at, due) in sync1_times.iter().zip(&expected) {
            assert!(at.abs_diff(*due) < 10, "cycle {sync1} µs: {sync1_times:?}");
        }
    }
}

#[test]
fn a_cycle_of_0_is_a_single_pulse() {
    let (mut bench, heard) = listen(1_000, false);
    let zero = start(&mut bench, 50_000, 0, 30_000, 0x07);
    bench.wait(Span::ms(5));
    assert_eq!(times(&heard, &bench, SyncSignal::Sync0, zero), [0]);
    assert_eq!(times(&heard, &bench, SyncSignal::Sync1, zero), [30_000]);
}

#[test]
fn without_acknowledgement_there_is_one_edge() {
    let (mut bench, heard) = listen(0, false);
    start(&mut bench, 50_000, 100_000, 0, 0x03);
    bench.wait(Span::ms(1));
    assert_eq!(heard.lock().unwrap().len(), 1);
    assert_eq!(bench.byte(0x098E), 1, "it is active still");

    let (mut bench, heard) = listen(0, true);
    start(&mut bench, 50_000, 100_000, 0, 0x03);
    bench.wait(Span::us(970));
    assert_eq!(heard.lock().unwrap().len(), 10);
    assert_eq!(bench.byte(0x098E), 0);
}

#[test]
fn pulses_are_al_events_where_they_are_mapped() {
    let mut bench = Bench::with(hardware(), image(1_000, true), Box::new(NoFirmware));
    let event = |bench: &mut Bench| bench.byte(0x0220) & 0x0C;
    start(&mut bench, 100_000, 200_000, 50_000, 0x07);
    bench.wait(Span::us(50));
    assert_eq!(event(&mut bench), 0);
    // 10 µs after its edge a pulse is over.
    let mut seen = Vec::new();
    for _ in 0..60 {
        let events = event(&mut bench);
        if seen.last() != Some(&events) {
            seen.push(events);
        }
    }
    assert_eq!(seen[..5], [0, 4, 0, 8, 0], "{seen:?}");
}

#[test]
fn the_processor_can_own_the_unit() {
    let mut bench = plain(1_000);
    assert_eq!(bench.write(0x09A0, &1_000_000u32.to_le_bytes()), 1);
    bench.write(0x0980, &[0x01]);
    for ado in [0x0981, 0x0990, 0x09A0, 0x09A4] {
        assert_eq!(bench.write(ado, &[0]), 0, "0x{ado:04X}");
    }
    assert_eq!(bench.write(0x09A8, &[1]), 1, "LATCH0 is for EtherCAT still");
    bench.write(0x0980, &[0x10]);
    assert_eq!(bench.write(0x0981, &[0]), 1);
    assert_eq!((bench.write(0x09A8, &[1]), bench.write(0x09A9, &[1])), (0, 1));
}

#[test]
fn extras_of_the_activation_need_the_feature() {
    let mut bench = plain(1_000);
    bench.write(0x0981, &[0xFA]);
    assert_eq!(bench.byte(0x0981), 0x02);

    let mut enhanced = hardware();
    enhanced.controller_type = 0x04;
    enhanced.features = Features(enhanced.features).with_enhanced_sync_activation(true).0;
    let mut bench = Bench::with(enhanced, image(1_000, false), Box::new(NoFirmware));
    // The start time activates by itself.
    bench.write(0x09A0, &1_000_000u32.to_le_bytes());
    bench.write(0x0981, &[0x0A]);
    let first = now(&bench) + 2_000_000;
    bench.write(0x0990, &first.to_le_bytes());
    assert_eq!(bench.byte(0x0981), 0x0B);
    assert_eq!(bench.byte(0x0984), 0x01, "SYNC0 is still to come");
    bench.wait(Span::ms(3));
    assert_eq!(bench.byte(0x0984), 0x00);
    assert_eq!(u64_at(&mut bench, 0x0990), first + 2_000_000);
    // A start time of 32 bits, extended; and one in the past, found out.
    bench.write(0x0981, &[0]);
    let next = now(&bench) + 1_000_000;
    bench.write(0x0990, &(next & 0xFFFF_FFFF).to_le_bytes());
    bench.write(0x0981, &[0x13]);
    assert_eq!(u64_at(&mut bench, 0x0990), next);
    bench.write(0x0981, &[0]);
    let past = now(&bench) - 1_000_000;
    bench.write(0x0990, &past.to_le_bytes());
    bench.write(0x0981, &[0x23]);
    bench.wait(Span::us(10));
    assert_eq!(bench.byte(0x0984), 0x04);
    assert!(u64_at(&mut bench, 0x0990) > past + 1_000_000, "it runs at once");
}

#[test]
fn a_jump_of_the_time_over_a_pulse_loses_all() {
    let mut bench = plain(1_000);
    let first = start(&mut bench, 1_000_000, 1_000_000, 0, 0x03);
    bench.write(0x0920, &5_000_000u64.to_le_bytes());
    bench.wait(Span::ms(20));
    assert_eq!(u64_at(&mut bench, 0x0990), first);
}

#[test]
fn pulses_follow_the_loop() {
    let (mut bench, heard) = listen(1_000, false);
    bench.controller.set_drift(bench.now, 50_000, 0, Span::ZERO);
    for _ in 0..15_000 {
        let time = bench.now.as_nanos() as u32;
        bench.exchange(Command::Apwr, at(0, 0x0910), &time.to_le_bytes());
        bench.wait(Span::us(4));
    }
    let zero = bench.now.as_nanos() + 1_000_000;
    bench.write(0x0990, &zero.to_le_bytes());
    bench.write(0x09A0, &250_000u32.to_le_bytes());
    bench.write(0x0981, &[0x03]);
    for _ in 0..1_000 {
        let time = bench.now.as_nanos() as u32;
        bench.exchange(Command::Apwr, at(0, 0x0910), &time.to_le_bytes());
        bench.wait(Span::us(240));
    }
    let heard = heard.lock().unwrap();
    assert!(heard.len() > 900, "{}", heard.len());
    for (n, (_, at)) in heard.iter().enumerate() {
        let due = zero + n as u64 * 250_000;
        assert!(at.as_nanos().abs_diff(due) < 100, "pulse {n} at {} ns, due {due}", at.as_nanos());
    }
}

#[test]
fn without_the_unit_there_are_no_registers() {
    let mut image = sii(false);
    image[1] = 0x08;
    let mut bench = Bench::with(hardware(), image, Box::new(NoFirmware));
    assert_eq!(bench.read(0x0981, 1), None);
    assert!(bench.read(0x0980, 1).is_some() && bench.read(0x09AE, 2).is_some());
}
