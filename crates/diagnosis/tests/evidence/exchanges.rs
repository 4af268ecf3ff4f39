//! Which frames belong together, on captures made by hand: both directions, one, none; numbers that
//! come twice, times that run backwards, frames cut off, damaged and wrapped.

use crate::support::script::{Datagram, Script, brd, fprd, fpwr, frame, lrw};
use crate::support::text;
use linesman_diagnosis::report::{FindingState, Verdict};
use linesman_diagnosis::{Direction, Engine, FrameSeen, Setup};
use linesman_proto::address::{Network, Path};
use linesman_proto::command::Command;
use linesman_proto::time::Instant;
use proptest::prelude::*;

#[test]
fn a_healthy_line_is_healthy() {
    let mut script = Script::scanned(3);
    for _ in 0..500 {
        script.exchange(&[lrw(0x0100_0000, 8, 3), brd(0x0130, &[8, 0], 3)]);
    }
    script.finish();
    let report = script.engine.diagnosis();
    assert_eq!(report.verdict, Verdict::Healthy, "{}", text(&report));
    assert_eq!(report.network.devices.0, 3);
    assert_eq!(report.network.datagrams.0, 1 + 3 + 9 + 1000);
    assert_eq!(report.network.unanswered.0, 0);
    assert_eq!(report.network.al_state_highest.as_deref(), Some("OP"));
}

// fires: X500
// silent: H100
#[test]
fn requests_alone_are_no_dead_line() {
    let mut script = Script::new();
    for _ in 0..3000 {
        script.vanish(&[lrw(0x0100_0000, 8, 0), fprd(0x1001, 0x0130, &[0, 0])]);
    }
    script.finish();
    let report = script.engine.diagnosis();
    assert_eq!(report.verdict, Verdict::Inconclusive, "{}", text(&report));
    assert_eq!(report.findings.len(), 1, "{}", text(&report));
    assert_eq!(report.findings[0].name, "one-direction");
    assert_eq!(report.network.datagrams.0, 6000);
}

#[test]
fn returns_alone_still_teach() {
    let mut script = Script::new();
    for _ in 0..100 {
        script.give_back(&[brd(0x0130, &[8, 0], 4), fprd(0x1001, 0x0130, &[8, 0])]);
        script.index += 2;
    }
    script.finish();
    let report = script.engine.diagnosis();
    assert_eq!(report.verdict, Verdict::Inconclusive, "{}", text(&report));
    assert_eq!(report.findings[0].name, "one-direction");
    assert_eq!(report.network.devices.0, 4);
    assert_eq!(report.network.al_state_highest.as_deref(), Some("OP"));
    assert_eq!((report.network.datagrams.0, report.network.unanswered.0), (200, 0));
}

// fires: H100
// silent: X500
#[test]
fn thousands_of_unanswered_requests_are_one_finding() {
    let mut script = Script::scanned(2);
    for _ in 0..5000 {
        script.vanish(&[brd(0x0130, &[0, 0], 0)]);
    }
    script.finish();
    let report = script.engine.diagnosis();
    assert_eq!(report.findings.len(), 1, "{}", text(&report));
    assert_eq!(report.findings[0].name, "nobody-answers");
    assert_eq!(report.network.unanswered.0, 5000);
    assert_eq!(report.network.lost.0, 5000);
}

#[test]
fn a_silence_that_ends_is_a_closed_finding() {
    let mut script = Script::scanned(2);
    for _ in 0..50 {
        script.vanish(&[brd(0x0130, &[0, 0], 0)]);
    }
    for _ in 0..50 {
        script.exchange(&[brd(0x0130, &[2, 0], 2)]);
    }
    script.finish();
    let report = script.engine.diagnosis();
    assert_eq!(report.verdict, Verdict::Faulty);
    let finding = &report.findings[0];
    assert_eq!(finding.name, "nobody-answers", "{}", text(&report));
    assert_eq!(finding.state, FindingState::Closed);
    assert!(finding.opened_ns < finding.closed_ns.unwrap());
}

