//! Links, loops and the counters of ports.

use linesman_proto::command::Command;
use linesman_proto::port::Port;
use linesman_proto::register::{DlControl, DlStatus, ErrorCounter, LoopMode, PortState};
use linesman_proto::time::{Instant, Span};

use super::rig::{Bench, at, frame, hardware, sii};
use crate::controller::{CountKind, PortEvent};
use crate::device::NoFirmware;
use crate::hardware::PortKind;
use linesman_proto::register::ErrorCounters;

const SECOND: Span = Span::s(1);

fn set_mode(bench: &mut Bench, port: Port, mode: LoopMode) {
    let control = DlControl(u32::from_le_bytes(bench.read(0x0100, 4).unwrap().try_into().unwrap()));
    let control = control.with_loop_mode(port, mode);
    assert_eq!(bench.write(0x0100, &control.to_bytes()), 1);
}

fn count(bench: &mut Bench, port: Port, kind: CountKind) {
    bench.controller.post(bench.now, PortEvent::Count { port, kind });
    bench.wait(Span::ZERO);
}

fn counter(bench: &Bench, counter: ErrorCounter) -> u8 {
    bench.controller.error_counters().value(counter).unwrap()
}

fn status(bench: &mut Bench) -> DlStatus {
    DlStatus(bench.word(0x0110))
}

// proves: ESC-04 partial, ESC-05 partial, ESC-14 partial
#[test]
fn loops_follow_links_in_mode_auto() {
    let mut bench = Bench::new();
    bench.link(Port::A, true);
    bench.link(Port::C, true);
    assert_eq!(bench.open(), [true, false, true, false]);
    let status = status(&mut bench);
    assert_eq!(status.port_state(Port::A), PortState::IN_USE);
    assert_eq!(status.port_state(Port::B), PortState::UNUSED);
    assert_eq!(status.active_ports().collect::<Vec<_>>(), [Port::A, Port::C]);
    bench.link(Port::C, false);
    assert_eq!(bench.open(), [true, false, false, false]);
}

// proves: ESC-03 partial
#[test]
fn port_a_is_the_way_out_when_all_is_closed() {
    let mut bench = Bench::new();
    assert_eq!(bench.open(), [true, false, false, false]);
    assert_eq!(status(&mut bench).port_state(Port::A), PortState::UNUSED, "the true state");
    bench.link(Port::B, true);
    assert_eq!(bench.open(), [false, true, false, false]);
    for port in Port::ALL {
        set_mode(&mut bench, port, LoopMode::Closed);
    }
    assert_eq!(bench.open(), [true, false, false, false]);
    let closed = PortState { link: true, closed: true, communication: true };
    assert_eq!(status(&mut bench).port_state(Port::B), closed);
}

// proves: ESC-06 partial
#[test]
fn a_port_in_auto_close_waits_for_the_main_device() {
    let mut bench = Bench::new();
    bench.link(Port::A, true);
    bench.link(Port::B, true);
    set_mode(&mut bench, Port::B, LoopMode::AutoClose);
    assert_eq!(bench.open(), [true, true, false, false]);
    bench.link(Port::B, false);
    assert_eq!(bench.open(), [true, false, false, false]);
    bench.link(Port::B, true);
    assert_eq!(bench.open(), [true, false, false, false], "closed, wait");
    bench.write(0x0100, &[1]);
    assert_eq!(bench.open(), [true, false, false, false], "only the loop byte counts");
    set_mode(&mut bench, Port::B, LoopMode::AutoClose);
    assert_eq!(bench.open(), [true, true, false, false]);
}

