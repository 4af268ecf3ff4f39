//! Treatment of frames as such by the processing unit: source mark, event field, wrappings, foreign
//! and circulating frames, frames that end too early.

use linesman_proto::command::Command;
use linesman_proto::frame::FrameView;
use linesman_proto::port::Port;
use linesman_proto::register::{DlControl, ErrorCounter, LoopMode};

use super::rig::{Bench, answers, at, frame};
use crate::controller::Forwarding;
use crate::frame::WireFrame;

fn unit_errors(bench: &Bench) -> u8 {
    bench.controller.error_counters().value(ErrorCounter::ProcessingUnit).unwrap()
}

// proves: ESC-07 partial
#[test]
fn processed_frames_bear_the_source_mark_unless_told_otherwise() {
    let mut bench = Bench::new();
    let mut probe = frame(&[(Command::Brd, at(0, 0x0000), &[0])]);
    let _ = bench.pass(&mut probe);
    assert!(FrameView::parse(&probe.bytes).unwrap().source().is_marked());
    bench.write(0x0100, &[0]);
    let mut probe = frame(&[(Command::Brd, at(0, 0x0000), &[0])]);
    let _ = bench.pass(&mut probe);
    assert!(!FrameView::parse(&probe.bytes).unwrap().source().is_marked());
    assert_eq!(answers(&probe)[0].1, 1, "it is processed all the same");
}

#[test]
fn foreign_frames_end_here_unless_told_otherwise() {
    let mut bench = Bench::new();
    let foreign = || {
        let mut bytes = vec![0x11; 60];
        bytes[12..14].copy_from_slice(&[0x08, 0x06]);
        WireFrame { bytes, ..WireFrame::default() }
    };
    assert_eq!(bench.pass(&mut foreign()), Forwarding::Destroy);
    assert_eq!(unit_errors(&bench), 1);
    bench.write(0x0100, &[0]);
    let mut passed = foreign();
    assert_eq!(bench.pass(&mut passed), Forwarding::Forward);
    assert_eq!((passed.bytes, unit_errors(&bench)), (foreign().bytes, 1));
}

#[test]
fn other_ethercat_frames_pass_unprocessed() {
    let mut bench = Bench::new();
    for kind in [4, 5, 2] {
        let mut other = frame(&[(Command::Brd, at(0, 0x0000), &[0; 4])]);
        other.bytes[15] = other.bytes[15] & 0x0F | kind << 4;
        let datagram = other.bytes[16..].to_vec();
        assert_eq!(bench.pass(&mut other), Forwarding::Forward);
        assert_eq!(other.bytes[16..], datagram);
    }
    assert_eq!(unit_errors(&bench), 0);
}

#[test]
fn datagrams_are_found_behind_tags_and_in_udp() {
    let mut bench = Bench::new();
    let plain = frame(&[(Command::Brd, at(0, 0x0000), &[0])]);
    let (ethernet, ethercat) = plain.bytes.split_at(14);
    let mut tagged = plain.clone();
    tagged.bytes = [&ethernet[..12], &[0x81, 0x00, 0x20, 0x05, 0x88, 0xA4], ethercat].concat();
    let mut udp = plain.clone();
    let mut ip = [0; 20];
    (ip[0], ip[9]) = (0x45, 17);
    let udp_header = [0x12, 0x34, 0x88, 0xA4, 0, 40, 0xAB, 0xCD];
    udp.bytes = [&ethernet[..12], &[0x08, 0x00], &ip, &udp_header, ethercat].concat();
    for probe in [&mut tagged, &mut udp] {
        assert_eq!(bench.pass(probe), Forwarding::Forward);
        assert_eq!(answers(probe)[0], (vec![0x11], 1));
    }
    assert_eq!(udp.bytes[40..42], [0, 0], "the UDP checksum is dropped");
}

