//! Effects of a damaged frame: RAM that it has already written, and nothing else.

use linesman_proto::address::{LogicalAddress, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::register::{AlEvents, FmmuConfig, SmControl};
use linesman_proto::time::Span;

use super::rig::{Bench, Datagram, answers, at, frame, logical};
use crate::controller::Forwarding;
use crate::frame::Damage;

const SPOILED: [Damage; 3] = [
    Damage { fcs_bad: true, marked: false, cut_off: false },
    Damage { fcs_bad: true, marked: true, cut_off: false },
    Damage { fcs_bad: false, marked: false, cut_off: true },
];

fn spoil(bench: &mut Bench, damage: Damage, datagrams: &[Datagram<'_>]) -> Vec<(Vec<u8>, u16)> {
    let mut frame = frame(datagrams);
    frame.damage = damage;
    assert_eq!(bench.pass(&mut frame), Forwarding::Forward);
    assert_eq!(frame.damage, damage);
    answers(&frame)
}

#[test]
fn registers_are_dropped_and_ram_is_kept() {
    for damage in SPOILED {
        let mut bench = Bench::new();
        let answers = spoil(
            &mut bench,
            damage,
            &[
                (Command::Bwr, at(0, 0x0200), &[0x55, 0]),
                (Command::Bwr, at(0, 0x0F00), &[0x55]),
                (Command::Bwr, at(0, 0x0F80), &[0x66]),
                (Command::Bwr, at(0, 0x1000), &[0x77]),
                (Command::Brd, at(0, 0x0000), &[0]),
                (Command::Bwr, at(0, 0x0120), &[2, 0]),
            ],
        );
        assert!(answers.iter().all(|answer| answer.1 == 1), "on the fly it counts all the same");
        assert_eq!(answers[4].0, [0x11]);
        assert_eq!(bench.word(0x0200), 0);
        assert_eq!(bench.byte(0x0F00), 0);
        assert_eq!(bench.byte(0x0F80), 0x66);
        assert_eq!(bench.byte(0x1000), 0x77);
        assert_eq!(bench.word(0x0120), 1);
        assert!(bench.pdi(|pdi| pdi.events()).is_empty());
        assert_eq!(bench.controller.error_counters().processing_unit, Some(0), "the wire counts");
    }
}

#[test]
fn buffers_are_not_swapped_and_watchdogs_not_triggered() {
    for damage in SPOILED {
        let mut bench = Bench::new();
        bench.guard(2, 0x1000, 4, SmControl::OUTPUTS);
        bench.guard(0, 0x1100, 4, SmControl::MAILBOX_OUT);
        bench.guard(1, 0x1180, 4, SmControl::MAILBOX_IN);
        bench.map(0, &FmmuConfig::outputs(LogicalAddress(0), 4, RegisterAddress(0x1000)));
        assert!(bench.pdi(|pdi| pdi.write_sync_manager(1, &[9])));
        assert_eq!(bench.exchange(Command::Lwr, logical(0), &[1; 4]).1, 1);
        bench.wait(Span::ms(50));
        let outputs = (Command::Lwr, logical(0), &[2; 4][..]);
        let mailbox = (Command::Bwr, at(0, 0x1100), &[3; 4][..]);
        let read = (Command::Brd, at(0, 0x1180), &[0; 4][..]);
        let answers = spoil(&mut bench, damage, &[outputs, mailbox, read]);
        assert!(answers.iter().all(|answer| answer.1 == 1));
        assert_eq!(answers[2].0[0], 9);

        let outputs = bench.pdi(|pdi| {
            let mut buffer = [0; 4];
            pdi.read_sync_manager(2, &mut buffer).map(|_| buffer)
        });
        assert_eq!(outputs, Some([1; 4]), "the old outputs stand");
        assert!(!bench.pdi(|pdi| pdi.mailbox_full(0)), "nothing arrived");
        assert!(bench.pdi(|pdi| pdi.mailbox_full(1)), "nothing was taken");
        let events = bench.pdi(|pdi| pdi.events());
        assert!(!events.contains(AlEvents::sync_manager(0)));
        bench.wait(Span::ms(51));
        assert_eq!(bench.word(0x0440), 0, "the watchdog ran out in spite of the spoiled frame");
        assert_eq!(bench.write(0x1100, &[4; 4]), 1, "the mailbox takes the next message");
        assert_eq!(bench.read(0x1180, 4).unwrap()[0], 9, "the message is there again");
    }
}

#[test]
fn an_open_access_survives_a_spoiled_end() {
    let mut bench = Bench::new();
    bench.guard(0, 0x1100, 4, SmControl::MAILBOX_OUT);
    assert_eq!(bench.write(0x1100, &[1, 2]), 1);
    let end = (Command::Bwr, at(0, 0x1102), &[3, 4][..]);
    spoil(&mut bench, SPOILED[0], &[end]);
    assert!(!bench.pdi(|pdi| pdi.mailbox_full(0)));
    assert_eq!(bench.write(0x1103, &[5]), 1, "the access is still open");
    assert!(bench.pdi(|pdi| pdi.mailbox_full(0)));
    // And one that began in a spoiled frame never began.
    bench.pdi(|pdi| pdi.read_sync_manager(0, &mut [0; 4]));
    spoil(&mut bench, SPOILED[0], &[(Command::Bwr, at(0, 0x1100), &[1, 2])]);
    assert_eq!(bench.write(0x1103, &[5]), 0);
}

#[test]
fn latches_and_events_need_a_good_frame() {
    for damage in SPOILED {
        let mut bench = Bench::new();
        bench.link(linesman_proto::port::Port::A, true);
        let before = bench.read(0x0900, 4).unwrap();
        let latch = (Command::Bwr, at(0, 0x0900), &[0; 4][..]);
        let status = (Command::Brd, at(0, 0x0110), &[0; 2][..]);
        spoil(&mut bench, damage, &[latch, status]);
        assert_eq!(bench.read(0x0900, 4).unwrap(), before);
        assert_eq!(bench.word(0x0210) & 4, 4, "the event was not taken");
    }
}

// proves: FRM-15 partial
#[test]
fn a_cut_ends_execution_where_it_is() {
    let whole = frame(&[
        (Command::Bwr, at(0, 0x1000), &[7; 20]),
        (Command::Bwr, at(0, 0x1100), &[8; 20]),
        (Command::Brd, at(0, 0x1000), &[0; 20]),
    ]);
    // Where the second datagram's data begin.
    let second = 16 + 32 + 10;
    for len in 13..whole.bytes.len() {
        let mut bench = Bench::new();
        let mut cut = whole.clone();
        cut.bytes.truncate(len);
        cut.damage.cut_off = true;
        let verdict = bench.pass(&mut cut);
        assert_eq!(cut.bytes.len(), len);
        // Without an EtherType it is not even EtherCAT.
        let expected = if len < 14 { Forwarding::Destroy } else { Forwarding::Forward };
        assert_eq!(verdict, expected, "cut at {len}");
        let written = |start: usize| len.saturating_sub(start).min(20);
        let ram = |bench: &mut Bench, ado| bench.read(ado, 20).unwrap();
        let first = ram(&mut bench, 0x1000).iter().filter(|byte| **byte == 7).count();
        let then = ram(&mut bench, 0x1100).iter().filter(|byte| **byte == 8).count();
        assert_eq!((first, then), (written(26), written(second)), "cut at {len}");
        if len >= second + 22 {
            assert_eq!(cut.bytes[second + 20..second + 22], [1, 0], "cut at {len}");
        }
    }
}