// proves: ESC-06 partial
#[test]
fn a_good_frame_opens_a_port_in_auto_close() {
    let mut bench = Bench::new();
    bench.link(Port::A, true);
    set_mode(&mut bench, Port::B, LoopMode::AutoClose);
    let mut probe = frame(&[(Command::Brd, at(0, 0), &[0])]);
    bench.controller.enters(bench.now, Port::B, &probe);
    bench.wait(Span::us(10));
    assert!(!bench.controller.is_open(Port::B), "without a link nothing comes in");
    bench.link(Port::B, true);
    probe.damage.fcs_bad = true;
    bench.controller.enters(bench.now, Port::B, &probe);
    bench.wait(Span::us(10));
    assert!(!bench.controller.is_open(Port::B), "a bad frame does not count");
    probe.damage.fcs_bad = false;
    bench.controller.enters(bench.now, Port::B, &probe);
    bench.wait(probe.duration().saturating_sub(Span::ns(1)));
    assert!(!bench.controller.is_open(Port::B), "its end is still to come");
    bench.wait(Span::ns(1));
    assert!(bench.controller.is_open(Port::B));
}

// proves: ESC-06 partial
#[test]
fn loops_by_hand_ignore_links() {
    let mut bench = Bench::new();
    bench.link(Port::A, true);
    set_mode(&mut bench, Port::B, LoopMode::Open);
    assert_eq!(bench.open(), [true, true, false, false]);
    let open = PortState { link: false, closed: false, communication: false };
    assert_eq!(status(&mut bench).port_state(Port::B), open);
    set_mode(&mut bench, Port::A, LoopMode::Closed);
    assert_eq!(bench.open(), [false, true, false, false]);
    bench.link(Port::A, false);
    bench.link(Port::A, true);
    assert_eq!(bench.open(), [false, true, false, false]);
}

#[test]
fn a_loop_changes_when_its_frame_has_passed() {
    let mut bench = Bench::new();
    bench.link(Port::A, true);
    bench.link(Port::B, true);
    let control = DlControl::RESET.with_loop_mode(Port::B, LoopMode::Closed);
    let mut probe = frame(&[(Command::Bwr, at(0, 0x0100), &control.to_bytes())]);
    let start = bench.now;
    let _ = bench.controller.process(start, &mut probe, &mut bench.signals);
    assert!(bench.controller.is_open(Port::B), "it goes out this way");
    let end = start + probe.duration();
    assert_eq!(bench.controller.next_event(), Some(end));
    assert!(bench.controller.is_open_at(Port::B, end - Span::ns(1)));
    assert!(!bench.controller.is_open_at(Port::B, end));
    bench.controller.advance(end, &mut bench.signals);
    assert!(!bench.controller.is_open(Port::B));
}

#[test]
fn temporary_loops_return_after_a_second() {
    let mut bench = Bench::new();
    bench.link(Port::A, true);
    bench.link(Port::B, true);
    let closed = DlControl::RESET.with_loop_mode(Port::B, LoopMode::Closed).with_temporary(true);
    bench.write(0x0100, &closed.to_bytes());
    bench.wait(Span::ms(990));
    assert!(!bench.controller.is_open(Port::B));
    // Written again, it lasts longer, and what returns is still what was there at first.
    bench.write(0x0100, &closed.to_bytes());
    bench.wait(Span::ms(990));
    assert!(!bench.controller.is_open(Port::B));
    assert!(bench.controller.is_open_at(Port::B, bench.now + SECOND));
    bench.wait(Span::ms(20));
    assert!(bench.controller.is_open(Port::B));
    assert_eq!(bench.read(0x0100, 4).unwrap(), DlControl::RESET.to_bytes());
}

#[test]
fn port_event_posted_ahead_is_foreseen() {
    let mut bench = Bench::new();
    bench.link(Port::A, true);
    let (down, up) = (bench.now + Span::ms(1), bench.now + Span::ms(2));
    bench.controller.post(up, PortEvent::Link { port: Port::A, up: true });
    bench.controller.post(down, PortEvent::Link { port: Port::A, up: false });
    bench.controller.post(down, PortEvent::Link { port: Port::B, up: true });
    let open = |at: Instant| bench.controller.is_open_at(Port::A, at);
    assert!(open(down - Span::ns(1)) && !open(down) && !open(up - Span::ns(1)) && open(up));
    assert_eq!(bench.controller.next_event(), Some(down));
    bench.wait(Span::us(1_500));
    assert_eq!(bench.open(), [false, true, false, false]);
}

