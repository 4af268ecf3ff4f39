//! The two watchdogs.

use linesman_proto::register::{AlEvents, SmControl};
use linesman_proto::time::Span;

use super::rig::{Bench, hardware, sii};
use crate::device::NoFirmware;

fn outputs(bench: &mut Bench) {
    assert_eq!(bench.write(0x1000, &[1; 4]), 1);
}

fn expired(bench: &mut Bench) -> bool {
    bench.word(0x0440) & 1 == 0
}

#[test]
fn fresh_outputs_keep_it_awake() {
    let mut bench = Bench::new();
    bench.guard(2, 0x1000, 4, SmControl::OUTPUTS);
    assert!(expired(&mut bench), "never started");
    for _ in 0..5 {
        outputs(&mut bench);
        bench.wait(Span::ms(90));
        assert!(!expired(&mut bench));
    }
    bench.wait(Span::ms(11));
    assert!(expired(&mut bench));
    assert_eq!(bench.byte(0x0442), 1);
    assert!(bench.pdi(|pdi| pdi.events()).contains(AlEvents::PROCESS_DATA_WATCHDOG));
    assert!(bench.pdi(|pdi| pdi.watchdog_expired()));
    assert!(!bench.pdi(|pdi| pdi.events()).contains(AlEvents::PROCESS_DATA_WATCHDOG));
    bench.wait(Span::s(1));
    assert_eq!(bench.byte(0x0442), 1, "it expires once");
    outputs(&mut bench);
    assert!(!expired(&mut bench));
    assert!(!bench.pdi(|pdi| pdi.watchdog_expired()));
}

#[test]
fn only_whole_writes_to_watched_buffers_count() {
    let mut bench = Bench::new();
    bench.guard(2, 0x1000, 4, SmControl::OUTPUTS);
    bench.guard(3, 0x1100, 4, SmControl::OUTPUTS_WITHOUT_WATCHDOG);
    bench.write(0x1000, &[1; 3]);
    bench.write(0x1100, &[1; 4]);
    bench.write(0x1200, &[1; 4]);
    assert!(expired(&mut bench));
    bench.write(0x1003, &[1]);
    assert!(!expired(&mut bench));
}

#[test]
fn one_byte_of_digital_outputs_triggers_it() {
    let mut bench = Bench::new();
    bench.guard(0, 0x0F00, 1, SmControl::OUTPUTS_WITHOUT_EVENT);
    bench.write(0x0F00, &[1]);
    assert!(!expired(&mut bench));
    bench.wait(Span::ms(99));
    bench.byte(0x0F00);
    bench.wait(Span::ms(2));
    assert!(expired(&mut bench), "reading does not help");
}

#[test]
fn times_are_set_by_registers() {
    let mut bench = Bench::new();
    bench.guard(2, 0x1000, 4, SmControl::OUTPUTS);
    // A tick of 1 ms, ten of them.
    bench.write(0x0400, &24_998u16.to_le_bytes());
    bench.write(0x0420, &10u16.to_le_bytes());
    outputs(&mut bench);
    bench.wait(Span::us(9_900));
    assert!(!expired(&mut bench));
    bench.wait(Span::us(1_200));
    assert!(expired(&mut bench));
    bench.write(0x0420, &[0, 0]);
    assert!(!expired(&mut bench), "off is not expired");
    bench.wait(Span::s(10));
    assert!(!expired(&mut bench));
    assert_eq!(bench.byte(0x0442), 1);
    bench.write(0x0420, &10u16.to_le_bytes());
    outputs(&mut bench);
    bench.wait(Span::ms(12));
    assert_eq!(bench.byte(0x0442), 2);
}

#[test]
fn counters_are_cleared_together() {
    let mut bench = Bench::new();
    bench.guard(2, 0x1000, 4, SmControl::OUTPUTS);
    for address in [0x0442, 0x0443] {
        outputs(&mut bench);
        bench.pdi(|pdi| pdi.set_processor_stuck(true));
        bench.wait(Span::ms(102));
        assert_eq!(bench.read(0x0442, 2).unwrap(), [1, 1]);
        bench.pdi(|pdi| pdi.set_processor_stuck(false));
        bench.write(address, &[7]);
        assert_eq!(bench.read(0x0442, 2).unwrap(), [0, 0]);
    }
}

/// As an EK1100 shows it: DL status 0x..31, no interface, no watchdog.
#[test]
fn without_an_interface_its_watchdog_is_not_ok() {
    let mut image = sii(true);
    image[0] = 0;
    let mut bench = Bench::with(hardware(), image, Box::new(NoFirmware));
    assert_eq!(bench.word(0x0110) & 3, 1);
    assert_eq!(bench.byte(0x0443), 0);
}

#[test]
fn a_stuck_processor_shows_in_dl_status() {
    let mut bench = Bench::new();
    assert_eq!(bench.word(0x0110) & 3, 3);
    bench.pdi(|pdi| pdi.set_processor_stuck(true));
    bench.wait(Span::ms(99));
    assert_eq!(bench.word(0x0110) & 3, 3);
    bench.wait(Span::ms(2));
    assert_eq!(bench.word(0x0110) & 3, 1);
    assert_eq!(bench.word(0x0210) & 4, 0, "taken by reading DL status");
    bench.wait(Span::s(1));
    assert_eq!(bench.byte(0x0443), 1);
    bench.pdi(|pdi| pdi.set_processor_stuck(false));
    assert_eq!(bench.word(0x0110) & 3, 3);
}