/// Frames that are sent in a burst, some of which the recorder or the computer has lost: no cable opens and closes
/// within microseconds.
// silent: H100
#[test]
fn a_few_frames_of_a_burst_that_stay_away_are_no_open_link() {
    for lost in [3, 12] {
        let mut script = Script::scanned(2);
        for _ in 0..50 {
            script.exchange(&[brd(0x0130, &[2, 0], 2)]);
        }
        for _ in 0..lost {
            script.feed(
                &frame(&[brd(0x0130, &[0, 0], 0)], script.index, false),
                Direction::Unknown,
                2_000,
            );
            script.index = script.index.wrapping_add(1);
        }
        for _ in 0..200 {
            script.exchange(&[brd(0x0130, &[2, 0], 2)]);
        }
        script.finish();
        let report = script.engine.diagnosis();
        assert_eq!(report.network.lost.0, lost, "{}", text(&report));
        assert!(report.findings.iter().all(|one| one.code != "H100"), "{}", text(&report));
    }
}

#[test]
fn one_frame_without_return_at_the_end_is_no_fault() {
    let mut script = Script::scanned(2);
    script.vanish(&[brd(0x0130, &[0, 0], 0)]);
    script.finish();
    let report = script.engine.diagnosis();
    assert_eq!(report.verdict, Verdict::Inconclusive, "{}", text(&report));
    assert_eq!((report.network.unanswered.0, report.network.lost.0), (1, 0));
}

#[test]
fn the_same_request_again_was_not_answered_before() {
    let mut script = Script::new();
    // A MainDevice that tries again sends the same bytes, index and all.
    for _ in 0..4 {
        script.send(&[brd(0x0000, &[0, 0], 1)]);
    }
    script.give_back(&[brd(0x0000, &[0x11, 0], 1)]);
    script.finish();
    let report = script.engine.diagnosis();
    assert_eq!((report.network.datagrams.0, report.network.unanswered.0), (4, 3));
    assert_eq!(report.network.devices.0, 1);
}

#[test]
fn a_sender_whose_address_is_marked_from_the_start() {
    let mut script = Script::scanned(1);
    for round in 0..20_u8 {
        // Not even the datagram of an absent station changes on its way.
        for is_answered in [true, false] {
            let datagram = fprd(0x1001 + 5 * u16::from(!is_answered), 0x0000, &[0, 0]);
            let datagram = datagram.wkc(u16::from(is_answered));
            for is_back in [false, true] {
                let index = 100 + 2 * round + u8::from(is_answered);
                let mut bytes = frame(std::slice::from_ref(&datagram), index, is_back);
                bytes[6] = 0x02;
                script.feed(&bytes, Direction::Unknown, 50_000);
            }
        }
    }
    script.finish();
    let network = script.engine.diagnosis().network;
    assert_eq!((network.datagrams.0, network.unanswered.0), (1 + 1 + 3 + 40, 20));
    assert_eq!(network.lost.0, 0);
}

#[test]
fn frames_recorded_twice_count_once() {
    let mut script = Script::scanned(1);
    for _ in 0..50 {
        let datagrams = [fprd(0x1001, 0x0130, &[2, 0])];
        let (out, back) =
            (frame(&datagrams, script.index, false), frame(&datagrams, script.index, true));
        script.feed(&out, Direction::Unknown, 50_000);
        script.feed(&out, Direction::Unknown, 1_000);
        script.feed(&back, Direction::Unknown, 20_000);
        script.feed(&back, Direction::Unknown, 1_000);
        script.index += 1;
    }
    script.finish();
    let network = script.engine.diagnosis().network;
    assert_eq!((network.datagrams.0, network.unanswered.0), (1 + 1 + 3 + 50, 0));
}

#[test]
fn times_that_run_backwards_between_interfaces_decide_nothing() {
    let mut script = Script::scanned(2);
    script.now = 5_000_000_000;
    for _ in 0..300 {
        let datagrams = [brd(0x0130, &[2, 0], 2)];
        let (out, back) =
            (frame(&datagrams, script.index, false), frame(&datagrams, script.index, true));
        let now = script.now;
        script.feed(&out, Direction::Unknown, 50_000);
        // The clock of the other interface is three seconds behind.
        script.now -= 3_000_000_000;
        script.feed(&back, Direction::Unknown, 0);
        script.now = now + 100_000;
        script.index = script.index.wrapping_add(1);
    }
    script.finish();
    let report = script.engine.diagnosis();
    assert_eq!(report.verdict, Verdict::Healthy, "{}", text(&report));
    assert_eq!((report.network.datagrams.0, report.network.unanswered.0), (1 + 2 + 6 + 300, 0));
}