#[test]
fn datagrams_carry_masked_events_away() {
    let mut bench = Bench::new();
    let irq = |bench: &mut Bench, already: u16| {
        let mut probe = frame(&[(Command::Nop, at(0, 0), &[]), (Command::Fprd, at(9, 0), &[0])]);
        probe.bytes[24..26].copy_from_slice(&already.to_le_bytes());
        let _ = bench.pass(&mut probe);
        let view = FrameView::parse(&probe.bytes).unwrap();
        view.datagrams().map(|datagram| datagram.unwrap().irq()).collect::<Vec<_>>()
    };
    bench.link(Port::A, true);
    assert_eq!(irq(&mut bench, 0), [0, 0], "the mask is closed");
    bench.write(0x0200, &0x0004u16.to_le_bytes());
    assert_eq!(irq(&mut bench, 0x0100), [0x0104, 0x0004]);
    bench.word(0x0110);
    assert_eq!(irq(&mut bench, 0), [0, 0], "reading DL status takes the event");
}

/// A ring whose port A was lost: frames come round by other ports.
// proves: RED-04 partial
#[test]
fn frames_come_round_once() {
    let mut bench = Bench::new();
    bench.link(Port::B, true);
    assert!(bench.controller.port_zero_closes_ring());
    let mut probe =
        frame(&[(Command::Brd, at(0, 0x0000), &[0]), (Command::Brd, at(0, 0x0000), &[0])]);
    assert_eq!(bench.pass(&mut probe), Forwarding::Forward);
    let view = FrameView::parse(&probe.bytes).unwrap();
    assert!(view.datagrams().all(|datagram| datagram.unwrap().circulated()));
    assert_eq!(answers(&probe)[0].1, 1);

    let before = probe.bytes.clone();
    assert_eq!(bench.pass(&mut probe), Forwarding::Destroy);
    assert_eq!((unit_errors(&bench), &probe.bytes), (1, &before), "not processed again");
}

#[test]
fn a_port_closed_by_hand_or_in_use_lets_frames_circulate() {
    let mut bench = Bench::new();
    bench.link(Port::B, true);
    let by_hand = DlControl::RESET.with_loop_mode(Port::A, LoopMode::Closed);
    bench.write(0x0100, &by_hand.to_bytes());
    assert!(!bench.controller.port_zero_closes_ring());
    bench.write(0x0100, &DlControl::RESET.to_bytes());
    assert!(bench.controller.port_zero_closes_ring());
    bench.link(Port::A, true);
    assert!(!bench.controller.port_zero_closes_ring());

    let mut probe = frame(&[(Command::Brd, at(0, 0x0000), &[0])]);
    probe.bytes[16 + 7] |= 0x40;
    assert_eq!(bench.pass(&mut probe), Forwarding::Forward);
    assert_eq!(answers(&probe)[0].1, 1);
    bench.link(Port::B, false);
    bench.link(Port::A, false);
    assert!(!bench.controller.port_zero_closes_ring(), "port A is the way out when all is closed");
}

#[test]
fn a_frame_that_ends_before_its_datagrams_is_marked() {
    let mut bench = Bench::new();
    let mut probe = frame(&[
        (Command::Bwr, at(0, 0x0200), &[0xFF, 0xFF]),
        (Command::Bwr, at(0, 0x1000), &[7; 40]),
    ]);
    probe.bytes.truncate(16 + 14 + 10 + 20);
    assert_eq!(bench.pass(&mut probe), Forwarding::Forward);
    assert!(probe.damage.fcs_bad && probe.damage.marked);
    assert_eq!(unit_errors(&bench), 1);
    assert_eq!(bench.word(0x0200), 0, "registers are dropped");
    assert_eq!(bench.read(0x1000, 21).unwrap(), [vec![7; 20], vec![0]].concat(), "RAM is not");

    // More announced than there is: the last datagram lacks its successor.
    let mut probe = frame(&[(Command::Brd, at(0, 0x0000), &[0; 32])]);
    probe.bytes[16 + 7] |= 0x80;
    assert_eq!(bench.pass(&mut probe), Forwarding::Forward);
    assert!(probe.damage.marked);
    assert_eq!(unit_errors(&bench), 2);
}

#[test]
fn without_power_nothing_happens() {
    let mut bench = Bench::new();
    bench.link(Port::A, true);
    bench.controller.power_off(bench.now);
    assert_eq!(bench.open(), [false; 4]);
    let mut probe = frame(&[(Command::Brd, at(0, 0x0000), &[0])]);
    assert_eq!(bench.pass(&mut probe), Forwarding::Destroy);
    assert!(!bench.controller.is_powered());
}
