//! AL control and status, with a processor behind and without.

use linesman_proto::register::{AlControl, AlEvents, AlStatus};
use linesman_proto::state::{AlState, AlStatusCode};
use linesman_proto::time::{Instant, Span};

use super::rig::{Bench, hardware, sii};
use crate::controller::Pdi;
use crate::device::{Firmware, NoFirmware, Refusal, Signals};

#[test]
fn al_control_waits_until_the_last_request_was_taken() {
    let mut bench = Bench::new();
    assert_eq!(bench.write(0x0120, &[2, 0]), 1);
    assert_eq!(bench.write(0x0120, &[4, 0]), 0, "not before the device has read it");
    assert_eq!(bench.word(0x0120), 2);
    assert_eq!(bench.word(0x0220), 1);
    let preop = AlControl::request(AlState::PreOp);
    assert_eq!(bench.pdi(|pdi| pdi.take_al_control_event()), Some(preop));
    assert_eq!(bench.pdi(|pdi| pdi.take_al_control_event()), None);
    assert_eq!(bench.word(0x0220), 0);
    assert_eq!(bench.write(0x0120, &[0x14, 0]), 1);
    let control = bench.pdi(|pdi| pdi.take_al_control_event()).unwrap();
    assert!(control.acknowledges_error());
}

#[test]
fn al_status_changes_are_told() {
    let mut bench = Bench::new();
    assert_eq!(bench.word(0x0210) & 8, 0);
    bench.pdi(|pdi| {
        pdi.set_al_code(AlStatusCode(0x001E));
        pdi.set_al_status(AlStatus::new(AlState::PreOp).with_error(true));
    });
    assert_eq!(bench.word(0x0210) & 8, 8);
    assert_eq!(bench.read(0x0130, 6).unwrap(), [0x12, 0, 0, 0, 0x1E, 0]);
    assert_eq!(bench.word(0x0210) & 8, 0, "reading takes the event");
    bench.pdi(|pdi| pdi.set_al_status(AlStatus(0x12)));
    assert_eq!(bench.word(0x0210) & 8, 0, "no change");
    assert_eq!(bench.controller.al_code(), AlStatusCode(0x001E));
}

#[test]
fn device_emulation_copies_al_control() {
    let mut bench = Bench::with(hardware(), sii(true), Box::new(NoFirmware));
    for value in [2u16, 4, 8, 1, 0x12, 0x001F] {
        assert_eq!(bench.write(0x0120, &value.to_le_bytes()), 1);
        assert_eq!(bench.word(0x0130), value, "even what makes no sense");
    }
    assert_eq!(bench.word(0x0220), 0, "nobody is told");
    assert_eq!(bench.word(0x0134), 0);
    bench.pdi(|pdi| pdi.set_al_status(AlStatus(8)));
    assert_eq!(bench.word(0x0130), 0x001F, "nor can anybody else set it");
}

/// Notes when it was called, and asks for wake-ups.
#[derive(Debug, Default)]
struct Diary {
    calls: Vec<(u64, u32)>,
    every: Option<Span>,
}

impl Firmware for Diary {
    fn start(&mut self, now: Instant, _pdi: &mut Pdi<'_>) {
        self.calls.push((now.as_nanos(), u32::MAX));
    }

    fn run(&mut self, now: Instant, pdi: &mut Pdi<'_>) -> Option<Instant> {
        self.calls.push((now.as_nanos(), pdi.events().0));
        pdi.take_al_control_event();
        pdi.signals_mut().set(crate::device::SignalId(0), self.calls.len() as i32);
        self.every.map(|every| now + every)
    }

    fn refuse(&mut self, _refusal: Option<Refusal>) {}

    fn stop(&mut self, signals: &mut Signals) {
        signals.set(crate::device::SignalId(0), -1);
    }
}

fn calls(bench: &mut Bench) -> String {
    format!("{:?}", bench.controller.firmware_mut())
}

#[test]
fn the_device_is_called_at_the_end_of_the_frame() {
    let mut bench = Bench::with(hardware(), sii(false), Box::<Diary>::default());
    // Started, called once, then the write of the station address: no event.
    assert_eq!(calls(&mut bench), "Diary { calls: [(0, 4294967295), (0, 0)], every: None }");
    let start = bench.now;
    assert_eq!(bench.write(0x0120, &[2, 0]), 1);
    // 64 bytes and a preamble.
    let end = start + Span::ns(5_760);
    let expected = format!("({}, {})]", end.as_nanos(), AlEvents::AL_CONTROL.0);
    assert!(calls(&mut bench).contains(&expected), "{}", calls(&mut bench));
}

#[test]
fn wake_ups_come_on_time_however_rarely_time_is_told() {
    let run = |steps: u64| {
        let diary = Diary { every: Some(Span::us(300)), ..Diary::default() };
        let mut bench = Bench::with(hardware(), sii(false), Box::new(diary));
        for _ in 0..steps {
            bench.wait(Span::ns(3_000_000 / steps));
        }
        (calls(&mut bench), bench.controller.next_event())
    };
    let (diary, next) = run(1);
    assert_eq!(diary.matches("), (").count(), 11, "{diary}");
    assert_eq!(run(1_000).0, diary);
    assert!(next.is_some());
}

#[test]
fn a_wake_up_in_the_past_does_not_stop_time() {
    let diary = Diary { every: Some(Span::ZERO), ..Diary::default() };
    let mut bench = Bench::with(hardware(), sii(false), Box::new(diary));
    bench.wait(Span::us(100));
    assert!((100..=120).contains(&bench.signals.value(crate::device::SignalId(0))));
}

#[test]
fn without_power_the_device_drives_nothing() {
    let mut bench = Bench::with(hardware(), sii(false), Box::<Diary>::default());
    assert_eq!(bench.signals.value(crate::device::SignalId(0)), 2);
    bench.controller.power_off(bench.now);
    assert_eq!(bench.controller.next_event(), Some(bench.now));
    bench.wait(Span::us(1));
    assert_eq!(bench.signals.value(crate::device::SignalId(0)), -1);
    assert_eq!(bench.controller.next_event(), None);
}