#[test]
fn eleven_datagrams_and_padding_in_the_length_field() {
    let mut script = Script::scanned(1);
    let many: Vec<_> = (0..11).map(|_| fprd(0x1001, 0x0130, &[2, 0])).collect();
    for is_back in [false, true] {
        script.feed(&frame(&many, 50, is_back), Direction::Unknown, 50_000);
    }
    for is_back in [false, true] {
        let mut short = frame(&[fprd(0x1001, 0x0130, &[2, 0])], 90, is_back);
        // 44 bytes: all that follows the EtherCAT header, padding included.
        short[14..16].copy_from_slice(&0x102C_u16.to_le_bytes());
        script.feed(&short, Direction::Unknown, 50_000);
    }
    script.finish();
    let network = script.engine.diagnosis().network;
    assert_eq!((network.datagrams.0, network.unanswered.0), (1 + 1 + 3 + 11 + 1, 0));
}

#[test]
fn tagged_frames_and_udp_are_the_same_line() {
    let mut script = Script::new();
    for is_back in [false, true] {
        let plain = frame(&[brd(0x0000, &[0x11, 0], 7)], 1, is_back);
        let mut tagged = plain[..12].to_vec();
        tagged.extend([0x81, 0x00, 0x20, 0x05]);
        tagged.extend(&plain[12..]);
        script.feed(&tagged, Direction::Unknown, 50_000);
    }
    for is_back in [false, true] {
        let plain = frame(&[brd(0x0000, &[0x11, 0], 8)], 2, is_back);
        let mut udp = plain[..12].to_vec();
        udp.extend([0x08, 0x00, 0x45, 0]);
        udp.extend([0; 7]);
        udp.push(17);
        udp.extend([0; 10]);
        udp.extend([0x88, 0xA4, 0x88, 0xA4, 0, 0, 0, 0]);
        udp.extend(&plain[14..]);
        script.feed(&udp, Direction::Unknown, 50_000);
    }
    script.finish();
    let network = script.engine.diagnosis().network;
    assert_eq!((network.datagrams.0, network.unanswered.0, network.devices.0), (2, 0, 8));
}

#[test]
fn a_damaged_return_teaches_nothing_and_its_request_is_lost() {
    let mut script = Script::scanned(1);
    let datagrams = [fprd(0x1001, 0x0130, &[0x08, 0])];
    script.send(&datagrams);
    let bytes = frame(&datagrams, script.index, true);
    script.engine.handle_frame(&FrameSeen {
        network: Network(0),
        path: None,
        direction: Direction::Unknown,
        time: Instant::from_nanos(script.now + 20_000),
        number: script.number + 1,
        fcs: Some(false),
        truncated: false,
        probe: None,
        bytes: &bytes,
    });
    script.index += 1;
    script.number += 1;
    for _ in 0..40 {
        script.exchange(&[fprd(0x1001, 0x0130, &[2, 0])]);
    }
    script.finish();
    let network = script.engine.diagnosis().network;
    assert_eq!(network.al_state_highest.as_deref(), Some("PREOP"));
    assert_eq!((network.unanswered.0, network.lost.0, network.damaged.0), (1, 1, 1));
}

#[test]
fn frames_cut_off_by_the_recorder_are_read_as_far_as_they_go() {
    let mut script = Script::scanned(2);
    for _ in 0..20 {
        let datagrams = [fprd(0x1001, 0x0130, &[2, 0]), lrw(0x0100_0000, 200, 3)];
        for is_back in [false, true] {
            let bytes = frame(&datagrams, script.index, is_back);
            script.number += 1;
            script.now += 50_000;
            script.engine.handle_frame(&FrameSeen {
                network: Network(0),
                path: None,
                direction: Direction::Unknown,
                time: Instant::from_nanos(script.now),
                number: script.number,
                fcs: None,
                probe: None,
                truncated: true,
                bytes: &bytes[..64],
            });
        }
        script.index = script.index.wrapping_add(2);
    }
    script.finish();
    let report = script.engine.diagnosis();
    assert_eq!(report.verdict, Verdict::Inconclusive, "{}", text(&report));
    // The second datagram of each is not there to be judged.
    assert_eq!((report.network.datagrams.0, report.network.unanswered.0), (1 + 2 + 6 + 20, 0));
}

