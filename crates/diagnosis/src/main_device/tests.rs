//! Frames made by hand, in the manner of each kind.

use linesman_proto::address::RegisterAddress;
use linesman_proto::frame::FrameView;
use linesman_proto::time::{Instant, Span};

use super::{Access, Certainty, Habits, MainDeviceKind};

const APRD: u8 = 1;
const APWR: u8 = 2;
const FPRD: u8 = 4;
const BRD: u8 = 7;
const BWR: u8 = 8;
const LRW: u8 = 12;
const FRMW: u8 = 14;

/// Command, index, ADP, ADO, data.
type Sent<'a> = (u8, u8, u16, u16, &'a [u8]);

struct Script {
    habits: Habits,
    source: [u8; 6],
    destination: [u8; 6],
    now: Instant,
}

impl Script {
    fn new(source: [u8; 6]) -> Self {
        let (habits, now) = (Habits::default(), Instant::ZERO);
        Self { habits, source, destination: [0xFF; 6], now }
    }

    fn send(&mut self, datagrams: &[Sent<'_>]) {
        let mut frame = [self.destination, self.source].concat();
        frame.extend([0x88, 0xA4, 0, 0]);
        for (no, (command, index, adp, ado, data)) in datagrams.iter().enumerate() {
            let more = if no + 1 < datagrams.len() { 0x8000 } else { 0 };
            frame.extend([*command, *index]);
            frame.extend(adp.to_le_bytes());
            frame.extend(ado.to_le_bytes());
            frame.extend((data.len() as u16 | more).to_le_bytes());
            frame.extend([0, 0]);
            frame.extend(*data);
            frame.extend([0, 0]);
        }
        let len = (frame.len() - 16) as u16 | 0x1000;
        frame[14..16].copy_from_slice(&len.to_le_bytes());
        frame.resize(frame.len().max(60), 0);
        self.habits.take(&FrameView::parse(&frame).unwrap(), self.now, true);
    }

    fn pause(&mut self, span: Span) {
        self.now += span;
    }

    fn kind(&self) -> (MainDeviceKind, Certainty) {
        let found = self.habits.recognised().unwrap();
        (found.kind, found.certainty)
    }
}

/// Process data every 2 ms in frames of one index for all datagrams, AL status of all every 50 ms.
fn like_soem(source: [u8; 6], station: u16) -> Script {
    let mut script = Script::new(source);
    for cycle in 0..500_u32 {
        let index = (cycle % 16) as u8;
        script.send(&[(LRW, index, 0, 0, &[0; 8]), (FRMW, index, station, 0x0910, &[0; 8])]);
        if cycle % 25 == 0 {
            script.send(&[(BRD, index, 0, 0x0130, &[0; 2])]);
        }
        script.pause(Span::ms(2));
    }
    script
}

#[test]
fn nothing_sent_is_nobody() {
    assert_eq!(Habits::default().recognised(), None);
    assert_eq!(Habits::default().never_reads().count(), 0);
}

#[test]
fn soem_is_recognised_without_its_start_up() {
    let script = like_soem([1; 6], 0x1001);
    assert_eq!(script.kind(), (MainDeviceKind::Soem, Certainty::Likely));
    assert_eq!(script.habits.recognised().unwrap().marks.len(), 3);
}

#[test]
fn one_mark_alone_is_a_guess_and_a_shared_one_is_none() {
    assert_eq!(like_soem([1; 6], 7).kind(), (MainDeviceKind::Soem, Certainty::Likely));
    assert_eq!(like_soem([0; 6], 7).kind(), (MainDeviceKind::Soem, Certainty::Perhaps));
    let mut script = Script::new([0; 6]);
    for station in 1001..1004 {
        script.send(&[(FPRD, 0, station, 0x0130, &[0; 2])]);
    }
    // TwinCAT, KickCAT and others begin there.
    assert_eq!(script.kind(), (MainDeviceKind::Unknown, Certainty::None));
}

#[test]
fn polls_have_their_interval_and_what_was_not_read_is_named() {
    let script = like_soem([1; 6], 0x1001);
    let polls = script.habits.polls(script.now);
    let found: Vec<_> =
        polls.iter().map(|poll| (poll.register.0, poll.access, poll.interval())).collect();
    let expected = [
        (0x0130, Access::Broadcast, Some(Span::ms(50))),
        (0x0910, Access::Distributed, Some(Span::ms(2))),
    ];
    assert_eq!(found, expected);
    let never: Vec<_> = script.habits.never_reads().map(|(register, _)| register.0).collect();
    assert_eq!(never, [0x0110, 0x0300, 0x0310]);
}

#[test]
fn reads_that_have_stopped_are_no_poll() {
    let mut script = like_soem([1; 6], 0x1001);
    for _ in 0..20 {
        script.send(&[(FPRD, 0, 0x1001, 0x0110, &[0; 2])]);
        script.pause(Span::ms(1));
    }
    let has_links = |script: &Script| {
        let polls = script.habits.polls(script.now);
        polls.iter().any(|poll| poll.register == RegisterAddress(0x0110))
    };
    assert!(has_links(&script));
    script.pause(Span::s(2));
    assert!(!has_links(&script));
}

#[test]
fn the_interval_is_that_of_one_sub_device_though_several_are_read() {
    let mut script = Script::new([0; 6]);
    for _ in 0..10 {
        for station in 0x1001..0x1005 {
            script.send(&[(FPRD, 0, station, 0x0300, &[0; 20])]);
            script.pause(Span::ms(10));
        }
    }
    let polls = script.habits.polls(script.now);
    assert_eq!(polls.len(), 1);
    assert_eq!(polls[0].interval(), Some(Span::ms(40)));
}

#[test]
fn igh_is_recognised_by_stations_from_1_and_its_clock_datagrams() {
    let mut script = Script::new([0x00, 0x0E, 0x0C, 1, 2, 3]);
    for position in 0..3_u16 {
        let station = (position + 1).to_le_bytes();
        script.send(&[(APWR, 0, 0_u16.wrapping_sub(position), 0x0010, &station)]);
    }
    assert_eq!(script.kind(), (MainDeviceKind::Igh, Certainty::Perhaps));
    for index in 0..100 {
        script.send(&[(LRW, index, 0, 0, &[0; 8]), (FRMW, index + 1, 1, 0x0910, &[0; 4])]);
    }
    assert_eq!(script.kind(), (MainDeviceKind::Igh, Certainty::Likely));
}

#[test]
fn twincat_is_recognised_by_its_cycle_and_the_counters_it_clears() {
    let mut script = Script::new([0x00, 0x0E, 0x0C, 1, 2, 3]);
    for cycle in 0..200_u32 {
        // Logical 0x01000000 and the states of the mailboxes at 0x09000000.
        script.send(&[
            (10, 0, 0, 0x0900, &[0; 1]),
            (LRW, cycle as u8, 0, 0x0100, &[0; 22]),
            (BRD, 0, 0, 0x0130, &[0; 2]),
        ]);
        if cycle % 50 == 0 {
            script.send(&[(FPRD, 0, 1001, 0x0300, &[0; 8]), (FPRD, 0, 1002, 0x0300, &[0; 8])]);
            script.send(&[(BWR, 0, 0, 0x0300, &[0; 8])]);
        }
        script.pause(Span::ms(2));
    }
    assert_eq!(script.kind(), (MainDeviceKind::Twincat, Certainty::Likely));
    let polls = script.habits.polls(script.now);
    let cleared = polls.iter().find(|poll| poll.access == Access::Cleared).unwrap();
    assert_eq!(cleared.interval(), Some(Span::ms(100)));
    let never: Vec<_> = script.habits.never_reads().map(|(register, _)| register.0).collect();
    assert_eq!(never, [0x0110, 0x0310]);
}

#[test]
fn kickcat_and_ethercrab_are_recognised_by_source_and_stations() {
    let mut kickcat = Script::new([0xCA, 0xDE, 0xCA, 0xDE, 0xDE, 0xFF]);
    kickcat.send(&[(BWR, 0, 0, 0x0600, &[0; 256])]);
    kickcat.send(&[(APWR, 0, 0, 0x0010, &1001_u16.to_le_bytes())]);
    assert_eq!(kickcat.kind(), (MainDeviceKind::Kickcat, Certainty::Likely));
    let mut ethercrab = Script::new([0x10; 6]);
    ethercrab.send(&[(APWR, 0, 0xFFFF, 0x0010, &0x1001_u16.to_le_bytes())]);
    assert_eq!(ethercrab.kind(), (MainDeviceKind::Ethercrab, Certainty::Likely));
}

#[test]
fn linesman_is_recognised_by_frames_numbered_over_two_bytes() {
    let mut script = Script::new([0x00, 0x0E, 0x0C, 1, 2, 3]);
    for number in 0..600_u16 {
        let [low, high] = number.to_le_bytes();
        script.send(&[(LRW, low, 0, 0, &[0; 8]), (FPRD, high, 0x1001, 0x0130, &[0; 2])]);
    }
    assert_eq!(script.kind(), (MainDeviceKind::Linesman, Certainty::Likely));
}

#[test]
fn a_second_sender_does_not_mix_with_the_main_device() {
    let mut script = like_soem([1; 6], 0x1001);
    script.source = [0x00, 0x0E, 0x0C, 1, 2, 3];
    for _ in 0..50 {
        script.send(&[(APRD, 200, 0, 0x0300, &[0; 8])]);
    }
    assert_eq!(script.kind(), (MainDeviceKind::Soem, Certainty::Likely));
}