#[test]
fn dl_status_changes_are_told_once() {
    let mut bench = Bench::new();
    assert_eq!(bench.word(0x0210) & 4, 4, "the SII was loaded");
    bench.word(0x0110);
    assert_eq!(bench.word(0x0210) & 4, 0);
    bench.link(Port::A, true);
    assert_eq!(bench.word(0x0210) & 4, 4);
    assert_eq!(bench.byte(0x0111) & 3, 0b10, "the high byte alone takes the event, too");
    assert_eq!(bench.word(0x0210) & 4, 0);
}

// proves: HW-08 partial, HW-13 partial, HW-28 partial
#[test]
fn each_error_has_its_counter() {
    let mut bench = Bench::new();
    for port in Port::ALL {
        bench.link(port, true);
        for _ in 0..2 {
            count(&mut bench, port, CountKind::SymbolError);
        }
        count(&mut bench, port, CountKind::InvalidFrame);
        count(&mut bench, port, CountKind::ForwardedError);
        count(&mut bench, port, CountKind::LostLink);
    }
    count(&mut bench, Port::A, CountKind::ProcessingUnitError);
    assert_eq!(bench.read(0x0300, 8).unwrap(), [1, 2, 1, 2, 1, 2, 1, 2]);
    assert_eq!(bench.read(0x0308, 6).unwrap(), [1, 1, 1, 1, 1, 0]);
    assert_eq!(bench.read(0x0310, 4).unwrap(), [1; 4]);
}

// proves: HW-13 partial
#[test]
fn counters_stop_at_255_and_are_cleared_in_groups() {
    let set = |bench: &mut Bench| {
        for counter in ErrorCounter::ALL {
            bench.controller.set_counter(counter, 254);
        }
    };
    let mut bench = Bench::new();
    bench.link(Port::B, true);
    set(&mut bench);
    for _ in 0..3 {
        count(&mut bench, Port::B, CountKind::SymbolError);
        count(&mut bench, Port::A, CountKind::ProcessingUnitError);
        bench.pdi(|pdi| pdi.count_pdi_error());
    }
    assert_eq!(counter(&bench, ErrorCounter::PhysicalLayer(Port::B)), 255);
    assert_eq!(counter(&bench, ErrorCounter::ProcessingUnit), 255);
    assert_eq!(counter(&bench, ErrorCounter::Pdi), 255);

    // Any byte of a group clears the whole group and no other; any value does.
    let groups: [&[u16]; 4] = [
        &[0x0300, 0x0301, 0x0302, 0x0303, 0x0304, 0x0305, 0x0306, 0x0307, 0x0308, 0x030B],
        &[0x030C],
        &[0x030D],
        &[0x0310, 0x0311, 0x0312, 0x0313],
    ];
    for (group, addresses) in groups.iter().enumerate() {
        for address in *addresses {
            let mut bench = Bench::new();
            set(&mut bench);
            assert_eq!(bench.write(*address, &[0x5A]), 1);
            let counters = bench.read(0x0300, 0x14).unwrap();
            let zero = |range: std::ops::Range<usize>| counters[range].iter().all(|c| *c == 0);
            let cleared = [zero(0..0x0C), zero(0x0C..0x0D), zero(0x0D..0x0E), zero(0x10..0x14)];
            let expected: [bool; 4] = std::array::from_fn(|index| index == group);
            assert_eq!(cleared, expected, "0x{address:04X}");
        }
    }
}