// proves: RED-06 partial
#[test]
fn both_cards_of_a_ring_make_one_exchange() {
    let mut script = Script::new();
    script.is_live = true;
    for _ in 0..100 {
        // Whole ring: the copy of card A is processed by all, the other one by nobody.
        let processed = [brd(0x0130, &[8, 0], 5), lrw(0x0100_0000, 8, 6)];
        let untouched = [brd(0x0130, &[0, 0], 0), lrw(0x0100_0000, 8, 0)];
        script.path = Some(Path::A);
        script.send(&processed);
        script.path = Some(Path::B);
        script.now -= 79_999;
        script.send(&untouched);
        script.give_back(&processed);
        script.path = Some(Path::A);
        script.give_back(&untouched);
        script.index = script.index.wrapping_add(2);
    }
    for _ in 0..100 {
        // Broken behind the second device: each card's copy comes back to it.
        let halves = [
            (Path::A, [brd(0x0130, &[8, 0], 2), lrw(0x0100_0000, 8, 2)]),
            (Path::B, [brd(0x0130, &[8, 0], 3), lrw(0x0100_0000, 8, 4)]),
        ];
        for (path, datagrams) in &halves {
            script.path = Some(*path);
            script.send(datagrams);
            script.now -= 79_999;
        }
        for (path, datagrams) in &halves {
            script.path = Some(*path);
            script.give_back(datagrams);
        }
        script.index = script.index.wrapping_add(2);
    }
    script.finish();
    let report = script.engine.diagnosis();
    assert_eq!((report.network.datagrams.0, report.network.unanswered.0), (400, 0));
    assert_eq!(report.network.devices.0, 5);
    assert_eq!(report.findings.len(), 0, "{}", text(&report));
}

#[test]
fn a_long_frame_that_is_noted_late_is_not_lost() {
    for (each_ns, lost) in [(5_000, 0), (100_000, 1)] {
        let mut script = Script::scanned(2);
        let long = [lrw(0x0100_0000, 1400, 3)];
        let index = script.index;
        script.vanish(&long);
        for _ in 0..20 {
            script.exchange(&[fprd(0x1001, 0x0130, &[2, 0])]);
            script.now -= 100_000 - each_ns;
        }
        script.feed(&frame(&long, index, true), Direction::Unknown, 5_000);
        script.finish();
        let network = script.engine.diagnosis().network;
        assert_eq!(network.lost.0, lost, "{each_ns} ns from one to the next");
    }
}

/// What the second card sends of a request that is for the first one alone.
fn void(datagram: &Datagram) -> Datagram {
    Datagram { command: Command::Nop, ..datagram.clone() }
}

// silent: H100
#[test]
fn copies_that_carry_nothing_may_vanish() {
    let mut script = Script::new();
    script.is_live = true;
    for _ in 0..100 {
        // The ring is opened at the second card: what that one sends never comes back.
        let asked = brd(0x0130, &[8, 0], 5);
        let first = script.index;
        for _ in 0..5 {
            for (path, datagram) in [(Path::A, asked.clone()), (Path::B, void(&asked))] {
                script.path = Some(path);
                script.send(&[datagram]);
                script.now -= 79_999;
            }
            script.index = script.index.wrapping_add(1);
        }
        let next = std::mem::replace(&mut script.index, first);
        script.path = Some(Path::A);
        while script.index != next {
            script.give_back(std::slice::from_ref(&asked));
            script.index = script.index.wrapping_add(1);
        }
    }
    script.finish();
    let report = script.engine.diagnosis();
    assert_eq!(report.findings.len(), 0, "{}", text(&report));
    assert_eq!((report.network.lost.0, report.network.unanswered.0), (0, 0));
}

/// Copies that did not come to either card while all processed ones came to card B, and those to card A only where
/// `is_whole` says so.
fn copies_lost(cycles: u32, is_whole: impl Fn(u32) -> bool) -> [u64; 2] {
    let mut script = Script::new();
    script.is_live = true;
    for cycle in 0..cycles {
        let processed = [lrw(0x0100_0000, 8, 6)];
        let untouched = [lrw(0x0100_0000, 8, 0)];
        for (path, back) in [(Path::A, 80_000), (Path::B, 79_999)] {
            script.path = Some(path);
            script.now -= 80_000 - back;
            script.send(&processed);
        }
        script.path = Some(Path::B);
        script.give_back(&processed);
        script.path = Some(Path::A);
        if is_whole(cycle) {
            script.give_back(&untouched);
        }
        script.index = script.index.wrapping_add(1);
    }
    let model = script.engine.model(Network(0)).unwrap();
    Path::ALL.map(|card| model.traffic.losses.copies(card).sum)
}