#[test]
fn closed_ports_count_only_where_the_hardware_does() {
    let mut bench = Bench::new();
    bench.link(Port::A, true);
    for kind in [CountKind::SymbolError, CountKind::InvalidFrame, CountKind::ForwardedError] {
        count(&mut bench, Port::B, kind);
    }
    assert_eq!(bench.controller.error_counters().iter().map(|(_, value)| value).max(), Some(0));

    let mut hardware = hardware();
    hardware.counting.counts_when_closed = true;
    hardware.counting.forwarded = false;
    hardware.ports.0[3] = PortKind::Absent;
    let mut bench = Bench::with(hardware, sii(false), Box::new(NoFirmware));
    bench.link(Port::A, true);
    for port in [Port::B, Port::D] {
        for kind in [CountKind::SymbolError, CountKind::InvalidFrame, CountKind::ForwardedError] {
            count(&mut bench, port, kind);
        }
    }
    let mut expected = ErrorCounters::from_bytes(&[0; ErrorCounters::LEN], ErrorCounters::START);
    *expected.slot(ErrorCounter::PhysicalLayer(Port::B)) = Some(1);
    *expected.slot(ErrorCounter::InvalidFrame(Port::B)) = Some(1);
    assert_eq!(bench.controller.error_counters(), expected);
}

// proves: HW-08 partial
#[test]
fn a_lost_link_counts_once_and_only_where_the_loop_follows_it() {
    let lost = ErrorCounter::LostLink(Port::B);
    let mut bench = Bench::new();
    bench.link(Port::A, true);
    // mode, counts
    let table = [
        (LoopMode::Auto, true),
        (LoopMode::AutoClose, true),
        (LoopMode::Open, false),
        (LoopMode::Closed, false),
    ];
    for (mode, counts) in table {
        bench.link(Port::B, true);
        set_mode(&mut bench, Port::B, mode);
        bench.controller.set_counter(lost, 0);
        bench.link(Port::B, false);
        assert_eq!(counter(&bench, lost), u8::from(counts), "{mode}");
        bench.wait(Span::us(1));
        bench.link(Port::B, false);
        count(&mut bench, Port::B, CountKind::LostLink);
        assert_eq!(counter(&bench, lost), u8::from(counts), "{mode}: it is gone already");
    }
    // Posted twice for one instant, in either order.
    for link_first in [true, false] {
        set_mode(&mut bench, Port::B, LoopMode::Auto);
        bench.link(Port::B, true);
        bench.controller.set_counter(lost, 0);
        bench.wait(Span::us(1));
        let link = PortEvent::Link { port: Port::B, up: false };
        let count = PortEvent::Count { port: Port::B, kind: CountKind::LostLink };
        let events = if link_first { [link, count] } else { [count, link] };
        for event in events {
            bench.controller.post(bench.now, event);
        }
        bench.wait(Span::ZERO);
        assert_eq!(counter(&bench, lost), 1);
    }
}

#[test]
fn events_of_absent_ports_change_nothing() {
    let mut hardware = hardware();
    hardware.ports.0[3] = PortKind::Absent;
    let mut bench = Bench::with(hardware, sii(false), Box::new(NoFirmware));
    bench.link(Port::A, true);
    bench.link(Port::D, true);
    set_mode(&mut bench, Port::D, LoopMode::Open);
    assert_eq!(bench.open(), [true, false, false, false]);
    assert_eq!(status(&mut bench).port_state(Port::D), PortState::UNUSED);
}

#[test]
fn a_supply_that_returns_finds_only_later_events() {
    let mut bench = Bench::new();
    bench.link(Port::A, true);
    bench.controller.power_off(bench.now);
    let (early, late) = (bench.now + Span::ms(1), bench.now + Span::ms(3));
    bench.controller.post(early, PortEvent::Link { port: Port::B, up: true });
    bench.controller.post(late, PortEvent::Link { port: Port::C, up: true });
    bench.controller.power_on(bench.now + Span::ms(2));
    bench.wait(Span::ms(2));
    assert_eq!(bench.open(), [true, false, false, false]);
    bench.wait(Span::ms(1));
    assert_eq!(bench.open(), [false, false, true, false]);
}