#[test]
fn a_single_copy_that_is_lost_in_a_whole_ring_is_counted_at_its_card() {
    // From cycle 150 on the ring is open: copies are lost, but no single ones.
    assert_eq!(copies_lost(200, |cycle| cycle != 100 && cycle < 150), [1, 0]);
}

#[test]
fn copies_that_are_lost_in_a_burst_are_counted_when_the_ring_proves_whole_again() {
    assert_eq!(copies_lost(250, |cycle| !(150..190).contains(&cycle)), [40, 0]);
    assert_eq!(copies_lost(250, |cycle| cycle < 150), [0, 0], "it stays open");
}

/// In a whole ring nobody processes what the second card sends: it asks by it alone to see which way frames come back.
#[test]
fn look_by_the_second_card_alone_is_not_unanswered() {
    let mut script = Script::new();
    script.is_live = true;
    let asked = brd(0x0130, &[8, 0], 4);
    let untouched = |datagram: &Datagram| Datagram { passed: 0, ..datagram.clone().wkc(0) };
    for _ in 0..200 {
        for (first, second) in [(asked.clone(), void(&asked)), (void(&asked), asked.clone())] {
            for (path, datagram) in [(Path::A, &first), (Path::B, &second)] {
                script.path = Some(path);
                script.send(std::slice::from_ref(datagram));
                script.now -= 79_999;
            }
            // What card A has sent comes to card B, processed, and the other way round.
            script.path = Some(Path::A);
            script.give_back(&[untouched(&second)]);
            script.path = Some(Path::B);
            let is_void = first.command == Command::Nop;
            script.give_back(&[if is_void { untouched(&first) } else { first.clone() }]);
            script.index = script.index.wrapping_add(1);
        }
    }
    script.finish();
    let report = script.engine.diagnosis();
    assert_eq!(
        (report.network.devices.0, report.network.unanswered.0),
        (4, 0),
        "{}",
        text(&report)
    );
    assert!(!text(&report).contains("answered the last broadcast"), "{}", text(&report));
}

#[test]
fn a_write_that_nobody_takes_is_unanswered_but_an_empty_mailbox_is_not() {
    let mut script = Script::scanned(1);
    script.exchange(&[fprd(0x1001, 0x1080, &[0; 16]).wkc(0)]);
    script.exchange(&[fpwr(0x1009, 0x0120, &[1, 0]).wkc(0)]);
    script.finish();
    let network = script.engine.diagnosis().network;
    assert_eq!((network.datagrams.0, network.unanswered.0), (1 + 1 + 3 + 2, 1));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    /// Whatever bytes come: no panic, and no memory that grows with them.
    #[test]
    fn any_frames_are_survived(
        frames in proptest::collection::vec(
            (proptest::collection::vec(any::<u8>(), 0..120), any::<u64>(), 0u8..3, any::<bool>()),
            1..60,
        ),
        is_ethercat in any::<bool>(),
    ) {
        let mut engine = Engine::new(Setup { probes: true, ..Setup::default() });
        for (number, (mut bytes, time, direction, is_marked)) in frames.into_iter().enumerate() {
            if is_ethercat && bytes.len() > 20 {
                bytes[12..14].copy_from_slice(&[0x88, 0xA4]);
                bytes[15] = 0x10;
                bytes[16] %= 15;
                bytes[6] = if is_marked { 2 } else { 0 };
            }
            engine.handle_frame(&FrameSeen {
                network: Network(0),
                path: None,
                direction: match direction {
                    0 => Direction::Sent,
                    1 => Direction::Received,
                    _ => Direction::Unknown,
                },
                time: Instant::from_nanos(time),
                number: number as u64,
                fcs: None,
                truncated: false,
                probe: None,
                bytes: &bytes,
            });
        }
        engine.finish(Instant::default(), true);
        let model = engine.model(Network(0)).unwrap();
        prop_assert!(model.devices.len() <= 4096 && model.cyclic.len() <= 256);
        let report = engine.diagnosis();
        prop_assert!(report.network.unanswered <= report.network.datagrams);
    }
}
